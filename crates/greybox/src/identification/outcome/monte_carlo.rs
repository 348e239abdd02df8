//! The total uncertainty by drawing, in a result.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::uncertainty::monte_carlo::Spread;

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

impl MonteCarlo {
    /// What the analysis of an estimate says.
    pub(crate) fn of(spread: Spread) -> MonteCarlo {
        let (lower, upper) = spread.interval;
        MonteCarlo {
            standard_error: spread.standard_error,
            lower,
            upper,
            samples: spread.samples,
        }
    }
}
