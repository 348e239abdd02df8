//! The adaptive Rosenbrock method of `simulation::stiff` for a document's plant: the same stages,
//! tolerance and step control, with the exact Jacobian of the tape.
//!
//! Inputs that move between the samples make the equations depend on time; time is then one more
//! state, whose rate is 1.

use super::jacobian;
use super::simulator::Machine;
use crate::simulation::Failure;
use crate::simulation::stiff::{self, A, B, C, E, GAMMA, Span};

/// Derivatives that a Jacobian counts for.
const JACOBIAN_COST: u64 = 4;

/// Integrates one candidate over a span, and counts the derivatives in `evaluations`.
///
/// # Errors
/// [`Failure::Diverged`] when a state is no longer finite, [`Failure::StepBudget`] when the
/// budget of derivatives or of steps is used up.
pub fn integrate(
    machine: &mut Machine<'_, f64>,
    state: &mut [f64],
    span: Span,
    evaluations: &mut u64,
    budget: u64,
) -> Result<(), Failure> {
    let end = stiff::controlled(span, state.to_vec(), |state, elapsed, length| {
        *evaluations += JACOBIAN_COST + 3;
        if *evaluations > budget {
            return Err(Failure::StepBudget);
        }
        Ok(step(machine, state, elapsed, length))
    })?;
    state.copy_from_slice(&end);
    Ok(())
}

/// One step: the new state and its relative error; none where the linear
/// system is singular or a number is not finite.
fn step(
    machine: &mut Machine<'_, f64>,
    state: &[f64],
    elapsed: f64,
    length: f64,
) -> Option<(Vec<f64>, f64)> {
    let n = state.len();
    let mut slope = vec![0.0; n];
    machine.rates(state, elapsed, &mut slope);
    let mut matrix = jacobian::by_states(machine);
    let by_time = jacobian::by_time(machine);
    matrix.iter_mut().for_each(|entry| *entry = -*entry);
    for row in 0..n {
        matrix[row * n + row] += 1.0 / (GAMMA * length);
    }
    let factors = Factors::new(matrix, n)?;
    let mut stages: Vec<Vec<f64>> = Vec::with_capacity(4);
    // Time as a state: its stages follow from the same recursion, alone.
    let mut time_stages: [f64; 4] = [0.0; 4];
    for stage in 0..4 {
        if stage == 1 || stage == 2 {
            let mut point = state.to_vec();
            let mut at = elapsed;
            for (earlier, a) in A[stage - 1].iter().enumerate().take(stage) {
                at += a * time_stages[earlier];
                add(&mut point, *a, &stages[earlier]);
            }
            machine.rates(&point, at, &mut slope);
        }
        let mut right = slope.clone();
        let mut time_right = 1.0;
        let shares = stage.checked_sub(1).map_or([0.0; 3], |row| C[row]);
        for (earlier, c) in shares.iter().enumerate().take(stage) {
            time_right += c / length * time_stages[earlier];
            add(&mut right, c / length, &stages[earlier]);
        }
        time_stages[stage] = time_right * GAMMA * length;
        if let Some(by_time) = &by_time {
            add(&mut right, time_stages[stage], by_time);
        }
        factors.solve(&mut right);
        stages.push(right);
    }
    let mut next = state.to_vec();
    let mut error: f64 = 0.0;
    for (row, scale) in machine.plant.scales.iter().enumerate() {
        let mut estimate = 0.0;
        for stage in 0..4 {
            next[row] += B[stage] * stages[stage][row];
            estimate += E[stage] * stages[stage][row];
        }
        let size = next[row].abs().max(*scale);
        error = error.max((estimate / size).abs());
    }
    (error.is_finite() && next.iter().all(|value| value.is_finite())).then_some((next, error))
}

fn add(to: &mut [f64], share: f64, change: &[f64]) {
    for (to, change) in to.iter_mut().zip(change) {
        *to += share * change;
    }
}

/// A matrix as the product of triangular ones, rows exchanged for the largest pivots.
struct Factors {
    matrix: Vec<f64>,
    order: Vec<usize>,
    n: usize,
}

impl Factors {
    fn new(mut matrix: Vec<f64>, n: usize) -> Option<Factors> {
        let mut order: Vec<usize> = (0..n).collect();
        for column in 0..n {
            let size = |row: &usize| matrix[*row * n + column].abs();
            let pivot = (column..n).max_by(|a, b| size(a).total_cmp(&size(b)))?;
            if pivot != column {
                order.swap(pivot, column);
                (0..n).for_each(|j| matrix.swap(pivot * n + j, column * n + j));
            }
            let divisor = matrix[column * n + column];
            if divisor == 0.0 || !divisor.is_finite() {
                return None;
            }
            for row in column + 1..n {
                let factor = matrix[row * n + column] / divisor;
                matrix[row * n + column] = factor;
                let rest = column + 1..n;
                rest.for_each(|j| matrix[row * n + j] -= factor * matrix[column * n + j]);
            }
        }
        Some(Factors { matrix, order, n })
    }

    fn solve(&self, right: &mut [f64]) {
        let n = self.n;
        let mut solution: Vec<f64> = self.order.iter().map(|row| right[*row]).collect();
        for row in 0..n {
            for j in 0..row {
                solution[row] -= self.matrix[row * n + j] * solution[j];
            }
        }
        for row in (0..n).rev() {
            for j in row + 1..n {
                solution[row] -= self.matrix[row * n + j] * solution[j];
            }
            solution[row] /= self.matrix[row * n + row];
        }
        right.copy_from_slice(&solution);
    }
}
