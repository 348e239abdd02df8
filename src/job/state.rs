//! The life of a job: the states it can be in and the only ways from one to another.
//!
//! ```text
//!            ┌────────────── resume ──────────────┐
//!            ▼                                    │
//!         queued ──start──▶ running ──pause──▶ paused
//!            │                │  │                │
//!            │                │  └─succeed─▶ succeeded
//!            ├──fail──────────┼───────────▶ failed
//!            └──cancel────────┴─────┬──────▶ cancelled ◀── cancel (from paused)
//! ```
//! A queued job can be paused too. A job that waits for its next slice is still `running`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Where a job is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Accepted and waiting for its first slice, or resumed and waiting for its next.
    Queued,
    /// At work, in slices.
    Running,
    /// Held by request; keeps its best estimate and can be resumed.
    Paused,
    /// Done, with a result.
    Succeeded,
    /// Ended by a problem that the job shows in `error`.
    Failed,
    /// Ended by request; keeps the best estimate so far.
    Cancelled,
}

/// A change of state that the life of a job does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a {from} job cannot become {to}")]
pub struct IllegalTransition {
    /// The state the job is in.
    pub from: Status,
    /// The state that was asked for.
    pub to: Status,
}

impl Status {
    /// All states, in the order of a life.
    pub const ALL: [Status; 6] = [
        Status::Queued,
        Status::Running,
        Status::Paused,
        Status::Succeeded,
        Status::Failed,
        Status::Cancelled,
    ];

    /// The word for this state in JSON, SQL and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Status::Queued => "queued",
            Status::Running => "running",
            Status::Paused => "paused",
            Status::Succeeded => "succeeded",
            Status::Failed => "failed",
            Status::Cancelled => "cancelled",
        }
    }

    /// Whether nothing can follow.
    pub fn is_terminal(self) -> bool {
        matches!(self, Status::Succeeded | Status::Failed | Status::Cancelled)
    }

    /// The requests that the life of a job allows in this state.
    pub fn actions(self) -> impl Iterator<Item = &'static str> {
        let requests = [
            ("pause", Status::Paused),
            ("resume", Status::Queued),
            ("cancel", Status::Cancelled),
        ];
        let legal = requests
            .into_iter()
            .filter(move |(_, to)| self.advance_to(*to).is_ok());
        legal.map(|(action, _)| action)
    }

    /// The state after this one, if the life of a job allows it.
    pub fn advance_to(self, to: Status) -> Result<Status, IllegalTransition> {
        use Status::{Cancelled, Failed, Paused, Queued, Running, Succeeded};
        let legal = matches!(
            (self, to),
            (Queued, Running | Paused | Failed | Cancelled)
                | (Running, Paused | Succeeded | Failed | Cancelled)
                | (Paused, Queued | Cancelled)
        );
        if legal {
            Ok(to)
        } else {
            Err(IllegalTransition { from: self, to })
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A word that names no state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not one of queued, running, paused, succeeded, failed, cancelled")]
pub struct UnknownStatus(pub String);

impl FromStr for Status {
    type Err = UnknownStatus;

    fn from_str(word: &str) -> Result<Self, UnknownStatus> {
        Status::ALL
            .into_iter()
            .find(|status| status.as_str() == word)
            .ok_or_else(|| UnknownStatus(word.chars().take(40).collect()))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_word_reads_back_to_its_state() {
        for status in Status::ALL {
            assert_eq!(status.as_str().parse(), Ok(status));
            let json = serde_json::to_value(status).expect("a status is JSON");
            assert_eq!(json, status.as_str());
        }
    }

    #[test]
    fn nothing_follows_a_terminal_state() {
        for from in Status::ALL.into_iter().filter(|s| s.is_terminal()) {
            for to in Status::ALL {
                assert_eq!(from.advance_to(to), Err(IllegalTransition { from, to }));
            }
        }
    }

    #[test]
    fn every_state_leads_to_an_end() {
        for from in Status::ALL.into_iter().filter(|s| !s.is_terminal()) {
            assert_eq!(from.advance_to(Status::Cancelled), Ok(Status::Cancelled));
        }
    }

    #[test]
    fn only_a_running_job_succeeds() {
        let able: Vec<Status> = Status::ALL
            .into_iter()
            .filter(|s| s.advance_to(Status::Succeeded).is_ok())
            .collect();
        assert_eq!(able, [Status::Running]);
    }

    #[test]
    fn a_job_offers_what_its_state_allows() {
        let actions = |status: Status| status.actions().collect::<Vec<_>>();
        assert_eq!(actions(Status::Queued), ["pause", "cancel"]);
        assert_eq!(actions(Status::Running), ["pause", "cancel"]);
        assert_eq!(actions(Status::Paused), ["resume", "cancel"]);
        assert!(actions(Status::Failed).is_empty());
    }

    proptest! {
        #[test]
        fn any_walk_of_legal_steps_ends_at_most_once(
            walk in proptest::collection::vec(0_usize..Status::ALL.len(), 0..50)
        ) {
            let mut status = Status::Queued;
            let mut ends = 0;
            for step in walk {
                if let Ok(next) = status.advance_to(Status::ALL[step]) {
                    prop_assert_ne!(next, status);
                    status = next;
                    ends += usize::from(next.is_terminal());
                }
            }
            prop_assert!(ends <= 1);
            prop_assert_eq!(ends == 1, status.is_terminal());
        }
    }
}
