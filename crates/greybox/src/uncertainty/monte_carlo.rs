//! Total uncertainty by drawing, without linear algebra.
//!
//! Every number that is taken as known is drawn from what is known of it, the noise is drawn anew,
//! and the estimate is fitted again, many times over: the propagation of distributions (JCGM
//! 101:2008, *Evaluation of measurement data – Supplement 1 to the GUM*). What the fits come to
//! stands beside the total of the budget ([`super::budget`]), which is linear.

use super::bootstrap::{DrawnFit, fitted, quantile};
use super::simulated_estimate::SimulatedEstimate;

/// How the fits to drawn data and drawn assumptions lie about an estimate, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The root mean square of their distances from it.
    pub standard_error: f64,
    /// The range that holds 95 % of them, as many below as above.
    pub interval: (f64, f64),
    /// How many they are.
    pub samples: u32,
}

/// How refits to drawn noise and drawn assumptions lie about an estimate, for each coordinate; none
/// where fewer than half of them could be fitted.
pub(super) fn spreads(estimate: &SimulatedEstimate, refits: &[DrawnFit]) -> Option<Vec<Spread>> {
    let fitted = fitted(refits)?;
    let coordinates = estimate.problem.coordinates.iter();
    let described = coordinates.zip(&estimate.report.positions).enumerate();
    let spread = described.map(|(index, (coordinate, position))| {
        let estimate = coordinate.value(*position);
        let values = fitted.iter().map(|fit| coordinate.value(fit[index]));
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let squares: f64 = values.iter().map(|value| (value - estimate).powi(2)).sum();
        Spread {
            standard_error: (squares / values.len() as f64).sqrt(),
            interval: (quantile(&values, 0.025), quantile(&values, 0.975)),
            samples: values.len() as u32,
        }
    });
    Some(spread.collect())
}
