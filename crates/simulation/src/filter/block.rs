//! One block of candidates whose means and covariances go through a record side by side.

use super::controller::SampledController;
use super::covariance::StateCovariance;
use super::layout::FilterLayout;
use super::noises::{Noise, noises, white_variances};
use super::start::StartVariance;
use super::trace::TraceLayout;
use super::transition::{CovarianceStep, Matrix, StepCovariance};
use crate::block::SimulationBlock;
use crate::equations::{Equations, HeldQuantities};
use crate::input_delay::HeldStretch;
use crate::program::{DisturbanceKind, Program};
use crate::steps::FirstStretch;
use crate::{
    BlockSimulator, CandidateBlock, DrivingInputs, Plant, SimulatedCandidate, SimulationFailure,
};
use greybox_numerics::lanes::{LANES, Lanes, Real};
use greybox_numerics::width::{Wide, Width};
use std::sync::atomic::{AtomicBool, Ordering};

/// The equations with their disturbances, and what the filter is asked of them.
#[derive(Clone, Copy, Debug)]
pub struct FilterEquations<'a> {
    /// The equations, a state more for each disturbance.
    pub program: &'a Program,
    /// What the filter is asked.
    pub layout: &'a FilterLayout,
    /// How many parameters the model has.
    pub n_model_parameters: usize,
}

/// Candidates on their way through a record, each with its covariance.
pub struct FilterBlock<'a> {
    block: SimulationBlock<'a, Program, f64, LANES>,
    layout: &'a FilterLayout,
    noises: Vec<Noise>,
    /// The variance of each output's sensor.
    sensors: Vec<Lanes>,
    covariance: StateCovariance,
    controller: Option<SampledController>,
    transition: StepCovariance,
    step: CovarianceStep,
    /// ∂rate/∂state over all states.
    jacobian: Matrix,
    /// ∂output/∂state over all states.
    by_state: Matrix,
    /// The variance that each output of the first sample has from white noise of the controller.
    followed: Vec<Lanes>,
    /// The outputs of the model.
    row: Vec<Lanes>,
    /// Φ since the last sample, where the filter is traced.
    crossed: Option<Matrix>,
    /// The rates where the Jacobian was taken last.
    rates: Vec<Lanes>,
    /// The mean at both ends of a step.
    ends: [StepEnd; 2],
    /// What acts on the plant as a step begins.
    held: HeldQuantities<Lanes>,
}

/// The mean at one end of a step.
#[derive(Clone, Default)]
struct StepEnd {
    states: Vec<Lanes>,
    rates: Vec<Lanes>,
}

impl<'a> FilterBlock<'a> {
    /// A block of 1 to [`LANES`] candidates; lanes left over repeat the first.
    pub fn new(
        equations: FilterEquations<'a>,
        excitation: DrivingInputs<'a>,
        candidates: CandidateBlock<'_>,
    ) -> Self {
        let FilterEquations {
            program,
            layout,
            n_model_parameters,
        } = equations;
        let CandidateBlock { members, in_step } = candidates;
        let of_lane = |lane: usize| members.get(lane).unwrap_or(&members[0]);
        let parameter =
            |index: usize| Lanes(std::array::from_fn(|lane| of_lane(lane).parameters[index]));
        let n_model_states = layout.starts.len();
        let noises = noises(layout, n_model_parameters, parameter);
        let n_outputs = program.n_outputs();
        let first_sensor = layout.first_sensor(n_model_parameters);
        let sensors = (0..n_outputs).map(|output| parameter(first_sensor + output));
        let first_of_controller = layout.first_of_controller();
        let n_states = layout.n_states();
        let is_white = |state: &usize| {
            let noise = state
                .checked_sub(n_model_states)
                .and_then(|index| noises.get(index));
            noise.is_some_and(|noise| noise.kind == DisturbanceKind::White)
        };
        // A smoother follows white noise too.
        let is_moved = |state: &usize| layout.is_traced || !is_white(state);
        let moved: Vec<usize> = (0..n_states).filter(is_moved).collect();
        let n_moving = moved
            .iter()
            .filter(|state| **state < first_of_controller)
            .count();
        let more = n_states - n_model_states;
        let starts: Vec<Vec<Option<f64>>> = members
            .iter()
            .map(|member| [member.initial_state, &vec![None; more]].concat())
            .collect();
        let members: Vec<SimulatedCandidate<'_>> = members
            .iter()
            .zip(&starts)
            .map(|(member, initial_state)| SimulatedCandidate {
                initial_state,
                ..*member
            })
            .collect();
        let candidates = CandidateBlock {
            members: &members,
            in_step,
        };
        let zero = Lanes::splat(0.0);
        let block = SimulationBlock::new(program, excitation, candidates, Width::widest());
        let controller = layout.controller.map(|controller| {
            let before = block.equations.sampled().to_vec();
            SampledController::new(controller, first_of_controller, before)
        });
        FilterBlock {
            block,
            controller,
            layout,
            sensors: sensors.map(|sensor| sensor * sensor).collect(),
            transition: StepCovariance::new(moved.len(), n_moving),
            step: CovarianceStep::new(moved.len()),
            covariance: StateCovariance::new(moved),
            noises,
            jacobian: vec![zero; n_states * n_states],
            by_state: vec![zero; n_outputs * n_states],
            followed: vec![zero; n_outputs],
            row: vec![zero; n_outputs],
            crossed: layout.is_traced.then(|| vec![zero; n_states * n_states]),
            rates: vec![zero; n_states],
            ends: <[StepEnd; 2]>::default(),
            held: HeldQuantities::default(),
        }
    }

    #[inline(always)]
    fn advance_lanes(
        &mut self,
        samples: usize,
        outputs: &mut [Lanes],
        stop: &AtomicBool,
    ) -> Option<()> {
        for outputs in outputs.chunks_exact_mut(outputs.len() / samples) {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let interval = self.block.excitation.interval(self.block.sample);
            let stretches = self.block.hold(interval);
            let sample = self.block.sample;
            if let Some(controller) = &mut self.controller {
                controller.begin_sample(&mut self.block, self.layout, &mut self.covariance);
            }
            self.block
                .write_outputs(stretches.as_deref(), &mut self.row);
            if sample == 0 {
                self.begin();
            }
            let whites = white_variances(&self.noises, interval);
            self.correct(&whites, outputs);
            self.begin_interval(&whites);
            if interval > 0.0 {
                self.go_on(stretches.as_deref(), interval, stop)?;
            }
            self.end_interval(outputs);
            self.block.sample += 1;
        }
        Some(())
    }

    /// The covariance at the first sample.
    fn begin(&mut self) {
        let starts = &self.layout.starts;
        let n = self.covariance.states.len();
        let is_made = |state: &usize| starts.get(*state) == Some(&StartVariance::OneInterval);
        let is_made: Vec<bool> = self.covariance.states.iter().map(is_made).collect();
        if is_made.contains(&true) {
            let length = Lanes::splat(self.block.excitation.sample_time);
            for place in 0..3 {
                self.take_jacobian(place, Lanes::splat(0.0));
            }
            self.step.length = length;
            let follow = self.block.follow;
            let matrix = &mut self.covariance.matrix;
            self.transition.carry(matrix, &self.step, follow);
        }
        for (index, value) in self.covariance.matrix.iter_mut().enumerate() {
            if !is_made[index / n] || !is_made[index % n] {
                *value = Lanes::splat(0.0);
            }
        }
        for row in 0..n {
            let state = self.covariance.states[row];
            let given = match starts.get(state) {
                Some(StartVariance::Known(variance)) => Some(Lanes::splat(*variance)),
                Some(StartVariance::OneInterval) => None,
                None => {
                    let noise = self.noises.get(state - starts.len());
                    Some(noise.map_or(Lanes::splat(0.0), |noise| noise.start))
                }
            };
            if let Some(variance) = given {
                self.covariance.matrix[row * (n + 1)] = variance;
            }
        }
    }

    /// Says what is expected of each output, and lets what was measured correct the states.
    #[inline(always)]
    fn correct(&mut self, whites: &[(usize, Lanes)], outputs: &mut [Lanes]) {
        let SimulationBlock {
            equations,
            integrator,
            excitation,
            sample,
            ..
        } = &mut self.block;
        equations.output_jacobian(&integrator.states, &self.row, &mut self.by_state);
        self.followed.fill(Lanes::splat(0.0));
        let controller = self.controller.as_ref();
        if let Some(controller) = controller.filter(|controller| controller.acts_at_once(*sample)) {
            controller.follow(*sample, whites, &mut self.by_state, &mut self.followed);
        }
        self.covariance.begin_sample();
        let n_states = integrator.states.len();
        let trace = self.crossed.is_some().then_some(TraceLayout {
            n_states,
            n_outputs: self.row.len(),
        });
        if let Some(trace) = trace {
            outputs[trace.mean()].copy_from_slice(&integrator.states);
            outputs[trace.covariance()].copy_from_slice(&self.covariance.matrix);
        }
        let n_outputs = self.row.len();
        let first_measured = self.layout.n_inputs;
        for (output, by_state) in self.by_state.chunks_exact(n_states).enumerate() {
            let sensor = self.sensors[output] + self.followed[output];
            let predicted = self.covariance.predict(self.row[output], by_state, sensor);
            outputs[output] = predicted.value;
            outputs[n_outputs + output] = predicted.variance;
            if let Some(trace) = trace {
                outputs[trace.derivatives(output)].copy_from_slice(by_state);
                outputs[trace.gain(output)].copy_from_slice(&self.covariance.gain);
            }
            let measured = excitation.inputs[first_measured + output][*sample];
            if !measured.is_nan() && !self.layout.shows_what_acted(output) {
                self.covariance.correct(predicted, measured);
            }
        }
        let moved = self.covariance.states.iter().zip(&self.covariance.moved);
        for (state, moved) in moved {
            integrator.states[*state] += *moved;
        }
    }

    /// What the controller computes at the sample follows from the corrected states. Where the filter is traced,
    /// an interval begins with Φ = I.
    #[inline(always)]
    fn begin_interval(&mut self, whites: &[(usize, Lanes)]) {
        let n = self.covariance.states.len();
        for (index, value) in self.crossed.iter_mut().flatten().enumerate() {
            *value = Lanes::splat(if index % (n + 1) == 0 { 1.0 } else { 0.0 });
        }
        if let Some(controller) = &mut self.controller {
            controller.run(&mut self.block);
            let sample = self.block.sample;
            controller.spread(sample, whites, &mut self.covariance, self.crossed.as_mut());
        }
    }

    /// What the controller has computed moves on. Where the filter is traced, Φ over the interval is answered
    /// with the sample before it.
    #[inline(always)]
    fn end_interval(&mut self, outputs: &mut [Lanes]) {
        if let Some(controller) = &self.controller {
            let states = &mut self.block.integrator.states;
            controller.end_interval(states, &mut self.covariance, self.crossed.as_mut());
        }
        if let Some(crossed) = &self.crossed {
            let first = outputs.len() - crossed.len();
            outputs[first..].copy_from_slice(crossed);
        }
    }

    /// From a sample to the next.
    #[inline(always)]
    fn go_on(
        &mut self,
        stretches: Option<&[HeldStretch<Lanes>]>,
        interval: f64,
        stop: &AtomicBool,
    ) -> Option<()> {
        let longest = self.layout.longest_step;
        let n_steps = (interval / longest).ceil().max(1.0);
        let Some(stretches) = stretches else {
            let mut held = std::mem::take(&mut self.held);
            held.values.clone_from(&self.block.held.values);
            held.slopes.clone_from(&self.block.held.slopes);
            let crossed = self.cross(&mut held, Lanes::splat(interval), n_steps, stop);
            self.held = held;
            return crossed;
        };
        for (index, stretch) in stretches.iter().enumerate() {
            if index > 0 {
                self.block.equations.act(&stretch.held);
                self.let_newer_act();
            }
            self.cross(&mut stretch.held.clone(), stretch.duration, n_steps, stop)?;
        }
        Some(())
    }

    /// Within an interval the values of the controller begin to act that were computed a sample later.
    fn let_newer_act(&mut self) {
        if let Some(controller) = &self.controller {
            let states = &mut self.block.integrator.states;
            controller.act(states, &mut self.covariance, self.crossed.as_mut());
        }
    }

    /// Over a stretch in which nothing jumps, in so many steps of the covariance.
    #[inline(always)]
    fn cross(
        &mut self,
        held: &mut HeldQuantities<Lanes>,
        duration: Lanes,
        n_steps: f64,
        stop: &AtomicBool,
    ) -> Option<()> {
        let length = duration / Lanes::splat(n_steps);
        for step in 0..n_steps as usize {
            if step > 0 && !held.slopes.is_empty() {
                held.go_on(length);
                self.block.equations.act(held);
            }
            self.step_over(held, length, stop)?;
        }
        Some(())
    }

    /// A step of the mean and of the covariance.
    #[inline(always)]
    fn step_over(
        &mut self,
        held: &HeldQuantities<Lanes>,
        length: Lanes,
        stop: &AtomicBool,
    ) -> Option<()> {
        self.take_jacobian(0, Lanes::splat(0.0));
        self.take_end(0);
        let SimulationBlock {
            equations,
            integrator,
            ..
        } = &mut self.block;
        let stretch = FirstStretch {
            held,
            duration: length,
        };
        integrator.integrate(equations, stretch, None, stop)?;
        self.take_jacobian(2, length);
        self.take_end(1);
        // Between them the mean is a cubic through both ends and their slopes.
        let [start, end] = &self.ends;
        let (half, eighth) = (Lanes::splat(0.5), length * Lanes::splat(0.125));
        for (index, state) in self.block.integrator.states.iter_mut().enumerate() {
            *state = (start.states[index] + end.states[index]) * half
                + (start.rates[index] - end.rates[index]) * eighth;
        }
        self.take_jacobian(1, length * half);
        self.block
            .integrator
            .states
            .clone_from(&self.ends[1].states);
        self.step.length = length;
        let matrix = &mut self.covariance.matrix;
        self.transition.carry(matrix, &self.step, self.block.follow);
        if let Some(crossed) = &mut self.crossed {
            self.transition.extend(crossed);
        }
        Some(())
    }

    /// Takes the mean at one end of a step.
    #[inline(always)]
    fn take_end(&mut self, place: usize) {
        let end = &mut self.ends[place];
        end.states.clone_from(&self.block.integrator.states);
        end.rates.clone_from(&self.rates);
    }

    /// Takes the rates, the Jacobian and what disturbances add, of the step's start, middle or end, at the
    /// states as they stand.
    #[inline(always)]
    fn take_jacobian(&mut self, place: usize, elapsed: Lanes) {
        let SimulationBlock {
            equations,
            integrator,
            ..
        } = &mut self.block;
        let states = &integrator.states;
        equations.rates(states, elapsed, &mut self.rates);
        equations.jacobian(states, elapsed, &self.rates, &mut self.jacobian);
        let moved = &self.covariance.states;
        let n = states.len();
        let entries = moved
            .iter()
            .flat_map(|row| moved.iter().map(move |column| row * n + column));
        for (entry, index) in self.step.jacobians[place].iter_mut().zip(entries) {
            *entry = self.jacobian[index];
        }
        self.take_diffusion(place);
    }

    /// What disturbances add in a second where the Jacobian was taken last.
    #[inline(always)]
    fn take_diffusion(&mut self, place: usize) {
        let moved = &self.covariance.states;
        let (n, n_states) = (moved.len(), self.block.integrator.states.len());
        let diffusion = &mut self.step.diffusions[place];
        diffusion.fill(Lanes::splat(0.0));
        for noise in &self.noises {
            if noise.kind != DisturbanceKind::White {
                let place = moved.partition_point(|state| *state < noise.state);
                diffusion[place * (n + 1)] += noise.diffusion;
                continue;
            }
            let driven = |place: usize| self.jacobian[moved[place] * n_states + noise.state];
            for (index, value) in diffusion.iter_mut().enumerate() {
                *value += driven(index / n) * driven(index % n) * noise.diffusion;
            }
        }
    }
}

/// The next samples of a block.
struct NextFilteredSamples<'b, 'a> {
    block: &'b mut FilterBlock<'a>,
    samples: usize,
    outputs: &'b mut [Lanes],
    stop: &'b AtomicBool,
}

impl Wide for NextFilteredSamples<'_, '_> {
    type Output = Option<()>;

    #[inline(always)]
    fn work(self) -> Option<()> {
        self.block
            .advance_lanes(self.samples, self.outputs, self.stop)
    }
}

impl BlockSimulator for FilterBlock<'_> {
    fn advance(&mut self, samples: usize, outputs: &mut [Lanes], stop: &AtomicBool) -> Option<()> {
        if samples == 0 {
            return Some(());
        }
        let width = self.block.width;
        width.does(NextFilteredSamples {
            block: self,
            samples,
            outputs,
            stop,
        })
    }

    fn failures(&self) -> &[Option<SimulationFailure>] {
        self.block.failures()
    }

    fn derivative_evaluations(&self) -> u64 {
        self.block.derivative_evaluations()
    }

    fn states(&self) -> Vec<Lanes> {
        self.block.states()
    }
}
