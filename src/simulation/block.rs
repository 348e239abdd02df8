//! One block of candidates going through a recording side by side.
//!
//! Promises: a candidate's trajectory depends on nothing but the candidate and the recording (not
//! on its neighbours, its lane, or the machine's vector width); a candidate that fails is marked
//! and disturbs no other; work per candidate is bounded.
//!
//! Candidates that are only ranked go through it in single precision, twice as many side by side.

use super::dynamics::{Dynamics, SampledInputs};
use super::explicit::{self, LARGEST_STEP_TIMES_RATE, Steps, Sum};
use super::lanes::{LANES, Lanes, Real, SINGLE_LANES, Scalar, lane_of, set_lane_of};
use super::width::{Wide, Width};
use super::{Accuracy, BlockSimulator, Candidate, Excitation, Failure, stiff};

/// Derivatives that one candidate may spend in the stiff method over a whole recording. A count
/// and not a time, so that the outcome does not depend on the machine's load.
pub const STIFF_BUDGET: u64 = 4_000_000;

/// How many candidates a block may hold at this accuracy, ascending. A larger one takes less time
/// for each candidate, a smaller one less for the whole block.
#[must_use]
pub fn sizes(accuracy: Accuracy) -> &'static [usize] {
    match accuracy {
        Accuracy::Ranking => &[SINGLE_LANES / 2, SINGLE_LANES],
        Accuracy::Screening | Accuracy::Full => &[LANES / 2, LANES],
    }
}

/// Starts the simulation of candidates in the smallest block that holds them; lanes left over
/// repeat the first.
pub fn simulator<'a, D: Dynamics>(
    dynamics: &'a D,
    excitation: Excitation<'a>,
    candidates: &[Candidate<'_>],
) -> Box<dyn BlockSimulator + 'a> {
    const HALF: usize = LANES / 2;
    const SINGLE_HALF: usize = SINGLE_LANES / 2;
    let width = Width::widest();
    let is_small = candidates.len() <= sizes(excitation.accuracy)[0];
    match (excitation.accuracy, is_small) {
        (Accuracy::Ranking, false) => Box::new(Block::<_, f32, SINGLE_LANES>::new(
            dynamics, excitation, candidates, width,
        )),
        (Accuracy::Ranking, true) => Box::new(Block::<_, f32, SINGLE_HALF>::new(
            dynamics, excitation, candidates, width,
        )),
        (_, false) => Box::new(Block::<_, f64, LANES>::new(
            dynamics, excitation, candidates, width,
        )),
        (_, true) => Box::new(Block::<_, f64, HALF>::new(
            dynamics, excitation, candidates, width,
        )),
    }
}

struct Block<'a, D: Dynamics, T: Scalar, const N: usize> {
    dynamics: &'a D,
    excitation: Excitation<'a>,
    width: Width,
    constants: D::Constants<Lanes<T, N>>,
    /// Those of each lane in double precision, for the stiff method.
    exact_constants: [D::Constants<f64>; N],
    delay: Option<Delay<D, T, N>>,
    whole_sample: Steps<T, N>,
    sum: Sum<D::State<Lanes<T, N>>>,
    sample: usize,
    /// Lanes that hold a candidate of their own.
    in_use: usize,
    failures: [Option<Failure>; N],
    stiff_evaluations: [u64; N],
    explicit_evaluations: u64,
}

/// Held quantities on their way to the plant. With a delay of `whole` samples and `part` of one,
/// sample k's plant sees the quantity of sample k − whole − 1 for `part` of the sample, and that
/// of sample k − whole for the rest.
struct Delay<D: Dynamics, T: Scalar, const N: usize> {
    whole: [usize; N],
    before: Steps<T, N>,
    after: Steps<T, N>,
    /// The latest held quantities, newest last.
    history: std::collections::VecDeque<D::Held<Lanes<T, N>>>,
}

/// A stretch of a sample over which the held quantities do not change.
struct Segment<D: Dynamics, T: Scalar, const N: usize> {
    held: D::Held<Lanes<T, N>>,
    steps: Steps<T, N>,
}

impl<'a, D: Dynamics, T: Scalar, const N: usize> Block<'a, D, T, N> {
    fn new(
        dynamics: &'a D,
        excitation: Excitation<'a>,
        candidates: &[Candidate<'_>],
        width: Width,
    ) -> Self {
        assert!(
            !candidates.is_empty() && candidates.len() <= N,
            "a block holds 1 to {N} candidates"
        );
        let of_lane = |lane: usize| candidates.get(lane).unwrap_or(&candidates[0]);
        let exact_constants =
            std::array::from_fn(|lane| dynamics.constants(of_lane(lane).parameters));
        let n_parameters = candidates[0].parameters.len();
        let parameters: Vec<Lanes<T, N>> = (0..n_parameters)
            .map(|index| {
                let of_lane = |lane| T::splat(of_lane(lane).parameters[index]);
                Lanes(std::array::from_fn(of_lane))
            })
            .collect();
        let constants = dynamics.constants(&parameters);
        let mut state = dynamics.initial_state(&constants);
        for (index, value) in state.as_mut().iter_mut().enumerate() {
            let own = *value;
            let given = |lane| of_lane(lane).initial_state[index].unwrap_or(own.lane(lane));
            *value = Lanes(std::array::from_fn(|lane| T::splat(given(lane))));
        }
        let rate = |lane: usize| {
            let own = || dynamics.resolved_rate(&exact_constants[lane]);
            of_lane(lane).resolved_rate.unwrap_or_else(own)
        };
        let resolved_rate = Lanes(std::array::from_fn(rate));
        let sample_time = Lanes::splat(excitation.sample_time);
        let delays = |lane: usize| dynamics.input_delay(&exact_constants[lane]).unwrap_or(0.0);
        let delays: [f64; N] = std::array::from_fn(delays);
        let delay = delays.iter().any(|seconds| *seconds > 0.0);
        let delay = delay.then(|| Delay::new(&delays, &excitation, &resolved_rate));
        Block {
            dynamics,
            excitation,
            width,
            constants,
            exact_constants,
            delay,
            whole_sample: Steps::resolving(&resolved_rate, &sample_time, excitation.accuracy),
            sum: Sum::of(state),
            sample: 0,
            in_use: candidates.len(),
            failures: [None; N],
            stiff_evaluations: [0; N],
            explicit_evaluations: 0,
        }
    }

    #[inline(always)]
    fn advance_lanes(&mut self, samples: usize, outputs: &mut [Lanes]) {
        let of_group = outputs.len() / N.div_ceil(LANES);
        let mut row = vec![Lanes::splat(0.0); of_group / samples];
        let mut inputs = Vec::with_capacity(self.excitation.inputs.len());
        for first in (0..of_group).step_by(row.len()) {
            self.dynamics
                .outputs(&self.constants, &self.sum.state, &mut row);
            self.blank_failed_lanes(&mut row);
            for (group, outputs) in outputs.chunks_exact_mut(of_group).enumerate() {
                write_group(&row, group, &mut outputs[first..][..row.len()]);
            }
            inputs.clear();
            inputs.extend(
                self.excitation
                    .inputs
                    .iter()
                    .map(|input| input[self.sample]),
            );
            let inputs = SampledInputs {
                input_set: self.excitation.input_set,
                values: &inputs,
            };
            let held = self
                .dynamics
                .hold(&self.constants, &inputs, &self.sum.state);
            self.integrate_sample(held);
            self.sample += 1;
        }
    }

    #[inline(always)]
    fn integrate_sample(&mut self, held: D::Held<Lanes<T, N>>) {
        let [first, second] = match &mut self.delay {
            None => {
                let steps = self.whole_sample;
                [Some(Segment { held, steps }), None]
            }
            Some(delay) => delay.segments(held).map(Some),
        };
        // One call: what is inlined into it is the largest code there is.
        for segment in [first, second].into_iter().flatten() {
            self.integrate_segment(&segment);
        }
    }

    /// Explicit steps for all lanes, then the stiff method for those that need it.
    #[inline(always)]
    fn integrate_segment(&mut self, segment: &Segment<D, T, N>) {
        let start = self.sum;
        let Segment { held, steps } = segment;
        self.sum = explicit::integrate(
            self.dynamics,
            &explicit::Constants {
                wide: &self.constants,
                width: self.width,
            },
            held,
            &start,
            steps,
        );
        let steps_taken: u64 = steps.count.iter().map(|&count| u64::from(count)).sum();
        self.explicit_evaluations += explicit::STAGES as u64 * steps_taken;
        let local_rate = |state| self.dynamics.local_rate(&self.constants, held, state);
        let (rate_before, rate_after) = (local_rate(&start.state), local_rate(&self.sum.state));
        let worst = rate_before.max(rate_after) * steps.length;
        let too_fast = |value: f64| value.is_nan() || value > LARGEST_STEP_TIMES_RATE;
        if worst.any(too_fast) || !self.all_finite() {
            self.mend(segment, &start.state, &worst);
        }
    }

    #[inline(always)]
    fn all_finite(&self) -> bool {
        // The sum is finite only if every term is; overflow of the sum itself only costs a look.
        let mut sum = Lanes::splat(0.0);
        for value in self.sum.state.as_ref() {
            sum += *value;
        }
        !sum.any(|value| !value.is_finite())
    }

    /// Integrates anew each lane that the explicit method did not serve, and marks those that
    /// cannot be served.
    #[inline(never)]
    fn mend(
        &mut self,
        segment: &Segment<D, T, N>,
        start: &D::State<Lanes<T, N>>,
        worst: &Lanes<T, N>,
    ) {
        for lane in 0..self.in_use {
            if self.failures[lane].is_some() {
                continue;
            }
            let states = self.sum.state.as_ref();
            let finite = states.iter().all(|value| value.lane(lane).is_finite());
            if finite && worst.lane(lane) <= LARGEST_STEP_TIMES_RATE {
                continue;
            }
            match self.integrate_lane_stiffly(segment, start, lane) {
                Ok(state) => self.sum.set_lane(lane, &state),
                Err(failure) => self.fail(lane, failure),
            }
        }
        // The lanes left over go on repeating the first.
        let first: D::State<f64> = lane_of(&self.sum.state, 0);
        for lane in self.in_use..N {
            self.sum.set_lane(lane, &first);
            self.failures[lane] = self.failures[0];
        }
    }

    fn integrate_lane_stiffly(
        &mut self,
        segment: &Segment<D, T, N>,
        start: &D::State<Lanes<T, N>>,
        lane: usize,
    ) -> Result<D::State<f64>, Failure> {
        let held: D::Held<f64> = lane_of(&segment.held, lane);
        let start: D::State<f64> = lane_of(start, lane);
        let constants = &self.exact_constants[lane];
        if !self.dynamics.is_valid(constants, &start) {
            return Err(Failure::OutOfRange);
        }
        let duration = segment.steps.length.lane(lane) * f64::from(segment.steps.count[lane]);
        let span = stiff::Span {
            duration,
            tolerance: self.excitation.accuracy.stiff_tolerance(),
        };
        let stretch = stiff::integrate(self.dynamics, constants, &held, &start, span)?;
        self.stiff_evaluations[lane] += stretch.derivative_evaluations;
        if self.stiff_evaluations[lane] > STIFF_BUDGET {
            return Err(Failure::StepBudget);
        }
        if !self.dynamics.is_valid(constants, &stretch.state) {
            return Err(Failure::OutOfRange);
        }
        Ok(stretch.state)
    }

    /// Marks the lane and parks it at a harmless state, so that the others go on undisturbed.
    fn fail(&mut self, lane: usize, failure: Failure) {
        self.failures[lane] = Some(failure);
        let parked = self.dynamics.initial_state(&self.exact_constants[lane]);
        self.sum.set_lane(lane, &parked);
    }

    #[inline(always)]
    fn blank_failed_lanes(&self, row: &mut [Lanes<T, N>]) {
        if self.failures.iter().all(Option::is_none) {
            return;
        }
        for (lane, failure) in self.failures.iter().enumerate() {
            if failure.is_some() {
                row.iter_mut()
                    .for_each(|value| value.set_lane(lane, f64::NAN));
            }
        }
    }
}

/// The outputs of one group of lanes; nothing where the block has fewer.
#[inline(always)]
fn write_group<T: Scalar, const N: usize>(
    row: &[Lanes<T, N>],
    group: usize,
    outputs: &mut [Lanes],
) {
    for (output, value) in outputs.iter_mut().zip(row) {
        let lane = |lane| if lane < N { value.lane(lane) } else { f64::NAN };
        *output = Lanes(std::array::from_fn(|index| lane(group * LANES + index)));
    }
}

/// The next samples of a block.
struct Advance<'b, 'a, D: Dynamics, T: Scalar, const N: usize> {
    block: &'b mut Block<'a, D, T, N>,
    samples: usize,
    outputs: &'b mut [Lanes],
}

impl<D: Dynamics, T: Scalar, const N: usize> Wide for Advance<'_, '_, D, T, N> {
    type Output = ();
    const FILLS_64_BYTES: bool = T::IS_SINGLE && N == SINGLE_LANES;

    #[inline(always)]
    fn work(self) {
        self.block.advance_lanes(self.samples, self.outputs);
    }
}

impl<D: Dynamics, T: Scalar, const N: usize> Delay<D, T, N> {
    fn new(delay: &[f64; N], excitation: &Excitation<'_>, rate: &Lanes<f64, N>) -> Self {
        let Excitation {
            sample_time,
            accuracy,
            ..
        } = *excitation;
        let whole = delay.map(|seconds| (seconds / sample_time).floor().max(0.0) as usize);
        let part = Lanes(std::array::from_fn(|lane| {
            (delay[lane] - whole[lane] as f64 * sample_time).clamp(0.0, sample_time)
        }));
        Delay {
            whole,
            before: Steps::resolving(rate, &part, accuracy),
            after: Steps::resolving(rate, &(Lanes::splat(sample_time) - part), accuracy),
            history: std::collections::VecDeque::new(),
        }
    }

    /// Before the record began the plant saw the first quantity.
    fn segments(&mut self, held: D::Held<Lanes<T, N>>) -> [Segment<D, T, N>; 2] {
        let longest = self.whole.iter().copied().max().unwrap_or(0) + 2;
        if self.history.is_empty() {
            self.history.extend(std::iter::repeat_n(held, longest));
        } else {
            self.history.pop_front();
            self.history.push_back(held);
        }
        let seen = |extra: usize| {
            let mut seen = held;
            for lane in 0..N {
                let age = self.whole[lane] + extra;
                let source = &self.history[longest - 1 - age];
                let of_lane: D::Held<T> = lane_of(source, lane);
                set_lane_of(&mut seen, lane, &of_lane);
            }
            seen
        };
        [
            Segment {
                held: seen(1),
                steps: self.before,
            },
            Segment {
                held: seen(0),
                steps: self.after,
            },
        ]
    }
}

impl<D: Dynamics, T: Scalar, const N: usize> BlockSimulator for Block<'_, D, T, N> {
    fn advance(&mut self, samples: usize, outputs: &mut [Lanes]) {
        if samples == 0 {
            return;
        }
        self.width.does(Advance {
            block: self,
            samples,
            outputs,
        });
    }

    fn failures(&self) -> &[Option<Failure>] {
        &self.failures
    }

    fn derivative_evaluations(&self) -> u64 {
        self.explicit_evaluations + self.stiff_evaluations.iter().sum::<u64>()
    }
}

#[cfg(test)]
mod tests;
