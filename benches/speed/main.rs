//! How fast the method is: the population simulation, a whole estimate, reading a recording.
//!
//! `cargo bench --bench speed` prints a table; with `-- --json` one JSON object instead, which
//! `benches/studies/compare.py` sets beside other programs. Each figure is the shortest of several runs,
//! because whatever else the machine does only adds to a time.

mod limits;
mod population;

use greybox::demo::{self, Demo};
use greybox::estimation::{Estimation, Problem, Report};
use greybox::identification::JobSpec;
use greybox::{Identification, Recording, uncertainty};
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// The seed of every recording and search.
const SEED: u64 = 1;

/// Runs of which the shortest counts.
const RUNS: usize = 15;

fn main() {
    let as_json = std::env::args().any(|argument| argument == "--json");
    let figures = json!({
        "limits": limits::figures(),
        "population": population::figures(),
        "documents": population::documents(),
        "estimate": [estimate(Demo::A), estimate(Demo::D)],
        "ingest": ingest(),
    });
    if as_json {
        println!("{figures}");
    } else {
        print_lines("", &figures);
    }
}

/// The shortest time of several runs [s], and what the last of them answered.
fn shortest<T>(runs: usize, mut run: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let started = Instant::now();
        let answer = run();
        (started.elapsed().as_secs_f64(), answer)
    };
    let (mut shortest, mut answer) = timed();
    for _ in 1..runs {
        let (seconds, next) = timed();
        shortest = f64::min(shortest, seconds);
        answer = next;
    }
    (shortest, answer)
}

/// The demonstration's job with its refinement and its standard errors.
fn estimate(demo: Demo) -> Value {
    let (problem, spec) = problem(demo);
    let (seconds, report) = shortest(5, || search(&problem, &spec));
    let truth = demo::true_parameters(demo);
    let errors: serde_json::Map<String, Value> = problem
        .coordinates
        .iter()
        .zip(&report.values)
        .filter_map(|(coordinate, value)| {
            let (_, truth) = truth.iter().find(|(name, _)| *name == coordinate.name)?;
            Some((coordinate.name.clone(), json!(1e2 * (value / truth - 1.0))))
        })
        .collect();
    let bounds: Vec<[f64; 2]> = problem
        .coordinates
        .iter()
        .map(|coordinate| [coordinate.lower, coordinate.upper])
        .collect();
    json!({
        "recording": demo.letter().to_string(),
        "seconds": seconds,
        "generations": report.generations,
        "candidates_simulated": report.counters.distinct_evaluations,
        "error_percent": errors,
        "bounds": bounds,
    })
}

fn search(problem: &Problem, spec: &JobSpec) -> Report {
    let never = AtomicBool::new(false);
    let mut run = Estimation::start(problem, &spec.method, spec.seed);
    let report = run
        .run(problem, &never, &mut ())
        .expect("the demonstration ends with an estimate");
    uncertainty::analyse(problem, &report, &uncertainty::Request::default(), &never)
        .expect("nothing interrupts the analysis");
    report
}

fn problem(demo: Demo) -> (Problem, JobSpec) {
    let job = Identification::of_job(demo::job(demo), demo::recording(demo, SEED));
    let (assembly, spec) = job
        .assembly()
        .expect("the demonstration's recording belongs to its job");
    (assembly.problem, spec)
}

/// Reading a recording of four columns from CSV.
fn ingest() -> Value {
    let mut text = "time [s],valve_command [1],position [m],chamber_pressure_1 [Pa]\n".to_owned();
    for sample in 0..400_000_u32 {
        let phase = f64::from(sample) * 0.01;
        text += &format!(
            "{:.3},{:.6},{:.6},{:.1}\n",
            f64::from(sample) * 1e-3,
            phase.sin(),
            0.07 + 0.01 * phase.cos(),
            3e6 + 1e5 * phase.sin()
        );
    }
    let (seconds, recording) = shortest(RUNS, || {
        Recording::from_csv(text.as_bytes()).expect("the recording is sound")
    });
    json!({
        "mebibytes": text.len() as f64 / f64::from(1 << 20),
        "samples": recording.summary().samples,
        "megabytes_per_second": text.len() as f64 / 1e6 / seconds,
    })
}

/// Every figure on a line of its own, named by its place.
fn print_lines(place: &str, figures: &Value) {
    let below = |name: &str| format!("{place}{}{name}", if place.is_empty() { "" } else { "." });
    match figures {
        Value::Object(members) => {
            for (name, value) in members {
                print_lines(&below(name), value);
            }
        }
        Value::Array(elements) => {
            for (index, value) in elements.iter().enumerate() {
                print_lines(&below(&index.to_string()), value);
            }
        }
        Value::Number(number) => {
            let number = number.as_f64().unwrap_or(f64::NAN);
            let places = if number.fract() == 0.0 { 0 } else { 4 };
            println!("{place:<50} {number:.places$}");
        }
        other => println!("{place:<50} {other}"),
    }
}
