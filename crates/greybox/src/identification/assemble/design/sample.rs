//! When a plant that nothing drives is measured best.

use super::problem::{Course, Question, simulated};
use super::report::{self, AssessedExperiment, Ranking};
use crate::estimation::problem::Experiment;
use crate::identification::design::Design;
use crate::identification::spec::design::InstantsPlan;
use crate::uncertainty::design::Excitation;
use crate::uncertainty::design::instants::{Candidates, Choice};
use greybox_numerics::parsing::fault::Fault;
use std::sync::atomic::AtomicBool;

/// The best instants; nothing where `stop` was raised before there were any.
pub(super) fn best(
    question: Question<'_>,
    plan: &InstantsPlan,
    stop: &AtomicBool,
) -> Result<Option<Design>, Vec<Fault>> {
    let (spec, problem) = (question.spec, question.problem);
    let instants = instants(plan);
    let experiment = experiment(question, &instants);
    let index_of = |instant: &f64| instants.partition_point(|earlier| earlier < instant);
    let measured: Vec<usize> = plan.measured.iter().map(index_of).collect();
    let present = question.present.clone();
    let present = present.measured(&problem.next, experiment.clone(), &measured, stop);
    let Some(present) = simulated(present, "/instants")? else {
        return Ok(None);
    };
    let present = present.spread(&problem.next, spec.points, spec.seed);
    let candidates = Candidates::new(&present, &problem.next, experiment, stop);
    let choice = Choice {
        among: plan.candidates.iter().map(index_of).collect(),
        count: plan.count,
        may_repeat: plan.may_repeat,
    };
    let chosen = candidates.and_then(|candidates| candidates.choose(&present, &choice, stop));
    let Some(chosen) = chosen else {
        return Ok(None);
    };
    let best = AssessedExperiment {
        name: "instants".to_owned(),
        excitation: Excitation::Instants {
            instants_s: chosen
                .samples
                .iter()
                .map(|index| instants[*index])
                .collect(),
        },
        inputs: Vec::new(),
        assessment: chosen.assessment,
    };
    let ranking = Ranking {
        candidates: vec![best],
        assessed: choice.among.len(),
        finished: chosen.is_finished,
    };
    let question = Question {
        present: &present,
        ..question
    };
    Ok(report::design(question, &ranking))
}

/// All instants that are simulated: the start, and each that may be measured.
fn instants(plan: &InstantsPlan) -> Vec<f64> {
    let all = plan.candidates.iter().chain(&plan.measured).copied();
    let mut instants: Vec<f64> = all.chain([0.0]).collect();
    instants.sort_by(f64::total_cmp);
    instants.dedup();
    instants
}

/// The experiment that measures at all instants.
fn experiment(question: Question<'_>, instants: &[f64]) -> Experiment {
    let last = instants.last().copied().unwrap_or_default();
    let course = Course {
        samples: instants.len(),
        sample_time: last / instants.len() as f64,
        instants: Some(instants.to_vec()),
        input_set: 0,
        inputs: Vec::new(),
    };
    question.problem.experiment(question.spec, course)
}
