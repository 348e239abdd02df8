//! What can be said of a job before it runs.

use super::experiment::signal_pointer;
use super::{Assembly, Finding};
use crate::estimation::{Settings, trajectory};
use greybox_numerics::statistics;
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;
use utoipa::ToSchema;

/// What a job will come to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Preflight {
    /// Numbers that are estimated: parameters and initial states.
    pub unknowns: u64,
    /// Measured samples that they are estimated from.
    pub residuals: u64,
    /// Candidates that are judged in the search at the most.
    pub evaluations: u64,
    /// Derivatives that one candidate takes, at the middle of the search box.
    pub derivatives_per_evaluation: u64,
    /// Findings that the job's user should know.
    pub findings: Vec<Finding>,
}

/// The step of a candidate against its sample time beyond which the recording is too coarse to
/// show its fastest mode: Nyquist's limit, π radians a sample.
const NYQUIST: f64 = std::f64::consts::PI;

/// Says what an assembled job will come to. When `stop` was raised before its work was counted
/// that is 0.
#[must_use]
pub fn preflight(assembly: &Assembly, settings: &Settings, stop: &AtomicBool) -> Preflight {
    let problem = &assembly.problem;
    let middle = vec![0.5; problem.coordinates.len()];
    Preflight {
        unknowns: problem.coordinates.len() as u64,
        residuals: problem.n_residuals() as u64,
        evaluations: u64::from(settings.population) * u64::from(settings.generations),
        derivatives_per_evaluation: trajectory::derivatives(problem, &middle, stop).unwrap_or(0),
        findings: findings(assembly),
    }
}

/// What the user of an assembled job should know of it.
#[must_use]
pub fn findings(assembly: &Assembly) -> Vec<Finding> {
    let problem = &assembly.problem;
    let middle = vec![0.5; problem.coordinates.len()];
    let rate = problem.fastest_rate(&middle);
    let mut findings = assembly.findings.clone();
    for (index, experiment) in problem.experiments.iter().enumerate() {
        let pointer = format!("/experiments/{index}");
        if rate * experiment.sample_time > NYQUIST {
            let detail = format!(
                "the plant's fastest mode ({:.0} Hz at the middle of the search box) lies above \
                 half the sampling rate ({:.0} Hz): it is simulated, but the recording shows it \
                 only through what it leaves at the samples",
                rate / (2.0 * NYQUIST),
                0.5 / experiment.sample_time
            );
            findings.push(Finding::new(
                "sampled_below_fastest_mode",
                &pointer,
                &detail,
            ));
        }
        for (input, values) in experiment.inputs.iter().enumerate() {
            let name = &problem.model.description().input_sets[experiment.input_set][input];
            if statistics::range(values).is_some_and(|(low, high)| low == high) {
                let detail = format!("the input `{name}` never changes: it excites nothing");
                let pointer = signal_pointer(&pointer, name);
                findings.push(Finding::new("input_constant", &pointer, &detail));
            }
        }
    }
    findings
}
