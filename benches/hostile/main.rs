//! How long a hostile document keeps the server: from its text to the faults that it is told.
//!
//! `cargo bench --bench hostile` prints a row for each body of `tests/documents/bodies.rs`; the
//! shortest of several runs counts, because whatever else the machine does only adds to a time.

#[path = "../../crates/greybox/tests/documents/bodies.rs"]
mod bodies;

use bodies::{Body, bodies};
use greybox::model::document;
use greybox::parsing::{Fault, json, yaml};
use std::time::Instant;

/// Runs of which the shortest counts.
const RUNS: usize = 5;

fn main() {
    println!("{:>9} {:>9} {:>7}  body: first fault", "ms", "kB", "faults");
    for body in bodies() {
        let mut shortest = f64::INFINITY;
        let mut told = (0, String::new());
        for _ in 0..RUNS {
            let started = Instant::now();
            told = answer(&body);
            shortest = shortest.min(started.elapsed().as_secs_f64());
        }
        let (count, first) = told;
        let first: String = first.chars().take(60).collect();
        println!(
            "{:9.1} {:9} {count:7}  {}{}: {first}",
            shortest * 1e3,
            body.text.len() / 1024,
            if body.is_yaml { "YAML, " } else { "" },
            body.name,
        );
    }
}

/// How many faults the document has, and the first.
fn answer(body: &Body) -> (usize, String) {
    let parsed = if body.is_yaml {
        yaml::parse(&body.text).map_err(|error| error.to_string())
    } else {
        json::parse(body.text.as_bytes()).map_err(|error| error.to_string())
    };
    let document = match parsed {
        Ok(document) => document,
        Err(error) => return (1, error),
    };
    match document::referenced(&document) {
        Ok(_) => (0, "none".to_owned()),
        Err(faults) => (
            faults.len(),
            faults.first().map(Fault::to_string).unwrap_or_default(),
        ),
    }
}
