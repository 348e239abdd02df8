//! Why a job failed, in the shape of a problem (RFC 9457).

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use greybox::parsing::Fault;

/// Why a job failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Failure {
    /// Names the kind of failure.
    #[serde(rename = "type")]
    pub kind: Cow<'static, str>,
    /// The kind in words.
    pub title: Cow<'static, str>,
    /// 422 where the job itself is at fault, 500 where the program is, 503 where what is stored is damaged.
    pub status: u16,
    /// What happened.
    pub detail: String,
    /// What is wrong with the job, place by place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<Fault>,
}

impl Failure {
    /// The method panicked.
    pub fn panicked(message: &str) -> Self {
        Self {
            kind: "/problems/estimation-panicked".into(),
            title: "The estimation broke off".into(),
            status: 500,
            detail: format!("the method panicked: {message}"),
            errors: Vec::new(),
        }
    }

    /// The job took its server down, again and again.
    pub fn crashed_too_often(times: u32) -> Self {
        Self {
            kind: "/problems/crashed-too-often".into(),
            title: "The server went down with this job".into(),
            status: 500,
            detail: format!(
                "the server went down {times} times in a row while it worked this job, and not \
                 once without it"
            ),
            errors: Vec::new(),
        }
    }

    /// The run came to its end without any candidate that could be simulated.
    pub fn no_estimate() -> Self {
        Self {
            kind: "/problems/no-estimate".into(),
            title: "There is no estimate".into(),
            status: 422,
            detail: "no candidate could be simulated over the recordings: the search ranges or \
                     the fixed values are far from the plant"
                .to_owned(),
            errors: Vec::new(),
        }
    }

    /// The data do not see a change of the unknowns, and the job's settings refuse it then.
    pub fn not_identifiable(errors: Vec<Fault>) -> Self {
        Self {
            kind: "/problems/not-identifiable".into(),
            title: "The data do not fix the unknowns".into(),
            status: 422,
            detail: "the unknowns can change along what the errors name and the outputs stay as \
                     they are, so no estimate of them would mean anything: do what the errors \
                     say, or ask for `uncertainty.flat_directions: report` to estimate all the \
                     same"
                .to_owned(),
            errors,
        }
    }

    /// What is stored of the job, or what it is worked from, is not what was written.
    pub fn damaged_data(what: &dyn std::error::Error) -> Self {
        Self {
            kind: "/problems/damaged-data".into(),
            title: "What is stored is damaged".into(),
            status: 503,
            detail: format!(
                "{what}; bring back what is damaged, from where it came or from a backup, and submit the \
                 job again"
            ),
            errors: Vec::new(),
        }
    }

    /// The stored job, its recordings or its checkpoint cannot be worked.
    pub fn cannot_run(detail: String, errors: Vec<Fault>) -> Self {
        Self {
            kind: "/problems/cannot-run".into(),
            title: "The job cannot be worked".into(),
            status: 422,
            detail,
            errors,
        }
    }
}
