//! The classical Runge–Kutta method of fourth order with a fixed step for each candidate.
//!
//! The step follows from the candidate's fastest rate that matters ([`STEP_TIMES_RATE`]), so it
//! depends on nothing but the candidate. The lanes of a block may take different numbers of
//! steps: a lane that has finished its sample keeps its state while the others go on.

use super::dynamics::Dynamics;
use super::lanes::{LANES, Lanes, Real, RealArray};

/// Step times the candidate's resolved rate. At 0.4 the servo's piston position is within 0.1 µm
/// of the reference trajectories in `tests/known_answers`.
pub const STEP_TIMES_RATE: f64 = 0.4;

/// Where a step times the local rate exceeds this, the explicit method is no longer trusted (its
/// stability ends at 2.78 on the real axis) and the sample is integrated by the stiff method.
pub const LARGEST_STEP_TIMES_RATE: f64 = 1.5;

/// A candidate takes at most so many steps in one sample; faster ones meet the stiff method.
pub const LARGEST_STEP_COUNT: u32 = 200;

/// How many steps of which length each lane takes.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// Steps of each lane.
    pub count: [u32; LANES],
    /// Their length [s].
    pub length: Lanes,
}

impl Steps {
    /// Steps over `duration` that keep each lane's `rate` resolved.
    #[must_use]
    pub fn resolving(rate: &Lanes, duration: &Lanes) -> Steps {
        let mut steps = Steps {
            count: [0; LANES],
            length: Lanes::splat(0.0),
        };
        for lane in 0..LANES {
            let wanted = (duration.0[lane] * rate.0[lane] / STEP_TIMES_RATE).ceil();
            let at_least = f64::from(u32::from(duration.0[lane] > 0.0));
            let count = wanted.clamp(at_least, f64::from(LARGEST_STEP_COUNT));
            steps.count[lane] = count as u32;
            steps.length.0[lane] = duration.0[lane] / count.max(1.0);
        }
        steps
    }
}

/// One step of the classical Runge–Kutta method (Hairer, Nørsett, Wanner, *Solving Ordinary
/// Differential Equations I*, 1993, table II.1.2).
#[inline(always)]
pub fn step<D: Dynamics, R: Real>(
    dynamics: &D,
    constants: &D::Constants<R>,
    held: &D::Held<R>,
    state: &D::State<R>,
    length: R,
) -> D::State<R> {
    let half = length * R::splat(0.5);
    let k1 = dynamics.derivative(constants, held, state);
    let k2 = dynamics.derivative(constants, held, &state.plus_scaled(half, &k1));
    let k3 = dynamics.derivative(constants, held, &state.plus_scaled(half, &k2));
    let k4 = dynamics.derivative(constants, held, &state.plus_scaled(length, &k3));
    let sixth = length * R::splat(1.0 / 6.0);
    let third = length * R::splat(1.0 / 3.0);
    state
        .plus_scaled(sixth, &k1)
        .plus_scaled(third, &k2)
        .plus_scaled(third, &k3)
        .plus_scaled(sixth, &k4)
}

/// Takes every lane's steps.
#[inline(always)]
pub fn integrate<D: Dynamics>(
    dynamics: &D,
    constants: &D::Constants<Lanes>,
    held: &D::Held<Lanes>,
    state: &D::State<Lanes>,
    steps: &Steps,
) -> D::State<Lanes> {
    let together = steps.count.iter().copied().min().unwrap_or(0);
    let at_most = steps.count.iter().copied().max().unwrap_or(0);
    let mut state = *state;
    for _ in 0..together {
        state = step(dynamics, constants, held, &state, steps.length);
    }
    for taken in together..at_most {
        let next = step(dynamics, constants, held, &state, steps.length);
        for (value, next) in state.as_mut().iter_mut().zip(next.as_ref()) {
            for lane in 0..LANES {
                if taken < steps.count[lane] {
                    value.0[lane] = next.0[lane];
                }
            }
        }
    }
    state
}
