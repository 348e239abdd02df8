//! Singular values of small matrices, by a method that always ends.
//!
//! Iterations of the QR kind never come to an end on numbers that are not finite. So a matrix with
//! such an entry, or with one whose square is not finite, is refused, and the iterations are
//! bounded.

use nalgebra::DMatrix;

/// Singular values, the largest first, with the directions that they belong to.
#[derive(Clone, Debug)]
pub struct SingularValues {
    /// The values.
    pub sizes: Vec<f64>,
    /// For each value the direction of length one that the matrix stretches by it.
    pub directions: Vec<Vec<f64>>,
}

/// Iterations for each row or column at the most; three are usual (G. H. Golub, C. F. Van Loan,
/// *Matrix Computations*, 2013, ch. 8.6).
const ITERATIONS_EACH: usize = 100;
/// An off-diagonal entry that is smaller beside its neighbours counts as zero.
const NEGLIGIBLE: f64 = 5.0 * f64::EPSILON;

/// Whether all entries and their squares are finite.
#[must_use]
pub fn has_finite_squares(matrix: &DMatrix<f64>) -> bool {
    matrix.iter().all(|entry| (entry * entry).is_finite())
}

/// The singular values of a matrix; none where it is empty, has an entry whose square is not
/// finite, or the iterations do not end.
#[must_use]
pub fn singular_values(matrix: &DMatrix<f64>) -> Option<SingularValues> {
    if matrix.is_empty() || !has_finite_squares(matrix) {
        return None;
    }
    let most = ITERATIONS_EACH * matrix.nrows().max(matrix.ncols());
    let decomposed = matrix.clone().try_svd(false, true, NEGLIGIBLE, most)?;
    let directions = decomposed.v_t?;
    Some(SingularValues {
        sizes: decomposed.singular_values.iter().copied().collect(),
        directions: directions
            .row_iter()
            .map(|direction| direction.iter().copied().collect())
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diagonal_matrix_has_its_entries_as_singular_values() {
        let matrix = DMatrix::from_row_slice(2, 2, &[0.0, -3.0, 2.0, 0.0]);
        let found = singular_values(&matrix).unwrap();
        assert!((found.sizes[0] - 3.0).abs() < 1e-15 && (found.sizes[1] - 2.0).abs() < 1e-15);
        assert!((found.directions[0][1].abs() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn what_overflows_is_refused_at_once() {
        for wild in [1e214, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            for size in [2, 3, 7] {
                let mut matrix = DMatrix::identity(size, size);
                matrix[(0, size - 1)] = wild;
                assert!(singular_values(&matrix).is_none(), "{wild}");
            }
        }
    }

    #[test]
    fn entries_of_any_finite_size_come_to_an_end() {
        let sizes = [1e150, 1e-150, 1e-300, 5e-324, 0.0, 1.0, 1e75];
        for shift in 0..sizes.len() {
            let matrix = DMatrix::from_fn(7, 7, |row, column| {
                sizes[(row + 2 * column + shift) % sizes.len()]
            });
            if let Some(found) = singular_values(&matrix) {
                // The Frobenius norm is that of the singular values.
                let norm = found.sizes.iter().map(|size| size * size).sum::<f64>();
                assert!((norm.sqrt() / matrix.norm() - 1.0).abs() < 1e-12);
            }
        }
    }
}
