//! What theory says of a recording, at the values that are known to be true.

use super::NEVER;
use greybox::estimation::{Problem, refine, sensitivity};
use greybox::numerics::least_squares::RowGatherer;
use greybox::simulation::Accuracy;

/// The estimate linearised at the truth.
pub struct FirstOrder {
    /// The square roots of the Cramér–Rao bounds, as shares of the search ranges.
    pub bounds: Vec<f64>,
    /// The errors that the recording's own noise leads to, in these.
    pub errors: Vec<f64>,
}

impl FirstOrder {
    /// With J the derivatives of the residuals r at the truth: the bounds are those of (JᵀJ)⁻¹,
    /// the estimate lies −(JᵀJ)⁻¹Jᵀr from the truth.
    pub fn at(problem: &Problem, truth: &[f64]) -> FirstOrder {
        let mut rows = RowGatherer::new(truth.len());
        let full = Accuracy::Full;
        let gather = |row: sensitivity::Row<'_>| {
            rows.add(row.derivatives.iter().copied(), row.residual);
        };
        sensitivity::visit_rows(problem, truth, full, &NEVER, gather)
            .expect("the rig is simulated");
        let triangle = rows.finish();
        let factor = triangle.factor();
        let information = factor.transpose() * factor;
        let covariance = information
            .try_inverse()
            .expect("the recording fixes its unknowns");
        let errors = -&covariance * triangle.gradient();
        let bounds: Vec<f64> = (0..truth.len())
            .map(|index| covariance[(index, index)].sqrt())
            .collect();
        let errors = errors.iter().zip(&bounds);
        FirstOrder {
            errors: errors.map(|(error, bound)| error / bound).collect(),
            bounds,
        }
    }
}

/// The cost at the bottom of the minimum in which the truth lies.
pub fn floor(problem: &Problem, truth: &[f64]) -> f64 {
    let descent = refine::descend(problem, truth.to_vec(), Accuracy::Full, &NEVER);
    descent
        .and_then(|descent| descent.cost)
        .expect("the rig is simulated")
}
