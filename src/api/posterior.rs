//! Draws from the posterior distribution of a result.

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};

use super::error::{Answer, Kind, Problem};
use super::extract::Named;
use super::finished_job::{result_of, unreadable};
use super::http_headers::{json, prefers};
use super::jobs::no_job;
use super::query::{NoQuery, Params};
use super::results;
use crate::job::JobKind;
use crate::store::{Jobs, Results};
use greybox::identification::JobId;
use greybox::identification::outcome::PosteriorDraws;

/// Read draws from the posterior distribution, where `uncertainty.intervals` asks for them: at most 1000, as
/// JSON or as CSV.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/posterior", operation_id = "read_posterior", tag = "jobs",
    params(("id" = JobId, Path, description = "The job")),
    responses(
        (status = 200, description = "The draws, a row each",
         content((PosteriorDraws = "application/json"), (String = "text/csv"))),
        (status = 409, description = "There is no result, or not yet, or it has no draws")
    )
)]
pub async fn posterior(
    State(jobs): State<Jobs>,
    State(stored): State<Results>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
) -> Answer {
    let row = jobs.find(id).await?.ok_or_else(|| no_job(id))?;
    let result = result_of(&stored, &row).await?;
    let draws = match row.task.kind() {
        JobKind::Design | JobKind::Selection => None,
        JobKind::Identification => result.outcome().map_err(unreadable)?.posterior,
    };
    let draws = draws.ok_or_else(|| {
        let detail = "the result has no draws from a posterior; submit the job with \
                      `\"uncertainty\": {\"intervals\": \"posterior\"}`";
        Problem::new(Kind::WrongState, detail)
    })?;
    Ok(match prefers(&headers, "text/csv") {
        true => results::csv(draws.csv()),
        false => json(StatusCode::OK, &draws),
    })
}
