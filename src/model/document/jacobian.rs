//! Exact first derivatives of the rates, and how fast a plant moves at a state.
//!
//! The derivatives are taken forward through the tape, up to eight directions in one pass.

use super::simulator::Machine;
use super::tape::{DIRECTIONS, Register, Registers, zeros};
use crate::simulation::lanes::{Lanes, Real};

/// Doublings of the power whose norm bounds the spectral radius: the 64th power, whose root is
/// within a few per cent of the radius once the matrix is balanced.
const DOUBLINGS: usize = 6;

/// Sweeps of the balancing.
const SWEEPS: usize = 6;

/// ∂(rates)/∂(state), row by row, where the machine took its rates last.
pub fn by_states(machine: &mut Machine<'_, f64>) -> Vec<f64> {
    let (tape, wiring) = (&machine.plant.tape, &machine.plant.wiring);
    let slopes = machine.directions.get_or_insert_with(zeros);
    let n = wiring.states.len();
    let mut matrix = vec![0.0; n * n];
    for first in (0..n).step_by(DIRECTIONS) {
        let directions = (first..n).take(DIRECTIONS);
        set(slopes, directions.clone().map(|state| wiring.states[state]));
        tape.run_slopes(&tape.rates, &machine.registers, slopes);
        for (row, rate) in tape.roots.rates.iter().enumerate() {
            for (direction, column) in directions.clone().enumerate() {
                matrix[row * n + column] = slopes[usize::from(*rate)].lane(direction);
            }
        }
        clear(slopes, directions.map(|state| wiring.states[state]));
    }
    matrix
}

/// ∂(rates)/∂t where the machine took its rates last and its inputs move; none where they do not.
pub fn by_time(machine: &mut Machine<'_, f64>) -> Option<Vec<f64>> {
    if machine.slopes.is_empty() {
        return None;
    }
    let (tape, wiring) = (&machine.plant.tape, &machine.plant.wiring);
    let slopes = machine.directions.get_or_insert_with(zeros);
    for (input, slope) in wiring.inputs.iter().zip(&machine.slopes) {
        if let Some(register) = input {
            slopes[usize::from(*register)] = Lanes::splat(*slope);
        }
    }
    tape.run_slopes(&tape.rates, &machine.registers, slopes);
    let rates = tape.roots.rates.iter();
    let by_time = rates.map(|rate| slopes[usize::from(*rate)].lane(0));
    let by_time = by_time.collect();
    clear(slopes, wiring.inputs.iter().copied());
    Some(by_time)
}

/// One direction for each of the leaves.
fn set(slopes: &mut Registers<Lanes>, leaves: impl Iterator<Item = Option<Register>>) {
    for (direction, leaf) in leaves.enumerate() {
        if let Some(register) = leaf {
            slopes[usize::from(register)].set_lane(direction, 1.0);
        }
    }
}

/// Leaves that no direction moves: what is computed from them is overwritten before it is read.
fn clear(slopes: &mut Registers<Lanes>, leaves: impl Iterator<Item = Option<Register>>) {
    for register in leaves.flatten() {
        slopes[usize::from(register)] = Lanes::splat(0.0);
    }
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
