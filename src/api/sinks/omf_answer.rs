//! Answers to messages of the Open Message Format, in the form of PI Web API.

use axum::http::StatusCode;
use serde::Serialize;
use utoipa::ToSchema;
use uuid::Uuid;

/// The outcome of a request.
#[derive(Serialize, ToSchema)]
#[serde(rename_all = "PascalCase")]
pub struct OmfAnswer {
    /// A number that no other answer has.
    #[schema(example = "019432f0-3c6a-7c2e-9d6e-0f6c8f1f2a10")]
    operation_id: String,
    /// The outcome of the messages: one entry for all of them.
    #[schema(min_items = 1, max_items = 1)]
    messages: Vec<OmfMessageAnswer>,
}

/// The outcome of messages.
#[derive(Serialize, ToSchema)]
#[serde(rename_all = "PascalCase")]
pub struct OmfMessageAnswer {
    /// `null`: the entry is of all messages of the request.
    #[schema(value_type = Option<u64>)]
    message_index: Option<u64>,
    /// Sentences on the messages.
    events: Vec<OmfEvent>,
    /// The status of the answer.
    status: OmfStatus,
}

/// A sentence on messages.
#[derive(Serialize, ToSchema)]
#[serde(rename_all = "PascalCase")]
pub struct OmfEvent {
    /// The sentence and how grave its matter is.
    event: OmfSentence,
}

/// A sentence and how grave its matter is.
#[derive(Serialize, ToSchema)]
#[serde(rename_all = "PascalCase")]
pub struct OmfSentence {
    /// The sentence.
    #[schema(example = "container \"Tank-3\": it is not defined here")]
    message: String,
    /// `Information` or `Error`.
    #[schema(value_type = String, example = "Error")]
    severity: &'static str,
}

/// The status of an answer.
#[derive(Serialize, ToSchema)]
#[serde(rename_all = "PascalCase")]
pub struct OmfStatus {
    /// The status of HTTP.
    #[schema(example = 200)]
    code: u16,
    /// `Information` or `Error`.
    #[schema(value_type = String, example = "Information")]
    highest_severity: &'static str,
}

impl OmfAnswer {
    /// All was taken, on which there may be something to say.
    pub(super) fn success(remarks: Vec<String>) -> Self {
        Self::new(StatusCode::OK, "Information", remarks)
    }

    /// Something was not taken: a sentence in each line.
    pub(super) fn refusal(status: StatusCode, sentences: String) -> Self {
        let sentences = sentences.lines().map(str::to_owned);
        Self::new(status, "Error", sentences.collect())
    }

    fn new(status: StatusCode, severity: &'static str, sentences: Vec<String>) -> Self {
        let events = sentences.into_iter().map(|message| OmfEvent {
            event: OmfSentence { message, severity },
        });
        Self {
            operation_id: Uuid::now_v7().to_string(),
            messages: vec![OmfMessageAnswer {
                message_index: None,
                events: events.collect(),
                status: OmfStatus {
                    code: status.as_u16(),
                    highest_severity: severity,
                },
            }],
        }
    }
}
