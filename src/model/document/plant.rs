//! A document's equations as a plant that the simulation can drive.

use super::graph::Leaf;
use super::jacobian;
use super::simulator::{Machine, Simulator};
use super::tape::{Register, Tape};
use crate::simulation::batch::Plant;
use crate::simulation::{BlockSimulator, Candidate, Excitation};

/// The equations, ready to run.
#[derive(Debug)]
pub struct DocumentPlant {
    pub(super) tape: Tape,
    pub(super) wiring: Wiring,
    /// The size that a change of each state is measured against.
    pub(super) scales: Vec<f64>,
    /// Whether inputs move in straight lines from sample to sample.
    pub(super) moving_inputs: bool,
}

/// The registers of what comes from outside, where the equations use it.
#[derive(Debug, Default)]
pub struct Wiring {
    pub parameters: Vec<Option<Register>>,
    pub sample_time: Option<Register>,
    pub recorded: Vec<Option<Register>>,
    pub previous: Vec<Option<Register>>,
    pub inputs: Vec<Option<Register>>,
    pub sampled: Vec<Option<Register>>,
    pub states: Vec<Option<Register>>,
}

impl Wiring {
    fn new(tape: &Tape, n_parameters: usize) -> Wiring {
        let mut wiring = Wiring {
            parameters: vec![None; n_parameters],
            previous: vec![None; tape.roots.sampled.len()],
            sampled: vec![None; tape.roots.sampled.len()],
            states: vec![None; tape.roots.rates.len()],
            ..Wiring::default()
        };
        for (leaf, register) in tape.leaves() {
            match leaf {
                Leaf::SampleTime => wiring.sample_time = Some(*register),
                Leaf::Parameter(index) => put(&mut wiring.parameters, *index, *register),
                Leaf::Recorded(index) => put(&mut wiring.recorded, *index, *register),
                Leaf::Previous(index) => put(&mut wiring.previous, *index, *register),
                Leaf::Input(index) => put(&mut wiring.inputs, *index, *register),
                Leaf::Sampled(index) => put(&mut wiring.sampled, *index, *register),
                Leaf::State(index) => put(&mut wiring.states, *index, *register),
            }
        }
        wiring
    }
}

fn put(places: &mut Vec<Option<Register>>, index: u16, register: Register) {
    let index = usize::from(index);
    if places.len() <= index {
        places.resize(index + 1, None);
    }
    places[index] = Some(register);
}

impl DocumentPlant {
    /// From the tape and, for each state, the size that its author gave. A state without one is
    /// measured against where it starts at the default parameters, or against 1.
    #[must_use]
    pub fn new(
        tape: Tape,
        scales: Vec<Option<f64>>,
        defaults: Vec<f64>,
        moving_inputs: bool,
    ) -> DocumentPlant {
        let wiring = Wiring::new(&tape, defaults.len());
        let mut plant = DocumentPlant {
            tape,
            wiring,
            scales: Vec::new(),
            moving_inputs,
        };
        let mut machine: Machine<'_, f64> = Machine::new(&plant, |index| defaults[index], 1.0);
        let initial = machine.initial_state();
        let own = |start: &f64| {
            let size = start.abs();
            if size > 0.0 && size.is_finite() {
                size
            } else {
                1.0
            }
        };
        let scales = scales.iter().zip(&initial);
        plant.scales = scales
            .map(|(given, start)| given.unwrap_or_else(|| own(start)))
            .collect();
        plant
    }

    /// The Jacobian of a candidate where it starts, its inputs at 0.
    pub(super) fn initial_jacobian(&self, parameters: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut machine: Machine<'_, f64> = Machine::new(self, parameters, 1.0);
        let state = machine.initial_state();
        machine.hold_zeros();
        let at = |machine: &mut Machine<'_, f64>, state: &[f64]| {
            let mut rates = vec![0.0; state.len()];
            machine.rates(state, 0.0, &mut rates);
            jacobian::by_states(machine)
        };
        let jacobian = at(&mut machine, &state);
        if jacobian.iter().all(|entry| entry.is_finite()) {
            return jacobian;
        }
        // A root or a quotient at its singular point: a little beside it the slope is finite.
        let beside: Vec<f64> = state
            .iter()
            .zip(&self.scales)
            .map(|(x, scale)| x + scale)
            .collect();
        at(&mut machine, &beside)
    }
}

impl Plant for DocumentPlant {
    fn n_outputs(&self) -> usize {
        self.tape.roots.outputs.len()
    }

    /// What the document says, or else the spectral radius of the Jacobian where it starts.
    fn resolved_rate(&self, parameters: &[f64]) -> f64 {
        let rate = match self.tape.roots.fastest_rate {
            Some(register) => {
                let machine: Machine<'_, f64> = Machine::new(self, |index| parameters[index], 1.0);
                machine.registers[usize::from(register)]
            }
            None => {
                let jacobian = self.initial_jacobian(|index| parameters[index]);
                jacobian::spectral_bound(&jacobian, self.scales.len())
            }
        };
        if rate.is_finite() { rate.max(0.0) } else { 0.0 }
    }

    fn simulator<'a>(
        &'a self,
        excitation: Excitation<'a>,
        candidates: &[Candidate<'_>],
    ) -> Box<dyn BlockSimulator + 'a> {
        Box::new(Simulator::new(self, excitation, candidates))
    }
}
