//! One block of candidates going through a recording side by side.
//!
//! Promises: a candidate's trajectory depends on nothing but the candidate and the recording (not
//! on its neighbours, its lane, or the machine's vector width); a candidate that fails is marked
//! and disturbs no other; work per candidate is bounded.

use super::dynamics::{Dynamics, SampledInputs};
use super::explicit::{self, LARGEST_STEP_TIMES_RATE, Steps};
use super::lanes::{LANES, Lanes, Real, RealArray};
use super::{BlockSimulator, Candidate, Excitation, Failure, stiff};

/// Derivatives that one candidate may spend in the stiff method over a whole recording. A count
/// and not a time, so that the outcome does not depend on the machine's load.
pub const STIFF_BUDGET: u64 = 4_000_000;

/// The vector registers that a block is compiled for. All give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// What every processor of this architecture has.
    Baseline,
    /// AVX2: four numbers in a register.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Width {
    /// The widths that this machine has, the widest last.
    #[must_use]
    pub fn available() -> Vec<Width> {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return vec![Width::Baseline, Width::Avx2];
        }
        vec![Width::Baseline]
    }

    fn widest() -> Width {
        *Width::available()
            .last()
            .expect("every machine has the baseline")
    }
}

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
            for lane in 0..LANES {
                if let Some(given) = of_lane(lane).initial_state[index] {
                    value.0[lane] = given;
                }
            }
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
        self.state = explicit::integrate(self.dynamics, &self.constants, held, &start, steps);
        let steps_taken: u64 = steps.count.iter().map(|&count| u64::from(count)).sum();
        self.explicit_evaluations += explicit::STAGES as u64 * steps_taken;
        let rate_before = self.dynamics.local_rate(&self.constants, held, &start);
        let rate_after = self.dynamics.local_rate(&self.constants, held, &self.state);
        let worst = rate_before.max(rate_after) * steps.length;
        // A comparison that is also false for NaN.
        if worst.any(|value| !(value <= LARGEST_STEP_TIMES_RATE)) || !self.all_finite() {
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
        for lane in 0..LANES {
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
        let stretch = stiff::integrate(self.dynamics, constants, &held, &start, duration)?;
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

    /// The same code, compiled for registers of four numbers.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn advance_avx2(&mut self, samples: usize, outputs: &mut [Lanes]) {
        self.advance_lanes(samples, outputs);
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
                for (value, from) in seen.as_mut().iter_mut().zip(source.as_ref()) {
                    value.0[lane] = from.0[lane];
                }
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

fn lane_of<W: RealArray<Lanes>, S: RealArray<f64>>(wide: &W, lane: usize) -> S {
    let mut single = S::zeros();
    for (value, lanes) in single.as_mut().iter_mut().zip(wide.as_ref()) {
        *value = lanes.0[lane];
    }
    single
}

fn set_lane_of<W: RealArray<Lanes>, S: RealArray<f64>>(wide: &mut W, lane: usize, single: &S) {
    for (lanes, value) in wide.as_mut().iter_mut().zip(single.as_ref()) {
        lanes.0[lane] = *value;
    }
}

impl<D: Dynamics> BlockSimulator for Block<'_, D> {
    fn advance(&mut self, samples: usize, outputs: &mut [Lanes]) {
        if samples == 0 {
            return;
        }
        match self.width {
            Width::Baseline => self.advance_lanes(samples, outputs),
            #[cfg(target_arch = "x86_64")]
            Width::Avx2 => {
                // SAFETY: `Width::available` offers this width only where the processor has it.
                #[expect(unsafe_code, reason = "run-time dispatch over vector widths")]
                unsafe {
                    self.advance_avx2(samples, outputs);
                }
            }
        }
    }

    fn failures(&self) -> &[Option<Failure>; LANES] {
        &self.failures
    }

    fn derivative_evaluations(&self) -> u64 {
        self.explicit_evaluations + self.stiff_evaluations.iter().sum::<u64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x'' = −ω²·x + u − friction, whose parameters are ω² and a dry friction; stiff where the
    /// friction is strong.
    struct Pendulum;

    impl Dynamics for Pendulum {
        type State<R: Real> = [R; 2];
        type Held<R: Real> = [R; 1];
        type Switches<R: Real> = [R; 1];
        type Constants<R: Real> = [R; 3];

        fn constants<R: Real>(&self, parameters: &[R]) -> [R; 3] {
            [parameters[0], parameters[1], parameters[2]]
        }
        fn initial_state<R: Real>(&self, _: &[R; 3]) -> [R; 2] {
            [R::splat(1.0), R::splat(0.0)]
        }
        fn hold<R: Real>(&self, _: &[R; 3], inputs: &SampledInputs<'_>, _: &[R; 2]) -> [R; 1] {
            [R::splat(inputs.values[0])]
        }
        #[inline(always)]
        fn derivative<R: Real>(&self, c: &[R; 3], held: &[R; 1], x: &[R; 2]) -> [R; 2] {
            [
                x[1],
                held[0] - c[0] * x[0] - c[1] * (x[1] * R::splat(100.0)).tanh(),
            ]
        }
        fn switches<R: Real>(&self, _: &[R; 3], _: &[R; 1], x: &[R; 2]) -> [R; 1] {
            [x[0]]
        }
        fn outputs<R: Real>(&self, _: &[R; 3], x: &[R; 2], outputs: &mut [R]) {
            outputs.copy_from_slice(x);
        }
        fn input_delay<R: Real>(&self, c: &[R; 3]) -> Option<R> {
            Some(c[2])
        }
        fn resolved_rate(&self, c: &[f64; 3]) -> f64 {
            c[0].abs().sqrt()
        }
        fn local_rate<R: Real>(&self, c: &[R; 3], _: &[R; 1], x: &[R; 2]) -> R {
            let tanh = (x[1] * R::splat(100.0)).tanh();
            c[1] * R::splat(100.0) * (R::splat(1.0) - tanh * tanh) + c[0].abs().sqrt()
        }
        fn state_scale(&self) -> &'static [f64] {
            &[1.0, 1.0]
        }
        fn is_valid(&self, _: &[f64; 3], x: &[f64; 2]) -> bool {
            x[0].abs() < 1e6
        }
    }

    fn simulate(parameters: &[[f64; 3]], inputs: &[Vec<f64>], width: Width) -> Vec<Lanes> {
        let excitation = Excitation {
            sample_time: 0.1,
            samples: inputs[0].len(),
            input_set: 0,
            inputs,
            accuracy: crate::simulation::Accuracy::Full,
        };
        let candidate = |parameters| Candidate {
            parameters,
            initial_state: &[None, None],
            resolved_rate: None,
        };
        let candidates: Vec<_> = parameters.iter().map(|p| candidate(p.as_slice())).collect();
        let mut block = Block::new(&Pendulum, excitation, &candidates, width);
        let mut outputs = vec![Lanes([0.0; LANES]); 2 * inputs[0].len()];
        block.advance(inputs[0].len(), &mut outputs);
        outputs
    }

    /// Slow and fast, smooth and stiff, with and without delay, and one that explodes.
    const MIXED: [[f64; 3]; 8] = [
        [4.0, 0.0, 0.0],
        [90.0, 0.3, 0.0],
        [4.0, 2.0, 0.03],
        [25.0, 5.0, 0.25],
        [1.0, 0.1, 0.1],
        [-1e4, 0.0, 0.0],
        [9.0, 0.02, 0.0],
        [16.0, 1.0, 1.0],
    ];

    fn square_wave() -> [Vec<f64>; 1] {
        [(0..120)
            .map(|k| if k / 20 % 2 == 0 { 1.0 } else { -0.5 })
            .collect()]
    }

    fn bits(outputs: &[Lanes], lane: usize) -> Vec<u64> {
        outputs.iter().map(|row| row.0[lane].to_bits()).collect()
    }

    #[test]
    fn every_vector_width_gives_the_same_bits() {
        let widths = Width::available();
        println!("widths on this machine: {widths:?}");
        let baseline = simulate(&MIXED, &square_wave(), widths[0]);
        for width in widths {
            let other = simulate(&MIXED, &square_wave(), width);
            for lane in (0..LANES).filter(|lane| *lane != 5) {
                assert_eq!(
                    bits(&baseline, lane),
                    bits(&other, lane),
                    "{width:?} lane {lane}"
                );
            }
        }
    }

    #[test]
    fn a_candidate_does_not_see_its_neighbours_not_even_one_that_explodes() {
        let together = simulate(&MIXED, &square_wave(), Width::widest());
        assert!(
            together.last().unwrap().0[5].is_nan(),
            "the unstable candidate has failed"
        );
        for lane in (0..LANES).filter(|lane| *lane != 5) {
            let alone = simulate(&MIXED[lane..=lane], &square_wave(), Width::widest());
            assert_eq!(bits(&together, lane), bits(&alone, 0), "lane {lane}");
        }
    }

    #[test]
    fn an_undamped_swing_is_the_cosine() {
        let outputs = simulate(&[[4.0, 0.0, 0.0]], &[vec![0.0; 100]], Width::widest());
        for (sample, row) in outputs.chunks_exact(2).enumerate() {
            let expected = (2.0 * 0.1 * sample as f64).cos();
            assert!((row[0].0[0] - expected).abs() < 1e-4, "at {sample}");
        }
    }

    #[test]
    fn a_delay_shifts_the_response_by_its_length() {
        let steps = |delay| simulate(&[[4.0, 0.0, delay]], &square_wave(), Width::widest());
        // The square wave holds its first value for 20 samples, so a delay of 5 samples acts like
        // a wave that changes 5 samples later.
        let later: Vec<f64> = (0..120i32)
            .map(|k| {
                if (k - 5).max(0) / 20 % 2 == 0 {
                    1.0
                } else {
                    -0.5
                }
            })
            .collect();
        let shifted = simulate(&[[4.0, 0.0, 0.0]], &[later], Width::widest());
        for (a, b) in steps(0.5).iter().zip(&shifted) {
            assert!((a.0[0] - b.0[0]).abs() < 1e-9);
        }
        // Half a sample more lies between the neighbours.
        let (before, half, after) = (steps(0.5), steps(0.55), steps(0.6));
        let row = 2 * 30;
        let between = (half[row].0[0] - before[row].0[0]) * (half[row].0[0] - after[row].0[0]);
        assert!(between < 0.0);
    }
}
