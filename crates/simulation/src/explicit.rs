//! The classical Runge–Kutta method of fourth order with an estimate of its error.
//!
//! The slope at the end of a step is that at the start of the next, so that a step takes four
//! derivatives. With it the weights (1/6, 1/3, 1/3, 0, 1/6) are a method of third order, and the
//! difference between the two, `h/6·(k4 − k5)`, estimates the error (E. Hairer, S. P. Nørsett,
//! G. Wanner, *Solving Ordinary Differential Equations I*, 1993, section II.4). The two last
//! slopes are taken at the same instant, so that they also show the fastest rate of the plant
//! (E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, 1996, section IV.2).

pub mod eighth;
pub mod smooth;

use super::equations::Equations;
use greybox_numerics::lanes::Real;

/// Derivatives that one step takes.
pub const STAGES: f64 = 4.0;

/// The slopes of a step, and where it leads.
#[derive(Clone, Debug)]
pub struct FourthOrderStages<S> {
    /// The slope at the start.
    pub first: S,
    /// The slopes in the middle: the first of them, then the sum of both.
    middle: S,
    second: S,
    /// Where the slope `last` is taken.
    point: S,
    last: S,
    /// The states at the end.
    pub next: S,
    /// What rounding has left out of them, in single precision.
    pub next_excess: S,
    /// The slope at the end.
    pub end: S,
}

impl<S: Clone> FourthOrderStages<S> {
    /// Room for the slopes of such states.
    pub fn like(states: &S) -> FourthOrderStages<S> {
        let room = || states.clone();
        FourthOrderStages {
            first: room(),
            middle: room(),
            second: room(),
            point: room(),
            last: room(),
            next: room(),
            next_excess: room(),
            end: room(),
        }
    }
}

/// States that grow by small increments. In single precision `excess` remembers what rounding has
/// left out of them (W. Kahan, "Further remarks on reducing truncation errors", Communications of
/// the ACM 8, 1965), or a state that creeps by less than its last digit a step would stand still.
#[derive(Clone, Copy, Debug)]
pub struct Sum<'a, S> {
    /// The states.
    pub states: &'a S,
    /// By how much they are too large.
    pub excess: &'a S,
}

/// A step of `length` from states whose slope is known, `elapsed` after the held quantities began
/// to act: writes where it leads and the slope there.
#[inline(always)]
pub fn step<R: Real, E: Equations<R>>(
    equations: &mut E,
    from: Sum<'_, E::States>,
    stages: &mut FourthOrderStages<E::States>,
    elapsed: R,
    length: R,
) {
    let half = length * R::splat(0.5);
    let sixth = length * R::splat(1.0 / 6.0);
    along::<R, _>(&mut stages.point, from.states, half, &stages.first);
    equations.rates(&stages.point, elapsed + half, &mut stages.middle);
    along::<R, _>(&mut stages.point, from.states, half, &stages.middle);
    equations.rates(&stages.point, elapsed + half, &mut stages.second);
    along::<R, _>(&mut stages.point, from.states, length, &stages.second);
    for (sum, second) in stages
        .middle
        .as_mut()
        .iter_mut()
        .zip(stages.second.as_ref())
    {
        *sum += *second;
    }
    equations.rates(&stages.point, elapsed + length, &mut stages.last);
    let slopes = stages.first.as_ref().iter().zip(stages.last.as_ref());
    let slopes = slopes.zip(stages.middle.as_ref());
    let starts = from.states.as_ref().iter().zip(from.excess.as_ref());
    let ends = stages.next.as_mut().iter_mut();
    let ends = ends.zip(stages.next_excess.as_mut());
    for ((((first, last), middle), (start, excess)), (next, next_excess)) in
        slopes.zip(starts).zip(ends)
    {
        let step = ((*first + *last) + (*middle + *middle)) * sixth;
        if R::IS_SINGLE {
            // Stops the compiler from filling registers with one lane of each state, gathered from
            // all over memory, instead of the lanes of one state.
            std::hint::black_box(());
            let part = step - *excess;
            *next = *start + part;
            *next_excess = (*next - *start) - part;
        } else {
            *next = *start + step;
        }
    }
    equations.rates(&stages.next, elapsed + length, &mut stages.end);
}

/// `to = from + length · slope`
#[inline(always)]
fn along<R: Real, S: AsRef<[R]> + AsMut<[R]>>(to: &mut S, from: &S, length: R, slope: &S) {
    let terms = from.as_ref().iter().zip(slope.as_ref());
    for (to, (from, slope)) in to.as_mut().iter_mut().zip(terms) {
        *to = *from + length * *slope;
    }
}

impl<S> FourthOrderStages<S> {
    /// Lets a candidate's step lead to where another method has taken it, with the slope there.
    pub fn set_end<R: Real, X: Real>(
        &mut self,
        lane: usize,
        next: &impl AsRef<[X]>,
        end: &impl AsRef<[X]>,
        place: usize,
    ) where
        S: AsMut<[R]>,
    {
        let set = |rows: &mut [R], from: &[X]| {
            let rows = rows.iter_mut().zip(from);
            rows.for_each(|(to, from)| to.set_lane(lane, from.lane(place)));
        };
        set(self.next.as_mut(), next.as_ref());
        set(self.end.as_mut(), end.as_ref());
        let excess = self.next_excess.as_mut().iter_mut();
        excess.for_each(|excess| excess.set_lane(lane, 0.0));
    }

    /// Lets the steps of some candidates, 1 in `which` and 0 elsewhere, lead to where the method of
    /// eighth order has taken them.
    #[inline(always)]
    pub fn take_where<R: Real>(&mut self, which: R, stages: &eighth::EighthOrderStages<S>)
    where
        S: AsRef<[R]> + AsMut<[R]>,
    {
        let one = R::splat(1.0);
        let take = |rows: &mut S, from: &S| {
            let rows = rows.as_mut().iter_mut().zip(from.as_ref());
            rows.for_each(|(to, from)| *to = which.select_ge(one, *from, *to));
        };
        take(&mut self.next, &stages.next);
        let zero = R::splat(0.0);
        for excess in self.next_excess.as_mut() {
            *excess = which.select_ge(one, zero, *excess);
        }
        take(&mut self.end, &stages.end);
        take(&mut self.point, &stages.point);
        take(&mut self.last, stages.last());
    }

    /// The square of the step's estimated error, each state's times its weight: the mean over the
    /// states.
    #[inline(always)]
    pub fn squared_error<R: Real>(&self, weights: &S, length: R) -> R
    where
        S: AsRef<[R]>,
    {
        let share = length * R::splat(1.0 / 6.0);
        let n = R::splat(1.0 / weights.as_ref().len() as f64);
        squared_distance(&self.last, &self.end, weights) * (share * share) * n
    }

    /// The square of the fastest rate that the step has met, times its length.
    pub fn squared_rate_times_length<R: Real>(&self, weights: &S, length: R) -> R
    where
        S: AsRef<[R]>,
    {
        let slopes = squared_distance(&self.last, &self.end, weights);
        slopes * (length * length) / squared_distance(&self.point, &self.next, weights)
    }
}

/// `Σ ((a − b) · weight)²`: not a number where one of them is not.
#[inline(always)]
fn squared_distance<R: Real, S: AsRef<[R]>>(a: &S, b: &S, weights: &S) -> R {
    let mut sum = R::splat(0.0);
    let pairs = a.as_ref().iter().zip(b.as_ref()).zip(weights.as_ref());
    for ((a, b), weight) in pairs {
        let distance = (*a - *b) * *weight;
        sum += distance * distance;
    }
    sum
}
