//! The classical Runge–Kutta method of fourth order with a fixed step for each candidate.
//!
//! The step follows from the candidate's fastest rate that matters ([`Accuracy`]), so it depends
//! on nothing but the candidate. The lanes of a block may take different numbers of steps: a lane
//! that has finished its sample keeps its state while the others go on.

use super::Accuracy;
use super::dynamics::Dynamics;
use super::lanes::{LANES, Lanes, Real, RealArray};

/// Where a step times the local rate exceeds this, the explicit method is no longer trusted (its
/// stability ends at 2.78 on the real axis) and the sample is integrated by the stiff method.
pub const LARGEST_STEP_TIMES_RATE: f64 = 1.5;

/// A candidate takes at most so many steps in one sample; faster ones meet the stiff method.
pub const LARGEST_STEP_COUNT: u32 = 400;

/// Derivatives that one step takes.
pub const STAGES: usize = 4;

/// Where the stages stand in a step, along the slope of the stage before, and their weights in
/// the step's sum (Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, 1993,
/// table II.1.2).
const TABLEAU: [Stage; STAGES] = [
    Stage {
        point: 0.0,
        weight: 1.0 / 6.0,
    },
    Stage {
        point: 0.5,
        weight: 1.0 / 3.0,
    },
    Stage {
        point: 0.5,
        weight: 1.0 / 3.0,
    },
    Stage {
        point: 1.0,
        weight: 1.0 / 6.0,
    },
];

struct Stage {
    point: f64,
    weight: f64,
}

/// How many steps of which length each lane takes.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// Steps of each lane.
    pub count: [u32; LANES],
    /// Their length `[s]`.
    pub length: Lanes,
}

impl Steps {
    /// Steps over `duration` that keep each lane's `rate` resolved.
    #[must_use]
    pub fn resolving(rate: &Lanes, duration: &Lanes, accuracy: Accuracy) -> Steps {
        let mut steps = Steps {
            count: [0; LANES],
            length: Lanes::splat(0.0),
        };
        for lane in 0..LANES {
            let wanted = (duration.0[lane] * rate.0[lane] / accuracy.step_times_rate()).ceil();
            let at_least = f64::from(u32::from(duration.0[lane] > 0.0));
            let count = wanted.clamp(at_least, f64::from(LARGEST_STEP_COUNT));
            steps.count[lane] = count as u32;
            steps.length.0[lane] = duration.0[lane] / count.max(1.0);
        }
        steps
    }
}

/// Takes every lane's steps. A step in which a switch of the plant changes its sign, so that the
/// equations have a kink there, is taken anew in two parts that meet near the kink: the method
/// keeps its order. Lanes without a kink keep the whole step.
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
    let mut switches = dynamics.switches(constants, held, &state);
    let mut leg = Leg::Whole;
    let mut start = state;
    let mut length = steps.length;
    let mut taken = 0;
    while taken < at_most {
        // The only place where the equations are evaluated, so that they are compiled once.
        let mut next = runge_kutta(dynamics, constants, held, &start, length);
        match leg {
            Leg::Whole => {
                let after = dynamics.switches(constants, held, &next);
                if let Some(kink) = Kink::between(&switches, &after) {
                    length = steps.length * kink.share;
                    leg = Leg::First { kink, whole: next };
                    continue;
                }
            }
            Leg::First { kink, whole } => {
                start = next;
                length = steps.length - length;
                leg = Leg::Second { kink, whole };
                continue;
            }
            Leg::Second { kink, whole } => {
                replace_lanes(&mut next, &whole, |lane| !kink.is_in[lane]);
            }
        }
        if taken < together {
            state = next;
        } else {
            replace_lanes(&mut state, &next, |lane| taken < steps.count[lane]);
        }
        taken += 1;
        switches = dynamics.switches(constants, held, &state);
        start = state;
        length = steps.length;
        leg = Leg::Whole;
    }
    state
}

#[inline(always)]
fn runge_kutta<D: Dynamics>(
    dynamics: &D,
    constants: &D::Constants<Lanes>,
    held: &D::Held<Lanes>,
    state: &D::State<Lanes>,
    length: Lanes,
) -> D::State<Lanes> {
    let mut next = *state;
    let mut slope = D::State::<Lanes>::zeros();
    for stage in &TABLEAU {
        let point = state.plus_scaled(length * Lanes::splat(stage.point), &slope);
        slope = dynamics.derivative(constants, held, &point);
        next = next.plus_scaled(length * Lanes::splat(stage.weight), &slope);
    }
    next
}

/// Which part of a step is being taken.
enum Leg<S> {
    Whole,
    First { kink: Kink, whole: S },
    Second { kink: Kink, whole: S },
}

/// Where in a step the first switch changes its sign.
#[derive(Clone, Copy)]
struct Kink {
    is_in: [bool; LANES],
    /// The part of the step before the kink, by linear interpolation; 1 in lanes without one.
    share: Lanes,
}

impl Kink {
    #[inline(always)]
    fn between<W: RealArray<Lanes>>(before: &W, after: &W) -> Option<Kink> {
        let mut lowest = Lanes::splat(0.0);
        for (before, after) in before.as_ref().iter().zip(after.as_ref()) {
            lowest = Real::min(*before * *after, lowest);
        }
        lowest
            .any(|product| product < 0.0)
            .then(|| Kink::locate(before, after))
    }

    #[inline(never)]
    fn locate<W: RealArray<Lanes>>(before: &W, after: &W) -> Kink {
        let mut kink = Kink {
            is_in: [false; LANES],
            share: Lanes::splat(1.0),
        };
        for (before, after) in before.as_ref().iter().zip(after.as_ref()) {
            for lane in (0..LANES).filter(|&lane| before.0[lane] * after.0[lane] < 0.0) {
                let share = before.0[lane] / (before.0[lane] - after.0[lane]);
                kink.is_in[lane] = true;
                kink.share.0[lane] = kink.share.0[lane].min(share);
            }
        }
        kink
    }
}

/// Takes over the chosen lanes.
#[inline(never)]
fn replace_lanes<S: RealArray<Lanes>>(state: &mut S, by: &S, chosen: impl Fn(usize) -> bool) {
    for (value, by) in state.as_mut().iter_mut().zip(by.as_ref()) {
        for lane in (0..LANES).filter(|&lane| chosen(lane)) {
            value.0[lane] = by.0[lane];
        }
    }
}
