//! One block of candidates going through a recording side by side.
//!
//! Promises: a candidate's trajectory depends on nothing but the candidate, the recording and the
//! candidate whose steps it takes (not on its neighbours, its lane, or the machine's vector
//! width); a candidate that fails is marked and disturbs no other; work per candidate is bounded,
//! and ends soon after the stop flag is raised.
//!
//! Candidates that are only ranked go through it in single precision where their plant offers it,
//! twice as many side by side.

use super::equations::{Equations, HeldQuantities, Sample, System};
use super::impossible::ImpossibleRow;
use super::input_delay::{HeldStretch, InputDelay};
use super::steps::{FirstStretch, Integrator, RowCandidates};
use super::{Accuracy, BlockSimulator, CandidateBlock, DrivingInputs, SimulationFailure};
use greybox_numerics::lanes::{LANES, Lanes, Real, SINGLE_LANES, Scalar};
use greybox_numerics::width::{Wide, Width};
use std::sync::atomic::{AtomicBool, Ordering};

/// How many candidates a block may hold at this accuracy, ascending. A larger one takes less time
/// for each candidate, a smaller one less for the whole block. Where registers are narrow there are
/// small ones alone.
#[must_use]
pub fn sizes(accuracy: Accuracy) -> &'static [usize] {
    let sizes: &[usize] = match accuracy {
        Accuracy::Ranking => &[SINGLE_HALF, SINGLE_LANES],
        Accuracy::Screening | Accuracy::Full | Accuracy::Reference => &[HALF, LANES],
    };
    match Width::widest() {
        Width::BASELINE => &sizes[..1],
        _ => sizes,
    }
}

/// Lanes of a small block.
const HALF: usize = LANES / 2;
const SINGLE_HALF: usize = SINGLE_LANES / 2;

/// Starts the simulation of candidates in the smallest block that holds them.
pub fn simulator<'a, P: System>(
    system: &'a P,
    excitation: DrivingInputs<'a>,
    candidates: CandidateBlock<'_>,
) -> Box<dyn BlockSimulator + 'a> {
    let width = Width::widest();
    let is_small = candidates.members.len() <= sizes(excitation.accuracy)[0];
    match (excitation.accuracy, is_small) {
        (Accuracy::Ranking, false) => Box::new(SimulationBlock::<_, f32, SINGLE_LANES>::new(
            system, excitation, candidates, width,
        )),
        (Accuracy::Ranking, true) => Box::new(SimulationBlock::<_, f32, SINGLE_HALF>::new(
            system, excitation, candidates, width,
        )),
        (_, false) => Box::new(SimulationBlock::<_, f64, LANES>::new(
            system, excitation, candidates, width,
        )),
        (_, true) => Box::new(SimulationBlock::<_, f64, HALF>::new(
            system, excitation, candidates, width,
        )),
    }
}

/// A block that is simulated with rows of this kind of number.
pub struct SimulationBlock<'a, P: System + 'a, T: Scalar, const N: usize> {
    pub(crate) equations: P::Row<'a, Lanes<T, N>>,
    pub(crate) integrator: Integrator<'a, P, Lanes<T, N>>,
    pub(crate) excitation: DrivingInputs<'a>,
    pub(crate) width: Width,
    /// Whether all candidates take the steps of the first.
    pub(crate) follow: bool,
    delay: Option<InputDelay<Lanes<T, N>>>,
    /// What acts on the plant where nothing is delayed, as the sample begins.
    pub(crate) held: HeldQuantities<Lanes<T, N>>,
    /// The next sample.
    pub(crate) sample: usize,
    /// Lanes that hold a candidate of their own; those left over repeat the first.
    in_use: usize,
}

impl<'a, P: System, T: Scalar, const N: usize> SimulationBlock<'a, P, T, N> {
    /// A block of 1 to N candidates; lanes left over repeat the first.
    pub fn new(
        plant: &'a P,
        excitation: DrivingInputs<'a>,
        candidates: CandidateBlock<'_>,
        width: Width,
    ) -> Self {
        let CandidateBlock { members, in_step } = candidates;
        assert!(
            !members.is_empty() && members.len() <= N,
            "a block holds 1 to {N} candidates"
        );
        let of_lane = |lane: usize| members.get(lane).unwrap_or(&members[0]);
        let n_parameters = members[0].parameters.len();
        let parameters: Vec<Lanes<T, N>> = (0..n_parameters)
            .map(|index| {
                let of_lane = |lane| T::splat(of_lane(lane).parameters[index]);
                Lanes(std::array::from_fn(of_lane))
            })
            .collect();
        let equations = plant.row(&parameters, excitation.sample_time);
        let mut states = equations.initial_states();
        for (index, value) in states.as_mut().iter_mut().enumerate() {
            let model_value = *value;
            let given = |lane| of_lane(lane).initial_state[index].unwrap_or(model_value.lane(lane));
            *value = Lanes(std::array::from_fn(|lane| T::splat(given(lane))));
        }
        let source = RowCandidates {
            plant,
            parameters,
            sample_time: excitation.sample_time,
            accuracy: excitation.accuracy,
            width,
            follow: in_step,
        };
        let delay = equations.input_delay();
        let delay = delay.filter(|delay| delay.any(|seconds| seconds > 0.0));
        let zero = Lanes::splat(0.0);
        SimulationBlock {
            integrator: Integrator::new(source, &equations, states, excitation.samples),
            held: HeldQuantities {
                values: vec![zero; equations.n_held()],
                slopes: Vec::new(),
            },
            equations,
            excitation,
            width,
            follow: in_step,
            delay: delay.map(InputDelay::new),
            sample: 0,
            in_use: members.len(),
        }
    }

    #[inline(always)]
    fn advance_lanes(
        &mut self,
        samples: usize,
        outputs: &mut [Lanes],
        stop: &AtomicBool,
    ) -> Option<()> {
        let of_group = outputs.len() / N.div_ceil(LANES);
        let mut row = vec![Lanes::splat(0.0); of_group / samples];
        for first in (0..of_group).step_by(row.len()) {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let interval = self.excitation.interval(self.sample);
            let stretches = self.hold(interval);
            self.write_outputs(stretches.as_deref(), &mut row);
            for (group, outputs) in outputs.chunks_exact_mut(of_group).enumerate() {
                write_group(&row, group, &mut outputs[first..][..row.len()]);
            }
            if interval > 0.0 {
                self.go_on(stretches.as_deref(), interval, stop)?;
            }
            self.sample += 1;
        }
        Some(())
    }

    /// Lets the inputs of the sample act, `interval` before the next sample. Answers the stretches
    /// of time until then where the plant has a delay.
    #[inline(always)]
    pub(crate) fn hold(&mut self, interval: f64) -> Option<Vec<HeldStretch<Lanes<T, N>>>> {
        let sample = Sample {
            input_set: self.excitation.input_set,
            inputs: self.excitation.inputs,
            index: self.sample,
            interval,
        };
        self.equations
            .hold(&sample, &self.integrator.states, &mut self.held);
        self.delay.as_mut().map(|delay| {
            let start = self.excitation.instant(self.sample);
            delay.stretches(&self.held, start, interval)
        })
    }

    /// From a sample to the next.
    #[inline(always)]
    fn go_on(
        &mut self,
        stretches: Option<&[HeldStretch<Lanes<T, N>>]>,
        interval: f64,
        stop: &AtomicBool,
    ) -> Option<()> {
        let n_stretches = stretches.map_or(1, <[_]>::len);
        // One call: what is inlined into it is the largest code there is.
        for index in 0..n_stretches {
            let (held, duration) = match stretches {
                None => (&self.held, Lanes::splat(interval)),
                Some(stretches) => (&stretches[index].held, stretches[index].duration),
            };
            if index > 0 {
                self.equations.act(held);
            }
            let stretch = FirstStretch { held, duration };
            self.integrator
                .integrate(&mut self.equations, stretch, None, stop)?;
        }
        Some(())
    }

    /// The outputs, with what acts on the plant as the sample begins.
    #[inline(always)]
    pub(crate) fn write_outputs(
        &mut self,
        stretches: Option<&[HeldStretch<Lanes<T, N>>]>,
        row: &mut [Lanes<T, N>],
    ) {
        let acting = match stretches {
            None => &self.held,
            Some(stretches) => &stretches[0].held,
        };
        self.equations.act(acting);
        let states = &self.integrator.states;
        if let Some(impossible) = ImpossibleRow::at(&mut self.equations, states, row) {
            self.fail_impossible(&impossible);
        }
        self.blank_failed_lanes(row);
    }

    #[inline(never)]
    fn fail_impossible(&mut self, impossible: &ImpossibleRow<Lanes<T, N>>) {
        for lane in 0..N {
            if let Some(failure) = impossible.failure(lane) {
                self.fail(lane, failure);
            }
        }
    }

    /// Marks a candidate, and with it those that take its steps.
    pub(crate) fn fail(&mut self, lane: usize, failure: SimulationFailure) {
        self.integrator.fail(lane, failure);
        if self.follow && lane == 0 {
            (1..N).for_each(|lane| self.integrator.fail(lane, failure));
        }
    }

    #[inline(always)]
    fn blank_failed_lanes(&self, row: &mut [Lanes<T, N>]) {
        if !self.integrator.has_failed {
            return;
        }
        let failures = self.integrator.failures();
        for (lane, failure) in failures.iter().enumerate() {
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
struct NextSamples<'b, 'a, P: System, T: Scalar, const N: usize> {
    block: &'b mut SimulationBlock<'a, P, T, N>,
    samples: usize,
    outputs: &'b mut [Lanes],
    stop: &'b AtomicBool,
}

impl<P: System, T: Scalar, const N: usize> Wide for NextSamples<'_, '_, P, T, N> {
    type Output = Option<()>;
    const FILLS_64_BYTES: bool = T::IS_SINGLE && N == SINGLE_LANES;
    const ON_BASELINE: bool =
        !P::HAS_SMALL_BLOCKS || N <= if T::IS_SINGLE { SINGLE_HALF } else { HALF };

    #[inline(always)]
    fn work(self) -> Option<()> {
        self.block
            .advance_lanes(self.samples, self.outputs, self.stop)
    }
}

impl<P: System, T: Scalar, const N: usize> BlockSimulator for SimulationBlock<'_, P, T, N> {
    fn advance(&mut self, samples: usize, outputs: &mut [Lanes], stop: &AtomicBool) -> Option<()> {
        if samples == 0 {
            return Some(());
        }
        self.width.does(NextSamples {
            block: self,
            samples,
            outputs,
            stop,
        })
    }

    fn failures(&self) -> &[Option<SimulationFailure>] {
        self.integrator.failures()
    }

    fn derivative_evaluations(&self) -> u64 {
        self.integrator.derivatives(self.in_use)
    }

    fn states(&self) -> Vec<Lanes> {
        let states = self.integrator.states.as_ref();
        let n_states = states.len();
        let mut grouped = vec![Lanes::splat(0.0); n_states * N.div_ceil(LANES)];
        for (group, states_of_group) in grouped.chunks_mut(n_states.max(1)).enumerate() {
            write_group(states, group, states_of_group);
        }
        grouped
    }
}

#[cfg(test)]
mod tests;
