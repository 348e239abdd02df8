//! Searching a plant that drifts: the record cut into segments that start afresh.
//!
//! An axis without a spring integrates every error of its force: over a long record the free run
//! of almost every candidate drifts away, and a candidate that does not move at all beats one
//! that moves almost rightly. Where every state can be read off the measured outputs (a position
//! and its slope), the search therefore judges segments, each started from the measured state,
//! as multiple shooting does (H. G. Bock, "Recent advances in parameter identification
//! techniques for O.D.E.", 1983). The refinement, the estimate and its uncertainty are those of
//! the free run over the whole record.

use std::sync::Arc;

use super::problem::{Experiment, Problem};
use greybox_simulation::model::InitialState;

/// Segments that a record is cut into.
const SEGMENTS: usize = 50;
/// A segment has at least so many samples; shorter records are searched as a whole.
const SHORTEST_SEGMENT: usize = 50;
/// A slope is taken over this share of a segment to either side.
const SLOPE_SHARE: f64 = 0.02;

/// The problem cut into segments; none where a state cannot be read off the outputs.
#[must_use]
pub fn segmented(problem: &Problem) -> Option<Problem> {
    let states = &problem.model.description().states;
    let sources: Vec<Source> = states
        .iter()
        .map(|state| Source::of(problem, state.initial))
        .collect::<Option<_>>()?;
    let mut experiments = Vec::new();
    for experiment in problem.experiments.iter() {
        let length = (experiment.estimation_samples / SEGMENTS).max(SHORTEST_SEGMENT);
        let count = experiment.estimation_samples / length;
        let cut = |segment: usize| cut(experiment, segment * length, length, &sources);
        experiments.extend((0..count).filter_map(cut));
    }
    (experiments.len() > 1).then(|| Problem {
        experiments: Arc::new(experiments),
        ..problem.clone()
    })
}

/// Where a state's value at a sample is read off.
#[derive(Clone, Copy)]
enum Source {
    /// A measured output, by its place in the problem.
    Output(usize),
    /// The slope of one.
    Slope(usize),
}

impl Source {
    fn of(problem: &Problem, initial: InitialState) -> Option<Source> {
        let place = |output: usize| {
            problem
                .outputs
                .iter()
                .position(|measured| measured.index == output)
        };
        match initial {
            InitialState::Model => None,
            InitialState::EstimatedFromOutput { output } | InitialState::FirstSample { output } => {
                place(output).map(Source::Output)
            }
            InitialState::EstimatedFromSlope { output } => place(output).map(Source::Slope),
        }
    }

    fn read(self, experiment: &Experiment, sample: usize, reach: usize) -> f64 {
        match self {
            Source::Output(output) => experiment.measured[output][sample],
            Source::Slope(output) => {
                let from = sample.saturating_sub(reach);
                let to = (sample + reach).min(experiment.estimation_samples - 1);
                let values = &experiment.measured[output];
                (values[to] - values[from]) / (experiment.instant(to) - experiment.instant(from))
            }
        }
    }
}

/// One segment; none where the state at its first sample is not measured.
fn cut(
    experiment: &Experiment,
    from: usize,
    length: usize,
    sources: &[Source],
) -> Option<Experiment> {
    let reach = ((length as f64 * SLOPE_SHARE) as usize).max(1);
    let start: Vec<f64> = sources
        .iter()
        .map(|source| source.read(experiment, from, reach))
        .collect();
    if start.iter().any(|value| value.is_nan()) {
        return None;
    }
    Some(Experiment {
        initial_state: start.into_iter().map(Some).collect(),
        ..experiment.part(from, length)
    })
}
