//! Where experiments start that only validate.
//!
//! Nothing is estimated from such an experiment, so its start would be a guess, and the score would
//! be that of the guess. It is fitted to the first samples of the experiment, with all parameters as
//! they were estimated, and these samples count in no score.

use crate::estimation::problem::{Coordinate, Experiment, Problem, Target};
use crate::estimation::{refine, trajectory};
use greybox_simulation::Accuracy;
use greybox_simulation::model::Scale;
use greybox_simulation::single::Outputs;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The start is forgotten where a change of it shows in no output by more than this share of how
/// much it showed at most.
const FORGOTTEN: f64 = 0.02;
/// The share of its range that the start is moved by to see that.
const MOVED: f64 = 0.05;
/// The largest part of an experiment that its start is fitted to, where the job does not say.
const LARGEST_PART: usize = 4;
/// Samples for each unknown start at the least.
const FEWEST_SAMPLES: usize = 10;

/// The problem with the starts that experiments which only validate have at these positions.
/// Answers nothing when `stop` was raised.
#[must_use]
pub fn settled(problem: &Problem, positions: &[f64], stop: &AtomicBool) -> Option<Problem> {
    let mut problem = problem.clone();
    let experiments = Arc::clone(&problem.experiments);
    for (place, experiment) in experiments.iter().enumerate() {
        if experiment.unknown_starts.is_empty() {
            continue;
        }
        let alone = alone(&problem, place, positions);
        let length = match experiment.start_samples {
            Some(samples) => samples,
            None => forgotten_after(&alone, stop)?,
        };
        let length = length.clamp(1, experiment.samples - 1);
        let fitted = fitted(alone, length, stop)?;
        let settled = &mut Arc::make_mut(&mut problem.experiments)[place];
        settled.scored_from = length;
        for (unknown, start) in experiment
            .unknown_starts
            .iter()
            .zip(fitted.unwrap_or_default())
        {
            settled.initial_state[unknown.state] = Some(start);
        }
    }
    Some(problem)
}

/// The experiment alone, with nothing unknown but its start.
fn alone(problem: &Problem, place: usize, positions: &[f64]) -> Problem {
    let experiment = &problem.experiments[place];
    let filled = problem.fill(place, positions);
    let mut initial_state = filled.initial_state;
    let states = &problem.model.description().states;
    let coordinate = |unknown: &crate::estimation::problem::UnknownStart| {
        let state = &states[unknown.state];
        Coordinate {
            name: state.name.to_string(),
            quantity: state.name.to_string(),
            symbol: String::new(),
            unit: state.unit.to_string(),
            target: Target::InitialState {
                experiment: 0,
                state: unknown.state,
            },
            lower: unknown.lower,
            upper: unknown.upper,
            scale: Scale::Linear,
            start: None,
            prior: None,
        }
    };
    let coordinates = experiment.unknown_starts.iter().map(coordinate).collect();
    for unknown in &experiment.unknown_starts {
        initial_state[unknown.state] = None;
    }
    let experiment = Experiment {
        place: 0,
        estimation_samples: experiment.samples,
        initial_state,
        parameters: Vec::new(),
        ..experiment.clone()
    };
    Problem {
        parameters: filled.parameters,
        coordinates,
        experiments: Arc::new(vec![experiment]),
        assumptions: Arc::default(),
        joint_priors: Arc::default(),
        constraints: Arc::default(),
        ..problem.clone()
    }
}

/// After how many samples no output shows any more where the experiment started: a quarter of
/// them at the most.
fn forgotten_after(alone: &Problem, stop: &AtomicBool) -> Option<usize> {
    let n = alone.coordinates.len();
    let middle = trajectory::simulate(alone, &vec![0.5; n], stop)?;
    let moved = trajectory::simulate(alone, &vec![0.5 + MOVED; n], stop)?;
    let samples = alone.experiments[0].samples;
    let longest = samples / LARGEST_PART;
    let (Ok(middle), Ok(moved)) = (middle, moved) else {
        return Some(longest);
    };
    let last_of = |output: usize| last_difference(&middle[0], &moved[0], output);
    let outputs = alone.outputs.iter().map(|output| last_of(output.index));
    let last = outputs.max().unwrap_or(longest);
    Some(last.clamp((n * FEWEST_SAMPLES).min(longest), longest))
}

/// The last sample at which an output differs by a share of its largest difference.
fn last_difference(middle: &Outputs, moved: &Outputs, output: usize) -> usize {
    let pairs = middle[output].iter().zip(&moved[output]);
    let differences: Vec<f64> = pairs.map(|(a, b)| (a - b).abs()).collect();
    let largest = differences.iter().copied().fold(0.0, f64::max);
    let shows = |difference: &f64| *difference > FORGOTTEN * largest;
    differences
        .iter()
        .rposition(shows)
        .map_or(0, |last| last + 1)
}

/// The starts that explain the first samples best; none where they cannot be simulated.
fn fitted(mut alone: Problem, length: usize, stop: &AtomicBool) -> Option<Option<Vec<f64>>> {
    let experiments = Arc::make_mut(&mut alone.experiments);
    experiments[0].estimation_samples = length;
    let start = vec![0.5; alone.coordinates.len()];
    let descent = refine::descend(&alone, start, Accuracy::Full, stop)?;
    Some(descent.cost.map(|_| alone.values(&descent.positions)))
}
