//! Which stream and signal a series of an agent belongs to, as the operator of the server says.

use crate::Interpolation;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Rules that give series their streams and signals. The first rule decides that fits a line and names its field.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"rules": [{
    "measurement": "rig", "tags": {"hall": "2"}, "stream": "rig-4",
    "signals": {"position": {"signal": "position", "unit": "mm"}}
}]}))]
pub struct Mapping {
    /// The rules, 1000 at the most. Where several fit, the first decides.
    #[schema(max_items = 1000)]
    pub rules: Vec<MappingRule>,
}

/// Gives the fields of some lines their stream and signals.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MappingRule {
    /// The measurement of the lines.
    #[schema(example = "rig")]
    pub measurement: String,
    /// Tags that the lines have; lines may have others too.
    #[serde(default)]
    #[schema(required = false, example = json!({"hall": "2"}))]
    pub tags: BTreeMap<String, String>,
    /// The stream that the samples go to.
    #[schema(example = "rig-4", pattern = "^[A-Za-z0-9._-]{1,100}$")]
    pub stream: String,
    /// The signals, by the fields of the lines. Fields that are not named here are not of this rule.
    #[schema(example = json!({"position": {"signal": "position", "unit": "mm"}}))]
    pub signals: BTreeMap<String, MappedSignal>,
    /// How the lines say that a value is good; left out, all values are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub quality: Option<MappedQuality>,
}

/// Which fields of a line say how good its other fields are.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MappedQuality {
    /// The fields; the worst of them counts. For OMF they are the properties with `isquality` where they are left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false, max_items = 10, example = json!(["Quality"]))]
    pub fields: Vec<String>,
    /// What the codes mean: `opc_da`, `opc_ua`, `aveva_quality`, `aveva_quality_detail`, `ignition`,
    /// `ignition_legacy`, `cognite`, `is_good` or `words`; words such as `Good` mean the same in all of them, and left out, only words
    /// are read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false, example = "opc_ua")]
    pub codes: Option<String>,
}

/// The signal that a field belongs to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MappedSignal {
    /// The name of the signal in the stream.
    #[schema(example = "position")]
    pub signal: String,
    /// The unit of the field's values. Where it is left out, it is what an OMF container declares, and else SI.
    #[serde(default)]
    #[schema(required = false, example = "mm")]
    pub unit: String,
    /// How the signal goes on between samples. Left out, it is what an OMF container declares, and else the stream
    /// decides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub interpolation: Option<Interpolation>,
}
