//! Whether a model starts where its data do.

use crate::estimation::problem::Problem;
use crate::estimation::trajectory;
use greybox_numerics::statistics;
use std::sync::atomic::AtomicBool;

/// Points of the search box that the start is looked at, the same in each direction.
const POINTS: [f64; 3] = [0.5, 0.25, 0.75];
/// A start lies elsewhere where it is off by more than this share of the range of the data …
const SHARE_OF_RANGE: f64 = 0.1;
/// … and by more than so many standard deviations of what changes from sample to sample.
const DEVIATIONS: f64 = 6.0;

/// An output that starts elsewhere in the model than in the data.
#[derive(Clone, Debug, PartialEq)]
pub struct StartsElsewhere {
    /// The name of the output.
    pub output: String,
    /// The SI unit of the output.
    pub unit: String,
    /// The first measured sample, SI.
    pub measured: f64,
    /// What the model has at that sample, SI: of the points that were looked at the nearest.
    pub simulated: f64,
}

/// The first output that starts elsewhere in the model than in the data of some experiment, whatever the unknowns
/// are. Nothing where the model cannot be simulated, or `stop` was raised.
#[must_use]
pub fn starts_elsewhere(problem: &Problem, stop: &AtomicBool) -> Option<StartsElsewhere> {
    let mut simulated = Vec::new();
    for point in POINTS {
        let positions = vec![point; problem.coordinates.len()];
        simulated.extend(trajectory::simulate(problem, &positions, stop)?.ok());
    }
    let experiments = problem.experiments.iter().enumerate();
    let mut starts = experiments.flat_map(|(place, experiment)| {
        let outputs = problem.outputs.iter().zip(&experiment.measured);
        outputs.map(move |(output, measured)| (place, output, measured))
    });
    starts.find_map(|(place, output, measured)| {
        let first = measured.iter().position(|sample| !sample.is_nan())?;
        let starts = simulated
            .iter()
            .map(|outputs| outputs[place][output.index][first]);
        let off = |start: &f64| (start - measured[first]).abs();
        let nearest = starts.min_by(|a, b| off(a).total_cmp(&off(b)))?;
        (off(&nearest) > tolerated(measured)).then(|| StartsElsewhere {
            output: output.name.clone(),
            unit: output.unit.clone(),
            measured: measured[first],
            simulated: nearest,
        })
    })
}

/// How far the start of a model may be off data.
pub(super) fn tolerated(measured: &[f64]) -> f64 {
    let (low, high) = statistics::range(measured).unwrap_or_default();
    let there = measured.iter().filter(|sample| !sample.is_nan());
    let there: Vec<f64> = there.copied().collect();
    let changes = there.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
    let variance = changes.sum::<f64>() / (2.0 * (there.len() as f64 - 1.0)).max(1.0);
    f64::max(SHARE_OF_RANGE * (high - low), DEVIATIONS * variance.sqrt())
}
