//! Draws from posterior distributions: beside published draws, calibrated on simulated records, and the
//! same bits on any number of threads and after a resumption.

#![expect(clippy::unwrap_used, reason = "a test whose premise fails has failed")]

mod bits;
mod calibration;
mod lynx_hare;
mod twins;

use greybox::estimation::observer::Counters;
use greybox::estimation::refine::descend;
use greybox::estimation::report::Report;
use greybox::estimation::{Problem, StopReason};
use greybox::simulation::Accuracy;
use greybox::uncertainty::posterior::Posterior;
use greybox::uncertainty::{Intervals, Request, Settings, analyse};
use std::sync::atomic::AtomicBool;

/// The report of a descent from a start.
pub fn descended(problem: &Problem, start: Vec<f64>) -> Report {
    let never = AtomicBool::new(false);
    let descent = descend(problem, start, Accuracy::Full, &never).unwrap();
    Report {
        stop_reason: StopReason::Stagnation,
        values: problem.values(&descent.positions),
        positions: descent.positions,
        cost: descent.cost,
        generations: 0,
        counters: Counters::default(),
        best_credit: None,
        best_generation: None,
        declared_positions: None,
        searches: Vec::new(),
        starts: Vec::new(),
        floor: None,
        twins: Vec::new(),
    }
}

/// Draws from the posterior about an estimate.
pub fn draw(problem: &Problem, report: &Report, generations: u32, seed: u64) -> Posterior {
    let request = Request {
        settings: Settings {
            intervals: Intervals::Posterior,
            posterior_generations: generations,
            ..Settings::default()
        },
        seed,
        ..Request::default()
    };
    let never = AtomicBool::new(false);
    let analysis = analyse(problem, report, &request, &never).unwrap();
    *analysis.posterior.unwrap()
}
