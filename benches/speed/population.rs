//! Thirty candidates through recording A: the work of one generation.

use super::{RUNS, SEED, shortest};
use greybox::demo::{self, Demo};
use greybox::model::{Catalogue, Model, document};
use greybox::numerics::lanes::Lanes;
use greybox::simulation::batch::{self, BatchRun, Piece, Sink};
use greybox::simulation::{Accuracy, DrivingInputs, SimulatedCandidate};
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;

/// Candidates of a generation.
const CANDIDATES: usize = 30;

/// How far the candidates lie from the nominal rig, as a share.
const SPREAD: f64 = 0.05;

/// Keeps the position of every lane.
struct Positions(Vec<Lanes>);

impl Sink for Positions {
    fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
        self.0
            .extend(outputs.chunks_exact(N_OUTPUTS).map(|row| row[0]));
    }
}

/// Outputs of the servo, the position first.
const N_OUTPUTS: usize = 4;

/// What all candidates have in common, as a job takes it for known.
fn common(candidates: &[Vec<f64>]) -> Vec<Option<f64>> {
    let first = candidates[0].iter().enumerate();
    let common = first.map(|(place, value)| {
        let mut others = candidates.iter();
        others.all(|other| other[place] == *value).then_some(*value)
    });
    common.collect()
}

struct Bench {
    model: std::sync::Arc<Model>,
    reference: Vec<Vec<f64>>,
    sample_time: f64,
}

struct Work<'a> {
    candidates: &'a [Vec<f64>],
    samples: usize,
    accuracy: Accuracy,
}

impl Bench {
    /// The same with the servo written as a document.
    fn written() -> Bench {
        let text =
            include_str!("../../crates/greybox/tests/documents/models/single_rod_servo.json");
        let document = serde_json::from_str(text).expect("a document of the tests is JSON");
        let read = document::read(&document).expect("a document of the tests is sound");
        Bench {
            model: std::sync::Arc::new(read.model),
            ..Bench::new()
        }
    }

    fn new() -> Bench {
        let recording = demo::recording(Demo::A, SEED);
        let models = Catalogue::built_in();
        let reference = recording
            .signals
            .iter()
            .find(|signal| signal.name == "reference")
            .expect("recording A holds the reference");
        Bench {
            model: models
                .get("single_rod_servo")
                .expect("a built-in model")
                .clone(),
            reference: vec![reference.values.clone()],
            sample_time: demo::SAMPLE_TIME,
        }
    }

    /// Candidates about the nominal rig, spread evenly and the same in every run.
    fn candidates(&self, count: usize) -> Vec<Vec<f64>> {
        let description = self.model.description();
        let unknowns = ["mass", "damping", "stiffness", "bulk_modulus"];
        let places = unknowns.map(|name| {
            description
                .parameter_index(name)
                .expect("a parameter of the servo")
        });
        let mut numbers = (0_u64..).map(|k| {
            // Steps of the golden ratio fill the interval evenly.
            (k as f64 * 0.618_033_988_749_894_9).fract() * 2.0 - 1.0
        });
        let spread = |_| {
            let mut candidate = description.defaults();
            for place in places {
                candidate[place] *= 1.0 + SPREAD * numbers.next().unwrap_or(0.0);
            }
            candidate
        };
        (0..count).map(spread).collect()
    }

    /// Every position, as the lanes of a block keep them.
    fn simulate(&self, work: &Work<'_>) -> Vec<Piece<Positions>> {
        let plant = self.model.plant_with(&common(work.candidates));
        let start = vec![None; self.model.description().states.len()];
        let candidate = |parameters| SimulatedCandidate {
            parameters,
            initial_state: &start,
        };
        let run = BatchRun {
            excitation: DrivingInputs {
                sample_time: self.sample_time,
                instants: None,
                samples: work.samples,
                input_set: 0,
                inputs: &self.reference,
                accuracy: work.accuracy,
            },
            candidates: work
                .candidates
                .iter()
                .map(|c| candidate(c.as_slice()))
                .collect(),
            in_step: 0,
        };
        let never = AtomicBool::new(false);
        let recorder = |_| Positions(Vec::with_capacity(work.samples));
        batch::simulate(plant.as_ref(), &[run], &never, recorder).expect("nobody interrupts")
    }

    /// The positions of each candidate.
    fn positions(&self, work: &Work<'_>) -> Vec<Vec<f64>> {
        let mut positions = vec![Vec::new(); work.candidates.len()];
        for piece in self.simulate(work) {
            for (lane, &member) in piece.members.iter().enumerate() {
                positions[member] = piece.sink.0.iter().map(|row| row.0[lane]).collect();
            }
        }
        positions
    }

    /// The shortest time [s], and the derivatives evaluated.
    fn timed(&self, work: &Work<'_>, threads: usize) -> (f64, u64) {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads can be started");
        let (seconds, pieces) = pool.install(|| shortest(RUNS, || self.simulate(work)));
        let derivatives = pieces.iter().map(|piece| piece.derivative_evaluations);
        (seconds, derivatives.sum())
    }
}

/// What the document of the servo always computes, and the servo in Rust only where it is there.
const EFFECTS: [(&str, f64); 7] = [
    ("coulomb_friction", 100.0),
    ("stribeck_friction", 30.0),
    ("dead_band", 0.02),
    ("internal_leakage", 1e-12),
    ("external_leakage", 1e-13),
    ("air_fraction", 0.002),
    ("supply_droop", 1e8),
];

/// The servo in Rust, and the servo that a user has written, on one core at full accuracy: the time,
/// the derivatives that their steps take, and how far both are from finer steps.
pub fn documents() -> Value {
    let compared = |effects: &[(&str, f64)]| {
        let [rust, document] = [Bench::new(), Bench::written()].map(|bench| {
            let place = |name: &str| bench.model.description().parameter_index(name);
            let place = |name: &str| place(name).expect("a parameter of the servo");
            let mut candidates = bench.candidates(CANDIDATES);
            for candidate in &mut candidates {
                effects
                    .iter()
                    .for_each(|(name, value)| candidate[place(name)] = *value);
            }
            let work = |accuracy| Work {
                candidates: &candidates,
                samples: bench.reference[0].len(),
                accuracy,
            };
            let (seconds, derivatives) = bench.timed(&work(Accuracy::Full), 1);
            let [own, reference] = [Accuracy::Full, Accuracy::Reference];
            let [own, reference] = [own, reference].map(|at| bench.positions(&work(at)));
            [
                1e3 * seconds,
                1e9 * seconds / derivatives as f64,
                derivatives as f64 / (bench.reference[0].len() * CANDIDATES) as f64,
                1e6 * root_mean_square(&own, &reference),
            ]
        });
        let figures = |[milliseconds, nanoseconds, derivatives, error]: [f64; 4]| {
            json!({
                "milliseconds": milliseconds,
                "nanoseconds_per_derivative": nanoseconds,
                "derivatives_per_sample": derivatives,
                "position_error_rms_micrometres": error,
            })
        };
        json!({
            "rust": figures(rust),
            "document": figures(document),
            "times_as_long": document[0] / rust[0],
            "times_as_long_per_derivative": document[1] / rust[1],
        })
    };
    json!({"every_effect": compared(&EFFECTS), "effects_of_recording_a": compared(&[])})
}

/// The root mean square of the differences.
fn root_mean_square(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    let squares = pairs.map(|(a, b)| (a - b).powi(2));
    let count = a.iter().map(Vec::len).sum::<usize>();
    (squares.sum::<f64>() / count as f64).sqrt()
}

/// Time, work and error at several accuracies; growth with samples and with candidates.
pub fn figures() -> Value {
    let bench = Bench::new();
    let samples = bench.reference[0].len();
    let candidates = bench.candidates(CANDIDATES);
    let work = |accuracy| Work {
        candidates: &candidates,
        samples,
        accuracy,
    };
    let reference = bench.positions(&work(Accuracy::Reference));
    let at = |name: &str, accuracy: Accuracy| {
        let work = work(accuracy);
        let (one_thread, derivatives) = bench.timed(&work, 1);
        let (all_threads, _) = bench.timed(&work, 2);
        let positions = bench.positions(&work);
        json!({
            "accuracy": name,
            "position_error_rms_micrometres": 1e6 * root_mean_square(&positions, &reference),
            "milliseconds_on_1_thread": 1e3 * one_thread,
            "milliseconds_on_2_threads": 1e3 * all_threads,
            "derivatives_per_sample": derivatives as f64 / (samples * CANDIDATES) as f64,
            "nanoseconds_per_derivative_on_1_thread": 1e9 * one_thread / derivatives as f64,
        })
    };
    let growth = |count: usize, samples: usize| {
        let candidates = bench.candidates(count);
        let work = Work {
            candidates: &candidates,
            samples,
            accuracy: Accuracy::Ranking,
        };
        let [one_thread, all_threads] = [1, 2].map(|threads| bench.timed(&work, threads).0);
        json!({
            "candidates": count,
            "samples": samples,
            "nanoseconds_per_candidate_and_sample": 1e9 * all_threads / (count * samples) as f64,
            "times_as_fast_as_1_thread": one_thread / all_threads,
        })
    };
    json!({
        "accuracies": [
            at("ranking", Accuracy::Ranking),
            at("screening", Accuracy::Screening),
            at("full", Accuracy::Full),
        ],
        "growth": [
            growth(32, 120), growth(32, 1200), growth(32, 12_000),
            growth(320, 1200), growth(3200, 1200), growth(10_000, 1200),
        ],
    })
}
