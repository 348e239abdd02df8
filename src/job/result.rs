//! What a job came to, as the method computed it.

use serde::Serialize;
use utoipa::ToSchema;

#[cfg(test)]
use greybox::estimation::StopReason;
use greybox::identification::Outcome;
use greybox::identification::design::Design;
use greybox::identification::selection::Selection;

/// The result of a job.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
#[serde(untagged)]
pub enum ResultOfJob {
    /// The result of an identification.
    Identification(Box<Outcome>),
    /// The result of a design.
    Design(Box<Design>),
    /// The result of a selection.
    Selection(Box<Selection>),
}

#[cfg(test)]
impl ResultOfJob {
    /// The result of an identification that estimated one parameter.
    pub(crate) fn sample(stop_reason: StopReason, name: &str, estimate: f64) -> ResultOfJob {
        let document = serde_json::json!({
            "job": "job_0198c0de-0000-7000-8000-000000000001",
            "model": "positioning_drive",
            "stop_reason": stop_reason,
            "verdict": {"trust": "high", "reasons": []},
            "parameters": [{
                "name": name, "symbol": "x", "unit": "1", "estimate": estimate,
                "standard_error": null, "confidence_interval": null,
                "lower": 0.0, "upper": 100.0, "at_bound": false, "identifiable": true,
            }],
            "initial_states": [],
            "correlation": null,
            "fit": {"estimation": {}, "validation": {}},
            "residuals": {},
            "criteria": {"cost": 1.0, "aic": null, "aicc": null, "bic": null, "fpe": null},
            "search": {
                "generations": 1, "evaluations": 1, "distinct_evaluations": 1,
                "failed_evaluations": {}, "best_credit": null, "best_generation": null,
            },
            "starts": [],
            "engine": {"seed": 1, "version": "0", "spec_digest": "", "dataset_digests": []},
        });
        let outcome = serde_json::from_value(document).expect("a result");
        ResultOfJob::Identification(Box::new(outcome))
    }
}
