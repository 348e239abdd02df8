//! What a running job may be asked to do, as the database keeps it.

use super::{StoreError, corrupt};
use crate::job::Status;

/// What a running job is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopRequest {
    /// End, and keep the best estimate so far.
    Cancel,
    /// Hold, and keep the best estimate so far.
    Pause,
}

impl StopRequest {
    pub(super) fn as_str(self) -> &'static str {
        match self {
            StopRequest::Cancel => "cancel",
            StopRequest::Pause => "pause",
        }
    }

    /// The state that the request leads to.
    pub fn leads_to(self) -> Status {
        match self {
            StopRequest::Cancel => Status::Cancelled,
            StopRequest::Pause => Status::Paused,
        }
    }

    pub(super) fn read(word: &str, of: &str) -> Result<Self, StoreError> {
        [StopRequest::Cancel, StopRequest::Pause]
            .into_iter()
            .find(|request| request.as_str() == word)
            .ok_or_else(|| corrupt("request", of, format!("`{word}` is no request")))
    }
}
