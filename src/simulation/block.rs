//! One block of candidates going through a recording side by side.
//!
//! Promises: a candidate's trajectory depends on nothing but the candidate and the recording (not
//! on its neighbours, its lane, or the machine's vector width); a candidate that fails is marked
//! and disturbs no other; work per candidate is bounded.

use super::dynamics::{Dynamics, SampledInputs};
use super::explicit::{self, LARGEST_STEP_TIMES_RATE, Steps};
use super::lanes::{LANES, Lanes, Real, RealArray, lane_of, set_lane_of};
use super::width::{Wide, Width};
use super::{BlockSimulator, Candidate, Excitation, Failure, stiff};

/// Derivatives that one candidate may spend in the stiff method over a whole recording. A count
/// and not a time, so that the outcome does not depend on the machine's load.
pub const STIFF_BUDGET: u64 = 4_000_000;

/// Starts the simulation of up to [`LANES`] candidates; lanes left over repeat the first.
pub fn simulator<'a, D: Dynamics>(
    dynamics: &'a D,
    excitation: Excitation<'a>,
    candidates: &[Candidate<'_>],
) -> Box<dyn BlockSimulator + 'a> {
    Box::new(Block::new(
        dynamics,
        excitation,
        candidates,
        Width::widest(),
    ))
}

struct Block<'a, D: Dynamics> {
    dynamics: &'a D,
    excitation: Excitation<'a>,
    width: Width,
    constants: D::Constants<Lanes>,
    lane_constants: [D::Constants<f64>; LANES],
    delay: Option<Delay<D>>,
    whole_sample: Steps,
    state: D::State<Lanes>,
    sample: usize,
    /// Lanes that hold a candidate of their own.
    in_use: usize,
    failures: [Option<Failure>; LANES],
    stiff_evaluations: [u64; LANES],
    explicit_evaluations: u64,
}

/// Held quantities on their way to the plant. With a delay of `whole` samples and `part` of one,
/// sample k's plant sees the quantity of sample k − whole − 1 for `part` of the sample, and that
/// of sample k − whole for the rest.
struct Delay<D: Dynamics> {
    whole: [usize; LANES],
    before: Steps,
    after: Steps,
    /// The latest held quantities, newest last.
    history: std::collections::VecDeque<D::Held<Lanes>>,
}

/// A stretch of a sample over which the held quantities do not change.
struct Segment<D: Dynamics> {
    held: D::Held<Lanes>,
    steps: Steps,
}

impl<'a, D: Dynamics> Block<'a, D> {
    fn new(
        dynamics: &'a D,
        excitation: Excitation<'a>,
        candidates: &[Candidate<'_>],
        width: Width,
    ) -> Self {
        assert!(
            !candidates.is_empty() && candidates.len() <= LANES,
            "a block holds 1 to {LANES} candidates"
        );
        let of_lane = |lane: usize| candidates.get(lane).unwrap_or(&candidates[0]);
        let lane_constants =
            std::array::from_fn(|lane| dynamics.constants(of_lane(lane).parameters));
        let n_parameters = candidates[0].parameters.len();
        let parameters: Vec<Lanes> = (0..n_parameters)
            .map(|index| Lanes(std::array::from_fn(|lane| of_lane(lane).parameters[index])))
            .collect();
        let constants = dynamics.constants(&parameters);
        let mut state = dynamics.initial_state(&constants);
        for (index, value) in state.as_mut().iter_mut().enumerate() {
            let own = *value;
            let given = |lane| of_lane(lane).initial_state[index].unwrap_or(own.0[lane]);
            *value = Lanes(std::array::from_fn(given));
        }
        let rate = |lane: usize| {
            let own = || dynamics.resolved_rate(&lane_constants[lane]);
            of_lane(lane).resolved_rate.unwrap_or_else(own)
        };
        let resolved_rate = Lanes(std::array::from_fn(rate));
        let sample_time = Lanes::splat(excitation.sample_time);
        let delay = dynamics
            .input_delay(&constants)
            .filter(|delay| delay.any(|seconds| seconds > 0.0))
            .map(|delay| Delay::new(delay, &excitation, &resolved_rate));
        Block {
            dynamics,
            excitation,
            width,
            constants,
            lane_constants,
            delay,
            whole_sample: Steps::resolving(&resolved_rate, &sample_time, excitation.accuracy),
            state,
            sample: 0,
            in_use: candidates.len(),
            failures: [None; LANES],
            stiff_evaluations: [0; LANES],
            explicit_evaluations: 0,
        }
    }

    #[inline(always)]
    fn advance_lanes(&mut self, samples: usize, outputs: &mut [Lanes]) {
        let width = outputs.len() / samples;
        let mut inputs = Vec::with_capacity(self.excitation.inputs.len());
        for row in outputs.chunks_exact_mut(width) {
            self.dynamics.outputs(&self.constants, &self.state, row);
            self.blank_failed_lanes(row);
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
            let held = self.dynamics.hold(&self.constants, &inputs, &self.state);
            self.integrate_sample(held);
            self.sample += 1;
        }
    }

    #[inline(always)]
    fn integrate_sample(&mut self, held: D::Held<Lanes>) {
        match &mut self.delay {
            None => self.integrate_segment(&Segment {
                held,
                steps: self.whole_sample,
            }),
            Some(delay) => {
                let [before, after] = delay.segments(held);
                self.integrate_segment(&before);
                self.integrate_segment(&after);
            }
        }
    }

    /// Explicit steps for all lanes, then the stiff method for those that need it.
    #[inline(always)]
    fn integrate_segment(&mut self, segment: &Segment<D>) {
        let start = self.state;
        let Segment { held, steps } = segment;
        self.state = explicit::integrate(
            self.dynamics,
            &explicit::Constants {
                wide: &self.constants,
                single: &self.lane_constants,
                width: self.width,
            },
            held,
            &start,
            steps,
        );
        let steps_taken: u64 = steps.count.iter().map(|&count| u64::from(count)).sum();
        self.explicit_evaluations += explicit::STAGES as u64 * steps_taken;
        let rate_before = self.dynamics.local_rate(&self.constants, held, &start);
        let rate_after = self.dynamics.local_rate(&self.constants, held, &self.state);
        let worst = rate_before.max(rate_after) * steps.length;
        let too_fast = |value: f64| value.is_nan() || value > LARGEST_STEP_TIMES_RATE;
        if worst.any(too_fast) || !self.all_finite() {
            self.mend(segment, &start, &worst);
        }
    }

    #[inline(always)]
    fn all_finite(&self) -> bool {
        // The sum is finite only if every term is; overflow of the sum itself only costs a look.
        let mut sum = Lanes::splat(0.0);
        for value in self.state.as_ref() {
            sum += *value;
        }
        !sum.any(|value| !value.is_finite())
    }

    /// Integrates anew each lane that the explicit method did not serve, and marks those that
    /// cannot be served.
    #[inline(never)]
    fn mend(&mut self, segment: &Segment<D>, start: &D::State<Lanes>, worst: &Lanes) {
        for lane in 0..self.in_use {
            if self.failures[lane].is_some() {
                continue;
            }
            let explicit: D::State<f64> = lane_of(&self.state, lane);
            let finite = explicit.as_ref().iter().all(|value| value.is_finite());
            let served = finite && worst.0[lane] <= LARGEST_STEP_TIMES_RATE;
            let outcome = if served {
                Ok(explicit)
            } else {
                self.integrate_lane_stiffly(segment, start, lane)
            };
            match outcome {
                Ok(state) => set_lane_of(&mut self.state, lane, &state),
                Err(failure) => self.fail(lane, failure),
            }
        }
        // The lanes left over go on repeating the first.
        let first: D::State<f64> = lane_of(&self.state, 0);
        for lane in self.in_use..LANES {
            set_lane_of(&mut self.state, lane, &first);
            self.failures[lane] = self.failures[0];
        }
    }

    fn integrate_lane_stiffly(
        &mut self,
        segment: &Segment<D>,
        start: &D::State<Lanes>,
        lane: usize,
    ) -> Result<D::State<f64>, Failure> {
        let mut held = <D::Held<f64> as RealArray<f64>>::zeros();
        for (value, lanes) in held.as_mut().iter_mut().zip(segment.held.as_ref()) {
            *value = lanes.0[lane];
        }
        let start: D::State<f64> = lane_of(start, lane);
        let constants = &self.lane_constants[lane];
        if !self.dynamics.is_valid(constants, &start) {
            return Err(Failure::OutOfRange);
        }
        let duration = segment.steps.length.0[lane] * f64::from(segment.steps.count[lane]);
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
        let parked = self.dynamics.initial_state(&self.lane_constants[lane]);
        set_lane_of(&mut self.state, lane, &parked);
    }

    #[inline(always)]
    fn blank_failed_lanes(&self, row: &mut [Lanes]) {
        if self.failures.iter().all(Option::is_none) {
            return;
        }
        for (lane, failure) in self.failures.iter().enumerate() {
            if failure.is_some() {
                row.iter_mut().for_each(|value| value.0[lane] = f64::NAN);
            }
        }
    }
}

/// The next samples of a block.
struct Advance<'b, 'a, D: Dynamics> {
    block: &'b mut Block<'a, D>,
    samples: usize,
    outputs: &'b mut [Lanes],
}

impl<D: Dynamics> Wide for Advance<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn work(self) {
        self.block.advance_lanes(self.samples, self.outputs);
    }
}

impl<D: Dynamics> Delay<D> {
    fn new(delay: Lanes, excitation: &Excitation<'_>, rate: &Lanes) -> Self {
        let Excitation {
            sample_time,
            accuracy,
            ..
        } = *excitation;
        let whole = delay
            .0
            .map(|seconds| (seconds / sample_time).floor().max(0.0) as usize);
        let part = Lanes(std::array::from_fn(|lane| {
            (delay.0[lane] - whole[lane] as f64 * sample_time).clamp(0.0, sample_time)
        }));
        Delay {
            whole,
            before: Steps::resolving(rate, &part, accuracy),
            after: Steps::resolving(rate, &(Lanes::splat(sample_time) - part), accuracy),
            history: std::collections::VecDeque::new(),
        }
    }

    /// Before the record began the plant saw the first quantity.
    fn segments(&mut self, held: D::Held<Lanes>) -> [Segment<D>; 2] {
        let longest = self.whole.iter().copied().max().unwrap_or(0) + 2;
        if self.history.is_empty() {
            self.history.extend(std::iter::repeat_n(held, longest));
        } else {
            self.history.pop_front();
            self.history.push_back(held);
        }
        let seen = |extra: usize| {
            let mut seen = held;
            for lane in 0..LANES {
                let age = self.whole[lane] + extra;
                let source = &self.history[longest - 1 - age];
                let of_lane: D::Held<f64> = lane_of(source, lane);
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

impl<D: Dynamics> BlockSimulator for Block<'_, D> {
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

    fn failures(&self) -> &[Option<Failure>; LANES] {
        &self.failures
    }

    fn derivative_evaluations(&self) -> u64 {
        self.explicit_evaluations + self.stiff_evaluations.iter().sum::<u64>()
    }
}

#[cfg(test)]
mod tests;
