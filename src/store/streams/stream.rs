//! A stream as it is stored and read, and the answers to its batches.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::access::Project;
use crate::store::columns::{self, from_json, json, time, unsigned};
use crate::store::database::{self, Connection, QueryBuilder, Row};
use crate::store::idempotency::Idempotency;
use crate::store::sealed::STREAMS;
use crate::store::writer::Tx;
use crate::store::{StoreError, corrupt};
use greybox::recording::{Batch, Merged, QualityReport, RowSignal};

/// What a stream keeps when nobody says `[MiB]`.
pub const DEFAULT_KEEP_MIB: u32 = 256;
/// Streams that a project can have.
pub const MAX_STREAMS: i64 = 1000;
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
    /// The time before the newest sample whose samples are kept `[s]`; for ever where no time was given.
    pub seconds: Option<f64>,
    /// The room for the newest samples `[MiB]`.
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
    pub(super) fn empty(first: &NewBatch, now: Timestamp) -> Self {
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
    pub(super) fn identity(&self) -> String {
        identity(&self.project, &self.name)
    }
}

/// By what a stream is kept. Names of projects and of streams have no slash.
pub(in crate::store) fn identity(project: &Project, name: &str) -> String {
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

pub(super) const SELECT: &str = "select identity, project, name, signals, zone, samples, bytes, first_ns, last_ns, \
                      keep_s, keep_mib, created_at, received_at, seal from streams";

pub(super) async fn fetch(
    connection: &mut Connection,
    project: &Project,
    name: &str,
) -> Result<Option<StreamRow>, StoreError> {
    // Where one of the three is damaged the row is found all the same, and told of.
    let mut query = QueryBuilder::new(SELECT);
    query
        .push(" where identity = ")
        .push_bind(identity(project, name));
    query.push(" or project = ").push_bind(project.as_str());
    query.push(" and name = ").push_bind(name);
    let row = query.build().fetch_optional(connection).await?;
    row.as_ref().map(read).transpose()
}

pub(super) fn read(row: &Row) -> Result<StreamRow, StoreError> {
    STREAMS.verify(row)?;
    let name: String = row.try_get("name")?;
    let count = |column| row.try_get::<i64>(column).map(i64::unsigned_abs);
    let samples = count("samples")?;
    let instant = |column| {
        let ns: i64 = row.try_get(column)?;
        (samples > 0).then(|| stamp(&name, ns)).transpose()
    };
    Ok(StreamRow {
        project: columns::project(&name, row.try_get("project")?)?,
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

pub(super) fn stamp(stream: &str, ns: i64) -> Result<Timestamp, StoreError> {
    Timestamp::from_nanosecond(ns.into()).map_err(|why| corrupt("stream", stream, why))
}

/// The streams of a project.
pub(super) async fn count(tx: &mut Tx, project: &Project) -> Result<i64, StoreError> {
    database::query_scalar("select count(*) from streams where project = $1")
        .bind(project.as_str())
        .fetch_one(&mut **tx)
        .await
        .map_err(StoreError::from)
}

/// Writes what a stream is.
pub(super) async fn put(tx: &mut Tx, row: &StreamRow) -> Result<(), StoreError> {
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

/// The server's clock, nanoseconds since 1970.
pub(super) fn now_ns() -> i64 {
    i64::try_from(Timestamp::now().as_nanosecond()).unwrap_or(i64::MAX)
}
