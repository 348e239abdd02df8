//! How good the estimates are that the service gives: the demonstration's job on the
//! demonstration's recording, with another excitation, other sensor errors and another search in
//! every run, against what theory allows.
//!
//! ```text
//! cargo bench --bench efficiency                     200 runs of A, four unknowns
//! cargo bench --bench efficiency -- --runs 50 --d    of D, five effects of its rig free as well
//! ```
//!
//! For each unknown it prints the mean square error as a multiple of the Cramér–Rao bound (the
//! inverse Fisher information at the true values; 1 is the best that can be), the share of the
//! 95 % intervals that hold the true value, and the mean error in standard errors. It prints too
//! how many searches came to within 1 % of the lowest cost that a descent from the truth finds.

use greybox::demo::{self, Demo};
use greybox::estimation::refine;
use greybox::estimation::sensitivity;
use greybox::estimation::{
    Advance, Estimation, GenerationRow, Observer, Problem, RefinementRow, Settings,
};
use greybox::job::spec::Context;
use greybox::job::{DatasetId, JobSpec, assemble};
use greybox::model::Catalogue;
use greybox::numerics::least_squares::Rows;
use greybox::simulation::Accuracy;
use greybox::uncertainty;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

static NEVER: AtomicBool = AtomicBool::new(false);

struct Unwatched;

impl Observer for Unwatched {
    fn generation(&mut self, _row: &GenerationRow) {}
    fn refinement(&mut self, _row: &RefinementRow) {}
}

/// One unknown over the runs.
struct Tally {
    name: String,
    squares: f64,
    sum: f64,
    covered: usize,
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let runs = arguments
        .iter()
        .position(|argument| argument == "--runs")
        .and_then(|place| arguments.get(place + 1)?.parse().ok())
        .unwrap_or(200);
    let demo = match arguments.iter().any(|argument| argument == "--d") {
        true => Demo::D,
        false => Demo::A,
    };
    let started = Instant::now();
    let mut tallies: Vec<Tally> = Vec::new();
    let mut misses = Vec::new();
    for seed in 1..=runs {
        let (problem, settings) = problem(demo, seed);
        let truth = truth(demo, &problem);
        let errors = errors(&problem, seed, &settings, &truth);
        eprint!("\r{seed}/{runs}");
        if tallies.is_empty() {
            let names = problem.coordinates.iter().map(|known| known.name.clone());
            tallies.extend(names.map(|name| Tally {
                name,
                squares: 0.0,
                sum: 0.0,
                covered: 0,
            }));
        }
        if let Some(miss) = errors.miss {
            misses.push(format!("seed {seed}: {miss}"));
            continue;
        }
        for (tally, (error, covered)) in tallies.iter_mut().zip(errors.of_coordinates) {
            tally.squares += error * error;
            tally.sum += error;
            tally.covered += usize::from(covered);
        }
    }
    eprintln!();
    let reached = runs as usize - misses.len();
    let n = reached as f64;
    println!(
        "recording {}, {runs} runs, seeded 1 to {runs}; within 1 % of the floor: {reached}, and \
         of those:",
        demo.letter()
    );
    println!("unknown                 mse/bound  mean/se  covered");
    for tally in tallies {
        println!(
            "{:22} {:>9.3}  {:>+7.2}  {:>6.1} %",
            tally.name,
            tally.squares / n,
            tally.sum / n,
            1e2 * tally.covered as f64 / n
        );
    }
    for miss in misses {
        println!("{miss}");
    }
    println!("{:.0} s", started.elapsed().as_secs_f64());
}

/// The default job on the recording of a seed.
fn problem(demo: Demo, seed: u64) -> (Problem, Settings) {
    let recording = demo::recording(demo, seed);
    let dataset = DatasetId::new();
    let mut job = demo::job(demo);
    job["experiments"][0]["dataset"] = json!(dataset);
    job["seed"] = json!(seed);
    let catalogue = Catalogue::built_in();
    let context = Context {
        models: catalogue.iter().map(|model| model.description()).collect(),
        datasets: &HashMap::from([(dataset, recording.summary())]),
        max_duration_s: f64::INFINITY,
    };
    let spec = read(&job, &context);
    let model = catalogue.get(&spec.model).expect("the servo");
    let assembly = assemble::problem(&spec, model, &[recording]).expect("a sound job");
    (assembly.problem, spec.method)
}

fn read(job: &Value, context: &Context<'_>) -> JobSpec {
    JobSpec::read(job, context).unwrap_or_else(|faults| panic!("{faults:?}"))
}

/// The positions of the true values.
fn truth(demo: Demo, problem: &Problem) -> Vec<f64> {
    let values: HashMap<String, f64> = demo::true_parameters(demo).into_iter().collect();
    let coordinates = problem.coordinates.iter();
    coordinates
        .map(|coordinate| {
            let value = values[&coordinate.name];
            let scale = coordinate.scale;
            scale.position(value, coordinate.lower, coordinate.upper)
        })
        .collect()
}

struct Errors {
    /// In standard deviations of the bound, and whether the interval holds the true value.
    of_coordinates: Vec<(f64, bool)>,
    /// What the run came to, where it is not the floor.
    miss: Option<String>,
}

fn errors(problem: &Problem, seed: u64, settings: &Settings, truth: &[f64]) -> Errors {
    let bounds = bounds(problem, truth);
    let mut run = Estimation::start(problem, settings, seed);
    while run.advance(problem, &NEVER, &mut Unwatched) != Advance::Finished {}
    let report = run.report(problem, None).expect("an estimate");
    let analysis = uncertainty::analyse(problem, &report, &uncertainty::Request::default(), &NEVER)
        .expect("nobody stops it");
    let of_coordinates = (0..truth.len())
        .map(|index| {
            let error = (report.positions[index] - truth[index]) / bounds[index];
            let value = problem.coordinates[index].value(truth[index]);
            let interval = analysis.coordinates[index].interval;
            let covered = interval.is_some_and(|(low, high)| {
                low.is_none_or(|low| low <= value) && high.is_none_or(|high| value <= high)
            });
            (error, covered)
        })
        .collect();
    let ratio = report.cost.unwrap_or(f64::INFINITY) / floor(problem, truth);
    let miss = (ratio > 1.01).then(|| {
        let reasons = analysis.verdict.reasons.iter();
        let codes: Vec<&str> = reasons.map(|reason| reason.code).collect();
        let trust = analysis.verdict.trust;
        format!("{ratio:.3} times the floor, trust {trust:?} {codes:?}")
    });
    Errors {
        of_coordinates,
        miss,
    }
}

/// The square roots of the Cramér–Rao bounds, as shares of the search ranges.
fn bounds(problem: &Problem, truth: &[f64]) -> Vec<f64> {
    let mut rows = Rows::new(truth.len());
    let full = Accuracy::Full;
    let gather = |row: sensitivity::Row<'_>| rows.add(row.derivatives.iter().copied(), 0.0);
    sensitivity::visit_rows(problem, truth, full, &NEVER, gather).expect("the rig is simulated");
    let factor = rows.finish().factor();
    let information = factor.transpose() * factor;
    let covariance = information.try_inverse().expect("A fixes its unknowns");
    (0..truth.len())
        .map(|index| covariance[(index, index)].sqrt())
        .collect()
}

/// The cost at the bottom of the minimum in which the truth lies.
fn floor(problem: &Problem, truth: &[f64]) -> f64 {
    let descent = refine::descend(problem, truth.to_vec(), Accuracy::Full, &NEVER);
    descent
        .and_then(|descent| descent.cost)
        .expect("the rig is simulated")
}
