//! Storing a recording: a small one in one transaction, a large one part by part.
//!
//! The parts of a large recording come in transactions of their own: between two of them others write, and on a
//! PostgreSQL the parts wait for no other node and hold none up. The row of the recording comes last, so nobody sees
//! a recording that is not whole. Until then `unfinished_datasets` says which server stores it; the parts of a
//! server that is gone are removed (see `retention`).

use std::sync::Arc;
use std::time::{Duration, Instant};

use jiff::Timestamp;
use tokio::sync::Mutex;

use super::chunks::{CHUNK_BYTES, Chunks};
use super::row::{DatasetRow, Description, NewDataset, SELECT, read};
use crate::store::columns::json;
use crate::store::database::{self, Pool, Query, QueryBuilder};
use crate::store::error::WriteFailure;
use crate::store::new_ids::NewIds;
use crate::store::sealed::DATASETS;
use crate::store::shared_database::Database;
use crate::store::writer::{Tx, in_transaction};
use crate::store::{StoreError, quota_checks};
use greybox::identification::DatasetId;
use greybox::recording::{ReceivedRecording, TimeAxis};

/// How long a PostgreSQL may take to store or remove a part.
const LONGEST_PART: Duration = Duration::from_secs(30);
/// Recordings whose parts are removed at a time.
const ABANDONED_AT_ONCE: i64 = 10;

/// Large recordings are stored one after the other, so that a few connections suffice.
pub(in crate::store) type Turn = Arc<Mutex<()>>;

/// The row of a recording that is not stored yet.
struct NewRow {
    row: DatasetRow,
    /// The project and the digest.
    identity: String,
    description: Description,
    /// The bytes of the samples.
    bytes: u64,
}

impl NewRow {
    /// The row that a recording gets under an identifier, and the recording.
    fn split(id: DatasetId, new: NewDataset) -> (Self, ReceivedRecording) {
        let identity = format!("{} {}", new.project, new.digest);
        let row = DatasetRow {
            id,
            project: new.project,
            name: new.name,
            digest: new.digest,
            summary: new.summary,
            created_at: Timestamp::now(),
        };
        let new_row = Self {
            row,
            identity,
            description: Description::of(&new.recording),
            bytes: bytes_of(&new.recording),
        };
        (new_row, new.recording)
    }

    /// The stored recording of the same project and digest. Where there is none, the project has room for this one.
    async fn look_up(&self, tx: &mut Tx) -> Result<Option<DatasetRow>, StoreError> {
        let mut query = QueryBuilder::new(SELECT);
        query
            .push(" where identity = ")
            .push_bind(self.identity.as_str());
        let same = query.build().fetch_optional(&mut **tx).await?;
        if let Some(same) = same {
            return read(&same).map(Some);
        }
        quota_checks::check_dataset(tx, &self.row.project, self.bytes).await?;
        Ok(None)
    }

    async fn insert(self, tx: &mut Tx) -> Result<DatasetRow, StoreError> {
        let row = self.row;
        let key = row.id.to_string();
        let (description, summary) = (json(&self.description), json(&row.summary));
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
        .bind(&self.identity)
        .bind(&row.name)
        .bind(&row.digest)
        .bind(description)
        .bind(summary)
        .bind(created_at)
        .bind(i64::try_from(self.bytes).unwrap_or(i64::MAX))
        .bind(seal)
        .execute(&mut **tx)
        .await?;
        Ok(row)
    }
}

/// Stores a recording, or finds the recording of its project that has the same digest. Says whether it is new. Once
/// begun it is not undone by dropping the future.
pub(super) async fn insert(
    database: &Arc<Database>,
    turn: &Turn,
    new: NewDataset,
) -> Result<(DatasetRow, bool), StoreError> {
    if bytes_of(&new.recording) <= CHUNK_BYTES as u64 {
        return in_transaction!(database, |tx| async move {
            let id = NewIds::of(tx, "datasets").await?.next();
            insert_as(tx, id, new).await
        })
        .await;
    }
    let (database, turn) = (database.clone(), turn.clone());
    let storing = tokio::spawn(async move {
        let _turn = turn.lock().await;
        insert_in_parts(&database, new).await
    });
    storing.await.map_err(|_crash| StoreError::Closed)?
}

/// Stores a recording by the identifier `id`. A stored recording of the same project and digest
/// stays instead. Returns the row, and whether it is new.
pub(in crate::store) async fn insert_as(
    tx: &mut Tx,
    id: DatasetId,
    new: NewDataset,
) -> Result<(DatasetRow, bool), StoreError> {
    let (new, recording) = NewRow::split(id, new);
    if let Some(same) = new.look_up(tx).await? {
        return Ok((same, false));
    }
    let mut chunks = Chunks::of(recording);
    let key = id.to_string();
    while let Some(chunk) = chunks.next().await {
        chunk.insertion(&key).build().execute(&mut **tx).await?;
    }
    chunks.end().await?;
    Ok((new.insert(tx).await?, true))
}

async fn insert_in_parts(
    database: &Database,
    new: NewDataset,
) -> Result<(DatasetRow, bool), StoreError> {
    let life = database.life;
    let (new, recording) = NewRow::split(DatasetId::default(), new);
    let begun = in_transaction!(database, |tx| begin(tx, new, life)).await?;
    let new = match begun {
        Begun::Stored(same) => return Ok((*same, false)),
        Begun::Unfinished(new) => new,
    };
    let key = new.row.id.to_string();
    let stored = match store_parts(database, &key, recording).await {
        Ok(()) => in_transaction!(database, |tx| finish(tx, *new, life)).await,
        Err(error) => Err(error),
    };
    if !matches!(stored, Ok((_, true)))
        && let Err(error) = abandon(database, &key).await
    {
        tracing::warn!(%error, "the parts of a recording that was not stored are removed later");
    }
    stored
}

/// A recording that is to be stored in parts.
enum Begun {
    /// The recording is stored already.
    Stored(Box<DatasetRow>),
    /// The row waits for its parts.
    Unfinished(Box<NewRow>),
}

async fn begin(tx: &mut Tx, mut new: NewRow, life: i64) -> Result<Begun, StoreError> {
    if let Some(same) = new.look_up(tx).await? {
        return Ok(Begun::Stored(Box::new(same)));
    }
    new.row.id = NewIds::of(tx, "datasets").await?.next();
    database::query("insert into unfinished_datasets (dataset, life) values ($1, $2)")
        .bind(new.row.id.to_string())
        .bind(life)
        .execute(&mut **tx)
        .await?;
    Ok(Begun::Unfinished(Box::new(new)))
}

/// Gives a recording its row after all parts. Meanwhile another may have come with the same digest, or have taken
/// the room.
async fn finish(tx: &mut Tx, new: NewRow, life: i64) -> Result<(DatasetRow, bool), StoreError> {
    if let Some(same) = new.look_up(tx).await? {
        return Ok((same, false));
    }
    let finished =
        database::query("delete from unfinished_datasets where dataset = $1 and life = $2")
            .bind(new.row.id.to_string())
            .bind(life)
            .execute(&mut **tx)
            .await?;
    if finished == 0 {
        return Err(StoreError::Commit(WriteFailure::superseded()));
    }
    Ok((new.insert(tx).await?, true))
}

async fn store_parts(
    database: &Database,
    key: &str,
    recording: ReceivedRecording,
) -> Result<(), StoreError> {
    let kind = database.writer_pool.kind();
    let mut chunks = Chunks::of(recording);
    while let Some(chunk) = chunks.next().await {
        let insertion = chunk.insertion_by(key, database.life, kind);
        let begun = Instant::now();
        if write_beside(database, insertion).await? == 0 {
            return Err(StoreError::Commit(WriteFailure::superseded()));
        }
        // Others have the disk for as long as a part had.
        tokio::time::sleep(begun.elapsed()).await;
    }
    chunks.end().await
}

/// Runs a statement of its own: in a file in its turn, in a PostgreSQL beside the transactions that take turns.
/// Answers how many rows it changed.
async fn write_beside(database: &Database, statement: Query) -> Result<u64, StoreError> {
    let Pool::Postgres(..) = &database.writer_pool else {
        return in_transaction!(database, |tx| async move {
            Ok(statement.execute(&mut **tx).await?)
        })
        .await;
    };
    let written = tokio::time::timeout(LONGEST_PART, statement.execute(&database.writer_pool));
    let written = written.await;
    Ok(written.map_err(|_too_long| StoreError::Commit(WriteFailure::no_answer()))??)
}

/// Removes the parts of a recording that got no row. First the recording belongs to no life, so that no part comes
/// any more; its entry goes last, so that whoever is interrupted leaves the rest to others.
async fn abandon(database: &Database, key: &str) -> Result<(), StoreError> {
    let left = database::query("update unfinished_datasets set life = 0 where dataset = $1");
    if write_beside(database, left.bind(key)).await? == 0 {
        return Ok(());
    }
    for removal in [
        "delete from dataset_chunks where dataset = $1",
        "delete from unfinished_datasets where dataset = $1",
    ] {
        write_beside(database, database::query(removal).bind(key)).await?;
    }
    Ok(())
}

/// Removes the parts of recordings whose servers are gone.
pub(in crate::store) async fn remove_abandoned(database: &Database) -> Result<(), StoreError> {
    let abandoned: Vec<String> = database::query_scalar(
        "select dataset from unfinished_datasets \
         where life not in (select life from nodes where state = 'live') order by dataset limit $1",
    )
    .bind(ABANDONED_AT_ONCE)
    .fetch_all(&database.readers)
    .await?;
    for key in &abandoned {
        abandon(database, key).await?;
    }
    Ok(())
}

/// The bytes of its samples.
fn bytes_of(recording: &ReceivedRecording) -> u64 {
    let axes = matches!(recording.header.time, TimeAxis::Instants(_));
    let series = recording.header.signals.len() + usize::from(axes);
    (recording.header.time.samples() * series * size_of::<f64>()) as u64
}
