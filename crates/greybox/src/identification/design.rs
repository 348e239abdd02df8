//! The design of an experiment, as it is answered.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::estimation::Finding;
use crate::uncertainty::design::Excitation;
use greybox_recording::SampledSignal;

/// Which experiment next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Design {
    /// The model.
    #[schema(example = "single_rod_servo")]
    pub model: String,
    /// Whether everything was looked at that was to be; else this is the best that was found in the
    /// time that a client may let the server compute.
    pub finished: bool,
    /// The unknowns whose uncertainty, with all that is assumed, was to become small: its
    /// determinant, averaged (as a logarithm) over the points.
    pub wanted: Vec<String>,
    /// Points of what is known at present that experiments were looked at.
    pub points: u64,
    /// Experiments that were looked at.
    pub assessed: u64,
    /// Where random numbers came from.
    pub seed: u64,
    /// What is known before the experiment.
    pub before: Vec<PredictedParameter>,
    /// The best of each family and all that was proposed, the best first.
    pub proposals: Vec<RankedProposal>,
    /// The inputs of the best, to be played: as `POST /v1/simulations` takes them. Absent where
    /// nothing drives the model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub inputs: Option<PlayedInputs>,
    /// What one sensor more would bring in the best experiment, the best first.
    pub sensors: Vec<RankedSensor>,
    /// What the user should know.
    pub findings: Vec<Finding>,
}

/// One unknown and how well it would be known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PredictedParameter {
    /// The parameter, or the state whose start is estimated.
    #[schema(example = "mass")]
    pub name: String,
    /// The SI unit of the unknown.
    #[schema(example = "kg")]
    pub unit: String,
    /// The value that the prediction is made at, SI: the estimate, the middle of its prior or the
    /// middle of its range.
    #[schema(example = 58.0)]
    pub value: f64,
    /// One standard deviation of the error by noise alone; `null` where the unknown is not fixed.
    #[schema(example = 0.31)]
    pub standard_error: Option<f64>,
    /// One standard deviation of the error with everything that is taken as known within its
    /// tolerance; `null` where the unknown is not fixed.
    #[schema(example = 0.44)]
    pub total_standard_error: Option<f64>,
}

/// One experiment and what it would bring.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RankedProposal {
    /// The family, or what the proposal is called.
    #[schema(example = "prbs")]
    pub name: String,
    /// What is played, or when is measured.
    pub excitation: Excitation,
    /// How many times larger the wanted total standard errors are than with the best (their
    /// geometric mean along the axes of the covariance, averaged over the points).
    #[schema(example = 1.35)]
    pub relative_error: f64,
    /// The decimal logarithm of the determinant of the wanted unknowns' information in SI, with all
    /// that was known before, averaged over the points.
    #[schema(example = 7.03)]
    pub log10_determinant: f64,
    /// Points at which it cannot be simulated: it counts as telling nothing there.
    pub failed_points: u64,
    /// What would be known after it, with all that was known before; empty where it cannot be
    /// simulated at the present values.
    pub after: Vec<PredictedParameter>,
}

/// One sensor more and what it would bring.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RankedSensor {
    /// The output.
    #[schema(example = "chamber_pressure_1")]
    pub output: String,
    /// The wanted total standard errors with it, as a share of those without it.
    #[schema(example = 0.4)]
    pub relative_error: f64,
    /// What would be known with it.
    pub after: Vec<PredictedParameter>,
}

/// Samples of inputs on a uniform grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PlayedInputs {
    /// The time from one sample to the next `[s]`; each is held until then.
    pub sample_time_s: f64,
    /// By the model's names.
    pub signals: BTreeMap<String, SampledSignal>,
}

impl Design {
    /// What is to be done, as a table in CSV: the samples of the inputs, or when to measure.
    #[must_use]
    pub fn csv(&self) -> String {
        if let Some(inputs) = &self.inputs {
            return inputs.csv();
        }
        let mut text = "time_s\n".to_owned();
        let instants = self.proposals.first().map(|best| &best.excitation);
        if let Some(Excitation::Instants { instants_s }) = instants {
            text.extend(instants_s.iter().map(|instant| format!("{instant}\n")));
        }
        text
    }
}

impl PlayedInputs {
    fn csv(&self) -> String {
        let names: Vec<&str> = self.signals.keys().map(String::as_str).collect();
        let mut text = format!("time_s,{}\n", names.join(","));
        let samples = self.signals.values().map(|signal| signal.values.len());
        for sample in 0..samples.min().unwrap_or(0) {
            text.push_str(&(sample as f64 * self.sample_time_s).to_string());
            for signal in self.signals.values() {
                let value = signal.values[sample].unwrap_or_default();
                text.push_str(&format!(",{value}"));
            }
            text.push('\n');
        }
        text
    }
}
