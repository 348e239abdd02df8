//! Integration of any model, many candidates at once.
//!
//! [`equations`] is what the integrator asks of a plant; a model written in Rust ([`native`]) and
//! the program of a document ([`program`]) answer it. `steps` takes a row of candidates from one
//! instant to another, each with steps as long as its errors allow, by an explicit method
//! (`explicit`) or, where that would take many steps, by one for stiff equations (`stiff`).
//! [`block`] takes a row through a recording, [`batch`] spreads blocks over the processor's cores.

pub mod batch;
pub mod block;
pub mod equations;
mod explicit;
mod factors;
pub mod filter;
mod free_block;
mod impossible;
mod input_delay;
pub(crate) mod language;
pub mod model;
pub mod native;
pub mod program;
pub mod single;
mod steps;
mod stiff;

pub use language::mathml;

use greybox_numerics::lanes::{LANES, Lanes};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use utoipa::ToSchema;

/// How accurate a simulation is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Accuracy {
    /// Fine enough to rank candidates by their errors: the steps of [`Accuracy::Screening`], in
    /// single precision where the plant offers it (which moves the servo's position by less than
    /// 0.1 µm rms). Too coarse for differences between neighbours.
    Ranking,
    /// Fine enough to find the best candidate: the servo's position within 2 µm rms.
    Screening,
    /// Fine enough to estimate from: the servo's position within 0.1 µm of the trajectories in
    /// `tests/known_answers`.
    #[default]
    Full,
    /// Fine enough to measure the errors of the coarser accuracies against.
    Reference,
}

impl Accuracy {
    /// The error that a step may make, against the size of each state `[1]`: the mean over the
    /// states. It is that of a method of third order; the one of fourth order that is gone on with
    /// errs less.
    #[must_use]
    pub fn tolerance(self) -> f64 {
        match self {
            Accuracy::Ranking | Accuracy::Screening => 5e-6,
            Accuracy::Full => 1e-8,
            Accuracy::Reference => 1e-11,
        }
    }
}

/// The recorded inputs that drive a simulation.
#[derive(Clone, Copy, Debug)]
pub struct DrivingInputs<'a> {
    /// The time from one sample to the next `[s]`.
    pub sample_time: f64,
    /// When the samples were taken `[s]`, where the time between them is not always the same.
    pub instants: Option<&'a [f64]>,
    /// How many samples.
    pub samples: usize,
    /// Which of the model's input sets is in use.
    pub input_set: usize,
    /// For each input of the set its samples, SI.
    pub inputs: &'a [Vec<f64>],
    /// How finely.
    pub accuracy: Accuracy,
}

impl DrivingInputs<'_> {
    /// When a sample was taken `[s]`.
    #[must_use]
    pub fn instant(&self, sample: usize) -> f64 {
        match self.instants {
            Some(instants) => instants[sample],
            None => sample as f64 * self.sample_time,
        }
    }

    /// The time from a sample to the next `[s]`; 0 at the last.
    #[must_use]
    #[inline]
    pub fn interval(&self, sample: usize) -> f64 {
        match self.instants {
            _ if sample + 1 >= self.samples => 0.0,
            Some(instants) => instants[sample + 1] - instants[sample],
            None => self.sample_time,
        }
    }
}

/// What is simulated: a full parameter vector and where it starts.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedCandidate<'a> {
    /// A value for each parameter of the model, SI.
    pub parameters: &'a [f64],
    /// For each state its value at the first sample, SI; none: the model's own.
    pub initial_state: &'a [Option<f64>],
}

/// Candidates that go through a recording side by side.
#[derive(Clone, Copy, Debug)]
pub struct CandidateBlock<'a> {
    /// The candidates.
    pub members: &'a [SimulatedCandidate<'a>],
    /// Whether all take the steps that the first of them needs, so that they can be compared to
    /// the last digits.
    pub in_step: bool,
}

/// Why a candidate's simulation ended before the record did.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum SimulationFailure {
    /// A quantity is no longer a number, or beyond any that a plant can have.
    Diverged,
    /// A state has left the range in which the model's equations hold.
    OutOfRange,
    /// The step budget of one candidate is used up.
    StepBudget,
    /// No step is short enough for its error to meet the tolerance.
    Tolerance,
}

impl SimulationFailure {
    /// The name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            SimulationFailure::Diverged => "diverged",
            SimulationFailure::OutOfRange => "out_of_range",
            SimulationFailure::StepBudget => "step_budget",
            SimulationFailure::Tolerance => "tolerance",
        }
    }
}

/// A plant of any kind, behind one table of functions.
pub trait Plant: Send + Sync {
    /// How many outputs the plant has.
    fn n_outputs(&self) -> usize;
    /// A rate that grows with the work that a candidate takes [1/s]. Candidates of like work go
    /// side by side; nothing else depends on it.
    fn work_rate(&self, _parameters: &[f64]) -> f64 {
        0.0
    }
    /// The rate of the plant's fastest mode `[1/s]`, where it starts and with inputs of 0; 0 where
    /// it cannot be told.
    fn fastest_rate(&self, parameters: &[f64]) -> f64 {
        self.work_rate(parameters)
    }
    /// The plant made for candidates that have these parameters in common, where it is faster:
    /// what they make 0 need not be computed. To the bit, but that what is multiplied by 0 counts
    /// as 0 where it is no number.
    fn specialised(&self, _fixed: &[Option<f64>]) -> Option<Arc<dyn Plant>> {
        None
    }
    /// How many candidates a block may hold at this accuracy, ascending. A larger one takes less
    /// time for each candidate, a smaller one less for the whole block.
    fn block_sizes(&self, _accuracy: Accuracy) -> &'static [usize] {
        &[LANES]
    }
    /// Whether candidates go through a recording of so many samples each by itself, so that a block may
    /// hold any number of them: nothing acts on the plant from outside.
    fn runs_freely(&self, _samples: usize) -> bool {
        false
    }
    /// Starts a block of candidates, at most as many as the largest holds.
    fn simulator<'a>(
        &'a self,
        excitation: DrivingInputs<'a>,
        candidates: CandidateBlock<'_>,
    ) -> Box<dyn BlockSimulator + 'a>;
}

/// A block of candidates going through a recording side by side.
pub trait BlockSimulator: Send {
    /// Simulates the next samples and writes all of the model's outputs at each of them; a failed
    /// candidate's outputs are NaN. The candidates stand in groups of [`LANES`], one after the
    /// other: `outputs[(group · samples + sample) · n_outputs + output]`. Answers nothing soon
    /// after `stop` is raised.
    fn advance(&mut self, samples: usize, outputs: &mut [Lanes], stop: &AtomicBool) -> Option<()>;
    /// How each lane has failed, if it has. The last group may have fewer lanes than [`LANES`].
    fn failures(&self) -> &[Option<SimulationFailure>];
    /// Derivatives evaluated so far, one lane each.
    fn derivative_evaluations(&self) -> u64;
    /// The states at the next sample; after the last one, where they were at it. In groups like the
    /// outputs: `states[group · n_states + state]`.
    fn states(&self) -> Vec<Lanes>;
}
