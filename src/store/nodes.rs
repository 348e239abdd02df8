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
mod watch;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use jiff::Timestamp;
use riverqueue::Client;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::database::{self, Kind};
use super::opening::Shared;
use super::writer::{Tx, Writer};
use super::{Change, OnChange, Store, StoreError, queue};
use beat::Beats;

/// Lives that ended of which a row is kept.
const LIVES_KEPT: i64 = 1000;

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
pub(super) struct Node {
    pub(super) life: i64,
    in_charge: Arc<AtomicBool>,
    place: Arc<Mutex<Option<(u32, u32)>>>,
    lost: CancellationToken,
    closing: CancellationToken,
    beats: Mutex<Option<JoinHandle<()>>>,
}

impl Node {
    /// Begins a life that says every `beat` that it is there.
    pub(super) async fn begin(writer: &Writer, beat: Duration) -> Result<Self, StoreError> {
        let life = writer.write(move |tx| Box::pin(begin_in(tx, beat))).await?;
        writer.fence().set(life);
        Ok(Self {
            life,
            in_charge: Arc::new(AtomicBool::new(true)),
            place: Arc::default(),
            lost: CancellationToken::new(),
            closing: CancellationToken::new(),
            beats: Mutex::default(),
        })
    }

    /// Says that it is there, among others, until it is closed.
    pub(super) fn live_among_others(
        &self,
        shared: Shared,
        (writer, queue): (Arc<Writer>, Client),
        on_change: OnChange,
    ) {
        self.in_charge.store(false, Ordering::Relaxed);
        let beats = Beats {
            life: self.life,
            shared,
            writer,
            queue,
            on_change,
            in_charge: self.in_charge.clone(),
            place: self.place.clone(),
            lost: self.lost.clone(),
        };
        let task = tokio::spawn(beats.run(self.closing.clone()));
        *self.beats.lock().unwrap_or_else(PoisonError::into_inner) = Some(task);
    }

    /// Whether it does what one node does for all: of those that live it has done so for the longest.
    pub(super) fn is_in_charge(&self) -> bool {
        self.in_charge.load(Ordering::Relaxed)
    }

    /// Which it is of those that live, from 0, and how many they are; nothing where it is alone.
    pub(super) fn place(&self) -> Option<(u32, u32)> {
        *self.place.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns when others have declared it dead.
    pub(super) async fn lost(&self) {
        self.lost.cancelled().await;
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
}

impl Drop for Node {
    fn drop(&mut self) {
        self.closing.cancel();
    }
}

async fn begin_in(tx: &mut Tx, beat: Duration) -> Result<i64, StoreError> {
    let last: i64 = database::query_scalar("select coalesce(max(life), 0) from nodes")
        .fetch_one(&mut **tx)
        .await?;
    let life = last + 1;
    if tx.kind() == Kind::Sqlite {
        let cut_off: Vec<i64> =
            database::query_scalar("select life from nodes where state = 'live'")
                .fetch_all(&mut **tx)
                .await?;
        for life in cut_off {
            note_death(tx, life).await?;
        }
    }
    database::query(
        "insert into nodes (life, name, beat_ms, state, begun_at) values ($1, $2, $3, 'live', $4)",
    )
    .bind(life)
    .bind(name())
    .bind(i64::try_from(beat.as_millis()).unwrap_or(i64::MAX))
    .bind(Timestamp::now().to_string())
    .execute(&mut **tx)
    .await?;
    database::query("delete from nodes where state <> 'live' and life < $1")
        .bind(life - LIVES_KEPT)
        .execute(&mut **tx)
        .await?;
    Ok(life)
}

/// The machine and the process.
fn name() -> String {
    let machine = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    format!("{}:{}", machine.trim(), std::process::id())
}

/// Notes that a life was cut off, and what that says of the jobs.
async fn note_death(tx: &mut Tx, life: i64) -> Result<(), StoreError> {
    for statement in [
        "update nodes set state = 'dead' where life = $1",
        "update jobs set deaths = case when at_work_in = $1 then deaths + 1 else 0 end \
         where at_work_in = $1 or (deaths > 0 and at_work_in is null)",
        "update jobs set at_work_in = null where at_work_in = $1",
    ] {
        database::query(statement)
            .bind(life)
            .execute(&mut **tx)
            .await?;
    }
    Ok(())
}

/// Declares a node dead that has not said that it lives since `beat`, and has others go on with its jobs.
async fn take_over(queue: Client, tx: &mut Tx, life: i64, beat: i64) -> Result<(), StoreError> {
    let silent = database::query(
        "update nodes set state = 'dead' where life = $1 and beat = $2 and state = 'live'",
    )
    .bind(life)
    .bind(beat)
    .execute(&mut **tx)
    .await?;
    if silent == 0 {
        return Ok(());
    }
    note_death(tx, life).await?;
    queue::let_go_of_leadership(tx, &queue::client_name(life)).await?;
    let jobs = queue::reassign(&queue, tx).await?;
    metrics::counter!("greybox_nodes_taken_over_total").increment(1);
    tracing::warn!(
        node = life,
        jobs,
        "a node is dead; others go on with its jobs"
    );
    tx.announce(Change::Missed);
    Ok(())
}

/// Ends a life in order: what was still at work in it others go on with.
async fn end_in(queue: Client, tx: &mut Tx, life: i64) -> Result<(), StoreError> {
    for statement in [
        "update nodes set state = 'ended' where life = $1",
        "update jobs set at_work_in = null where at_work_in = $1",
    ] {
        database::query(statement)
            .bind(life)
            .execute(&mut **tx)
            .await?;
    }
    queue::let_go_of_leadership(tx, &queue::client_name(life)).await?;
    queue::reassign(&queue, tx).await?;
    Ok(())
}

impl Store {
    /// Notes that the server ends in order.
    pub(super) async fn end_life(&self) -> Result<(), StoreError> {
        let (queue, life) = (self.inner.queue.clone(), self.inner.node.life);
        self.inner
            .writer
            .write(move |tx| Box::pin(end_in(queue, tx, life)))
            .await
    }

    /// Declares all other nodes dead, as one that observes them does in time.
    #[cfg(test)]
    pub(super) async fn take_over_from_all_others(&self) -> Result<(), StoreError> {
        let own = self.inner.node.life;
        let others: Vec<(i64, i64)> =
            database::query_as("select life, beat from nodes where state = 'live' and life <> $1")
                .bind(own)
                .fetch_all(self.readers())
                .await?;
        for (life, beat) in others {
            let queue = self.inner.queue.clone();
            self.inner
                .writer
                .write(move |tx| Box::pin(take_over(queue, tx, life, beat)))
                .await?;
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
