//! Exact first derivatives of the rates, and how fast a plant moves at a state.
//!
//! The derivatives are taken forward through the tape, up to eight directions in one pass.

use super::plant::Wiring;
use super::tape::{DIRECTIONS, Registers, Tape, zeros};
use crate::simulation::lanes::{Lanes, Real};

/// Doublings of the power whose norm bounds the spectral radius: the 64th power, whose root is
/// within a few per cent of the radius once the matrix is balanced.
const DOUBLINGS: usize = 6;

/// Sweeps of the balancing.
const SWEEPS: usize = 6;

/// ∂(rates)/∂(state), row by row, at the values that `registers` hold.
pub fn by_states(tape: &Tape, wiring: &Wiring, registers: &Registers<f64>) -> Vec<f64> {
    let n = wiring.states.len();
    let mut matrix = vec![0.0; n * n];
    for first in (0..n).step_by(DIRECTIONS) {
        let mut slopes: Registers<Lanes> = zeros();
        for (direction, state) in (first..n).take(DIRECTIONS).enumerate() {
            if let Some(register) = wiring.states[state] {
                slopes[usize::from(register)].set_lane(direction, 1.0);
            }
        }
        tape.run_slopes(&tape.rates, registers, &mut slopes);
        for (row, rate) in tape.roots.rates.iter().enumerate() {
            for (direction, column) in (first..n).take(DIRECTIONS).enumerate() {
                matrix[row * n + column] = slopes[usize::from(*rate)].lane(direction);
            }
        }
    }
    matrix
}

/// ∂(rates)/∂t where the inputs move by `input_slopes`.
pub fn by_time(
    tape: &Tape,
    wiring: &Wiring,
    registers: &Registers<f64>,
    input_slopes: &[f64],
) -> Vec<f64> {
    let mut slopes: Registers<Lanes> = zeros();
    for (input, slope) in wiring.inputs.iter().zip(input_slopes) {
        if let Some(register) = input {
            slopes[usize::from(*register)] = Lanes::splat(*slope);
        }
    }
    tape.run_slopes(&tape.rates, registers, &mut slopes);
    let rates = tape.roots.rates.iter();
    rates
        .map(|rate| slopes[usize::from(*rate)].lane(0))
        .collect()
}

/// Scales d that make the rows and the columns of D⁻¹·A·D equally large (E. E. Osborne, "On
/// pre-conditioning of matrices", Journal of the ACM 7, 1960), and that matrix.
pub fn balance(matrix: &mut [f64], n: usize) -> Vec<f64> {
    let mut scales = vec![1.0; n];
    for _ in 0..SWEEPS {
        for i in 0..n {
            let others = || (0..n).filter(|j| *j != i);
            let row: f64 = others().map(|j| matrix[i * n + j].abs()).sum();
            let column: f64 = others().map(|j| matrix[j * n + i].abs()).sum();
            let factor = (row / column).sqrt();
            if !(factor.is_finite() && factor > 0.0) {
                continue;
            }
            scales[i] *= factor;
            for j in others() {
                matrix[i * n + j] /= factor;
                matrix[j * n + i] *= factor;
            }
        }
    }
    scales
}

/// A bound of the spectral radius: ‖A^k‖^(1/k) for a high power k (Gelfand's formula). Not a
/// number where the matrix has one that is not finite.
pub fn spectral_bound(matrix: &[f64], n: usize) -> f64 {
    if matrix.iter().any(|value| !value.is_finite()) {
        return f64::NAN;
    }
    let mut power = matrix.to_vec();
    balance(&mut power, n);
    let mut logarithm = 0.0;
    let mut weight = 1.0;
    for doubling in 0..=DOUBLINGS {
        let row_sum = |row: &[f64]| row.iter().map(|value| value.abs()).sum::<f64>();
        let norm = power.chunks(n).map(row_sum).fold(0.0, f64::max);
        if norm == 0.0 {
            return 0.0;
        }
        logarithm += weight * libm::log(norm);
        if doubling == DOUBLINGS {
            break;
        }
        power.iter_mut().for_each(|value| *value /= norm);
        power = squared(&power, n);
        weight *= 0.5;
    }
    libm::exp(logarithm)
}

fn squared(matrix: &[f64], n: usize) -> Vec<f64> {
    let mut product = vec![0.0; n * n];
    for i in 0..n {
        for k in 0..n {
            for j in 0..n {
                product[i * n + j] += matrix[i * n + k] * matrix[k * n + j];
            }
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eigenvalues of companion and triangular matrices are known.
    #[test]
    fn the_bound_is_close_to_the_spectral_radius_even_where_units_differ_wildly() {
        let oscillator = [0.0, 1.0, -1e8, 0.0];
        let hydraulic = [0.0, 2e10, -1.25e-5, 0.0];
        let lag = [-50.0, 0.0, 1e6, -2.0];
        for (matrix, radius) in [(oscillator, 1e4), (hydraulic, 500.0), (lag, 50.0)] {
            let bound = spectral_bound(&matrix, 2);
            assert!(bound >= radius * 0.999_999, "{bound} is below {radius}");
            assert!(bound <= radius * 1.25, "{bound} is far above {radius}");
        }
        assert_eq!(
            spectral_bound(&[0.0, 1.0, 0.0, 0.0], 2),
            0.0,
            "a double integrator"
        );
        assert!(spectral_bound(&[f64::INFINITY], 1).is_nan());
    }
}
