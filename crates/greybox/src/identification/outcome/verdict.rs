//! How far a result can be trusted, why not further, and what to do next.

use super::{NextStep, Rule, Trust};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How far a result can be trusted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct Verdict {
    /// The grade.
    pub trust: Trust,
    /// The verdict in one sentence: which parameters can be trusted how far.
    #[serde(default)]
    pub summary: String,
    /// What speaks against the result, the gravest first; empty when nothing does.
    pub reasons: Vec<Reason>,
}

/// One thing that speaks against a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct Reason {
    /// What kind of doubt, for programs; `GET /v1/verdict-rules` explains each.
    #[schema(example = "residuals_not_white")]
    pub code: Rule,
    /// What the doubt is and what to do next, for people, with the numbers in it.
    pub detail: String,
    /// The parameters and initial states that the doubt concerns; absent where it concerns all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub concerns: Option<Vec<String>>,
    /// What may be done about the doubt, the most promising first: changes to the specification of
    /// the job; empty where none would help, and in results of earlier versions.
    #[serde(default)]
    pub next: Vec<NextStep>,
}
