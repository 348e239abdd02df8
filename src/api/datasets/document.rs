//! A recording in this service's own JSON, as it is described.

use std::collections::BTreeMap;

use jiff::Timestamp;
use utoipa::ToSchema;

/// A recording as JSON: uniform with `sample_time_s`, or with the instants in `time`.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "name": "rig 4, run 3",
    "sample_time_s": 0.01,
    "start": "2026-03-02T08:15:00Z",
    "signals": {"reference": {"unit": "m", "values": [0.03, 0.03]},
                "position": {"unit": "mm", "values": [0.0, 1.2]}}
}))]
pub struct RecordingDocument {
    /// A name for people.
    pub name: Option<String>,
    /// The time between two samples `[s]`, where they are uniform.
    #[schema(exclusive_minimum = 0)]
    pub sample_time_s: Option<f64>,
    /// The instants of the samples, where they are not.
    pub time: Option<RecordedSignal>,
    /// When the first sample was taken.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub start: Option<Timestamp>,
    /// The signals by name, all of the same length.
    pub signals: BTreeMap<String, RecordedSignal>,
}

/// The samples of one signal.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordedSignal {
    /// The unit, e.g. `mm`; SI is assumed when absent.
    #[schema(example = "mm")]
    pub unit: Option<String>,
    /// The samples; `null` is a missing one.
    pub values: Vec<Option<f64>>,
}

/// The bytes of a file: a workbook of Excel or Apache Parquet.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[allow(dead_code, reason = "it describes a body that is read as it comes")]
pub struct FileBytes(Vec<u8>);
