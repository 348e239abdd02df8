//! Total uncertainty by drawing, without linear algebra.
//!
//! Every number that is taken as known is drawn from what is known of it, the noise is drawn anew,
//! and the estimate is fitted again, many times over: the propagation of distributions (JCGM
//! 101:2008, *Evaluation of measurement data – Supplement 1 to the GUM*). What the fits come to
//! stands beside the total of the budget ([`super::budget`]), which is linear.

use super::bootstrap::{DrawnFit, fitted, quantile};
use super::simulated_estimate::SimulatedEstimate;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Fits in which the noise and all that was taken as known were drawn anew (JCGM 101): beside the
/// total standard error and interval, which are linear.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct MonteCarlo {
    /// The root mean square of the distances of the fits from the estimate, SI.
    #[schema(example = 0.83)]
    pub standard_error: f64,
    /// The lower end of the range that holds 95 % of the fits, SI.
    #[schema(example = 56.4)]
    pub lower: f64,
    /// The upper end, SI.
    #[schema(example = 59.7)]
    pub upper: f64,
    /// The fits that it was made from.
    #[schema(example = 1000)]
    pub samples: u32,
}

/// How refits to drawn noise and drawn assumptions lie about an estimate, for each coordinate; none
/// where fewer than half of them could be fitted.
pub(super) fn of_coordinates(
    estimate: &SimulatedEstimate,
    refits: &[DrawnFit],
) -> Option<Vec<MonteCarlo>> {
    let fitted = fitted(refits)?;
    let coordinates = estimate.problem.coordinates.iter();
    let described = coordinates.zip(&estimate.report.positions).enumerate();
    let drawn = described.map(|(index, (coordinate, position))| {
        let estimate = coordinate.value(*position);
        let values = fitted.iter().map(|fit| coordinate.value(fit[index]));
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let squares: f64 = values.iter().map(|value| (value - estimate).powi(2)).sum();
        MonteCarlo {
            standard_error: (squares / values.len() as f64).sqrt(),
            lower: quantile(&values, 0.025),
            upper: quantile(&values, 0.975),
            samples: values.len() as u32,
        }
    });
    Some(drawn.collect())
}
