//! A design: what is known at present and the experiment that is open, as a problem; what was
//! found, as the answer.

mod excite;
mod report;
mod sample;
mod subject;

pub use subject::PastResult;

use crate::job::design::Design;
use crate::job::spec::design::{DesignSpec, Plan};
use crate::model::Model;
use crate::parsing::fault::Fault;
use crate::uncertainty::design::Present;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use subject::Subject;

/// Looks for the next experiment; where `stop` is raised meanwhile, the best so far is the answer.
/// Answers nothing when it was raised before there was any.
///
/// # Errors
/// What keeps the experiment or those of the past from being looked at, with JSON pointers.
pub fn design(
    spec: &DesignSpec,
    model: &Arc<Model>,
    past: Option<PastResult<'_>>,
    stop: &AtomicBool,
) -> Result<Option<Design>, Vec<Fault>> {
    let subject = Subject::new(spec, model, past)?;
    if !subject.check_cost(spec, stop)? {
        return Ok(None);
    }
    let present = Present::new(
        &subject.next,
        &subject.positions,
        subject.wanted.clone(),
        subject.past.as_ref(),
        stop,
    );
    let Some(present) = subject::simulated(present, "/job")? else {
        return Ok(None);
    };
    match &spec.plan {
        Plan::Excite(plan) => {
            let present = present.spread(&subject.next, spec.points, spec.seed);
            Ok(excite::best(spec, plan, (&subject, &present), stop))
        }
        Plan::Sample(plan) => sample::best(spec, plan, (&subject, present), stop),
    }
}

#[cfg(test)]
mod tests;
