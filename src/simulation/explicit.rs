//! The classical Runge–Kutta method of fourth order with a fixed step for each candidate.
//!
//! The step follows from the candidate's fastest rate that matters ([`Accuracy`]), so it depends
//! on nothing but the candidate. The lanes of a block may take different numbers of steps: a lane
//! that has finished its sample keeps its state while the others go on.

use super::Accuracy;
use super::dynamics::Dynamics;
use super::lanes::{LANES, Lanes, Real, RealArray, lane_of, set_lane_of};
use super::width::{Wide, Width};

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

/// Takes every lane's steps. A lane in whose step a switch of the plant changes its sign, so that
/// the equations have a kink there, takes that step anew in two parts that meet near the kink: the
/// method keeps its order.
#[inline(always)]
pub fn integrate<D: Dynamics>(
    dynamics: &D,
    constants: &Constants<'_, D>,
    held: &D::Held<Lanes>,
    state: &D::State<Lanes>,
    steps: &Steps,
) -> D::State<Lanes> {
    let together = steps.count.iter().copied().min().unwrap_or(0);
    let at_most = steps.count.iter().copied().max().unwrap_or(0);
    let mut state = *state;
    let mut switches = dynamics.switches(constants.wide, held, &state);
    for taken in 0..at_most {
        let mut next = runge_kutta(dynamics, constants.wide, held, &state, steps.length);
        let after = dynamics.switches(constants.wide, held, &next);
        if crosses(&switches, &after) {
            let kinked = Kinked {
                held,
                state: &state,
                before: &switches,
                after: &after,
                steps,
                taken,
            };
            kinked.take_anew(dynamics, constants, &mut next);
            switches = dynamics.switches(constants.wide, held, &next);
        } else {
            switches = after;
        }
        if taken < together {
            state = next;
        } else {
            replace_lanes(&mut state, &next, |lane| taken < steps.count[lane]);
            switches = dynamics.switches(constants.wide, held, &state);
        }
    }
    state
}

/// The candidates' constants, side by side and one by one.
pub struct Constants<'a, D: Dynamics> {
    /// For the equations over all lanes.
    pub wide: &'a D::Constants<Lanes>,
    /// For those over one.
    pub single: &'a [D::Constants<f64>; LANES],
    /// The registers that the lanes stand in.
    pub width: Width,
}

#[inline(always)]
fn runge_kutta<D: Dynamics, R: Real>(
    dynamics: &D,
    constants: &D::Constants<R>,
    held: &D::Held<R>,
    state: &D::State<R>,
    length: R,
) -> D::State<R> {
    let mut next = *state;
    let mut slope = D::State::<R>::zeros();
    for stage in &TABLEAU {
        let point = state.plus_scaled(length * R::splat(stage.point), &slope);
        slope = dynamics.derivative(constants, held, &point);
        next = next.plus_scaled(length * R::splat(stage.weight), &slope);
    }
    next
}

/// Whether a switch changes its sign in at least one lane.
#[inline(always)]
fn crosses<W: RealArray<Lanes>>(before: &W, after: &W) -> bool {
    let mut lowest = Lanes::splat(0.0);
    for (before, after) in before.as_ref().iter().zip(after.as_ref()) {
        lowest = Real::min(*before * *after, lowest);
    }
    lowest.any(|product| product < 0.0)
}

/// A step in which at least one lane has a kink.
struct Kinked<'a, D: Dynamics> {
    held: &'a D::Held<Lanes>,
    state: &'a D::State<Lanes>,
    before: &'a D::Switches<Lanes>,
    after: &'a D::Switches<Lanes>,
    steps: &'a Steps,
    /// Steps taken so far.
    taken: u32,
}

impl<D: Dynamics> Kinked<'_, D> {
    /// Replaces the lanes with a kink in `next`: one by one where they are few, else all at once.
    #[inline(never)]
    fn take_anew(&self, dynamics: &D, constants: &Constants<'_, D>, next: &mut D::State<Lanes>) {
        let share = std::array::from_fn(|lane| {
            let moves = self.taken < self.steps.count[lane];
            if moves { self.share_before(lane) } else { 1.0 }
        });
        let kinked = |lane: usize| share[lane] < 1.0;
        let first = Lanes(share) * self.steps.length;
        let parts = [first, self.steps.length - first];
        if (0..LANES).filter(|&lane| kinked(lane)).count() >= TOGETHER_FROM {
            let end = constants.width.does(Parts {
                dynamics,
                constants: constants.wide,
                held: self.held,
                state: self.state,
                lengths: parts,
            });
            replace_lanes(next, &end, kinked);
            return;
        }
        for lane in (0..LANES).filter(|&lane| kinked(lane)) {
            let end = Parts {
                dynamics,
                constants: &constants.single[lane],
                held: &lane_of(self.held, lane),
                state: &lane_of(self.state, lane),
                lengths: parts.map(|part| part.0[lane]),
            };
            set_lane_of(next, lane, &end.work());
        }
    }

    /// The part of the step before a lane's first kink, by linear interpolation; 1 without one.
    fn share_before(&self, lane: usize) -> f64 {
        let switches = self.before.as_ref().iter().zip(self.after.as_ref());
        let crossed = switches
            .map(|(before, after)| (before.0[lane], after.0[lane]))
            .filter(|(before, after)| before * after < 0.0)
            .map(|(before, after)| before / (before - after));
        crossed.fold(1.0, f64::min)
    }
}

/// From so many lanes on all go anew together. Chosen from the registers' width, not tuned.
const TOGETHER_FROM: usize = 3;

/// A step in parts, one after the other.
struct Parts<'a, D: Dynamics, R: Real> {
    dynamics: &'a D,
    constants: &'a D::Constants<R>,
    held: &'a D::Held<R>,
    state: &'a D::State<R>,
    lengths: [R; 2],
}

impl<D: Dynamics, R: Real> Wide for Parts<'_, D, R> {
    type Output = D::State<R>;

    #[inline(always)]
    fn work(self) -> D::State<R> {
        let mut state = *self.state;
        for length in self.lengths {
            state = runge_kutta(self.dynamics, self.constants, self.held, &state, length);
        }
        state
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
