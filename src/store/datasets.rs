//! Stored recordings: each kept once however often it is posted, samples as they are in memory.
//!
//! Samples are little-endian `f64` in chunks of at most 1 MiB (8 MiB in databases of earlier
//! versions); a missing sample is NaN. On their way in, memory holds a few chunks (see `insertion`).

mod chunks;
mod insertion;
mod part;
mod row;

use std::io;
use std::sync::Arc;

use super::columns;
use super::database::{self, QueryBuilder};
use super::page::Page;
use super::recordings::RecordingCache;
use super::row_cache::RowCache;
use super::sealed::DATASET_CHUNKS;
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError, corrupt};
use crate::access::Project;
use greybox::identification::{DatasetId, JobId};
use greybox::recording::{NewScratch, Recording, TimeAxis};

use chunks::decode;
pub(super) use insertion::{Turn, insert_as, remove_abandoned};
pub use part::DatasetPart;
pub use row::{DatasetRow, NewDataset};
use row::{Description, SELECT, described, read};

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

/// Recordings.
#[derive(Clone)]
pub struct Datasets {
    pub(super) database: Arc<Database>,
    /// The rows of recordings that were read lately.
    pub(super) rows: RowCache<DatasetId, DatasetRow>,
    /// Recordings with their samples that were read lately.
    pub(super) recordings: RecordingCache,
    /// Held by the large recording that is being stored.
    pub(super) turn: Turn,
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
        insertion::insert(&self.database, &self.turn, new).await
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

    /// A recording with the wanted samples and their instants: as a whole where it is small enough to be kept in
    /// memory, else no more than the part.
    pub async fn with_part(
        &self,
        id: DatasetId,
        wanted: DatasetPart,
    ) -> Result<Option<Arc<Recording>>, StoreError> {
        let row = self.find(id).await?;
        let is_large = row.is_some_and(|row| {
            let series = row.summary.signals.len() + 1;
            !RecordingCache::may_keep(row.summary.samples, series)
        });
        if is_large {
            return Ok(self.part(id, wanted).await?.map(Arc::new));
        }
        self.recording(id).await
    }

    /// A part of a recording.
    pub(super) async fn part(
        &self,
        id: DatasetId,
        wanted: DatasetPart,
    ) -> Result<Option<Recording>, StoreError> {
        let mut transaction = self.database.readers.begin_read().await?;
        part::read(&mut transaction, &id.to_string(), wanted).await
    }

    async fn read_recording(&self, id: DatasetId) -> Result<Option<Recording>, StoreError> {
        let key = id.to_string();
        let mut transaction = self.database.readers.begin_read().await?;
        let Some((name, description)) = described(&mut transaction, &key).await? else {
            return Ok(None);
        };
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
