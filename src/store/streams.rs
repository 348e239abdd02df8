//! Recordings that grow: batches of samples come in any order, and windows are read back.
//!
//! Samples are kept in blocks that do not overlap. A batch changes the blocks that its instants fall
//! into and no others, so that one late sample costs as much as one that comes in time. What is older
//! or more than a stream is to keep goes block by block, the oldest first. Samples whose stamps lie
//! ahead of the server's clock do not count for the age of others, nor for what is due.

pub(super) mod answers;
mod blocks;
mod double_hour;
mod removal;
mod signals;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::database::{self, Connection, QueryBuilder, Row};
use super::idempotency::Idempotency;
use super::jobs::{self, Page, from_json, json, time};
use super::writer::Tx;
use super::{Change, Quotas, Store, StoreError, corrupt, quotas, unsigned};
use crate::access::Project;
use blocks::{Block, Span};
use greybox::recording::{Batch, Merged, QualityReport, RowSignal, Rows};
use signals::places;

/// What a stream keeps when nobody says `[MiB]`.
pub const DEFAULT_KEEP_MIB: u32 = 256;
/// Streams that a project can have.
pub const MAX_STREAMS: i64 = 1000;
/// Nanoseconds in a second.
const NS: f64 = 1e9;

/// Samples for a stream, which may be new.
pub struct NewBatch {
    /// Whose the stream is.
    pub project: Project,
    /// The stream's name.
    pub stream: String,
    /// The samples.
    pub batch: Batch,
    /// What is to be kept from now on, where that is said.
    pub keep: Keep,
    /// Makes the batch safe to repeat.
    pub idempotency: Option<Idempotency>,
}

/// What of a stream is kept; what is absent stays as it was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keep {
    /// So long before the newest sample `[s]`; for ever where it was never said.
    pub seconds: Option<f64>,
    /// So much, the newest.
    pub mib: Option<u32>,
}

/// A stream as it stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = Stream)]
pub struct StreamRow {
    /// The project that the stream belongs to.
    #[serde(skip)]
    pub project: Project,
    /// The name of the stream.
    #[schema(example = "rig-4")]
    pub name: String,
    /// The signals, in the order in which they came.
    pub signals: Vec<RowSignal>,
    /// The time zone that the source counted in; `null` where the source said none, or UTC.
    pub zone: Option<String>,
    /// How many instants the stream has samples of.
    pub samples: u64,
    /// Bytes that the samples take of the database.
    pub bytes: u64,
    /// The first instant with samples; `null` where there are no samples.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub first: Option<Timestamp>,
    /// The last instant with samples; `null` where there are no samples.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub last: Option<Timestamp>,
    /// How long before the last sample that is not ahead of the server's clock others are kept `[s]`; `null`: as long as there is room.
    pub keep_s: Option<f64>,
    /// How much is kept `[MiB]`.
    pub keep_mib: u32,
    /// When the first batch came.
    #[schema(value_type = String, format = DateTime)]
    pub created_at: Timestamp,
    /// When the last batch came.
    #[schema(value_type = String, format = DateTime)]
    pub received_at: Timestamp,
}

impl StreamRow {
    /// A stream before its first batch.
    fn empty(first: &NewBatch, now: Timestamp) -> Self {
        Self {
            project: first.project.clone(),
            name: first.stream.clone(),
            signals: Vec::new(),
            zone: None,
            samples: 0,
            bytes: 0,
            first: None,
            last: None,
            keep_s: None,
            keep_mib: DEFAULT_KEEP_MIB,
            created_at: now,
            received_at: now,
        }
    }

    /// By what its blocks and its monitors name it.
    fn identity(&self) -> String {
        identity(&self.project, &self.name)
    }
}

/// By what a stream is kept. Names of projects and of streams have no slash.
pub(super) fn identity(project: &Project, name: &str) -> String {
    if *project == Project::default() {
        name.to_owned()
    } else {
        format!("{project}/{name}")
    }
}

/// What became of a batch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Appended {
    /// What is odd about the batch, and what reading it assumed or left out: the findings that a
    /// recording has too.
    #[serde(default)]
    pub report: QualityReport,
    /// What the batch did to the stream.
    #[serde(flatten)]
    pub merged: Merged,
    /// Samples, old ones, that the stream no longer keeps.
    pub removed: u64,
    /// The stream as it then stood.
    pub stream: StreamRow,
}

/// The answer to a batch.
#[derive(Clone, Debug, PartialEq)]
pub enum BatchOutcome {
    /// The batch is stored; whether the stream is new.
    Stored(Box<Appended>, bool),
    /// A batch with the same key and body came before; the answer that was given.
    Replayed(Box<Appended>),
    /// The key came before with another body. Nothing was stored.
    KeyReused,
    /// A signal came in another unit before: its name, that unit, and the one that came now.
    UnitsDiffer(String, String, String),
    /// The samples are of a local hour that came twice, and both of its passes have others already.
    HourCameTwice,
    /// The stream would have more than [`greybox::recording::MAX_SIGNALS`].
    TooManySignals,
    /// The project has [`MAX_STREAMS`] already.
    TooManyStreams,
}

/// What became of a wish to remove a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StreamRemoval {
    /// It is gone.
    Removed,
    /// There is no such stream.
    NotFound,
    /// These monitors watch it.
    InUse(Vec<String>),
}

impl Store {
    /// Stores a batch. The answer means that it is on disk.
    pub async fn append(&self, batch: NewBatch) -> Result<BatchOutcome, StoreError> {
        let quotas = self.inner.quotas;
        self.inner
            .writer
            .write(move |tx| Box::pin(append(tx, batch, quotas)))
            .await
    }

    /// A stream of a project as it stands.
    pub async fn stream(
        &self,
        project: &Project,
        name: &str,
    ) -> Result<Option<StreamRow>, StoreError> {
        let mut connection = self.readers().acquire().await?;
        fetch(&mut connection, &identity(project, name)).await
    }

    /// Streams of a project by name, after `after`.
    pub async fn streams(
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
        let rows = query.build().fetch_all(self.readers()).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.name.clone()))
    }

    /// The samples of a stream from one instant up to, and without, another, `most` at the most;
    /// nothing where there are more. Instants are nanoseconds since 1970.
    pub async fn stream_rows(
        &self,
        stream: &StreamRow,
        span: (i64, i64),
        most: usize,
    ) -> Result<Option<Rows>, StoreError> {
        let mut connection = self.readers().acquire().await?;
        let span = Span {
            from: span.0,
            to: span.1,
        };
        blocks::between(&mut connection, stream, span, most).await
    }

    /// The first instant of a stream at or after one, nanoseconds since 1970.
    pub async fn stream_next(
        &self,
        stream: &StreamRow,
        from: i64,
    ) -> Result<Option<i64>, StoreError> {
        let mut connection = self.readers().acquire().await?;
        blocks::first_from(&mut connection, &stream.identity(), from).await
    }

    /// The last instant of a stream up to and with one, nanoseconds since 1970.
    pub async fn stream_reached(
        &self,
        stream: &StreamRow,
        until: i64,
    ) -> Result<Option<i64>, StoreError> {
        let mut connection = self.readers().acquire().await?;
        blocks::last_until(&mut connection, &stream.identity(), until).await
    }

    /// Removes a stream of a project that no monitor watches.
    pub async fn delete_stream(
        &self,
        project: &Project,
        name: &str,
    ) -> Result<StreamRemoval, StoreError> {
        let identity = identity(project, name);
        self.inner
            .writer
            .write(move |tx| Box::pin(delete(tx, identity)))
            .await
    }
}

const SELECT: &str = "select project, name, signals, zone, samples, bytes, first_ns, last_ns, keep_s, \
                      keep_mib, created_at, received_at from streams";

async fn fetch(
    connection: &mut Connection,
    identity: &str,
) -> Result<Option<StreamRow>, StoreError> {
    let mut query = QueryBuilder::new(SELECT);
    query.push(" where identity = ").push_bind(identity);
    let row = query.build().fetch_optional(connection).await?;
    row.as_ref().map(read).transpose()
}

fn read(row: &Row) -> Result<StreamRow, StoreError> {
    let name: String = row.try_get("name")?;
    let count = |column| row.try_get::<i64>(column).map(i64::unsigned_abs);
    let samples = count("samples")?;
    let instant = |column| {
        let ns: i64 = row.try_get(column)?;
        (samples > 0).then(|| stamp(&name, ns)).transpose()
    };
    Ok(StreamRow {
        project: jobs::project(&name, row.try_get("project")?)?,
        signals: from_json("signals", &name, row.try_get("signals")?)?,
        zone: row.try_get("zone")?,
        samples,
        bytes: count("bytes")?,
        first: instant("first_ns")?,
        last: instant("last_ns")?,
        keep_s: row.try_get("keep_s")?,
        keep_mib: unsigned("room", &name, row.try_get("keep_mib")?)?,
        created_at: time(&name, row.try_get("created_at")?)?,
        received_at: time(&name, row.try_get("received_at")?)?,
        name,
    })
}

fn stamp(stream: &str, ns: i64) -> Result<Timestamp, StoreError> {
    Timestamp::from_nanosecond(ns.into()).map_err(|why| corrupt("stream", stream, why))
}

async fn append(tx: &mut Tx, new: NewBatch, allowed: Quotas) -> Result<BatchOutcome, StoreError> {
    if let Some(idempotency) = &new.idempotency
        && let Some(earlier) = answers::earlier(tx, idempotency).await?
    {
        return Ok(earlier);
    }
    let before = fetch(tx, &identity(&new.project, &new.stream)).await?;
    let is_new = before.is_none();
    if is_new && count(tx, &new.project).await? >= MAX_STREAMS {
        return Ok(BatchOutcome::TooManyStreams);
    }
    let known = before.as_ref().map_or(&[][..], |row| &row.signals);
    let (signals, places) = match places(known, &new.batch.signals) {
        Ok(placed) => placed,
        Err(refusal) => return Ok(refusal),
    };
    let adds = blocks::bytes_of(&new.batch.rows);
    quotas::check_bytes(tx, &allowed, &new.project, adds).await?;
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
    let merged = blocks::merge(tx, &row, &rows).await?;
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

/// The streams of a project.
async fn count(tx: &mut Tx, project: &Project) -> Result<i64, StoreError> {
    database::query_scalar("select count(*) from streams where project = $1")
        .bind(project.as_str())
        .fetch_one(&mut **tx)
        .await
        .map_err(StoreError::from)
}

/// Writes what a stream is.
async fn put(tx: &mut Tx, row: &StreamRow) -> Result<(), StoreError> {
    let ns = |instant: Option<Timestamp>| {
        let ns = instant.map_or(0, Timestamp::as_nanosecond);
        i64::try_from(ns).expect("instants of samples are nanoseconds of 64 bits")
    };
    database::query(
        "insert into streams (identity, project, name, signals, zone, samples, bytes, first_ns, \
         last_ns, keep_s, keep_mib, created_at, received_at) \
         values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13) \
         on conflict (identity) do update set signals = excluded.signals, zone = excluded.zone, \
         samples = excluded.samples, bytes = excluded.bytes, first_ns = excluded.first_ns, \
         last_ns = excluded.last_ns, keep_s = excluded.keep_s, keep_mib = excluded.keep_mib, \
         received_at = excluded.received_at",
    )
    .bind(row.identity())
    .bind(row.project.as_str())
    .bind(&row.name)
    .bind(json(&row.signals))
    .bind(&row.zone)
    .bind(row.samples.cast_signed())
    .bind(row.bytes.cast_signed())
    .bind(ns(row.first))
    .bind(ns(row.last))
    .bind(row.keep_s)
    .bind(row.keep_mib)
    .bind(row.created_at.to_string())
    .bind(row.received_at.to_string())
    .execute(&mut **tx)
    .await?;
    Ok(())
}

/// Removes what is older or more than is to be kept, and writes what the stream then is. Says how
/// many samples went.
async fn keep(tx: &mut Tx, row: &mut StreamRow) -> Result<u64, StoreError> {
    let blocks = blocks::all(tx, &row.identity()).await?;
    let oldest = match row.keep_s {
        Some(keep_s) => {
            let now = now_ns();
            let reached = blocks::last_until(tx, &row.identity(), now).await?;
            reached.map_or(i64::MIN, |last| last.saturating_sub((keep_s * NS) as i64))
        }
        None => i64::MIN,
    };
    let room = u64::from(row.keep_mib) << 20;
    let mut kept = 0;
    // The newest block stays, whatever is to be kept.
    let is_kept = |(place, block): &(usize, &Block)| {
        kept += block.bytes;
        *place == 0 || (kept <= room && block.last >= oldest)
    };
    let n_kept = blocks.iter().rev().enumerate().take_while(is_kept).count();
    let (gone, left) = blocks.split_at(blocks.len() - n_kept);
    if let Some(newest_gone) = gone.last() {
        database::query("delete from stream_blocks where stream = $1 and first_ns <= $2")
            .bind(row.identity())
            .bind(newest_gone.first)
            .execute(&mut **tx)
            .await?;
    }
    note(tx, row, left).await?;
    Ok(gone.iter().map(|block| block.rows).sum())
}

/// Writes what a stream is that has these blocks.
async fn note(tx: &mut Tx, row: &mut StreamRow, blocks: &[Block]) -> Result<(), StoreError> {
    let stamp = |ns| stamp(&row.name, ns);
    row.first = blocks.first().map(|block| stamp(block.first)).transpose()?;
    row.last = blocks.last().map(|block| stamp(block.last)).transpose()?;
    row.samples = blocks.iter().map(|block| block.rows).sum();
    row.bytes = blocks.iter().map(|block| block.bytes).sum();
    put(tx, row).await
}

/// The server's clock, nanoseconds since 1970.
fn now_ns() -> i64 {
    i64::try_from(Timestamp::now().as_nanosecond()).unwrap_or(i64::MAX)
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
