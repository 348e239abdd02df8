//! A recording without its samples: as it is shown, and as it is stored.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::access::Project;
use crate::store::columns::{from_json, project, time};
use crate::store::database::{Connection, QueryBuilder, Row};
use crate::store::sealed::DATASETS;
use crate::store::{StoreError, corrupt};
use greybox::identification::DatasetId;
use greybox::recording::{
    NamedSignal, ReceivedRecording, RecordingSource, Summary, TimeAxis, Warning,
};

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

/// A recording without its samples, as it is stored.
#[derive(Serialize, Deserialize)]
pub(super) struct Description {
    pub(super) start: Option<Timestamp>,
    #[serde(default)]
    pub(super) zone: Option<String>,
    #[serde(default)]
    pub(super) source: RecordingSource,
    /// [s]; nothing where the time axis is stored as samples.
    pub(super) sample_time: Option<f64>,
    pub(super) samples: usize,
    pub(super) signals: Vec<NamedSignal>,
    pub(super) notes: Vec<Warning>,
}

impl Description {
    /// A recording without its samples, as it is stored.
    pub(super) fn of(recording: &ReceivedRecording) -> Self {
        Self {
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
}

/// A statement up to the condition that reads rows of recordings.
pub(super) const SELECT: &str =
    "select id, project, name, digest, description, summary, created_at, seal from datasets";

/// A recording without its samples, from its row.
pub(super) fn read(row: &Row) -> Result<DatasetRow, StoreError> {
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

/// The name of a recording and what it is without its samples; nothing where there is none.
pub(super) async fn described(
    connection: &mut Connection,
    key: &str,
) -> Result<Option<(Option<String>, Description)>, StoreError> {
    let mut query = QueryBuilder::new(SELECT);
    query.push(" where id = ").push_bind(key);
    let Some(stored) = query.build().fetch_optional(connection).await? else {
        return Ok(None);
    };
    DATASETS.verify(&stored)?;
    let description = from_json("description", key, stored.try_get("description")?)?;
    Ok(Some((stored.try_get("name")?, description)))
}
