//! The result document of a job: what was estimated, how well it is known, and what made it.
//!
//! Every number in it is finite. A number that could not be had is absent (`null`) and a
//! `…_reason` beside it says why.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

mod interval;
mod posterior;
mod process_noise;
mod search;
mod verdict;

pub use super::next_steps::NextStep;
pub use super::tried::{TriedParameter, TriedStep};
pub use crate::estimation::floor::FloorReport;
pub use crate::estimation::report::{SearchEnd, StartReport};
pub use crate::estimation::stop_reason::StopReason;
pub use crate::uncertainty::fit::{Criteria, OutputFit};
pub use crate::uncertainty::monte_carlo::MonteCarlo;
pub use crate::uncertainty::residuals::{InputCorrelation, ResidualReport};
pub use crate::uncertainty::selection::TriedModel;
pub use crate::uncertainty::verdict::{Rule, Trust};
pub use interval::{ConfidenceInterval, Correlation, ProfilePoint, TotalInterval};
pub use posterior::{PosteriorDraws, PosteriorQuantile, PosteriorReport};
pub use process_noise::{
    BandReport, ComparedNoiseReport, DisturbanceReport, InnovationReport, NoiseNumberReport,
    OutputErrorEstimate, ProcessNoiseReport,
};
pub use search::SearchReport;
pub use verdict::{Reason, Verdict};

use super::budget::BudgetLine;

/// The result of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct Outcome {
    /// The job that the result belongs to.
    #[schema(example = "job_0198c0de-0000-7000-8000-000000000001")]
    pub job: String,
    /// The model whose parameters were estimated.
    #[schema(example = "single_rod_servo")]
    pub model: String,
    /// Why the search ended: `generation_limit`, `cost_target`, `noise_floor`, `stagnation`,
    /// `time_limit`, `cancelled` or `paused`.
    pub stop_reason: StopReason,
    /// Whether to trust the numbers, and why not.
    pub verdict: Verdict,
    /// The estimated parameters, in the order of the model.
    pub parameters: Vec<ParameterEstimate>,
    /// The estimated initial states, experiment by experiment.
    pub initial_states: Vec<InitialStateEstimate>,
    /// Where experiments start that only validate, fitted to their first samples.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false)]
    pub validation_starts: Vec<ValidationStart>,
    /// How the estimates' errors hang together; `null` where no covariance could be had.
    pub correlation: Option<Correlation>,
    /// Combinations of unknowns that the data do not see, in words; each also lowers the verdict.
    #[serde(default)]
    pub flat_directions: Vec<String>,
    /// Each quantity that was taken as known, its tolerance, and how far the tolerance moves the parameters.
    #[serde(default)]
    pub budget: Vec<BudgetLine>,
    /// How well the simulated outputs follow the measured ones.
    pub fit: Fit,
    /// What the residuals look like, by output.
    pub residuals: BTreeMap<String, ResidualReport>,
    /// The cost at the estimate and the usual information criteria.
    pub criteria: Criteria,
    /// What the search did.
    pub search: SearchReport,
    /// Each of the searches; several where `method.restarts` asks for them.
    #[serde(default)]
    pub searches: Vec<SearchEnd>,
    /// Each start of the refinement and where it ended.
    pub starts: Vec<StartReport>,
    /// How sure it is that the lowest cost is the floor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub floor: Option<FloorReport>,
    /// Which effects the data support, where `model_search` asks for it; `parameters` holds those.
    #[serde(default)]
    pub model_search: Option<ModelSearchReport>,
    /// What moves the plant beside its inputs, where `process_noise` asks for it and the data show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub process_noise: Option<ProcessNoiseReport>,
    /// By parameter and initial state what the free run makes of it, where the estimates are those of a noise
    /// model.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(required = false)]
    pub output_error: BTreeMap<String, OutputErrorEstimate>,
    /// Draws from the posterior distribution, where `uncertainty.intervals` asks for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub posterior: Option<PosteriorDraws>,
    /// What made this result; equal engines make equal bits.
    pub engine: Engine,
}

impl Outcome {
    /// The estimate of a parameter that experiments share, or that only one of them has.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        let mut parameters = self.parameters.iter();
        parameters.find(|parameter| parameter.name == name)
    }
}

/// One estimated parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct ParameterEstimate {
    /// The name in the job, e.g. `mass`.
    #[schema(example = "mass")]
    pub name: String,
    /// The experiment whose own parameter it is, counted from 0 in the order of the job; absent where
    /// experiments share it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub experiment: Option<usize>,
    /// The symbol in the equations.
    #[schema(example = "M")]
    pub symbol: String,
    /// The SI unit of every number below.
    #[schema(example = "kg")]
    pub unit: String,
    /// What is known about its value.
    #[serde(flatten)]
    pub estimate: Estimate,
}

impl ParameterEstimate {
    /// A name that no other parameter of the result has: `mass`, or `load[1]` for the parameter of
    /// the second experiment alone.
    #[must_use]
    pub fn key(&self) -> String {
        match self.experiment {
            None => self.name.clone(),
            Some(experiment) => format!("{}[{experiment}]", self.name),
        }
    }

    /// The name of the parameter in tables, e.g. `mass (M)`; experiments count from 1.
    #[must_use]
    pub fn label(&self) -> String {
        let label = format!("{} ({})", self.name, self.symbol);
        match self.experiment {
            None => label,
            Some(experiment) => format!("{label} in experiment {}", experiment + 1),
        }
    }
}

/// Where a state starts in an experiment that only validates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct ValidationStart {
    /// The experiment, counted from 0 in the order of the job.
    pub experiment: usize,
    /// The state of the model.
    #[schema(example = "velocity")]
    pub state: String,
    /// The SI unit of the value.
    #[schema(example = "m/s")]
    pub unit: String,
    /// The fitted start, SI.
    pub value: f64,
    /// The length of the stretch that the start was fitted to `[s]`; the stretch counts in no score.
    pub fitted_s: f64,
}

/// One estimated initial state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct InitialStateEstimate {
    /// The experiment, counted from 0 in the order of the job.
    pub experiment: usize,
    /// The state of the model.
    #[schema(example = "velocity")]
    pub state: String,
    /// The SI unit of every number below.
    #[schema(example = "m/s")]
    pub unit: String,
    /// What is known about its value.
    #[serde(flatten)]
    pub estimate: Estimate,
}

impl InitialStateEstimate {
    /// A name that no other initial state of the result has: `initial_velocity`, or `initial_velocity_1` in the
    /// second experiment.
    #[must_use]
    pub fn key(&self) -> String {
        name_of_start(&self.state, self.experiment)
    }

    /// The name of the initial state in tables; experiments count from 1.
    #[must_use]
    pub fn label(&self) -> String {
        let number = self.experiment + 1;
        format!("{} at the start of experiment {number}", self.state)
    }
}

/// The name of the start of a state.
pub(super) fn name_of_start(state: &str, experiment: usize) -> String {
    match experiment {
        0 => format!("initial_{state}"),
        later => format!("initial_{state}_{later}"),
    }
}

/// An estimated value and how well it is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Estimate {
    /// The value with the lowest cost.
    #[schema(example = 58.02)]
    pub estimate: f64,
    /// One standard deviation of the estimate's error.
    #[schema(example = 0.31)]
    pub standard_error: Option<f64>,
    /// Why there is no standard error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_error_reason: Option<String>,
    /// The range that holds the true value with the stated probability.
    pub confidence_interval: Option<ConfidenceInterval>,
    /// Why there is no confidence interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence_interval_reason: Option<String>,
    /// The likelihood profile from which the interval is, where `uncertainty.intervals` asks for it:
    /// all other estimates fitted again while this one is held.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profile: Vec<ProfilePoint>,
    /// One standard deviation of the estimate's error with all that was taken as known, and not
    /// of noise alone.
    #[serde(default)]
    #[schema(example = 0.82)]
    pub total_standard_error: Option<f64>,
    /// The range that holds the true value with the stated probability, whatever the truth of
    /// what was taken as known within its tolerances.
    #[serde(default)]
    pub total_interval: Option<TotalInterval>,
    /// The total standard error and interval by drawing, where
    /// `uncertainty.monte_carlo_samples` asks for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub monte_carlo: Option<MonteCarlo>,
    /// What draws from the posterior distribution say of the value, where `uncertainty.intervals` asks for
    /// them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub posterior: Option<PosteriorReport>,
    /// How far the total interval can be relied on.
    #[serde(default)]
    pub trust: Option<Trust>,
    /// How many standard deviations of its prior the estimate is off its middle; absent without
    /// a prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub prior_shift: Option<f64>,
    /// The lower bound of the search.
    #[schema(example = 20.0)]
    pub lower: f64,
    /// The upper bound of the search.
    #[schema(example = 120.0)]
    pub upper: f64,
    /// Whether the estimate lies at a bound: the true value may then be outside.
    pub at_bound: bool,
    /// Whether the data determine it at all.
    pub identifiable: bool,
    /// For each measured output the root mean square of its change when the value grows by 100 %,
    /// linearised at the estimate, SI.
    #[serde(default)]
    #[schema(example = json!({"position": 4.8e-5}))]
    pub output_change: BTreeMap<String, f64>,
}

/// The fit over the data used for estimation, and over the data held back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct Fit {
    /// Over the data that were used, by output.
    pub estimation: BTreeMap<String, OutputFit>,
    /// Over the data that were held back, by output; empty when none were.
    pub validation: BTreeMap<String, OutputFit>,
}

/// Which of the effects that were left open the data support.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct ModelSearchReport {
    /// The effects of the model with the lowest criterion.
    #[schema(example = json!(["coulomb_friction", "dead_band"]))]
    pub supported: Vec<String>,
    /// The data that the models were compared by: `validation`, or `estimation` where none were
    /// held back.
    #[schema(example = "validation")]
    pub compared_on: String,
    /// Every model that was fitted, the best first.
    pub tried: Vec<TriedModel>,
}

/// What made a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct Engine {
    /// The seed of every random number.
    pub seed: u64,
    /// The version of greybox.
    pub version: String,
    /// The digest of the completed specification.
    #[schema(example = "sha256:9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08")]
    pub spec_digest: String,
    /// The digests of the recordings, in the order of the experiments.
    pub dataset_digests: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_stands_beside_its_name_as_the_contract_shows_it() {
        let parameter = ParameterEstimate {
            experiment: None,
            name: "mass".into(),
            symbol: "M".into(),
            unit: "kg".into(),
            estimate: Estimate {
                estimate: 58.02,
                standard_error: None,
                standard_error_reason: Some("the job was cancelled".into()),
                confidence_interval: Some(ConfidenceInterval {
                    level: 0.95,
                    lower: Some(57.4),
                    upper: None,
                    method: "fisher".into(),
                }),
                confidence_interval_reason: None,
                total_standard_error: Some(0.82),
                total_interval: Some(TotalInterval {
                    level: 0.95,
                    lower: Some(56.4),
                    upper: None,
                }),
                profile: Vec::new(),
                monte_carlo: None,
                posterior: None,
                trust: Some(Trust::High),
                prior_shift: None,
                lower: 20.0,
                upper: 120.0,
                at_bound: false,
                identifiable: true,
                output_change: BTreeMap::from([("position".into(), 4.8e-5)]),
            },
        };
        let json = serde_json::to_value(&parameter).unwrap();
        assert_eq!(
            json,
            serde_json::json!({
                "name": "mass", "symbol": "M", "unit": "kg", "estimate": 58.02,
                "standard_error": null, "standard_error_reason": "the job was cancelled",
                "confidence_interval":
                    {"level": 0.95, "lower": 57.4, "upper": null, "method": "fisher"},
                "total_standard_error": 0.82,
                "total_interval": {"level": 0.95, "lower": 56.4, "upper": null},
                "trust": "high",
                "lower": 20.0, "upper": 120.0, "at_bound": false, "identifiable": true,
                "output_change": {"position": 4.8e-5}
            })
        );
        let back: ParameterEstimate = serde_json::from_value(json).unwrap();
        assert_eq!(back, parameter);
    }
}
