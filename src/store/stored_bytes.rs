//! How much is kept, by what it is.

use std::fmt;

/// What is kept of a project, or of all of them, in bytes of texts and numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, sqlx::FromRow)]
pub struct StoredBytes {
    /// The samples of recordings and streams.
    #[sqlx(try_from = "i64")]
    pub samples: u64,
    /// The specifications, events, histories, candidates and results of jobs.
    #[sqlx(try_from = "i64")]
    pub jobs: u64,
    /// Idempotency keys, with the answers to batches.
    #[sqlx(try_from = "i64")]
    pub keys: u64,
}

impl StoredBytes {
    /// All together.
    pub(super) fn total(self) -> u64 {
        self.samples + self.jobs + self.keys
    }
}

impl fmt::Display for StoredBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            samples,
            jobs,
            keys,
        } = self;
        write!(
            f,
            "{samples} bytes of recordings and streams, {jobs} of jobs with their histories, candidates and \
             results, and {keys} of idempotency keys"
        )
    }
}
