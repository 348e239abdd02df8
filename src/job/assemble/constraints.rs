//! The conditions that parameters keep.

use crate::estimation::Problem;
use crate::estimation::feasible;
use crate::job::JobSpec;
use crate::model::ModelDescription;
use crate::model::document::Condition;
use crate::parsing::fault::Fault;

/// Those of a specification that exists, and can so be read.
pub(super) fn compiled(spec: &JobSpec, description: &ModelDescription) -> Vec<Condition> {
    let texts = spec.constraints.iter();
    let conditions = texts.filter_map(|text| Condition::compile(text, "", description).ok());
    conditions.flatten().collect()
}

/// They must leave something of the search ranges.
pub(super) fn check(problem: &Problem) -> Result<(), Vec<Fault>> {
    if problem.constraints.is_empty() || feasible::inside(problem).is_some() {
        return Ok(());
    }
    let texts = problem.constraints.iter();
    let texts: Vec<String> = texts.map(|own| format!("`{}`", own.text())).collect();
    let detail = format!(
        "no candidate within the search ranges was found that keeps {}",
        texts.join(" and ")
    );
    Err(vec![Fault::new("/constraints", "nothing_left", detail)])
}
