//! An adaptive Rosenbrock method for the samples at which a candidate is too stiff for fixed
//! explicit steps: a piston stalled against its load, friction at standstill, an end stop.
//!
//! Four stages, order 4 with an embedded order 3, A-stable (Kaps and Rentrop's form with
//! Shampine's coefficients: L. F. Shampine, "Implementation of Rosenbrock methods", ACM
//! Transactions on Mathematical Software 8, 1982). The Jacobian is taken by forward differences.

use super::Failure;
use super::dynamics::Dynamics;
use super::lanes::{Real, RealArray};
use nalgebra::{DMatrix, DVector};

/// Steps at the most over one stretch.
pub const LARGEST_STEP_COUNT: u32 = 20_000;

/// The share of a step that stands on the diagonal.
pub const GAMMA: f64 = 0.5;
/// Where the stages after the first evaluate the derivative, by the stages before.
pub const A: [[f64; 3]; 3] = [
    [2.0, 0.0, 0.0],
    [48.0 / 25.0, 6.0 / 25.0, 0.0],
    [48.0 / 25.0, 6.0 / 25.0, 0.0],
];
/// What the stages after the first take over from those before.
pub const C: [[f64; 3]; 3] = [
    [-8.0, 0.0, 0.0],
    [372.0 / 25.0, 12.0 / 5.0, 0.0],
    [-112.0 / 125.0, -54.0 / 125.0, -2.0 / 5.0],
];
/// The step, by its stages.
pub const B: [f64; 4] = [19.0 / 9.0, 0.5, 25.0 / 108.0, 125.0 / 108.0];
/// The estimate of its error, by its stages.
pub const E: [f64; 4] = [17.0 / 54.0, 7.0 / 36.0, 0.0, 125.0 / 108.0];

/// How far, and how finely.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// The time to cover `[s]`.
    pub duration: f64,
    /// Error of one step, against the larger of the state and its scale `[1]`.
    pub tolerance: f64,
}

/// Where a stretch ended, and what it took.
#[derive(Clone, Copy, Debug)]
pub struct Stretch<S> {
    /// The state at the end.
    pub state: S,
    /// Derivatives evaluated.
    pub derivative_evaluations: u64,
}

/// Integrates one candidate over a span with `held` unchanged.
///
/// # Errors
/// [`Failure::Diverged`] when a state is no longer finite, [`Failure::StepBudget`] when
/// [`LARGEST_STEP_COUNT`] steps do not reach the end.
pub fn integrate<D: Dynamics>(
    dynamics: &D,
    constants: &D::Constants<f64>,
    held: &D::Held<f64>,
    start: &D::State<f64>,
    span: Span,
) -> Result<Stretch<D::State<f64>>, Failure> {
    let mut evaluations = 0;
    let n = start.as_ref().len() as u64;
    let state = controlled(span, *start, |state, _elapsed, length| {
        evaluations += n + 3;
        Ok(rosenbrock_step(dynamics, constants, held, state, length))
    })?;
    Ok(Stretch {
        state,
        derivative_evaluations: evaluations,
    })
}

/// Covers a span with steps as long as their errors allow. `step` answers the state after so much
/// time more and its relative error; nothing where that cannot be had.
///
/// # Errors
/// [`Failure::Diverged`] when steps become too short to get on, [`Failure::StepBudget`] when
/// [`LARGEST_STEP_COUNT`] steps do not reach the end, and what `step` fails with.
pub fn controlled<S>(
    span: Span,
    start: S,
    mut step: impl FnMut(&S, f64, f64) -> Result<Option<(S, f64)>, Failure>,
) -> Result<S, Failure> {
    let Span {
        duration,
        tolerance,
    } = span;
    let mut state = start;
    let mut elapsed = 0.0;
    let mut length = duration * 0.05;
    for _ in 0..LARGEST_STEP_COUNT {
        let remaining = duration - elapsed;
        let last = length >= remaining;
        let taken = if last { remaining } else { length };
        let trial = step(&state, elapsed, taken)?;
        let error = trial
            .as_ref()
            .map_or(f64::INFINITY, |(_, error)| error / tolerance);
        if let Some((next, _)) = trial
            && error <= 1.0
        {
            state = next;
            elapsed += taken;
            if last {
                return Ok(state);
            }
        }
        // Order 4: the error falls with the fourth power of the step.
        let factor = if error.is_finite() {
            (0.9 / error.max(1e-12).sqrt().sqrt()).clamp(0.2, 4.0)
        } else {
            0.1
        };
        length = taken * factor;
        if length < duration * 1e-14 {
            return Err(Failure::Diverged);
        }
    }
    Err(Failure::StepBudget)
}

/// One step: the new state and its relative error; none where the linear
/// system is singular or a number is not finite.
fn rosenbrock_step<D: Dynamics>(
    dynamics: &D,
    constants: &D::Constants<f64>,
    held: &D::Held<f64>,
    state: &D::State<f64>,
    length: f64,
) -> Option<(D::State<f64>, f64)> {
    let n = state.as_ref().len();
    let scale = dynamics.state_scale();
    let slope = dynamics.derivative(constants, held, state);
    let mut matrix = DMatrix::<f64>::zeros(n, n);
    for column in 0..n {
        let mut shifted = *state;
        let size = shifted.as_ref()[column].abs().max(scale[column]);
        let change = size * 1e-8;
        shifted.as_mut()[column] += change;
        let shifted_slope = dynamics.derivative(constants, held, &shifted);
        for row in 0..n {
            let entry = (shifted_slope.as_ref()[row] - slope.as_ref()[row]) / change;
            matrix[(row, column)] = -entry;
        }
        matrix[(column, column)] += 1.0 / (GAMMA * length);
    }
    let factors = matrix.lu();
    let mut stages: [D::State<f64>; 4] = [D::State::<f64>::zeros(); 4];
    let mut rates = slope;
    let mut solution = DVector::<f64>::zeros(n);
    for stage in 0..4 {
        if stage == 1 || stage == 2 {
            let mut point = *state;
            for earlier in 0..stage {
                point = point.plus_scaled(A[stage - 1][earlier], &stages[earlier]);
            }
            rates = dynamics.derivative(constants, held, &point);
        }
        let mut right = rates;
        for earlier in 0..stage {
            right = right.plus_scaled(C[stage - 1][earlier] / length, &stages[earlier]);
        }
        solution.copy_from_slice(right.as_ref());
        if !factors.solve_mut(&mut solution) {
            return None;
        }
        stages[stage].as_mut().copy_from_slice(solution.as_slice());
    }
    let mut next = *state;
    let mut error: f64 = 0.0;
    for (row, &scale) in scale.iter().enumerate() {
        let mut change = 0.0;
        let mut estimate = 0.0;
        for stage in 0..4 {
            change += B[stage] * stages[stage].as_ref()[row];
            estimate += E[stage] * stages[stage].as_ref()[row];
        }
        next.as_mut()[row] += change;
        let size = Real::max(next.as_ref()[row].abs(), scale);
        error = error.max((estimate / size).abs());
    }
    (error.is_finite() && next.as_ref().iter().all(|value| value.is_finite()))
        .then_some((next, error))
}
