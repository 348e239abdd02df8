//! How good the estimates are that the service gives: the demonstration's job on the
//! demonstration's recording, with another excitation, other sensor errors and another search in
//! every run, against what theory allows.
//!
//! ```text
//! cargo bench --bench efficiency                     200 runs of A, four unknowns
//! cargo bench --bench efficiency -- --runs 50 --d    of D, five effects of its rig free as well
//!     --first 201       seeds from 201 on
//!     --normal          with normal noise of the same size in the place of the 12-bit rounding
//!     --first-order     what theory expects of these very recordings, without a search
//! ```
//!
//! For each unknown it prints the mean square error as a multiple of the Cramér–Rao bound (the
//! inverse Fisher information at the true values; 1 is the best that can be), the mean error in
//! standard errors, and the share of the 95 % intervals that hold the true value. Beside each
//! stands what the estimate linearised at the truth comes to in the same runs: of that theory
//! knows that it expects 1, 0 and 95 % where the noise is normal, so its distance from them is the
//! luck of the draw, and what is left without it is the method's own (a control variate).
//! It prints too how many searches came to within 1 % of the lowest cost that a descent from the
//! truth finds, and how far above it, in χ², the farthest of them ended.

mod theory;

use greybox::demo::{self, Demo};
use greybox::estimation::{Estimation, Problem, Settings};
use greybox::numerics::rng::{self, Purpose};
use greybox::recording::Recording;
use greybox::{Identification, uncertainty};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use theory::{FirstOrder, floor};

static NEVER: AtomicBool = AtomicBool::new(false);

/// Half the width of a 95 % interval, in standard errors.
const TWO_SIDED_95: f64 = 1.96;

/// What is run.
struct Plan {
    demo: Demo,
    seeds: std::ops::Range<u64>,
    normal: bool,
    first_order_only: bool,
}

impl Plan {
    fn of_arguments() -> Plan {
        let arguments: Vec<String> = std::env::args().collect();
        let has = |flag: &str| arguments.iter().any(|argument| argument == flag);
        let number = |flag: &str| -> Option<u64> {
            let place = arguments.iter().position(|argument| argument == flag)?;
            arguments.get(place + 1)?.parse().ok()
        };
        let first = number("--first").unwrap_or(1);
        Plan {
            demo: if has("--d") { Demo::D } else { Demo::A },
            seeds: first..first + number("--runs").unwrap_or(200),
            normal: has("--normal"),
            first_order_only: has("--first-order"),
        }
    }

    fn recording(&self, seed: u64) -> Recording {
        let mut recording = demo::recording(self.demo, seed);
        if self.normal {
            let signal = |name: &str| {
                let mut signals = recording.signals.iter();
                signals.position(|signal| signal.name == name)
            };
            let [reference, position] = ["reference", "position"]
                .map(|name| signal(name).expect("a signal of every demonstration"));
            let rig = demo::rig::parameters(self.demo);
            let exact = demo::rig::simulate(&rig, &recording.signals[reference].values);
            let mut noise = rng::stream(seed, 0, Purpose::Noise);
            let measured = exact.position.iter();
            recording.signals[position].values = measured
                .map(|x| x + demo::sensors::POSITION_NOISE * rng::normal(&mut noise))
                .collect();
        }
        recording
    }
}

/// Errors of one unknown over the runs, in standard deviations of the bound.
#[derive(Clone, Default)]
struct Tally {
    squares: f64,
    sum: f64,
    covered: usize,
}

impl Tally {
    fn add(&mut self, error: f64, covered: bool) {
        self.squares += error * error;
        self.sum += error;
        self.covered += usize::from(covered);
    }
}

fn main() {
    let plan = Plan::of_arguments();
    let started = Instant::now();
    let mut tallies: Vec<(String, Tally, Tally)> = Vec::new();
    let mut misses = Vec::new();
    let mut farthest = 0.0_f64;
    for seed in plan.seeds.clone() {
        eprint!("\r{seed}/{}", plan.seeds.end - 1);
        let (problem, settings) = problem(&plan, seed);
        let truth = truth(plan.demo, &problem);
        let theory = FirstOrder::at(&problem, &truth);
        if tallies.is_empty() {
            let names = problem.coordinates.iter().map(|known| known.name.clone());
            tallies.extend(names.map(|name| (name, Tally::default(), Tally::default())));
        }
        if !plan.first_order_only {
            let run = run(&problem, seed, &settings, (&truth, &theory));
            match run.miss {
                Some(miss) => {
                    misses.push(format!("seed {seed}: {miss}"));
                    continue;
                }
                None => farthest = farthest.max(run.above_the_floor),
            }
            for ((_, tally, _), (error, covered)) in tallies.iter_mut().zip(run.of_coordinates) {
                tally.add(error, covered);
            }
        }
        for ((_, _, expected), &error) in tallies.iter_mut().zip(&theory.errors) {
            expected.add(error, error.abs() < TWO_SIDED_95);
        }
    }
    eprintln!();
    print(&plan, &tallies, misses.len(), farthest);
    for miss in misses {
        println!("{miss}");
    }
    println!("{:.0} s", started.elapsed().as_secs_f64());
}

fn print(plan: &Plan, tallies: &[(String, Tally, Tally)], misses: usize, farthest: f64) {
    let runs = plan.seeds.end - plan.seeds.start;
    let n = (runs as usize - misses) as f64;
    let noise = if plan.normal {
        "normal noise"
    } else {
        "12 bits"
    };
    println!(
        "recording {}, {noise}, {runs} runs, seeded {} to {}",
        plan.demo.letter(),
        plan.seeds.start,
        plan.seeds.end - 1
    );
    if !plan.first_order_only {
        println!(
            "within 1 % of the floor: {n}; the farthest of them lies {farthest:.1e} above it in \
             chi-square"
        );
    }
    println!("                        mse/bound        mean/se          covered, %");
    println!("unknown                 here  1st order  here  1st order  here  1st order");
    for (name, tally, expected) in tallies {
        let of = |value: f64, digits: usize| match plan.first_order_only {
            true => "-".to_owned(),
            false => format!("{:.digits$}", value / n),
        };
        println!(
            "{name:22} {:>6} {:>9.3} {:>7} {:>9.2} {:>6} {:>9.1}",
            of(tally.squares, 3),
            expected.squares / n,
            of(tally.sum, 2),
            expected.sum / n,
            of(1e2 * tally.covered as f64, 1),
            1e2 * expected.covered as f64 / n,
        );
    }
}

/// The default job on the recording of a seed.
fn problem(plan: &Plan, seed: u64) -> (Problem, Settings) {
    let job = Identification::of_job(demo::job(plan.demo), plan.recording(seed)).seed(seed);
    let (assembly, spec) = job.assembly().expect("a sound job");
    (assembly.problem, spec.method)
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

/// One run of the service's method.
struct Outcome {
    /// In standard deviations of the bound, and whether the interval holds the true value.
    of_coordinates: Vec<(f64, bool)>,
    /// What the run came to, where it is not the floor.
    miss: Option<String>,
    /// How far above the floor it ended, in χ².
    above_the_floor: f64,
}

fn run(
    problem: &Problem,
    seed: u64,
    settings: &Settings,
    (truth, theory): (&[f64], &FirstOrder),
) -> Outcome {
    let mut run = Estimation::start(problem, settings, seed);
    let report = run.run(problem, &NEVER, &mut ()).expect("an estimate");
    let analysis = uncertainty::analyse(problem, &report, &uncertainty::Request::default(), &NEVER)
        .expect("nobody stops it");
    let of_coordinates = (0..truth.len())
        .map(|index| {
            let error = (report.positions[index] - truth[index]) / theory.bounds[index];
            let value = problem.coordinates[index].value(truth[index]);
            let interval = analysis.coordinates[index].interval;
            let covered = interval.is_some_and(|(low, high)| {
                low.is_none_or(|low| low <= value) && high.is_none_or(|high| value <= high)
            });
            (error, covered)
        })
        .collect();
    let floor = floor(problem, truth);
    let ratio = report.cost.unwrap_or(f64::INFINITY) / floor;
    let miss = (ratio > 1.01).then(|| {
        let doubts = analysis.judgement.doubts.iter();
        let codes: Vec<&str> = doubts.map(|doubt| doubt.rule.code()).collect();
        let trust = analysis.judgement.trust;
        format!("{ratio:.3} times the floor, trust {trust:?} {codes:?}")
    });
    Outcome {
        of_coordinates,
        miss,
        above_the_floor: (ratio - 1.0) * problem.n_residuals() as f64,
    }
}
