//! Recordings that grow: batches of samples come in any order, and windows are read back.
//!
//! Samples are kept in blocks that do not overlap. A batch changes the blocks that its instants fall
//! into and no others, so that one late sample costs as much as one that comes in time. What is older
//! or more than a stream is to keep goes block by block, the oldest first. Samples whose stamps lie
//! ahead of the server's clock do not count for the age of others, nor for what is due.

pub(super) mod answers;
mod blocks;
mod coding;
mod double_hour;
mod overview;
mod removal;
mod signals;
mod stream;

use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use jiff::Timestamp;

use super::database::{self, QueryBuilder};
use super::page::Page;
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError, quota_checks};
use crate::access::Project;
use blocks::{Kept, Order, Span};
use greybox::recording::{Batch, Rows};
pub use removal::Cleared;
use signals::places;
pub(super) use stream::identity;
pub use stream::{
    Appended, BatchOutcome, DEFAULT_KEEP_MIB, Keep, MAX_STREAMS, NewBatch, StreamRemoval, StreamRow,
};
use stream::{SELECT, count, fetch, now_ns, put, read};

/// Recordings that grow.
#[derive(Clone)]
pub struct Streams {
    pub(super) database: Arc<Database>,
}

impl Streams {
    /// Stores a batch. The answer means that it is on disk.
    pub async fn append(&self, batch: NewBatch) -> Result<BatchOutcome, StoreError> {
        in_transaction!(self.database, |tx| append(tx, batch)).await
    }

    /// A stream of a project as it stands.
    pub async fn find(
        &self,
        project: &Project,
        name: &str,
    ) -> Result<Option<StreamRow>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        fetch(&mut connection, project, name).await
    }

    /// Streams of a project by name, after `after`.
    pub async fn list(
        &self,
        project: &Project,
        after: Option<String>,
        limit: u32,
    ) -> Result<Page<StreamRow, String>, StoreError> {
        let mut query = QueryBuilder::new(SELECT);
        query
            .push(" where project = ")
            .push_bind(project.as_str().to_owned());
        if let Some(after) = after {
            query.push(" and name > ").push_bind(after);
        }
        query
            .push(" order by name limit ")
            .push_bind(i64::from(limit) + 1);
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.name.clone()))
    }

    /// The samples of a stream in a span, `most` at the most; nothing where there are more. Instants are nanoseconds since 1970.
    pub async fn rows(
        &self,
        stream: &StreamRow,
        span: Range<i64>,
        most: usize,
    ) -> Result<Option<Rows>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        blocks::between(&mut connection, stream, Span::from(span), most).await
    }

    /// The samples of a stream in a span that lie in one block with the first of them; nothing where there are
    /// none. Instants are nanoseconds since 1970.
    pub async fn first_rows(
        &self,
        stream: &StreamRow,
        span: Range<i64>,
    ) -> Result<Option<Rows>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        let in_order = (Span::from(span), Order::OldestFirst);
        let first = |rows: Rows| match rows.rows() {
            0 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(rows),
        };
        blocks::visit(&mut connection, stream, in_order, first).await
    }

    /// The samples of a stream in a span for a plot of so many points: all of them where there are few, else
    /// those with the least and the greatest value of each signal in each of more stretches than there are
    /// points. Instants are nanoseconds since 1970.
    pub async fn overview(
        &self,
        stream: &StreamRow,
        span: Range<i64>,
        points: usize,
    ) -> Result<Rows, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        overview::overview(&mut connection, stream, Span::from(span), points).await
    }

    /// The first instant of a stream at or after one, nanoseconds since 1970.
    pub async fn next_instant(
        &self,
        stream: &StreamRow,
        from: i64,
    ) -> Result<Option<i64>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        blocks::first_from(&mut connection, &stream.identity(), from).await
    }

    /// The last instant of a stream up to and with one, nanoseconds since 1970.
    pub async fn last_instant(
        &self,
        stream: &StreamRow,
        until: i64,
    ) -> Result<Option<i64>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        blocks::last_until(&mut connection, &stream.identity(), until).await
    }

    /// Removes the samples of a stream in a span of nanoseconds since 1970; nothing where there is no
    /// such stream. The answer means that they are gone.
    pub async fn remove_samples(
        &self,
        project: &Project,
        name: &str,
        span: Range<i64>,
    ) -> Result<Option<Cleared>, StoreError> {
        let (project, name) = (project.clone(), name.to_owned());
        let span = Span::from(span);
        in_transaction!(self.database, |tx| async move {
            removal::remove(tx, &project, &name, span).await
        })
        .await
    }

    /// Removes a stream of a project that no monitor watches.
    pub async fn delete(&self, project: &Project, name: &str) -> Result<StreamRemoval, StoreError> {
        let identity = identity(project, name);
        in_transaction!(self.database, |tx| delete(tx, identity)).await
    }
}

/// Nanoseconds in a second.
const NS: f64 = 1e9;

pub(super) async fn append(tx: &mut Tx, new: NewBatch) -> Result<BatchOutcome, StoreError> {
    if let Some(idempotency) = &new.idempotency
        && let Some(earlier) = answers::earlier(tx, idempotency).await?
    {
        return Ok(earlier);
    }
    let before = fetch(tx, &new.project, &new.stream).await?;
    let is_new = before.is_none();
    if is_new && count(tx, &new.project).await? >= MAX_STREAMS {
        return Ok(BatchOutcome::TooManyStreams);
    }
    let signals_before = before.as_ref().map_or(&[][..], |row| &row.signals);
    let (signals, places) = match places(signals_before, &new.batch.signals) {
        Ok(placed) => placed,
        Err(refusal) => return Ok(refusal),
    };
    let now = Timestamp::now();
    let mut row = before.unwrap_or_else(|| StreamRow::empty(&new, now));
    let Batch {
        rows,
        zone,
        mut report,
        double_hour,
        ..
    } = new.batch;
    row.zone = zone.or(row.zone);
    row.keep_s = new.keep.seconds.or(row.keep_s);
    row.keep_mib = new.keep.mib.unwrap_or(row.keep_mib);
    row.received_at = now;
    row.signals = signals;
    let mut rows = rows.spread(&places, row.signals.len());
    if let Some(hour) = double_hour {
        let Some(settled) = double_hour::settle(tx, &row, rows, hour).await? else {
            return Ok(BatchOutcome::HourCameTwice);
        };
        rows = settled.rows;
        report.warnings.push(settled.told);
    }
    if is_new {
        put(tx, &row).await?;
    }
    let bytes_before = row.bytes;
    let merged = blocks::merge(tx, &mut row, &rows).await?;
    let adds = row.bytes.saturating_sub(bytes_before);
    quota_checks::check_bytes(tx, &new.project, adds).await?;
    let removed = keep(tx, &mut row).await?;
    tx.announce(Change::Stream);
    let appended = Appended {
        report,
        merged,
        removed,
        stream: row,
    };
    if let Some(idempotency) = &new.idempotency {
        answers::remember(tx, idempotency, &appended).await?;
    }
    Ok(BatchOutcome::Stored(Box::new(appended), is_new))
}

/// Removes what is older or more than is to be kept, and writes what the stream then is. Says how
/// many samples went.
async fn keep(tx: &mut Tx, row: &mut StreamRow) -> Result<u64, StoreError> {
    let from = match row.keep_s {
        Some(keep_s) => {
            let reached = blocks::last_until(tx, &row.identity(), now_ns()).await?;
            reached.map_or(i64::MIN, |last| last.saturating_sub((keep_s * NS) as i64))
        }
        None => i64::MIN,
    };
    let bytes = u64::from(row.keep_mib) << 20;
    blocks::keep(tx, row, Kept { from, bytes }).await
}

async fn delete(tx: &mut Tx, identity: String) -> Result<StreamRemoval, StoreError> {
    let monitors: Vec<String> =
        database::query_scalar("select id from monitors where stream = $1 order by id")
            .bind(&identity)
            .fetch_all(&mut **tx)
            .await?;
    if !monitors.is_empty() {
        return Ok(StreamRemoval::InUse(monitors));
    }
    let removed = database::query("delete from streams where identity = $1")
        .bind(&identity)
        .execute(&mut **tx)
        .await?;
    Ok(match removed {
        0 => StreamRemoval::NotFound,
        _ => StreamRemoval::Removed,
    })
}
