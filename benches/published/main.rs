//! How long a candidate of a published problem takes: alone, and where thirty share the work, on
//! one thread. `benches/studies/published.py` sets the figures beside other programs.
//!
//! The problems are those of `tests/documents/published.rs`; where they are not at hand nothing is
//! measured.

#[path = "../../crates/greybox/tests/documents/published.rs"]
#[expect(dead_code, reason = "the tests in it are not run here")]
mod published;

use greybox::estimation::Problem;
use greybox::estimation::objective::Objective;
use greybox::numerics::lanes::Lanes;
use greybox::simulation::batch::{self, BatchRun, Sink};
use greybox::simulation::{Accuracy, DrivingInputs, SimulatedCandidate};
use published::Published;
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

const PROBLEMS: [&str; 5] = [
    "crauste",
    "petab/Bertozzi_PNAS2020",
    "petab/Boehm_JProteomeRes2014",
    "petab/Elowitz_Nature2000",
    "petab/Rahman_MBS2016",
];

/// Runs of which the shortest counts.
const RUNS: usize = 30;

/// Candidates that share the work.
const TOGETHER: usize = 30;

/// How far they lie from the published values, as a share of the search range.
const SPREAD: f64 = 0.0005;

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.expect("a thread can be started");
    // Only those that a word on the command line stands in, if there is one.
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'))
        .collect();
    let asked = |name: &&str| words.is_empty() || words.iter().any(|word| name.contains(word));
    let figures = PROBLEMS.into_iter().filter(asked).filter_map(|name| {
        let published = Published::new(name)?;
        let problem = published.problem();
        let nominal = published.nominal(&problem);
        Some((
            name.to_owned(),
            pool.install(|| figures(&problem, &nominal)),
        ))
    });
    let figures: serde_json::Map<String, Value> = figures.collect();
    println!("{:#}", Value::Object(figures));
}

fn figures(problem: &Problem, nominal: &[f64]) -> Value {
    let one = [nominal.to_vec()];
    let near = (0..).map(|place| beside(nominal, place));
    let many: Vec<Vec<f64>> = near
        .filter(|own| is_simulated(problem, own))
        .take(TOGETHER)
        .collect();
    let of = |candidates: &[Vec<f64>], accuracy| {
        1e3 * shortest(problem, candidates, accuracy) / candidates.len() as f64
    };
    json!({
        "one_full_ms": of(&one, Accuracy::Full),
        "of_thirty_full_ms": of(&many, Accuracy::Full),
        "one_ranking_ms": of(&one, Accuracy::Ranking),
        "of_thirty_ranking_ms": of(&many, Accuracy::Ranking),
        "full_derivatives": derivatives(problem, nominal, Accuracy::Full),
        "ranking_derivatives": derivatives(problem, nominal, Accuracy::Ranking),
    })
}

/// A candidate near the published values, the same in every run.
fn beside(nominal: &[f64], place: usize) -> Vec<f64> {
    let shifted = nominal.iter().enumerate().map(|(index, position)| {
        // Steps of the golden ratio fill the interval evenly.
        let share = ((place * nominal.len() + index) as f64 * 0.618_033_988_749_894_9).fract();
        (position + SPREAD * (2.0 * share - 1.0)).clamp(0.0, 1.0)
    });
    shifted.collect()
}

/// Whether a candidate does not explode, as one near the published virus may.
fn is_simulated(problem: &Problem, candidate: &[f64]) -> bool {
    let never = AtomicBool::new(false);
    let objective = Objective::new(problem, usize::MAX);
    let judged = objective.evaluate(problem, &[candidate.to_vec()], Accuracy::Ranking, &never);
    judged.is_some_and(|judged| judged[0].cost.is_finite())
}

/// Derivatives that a candidate takes over all experiments.
fn derivatives(problem: &Problem, candidate: &[f64], accuracy: Accuracy) -> u64 {
    let filled: Vec<_> = (0..problem.experiments.len())
        .map(|experiment| problem.fill(experiment, candidate))
        .collect();
    let runs = problem.experiments.iter().zip(&filled);
    let runs = runs.map(|(experiment, filled)| BatchRun {
        excitation: DrivingInputs {
            sample_time: experiment.sample_time,
            instants: experiment.instants.as_deref(),
            samples: experiment.samples,
            input_set: experiment.input_set,
            inputs: &experiment.inputs,
            accuracy,
        },
        candidates: vec![SimulatedCandidate {
            parameters: &filled.parameters,
            initial_state: &filled.initial_state,
        }],
        in_step: 0,
    });
    let runs: Vec<BatchRun<'_>> = runs.collect();
    let plant = problem.plant();
    let never = AtomicBool::new(false);
    let pieces = batch::simulate(plant.as_ref(), &runs, &never, |_run| Unread);
    let pieces = pieces.expect("nobody interrupts");
    pieces
        .iter()
        .map(|piece| piece.derivative_evaluations)
        .sum()
}

/// Outputs that nobody reads.
struct Unread;

impl Sink for Unread {
    fn consume(&mut self, _first_sample: usize, _outputs: &[Lanes]) {}
}

/// The shortest time in which candidates are judged [s].
fn shortest(problem: &Problem, candidates: &[Vec<f64>], accuracy: Accuracy) -> f64 {
    let never = AtomicBool::new(false);
    let objective = Objective::new(problem, usize::MAX);
    let times = (0..RUNS).map(|_| {
        let started = Instant::now();
        let judged = objective.evaluate(problem, candidates, accuracy, &never);
        let judged = judged.expect("nobody interrupts");
        assert!(judged[0].cost.is_finite(), "it can be simulated");
        started.elapsed().as_secs_f64()
    });
    times.fold(f64::INFINITY, f64::min)
}
