//! A row of candidates from one instant to another, each with steps as long as its errors allow.
//!
//! All candidates of a row try a step at once, each of its own length. Where the estimated error
//! is too large, or not a number, the candidate stays and tries a shorter one. A kink of the
//! equations (a valve that opens, an end stop) needs no mention: the error of a step across it
//! shows it. What a candidate does depends on its own numbers alone, so its steps do not depend on
//! its neighbours. Neighbours that are compared to the last digits, for a derivative by
//! differences, take the steps of the first of them instead (internal numerical differentiation:
//! H. G. Bock, "Numerical treatment of inverse problems in chemical reaction kinetics", 1981).
//!
//! A candidate whose steps are limited by stability, and not by accuracy, goes on with the stiff
//! method until its steps are short against its fastest rate again. One whose accuracy limits its
//! steps, and that takes many of them from sample to sample, goes on with the method of eighth order.

mod arrivals;
mod exact;
mod look;
mod smooth;

use super::equations::{Equations, HeldQuantities, Shares, System};
use super::explicit::smooth::{Smooth, SmoothRow};
use super::explicit::{self, FourthOrderStages, Sum, eighth};
use super::stiff::exact::Exact;
use super::{Accuracy, SimulationFailure};
use greybox_numerics::lanes::{Lanes, Real, SINGLE_LANES};
use greybox_numerics::width::Width;
use std::sync::atomic::{AtomicBool, Ordering};

/// Candidates in a row at the most.
const MOST: usize = SINGLE_LANES;

/// How much longer the next step may be, and how much shorter.
const LARGEST_FACTOR: f64 = 4.0;
const SMALLEST_FACTOR: f64 = 0.2;

/// The step that the error allows is shortened by this, so that few are rejected.
const SAFETY: f64 = 0.85;

/// Sizes that errors are measured against shrink by this a step, where a state does.
const SIZE_MEMORY: f64 = 0.9;

/// After so many trials in one stretch candidates are looked at, and then at every eighth: sooner
/// where nothing acts from outside, because there a stretch is a large part of the recording.
const FIRST_LOOK: u32 = 48;
const FIRST_LOOK_WHERE_UNDISTURBED: u32 = 16;
const LOOK_EVERY: u32 = 8;

/// A candidate is stiff that shows it at so many looks in a row, twice as many each time that it
/// has left the stiff method, up to a limit.
const STIFF_LOOKS: u8 = 3;
const MOST_STIFF_LOOKS: u8 = 96;

/// The stiff method is left where this part of its derivatives would do for the explicit ones, ...
const NOT_STIFF: f64 = 0.5;

/// ... which take so many, limited by stability, in one over the fastest rate, ...
const EXPLICIT_DERIVATIVES: f64 = 2.2;

/// ... so many steps in a row.
const CALM_STEPS: u8 = 8;

/// Derivatives that one candidate may spend over a recording: a part for each sample, and a part
/// for all. A count and not a time, so that the outcome does not depend on the machine's load.
const BUDGET: f64 = 2e6;
const BUDGET_OF_SAMPLE: f64 = 4e3;

/// Derivatives that one candidate may spend where candidates are simulated coarsely, to be told apart: a few
/// extreme ones (a rate of 1e5 a minute, an exponent of 1000) would else cost more than thousands of others.
const COARSE_BUDGET: f64 = 5e4;
const COARSE_BUDGET_OF_SAMPLE: f64 = 1e3;

/// The candidates that a row is made of.
pub struct RowCandidates<'a, P: System, R> {
    /// The plant of the candidates.
    pub plant: &'a P,
    /// The parameters of the candidates, a row for each parameter.
    pub parameters: Vec<R>,
    /// The time from one sample to the next `[s]`.
    pub sample_time: f64,
    /// How accurate the steps are.
    pub accuracy: Accuracy,
    /// The registers that rows stand in.
    pub width: Width,
    /// Whether all candidates take the steps of the first.
    pub follow: bool,
}

/// A row of candidates on its way.
pub struct Integrator<'a, P: System + 'a, R: Real> {
    source: RowCandidates<'a, P, R>,
    /// Where the candidates are.
    pub states: <P::Row<'a, R> as Equations<R>>::States,
    excess: <P::Row<'a, R> as Equations<R>>::States,
    /// What errors of the states are measured against.
    sizes: <P::Row<'a, R> as Equations<R>>::States,
    least_sizes: <P::Row<'a, R> as Equations<R>>::States,
    /// 1 / (tolerance · size).
    weights: <P::Row<'a, R> as Equations<R>>::States,
    stages: FourthOrderStages<<P::Row<'a, R> as Equations<R>>::States>,
    /// The next step of each candidate `[s]`; 0 before the first.
    length: R,
    /// Whether there is one before its first step.
    has_new: bool,
    /// Derivatives that each candidate has taken.
    derivatives: R,
    budget: f64,
    failures: [Option<SimulationFailure>; MOST],
    /// Whether there is a candidate that has failed.
    pub has_failed: bool,
    stiff_looks: [u8; MOST],
    stiff_looks_needed: [u8; MOST],
    is_stiff: [bool; MOST],
    /// Whether there is a candidate for which the stiff method is used.
    has_stiff: bool,
    calm_steps: [u8; MOST],
    exact: Vec<Exact<P::Row<'a, Lanes>>>,
    smooth: Option<Box<SmoothRow<P::Row<'a, R>, R>>>,
    shares: Shares,
    first_look: u32,
}

/// A stretch of time over which the held quantities do not jump.
#[derive(Clone, Copy, Debug)]
pub struct FirstStretch<'s, R> {
    /// The quantities that are held over the stretch.
    pub held: &'s HeldQuantities<R>,
    /// The length of the stretch for each candidate `[s]`.
    pub duration: R,
}

/// The stretches of candidates of which each runs by itself: nothing acts on the plant from outside, so that
/// no candidate needs to wait for the others at the end of a stretch.
pub trait Arrivals<'a, P: System, R: Real> {
    /// Takes note of the candidates that have arrived, and answers how long the next stretch of each is
    /// `[s]`, 0 where there is none. A candidate that cannot go on is marked.
    fn next(
        &mut self,
        integrator: &mut Integrator<'a, P, R>,
        equations: &mut P::Row<'a, R>,
        has_arrived: &[bool],
    ) -> R;
}

/// A stretch that is under way.
struct IntegratedStretch<'s, R> {
    held: &'s HeldQuantities<R>,
    duration: R,
    /// The part of the stretch that is left.
    remaining: R,
    /// Whether the exact equations know what is held.
    is_exact: bool,
    /// Trials of the row.
    trials: u32,
    /// Trials of the row before the stretch of each candidate; all 0 where no candidate runs by itself.
    trials_before: [u32; MOST],
    runs_free: bool,
}

impl<R: Real> IntegratedStretch<'_, R> {
    /// Trials of a candidate in its stretch.
    fn trials_of(&self, lane: usize) -> u32 {
        self.trials - self.trials_before[lane]
    }

    /// Whether a condition holds for the trials of a candidate.
    #[inline(always)]
    fn any_trials(&self, condition: impl Fn(u32) -> bool) -> bool {
        let lanes = if self.runs_free { R::WIDTH } else { 1 };
        (0..lanes).any(|lane| condition(self.trials_of(lane)))
    }
}

/// One trial of a step by every candidate.
struct StepTrial<R> {
    /// The time since the held quantities began to act `[s]`.
    elapsed: R,
    /// The length of the step `[s]`.
    taken: R,
    /// The square of the error over the tolerance; not at most 1 where the candidate stays.
    squared_error: R,
}

impl<'a, P: System, R: Real> Integrator<'a, P, R> {
    /// Candidates at the given states, for a recording of so many samples.
    pub fn new(
        source: RowCandidates<'a, P, R>,
        equations: &P::Row<'a, R>,
        states: <P::Row<'a, R> as Equations<R>>::States,
        samples: usize,
    ) -> Self {
        let mut excess = states.clone();
        excess.as_mut().fill(R::splat(0.0));
        let least_sizes = equations.sizes();
        let mut sizes = least_sizes.clone();
        if !<P::Row<'a, R>>::SIZES_ARE_FIXED {
            for (size, state) in sizes.as_mut().iter_mut().zip(states.as_ref()) {
                *size = state.abs().max(*size);
            }
        }
        let per_tolerance = R::splat(1.0 / source.accuracy.tolerance());
        let mut weights = sizes.clone();
        for weight in weights.as_mut() {
            *weight = per_tolerance / *weight;
        }
        let is_undisturbed = equations.n_held() == 0;
        let budget = match source.accuracy {
            Accuracy::Ranking | Accuracy::Screening => {
                COARSE_BUDGET + COARSE_BUDGET_OF_SAMPLE * samples as f64
            }
            Accuracy::Full | Accuracy::Reference => BUDGET + BUDGET_OF_SAMPLE * samples as f64,
        };
        Integrator {
            source,
            stages: FourthOrderStages::like(&states),
            states,
            excess,
            sizes,
            least_sizes,
            length: R::splat(0.0),
            has_new: true,
            derivatives: R::splat(0.0),
            budget,
            failures: [None; MOST],
            has_failed: false,
            stiff_looks: [0; MOST],
            stiff_looks_needed: [STIFF_LOOKS; MOST],
            is_stiff: [false; MOST],
            has_stiff: false,
            calm_steps: [0; MOST],
            exact: Vec::new(),
            smooth: Smooth::of::<P::Row<'a, R>>(&weights),
            shares: equations.shares(),
            first_look: match is_undisturbed {
                true => FIRST_LOOK_WHERE_UNDISTURBED,
                false => FIRST_LOOK,
            },
            weights,
        }
    }

    /// How each candidate has failed, if it has.
    pub fn failures(&self) -> &[Option<SimulationFailure>] {
        &self.failures[..R::WIDTH]
    }

    /// Derivatives taken by the first candidates.
    pub fn derivatives(&self, candidates: usize) -> u64 {
        let taken = (0..candidates).map(|lane| self.derivatives.lane(lane));
        taken.sum::<f64>() as u64
    }

    /// Derivatives taken by a candidate.
    pub fn derivatives_of(&self, lane: usize) -> u64 {
        self.derivatives.lane(lane) as u64
    }

    /// Marks a candidate, which stays where it is.
    pub fn fail(&mut self, lane: usize, failure: SimulationFailure) {
        self.failures[lane].get_or_insert(failure);
        self.has_failed = true;
    }

    /// Goes on for a stretch under what is held, which `equations` know, and for those that follow
    /// where candidates run by themselves. Answers nothing when `stop` was raised.
    #[inline(always)]
    pub fn integrate(
        &mut self,
        equations: &mut P::Row<'a, R>,
        FirstStretch { held, duration }: FirstStretch<'_, R>,
        mut arrivals: Option<&mut dyn Arrivals<'a, P, R>>,
        stop: &AtomicBool,
    ) -> Option<()> {
        let mut stretch = IntegratedStretch {
            held,
            duration,
            remaining: duration,
            is_exact: false,
            trials: 0,
            trials_before: [0; MOST],
            runs_free: arrivals.is_some(),
        };
        if self.has_failed {
            for lane in (0..R::WIDTH).filter(|lane| self.failures[*lane].is_some()) {
                stretch.remaining.set_lane(lane, 0.0);
            }
        }
        let zero = R::splat(0.0);
        equations.rates(&self.states, zero, &mut self.stages.first);
        if self.has_new {
            self.choose_first_lengths(duration);
        }
        while stretch.remaining.any_above(0.0) {
            let mut trial = StepTrial {
                elapsed: stretch.duration - stretch.remaining,
                taken: self.next_lengths(&stretch),
                squared_error: zero,
            };
            if !self.has_stiff || self.has_explicit(&stretch) {
                self.try_explicit(equations, &mut trial, &stretch);
            }
            if self.has_stiff {
                self.try_stiff(&mut stretch, &mut trial);
            }
            self.accept(&mut stretch, &mut trial);
            stretch.trials += 1;
            if self.smooth.is_some() {
                self.choose_order(&stretch, &trial);
            }
            let first_look = self.first_look;
            let is_looked_at = stretch
                .any_trials(|trials| trials >= first_look && trials.is_multiple_of(LOOK_EVERY));
            if (is_looked_at || self.has_stiff) && stop.load(Ordering::Relaxed) {
                return None;
            }
            if is_looked_at {
                self.look(&mut stretch, &trial);
            }
            if let Some(arrivals) = &mut arrivals {
                self.arrive(*arrivals, equations, &mut stretch);
            }
        }
        Some(())
    }

    /// The step that each candidate tries: what is left is cut in two equal parts rather than in
    /// a long one and a short one.
    #[inline(always)]
    fn next_lengths(&self, stretch: &IntegratedStretch<'_, R>) -> R {
        let (length, remaining) = (self.length, stretch.remaining);
        let half = remaining * R::splat(0.5);
        let part = (length + length).select_ge(remaining, half, length);
        let mut taken = length.select_ge(remaining, remaining, part);
        if self.source.follow {
            self.follow_lengths(stretch, &mut taken);
        }
        taken
    }

    /// Has following candidates take the same share of the stretch as the first candidate.
    #[inline(never)]
    fn follow_lengths(&self, stretch: &IntegratedStretch<'_, R>, taken: &mut R) {
        let (first, remaining) = (taken.lane(0), stretch.remaining.lane(0));
        let share = first / stretch.duration.lane(0);
        for lane in self.followers(stretch) {
            let of_lane = if first == remaining {
                stretch.remaining.lane(lane)
            } else {
                share * stretch.duration.lane(lane)
            };
            taken.set_lane(lane, of_lane);
        }
    }

    /// Which candidates take the steps of the first over this stretch: not those that have it
    /// alone, because their input is delayed by another number of samples.
    fn followers(&self, stretch: &IntegratedStretch<'_, R>) -> impl Iterator<Item = usize> {
        let leads = stretch.duration.lane(0) > 0.0;
        let duration = stretch.duration;
        (1..R::WIDTH).filter(move |lane| leads && duration.lane(*lane) > 0.0)
    }

    #[inline(always)]
    fn try_explicit(
        &mut self,
        equations: &mut P::Row<'a, R>,
        trial: &mut StepTrial<R>,
        stretch: &IntegratedStretch<'_, R>,
    ) {
        if self.has_fourth_order(stretch) {
            let from = Sum {
                states: &self.states,
                excess: &self.excess,
            };
            let (elapsed, length) = (trial.elapsed, trial.taken);
            explicit::step(equations, from, &mut self.stages, elapsed, length);
            let share = self.shares.fourth;
            let squared_error = self.stages.squared_error(&self.weights, trial.taken);
            trial.squared_error = squared_error * R::splat(1.0 / (share * share));
        }
        self.try_smooth(equations, trial);
    }

    /// Takes over the states of the candidates whose error is small enough, and chooses the
    /// lengths of the next steps.
    #[inline(always)]
    fn accept(&mut self, stretch: &mut IntegratedStretch<'_, R>, trial: &mut StepTrial<R>) {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        if self.source.follow {
            for lane in self.followers(stretch) {
                trial
                    .squared_error
                    .set_lane(lane, trial.squared_error.lane(0));
            }
        }
        // Candidates at the end of the stretch take no more steps.
        let least = R::splat(f64::from(f32::MIN_POSITIVE));
        let error = stretch
            .remaining
            .select_ge(least, trial.squared_error, one + one);
        let mut derivatives = R::splat(explicit::STAGES);
        let mut factor = trial.squared_error.inverse_eighth_root_estimate();
        if let Some(smooth) = self.smooth_in_use() {
            let of_eighth = R::splat(eighth::STAGES as f64);
            derivatives = smooth.candidates.select_ge(one, of_eighth, derivatives);
            factor = smooth.candidates.select_ge(one, factor.sqrt(), factor);
        }
        self.derivatives += stretch.remaining.select_ge(least, derivatives, zero);
        replace(&mut self.states, &self.stages.next, error);
        if R::IS_SINGLE {
            replace(&mut self.excess, &self.stages.next_excess, error);
        }
        replace(&mut self.stages.first, &self.stages.end, error);
        if !<P::Row<'a, R>>::SIZES_ARE_FIXED {
            self.follow_sizes(error);
        }
        let factor = (factor * R::splat(SAFETY)).clamp(SMALLEST_FACTOR, LARGEST_FACTOR);
        let scaled = trial.taken * factor;
        // A step that was cut short, and whose error is far below the tolerance, says nothing
        // against the length before.
        let grown = factor.select_ge(
            R::splat(LARGEST_FACTOR),
            Real::max(scaled, self.length),
            scaled,
        );
        self.length = stretch.remaining.select_ge(least, grown, self.length);
        let rest = stretch.remaining - trial.taken;
        let rest = one.select_ge(error, rest, stretch.remaining);
        stretch.remaining = rest.select_ge(zero, rest, zero);
    }

    /// Lets the sizes follow the states of those that moved.
    #[inline(always)]
    fn follow_sizes(&mut self, error: R) {
        let one = R::splat(1.0);
        let per_tolerance = R::splat(1.0 / self.source.accuracy.tolerance());
        let states = self.states.as_ref().iter().zip(self.least_sizes.as_ref());
        let sizes = self.sizes.as_mut().iter_mut().zip(self.weights.as_mut());
        for ((state, least), (size, weight)) in states.zip(sizes) {
            let shrunk = (*size * R::splat(SIZE_MEMORY)).max(*least);
            *size = one.select_ge(error, state.abs().max(shrunk), *size);
            *weight = per_tolerance / *size;
        }
    }

    /// Steps at whose start each state moves by a hundredth of its size; errors decide the rest.
    #[inline(never)]
    fn choose_first_lengths(&mut self, duration: R) {
        let mut fastest = R::splat(0.0);
        for (slope, size) in self.stages.first.as_ref().iter().zip(self.sizes.as_ref()) {
            fastest = (slope.abs() / *size).max(fastest);
        }
        self.has_new = false;
        for lane in 0..R::WIDTH {
            let (whole, rate) = (duration.lane(lane), fastest.lane(lane));
            self.has_new |= self.length.lane(lane) == 0.0 && whole == 0.0;
            if self.length.lane(lane) == 0.0 && whole > 0.0 {
                // Far enough that the error says something about the length of the next.
                let (shortest, longest) = (1e-6 * whole, 0.1 * whole);
                let length = f64::max(0.01 / rate, shortest).min(longest);
                self.length.set_lane(lane, length);
            }
        }
    }
}

/// Takes over the numbers of the candidates whose error is at most 1.
#[inline(always)]
fn replace<R: Real, S: AsRef<[R]> + AsMut<[R]>>(to: &mut S, from: &S, error: R) {
    let one = R::splat(1.0);
    for (to, from) in to.as_mut().iter_mut().zip(from.as_ref()) {
        *to = one.select_ge(error, *from, *to);
    }
}
