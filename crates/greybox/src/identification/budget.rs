//! The uncertainty budget of a result: what was taken as known, and what that does to it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One number that was taken as known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct BudgetLine {
    /// The parameter, the state whose start is given, a number of a sensor such as `position.gain` or of an
    /// input such as `pump.input_gain`, a loss such as `level.quadratic_loss`, or `clock`.
    #[schema(example = "supply_pressure")]
    pub assumption: String,
    /// What kind of assumption.
    pub kind: AssumptionKind,
    /// The declared value, SI.
    #[schema(example = 7e6)]
    pub value: f64,
    /// The value that the estimate was made with, SI: where the data and the tolerances together
    /// put it. Absent where it is the declared one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false, example = 7.01e6)]
    pub taken: Option<f64>,
    /// One standard deviation of what is not known of it, SI: of an effect that is left out, its
    /// plausible size.
    #[schema(example = 7e4)]
    pub tolerance: f64,
    /// Whether nobody declared the tolerance: `tolerances` of the job says otherwise by name. Absent where
    /// somebody did.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schema(required = false)]
    pub by_default: bool,
    /// The SI unit of all numbers of the assumption.
    #[schema(example = "Pa")]
    pub unit: String,
    /// How many standard deviations of noise the residuals pull at the declared value: beyond 4 they
    /// ask for another one, and contradict it where that lies beyond the tolerances. `null` where
    /// they cannot tell it from the unknowns, and before anything is estimated.
    #[schema(example = -0.8)]
    pub score: Option<f64>,
    /// The value that the data alone would give it, with all other assumptions as they were taken.
    pub suggested: Option<Suggested>,
    /// Where the data and all tolerances together put it, and how well they know it; absent before
    /// anything is estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub posterior: Option<Suggested>,
    /// By how much it could be wrong without residuals that show it, SI; `null` where by anything.
    #[schema(example = 1.2e4)]
    pub unnoticed_up_to: Option<f64>,
    /// By estimated parameter, what it contributes to the total standard error; empty where the
    /// data do not fix the parameters.
    pub contributions: BTreeMap<String, BudgetContribution>,
}

/// The kinds of assumptions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AssumptionKind {
    /// A value that is known within a tolerance.
    Tolerance,
    /// An effect of the model that is left out.
    AbsentEffect,
    /// The gain, the offset or the lag of an output's sensor.
    Sensor,
    /// The gain or the offset of an input.
    Input,
    /// The clock that samples are taken by.
    Clock,
}

/// A value that the data give to what was taken as known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct Suggested {
    /// The value, SI.
    #[schema(example = 7.02e6)]
    pub value: f64,
    /// The standard error of the value, SI.
    #[schema(example = 3e3)]
    pub standard_error: f64,
}

/// What an assumption contributes to the total standard error of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct BudgetContribution {
    /// The standard deviation that the assumption itself contributes, in the parameter's unit.
    #[schema(example = 0.6)]
    pub standard_error: f64,
    /// The assumption's share of the square of the total standard error; below zero where it makes
    /// up for another assumption.
    #[schema(example = 0.41)]
    pub share: f64,
    /// What the total standard error would be, were the tolerance five times smaller.
    #[schema(example = 0.4)]
    pub total_if_better: f64,
}
