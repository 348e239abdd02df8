//! Stored recordings: each kept once however often it is posted, samples as they are in memory.
//!
//! Samples are little-endian `f64` in chunks of at most 1 MiB (8 MiB in databases of earlier
//! versions); a missing sample is NaN. On their way in, memory holds a few chunks.

use std::io;
use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;

use super::columns::{self, from_json, json, project, time};
use super::database::{self, QueryBuilder, Row};
use super::new_ids::NewIds;
use super::page::Page;
use super::recordings::RecordingCache;
use super::row_cache::RowCache;
use super::sealed::{DATASET_CHUNKS, DATASETS};
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError, corrupt, quota_checks};
use crate::access::Project;
use greybox::identification::{DatasetId, JobId};
use greybox::recording::{
    NamedSignal, NewScratch, ReceivedRecording, Recording, RecordingSource, Summary, TimeAxis,
    Warning,
};

/// The most bytes in one chunk.
const CHUNK_BYTES: usize = 1 << 20;
/// Chunks that wait to be written.
const CHUNKS_WAITING: usize = 2;

/// A recording to be stored.
pub struct NewDataset {
    /// The project that the recording belongs to.
    pub project: Project,
    /// A name for people.
    pub name: Option<String>,
    /// A digest of the bytes that came and of the options they were read with.
    pub digest: String,
    /// The contents of the recording in a few numbers.
    pub summary: Summary,
    /// The samples and signals.
    pub recording: ReceivedRecording,
}

/// A recording as it is shown: all but its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetRow {
    /// The identifier of the recording.
    pub id: DatasetId,
    /// The project that the recording belongs to.
    pub project: Project,
    /// A name for people.
    pub name: Option<String>,
    /// A digest of the bytes that came and of the options they were read with.
    pub digest: String,
    /// What the recording holds, in a few numbers.
    pub summary: Summary,
    /// When the recording was stored.
    pub created_at: Timestamp,
}

/// What became of a wish to remove a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DatasetRemoval {
    /// It is gone.
    Removed,
    /// There is no such recording.
    NotFound,
    /// These jobs have not ended and read it.
    InUse(Vec<JobId>),
}

/// A recording without its samples, as it is stored.
#[derive(Serialize, Deserialize)]
struct Description {
    start: Option<Timestamp>,
    #[serde(default)]
    zone: Option<String>,
    #[serde(default)]
    source: RecordingSource,
    /// [s]; nothing where the time axis is stored as samples.
    sample_time: Option<f64>,
    samples: usize,
    signals: Vec<NamedSignal>,
    notes: Vec<Warning>,
}

/// Recordings.
#[derive(Clone)]
pub struct Datasets {
    pub(super) database: Arc<Database>,
    /// The rows of recordings that were read lately.
    pub(super) rows: RowCache<DatasetId, DatasetRow>,
    /// Recordings with their samples that were read lately.
    pub(super) recordings: RecordingCache,
}

impl Datasets {
    /// Makes scratches for recordings on their way here: files without a name beside the
    /// database, which are gone with the process.
    pub fn scratch(&self) -> NewScratch {
        let datasets = self.clone();
        Box::new(move || Ok(Box::new(datasets.nameless_file()?)))
    }

    /// A file without a name beside the database, which is gone with the process.
    pub fn nameless_file(&self) -> io::Result<std::fs::File> {
        tempfile::tempfile_in(&self.database.folder)
    }

    /// Stores a recording, or finds the one of its project that has the same digest. Says whether it
    /// is new.
    pub async fn insert(&self, new: NewDataset) -> Result<(DatasetRow, bool), StoreError> {
        in_transaction!(self.database, |tx| insert(tx, new)).await
    }

    /// A recording without its samples.
    pub async fn find(&self, id: DatasetId) -> Result<Option<Arc<DatasetRow>>, StoreError> {
        let reading = match self.rows.get(id) {
            Ok(row) => return Ok(Some(row)),
            Err(reading) => reading,
        };
        let mut query = QueryBuilder::new(SELECT);
        query.push(" where id = ").push_bind(id.to_string());
        let row = query.build().fetch_optional(&self.database.readers).await?;
        let row = row.as_ref().map(read).transpose()?.map(Arc::new);
        if let Some(row) = &row {
            reading.keep(row);
        }
        Ok(row)
    }

    /// Recordings of a project, newest first, older than `before`.
    pub async fn list(
        &self,
        project: &Project,
        before: Option<DatasetId>,
        limit: u32,
    ) -> Result<Page<DatasetRow, DatasetId>, StoreError> {
        let mut query = QueryBuilder::new(SELECT);
        query.push(" where project = ").push_bind(project.as_str());
        if let Some(before) = before {
            query.push(" and id < ").push_bind(before.to_string());
        }
        query
            .push(" order by id desc limit ")
            .push_bind(i64::from(limit) + 1);
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.id))
    }

    /// A recording with its samples.
    pub async fn recording(&self, id: DatasetId) -> Result<Option<Arc<Recording>>, StoreError> {
        if let Some(recording) = self.recordings.get(id) {
            return Ok(Some(recording));
        }
        let read = self.read_recording(id).await?.map(Arc::new);
        if let Some(recording) = &read {
            self.recordings.keep(id, recording);
        }
        Ok(read)
    }

    async fn read_recording(&self, id: DatasetId) -> Result<Option<Recording>, StoreError> {
        let key = id.to_string();
        let mut transaction = self.database.readers.begin_read().await?;
        let mut query = QueryBuilder::new(SELECT);
        query.push(" where id = ").push_bind(&key);
        let stored = query.build().fetch_optional(&mut transaction).await?;
        let Some(stored) = stored else {
            return Ok(None);
        };
        DATASETS.verify(&stored)?;
        let name = stored.try_get("name")?;
        let description: Description =
            from_json("description", &key, stored.try_get("description")?)?;
        let chunks = database::query(
            "select dataset, position, chunk, samples, seal from dataset_chunks where dataset = $1 \
             order by position, chunk",
        )
        .bind(&key)
        .fetch_all(&mut transaction)
        .await?;
        let mut series = vec![Vec::new(); description.signals.len() + 1];
        for chunk in &chunks {
            DATASET_CHUNKS.verify(chunk)?;
            let position: i64 = chunk.try_get("position")?;
            let samples: &[u8] = chunk.try_get("samples")?;
            let into = usize::try_from(position)
                .ok()
                .and_then(|position| series.get_mut(position))
                .ok_or_else(|| corrupt("recording", &key, "it has a chunk of no signal"))?;
            into.extend(decode(samples));
        }
        assemble(&key, name, description, series).map(Some)
    }

    /// Removes a recording that no unfinished job reads.
    pub async fn delete(&self, id: DatasetId) -> Result<DatasetRemoval, StoreError> {
        in_transaction!(self.database, |tx| delete(tx, id)).await
    }
}

const SELECT: &str =
    "select id, project, name, digest, description, summary, created_at, seal from datasets";

/// A recording without its samples, from its row.
fn read(row: &Row) -> Result<DatasetRow, StoreError> {
    DATASETS.verify(row)?;
    let id: &str = row.try_get("id")?;
    Ok(DatasetRow {
        project: project(id, row.try_get("project")?)?,
        name: row.try_get("name")?,
        digest: row.try_get("digest")?,
        summary: from_json("summary", id, row.try_get("summary")?)?,
        created_at: time(id, row.try_get("created_at")?)?,
        id: id.parse().map_err(|why| corrupt("identifier", id, why))?,
    })
}

async fn insert(tx: &mut Tx, new: NewDataset) -> Result<(DatasetRow, bool), StoreError> {
    let id = NewIds::of(tx, "datasets").await?.next();
    insert_as(tx, id, new).await
}

/// Stores a recording by the identifier `id`. A stored recording of the same project and digest
/// stays instead. Returns the row, and whether it is new.
pub(super) async fn insert_as(
    tx: &mut Tx,
    id: DatasetId,
    new: NewDataset,
) -> Result<(DatasetRow, bool), StoreError> {
    let identity = format!("{} {}", new.project, new.digest);
    let mut query = QueryBuilder::new(SELECT);
    query.push(" where identity = ").push_bind(&identity);
    let same = query.build().fetch_optional(&mut **tx).await?;
    if let Some(same) = same {
        return Ok((read(&same)?, false));
    }
    let bytes = bytes_of(&new.recording);
    quota_checks::check_dataset(tx, &new.project, bytes).await?;
    let row = DatasetRow {
        id,
        project: new.project,
        name: new.name,
        digest: new.digest,
        summary: new.summary,
        created_at: Timestamp::now(),
    };
    let key = row.id.to_string();
    let (description, summary) = (json(&describe(&new.recording)), json(&row.summary));
    let created_at = row.created_at.to_string();
    let seal = DATASETS.seal(&[
        (&key).into(),
        row.project.as_str().into(),
        (&row.name).into(),
        (&row.digest).into(),
        (&description).into(),
        (&summary).into(),
        (&created_at).into(),
    ]);
    database::query(
        "insert into datasets (id, project, identity, name, digest, description, summary, \
         created_at, bytes, seal) values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
    )
    .bind(&key)
    .bind(row.project.as_str())
    .bind(&identity)
    .bind(&row.name)
    .bind(&row.digest)
    .bind(description)
    .bind(summary)
    .bind(created_at)
    .bind(i64::try_from(bytes).unwrap_or(i64::MAX))
    .bind(seal)
    .execute(&mut **tx)
    .await?;
    insert_samples(tx, &key, new.recording).await?;
    Ok((row, true))
}

/// The bytes of its samples.
fn bytes_of(recording: &ReceivedRecording) -> u64 {
    let axes = matches!(recording.header.time, TimeAxis::Instants(_));
    let series = recording.header.signals.len() + usize::from(axes);
    (recording.header.time.samples() * series * size_of::<f64>()) as u64
}

async fn insert_samples(
    tx: &mut Tx,
    dataset: &str,
    recording: ReceivedRecording,
) -> Result<(), StoreError> {
    let (send, mut chunks) = mpsc::channel(CHUNKS_WAITING);
    let cutting = tokio::task::spawn_blocking(move || {
        let gone = |_| io::Error::from(io::ErrorKind::BrokenPipe);
        cut(recording, |chunk| send.blocking_send(chunk).map_err(gone))
    });
    while let Some(chunk) = chunks.recv().await {
        let Chunk {
            position,
            number,
            samples,
        } = chunk;
        let parts = [
            dataset.into(),
            position.into(),
            number.into(),
            (&samples).into(),
        ];
        let seal = DATASET_CHUNKS.seal(&parts);
        database::query(
            "insert into dataset_chunks (dataset, position, chunk, samples, seal) \
             values ($1, $2, $3, $4, $5)",
        )
        .bind(dataset)
        .bind(position)
        .bind(number)
        .bind(samples)
        .bind(seal)
        .execute(&mut **tx)
        .await?;
    }
    let cut = cutting.await.unwrap_or_else(|crash| Err(crash.into()));
    cut.map_err(StoreError::Scratch)
}

/// A part of a series of samples.
struct Chunk {
    /// Which series: 0 is the time axis, signals follow.
    position: i64,
    number: i64,
    samples: Vec<u8>,
}

/// Cuts the series of a recording, one after the other.
fn cut(
    mut recording: ReceivedRecording,
    mut hand_over: impl FnMut(Chunk) -> io::Result<()>,
) -> io::Result<()> {
    if let TimeAxis::Instants(instants) = &recording.header.time {
        let mut cutter = Cutter::new(0);
        cutter.take(instants, &mut hand_over)?;
        cutter.end(&mut hand_over)?;
    }
    for signal in 0..recording.header.signals.len() {
        let mut cutter = Cutter::new(signal as i64 + 1);
        recording.visit(signal, &mut |samples| cutter.take(samples, &mut hand_over))?;
        cutter.end(&mut hand_over)?;
    }
    Ok(())
}

/// Cuts a series that comes in pieces of any length.
struct Cutter {
    position: i64,
    number: i64,
    samples: Vec<u8>,
}

impl Cutter {
    fn new(position: i64) -> Self {
        Self {
            position,
            number: 0,
            samples: Vec::new(),
        }
    }

    fn take(
        &mut self,
        samples: &[f64],
        hand_over: &mut impl FnMut(Chunk) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut left = samples;
        while !left.is_empty() {
            let room = (CHUNK_BYTES - self.samples.len()) / size_of::<f64>();
            let (now, later) = left.split_at(room.min(left.len()));
            self.samples
                .extend(now.iter().flat_map(|x| x.to_le_bytes()));
            left = later;
            if self.samples.len() == CHUNK_BYTES {
                self.end(hand_over)?;
            }
        }
        Ok(())
    }

    /// Hands over what there is.
    fn end(&mut self, hand_over: &mut impl FnMut(Chunk) -> io::Result<()>) -> io::Result<()> {
        if self.samples.is_empty() {
            return Ok(());
        }
        hand_over(Chunk {
            position: self.position,
            number: self.number,
            samples: std::mem::take(&mut self.samples),
        })?;
        self.number += 1;
        Ok(())
    }
}

pub(super) async fn delete(tx: &mut Tx, id: DatasetId) -> Result<DatasetRemoval, StoreError> {
    let key = id.to_string();
    let readers: Vec<String> = database::query_scalar(
        "select jobs.id from job_datasets join jobs on jobs.id = job_datasets.job \
         where dataset = $1 and status in ('queued', 'running', 'paused') order by jobs.id",
    )
    .bind(&key)
    .fetch_all(&mut **tx)
    .await?;
    if !readers.is_empty() {
        let readers = readers.iter().map(|job| columns::parse_id(job));
        return Ok(DatasetRemoval::InUse(readers.collect::<Result<_, _>>()?));
    }
    let removed = database::query("delete from datasets where id = $1")
        .bind(&key)
        .execute(&mut **tx)
        .await?;
    Ok(if removed == 0 {
        DatasetRemoval::NotFound
    } else {
        tx.announce(Change::DatasetRemoved(id));
        DatasetRemoval::Removed
    })
}

fn describe(recording: &ReceivedRecording) -> Description {
    Description {
        start: recording.header.start,
        zone: recording.header.zone.clone(),
        source: recording.header.source.clone(),
        sample_time: match recording.header.time {
            TimeAxis::Uniform { sample_time, .. } => Some(sample_time),
            TimeAxis::Instants(_) => None,
        },
        samples: recording.header.time.samples(),
        signals: recording.header.signals.clone(),
        notes: recording.header.notes.clone(),
    }
}

/// Puts a recording together again; the first of the series is the time axis.
fn assemble(
    key: &str,
    name: Option<String>,
    description: Description,
    mut series: Vec<Vec<f64>>,
) -> Result<Recording, StoreError> {
    let samples = description.samples;
    let instants = std::mem::take(&mut series[0]);
    let time = match description.sample_time {
        Some(sample_time) => TimeAxis::Uniform {
            sample_time,
            samples,
        },
        None => TimeAxis::Instants(instants),
    };
    let lengths_agree = time.samples() == samples && series[1..].iter().all(|s| s.len() == samples);
    if !lengths_agree {
        return Err(corrupt("recording", key, "samples are missing"));
    }
    let signals = description
        .signals
        .into_iter()
        .zip(series.into_iter().skip(1))
        .map(|(signal, values)| signal.with_values(values))
        .collect();
    Ok(Recording {
        double_hour: None,
        own_instants: false,
        name,
        start: description.start,
        zone: description.zone,
        source: description.source,
        time,
        signals,
        notes: description.notes,
    })
}

fn decode(bytes: &[u8]) -> impl Iterator<Item = f64> {
    let (samples, _) = bytes.as_chunks();
    samples.iter().map(|sample| f64::from_le_bytes(*sample))
}
