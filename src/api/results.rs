//! What a job came to: the history of its search and its result.

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use serde::Serialize;
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::error::{Answer, Kind, Problem};
use super::extract::Named;
use super::jobs::{no_job, retry_after};
use super::manners::{json, tagged_json};
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use crate::job::{GenerationEvent, JobId, Outcome, Status};
use crate::store::JobRow;

/// Rows of the history in one answer when the client does not say.
const DEFAULT_ROWS: u64 = 1000;
/// Rows of the history in one answer at the most.
const MAX_ROWS: u64 = 10_000;

/// Which part of the history.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct GenerationsQuery {
    /// Only generations after this one.
    #[param(value_type = u64, maximum = 4294967295_i64, default = 0, required = false)]
    pub after: u32,
    /// So many at the most.
    #[param(minimum = 1, maximum = 10000, default = 1000, required = false)]
    pub limit: u32,
}

impl FromQuery for GenerationsQuery {
    fn read(query: &mut QueryReader) -> Self {
        let small = |number: u64| u32::try_from(number).expect("the range was checked");
        let after = query.integer("after", 0, u32::MAX.into()).unwrap_or(0);
        let limit = query.integer("limit", 1, MAX_ROWS).unwrap_or(DEFAULT_ROWS);
        Self {
            after: small(after),
            limit: small(limit),
        }
    }
}

/// A part of the history of a search.
#[derive(Serialize, ToSchema)]
pub struct Generations {
    /// The generations, in order.
    items: Vec<GenerationEvent>,
}

/// Read the history of a search, a row a generation.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/generations", operation_id = "read_generations", tag = "jobs",
    params(("id" = JobId, Path, description = "The job"), GenerationsQuery),
    responses((status = 200, description = "Generations in order; fewer than `limit` when there \
                                            are no more yet", body = Generations))
)]
pub async fn generations(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    Params(query): Params<GenerationsQuery>,
) -> Answer {
    let items = state
        .store
        .generations(id, query.after, query.limit)
        .await?;
    if items.is_empty() && state.store.job(id).await?.is_none() {
        return Err(no_job(id));
    }
    Ok(json(StatusCode::OK, &Generations { items }))
}

/// Read the estimate: final when the job succeeded, the best so far when it was paused or
/// cancelled.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/result", operation_id = "read_result", tag = "jobs",
    params(
        ("id" = JobId, Path, description = "The job"),
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` that the client has")
    ),
    responses(
        (status = 200, description = "The result", body = Outcome,
         headers(("ETag" = String, description = "Changes with the answer"))),
        (status = 304, description = "The client has this already"),
        (status = 409, description = "There is no result, or not yet")
    )
)]
pub async fn result(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
) -> Answer {
    let row = state.store.job(id).await?.ok_or_else(|| no_job(id))?;
    Ok(tagged_json(&headers, &settled_result(&state, &row).await?))
}

/// The result of a job that has one.
pub async fn settled_result(state: &ApiState, row: &JobRow) -> Answer<Value> {
    let settled = row.status.is_terminal() || row.status == Status::Paused;
    if settled && let Some(outcome) = state.store.result(row.id).await? {
        return Ok(outcome);
    }
    let detail = match row.status {
        Status::Failed => "the job failed, its `error` says why".to_owned(),
        status if settled => format!("the job was {status} before it had an estimate"),
        status => format!("the job is {status} and has no result yet"),
    };
    let problem = Problem::new(Kind::WrongState, detail);
    Err(match retry_after(row) {
        Some(retry) => problem.with_header(header::RETRY_AFTER, retry),
        None => problem,
    })
}
