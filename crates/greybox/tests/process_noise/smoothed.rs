//! What the smoother says acted on a rig, beside what acted: at the true values the errors are those that the
//! smoother gives, and what it calls unexpected is as rare as chance.

use super::coverage::{Disturbed, TRUTH, TrueRecord, model, record_with_truth};
use greybox::Identification;
use greybox::estimation::process_noise::{NoiseModel, NoiseNumber, ProcessNoise};
use greybox::estimation::smoothing::{SmoothedExperiment, smoothed};
use greybox::simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use std::sync::atomic::AtomicBool;

const RECORDS: u64 = 6;

/// The record as the smoother puts it, at the true values.
fn smooth(record: TrueRecord, kind: DisturbanceKind) -> (SmoothedExperiment, Vec<f64>) {
    let identification = Identification::new(&model(), record.recording).hold_back(0.25);
    let problem = identification.problem().unwrap();
    let coordinates = problem.coordinates.iter().zip(TRUTH);
    let positions: Vec<f64> = coordinates
        .map(|(of, value)| of.scale.position(value, of.lower, of.upper))
        .collect();
    let has_memory = kind == DisturbanceKind::Memory;
    // 2 N on 10 kg that remember 0.5 s; 1 N·√s on 10 kg.
    let strength = if has_memory { 0.2 } else { 0.1 };
    let noise = NoiseModel {
        disturbances: vec![ProcessNoise {
            name: "v".to_owned(),
            disturbance: Disturbance {
                acts_on: ActsOn::Rate(1),
                kind,
            },
            strength: NoiseNumber::Given(strength),
            time_constant: has_memory.then_some(NoiseNumber::Given(0.5)),
        }],
        sensors: vec![NoiseNumber::Given(1e-4)],
        steps: 2,
    };
    let never = AtomicBool::new(false);
    let smoothed = smoothed(&problem, &positions, &noise, &never);
    (smoothed.unwrap().unwrap().remove(0), record.disturbance)
}

fn mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
    assert!(values.len() > 5000);
    values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64
}

fn check(disturbed: Disturbed, kind: DisturbanceKind) {
    let mut errors = Vec::new();
    let mut residuals = Vec::new();
    let mut n_events = 0;
    for seed in 0..RECORDS {
        let (smoothed, truth) = smooth(record_with_truth(disturbed, 0.0, seed), kind);
        let path = &smoothed.record.disturbances[0];
        let pairs = path.values.iter().zip(&path.deviations).zip(&truth);
        errors.extend(pairs.map(|((value, deviation), truth)| (value - truth) / deviation));
        residuals.extend(smoothed.record.residuals[0].iter().copied());
        n_events += smoothed.events[0].len();
    }
    // Neighbouring errors are alike: 6000 of them count as several hundred.
    let of_errors = mean_square(errors.iter().copied());
    let of_residuals = mean_square(residuals.into_iter());
    let inside = errors.iter().filter(|error| error.abs() < 1.96).count();
    let share = inside as f64 / errors.iter().filter(|error| !error.is_nan()).count() as f64;
    println!("{kind:?}: errors {of_errors}, inside {share}, t {of_residuals}, {n_events} events");
    assert!((of_errors - 1.0).abs() < 0.15);
    assert!((share - 0.95).abs() < 0.02);
    assert!((of_residuals - 1.0).abs() < 0.15);
    assert!(n_events <= 2);
}

#[test]
fn the_band_of_a_load_with_memory_holds_the_load_that_acted() {
    check(Disturbed::Memory, DisturbanceKind::Memory);
}

#[test]
fn the_band_of_a_white_load_holds_the_load_that_acted() {
    check(Disturbed::White, DisturbanceKind::White);
}
