//! Why samples do not come from a source to its stream.

use std::time::Duration;

use crate::outbound::OutboundError;

/// Why a pass over a series ended early. The cursor stands where the last page that was stored has its end.
#[derive(Debug, thiserror::Error)]
pub enum CollectError {
    /// The source is not reached.
    #[error("the source is not reached: {0}")]
    SourceAway(String),
    /// The source answers something else than samples.
    #[error("the source refuses: {0}")]
    SourceRefuses(String),
    /// The server is not reached, or has too much to do; perhaps it says when it may be asked again.
    #[error("the server does not take samples now: {why}")]
    ServerAway {
        /// Why.
        why: String,
        /// When the server may be asked again, at the earliest.
        after: Option<Duration>,
    },
    /// The server takes no page of this size.
    #[error("the server takes no page of this size, though it has few rows")]
    PageTooLarge,
    /// The server refuses a page for what is in it, or the token.
    #[error("the server refuses the samples: {0}")]
    ServerRefuses(String),
    /// The file with the cursors cannot be used.
    #[error("the file of cursors cannot be used: {0}")]
    Cursors(#[from] sqlx::Error),
}

impl CollectError {
    /// Whether the source or the server refuses what it was asked, which concerns one series alone.
    pub(super) fn is_refusal(&self) -> bool {
        self.is_for_good() || matches!(self, Self::SourceRefuses(_))
    }

    /// Whether the server refuses what it was sent, so that the same is refused again.
    pub(super) fn is_for_good(&self) -> bool {
        matches!(self, Self::PageTooLarge | Self::ServerRefuses(_))
    }

    /// The refusal with the name of the file that is refused.
    pub(super) fn of_file(self, file: &str) -> Self {
        match self {
            Self::SourceRefuses(why) => Self::SourceRefuses(format!("{file}: {why}")),
            refusal => Self::ServerRefuses(format!("{file}: {refusal}")),
        }
    }

    /// The failure of a request to a source.
    pub(super) fn away(error: &OutboundError) -> Self {
        Self::SourceAway(error.to_string())
    }
}
