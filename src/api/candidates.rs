//! The candidates that the search of a job has simulated, each once.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::Response;
use indexmap::IndexMap;
use serde::Serialize;
use utoipa::ToSchema;

use super::ApiState;
use super::error::Answer;
use super::extract::Named;
use super::http_headers::{json, prefers};
use super::jobs::no_job;
use super::query::Params;
use super::results::{GenerationsQuery, csv};
use crate::job::{Candidate, CandidateColumn, candidate};
use crate::store::CandidatePage;
use greybox::identification::JobId;

/// An answer ends with the generation that brings it to so many candidates.
const ENOUGH: usize = 50_000;

/// Names the generation from which on candidates are missing, where some are.
const CUT_IN_GENERATION: HeaderName = HeaderName::from_static("x-cut-in-generation");

/// A part of the candidates that the search has simulated.
#[derive(Serialize, ToSchema)]
#[schema(as = Candidates)]
pub struct CandidateList {
    /// What the values of a candidate stand for; empty while none was simulated.
    columns: Vec<CandidateColumn>,
    /// Candidates of the job that are kept, in this part and the others.
    kept: u64,
    /// The generation in which as many were kept as the server keeps of a job: candidates that
    /// were new then or later are missing. `null` where none is missing.
    cut_in_generation: Option<u32>,
    /// The candidates, in the order in which they were judged.
    items: Vec<CandidateItem>,
    /// What to pass as `after` for the next part; `null` where there are no more yet.
    next_after: Option<u32>,
}

/// One candidate.
#[derive(Serialize, ToSchema)]
struct CandidateItem {
    /// The generation in which the candidate was judged first, from 1.
    generation: u32,
    /// The place of the candidate in the population of `generation`, from 0.
    place: u32,
    /// The cost, at the accuracy of the search; `null` where the simulation failed.
    cost: Option<f64>,
    /// How the simulation failed: `diverged`, `out_of_range` or `step_budget`; `null` where the
    /// simulation did not fail.
    failure: Option<&'static str>,
    /// Each unknown's value, SI.
    #[schema(value_type = Object, example = json!({"mass": 57.2}))]
    values: IndexMap<String, f64>,
}

/// Read every candidate that the search has simulated, each once: as JSON, or as CSV with the
/// unknowns in columns. Those of the refinement are not among them: its starts stand in the result.
///
/// An answer holds whole generations and ends with the one that brings it to 50 000 candidates;
/// `next_after` and `Link` say how to go on. Of each job the server keeps so many candidates
/// (`--max-candidates`, a million when it is not set) and no more, and says where it stopped.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/candidates", operation_id = "read_candidates", tag = "jobs",
    params(("id" = JobId, Path, description = "The job"), GenerationsQuery),
    responses(
        (status = 200, description = "Candidates in the order in which they were judged",
         content((CandidateList = "application/json"), (String = "text/csv")),
         headers(("Link" = String, description = "The next part, `rel=\"next\"`"),
                 ("X-Cut-In-Generation" = String, description = "`cut_in_generation`, where \
                  candidates are missing")))
    )
)]
pub async fn candidates(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    Params(query): Params<GenerationsQuery>,
    uri: Uri,
    headers: HeaderMap,
) -> Answer {
    let (after, limit) = (query.after, query.limit);
    let page = state
        .store
        .candidates()
        .page(id, after, limit, ENOUGH)
        .await?;
    if page.columns.is_empty() && state.store.jobs().find(id).await?.is_none() {
        return Err(no_job(id));
    }
    let (cut, more_after) = (page.cut_in_generation, page.more_after);
    let as_csv = prefers(&headers, "text/csv");
    let mut response = state
        .work
        .convert(move || Ok(written(page, as_csv)))
        .await?;
    let answered = response.headers_mut();
    if let Some(generation) = cut {
        answered.insert(CUT_IN_GENERATION, HeaderValue::from(generation));
    }
    if let Some(last) = more_after {
        let link = format!("<{}?after={last}&limit={limit}>; rel=\"next\"", uri.path());
        let link = HeaderValue::from_str(&link).expect("a path is visible ASCII");
        answered.insert(header::LINK, link);
    }
    Ok(response)
}

fn written(page: CandidatePage, as_csv: bool) -> Response {
    if as_csv {
        return csv(candidate::csv(&page.columns, &page.candidates));
    }
    let item = |candidate: &Candidate| {
        let names = page.columns.iter().map(|column| column.name.clone());
        CandidateItem {
            generation: candidate.generation,
            place: candidate.place,
            cost: candidate.cost,
            failure: candidate.failure.map(candidate::SimulationFailure::name),
            values: names.zip(candidate.values.iter().copied()).collect(),
        }
    };
    let items = page.candidates.iter().map(item).collect();
    let body = CandidateList {
        items,
        columns: page.columns,
        kept: page.kept,
        cut_in_generation: page.cut_in_generation,
        next_after: page.more_after,
    };
    json(StatusCode::OK, &body)
}
