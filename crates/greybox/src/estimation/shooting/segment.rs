//! Segments: where they are cut, where they start, and their simulation.

use crate::estimation::problem::{Experiment, Filled, Problem};
use crate::estimation::sensitivity::{Columns, SHIFT, record_runs};
use greybox_simulation::batch::BatchRun;
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate};
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;

/// Segments of an experiment at the most.
const MOST_SEGMENTS: usize = 100;
/// Samples of a segment at the least.
const FEWEST_SAMPLES: usize = 5;
/// How far a state is shifted for a difference, as a share of what it moves.
pub(super) const STATE_SHIFT: f64 = 1e-6;
/// An output is a state where it moves by as much, up to this share.
const SAME: f64 = 1e-9;
/// How finely segments are simulated.
const ACCURACY: Accuracy = Accuracy::Screening;

/// Where segments start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Starts {
    /// For each experiment the states at the starts of its segments but the first, which the problem
    /// says.
    pub of: Vec<Vec<Vec<f64>>>,
    /// What each state moves: what its jumps are measured by.
    pub scales: Vec<f64>,
}

/// How the segments are joined.
#[derive(Clone, Copy)]
pub(super) struct Joins<'a> {
    /// Where the segments start.
    pub starts: &'a Starts,
    /// How much the square of a jump counts beside the square of a residual.
    pub weight: f64,
}

/// A candidate with starts of its own.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub positions: Vec<f64>,
    pub starts: Starts,
}

/// The samples at which the segments of an experiment start, and last its last sample.
pub(super) fn cuts(experiment: &Experiment) -> Vec<usize> {
    let last = experiment.estimation_samples.saturating_sub(1);
    let count = (last / FEWEST_SAMPLES).clamp(1, MOST_SEGMENTS);
    (0..=count).map(|place| place * last / count).collect()
}

/// One segment.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    /// The segment's experiment, and the segment's place in that experiment.
    pub experiment: usize,
    pub place: usize,
    /// The samples of the segment with the first of the next segment.
    pub data: Experiment,
    /// Samples that are compared: the last belongs to the next segment, where there is one.
    pub compared: usize,
}

/// All segments of a problem.
pub(super) fn segments(problem: &Problem) -> Vec<Segment> {
    let mut segments = Vec::new();
    for (experiment, whole) in problem.experiments.iter().enumerate() {
        let cuts = cuts(whole);
        let ends = cuts.windows(2).enumerate();
        segments.extend(ends.map(|(place, ends)| {
            let is_last = place + 2 == cuts.len();
            let samples = ends[1] - ends[0] + 1;
            Segment {
                experiment,
                place,
                data: whole.part(ends[0], samples),
                compared: samples - usize::from(!is_last),
            }
        }));
    }
    segments
}

impl Segment {
    /// A candidate spelled out, with the start of the segment.
    fn fill(&self, problem: &Problem, positions: &[f64], starts: &Starts) -> Filled {
        let mut filled = problem.fill(self.experiment, positions);
        if let Some(start) = self.start(starts) {
            filled.initial_state = start.iter().copied().map(Some).collect();
        }
        filled
    }

    /// Returns the start of the segment, where it has one of its own.
    fn start<'a>(&self, starts: &'a Starts) -> Option<&'a Vec<f64>> {
        starts.of[self.experiment].get(self.place.checked_sub(1)?)
    }

    fn run<'a>(&'a self, candidates: &'a [Filled], in_step: usize) -> BatchRun<'a> {
        BatchRun {
            excitation: DrivingInputs {
                sample_time: self.data.sample_time,
                instants: self.data.instants.as_deref(),
                samples: self.data.samples,
                input_set: self.data.input_set,
                inputs: &self.data.inputs,
                accuracy: ACCURACY,
            },
            candidates: candidates.iter().map(spelled).collect(),
            in_step,
        }
    }
}

fn spelled(filled: &Filled) -> SimulatedCandidate<'_> {
    SimulatedCandidate {
        parameters: &filled.parameters,
        initial_state: &filled.initial_state,
    }
}

/// Simulates candidates spelled out for each segment.
fn simulate(
    problem: &Problem,
    segments: &[Segment],
    filled: &[Vec<Filled>],
    in_step: usize,
    stop: &AtomicBool,
) -> Option<Vec<Columns>> {
    let pairs = segments.iter().zip(filled);
    let runs: Vec<BatchRun<'_>> = pairs
        .map(|(segment, filled)| segment.run(filled, in_step))
        .collect();
    record_runs(problem, &runs, stop)
}

/// A candidate with its segments, and its neighbours along every coordinate and every state.
pub(super) struct Simulated {
    pub segments: Vec<Segment>,
    pub columns: Vec<Columns>,
    /// How far each coordinate was moved.
    pub shifts: Vec<f64>,
    /// How far each state was moved at the start of a segment.
    pub state_shifts: Vec<f64>,
}

impl Simulated {
    /// Nothing when `stop` was raised.
    pub(super) fn around(
        problem: &Problem,
        positions: &[f64],
        starts: &Starts,
        stop: &AtomicBool,
    ) -> Option<Simulated> {
        let segments = segments(problem);
        let shift = |position: &f64| if *position < 0.5 { SHIFT } else { -SHIFT };
        let shifts: Vec<f64> = positions.iter().map(shift).collect();
        let state_shifts: Vec<f64> = starts
            .scales
            .iter()
            .map(|scale| scale * STATE_SHIFT)
            .collect();
        let around = |segment: &Segment| {
            let here = segment.fill(problem, positions, starts);
            let coordinates = shifts.iter().enumerate().map(|(coordinate, shift)| {
                let mut moved = positions.to_vec();
                moved[coordinate] += shift;
                segment.fill(problem, &moved, starts)
            });
            let states = state_shifts.iter().enumerate().map(|(state, shift)| {
                let mut moved = here.clone();
                // The first segment starts where the problem says.
                let start = moved.initial_state[state].filter(|_| segment.place > 0);
                moved.initial_state[state] = start
                    .map(|start| start + shift)
                    .or(here.initial_state[state]);
                moved
            });
            let neighbours: Vec<Filled> = coordinates.chain(states).collect();
            std::iter::once(here).chain(neighbours).collect()
        };
        let filled = segments.iter().map(around);
        let filled: Vec<Vec<Filled>> = filled.collect();
        let in_step = filled.first().map_or(0, Vec::len);
        Some(Simulated {
            columns: simulate(problem, &segments, &filled, in_step, stop)?,
            segments,
            shifts,
            state_shifts,
        })
    }

    /// How many candidates that were.
    pub(super) fn n_candidates(&self) -> u64 {
        1 + (self.shifts.len() + self.state_shifts.len()) as u64
    }

    /// Whether all can be simulated.
    pub(super) fn is_whole(&self) -> bool {
        let failures = self.columns.iter().flat_map(|columns| &columns.failures);
        failures.into_iter().all(Option::is_none)
    }
}

/// For each trial the sum of the squared residuals, those of priors among them, and that of the
/// jumps; infinite where it cannot be simulated. Nothing when `stop` was raised.
pub(super) fn judge(
    problem: &Problem,
    trials: &[&Trial],
    stop: &AtomicBool,
) -> Option<Vec<[f64; 2]>> {
    let segments = segments(problem);
    let filled = segments.iter().map(|segment| {
        let fill = |trial: &&Trial| segment.fill(problem, &trial.positions, &trial.starts);
        trials.iter().map(fill).collect()
    });
    let filled: Vec<Vec<Filled>> = filled.collect();
    let columns = simulate(problem, &segments, &filled, 0, stop)?;
    let sums = trials.iter().enumerate().map(|(member, trial)| {
        let mut sums = [problem.prior_sum(&trial.positions).0, 0.0];
        for (segment, columns) in segments.iter().zip(&columns) {
            if columns.failures[member].is_some() {
                return [f64::INFINITY; 2];
            }
            visit(problem, segment, |sample, output, measured, scale| {
                let simulated = columns.value(member, sample, output);
                sums[0] += problem.loss.bent((measured - simulated) / scale).powi(2);
            });
            let jumps = jumps(segment, columns, member, &trial.starts);
            sums[1] += jumps.iter().map(|jump| jump * jump).sum::<f64>();
        }
        sums.map(|sum| if sum.is_nan() { f64::INFINITY } else { sum })
    });
    Some(sums.collect())
}

/// Visits what was measured in a segment, with what its residual is divided by.
pub(super) fn visit(
    problem: &Problem,
    segment: &Segment,
    mut visit: impl FnMut(usize, usize, f64, f64),
) {
    for sample in 0..segment.compared {
        for (output, about) in problem.outputs.iter().enumerate() {
            let measured = segment.data.measured[output][sample];
            if !measured.is_nan() {
                let scale = about.residual_scale / segment.data.weight(output, sample);
                visit(sample, output, measured, scale);
            }
        }
    }
}

/// How far the end of a segment is from the start of the next one, in what each state moves; nothing
/// after the last.
pub(super) fn jumps(
    segment: &Segment,
    columns: &Columns,
    member: usize,
    starts: &Starts,
) -> Vec<f64> {
    let next = starts.of[segment.experiment].get(segment.place);
    let next = next.into_iter().flatten().zip(&starts.scales).enumerate();
    next.map(|(state, (start, scale))| (columns.last_state(member, state) - start) / scale)
        .collect()
}

/// Where segments start at first: states that an output measures where they were measured, the others
/// where the simulation of the segments before has brought them. Nothing inside where the candidate
/// cannot be simulated at all; nothing when `stop` was raised.
pub(super) fn first_starts(
    problem: &Problem,
    positions: &[f64],
    stop: &AtomicBool,
) -> Option<Option<Starts>> {
    let Some(sources) = measured_states(problem, positions, stop)? else {
        return Some(None);
    };
    let mut starts = Starts {
        of: vec![Vec::new(); problem.experiments.len()],
        scales: Vec::new(),
    };
    for segment in segments(problem) {
        let filled = vec![vec![segment.fill(problem, positions, &starts)]];
        let columns = simulate(problem, std::slice::from_ref(&segment), &filled, 0, stop)?;
        let has_failed = columns[0].failures[0].is_some();
        if segment.compared == segment.data.samples {
            continue;
        }
        let last = segment.data.samples - 1;
        let state = |(state, source): (usize, &Option<usize>)| {
            let measured = source.map(|output| segment.data.measured[output][last]);
            let simulated = (!has_failed).then(|| columns[0].last_state(0, state));
            let before = filled[0][0].initial_state[state];
            measured
                .filter(|value| !value.is_nan())
                .or(simulated)
                .or(before)
        };
        let start: Option<Vec<f64>> = sources.iter().enumerate().map(state).collect();
        let Some(start) = start else {
            return Some(None);
        };
        starts.of[segment.experiment].push(start);
    }
    starts.scales = scales(&starts.of, sources.len());
    Some(Some(starts))
}

/// What each state moves over all starts; its size where it stands still.
fn scales(starts: &[Vec<Vec<f64>>], states: usize) -> Vec<f64> {
    let scale = |state: usize| {
        let values = || starts.iter().flatten().map(|start| start[state]);
        let (least, most) = (
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        );
        let size = values().fold(0.0, |size: f64, value| size.max(value.abs()));
        let moved = (most - least).max(1e-3 * size);
        if moved > 0.0 { moved } else { 1.0 }
    };
    (0..states).map(scale).collect()
}

/// For each state the output that measures it, by its place in the problem: the one that moves as it
/// does at the first sample, and with no other state. Nothing inside where the candidate cannot be
/// simulated; nothing when `stop` was raised.
fn measured_states(
    problem: &Problem,
    positions: &[f64],
    stop: &AtomicBool,
) -> Option<Option<Vec<Option<usize>>>> {
    let Some(first) = segments(problem).into_iter().next() else {
        return Some(None);
    };
    let moment = Segment {
        data: first.data.part(0, 1),
        compared: 1,
        ..first
    };
    let here = vec![vec![problem.fill(0, positions)]];
    let moments = std::slice::from_ref(&moment);
    let columns = simulate(problem, moments, &here, 0, stop)?;
    if columns[0].failures[0].is_some() {
        return Some(None);
    }
    let states = columns[0].n_states();
    let start: Vec<f64> = (0..states)
        .map(|state| columns[0].last_state(0, state))
        .collect();
    let shift = |state: usize| 0.1 * start[state].abs().max(1e-3);
    let moved = |state: Option<usize>| {
        let mut moved = here[0][0].clone();
        moved.initial_state = start.iter().copied().map(Some).collect();
        if let Some(state) = state {
            moved.initial_state[state] = Some(start[state] + shift(state));
        }
        moved
    };
    let candidates = std::iter::once(None).chain((0..states).map(Some));
    let moved = vec![candidates.map(moved).collect::<Vec<Filled>>()];
    let columns = &simulate(problem, moments, &moved, 0, stop)?[0];
    let change = |output: usize, state: usize| {
        columns.value(1 + state, 0, output) - columns.value(0, 0, output)
    };
    let is_state = |output: usize, state: usize| {
        let is_equal = (columns.value(0, 0, output) - start[state]).abs()
            <= SAME * start[state].abs().max(shift(state));
        let others = (0..states).filter(|other| *other != state);
        is_equal
            && (change(output, state) - shift(state)).abs() <= SAME.sqrt() * shift(state)
            && others.into_iter().all(|other| change(output, other) == 0.0)
    };
    let source = |state: usize| (0..problem.outputs.len()).find(|output| is_state(*output, state));
    Some(Some((0..states).map(source).collect()))
}
