//! The eigenvalues of a matrix of any kind.

use super::singular_values::has_finite_squares;
use nalgebra::{DMatrix, Schur};

/// Iterations for each row at the most; a few are usual.
const ITERATIONS_EACH: usize = 100;

/// The size of the largest eigenvalue of a matrix of `n` rows, given row by row; 0 where a square is
/// not finite.
#[must_use]
pub fn spectral_radius(n: usize, entries: &[f64]) -> f64 {
    let matrix = DMatrix::from_row_slice(n, n, entries);
    let schur = (n > 0 && has_finite_squares(&matrix))
        .then(|| {
            Schur::try_new(
                matrix.clone(),
                f64::EPSILON,
                ITERATIONS_EACH * matrix.nrows(),
            )
        })
        .flatten();
    let values = schur.map(|decomposed| decomposed.complex_eigenvalues());
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
        assert!((spectral_radius(2, &[0.0, 1.0, -49.0, -1.4]) - 7.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_not_finite_has_none() {
        assert_eq!(spectral_radius(2, &[0.0, f64::NAN, 1e200, -1.4]), 0.0);
        assert_eq!(spectral_radius(0, &[]), 0.0);
    }
}
