//! One block of candidates of a document's plant going through a recording side by side.
//!
//! The same promises as `simulation::block`: a candidate's trajectory depends on nothing but the
//! candidate and the recording, a candidate that fails is marked and disturbs no other, and work
//! per candidate is bounded. The steps are those of `simulation::explicit`: fourth order, fixed
//! for each candidate, taken in two parts where a switch changes its sign.

use super::held::{Delay, Held, Segment};
use super::plant::DocumentPlant;
use super::runge_kutta::Explicit;
use super::tape::{Registers, Row};
use super::{jacobian, stiff};
use crate::simulation::block::STIFF_BUDGET;
use crate::simulation::explicit::{LARGEST_STEP_TIMES_RATE, STAGES, Steps};
use crate::simulation::lanes::{LANES, Lanes, Real};
use crate::simulation::stiff::Span;
use crate::simulation::{BlockSimulator, Candidate, Excitation, Failure};

/// Instructions that one candidate may spend in the stiff method over a whole recording; never
/// more derivatives than a built-in model may.
const STIFF_INSTRUCTIONS: u64 = 200_000_000;

/// How a lane has failed whose outputs are not numbers, or whose state is out of range.
const NOT_POSSIBLE: [Failure; 2] = [Failure::Diverged, Failure::OutOfRange];

/// The equations with their registers, for one candidate or for a row of them.
pub struct Machine<'a, R> {
    pub(super) plant: &'a DocumentPlant,
    pub(super) registers: Registers<R>,
    /// The inputs at the start of the segment, and how fast they move.
    inputs: Vec<R>,
    pub(super) slopes: Vec<R>,
    /// Room for derivatives, once they are asked for.
    pub(super) directions: Option<Registers<Lanes>>,
}

impl<'a, R: Row> Machine<'a, R> {
    /// Registers for the given parameters, with all that follows from them.
    pub fn new(
        plant: &'a DocumentPlant,
        parameters: impl Fn(usize) -> R,
        sample_time: f64,
    ) -> Self {
        let mut machine = Machine {
            plant,
            registers: plant.tape.registers(),
            inputs: Vec::new(),
            slopes: Vec::new(),
            directions: None,
        };
        for (index, register) in plant.wiring.parameters.iter().enumerate() {
            machine.set(*register, parameters(index));
        }
        machine.set(plant.wiring.sample_time, R::splat(sample_time));
        plant.tape.run(&plant.tape.setup, &mut machine.registers);
        machine
    }

    fn set(&mut self, register: Option<u16>, value: R) {
        if let Some(register) = register {
            self.registers[usize::from(register)] = value;
        }
    }

    fn get(&self, register: u16) -> R {
        self.registers[usize::from(register)]
    }

    /// Where the model starts.
    pub fn initial_state(&mut self) -> Vec<R> {
        let initial = self.plant.tape.roots.initial.iter();
        initial.map(|register| self.get(*register)).collect()
    }

    /// All held quantities 0.
    pub fn hold_zeros(&mut self) {
        let zero = R::splat(0.0);
        let held = Held {
            inputs: vec![zero; self.plant.wiring.inputs.len()],
            slopes: Vec::new(),
            sampled: vec![zero; self.plant.wiring.sampled.len()],
        };
        self.hold(&held);
    }

    /// Begins a segment.
    pub fn hold(&mut self, held: &Held<R>) {
        for (register, value) in self.plant.wiring.inputs.iter().zip(&held.inputs) {
            self.set(*register, *value);
        }
        for (register, value) in self.plant.wiring.sampled.iter().zip(&held.sampled) {
            self.set(*register, *value);
        }
        self.inputs.clone_from(&held.inputs);
        self.slopes.clone_from(&held.slopes);
        self.plant
            .tape
            .run(&self.plant.tape.held, &mut self.registers);
    }

    #[inline(always)]
    fn load(&mut self, state: &[R]) {
        for (register, value) in self.plant.wiring.states.iter().zip(state) {
            self.set(*register, *value);
        }
    }

    /// The rates of change at a state, `elapsed` after the segment began.
    pub fn rates(&mut self, state: &[R], elapsed: R, into: &mut [R]) {
        self.load_moving(state, elapsed);
        let tape = &self.plant.tape;
        tape.run(&tape.rates, &mut self.registers);
        self.read_rates(into);
    }

    #[inline(always)]
    fn load_moving(&mut self, state: &[R], elapsed: R) {
        self.load(state);
        for (index, slope) in self.slopes.iter().enumerate() {
            if let Some(Some(register)) = self.plant.wiring.inputs.get(index) {
                self.registers[usize::from(*register)] = self.inputs[index] + *slope * elapsed;
            }
        }
    }

    #[inline(always)]
    fn read_rates(&self, into: &mut [R]) {
        for (rate, register) in into.iter_mut().zip(&self.plant.tape.roots.rates) {
            *rate = self.registers[usize::from(*register)];
        }
    }

    /// The switches where the rates were taken last.
    pub fn switches(&mut self, into: &mut [R]) {
        let tape = &self.plant.tape;
        tape.run(&tape.switches, &mut self.registers);
        self.read_switches(into);
    }

    #[inline(always)]
    fn read_switches(&self, into: &mut [R]) {
        for (switch, register) in into.iter_mut().zip(&self.plant.tape.roots.switches) {
            *switch = self.get(*register);
        }
    }

    /// The outputs at a state.
    fn outputs(&mut self, state: &[R], into: &mut [R]) {
        self.load(state);
        let tape = &self.plant.tape;
        tape.run(&tape.output, &mut self.registers);
        for (output, register) in into.iter_mut().zip(&tape.roots.outputs) {
            *output = self.registers[usize::from(*register)];
        }
    }

    /// What is computed once a sample, from the recorded inputs and the values before.
    fn sample(&mut self, state: &[R], recorded: &[f64], previous: &[R]) -> Vec<R> {
        self.load(state);
        for (register, value) in self.plant.wiring.recorded.iter().zip(recorded) {
            self.set(*register, R::splat(*value));
        }
        for (register, value) in self.plant.wiring.previous.iter().zip(previous) {
            self.set(*register, *value);
        }
        let tape = &self.plant.tape;
        tape.run(&tape.sample, &mut self.registers);
        let roots = tape.roots.sampled.iter();
        roots.map(|(register, _)| self.get(*register)).collect()
    }
}

impl Machine<'_, Lanes> {
    /// [`Machine::rates`] as part of work that is compiled for each width.
    #[inline(always)]
    pub fn rates_wide(&mut self, state: &[Lanes], elapsed: Lanes, into: &mut [Lanes]) {
        self.load_moving(state, elapsed);
        let tape = &self.plant.tape;
        tape.run_wide(&tape.rates, &mut self.registers);
        self.read_rates(into);
    }

    /// [`Machine::switches`], likewise.
    #[inline(always)]
    pub fn switches_wide(&mut self, into: &mut [Lanes]) {
        let tape = &self.plant.tape;
        tape.run_wide(&tape.switches, &mut self.registers);
        self.read_switches(into);
    }
}

/// The block.
pub struct Simulator<'a> {
    machine: Machine<'a, Lanes>,
    excitation: Excitation<'a>,
    explicit: Explicit,
    state: Vec<Lanes>,
    parked: Vec<Lanes>,
    /// The sampled quantities at the sample before.
    previous: Vec<Lanes>,
    delay: Option<Delay>,
    whole_sample: Steps,
    sample: usize,
    /// Lanes from here on repeat the first.
    n_candidates: usize,
    failures: [Option<Failure>; LANES],
    stiff_evaluations: [u64; LANES],
    stiff_budget: u64,
    explicit_evaluations: u64,
}

impl<'a> Simulator<'a> {
    /// Starts the simulation of up to [`LANES`] candidates; lanes left over repeat the first.
    pub fn new(
        plant: &'a DocumentPlant,
        excitation: Excitation<'a>,
        candidates: &[Candidate<'_>],
    ) -> Self {
        assert!(
            !candidates.is_empty() && candidates.len() <= LANES,
            "a block holds 1 to {LANES} candidates"
        );
        let of_lane = |lane: usize| candidates.get(lane).unwrap_or(&candidates[0]);
        let parameter =
            |index: usize| Lanes(std::array::from_fn(|lane| of_lane(lane).parameters[index]));
        let mut machine = Machine::new(plant, parameter, excitation.sample_time);
        let parked = machine.initial_state();
        let given = |(index, own): (usize, &Lanes)| {
            let start = |lane: usize| of_lane(lane).initial_state[index].unwrap_or(own.0[lane]);
            Lanes(std::array::from_fn(start))
        };
        let state: Vec<Lanes> = parked.iter().enumerate().map(given).collect();
        let rate = |lane: usize| {
            let candidate = of_lane(lane);
            let own =
                || crate::simulation::batch::Plant::resolved_rate(plant, candidate.parameters);
            candidate.resolved_rate.unwrap_or_else(own)
        };
        let rate = Lanes(std::array::from_fn(rate));
        let whole = Lanes::splat(excitation.sample_time);
        let before = plant.tape.roots.sampled.iter();
        let before = before.map(|(_, initial)| {
            initial.map_or(Lanes::splat(0.0), |register| {
                machine.registers[usize::from(register)]
            })
        });
        let previous = before.collect();
        let delay = plant
            .tape
            .roots
            .delay
            .map(|register| machine.registers[usize::from(register)]);
        let delay = delay.filter(|delay| delay.any(|seconds| seconds > 0.0));
        let instructions = plant.tape.rates.len().max(1) as u64;
        Simulator {
            explicit: Explicit::new(plant, |lane, index| of_lane(lane).parameters[index]),
            excitation,
            state,
            parked,
            previous,
            delay: delay.map(|delay| Delay::new(delay, &excitation, &rate)),
            whole_sample: Steps::resolving(&rate, &whole, excitation.accuracy),
            sample: 0,
            n_candidates: candidates.len(),
            failures: [None; LANES],
            stiff_evaluations: [0; LANES],
            stiff_budget: (STIFF_INSTRUCTIONS / instructions).min(STIFF_BUDGET),
            explicit_evaluations: 0,
            machine,
        }
    }

    fn take_sample(&mut self, row: &mut [Lanes]) {
        let inputs = self.excitation.inputs;
        let at = |sample: usize| inputs.iter().map(move |input| input[sample]);
        let recorded: Vec<f64> = at(self.sample).collect();
        let sampled = self.machine.sample(&self.state, &recorded, &self.previous);
        self.previous.clone_from(&sampled);
        let slopes = if self.machine.plant.moving_inputs {
            let next = (self.sample + 1).min(self.excitation.samples - 1);
            let per_second = 1.0 / self.excitation.sample_time;
            let pairs = at(next).zip(&recorded);
            pairs
                .map(|(next, now)| Lanes::splat((next - now) * per_second))
                .collect()
        } else {
            Vec::new()
        };
        let held = Held {
            inputs: recorded.into_iter().map(Lanes::splat).collect(),
            slopes,
            sampled,
        };
        let segments = match &mut self.delay {
            None => vec![Segment {
                held,
                steps: self.whole_sample,
            }],
            Some(delay) => delay.segments(held, self.excitation.sample_time),
        };
        self.write_outputs(&segments, row);
        for segment in &segments {
            self.integrate(segment);
        }
        self.sample += 1;
    }

    /// The outputs, with what acts on the plant as the sample begins.
    fn write_outputs(&mut self, segments: &[Segment], row: &mut [Lanes]) {
        let mut held = segments[0].held.clone();
        if let [before, after] = segments {
            for lane in (0..LANES).filter(|&lane| before.steps.count[lane] == 0) {
                held.set_lane_from(lane, &after.held);
            }
        }
        self.machine.hold(&held);
        self.machine.outputs(&self.state, row);
        let valid = self
            .machine
            .plant
            .tape
            .roots
            .valid
            .map(|register| self.machine.get(register));
        for lane in 0..LANES {
            let finite = row.iter().all(|output| output.0[lane].is_finite());
            let holds = valid.is_none_or(|valid| valid.0[lane] >= 0.5);
            if self.failures[lane].is_none() && !(finite && holds) {
                self.fail(lane, NOT_POSSIBLE[usize::from(finite)]);
            }
            if self.failures[lane].is_some() {
                row.iter_mut().for_each(|output| output.0[lane] = f64::NAN);
            }
        }
    }

    /// Explicit steps for all lanes, then the stiff method for those that need it.
    fn integrate(&mut self, segment: &Segment) {
        let start = self.state.clone();
        self.machine.hold(&segment.held);
        let worst = self
            .explicit
            .integrate(&mut self.machine, &mut self.state, &segment.steps);
        let steps: u64 = segment
            .steps
            .count
            .iter()
            .map(|&count| u64::from(count))
            .sum();
        self.explicit_evaluations += STAGES as u64 * steps;
        for lane in (0..self.n_candidates).filter(|&lane| segment.steps.count[lane] > 0) {
            let finite = self.state.iter().all(|value| value.0[lane].is_finite());
            let calm = worst.0[lane] <= LARGEST_STEP_TIMES_RATE;
            if self.failures[lane].is_none() && !(finite && calm) {
                self.mend(segment, &start, lane);
            }
        }
        for lane in self.n_candidates..LANES {
            self.failures[lane] = self.failures[0];
            self.state
                .iter_mut()
                .for_each(|value| value.0[lane] = value.0[0]);
        }
    }

    /// Integrates one lane anew by the stiff method, unless the alarm was false; marks it where
    /// it cannot be served.
    fn mend(&mut self, segment: &Segment, start: &[Lanes], lane: usize) {
        let mut single = Machine {
            plant: self.machine.plant,
            registers: Box::new(std::array::from_fn(|place| {
                self.machine.registers[place].0[lane]
            })),
            inputs: Vec::new(),
            slopes: Vec::new(),
            directions: None,
        };
        single.hold(&segment.held.of_lane(lane));
        let mut state: Vec<f64> = start.iter().map(|value| value.0[lane]).collect();
        let end: Vec<f64> = self.state.iter().map(|value| value.0[lane]).collect();
        let length = segment.steps.length.0[lane];
        let is_slow = |rate: f64| rate * length <= LARGEST_STEP_TIMES_RATE;
        let finite = end.iter().all(|value| value.is_finite());
        self.stiff_evaluations[lane] += 2;
        if finite && is_slow(rate_at(&mut single, &state)) && is_slow(rate_at(&mut single, &end)) {
            return;
        }
        let duration = length * f64::from(segment.steps.count[lane]);
        let outcome = stiff::integrate(
            &mut single,
            &mut state,
            Span {
                duration,
                tolerance: self.excitation.accuracy.stiff_tolerance(),
            },
            &mut self.stiff_evaluations[lane],
            self.stiff_budget,
        );
        match outcome {
            Ok(()) => {
                for (row, value) in self.state.iter_mut().zip(state) {
                    row.0[lane] = value;
                }
            }
            Err(failure) => self.fail(lane, failure),
        }
    }

    /// Marks the lane and parks it at a harmless state, so that the others go on undisturbed.
    fn fail(&mut self, lane: usize, failure: Failure) {
        self.failures[lane] = Some(failure);
        for (row, parked) in self.state.iter_mut().zip(&self.parked) {
            row.0[lane] = parked.0[lane];
        }
    }
}

/// A bound of the fastest rate at a state.
fn rate_at(machine: &mut Machine<'_, f64>, state: &[f64]) -> f64 {
    let mut rates = vec![0.0; state.len()];
    machine.rates(state, 0.0, &mut rates);
    let jacobian = jacobian::by_states(machine);
    jacobian::spectral_bound(&jacobian, state.len())
}

impl BlockSimulator for Simulator<'_> {
    fn advance(&mut self, samples: usize, outputs: &mut [Lanes]) {
        let width = outputs.len() / samples.max(1);
        for row in outputs.chunks_exact_mut(width.max(1)) {
            self.take_sample(row);
        }
    }

    fn failures(&self) -> &[Option<Failure>] {
        &self.failures
    }

    fn derivative_evaluations(&self) -> u64 {
        self.explicit_evaluations + self.stiff_evaluations.iter().sum::<u64>()
    }
}
