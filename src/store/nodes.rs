//! The servers that work with the database, the nodes: their lives, and what becomes of the jobs of one
//! that was cut off.
//!
//! Each start of a server is a life with a number. A file has one server, so whoever opens it takes over
//! from all lives before. A PostgreSQL has many: each says again and again that it is there (see `beat`),
//! and one that no longer does is declared dead by another. From then on it writes nothing more: each
//! transaction asks whether its node lives, and all transactions that write, of all nodes, come one after
//! the other.
//!
//! A job that takes its server down must not do so for ever, and a job whose server was taken down
//! by something else must not be blamed. A life that is cut off speaks against the jobs that were at
//! work in it and for those that were not: a server that goes down without a job is not taken down by
//! it. A job that one life after another ends with waits a little longer each time, alone among its
//! like, so that there are lives without it; what fails in the end is a job that the server always
//! went down with and never without.
//!
//! A slice that the database refused leaves no trace: the life goes on, so nothing was cut off.

mod beat;
mod lives;
mod watch;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::opening::Shared;
use super::shared_database::Database;
use super::writer::in_transaction;
use super::{OnChange, StoreError};
use beat::Beats;
pub(super) use lives::begin;

/// From so many lives that ended with it a job waits before it is worked again.
pub(super) const SUSPECT_FROM: u32 = 3;
/// The longest wait.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// How long the server has to have been up before it works a job again that so many lives in a row
/// ended with: nothing for the first few, then a second, two, four …
pub(super) fn wait_after(deaths: u32) -> Duration {
    match deaths.checked_sub(SUSPECT_FROM) {
        None => Duration::ZERO,
        Some(doublings) => Duration::from_secs(1 << doublings.min(16)).min(LONGEST_WAIT),
    }
}

/// This server among those of its database.
#[derive(Clone)]
pub struct Nodes {
    database: Arc<Database>,
    /// Whether this node does what one node does for all; the task of the beats sets it.
    in_charge: Arc<AtomicBool>,
    /// Which node this one is of those that live, and how many they are; the task of the beats sets it.
    place: Arc<Mutex<Option<(u32, u32)>>>,
    /// Cancelled by the task of the beats when others have declared this node dead.
    lost: CancellationToken,
    /// Ends the task of the beats.
    closing: CancellationToken,
    beats: Arc<Mutex<Option<JoinHandle<()>>>>,
}

impl Nodes {
    /// A server that is alone, until `closing`.
    pub(super) fn new(database: Arc<Database>, closing: CancellationToken) -> Self {
        Self {
            database,
            in_charge: Arc::new(AtomicBool::new(true)),
            place: Arc::default(),
            lost: CancellationToken::new(),
            closing,
            beats: Arc::default(),
        }
    }

    /// Says that it is there, among others, until it is closed.
    pub(super) fn live_among_others(&self, shared: Shared, on_change: OnChange) {
        self.in_charge.store(false, Ordering::Relaxed);
        let beats = Beats {
            database: self.database.clone(),
            shared,
            on_change,
            in_charge: self.in_charge.clone(),
            place: self.place.clone(),
            lost: self.lost.clone(),
        };
        let task = tokio::spawn(beats.run(self.closing.clone()));
        *self.beats.lock().unwrap_or_else(PoisonError::into_inner) = Some(task);
    }

    /// Whether this server does what one does for all that work with the database: of those that live
    /// it has done so for the longest.
    pub fn is_in_charge(&self) -> bool {
        self.in_charge.load(Ordering::Relaxed)
    }

    /// Which share of what nodes do together this one begins with, and of how many; nothing where it is
    /// alone.
    pub fn share(&self) -> Option<(u32, u32)> {
        *self.place.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns when others have declared this server dead: it can do nothing more.
    pub async fn superseded(&self) {
        self.lost.cancelled().await;
    }

    /// Notes that the server ends in order.
    pub(super) async fn end_life(&self) -> Result<(), StoreError> {
        let life = self.database.life;
        in_transaction!(self.database, |tx| lives::end(tx, life)).await
    }

    /// Says no more that it is there.
    pub(super) async fn close(&self) {
        self.closing.cancel();
        let beats = self
            .beats
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(beats) = beats
            && let Err(error) = beats.await
        {
            tracing::error!(%error, "the task that says that this node lives ended badly");
        }
    }

    /// Declares all other nodes dead, as one that observes them does in time.
    #[cfg(test)]
    pub(super) async fn take_over_from_all_others(&self) -> Result<(), StoreError> {
        let others: Vec<(i64, i64)> = super::database::query_as(
            "select life, beat from nodes where state = 'live' and life <> $1",
        )
        .bind(self.database.life)
        .fetch_all(&self.database.readers)
        .await?;
        for (life, beat) in others {
            in_transaction!(self.database, |tx| lives::take_over(tx, life, beat)).await?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_waits_longer_with_each_life_that_ends_with_it() {
        let waits: Vec<u64> = (0..12).map(|deaths| wait_after(deaths).as_secs()).collect();
        assert_eq!(waits, [0, 0, 0, 1, 2, 4, 8, 16, 32, 60, 60, 60]);
    }
}
