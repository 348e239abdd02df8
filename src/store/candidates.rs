//! The candidates of a search: a blob a generation, 13 bytes and 8 for each unknown a candidate.

use std::sync::Arc;

use futures_util::TryStreamExt;

use super::columns::{self, from_json};
use super::database::{self, QueryBuilder};
use super::sealed::{CANDIDATE_RECORDS, CANDIDATES};
use super::shared_database::Database;
use super::writer::Tx;
use super::{StoreError, corrupt, unsigned};
use crate::job::candidate::Failure;
use crate::job::{Candidate, CandidateColumn};
use greybox::identification::JobId;

/// Rows in one statement; SQLite takes 32766 values in one.
const ROWS_PER_STATEMENT: usize = 1000;
/// Bytes of a candidate before its values: place, failure, cost.
const HEAD: usize = 4 + 1 + 8;

/// Candidates that are new, and what is kept with them.
#[derive(Clone, Debug)]
pub struct NewCandidates {
    /// What each of their values stands for.
    pub columns: Arc<[CandidateColumn]>,
    /// The candidates, generation by generation.
    pub candidates: Vec<Candidate>,
    /// How many candidates of the job are kept, with these.
    pub kept: u64,
    /// The generation in which the limit was reached.
    pub cut_in_generation: Option<u32>,
}

/// A part of the candidates that are kept of a job.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CandidatePage {
    /// What each of their values stands for; empty while none is kept.
    pub columns: Vec<CandidateColumn>,
    /// The candidates in order; those of a generation stand together.
    pub candidates: Vec<Candidate>,
    /// How many are kept in all.
    pub kept: u64,
    /// The generation in which the limit was reached; later candidates are not kept.
    pub cut_in_generation: Option<u32>,
    /// The last generation of this part, when there are more after it.
    pub more_after: Option<u32>,
}

/// The candidates of searches.
#[derive(Clone)]
pub struct Candidates {
    pub(super) database: Arc<Database>,
}

impl Candidates {
    /// Candidates of a job from generations above `after`, in order: of at most `generations`
    /// generations, and no further generation once there are `enough` candidates.
    pub async fn page(
        &self,
        job: JobId,
        after: u32,
        generations: u32,
        enough: usize,
    ) -> Result<CandidatePage, StoreError> {
        let job = job.to_string();
        let record = database::query(
            "select job, columns, kept, cut_in_generation, seal from candidate_records \
             where job = $1",
        )
        .bind(&job)
        .fetch_optional(&self.database.readers)
        .await?;
        let Some(record) = record else {
            return Ok(CandidatePage::default());
        };
        CANDIDATE_RECORDS.verify(&record)?;
        let cut: Option<i64> = record.try_get("cut_in_generation")?;
        let mut page = CandidatePage {
            columns: from_json("candidate columns", &job, record.try_get("columns")?)?,
            candidates: Vec::new(),
            kept: record.try_get::<i64>("kept")?.unsigned_abs(),
            cut_in_generation: cut
                .map(|value| unsigned("generation", &job, value))
                .transpose()?,
            more_after: None,
        };
        // One more says whether there are more.
        let mut rows = database::query(
            "select job, generation, candidates, seal from candidates \
             where job = $1 and generation > $2 order by generation limit $3 + 1",
        )
        .bind(&job)
        .bind(after)
        .bind(generations)
        .fetch(&self.database.readers);
        let mut read = 0;
        while let Some(row) = rows.try_next().await? {
            if read == generations || page.candidates.len() >= enough {
                page.more_after = page.candidates.last().map(|last| last.generation);
                break;
            }
            CANDIDATES.verify(&row)?;
            let generation = unsigned("generation", &job, row.try_get("generation")?)?;
            let decoded = decode(generation, row.try_get("candidates")?, page.columns.len());
            let decoded = decoded.map_err(|why| corrupt("candidates", &job, why))?;
            page.candidates.extend(decoded);
            read += 1;
        }
        Ok(page)
    }
}

/// Writes candidates. A generation that is there already stays as it is.
pub(super) async fn insert(tx: &mut Tx, job: JobId, new: &NewCandidates) -> Result<(), StoreError> {
    let job = job.to_string();
    let columns = columns::json(&new.columns);
    let kept = i64::try_from(new.kept).unwrap_or(i64::MAX);
    let parts = [
        (&job).into(),
        (&columns).into(),
        kept.into(),
        new.cut_in_generation.into(),
    ];
    database::query(
        "insert into candidate_records (job, columns, kept, cut_in_generation, seal) \
         values ($1, $2, $3, $4, $5) on conflict (job) do update set columns = excluded.columns, \
         kept = excluded.kept, cut_in_generation = excluded.cut_in_generation, seal = excluded.seal",
    )
    .bind(&job)
    .bind(&columns)
    .bind(kept)
    .bind(new.cut_in_generation)
    .bind(CANDIDATE_RECORDS.seal(&parts))
    .execute(&mut **tx)
    .await?;
    let same_generation = |a: &Candidate, b: &Candidate| a.generation == b.generation;
    let generations: Vec<&[Candidate]> = new.candidates.chunk_by(same_generation).collect();
    for rows in generations.chunks(ROWS_PER_STATEMENT) {
        let mut query =
            QueryBuilder::new("insert into candidates (job, generation, candidates, seal) ");
        query.push_values(rows, |mut row, candidates| {
            let (generation, blob) = (candidates[0].generation, encode(candidates));
            let seal = CANDIDATES.seal(&[(&job).into(), generation.into(), (&blob).into()]);
            row.push_bind(job.clone())
                .push_bind(generation)
                .push_bind(blob)
                .push_bind(seal);
        });
        query.push(" on conflict do nothing");
        // Each number of rows is another statement; they are not worth keeping.
        query.build().persistent(false).execute(&mut **tx).await?;
    }
    Ok(())
}

fn encode(candidates: &[Candidate]) -> Vec<u8> {
    let n_values = candidates.first().map_or(0, |one| one.values.len());
    let mut blob = Vec::with_capacity(candidates.len() * (HEAD + 8 * n_values));
    for candidate in candidates {
        blob.extend(candidate.place.to_le_bytes());
        blob.push(code(candidate.failure));
        blob.extend(candidate.cost.unwrap_or(f64::NAN).to_le_bytes());
        blob.extend(
            candidate
                .values
                .iter()
                .flat_map(|value| value.to_le_bytes()),
        );
    }
    blob
}

fn decode(generation: u32, blob: &[u8], n_values: usize) -> Result<Vec<Candidate>, String> {
    let length = HEAD + 8 * n_values;
    let pieces = blob.chunks_exact(length);
    if !pieces.remainder().is_empty() {
        let n = blob.len();
        return Err(format!(
            "{n} bytes of generation {generation} are no multiple of {length}"
        ));
    }
    pieces
        .map(|piece| {
            let (place, rest) = piece.split_at(4);
            let (failure, numbers) = rest.split_at(1);
            let mut numbers = numbers.chunks_exact(8).map(number);
            let cost = numbers.next().filter(|cost| !cost.is_nan());
            Ok(Candidate {
                generation,
                place: u32::from_le_bytes(place.try_into().expect("four bytes")),
                cost,
                failure: failure_of(failure[0])?,
                values: numbers.collect(),
            })
        })
        .collect()
}

fn number(bytes: &[u8]) -> f64 {
    f64::from_le_bytes(bytes.try_into().expect("eight bytes"))
}

fn code(failure: Option<Failure>) -> u8 {
    match failure {
        None => 0,
        Some(Failure::Diverged) => 1,
        Some(Failure::OutOfRange) => 2,
        Some(Failure::StepBudget) => 3,
        Some(Failure::Tolerance) => 4,
    }
}

fn failure_of(code: u8) -> Result<Option<Failure>, String> {
    match code {
        0 => Ok(None),
        1 => Ok(Some(Failure::Diverged)),
        2 => Ok(Some(Failure::OutOfRange)),
        3 => Ok(Some(Failure::StepBudget)),
        4 => Ok(Some(Failure::Tolerance)),
        other => Err(format!("there is no failure {other}")),
    }
}
