//! Two minima that explain the data as well: chains go from one to the other.

use super::{descended, draw};
use greybox::model::Model;
use greybox::numerics::rng::{Purpose, normal, stream};
use greybox::{Identification, Recording};

/// A plant that shows the square of its unknown.
const SQUARE: &str = r#"{
    "name": "square", "title": "square",
    "inputs": {"drive": {"unit": "1"}},
    "parameters": {
        "root": {"unit": "1", "default": 1, "lower": -4, "upper": 4, "unknown": true}
    },
    "states": {"x": {"unit": "1", "derivative": "root^2*drive - x", "initial": 0}},
    "outputs": {"seen": {"unit": "1", "expression": "x"}}
}"#;

#[test]
fn chains_see_both_of_two_minima_as_often_as_the_data_allow() {
    let mut rng = stream(4, 1, Purpose::Noise);
    let seen = (0..40).map(|k| 1.0 - (-0.2 * f64::from(k)).exp() + 0.05 * normal(&mut rng));
    let recording = Recording::from_samples(
        0.2,
        [("drive", "1", vec![1.0; 40]), ("seen", "1", seen.collect())],
    );
    let model = Model::from_text(SQUARE).unwrap();
    let identification = Identification::new(&model, recording).hold_back(0.0);
    let problem = identification.noise("seen", 0.05).problem().unwrap();
    let mut report = descended(&problem, vec![0.62]);
    let root = report.values[0];
    assert!((root - 1.0).abs() < 0.05, "{root}");
    report.twins = vec![vec![("root".to_owned(), -root)]];
    let posterior = draw(&problem, &report, 3000, 1);
    let drawn = &posterior.coordinates[0];
    let convergence = drawn.convergence.unwrap();
    assert!(drawn.has_converged(), "{convergence:?}");
    // Both are as likely: the mean is 0, and the standard deviation nearly the root itself.
    let error = drawn.standard_deviation / convergence.ess_bulk.sqrt();
    assert!(drawn.mean.abs() < 4.0 * error, "{} ± {error}", drawn.mean);
    assert!((drawn.standard_deviation / root - 1.0).abs() < 0.02);
}
