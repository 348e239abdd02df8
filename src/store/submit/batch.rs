//! Writes submissions together: what each refers to is looked up once for all, and each table gets
//! the rows of all in one statement.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;

use jiff::Timestamp;
use serde::Serialize;

use super::submission::{NewJob, Submitted, answer_again};
use crate::access::Project;
use crate::job::{Event, Status};
use crate::store::columns::json;
use crate::store::database::{self, QueryBuilder, Separated};
use crate::store::idempotency::{Earlier, Idempotency};
use crate::store::jobs::JobRow;
use crate::store::new_ids::NewIds;
use crate::store::quota_checks::JobRoom;
use crate::store::sealed::{JOBS as SEALED_JOBS, KEYS};
use crate::store::writer::Tx;
use crate::store::{Change, StoreError, events, queue};
use greybox::identification::JobId;

/// Rows in one statement; SQLite takes 32766 values in one, and no row has more than 9.
const ROWS_PER_STATEMENT: usize = 4000;

/// A job that is new.
struct Fresh {
    id: JobId,
    entry: i64,
    created_at: Timestamp,
    job: NewJob,
}

/// Writes all that can be written and says, in order, what became of each.
pub(super) async fn write(tx: &mut Tx, jobs: Vec<NewJob>) -> Result<Vec<Submitted>, StoreError> {
    let stored = Known::look_up(tx, &jobs).await?;
    let mut verdicts = Vec::with_capacity(jobs.len());
    let mut accepted = Vec::with_capacity(jobs.len());
    let mut keys = HashMap::new();
    let mut room = JobRoom::default();
    for job in jobs {
        let verdict = stored.refusal(tx, &job).await?;
        let verdict = verdict.map_or_else(
            || same_key(&mut keys, &accepted, &job),
            |refusal| Verdict::Final(Box::new(refusal)),
        );
        let verdict = match verdict {
            Verdict::Fresh(_) => match room.take(tx, &job.project, 1).await? {
                Ok(()) => {
                    accepted.push(job);
                    verdict
                }
                Err(exceeded) => {
                    if let Some(idempotency) = &job.idempotency {
                        keys.remove(&key_of(idempotency));
                    }
                    Verdict::Final(Box::new(Submitted::Refused(exceeded)))
                }
            },
            verdict => verdict,
        };
        verdicts.push(verdict);
    }
    let rows = store(tx, accepted).await?;
    let answers = verdicts.into_iter().map(|verdict| match verdict {
        Verdict::Final(submitted) => *submitted,
        Verdict::Fresh(place) => Submitted::Created(rows[place].clone()),
        Verdict::Again(place) => Submitted::Replayed(rows[place].clone()),
    });
    Ok(answers.collect())
}

/// Stores jobs that nothing speaks against.
pub(in crate::store) async fn store(
    tx: &mut Tx,
    jobs: Vec<NewJob>,
) -> Result<Vec<JobRow>, StoreError> {
    let fresh = enter(tx, jobs).await?;
    insert(tx, &fresh).await?;
    let rows: Vec<JobRow> = fresh.into_iter().map(Fresh::into_row).collect();
    for row in &rows {
        tx.announce(Change::Job(row.id));
    }
    Ok(rows)
}

/// What becomes of a submission; a place is one among the new jobs.
enum Verdict {
    Final(Box<Submitted>),
    Fresh(usize),
    Again(usize),
}

/// Whether a submission that nothing speaks against is new, or has its key from one before it.
fn same_key(keys: &mut HashMap<Key, usize>, accepted: &[NewJob], job: &NewJob) -> Verdict {
    let Some(idempotency) = &job.idempotency else {
        return Verdict::Fresh(accepted.len());
    };
    let key = key_of(idempotency);
    let body_digest = &idempotency.body_digest;
    let Some(place) = keys.get(&key) else {
        keys.insert(key, accepted.len());
        return Verdict::Fresh(accepted.len());
    };
    let first = accepted[*place].idempotency.as_ref();
    if first.is_some_and(|first| first.body_digest == *body_digest) {
        Verdict::Again(*place)
    } else {
        Verdict::Final(Box::new(Submitted::KeyReused))
    }
}

/// A key, after the project that it is of.
type Key = (String, String);

fn key_of(idempotency: &Idempotency) -> Key {
    (idempotency.project.to_string(), idempotency.key.clone())
}

/// What the database knows of the things that submissions refer to.
pub(in crate::store) struct Known {
    /// The digest and the job that came with a key.
    keys: HashMap<Key, (String, String)>,
    datasets: HashSet<String>,
    /// Models by project and reference.
    models: HashSet<(String, String)>,
}

impl Known {
    pub(in crate::store) async fn look_up(
        tx: &mut Tx,
        jobs: &[NewJob],
    ) -> Result<Self, StoreError> {
        let keys = jobs.iter().filter_map(|job| job.idempotency.as_ref());
        let keys = distinct(keys.map(key_of));
        let datasets = jobs.iter().flat_map(|job| &job.datasets);
        let datasets = distinct(datasets.map(ToString::to_string));
        // Models of the catalogue, whose names have no digest, are always there.
        let models = jobs.iter().filter(|job| job.model.contains('@'));
        let models = distinct(models.map(|job| (job.project.to_string(), job.model.clone())));
        let mut stored = Self {
            keys: HashMap::new(),
            datasets: HashSet::new(),
            models: HashSet::new(),
        };
        if let Some(keys) = keys {
            let rows = database::query(tx.kind().either(
                "select idempotency.project, idempotency.key, body_digest, made, created_at, seal \
                     from json_each($1) as asked join idempotency \
                     on idempotency.project = asked.value ->> 0 \
                     and idempotency.key = asked.value ->> 1",
                "select idempotency.project, idempotency.key, body_digest, made, created_at, seal \
                     from json_array_elements($1::json) as asked (value) join idempotency \
                     on idempotency.project = asked.value ->> 0 \
                     and idempotency.key = asked.value ->> 1",
            ))
            .bind(keys)
            .fetch_all(&mut **tx)
            .await?;
            for row in &rows {
                KEYS.verify(row)?;
                let key = (row.try_get("project")?, row.try_get("key")?);
                let made = (row.try_get("body_digest")?, row.try_get("made")?);
                stored.keys.insert(key, made);
            }
        }
        if let Some(datasets) = datasets {
            let rows: Vec<String> = database::query_scalar(tx.kind().either(
                "select id from datasets where id in (select value from json_each($1))",
                "select id from datasets where id in \
                     (select value from json_array_elements_text($1::json) as asked (value))",
            ))
            .bind(datasets)
            .fetch_all(&mut **tx)
            .await?;
            stored.datasets.extend(rows);
        }
        if let Some(models) = models {
            let rows: Vec<(String, String)> = database::query_as(tx.kind().either(
                "select models.project, models.reference \
                     from json_each($1) as asked join models \
                     on models.project = asked.value ->> 0 \
                     and models.reference = asked.value ->> 1",
                "select models.project, models.reference \
                     from json_array_elements($1::json) as asked (value) join models \
                     on models.project = asked.value ->> 0 \
                     and models.reference = asked.value ->> 1",
            ))
            .bind(models)
            .fetch_all(&mut **tx)
            .await?;
            stored.models.extend(rows);
        }
        Ok(stored)
    }

    /// The answer to a submission that makes no new job, as far as the database says.
    async fn refusal(&self, tx: &mut Tx, job: &NewJob) -> Result<Option<Submitted>, StoreError> {
        if let Some(idempotency) = &job.idempotency
            && let Some((digest, earlier)) = self.keys.get(&key_of(idempotency))
        {
            let earlier = Earlier {
                is_same_body: *digest == idempotency.body_digest,
                made: earlier.clone(),
            };
            return answer_again(tx, earlier).await.map(Some);
        }
        Ok(self.missing(job))
    }

    /// What a submission refers to that is not there.
    pub(in crate::store) fn missing<T>(&self, job: &NewJob) -> Option<Submitted<T>> {
        let gone = |dataset: &&_| !self.datasets.contains(&ToString::to_string(dataset));
        if let Some(dataset) = job.datasets.iter().find(gone) {
            return Some(Submitted::NoDataset(*dataset));
        }
        let model = (job.project.to_string(), job.model.clone());
        if job.model.contains('@') && !self.models.contains(&model) {
            return Some(Submitted::NoModel(job.model.clone()));
        }
        None
    }
}

/// The different ones of many texts, as a JSON array; nothing where there are none.
fn distinct<T: Hash + Eq + Serialize>(texts: impl Iterator<Item = T>) -> Option<String> {
    let texts: HashSet<T> = texts.collect();
    (!texts.is_empty()).then(|| json(&texts))
}

/// Gives each new job its identifier and its entry in the queue.
async fn enter(tx: &mut Tx, jobs: Vec<NewJob>) -> Result<Vec<Fresh>, StoreError> {
    let mut ids = NewIds::of(tx, "jobs").await?;
    let named = jobs.iter().map(|job| (ids.next(), job.project.clone()));
    let named: Vec<(JobId, Project)> = named.collect();
    let entries = queue::enqueue_all(tx, &named).await?;
    let ids = named.into_iter().map(|(id, _)| id);
    let created_at = Timestamp::now();
    let fresh = jobs.into_iter().zip(ids.zip(entries));
    Ok(fresh
        .map(|(job, (id, entry))| Fresh {
            id,
            entry,
            created_at,
            job,
        })
        .collect())
}

async fn insert(tx: &mut Tx, jobs: &[Fresh]) -> Result<(), StoreError> {
    for statement in statements(jobs).into_iter().flatten() {
        statement.build().execute(&mut **tx).await?;
    }
    Ok(())
}

/// What inserts jobs and all that belongs to them, in the order of their references.
fn statements(jobs: &[Fresh]) -> [Vec<QueryBuilder>; 5] {
    const JOBS: &str = "insert into jobs (id, project, name, labels, model, spec, status, queue_entry, \
                        last_event, created_at, seal) ";
    const LABELS: &str = "insert into job_labels (job, label, value) ";
    const DATASETS: &str = "insert into job_datasets (job, dataset) ";
    const EVENTS: &str = "insert into events (job, id, name, data, seal) ";
    const KEYS: &str = "insert into idempotency (project, key, body_digest, made, created_at) ";
    let labels = jobs.iter().flat_map(|fresh| {
        let labels = fresh.job.labels.iter();
        labels.map(|label| (fresh.id, label))
    });
    let datasets = jobs.iter().flat_map(|fresh| {
        let datasets = fresh.job.datasets.iter();
        datasets.map(|dataset| (fresh.id, dataset))
    });
    let keys = jobs
        .iter()
        .filter_map(|fresh| Some((fresh, fresh.job.idempotency.as_ref()?)));
    let first = Event::State {
        status: Status::Queued,
    };
    [
        rows((JOBS, ""), jobs.iter(), push_job),
        rows((LABELS, ""), labels, |row, (job, (label, value))| {
            row.push_bind(job.to_string())
                .push_bind(label.clone())
                .push_bind(value.clone());
        }),
        rows(
            (DATASETS, " on conflict do nothing"),
            datasets,
            |row, (job, dataset)| {
                row.push_bind(job.to_string())
                    .push_bind(dataset.to_string());
            },
        ),
        rows((EVENTS, ""), jobs.iter(), |row, fresh| {
            let (id, name, data) = (fresh.id.to_string(), first.name(), first.data());
            let seal = events::seal(&id, 1, (name, &data));
            row.push_bind(id)
                .push("1")
                .push_bind(name)
                .push_bind(data)
                .push_bind(seal);
        }),
        rows((KEYS, ""), keys, |row, (fresh, idempotency)| {
            row.push_bind(idempotency.project.to_string())
                .push_bind(idempotency.key.clone())
                .push_bind(idempotency.body_digest.clone())
                .push_bind(fresh.id.to_string())
                .push_bind(fresh.created_at.to_string());
        }),
    ]
}

/// Adds the columns of a job to the row that inserts it.
fn push_job(row: &mut Separated<'_>, fresh: &Fresh) {
    let NewJob {
        project,
        name,
        model,
        ..
    } = &fresh.job;
    let id = fresh.id.to_string();
    let (labels, spec) = (json(&fresh.job.labels), json(&fresh.job.task));
    let seal = SEALED_JOBS.seal(&[
        (&id).into(),
        project.as_str().into(),
        name.into(),
        (&labels).into(),
        model.into(),
        (&spec).into(),
    ]);
    row.push_bind(id)
        .push_bind(project.as_str())
        .push_bind(name)
        .push_bind(labels)
        .push_bind(model)
        .push_bind(spec)
        .push("'queued'")
        .push_bind(fresh.entry)
        .push("1")
        .push_bind(fresh.created_at.to_string())
        .push_bind(seal);
}

/// The statements that insert rows; none where there are none.
fn rows<T: Copy>(
    (into, after): (&'static str, &'static str),
    rows: impl Iterator<Item = T>,
    mut push: impl FnMut(&mut Separated<'_>, T),
) -> Vec<QueryBuilder> {
    let rows: Vec<T> = rows.collect();
    let statements = rows.chunks(ROWS_PER_STATEMENT).map(|rows| {
        let mut query = QueryBuilder::new(into);
        query.push_values(rows, |mut row, value| push(&mut row, *value));
        query.push(after);
        query
    });
    statements.collect()
}

impl Fresh {
    fn into_row(self) -> JobRow {
        JobRow {
            id: self.id,
            project: self.job.project,
            name: self.job.name,
            labels: self.job.labels,
            model: self.job.model,
            task: self.job.task,
            status: Status::Queued,
            stop_request: None,
            progress: None,
            attempt: 0,
            error: None,
            created_at: self.created_at,
            started_at: None,
            finished_at: None,
            last_event: 1,
            revision: 1,
        }
    }
}
