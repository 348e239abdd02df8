//! The principal axes of a symmetric matrix, and what makes a covariance one of unit size.

use super::singular_values::has_finite_squares;
use nalgebra::{DMatrix, SymmetricEigen};

/// An eigenvector of length one and its eigenvalue.
#[derive(Clone, Debug)]
pub struct PrincipalAxis {
    /// The eigenvalue.
    pub value: f64,
    /// The eigenvector.
    pub direction: Vec<f64>,
}

/// Iterations for each row at the most; a few are usual.
const ITERATIONS_EACH: usize = 100;

/// The axes of a symmetric matrix of finite numbers, given row by row. Small eigenvalues are
/// exact to a rounding error of the largest. Where a square is not finite there are none to be
/// had: then the axes are those of the diagonal alone.
#[must_use]
pub fn axes(rows: &[Vec<f64>]) -> Vec<PrincipalAxis> {
    let n = rows.len();
    let matrix = DMatrix::from_fn(n, n, |row, column| rows[row][column]);
    let decomposed = has_finite_squares(&matrix)
        .then(|| SymmetricEigen::try_new(matrix.clone(), f64::EPSILON, ITERATIONS_EACH * n))
        .flatten()
        .unwrap_or_else(|| SymmetricEigen {
            eigenvalues: matrix.diagonal(),
            eigenvectors: DMatrix::identity(n, n),
        });
    let columns = decomposed.eigenvectors.column_iter();
    let pairs = decomposed.eigenvalues.iter().zip(columns);
    pairs
        .map(|(value, direction)| PrincipalAxis {
            value: *value,
            direction: direction.iter().copied().collect(),
        })
        .collect()
}

/// A pivot below this share of its variance is rounding.
const ROUNDING: f64 = 1e-12;

/// W with WᵀW the inverse of a covariance, given row by row; none where that is not positive
/// definite.
#[must_use]
pub fn whitening(rows: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = rows.len();
    let matrix = DMatrix::from_fn(n, n, |row, column| rows[row][column]);
    let lower = matrix.clone().cholesky()?.unpack();
    let is_sound = |index: usize| {
        let pivot = lower[(index, index)];
        pivot * pivot > ROUNDING * matrix[(index, index)]
    };
    if !(0..n).all(is_sound) {
        return None;
    }
    let inverse = lower.solve_lower_triangular(&DMatrix::identity(n, n))?;
    let row = |row: usize| inverse.row(row).iter().copied().collect();
    Some((0..n).map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_axes_put_together_give_the_matrix_back(
            entries in prop::collection::vec(-10.0..10.0f64, 15),
            size in 1usize..=5,
        ) {
            let entry = |a: usize, b: usize| entries[a.max(b) * (a.max(b) + 1) / 2 + a.min(b)];
            let rows: Vec<Vec<f64>> = (0..size)
                .map(|row| (0..size).map(|column| entry(row, column)).collect())
                .collect();
            let axes = axes(&rows);
            for place in 0..size * size {
                let (row, column) = (place / size, place % size);
                let products = || axes.iter().map(|a| a.direction[row] * a.direction[column]);
                let unit: f64 = products().sum();
                prop_assert!((unit - f64::from(row == column)).abs() < 1e-12);
                let parts = axes.iter().zip(products());
                let sum: f64 = parts.map(|(axis, product)| axis.value * product).sum();
                prop_assert!((sum - rows[row][column]).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn a_matrix_that_overflows_comes_to_an_end_with_the_axes_of_its_diagonal() {
        for wild in [1e200, f64::INFINITY, f64::NAN] {
            let axes = axes(&[vec![1.0, wild], vec![wild, 2.0]]);
            assert_eq!([axes[0].value, axes[1].value], [1.0, 2.0]);
            assert_eq!(axes[1].direction, [0.0, 1.0]);
        }
    }

    #[test]
    fn a_matrix_of_zeros_has_axes_too() {
        for size in 1..4 {
            let axes = axes(&vec![vec![0.0; size]; size]);
            assert_eq!(axes.len(), size);
            assert!(axes.iter().all(|axis| axis.value == 0.0));
        }
    }
}
