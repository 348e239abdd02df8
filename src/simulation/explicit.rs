//! The classical Runge–Kutta method of fourth order with a fixed step for each candidate.
//!
//! The step follows from the candidate's fastest rate that matters ([`Accuracy`]), so it depends
//! on nothing but the candidate. The lanes of a block may take different numbers of steps: a lane
//! that has finished its sample keeps its state while the others go on.

use super::Accuracy;
use super::dynamics::Dynamics;
use super::lanes::{LANES, Lanes, Real, RealArray, SINGLE_LANES, Scalar, set_lane_of};
use super::width::{Wide, Width};

/// Where a step times the local rate exceeds this, the explicit method is no longer trusted (its
/// stability ends at 2.78 on the real axis) and the sample is integrated by the stiff method.
pub const LARGEST_STEP_TIMES_RATE: f64 = 1.5;

/// A candidate takes at most so many steps in one sample; faster ones meet the stiff method.
pub const LARGEST_STEP_COUNT: u32 = 400;

/// Derivatives that one step takes.
pub const STAGES: usize = 4;

/// How many steps of which length each lane takes.
#[derive(Clone, Copy, Debug)]
pub struct Steps<T = f64, const N: usize = LANES> {
    /// Steps of each lane.
    pub count: [u32; N],
    /// Their length `[s]`.
    pub length: Lanes<T, N>,
}

impl<T: Scalar, const N: usize> Steps<T, N> {
    /// Steps over `duration` that keep each lane's `rate` resolved.
    #[must_use]
    pub fn resolving(
        rate: &Lanes<f64, N>,
        duration: &Lanes<f64, N>,
        accuracy: Accuracy,
    ) -> Steps<T, N> {
        let mut steps = Steps {
            count: [0; N],
            length: Lanes::splat(0.0),
        };
        for lane in 0..N {
            let wanted = (duration.0[lane] * rate.0[lane] / accuracy.step_times_rate()).ceil();
            let at_least = f64::from(u32::from(duration.0[lane] > 0.0));
            let count = wanted.clamp(at_least, f64::from(LARGEST_STEP_COUNT));
            steps.count[lane] = count as u32;
            steps
                .length
                .set_lane(lane, duration.0[lane] / count.max(1.0));
        }
        steps
    }
}

/// A state that grows by small increments. In single precision it remembers what rounding has
/// left out of it (W. Kahan, "Further remarks on reducing truncation errors", Communications of
/// the ACM 8, 1965), or a state that creeps by less than its last digit a step would stand still.
#[derive(Clone, Copy, Debug)]
pub struct Sum<S> {
    /// The state.
    pub state: S,
    /// By how much it is too large.
    excess: S,
}

impl<S> Sum<S> {
    /// A state before the first increment.
    pub fn of<R: Real>(state: S) -> Sum<S>
    where
        S: RealArray<R>,
    {
        Sum {
            state,
            excess: S::zeros(),
        }
    }

    /// What the weighted slopes of a step are added to: the state in double precision; nothing in
    /// single, where the increment keeps all its digits until [`Sum::go_to`] adds it.
    #[inline(always)]
    fn base<R: Real>(state: &S) -> S
    where
        S: RealArray<R>,
    {
        if R::IS_SINGLE { S::zeros() } else { *state }
    }

    /// Writes the state after a step from its base to here.
    #[inline(always)]
    fn go_to<R: Real>(&self, step: &S, next: &mut Sum<S>)
    where
        S: RealArray<R>,
    {
        let (states, excesses) = (self.state.as_ref(), self.excess.as_ref());
        let next_states = next.state.as_mut();
        let next_excesses = next.excess.as_mut();
        for (index, step) in step.as_ref().iter().enumerate() {
            if R::IS_SINGLE {
                let part = *step - excesses[index];
                let total = states[index] + part;
                next_excesses[index] = (total - states[index]) - part;
                next_states[index] = total;
            } else {
                next_states[index] = *step;
            }
        }
    }

    /// Gives a lane another state.
    pub fn set_lane<R: Real, A: RealArray<f64>>(&mut self, lane: usize, state: &A)
    where
        S: RealArray<R>,
    {
        set_lane_of(&mut self.state, lane, state);
        let zeros = A::zeros();
        set_lane_of(&mut self.excess, lane, &zeros);
    }
}

/// Takes every lane's steps. A lane in whose step a switch of the plant changes its sign, so that
/// the equations have a kink there, takes that step anew in two parts that meet near the kink: the
/// method keeps its order.
#[inline(always)]
pub fn integrate<D: Dynamics, T: Scalar, const N: usize>(
    dynamics: &D,
    constants: &Constants<'_, D, T, N>,
    held: &D::Held<Lanes<T, N>>,
    start: &Sum<D::State<Lanes<T, N>>>,
    steps: &Steps<T, N>,
) -> Sum<D::State<Lanes<T, N>>> {
    let together = steps.count.iter().copied().min().unwrap_or(0);
    let at_most = steps.count.iter().copied().max().unwrap_or(0);
    let counts = Lanes(steps.count.map(|count| T::splat(f64::from(count))));
    // Two places that take turns: what a step comes from and where it goes to.
    let mut sums = [*start, *start];
    let mut switches = [dynamics.switches(constants.wide, held, &start.state); 2];
    let [mut sum, mut next] = sums.each_mut();
    let [mut before, mut after] = switches.each_mut();
    for taken in 0..at_most {
        let state = &sum.state;
        let base = Sum::base(state);
        let mut step = runge_kutta(dynamics, (constants.wide, held), state, &base, steps.length);
        sum.go_to(&step, next);
        *after = dynamics.switches(constants.wide, held, &next.state);
        if crosses(before, after) {
            let kinked = Kinked {
                held,
                state,
                before,
                after,
                steps,
                taken,
            };
            kinked.take_anew(dynamics, constants, &mut step);
            sum.go_to(&step, next);
            *after = dynamics.switches(constants.wide, held, &next.state);
        }
        if taken >= together {
            let left = counts - Lanes::splat(f64::from(taken));
            rest(&mut next.state, &sum.state, left);
            rest(&mut next.excess, &sum.excess, left);
            rest(after, before, left);
        }
        std::mem::swap(&mut sum, &mut next);
        std::mem::swap(&mut before, &mut after);
    }
    *sum
}

/// Lanes with no steps left stay where they were.
#[inline(always)]
fn rest<R: Real, A: RealArray<R>>(numbers: &mut A, before: &A, left: R) {
    let one = R::splat(1.0);
    for (number, before) in numbers.as_mut().iter_mut().zip(before.as_ref()) {
        *number = left.select_ge(one, *number, *before);
    }
}

/// The candidates' constants, side by side.
pub struct Constants<'a, D: Dynamics, T: Scalar, const N: usize> {
    /// Those of every lane.
    pub wide: &'a D::Constants<Lanes<T, N>>,
    /// The registers that the lanes stand in.
    pub width: Width,
}

/// A step from a state: its weighted slopes, added to `base` (Hairer, Nørsett, Wanner, *Solving
/// Ordinary Differential Equations I*, 1993, table II.1.2). Written out: a loop over the stages
/// would keep the lanes in memory.
#[inline(always)]
fn runge_kutta<D: Dynamics, R: Real>(
    dynamics: &D,
    (constants, held): (&D::Constants<R>, &D::Held<R>),
    state: &D::State<R>,
    base: &D::State<R>,
    length: R,
) -> D::State<R> {
    let [half, third, sixth] = [0.5, 1.0 / 3.0, 1.0 / 6.0].map(|part| length * R::splat(part));
    let derivative = |state: &D::State<R>| dynamics.derivative(constants, held, state);
    let slope = derivative(state);
    let sum = base.plus_scaled(sixth, &slope);
    let slope = derivative(&state.plus_scaled(half, &slope));
    let sum = sum.plus_scaled(third, &slope);
    let slope = derivative(&state.plus_scaled(half, &slope));
    let sum = sum.plus_scaled(third, &slope);
    let slope = derivative(&state.plus_scaled(length, &slope));
    sum.plus_scaled(sixth, &slope)
}

/// Whether a switch changes its sign in at least one lane.
#[inline(always)]
fn crosses<T: Scalar, const N: usize, W: RealArray<Lanes<T, N>>>(before: &W, after: &W) -> bool {
    let mut lowest = Lanes::splat(0.0);
    for (before, after) in before.as_ref().iter().zip(after.as_ref()) {
        lowest = Real::min(*before * *after, lowest);
    }
    let zero = T::splat(0.0);
    let any = |any, product: &T| any | (*product < zero);
    lowest.0.iter().fold(false, any)
}

/// A step in which at least one lane has a kink.
struct Kinked<'a, D: Dynamics, T: Scalar, const N: usize> {
    held: &'a D::Held<Lanes<T, N>>,
    state: &'a D::State<Lanes<T, N>>,
    before: &'a D::Switches<Lanes<T, N>>,
    after: &'a D::Switches<Lanes<T, N>>,
    steps: &'a Steps<T, N>,
    /// Steps taken so far.
    taken: u32,
}

impl<D: Dynamics, T: Scalar, const N: usize> Kinked<'_, D, T, N> {
    /// Replaces the steps of the lanes with a kink. All lanes are computed, for where one has a
    /// kink most others have it in the same step.
    #[inline(never)]
    fn take_anew(
        &self,
        dynamics: &D,
        constants: &Constants<'_, D, T, N>,
        step: &mut D::State<Lanes<T, N>>,
    ) {
        let share = std::array::from_fn(|lane| {
            let moves = self.taken < self.steps.count[lane];
            if moves { self.share_before(lane) } else { 1.0 }
        });
        let first = Lanes(share.map(T::splat)) * self.steps.length;
        let anew = constants.width.does(Parts {
            dynamics,
            constants: constants.wide,
            held: self.held,
            state: self.state,
            lengths: [first, self.steps.length - first],
        });
        replace_lanes(step, &anew, |lane| share[lane] < 1.0);
    }

    /// The part of the step before a lane's first kink, by linear interpolation; 1 without one.
    fn share_before(&self, lane: usize) -> f64 {
        let switches = self.before.as_ref().iter().zip(self.after.as_ref());
        let crossed = switches
            .map(|(before, after)| (before.lane(lane), after.lane(lane)))
            .filter(|(before, after)| before * after < 0.0)
            .map(|(before, after)| before / (before - after));
        crossed.fold(1.0, f64::min)
    }
}

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
    const FILLS_64_BYTES: bool = R::IS_SINGLE && R::WIDTH == SINGLE_LANES;

    /// The step that the parts make together.
    #[inline(always)]
    fn work(self) -> D::State<R> {
        let given = (self.constants, self.held);
        let mut step = Sum::base(self.state);
        let mut reached = *self.state;
        for length in self.lengths {
            step = runge_kutta(self.dynamics, given, &reached, &step, length);
            reached = if R::IS_SINGLE {
                self.state.plus_scaled(R::splat(1.0), &step)
            } else {
                step
            };
        }
        step
    }
}

/// Takes over the chosen lanes.
#[inline(never)]
fn replace_lanes<T: Scalar, const N: usize, S: RealArray<Lanes<T, N>>>(
    numbers: &mut S,
    by: &S,
    chosen: impl Fn(usize) -> bool,
) {
    for (number, by) in numbers.as_mut().iter_mut().zip(by.as_ref()) {
        for lane in (0..N).filter(|&lane| chosen(lane)) {
            number.0[lane] = by.0[lane];
        }
    }
}
