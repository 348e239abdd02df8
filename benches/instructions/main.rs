//! Instructions that the inner loops execute, counted by Valgrind's Callgrind: the same in every
//! run on any load of the machine, so a change shows to the last per mille.
//!
//! Needs `valgrind` and the runner of the version in `Cargo.lock`:
//!
//! ```text
//! cargo install --locked gungraun-runner@0.20.0
//! cargo bench --bench instructions                                    beside the run before
//! cargo bench --bench instructions -- --save-baseline=main            kept under a name
//! cargo bench --bench instructions -- --baseline=main                 beside that one
//! cargo bench --bench instructions -- --callgrind-limits='ir=1%'      fails where one grew by more
//! ```

#![allow(
    missing_docs,
    reason = "the macros write modules without documentation"
)]

use greybox::credit::{self, Credits, Form, icra::Network};
use greybox::demo::{self, Demo};
use greybox::model::{Catalogue, Model, document};
use greybox::numerics::lanes::{LANES, Lanes};
use greybox::numerics::least_squares::{RowGatherer, Triangle};
use greybox::recording::Recording;
use greybox::simulation::{Accuracy, CandidateBlock, DrivingInputs, Plant, SimulatedCandidate};
use gungraun::{library_benchmark, library_benchmark_group, main};
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Samples that a block goes through.
const SAMPLES: usize = 200;

/// A block of candidates about the nominal rig, and the excitation of recording A.
struct Work {
    model: Arc<Model>,
    /// Its equations with what the candidates have in common.
    plant: Arc<dyn Plant>,
    candidates: Vec<Vec<f64>>,
    inputs: Vec<Vec<f64>>,
    accuracy: Accuracy,
}

impl Work {
    fn of(model: Arc<Model>, accuracy: Accuracy) -> Work {
        let recording = demo::recording_of(Demo::A, 1, SAMPLES);
        let reference = recording.signal("reference").expect("a signal of A");
        let sizes = model.plant().block_sizes(accuracy);
        let size = *sizes.last().expect("a block holds something");
        let candidates = (0..size).map(|lane| {
            let mut candidate = model.description().defaults();
            for name in ["mass", "damping", "stiffness", "bulk_modulus"] {
                let place = model.description().parameter_index(name);
                let share = 0.16 * ((lane as f64 + 0.5) / size as f64 - 0.5);
                candidate[place.expect("a parameter of the servo")] *= 1.0 + share;
            }
            candidate
        });
        let candidates: Vec<Vec<f64>> = candidates.collect();
        let common = candidates[0].iter().zip(&candidates[1]);
        let common = common.map(|(one, other)| (one == other).then_some(*one));
        Work {
            plant: model.plant_with(&common.collect::<Vec<_>>()),
            candidates,
            model,
            inputs: vec![reference.values.clone()],
            accuracy,
        }
    }
}

fn in_rust(accuracy: Accuracy) -> Work {
    let models = Catalogue::built_in();
    let model = models.get("single_rod_servo").expect("a built-in model");
    Work::of(model.clone(), accuracy)
}

fn written(accuracy: Accuracy) -> Work {
    let text = include_str!("../../crates/greybox/tests/documents/models/single_rod_servo.json");
    let document = serde_json::from_str(text).expect("a document of the tests is JSON");
    let read = document::read(&document).expect("a document of the tests is sound");
    Work::of(Arc::new(read.model), accuracy)
}

#[library_benchmark]
#[bench::rust_as_the_search_simulates(args = (Accuracy::Ranking), setup = in_rust)]
#[bench::rust_as_descents_begin(args = (Accuracy::Screening), setup = in_rust)]
#[bench::rust_as_estimates_are_made(args = (Accuracy::Full), setup = in_rust)]
#[bench::document_as_estimates_are_made(args = (Accuracy::Full), setup = written)]
fn simulate(work: Work) -> Vec<Lanes> {
    let description = work.model.description();
    let start = vec![None; description.states.len()];
    let excitation = DrivingInputs {
        sample_time: demo::SAMPLE_TIME,
        instants: None,
        samples: SAMPLES,
        input_set: 0,
        inputs: &work.inputs,
        accuracy: work.accuracy,
    };
    let candidates: Vec<SimulatedCandidate<'_>> = work
        .candidates
        .iter()
        .map(|parameters| SimulatedCandidate {
            parameters,
            initial_state: &start,
        })
        .collect();
    let rows = SAMPLES * candidates.len() / LANES;
    let mut outputs = vec![Lanes([0.0; LANES]); rows * description.outputs.len()];
    let candidates = CandidateBlock {
        members: &candidates,
        in_step: false,
    };
    let mut block = work.plant.simulator(excitation, candidates);
    let never = AtomicBool::new(false);
    let ended = black_box(&mut block).advance(SAMPLES, &mut outputs, &never);
    assert!(ended.is_some(), "nobody stops it");
    outputs
}

/// Errors of 30 candidates in 300 blocks, of which the entropy criterion stops no one.
fn errors() -> Vec<Vec<f64>> {
    let error = |block: u32, candidate: u32| {
        let draw = (block * 30 + candidate).wrapping_mul(2_654_435_761);
        1.0 + f64::from(draw) / f64::from(u32::MAX)
    };
    let of_block = |block| (0..30).map(|candidate| error(block, candidate)).collect();
    (0..300).map(of_block).collect()
}

#[library_benchmark]
#[bench::of_a_generation(setup = errors)]
fn credits(errors: Vec<Vec<f64>>) -> Credits {
    let network = Network {
        form: Form::Paper,
        gain: 0.1,
        spread: 100.0,
        updates: errors.len(),
    };
    credit::assign(&network, 30, |block| &errors[block])
}

/// Rows of a sensitivity of four unknowns.
fn rows() -> Vec<[f64; 5]> {
    let row = |k: i32| std::array::from_fn(|column| (f64::from(k) * 0.1 + column as f64).sin());
    (0..9000).map(row).collect()
}

#[library_benchmark]
#[bench::of_nine_thousand_rows(setup = rows)]
fn triangle(rows: Vec<[f64; 5]>) -> Triangle {
    let mut gathered = RowGatherer::new(4);
    for [derivatives @ .., residual] in rows {
        gathered.add(derivatives, residual);
    }
    gathered.finish()
}

fn text() -> Vec<u8> {
    let recording = demo::recording_of(Demo::A, 1, 2000);
    let mut text = Vec::new();
    recording.write_csv(&mut text).expect("memory takes it");
    text
}

#[library_benchmark]
#[bench::of_two_thousand_samples(setup = text)]
fn ingest(text: Vec<u8>) -> Recording {
    Recording::from_csv(&*text).expect("the recording is sound")
}

library_benchmark_group!(
    name = kernels,
    benchmarks = [simulate, credits, triangle, ingest]
);
main!(library_benchmark_groups = kernels);
