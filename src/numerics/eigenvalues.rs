//! The eigenvalues of a matrix of any kind.

use super::singular_values::has_finite_squares;
use nalgebra::{DMatrix, Schur};

/// Iterations for each row at the most; a few are usual.
const ITERATIONS_EACH: usize = 100;

/// The size of the largest eigenvalue; 0 where a square is not finite.
#[must_use]
pub fn spectral_radius(matrix: &DMatrix<f64>) -> f64 {
    let found = (!matrix.is_empty() && has_finite_squares(matrix))
        .then(|| {
            Schur::try_new(
                matrix.clone(),
                f64::EPSILON,
                ITERATIONS_EACH * matrix.nrows(),
            )
        })
        .flatten();
    let values = found.map(|schur| schur.complex_eigenvalues());
    let sizes = values
        .iter()
        .flatten()
        .map(|value| value.re.hypot(value.im));
    sizes.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oscillator_has_its_natural_frequency() {
        // x'' + 2·0.1·7·x' + 49·x = 0
        let matrix = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -49.0, -1.4]);
        assert!((spectral_radius(&matrix) - 7.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_not_finite_has_none() {
        let matrix = DMatrix::from_row_slice(2, 2, &[0.0, f64::NAN, 1e200, -1.4]);
        assert_eq!(spectral_radius(&matrix), 0.0);
        assert_eq!(spectral_radius(&DMatrix::zeros(0, 0)), 0.0);
    }
}
