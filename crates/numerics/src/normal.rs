//! Normal distributions of several numbers together.

use super::symmetric;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A direction in which a posterior is narrower than its prior by less than this share of the
/// variance is taken to be this much narrower: the difference would be one of rounding errors.
const LEAST_NEWS: f64 = 1e-9;

/// A normal distribution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Normal {
    /// The mean of each number.
    pub mean: Vec<f64>,
    /// The covariance of the numbers, row by row.
    pub covariance: Vec<Vec<f64>>,
}

impl Normal {
    /// What data say of themselves, where a prior and they together make this: the distribution
    /// N(z, R) with `P⁻¹ = M⁻¹ + R⁻¹` and `P⁻¹·x = M⁻¹·m + R⁻¹·z` for this one's N(x, P) and the
    /// prior's N(m, M). None where a covariance is not positive definite.
    ///
    /// With `W·M·Wᵀ = 1` and the axes `W·P·Wᵀ = V·λ·Vᵀ`, whose λ lie between 0 (the data know all)
    /// and 1 (they know nothing), `W·R·Wᵀ = V·λ/(1 − λ)·Vᵀ` and
    /// `W·(z − m) = V·1/(1 − λ)·Vᵀ·W·(x − m)`.
    #[must_use]
    pub fn without(&self, prior: &Normal) -> Option<Normal> {
        let n = self.mean.len();
        let whitening = matrix(&symmetric::whitening(&prior.covariance)?);
        let inverse = whitening.solve_lower_triangular(&DMatrix::identity(n, n))?;
        let white = &whitening * matrix(&self.covariance) * whitening.transpose();
        let axes = symmetric::axes(&rows(&white));
        if axes.iter().any(|axis| axis.value <= 0.0) {
            return None;
        }
        let middle = DVector::from_column_slice(&prior.mean);
        let off = &whitening * (DVector::from_column_slice(&self.mean) - &middle);
        let mut shift = DVector::zeros(n);
        let mut spread = DMatrix::zeros(n, n);
        for axis in axes {
            let news = (1.0 - axis.value).max(LEAST_NEWS);
            let direction = DVector::from_vec(axis.direction);
            shift += &direction * (direction.dot(&off) / news);
            spread += &direction * direction.transpose() * (axis.value / news);
        }
        let mean = middle + &inverse * shift;
        Some(Normal {
            mean: mean.iter().copied().collect(),
            covariance: rows(&(&inverse * spread * inverse.transpose())),
        })
    }
}

fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    let n = rows.len();
    DMatrix::from_fn(n, n, |row, column| rows[row][column])
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let rows = matrix.row_iter();
    rows.map(|row| row.iter().copied().collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A covariance with these deviations and correlations of at most a half in size, which is positive
    /// definite for three numbers.
    fn covariance(deviations: &[f64], correlations: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(3, 3, |a, b| {
            let between = if a == b { 1.0 } else { correlations[a + b - 1] };
            between * deviations[a] * deviations[b]
        })
    }

    proptest! {
        #[test]
        fn what_is_left_is_what_was_put_together(
            mean in prop::collection::vec(-5.0..5.0f64, 6),
            deviations in prop::collection::vec(0.1..10.0f64, 6),
            correlations in prop::collection::vec(-0.45..0.45f64, 6),
        ) {
            let prior = covariance(&deviations[..3], &correlations[..3]);
            let own = covariance(&deviations[3..], &correlations[3..]);
            let [m, z] = [&mean[..3], &mean[3..]].map(DVector::from_column_slice);
            let [prior_inverse, own_inverse] =
                [&prior, &own].map(|c| c.clone().try_inverse().unwrap());
            let joint = (&prior_inverse + &own_inverse).try_inverse().unwrap();
            let x = &joint * (prior_inverse * &m + own_inverse * &z);
            let normal = |mean: &DVector<f64>, covariance: &DMatrix<f64>| Normal {
                mean: mean.iter().copied().collect(),
                covariance: rows(covariance),
            };
            let found = normal(&x, &joint).without(&normal(&m, &prior)).unwrap();
            for a in 0..3 {
                let deviation = own[(a, a)].sqrt();
                prop_assert!((found.mean[a] - z[a]).abs() < 1e-6 * deviation);
                for b in 0..3 {
                    let size = deviation * own[(b, b)].sqrt();
                    prop_assert!((found.covariance[a][b] - own[(a, b)]).abs() < 1e-6 * size);
                }
            }
        }
    }

    #[test]
    fn data_that_know_one_direction_say_nothing_of_the_other() {
        // The data know the sum of two numbers, whose prior is 0 ± 1 each: 3 ± 1.
        let prior = Normal {
            mean: vec![0.0, 0.0],
            covariance: vec![vec![1.0, 0.0], vec![0.0, 1.0]],
        };
        // The sum is 0 ± √2 before: afterwards 2 with a variance of 2/3; the difference stays.
        let joint = Normal {
            mean: vec![1.0, 1.0],
            covariance: vec![vec![2.0 / 3.0, -1.0 / 3.0], vec![-1.0 / 3.0, 2.0 / 3.0]],
        };
        let alone = joint.without(&prior).unwrap();
        assert!(
            alone
                .covariance
                .iter()
                .enumerate()
                .all(|(k, row)| row[k] > 1e8)
        );
        let sum: f64 = alone.covariance.iter().flatten().sum();
        assert!((alone.mean.iter().sum::<f64>() - 3.0).abs() < 1e-6);
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    }

    #[test]
    fn a_covariance_that_is_none_has_no_answer() {
        let of = |between: f64| Normal {
            mean: vec![0.0, 0.0],
            covariance: vec![vec![1.0, between], vec![between, 1.0]],
        };
        assert_eq!(of(0.5).without(&of(1.1)), None);
        assert_eq!(of(1.1).without(&of(0.5)), None);
    }
}
