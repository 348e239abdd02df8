//! What is shown of a monitor: its windows and its alarms.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::detector::DetectorName;
use greybox::identification::outcome::{ConfidenceInterval, Outcome, TotalInterval, Trust};
use greybox::identification::{DatasetId, JobId};

/// A window of a stream, and what was estimated from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MonitorWindow {
    /// Counts from 0; a gap in the data leaves numbers out.
    pub number: i64,
    /// The first instant of the window.
    #[schema(value_type = String, format = DateTime)]
    pub from: Timestamp,
    /// The instant at which the window ends, which belongs to the next window.
    #[schema(value_type = String, format = DateTime)]
    pub to: Timestamp,
    /// What became of the window.
    pub status: WindowStatus,
    /// Why nothing was estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub reason: Option<String>,
    /// Where the search of the window began.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub start: Option<Start>,
    /// How far the estimate can be trusted.
    #[serde(default)]
    pub trust: Option<Trust>,
    /// What speaks against the estimate, for programs.
    #[serde(default)]
    pub doubts: Vec<String>,
    /// The estimates.
    #[serde(default)]
    pub parameters: Vec<WatchedEstimate>,
}

/// What became of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WindowStatus {
    /// The job of the window has not ended.
    Running,
    /// The parameters of the window were estimated.
    Estimated,
    /// The window says nothing of the parameters: nothing was estimated.
    Quiet,
    /// The stream has no samples in the window.
    NoData,
    /// The job of the window came to no estimate.
    Failed,
}

impl WindowStatus {
    /// The name of the status.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Estimated => "estimated",
            Self::Quiet => "quiet",
            Self::NoData => "no_data",
            Self::Failed => "failed",
        }
    }
}

/// Where a search began.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// As the job says: nothing of the windows before was used.
    Cold,
    /// At the estimate of the window before, with it as a prior.
    Warm,
}

/// A parameter in a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WatchedEstimate {
    /// The name of the parameter.
    #[schema(example = "bulk_modulus")]
    pub name: String,
    /// The SI unit of every number below.
    #[schema(example = "Pa")]
    pub unit: String,
    /// The estimated value of the parameter.
    pub estimate: f64,
    /// One standard deviation of the error of the estimate.
    pub standard_error: Option<f64>,
    /// The range that holds the true value with the stated probability.
    pub confidence_interval: Option<ConfidenceInterval>,
    /// One standard deviation with all that was taken as known.
    pub total_standard_error: Option<f64>,
    /// The range with all that was taken as known.
    pub total_interval: Option<TotalInterval>,
    /// How far the parameter can be trusted; absent where that was not judged for it alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub trust: Option<Trust>,
}

impl WatchedEstimate {
    /// The parameters of a result that its one experiment shares with no other.
    #[must_use]
    pub fn all(outcome: &Outcome) -> Vec<Self> {
        let shared = outcome.parameters.iter();
        let shared = shared.filter(|parameter| parameter.experiment.is_none());
        shared
            .map(|parameter| Self {
                name: parameter.name.clone(),
                unit: parameter.unit.clone(),
                estimate: parameter.estimate.estimate,
                standard_error: parameter.estimate.standard_error,
                confidence_interval: parameter.estimate.confidence_interval.clone(),
                total_standard_error: parameter.estimate.total_standard_error,
                total_interval: parameter.estimate.total_interval,
                trust: parameter.estimate.trust,
            })
            .collect()
    }
}

/// What somebody should look at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Alarm {
    /// Counts from 1.
    #[serde(default)]
    pub id: i64,
    /// What kind of alarm.
    pub kind: AlarmKind,
    /// The time at which the alarm was raised.
    #[schema(value_type = String, format = DateTime)]
    pub raised_at: Timestamp,
    /// The window that raised it; absent where data stopped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub window: Option<i64>,
    /// What has changed, where a parameter has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub change: Option<ParameterChange>,
    /// The alarm in words, for people, with the numbers in them.
    pub detail: String,
}

/// A kind of alarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AlarmKind {
    /// A parameter has changed by more than its intervals allow.
    Change,
    /// Estimates can be trusted less than before, in so many windows in a row that chance is no reason.
    TrustFell,
    /// Windows no longer come to an estimate.
    NoEstimate,
    /// No data came for too long.
    DataStopped,
}

/// A parameter that has changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ParameterChange {
    /// The name of the parameter.
    #[schema(example = "bulk_modulus")]
    pub parameter: String,
    /// The SI unit of the values.
    #[schema(example = "Pa")]
    pub unit: String,
    /// The detector that found the change.
    pub detector: DetectorName,
    /// The value that the statistic of the detector reached.
    pub statistic: f64,
    /// The threshold that the statistic exceeded.
    pub threshold: f64,
    /// The first window that most likely has the new value.
    pub since_window: i64,
    /// When the window `since_window` begins.
    #[schema(value_type = String, format = DateTime)]
    pub since: Timestamp,
    /// The mean of the windows before the change.
    pub before: f64,
    /// One standard deviation of the error of `before`, of what windows do not share.
    pub before_standard_error: f64,
    /// The mean of the windows since the change.
    pub after: f64,
    /// One standard deviation of the error of `after`, of what windows do not share.
    pub after_standard_error: f64,
}

/// What a step says of a window beside what is stored with it.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ShownWindow {
    /// The window.
    #[serde(flatten)]
    pub window: MonitorWindow,
    /// The job that worked it, where one did and is still kept.
    pub job: Option<JobId>,
    /// The recording of the window, where it is still kept.
    pub dataset: Option<DatasetId>,
}
