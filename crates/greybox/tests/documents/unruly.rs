//! Random plants that explode, chatter, are stiff or stand still: whatever a job on them does, it
//! ends when it is told to.

use greybox::recording::{Recording, Signal, TimeAxis};
use greybox::{Identification, IdentificationError};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde_json::{Map, Value, json};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

const DOCUMENTS: u64 = 1000;

/// A job that has not ended so long after it was told to hangs.
const HANGS: Duration = Duration::from_secs(60);

/// An expression over these names, random and often nonsense.
fn expression(random: &mut impl Rng, names: &[String], depth: u32) -> String {
    let mut part = |depth| expression(random, names, depth);
    if depth == 0 {
        let pick = random.random_range(0..names.len() + 1);
        return match names.get(pick) {
            Some(name) => name.clone(),
            None => format!("{:.3e}", 10_f64.powf(random.random_range(-3.0..4.0))),
        };
    }
    let (a, b) = (part(depth - 1), part(depth - 1));
    match random.random_range(0..14) {
        0 | 1 => format!("({a} + {b})"),
        2 | 3 => format!("({a} - {b})"),
        4..=6 => format!("({a} * {b})"),
        7 => format!("({a} / {b})"),
        8 => format!("exp({a})"),
        9 => format!("sign({a}) * {b}"),
        10 => format!("sqrt(abs({a}))"),
        11 => format!("if({a} > {b}, {b}, -{a})"),
        12 => format!("({a})^3"),
        _ => format!("sin({a}) / ({b} - {a})"),
    }
}

/// One to four states, one to three unknowns over up to twelve decades, with or without an input.
fn job(random: &mut impl Rng) -> Value {
    let states: Vec<String> = (0..random.random_range(1..5))
        .map(|k| format!("x{k}"))
        .collect();
    let parameters: Vec<String> = (0..random.random_range(1..4))
        .map(|k| format!("p{k}"))
        .collect();
    let mut names = [&states[..], &parameters[..]].concat();
    let mut document = json!({"name": "unruly"});
    if random.random() {
        document["inputs"] = json!({"u": {"unit": "1"}});
        names.push("u".to_owned());
    }
    let decades = |random: &mut dyn Rng| 10_f64.powf(random.random_range(0.0..6.0));
    let known = parameters.iter().map(|name| {
        let (lower, upper) = (1.0 / decades(random), decades(random));
        let said = json!({"unit": "1", "default": 1, "lower": lower, "upper": upper,
                          "scale": "log"});
        (name.clone(), said)
    });
    document["parameters"] = Value::Object(known.collect());
    let rates = states.iter().map(|name| {
        let rate = expression(random, &names, 3);
        let own = if random.random() {
            format!(" - {:.1e}*{name}", decades(random))
        } else {
            String::new()
        };
        let start: f64 = random.random_range(-2.0..2.0);
        (
            name.clone(),
            json!({"unit": "1", "initial": start, "derivative": format!("{rate}{own}")}),
        )
    });
    document["states"] = Value::Object(rates.collect());
    let first = &states[0];
    document["outputs"] = json!({"y": {"unit": "1", "expression": first}});
    let freed = parameters
        .iter()
        .map(|name| (name.clone(), json!({"estimate": {}})));
    let freed: Map<String, Value> = freed.collect();
    let intervals = ["fisher", "profile"][random.random_range(0..2)];
    json!({"model": document, "parameters": freed, "seed": 1,
           "uncertainty": {"flat_directions": "report", "intervals": intervals},
           "method": {"generations": random.random_range(1..60)}})
}

fn recording(random: &mut impl Rng) -> Recording {
    let samples = random.random_range(20..2000);
    let mut level = 0.0;
    let walk = (0..samples).map(|_| {
        level += random.random_range(-0.1..0.1);
        level
    });
    let walk: Vec<f64> = walk.collect();
    let square = (0..samples).map(|k| if k / 7 % 2 == 0 { 1.0 } else { -1.0 });
    let time = TimeAxis::Uniform {
        sample_time: 0.1,
        samples,
    };
    let signals = vec![
        Signal::new("u", "1", square.collect()),
        Signal::new("y", "1", walk),
    ];
    Recording::new(time, signals)
}

/// Runs the job on these threads, and stops it where it has not ended by itself. Answers how long it
/// took to end then; none where it had ended.
fn stopped(
    threads: &ThreadPool,
    job: Value,
    recording: Recording,
    patience: Duration,
) -> Option<Duration> {
    let stop = AtomicBool::new(false);
    let (sender, ended) = mpsc::channel();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let identification = Identification::of_job(job.clone(), recording);
            let outcome = threads.install(|| identification.run_observed(&stop, &mut ()));
            if let Err(IdentificationError::Invalid(faults)) = &outcome {
                // A parameter that no expression uses cannot be told from any other.
                assert!(!faults.is_empty());
            }
            sender.send(()).expect("it is waited for");
        });
        if ended.recv_timeout(patience).is_ok() {
            return None;
        }
        let told = Instant::now();
        stop.store(true, Ordering::Relaxed);
        if ended.recv_timeout(HANGS).is_err() {
            // The thread cannot be ended, nor the test while it runs.
            eprintln!("does not end: {job}");
            std::process::exit(1);
        }
        Some(told.elapsed())
    })
}

#[test]
fn whatever_the_equations_do_a_job_ends_when_it_is_told_to() {
    // The threads that all tests share may be busy with one long fit each.
    let threads = ThreadPoolBuilder::new().num_threads(2);
    let threads = threads.build().expect("two threads can be started");
    let mut longest = Duration::ZERO;
    let mut count = 0;
    for seed in 0..DOCUMENTS {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (job, recording) = (job(&mut random), recording(&mut random));
        let patience = Duration::from_millis(random.random_range(1..60));
        if let Some(took) = stopped(&threads, job, recording, patience) {
            count += 1;
            if took > longest {
                println!("document {seed}: {took:?}");
            }
            longest = longest.max(took);
        }
    }
    println!("{count} of {DOCUMENTS} were stopped, the slowest took {longest:?}");
    assert!(count > 100, "most take longer than they are given");
}
