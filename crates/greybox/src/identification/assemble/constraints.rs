//! The conditions that parameters keep.

use crate::estimation::{Problem, feasible};
use crate::identification::JobSpec;
use greybox_numerics::parsing::fault::Fault;
use greybox_simulation::model::ModelDescription;
use greybox_simulation::model::document::Condition;

/// Compiles the conditions of a specification that exists, and whose conditions can so be read.
pub(super) fn compiled(spec: &JobSpec, description: &ModelDescription) -> Vec<Condition> {
    let texts = spec.constraints.iter();
    let conditions = texts.filter_map(|text| Condition::compile(text, "", description).ok());
    conditions.flatten().collect()
}

/// Checks that the conditions leave something of the search ranges.
pub(super) fn check(problem: &Problem) -> Result<(), Vec<Fault>> {
    if problem.constraints.is_empty() || feasible::inside(problem).is_some() {
        return Ok(());
    }
    let texts = problem.constraints.iter();
    let texts: Vec<String> = texts
        .map(|constraint| format!("`{}`", constraint.text()))
        .collect();
    let detail = format!(
        "no candidate within the search ranges was found that keeps {}",
        texts.join(" and ")
    );
    Err(vec![Fault::new("/constraints", "nothing_left", detail)])
}
