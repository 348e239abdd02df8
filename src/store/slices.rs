//! The worker's side: a slice begins, records what it did, and hands the job on or ends it (see
//! `endings`).
//!
//! `jobs.epoch` fences: the transaction that begins a slice raises it, and a write with an older
//! one changes no row and says [`Hold::Lost`], which ends that worker's slice.

mod beginning;
pub(super) mod endings;
mod recording;
mod slice;

use std::sync::Arc;

use super::StoreError;
use super::shared_database::Database;
use super::writer::in_transaction;
pub use endings::Ending;
use endings::LastSlice;
use greybox::identification::JobId;
use recording::{hand_on, write_record};
pub use slice::{Begin, HandedOn, Hold, Lease, Record, Reported, Slice};

/// Slices of jobs that workers begin, record and end.
#[derive(Clone)]
pub struct Slices {
    pub(super) database: Arc<Database>,
}

impl Slices {
    /// Begins a slice for a queue entry, or, without one, for a job that was asked to stop.
    /// A job that `death_limit` lives of the server in a row ended with fails instead.
    pub async fn begin(
        &self,
        job: JobId,
        entry: Option<i64>,
        death_limit: u32,
    ) -> Result<Begin, StoreError> {
        let now = beginning::Now {
            life: self.database.life,
            age: self.database.opened.elapsed(),
            death_limit,
            damage: self.database.damage.clone(),
        };
        in_transaction!(self.database, |tx| beginning::begin(tx, job, entry, now)).await
    }

    /// Writes what a slice did so far.
    pub async fn record(&self, lease: Lease, record: Record) -> Result<Hold, StoreError> {
        in_transaction!(self.database, |tx| write_record(tx, lease, record)).await
    }

    /// Writes what a slice did last, with its checkpoint, and hands the job on: through the queue where
    /// other jobs wait there or `must` says so.
    pub async fn hand_on(
        &self,
        lease: Lease,
        record: Record,
        must: bool,
    ) -> Result<HandedOn, StoreError> {
        in_transaction!(self.database, |tx| hand_on(tx, (lease, record), must)).await
    }

    /// Writes what a slice did last, and the state, the result and the last events of its job, in
    /// one transaction. The record has the checkpoint of the run, which is kept where the job may go on.
    pub async fn finish(
        &self,
        lease: Lease,
        record: Record,
        ending: Ending,
    ) -> Result<Hold, StoreError> {
        let end = LastSlice { record, ending };
        in_transaction!(self.database, |tx| endings::finish(tx, lease, end)).await
    }
}
