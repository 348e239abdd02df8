//! Integration of any model, many candidates at once.
//!
//! [`dynamics`] is what a plant says of itself, [`lanes`] the numbers of either precision that its
//! equations are written in, [`block`] one block of candidates going through a recording side by side:
//! fixed-step Runge–Kutta ([`explicit`]) where that is accurate, an adaptive Rosenbrock method
//! ([`stiff`]) for the single samples of the single candidates where it is not. [`width`] chooses
//! the processor's registers for it, [`batch`] spreads blocks over the processor's cores.

pub mod batch;
pub mod block;
pub mod dynamics;
pub mod explicit;
pub mod lanes;
pub mod single;
pub mod stiff;
pub mod width;

use serde::{Deserialize, Serialize};
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
}

impl Accuracy {
    /// Step times rate `[1]`.
    #[must_use]
    pub fn step_times_rate(self) -> f64 {
        match self {
            Accuracy::Ranking | Accuracy::Screening => 0.8,
            Accuracy::Full => 0.15,
        }
    }

    /// Error of one step of the stiff method, against the larger of the state and its scale `[1]`.
    #[must_use]
    pub fn stiff_tolerance(self) -> f64 {
        match self {
            Accuracy::Ranking | Accuracy::Screening => 1e-5,
            Accuracy::Full => 1e-8,
        }
    }
}

/// The recorded inputs that drive a simulation.
#[derive(Clone, Copy, Debug)]
pub struct Excitation<'a> {
    /// The time from one sample to the next `[s]`.
    pub sample_time: f64,
    /// How many samples.
    pub samples: usize,
    /// Which of the model's input sets is in use.
    pub input_set: usize,
    /// For each input of the set its samples, SI.
    pub inputs: &'a [Vec<f64>],
    /// How finely.
    pub accuracy: Accuracy,
}

/// What is simulated: a full parameter vector and where it starts.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'a> {
    /// A value for each parameter of the model, SI.
    pub parameters: &'a [f64],
    /// For each state its value at the first sample, SI; none: the model's own.
    pub initial_state: &'a [Option<f64>],
    /// The rate that its steps resolve [1/s], where that is not its own: candidates that are
    /// compared to the last digits (a derivative by differences) take the same steps.
    pub resolved_rate: Option<f64>,
}

/// Why a candidate's simulation ended before the record did.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// A state is no longer a finite number.
    Diverged,
    /// A state has left the range in which the model's equations hold.
    OutOfRange,
    /// The step budget of one candidate is used up.
    StepBudget,
}

impl Failure {
    /// The name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Failure::Diverged => "diverged",
            Failure::OutOfRange => "out_of_range",
            Failure::StepBudget => "step_budget",
        }
    }
}

/// A block of candidates going through a recording side by side.
pub trait BlockSimulator: Send {
    /// Simulates the next samples and writes all of the model's outputs at each of them; a failed
    /// candidate's outputs are NaN. The candidates stand in groups of [`lanes::LANES`], one after
    /// the other: `outputs[(group · samples + sample) · n_outputs + output]`.
    fn advance(&mut self, samples: usize, outputs: &mut [lanes::Lanes]);
    /// How each lane has failed, if it has. The last group may have fewer lanes than
    /// [`lanes::LANES`].
    fn failures(&self) -> &[Option<Failure>];
    /// Derivatives evaluated so far, one lane each.
    fn derivative_evaluations(&self) -> u64;
}
