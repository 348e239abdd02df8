//! A recording with wild samples, against an independent computation: where the output is linear in
//! the unknowns, Huber's estimate is the fixed point of reweighted least squares.

use crate::joint::{DECLARED, Data, Own, job, record};
use crate::run::run;
use greybox::identification::Outcome;
use nalgebra::{DMatrix, DVector};
use serde_json::json;

const THRESHOLD: f64 = 1.345;
/// Every so manieth sample is wild ...
const WILD: usize = 15;
/// ... by so much.
const SPIKE: f64 = 12.0;

fn record_with_spikes() -> Data {
    let mut data = record(Own::Offset);
    let signals = &mut data.recording.signals;
    let output = signals.iter_mut().find(|signal| signal.name == "y");
    let values = &mut output.expect("the output is recorded").values;
    for (value, measured) in values.iter_mut().zip(&mut data.measured).step_by(WILD) {
        *value += SPIKE;
        *measured += SPIKE;
    }
    data
}

/// The estimate and its standard errors `τ·√diag (XᵀX)⁻¹`, `τ² = Σψ²/(n − p)/(share of |r| ≤ k)²`.
fn reweighted(data: &Data) -> (DVector<f64>, Vec<f64>) {
    let (n, p) = data.columns.shape();
    let limit = THRESHOLD * DECLARED;
    let mut found = DVector::zeros(p);
    for _ in 0..500 {
        let residuals = &data.measured - &data.columns * &found;
        let weights = residuals.map(|r| {
            if r.abs() > limit {
                limit / r.abs()
            } else {
                1.0
            }
        });
        let weighted = DMatrix::from_fn(n, p, |row, column| {
            weights[row] * data.columns[(row, column)]
        });
        let normal = weighted.transpose() * &data.columns;
        let inverse = normal.try_inverse().expect("columns apart");
        found = inverse * weighted.transpose() * &data.measured;
    }
    let residuals = &data.measured - &data.columns * &found;
    let squares: f64 = residuals
        .iter()
        .map(|r| r.clamp(-limit, limit).powi(2))
        .sum();
    let inside = residuals.iter().filter(|r| r.abs() <= limit).count() as f64 / n as f64;
    let level = (squares / (n - p) as f64).sqrt() / inside;
    let information = (data.columns.transpose() * &data.columns).try_inverse();
    let covariance = information.expect("columns apart");
    let errors = (0..p).map(|k| level.max(DECLARED) * covariance[(k, k)].sqrt());
    (found, errors.collect())
}

fn estimate(data: &Data, huber: bool, intervals: &str) -> Outcome {
    let mut job = job(Own::Offset, &[0, 1]);
    if huber {
        job["method"]["huber_threshold"] = json!(THRESHOLD);
    }
    job["uncertainty"] = json!({ "intervals": intervals, "bootstrap_samples": 100 });
    run(job, data.recording.clone())
}

#[test]
fn wild_samples_do_not_pull_the_estimate_away_and_are_counted() {
    let data = record_with_spikes();
    let (expected, errors) = reweighted(&data);
    let huber = estimate(&data, true, "fisher");
    for (place, known) in huber.parameters.iter().enumerate() {
        let known = &known.estimate;
        let distance = (known.estimate - expected[place]).abs() / errors[place];
        assert!(distance < 1e-2, "{place}: {distance} standard errors off");
        let ratio = known.standard_error.expect("an error") / errors[place];
        assert!((ratio - 1.0).abs() < 1e-2, "{place}: {ratio}");
    }
    let spikes = data.measured.len().div_ceil(WILD) as u64;
    let counted = huber.residuals["y"].outliers.expect("a count");
    assert!((spikes..spikes + 60).contains(&counted), "{counted}");

    // The wild samples pull both offsets up, by their share times the spike.
    let squared = estimate(&data, false, "fisher");
    let offset = |outcome: &Outcome| outcome.parameters[1].estimate.estimate;
    let pulled = offset(&squared) - offset(&huber);
    assert!(pulled > 0.6 * SPIKE / WILD as f64, "{pulled}");
    assert_eq!(squared.residuals["y"].outliers, None);
}

#[test]
fn the_bootstrap_of_robust_fits_is_as_wide_as_the_asymptotic_interval() {
    let data = record_with_spikes();
    let widths = |outcome: &Outcome| -> Vec<f64> {
        let intervals = outcome.parameters.iter();
        let intervals = intervals.map(|known| known.estimate.confidence_interval.as_ref());
        intervals
            .map(|interval| {
                let interval = interval.expect("an interval");
                interval.upper.expect("an end") - interval.lower.expect("an end")
            })
            .collect()
    };
    let asymptotic = widths(&estimate(&data, true, "fisher"));
    let resampled = widths(&estimate(&data, true, "bootstrap"));
    for (asymptotic, resampled) in asymptotic.iter().zip(&resampled) {
        let ratio = resampled / asymptotic;
        assert!((0.7..1.4).contains(&ratio), "{ratio}");
    }
}
