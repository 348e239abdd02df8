//! A design: from what is known at present and the experiment that is open to the best experiment.

mod assessments;
mod excite;
mod problem;
mod report;
mod sample;

pub use assessments::Assessments;
pub use problem::PastResult;
pub(super) use problem::simulated;
pub(super) use report::predicted;

use crate::identification::design::Design;
use crate::identification::spec::design::{DesignSpec, Plan};
use crate::uncertainty::design::Present;
use crate::uncertainty::design::search::Family;
use assessments::Pass;
use greybox_numerics::parsing::fault::Fault;
use greybox_simulation::model::Model;
use problem::{DesignProblem, Question};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Derivatives that one experiment may take while a client waits.
pub const COST_WHILE_WAITING: f64 = super::forecast::BUDGET;
/// Derivatives that one experiment may take in a job of its own.
pub const COST_OF_JOB: f64 = 2e10;

/// Looks for the next experiment; where `stop` is raised meanwhile, the best so far is the answer.
/// Answers nothing when `stop` was raised before there was any.
///
/// # Errors
/// What keeps the experiment or those of the past from being looked at, with JSON pointers.
pub fn design(
    spec: DesignSpec,
    model: &Arc<Model>,
    past: Option<PastResult<'_>>,
    stop: &AtomicBool,
) -> Result<Option<Design>, Vec<Fault>> {
    let Some(designing) = Designing::begin(spec, model, past, COST_WHILE_WAITING, stop)? else {
        return Ok(None);
    };
    designing.go_on(&mut Assessments::default(), usize::MAX, stop)
}

/// Says what speaks against a design before it begins, one experiment of which may take so many
/// derivatives; whether `stop` was not raised meanwhile.
///
/// # Errors
/// What keeps the experiment or those of the past from being looked at, with JSON pointers.
pub fn check_design(
    spec: &DesignSpec,
    model: &Arc<Model>,
    past: Option<PastResult<'_>>,
    most_derivatives: f64,
    stop: &AtomicBool,
) -> Result<bool, Vec<Fault>> {
    DesignProblem::new(spec, model, past)?.check_cost(spec, most_derivatives, stop)
}

/// A design at work: what is known at present, before which experiments are held.
pub struct Designing {
    spec: DesignSpec,
    problem: DesignProblem,
    present: Present,
}

impl Designing {
    /// Looks at what is known at present. Answers nothing when `stop` was raised.
    ///
    /// # Errors
    /// What keeps the experiment or those of the past from being looked at, with JSON pointers.
    pub fn begin(
        spec: DesignSpec,
        model: &Arc<Model>,
        past: Option<PastResult<'_>>,
        most_derivatives: f64,
        stop: &AtomicBool,
    ) -> Result<Option<Designing>, Vec<Fault>> {
        let problem = DesignProblem::new(&spec, model, past)?;
        if !problem.check_cost(&spec, most_derivatives, stop)? {
            return Ok(None);
        }
        let present = Present::new(
            &problem.next,
            &problem.positions,
            problem.wanted.clone(),
            problem.past.as_ref(),
            stop,
        );
        let Some(present) = problem::simulated(present, "/job")? else {
            return Ok(None);
        };
        let present = match &spec.plan {
            Plan::Excite(_) => present.spread(&problem.next, spec.points, spec.seed),
            Plan::Sample(_) => present,
        };
        Ok(Some(Designing {
            spec,
            problem,
            present,
        }))
    }

    /// The best experiment, after so many more than before were assessed; `finished` where no more
    /// are to be. Answers nothing when `stop` was raised before there was any.
    ///
    /// # Errors
    /// What keeps the experiment from being looked at, with JSON pointers.
    pub fn go_on(
        &self,
        assessments: &mut Assessments,
        more: usize,
        stop: &AtomicBool,
    ) -> Result<Option<Design>, Vec<Fault>> {
        let question = Question {
            spec: &self.spec,
            problem: &self.problem,
            present: &self.present,
        };
        match &self.spec.plan {
            Plan::Excite(plan) => {
                let pass = Pass::new(assessments, more);
                Ok(excite::best(question, plan, pass, stop))
            }
            Plan::Sample(plan) => sample::best(question, plan, stop),
        }
    }

    /// How many experiments are assessed at the most; instants are chosen in one piece.
    #[must_use]
    pub fn most_assessments(&self) -> usize {
        match &self.spec.plan {
            Plan::Excite(plan) => {
                let families = plan.families.iter().copied();
                let searched: usize = families.map(Family::most_assessments).sum();
                plan.proposals.len() + searched + self.spec.sensors.len()
            }
            Plan::Sample(_) => 1,
        }
    }
}

#[cfg(test)]
mod tests;
