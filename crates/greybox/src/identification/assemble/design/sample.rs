//! When a plant that nothing drives is measured best.

use super::report::{self, Candidate};
use super::subject::{Subject, simulated};
use crate::estimation::problem::Experiment;
use crate::identification::design::Design;
use crate::identification::spec::design::{DesignSpec, InstantsPlan};
use crate::uncertainty::design::instants::{Candidates, Choice};
use crate::uncertainty::design::{Excitation, Present};
use greybox_numerics::parsing::fault::Fault;
use std::sync::atomic::AtomicBool;

/// The best instants; nothing where `stop` was raised before there were any.
pub(super) fn best(
    spec: &DesignSpec,
    plan: &InstantsPlan,
    (subject, present): (&Subject, Present),
    stop: &AtomicBool,
) -> Result<Option<Design>, Vec<Fault>> {
    let instants = instants(plan);
    let experiment = experiment(spec, subject, &instants);
    let place = |instant: &f64| instants.partition_point(|own| own < instant);
    let measured: Vec<usize> = plan.measured.iter().map(place).collect();
    let present = present.measured(&subject.next, experiment.clone(), &measured, stop);
    let Some(present) = simulated(present, "/instants")? else {
        return Ok(None);
    };
    let present = present.spread(&subject.next, spec.points, spec.seed);
    let seen = Candidates::new(&present, &subject.next, experiment, stop);
    let choice = Choice {
        among: plan.candidates.iter().map(place).collect(),
        count: plan.count,
        may_repeat: plan.may_repeat,
    };
    let Some(chosen) = seen.and_then(|seen| seen.choose(&present, &choice, stop)) else {
        return Ok(None);
    };
    let best = Candidate {
        name: "instants".to_owned(),
        excitation: Excitation::Instants {
            instants_s: chosen.samples.iter().map(|at| instants[*at]).collect(),
        },
        inputs: Vec::new(),
        assessment: chosen.assessment,
    };
    let told = (choice.among.len(), chosen.is_finished);
    Ok(report::design(spec, (subject, &present), &[best], told))
}

/// All instants that are simulated: the start, and each that may be measured.
fn instants(plan: &InstantsPlan) -> Vec<f64> {
    let all = plan.candidates.iter().chain(&plan.measured).copied();
    let mut instants: Vec<f64> = all.chain([0.0]).collect();
    instants.sort_by(f64::total_cmp);
    instants.dedup();
    instants
}

/// The experiment that measures at all of them.
fn experiment(spec: &DesignSpec, subject: &Subject, instants: &[f64]) -> Experiment {
    let last = instants.last().copied().unwrap_or_default();
    let shape = (instants.len(), last / instants.len() as f64);
    subject.experiment(spec, shape, Some(instants.to_vec()), (0, Vec::new()))
}
