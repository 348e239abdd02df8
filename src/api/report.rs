//! A result as one page for the file.

use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{Html, IntoResponse};

use super::ApiState;
use super::error::Answer;
use super::extract::Named;
use super::finished_job::FinishedJob;
use super::query::{NoQuery, Params};
use crate::job::JobId;
use crate::report::{self, Report};

/// Generations that a page shows at the most.
const MAX_GENERATIONS: u32 = 100_000;

/// What the page may load: nothing but its own style.
const POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'",
);

/// Read a result as one self-contained page: verdict, estimates, fit, plots, and what made it.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/report", operation_id = "read_report", tag = "jobs",
    params(("id" = JobId, Path, description = "The job")),
    responses(
        (status = 200, description = "The page", body = String, content_type = "text/html"),
        (status = 409, description = "There is no result, or not yet, or its recording is gone")
    )
)]
pub async fn report(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
) -> Answer {
    let job = FinishedJob::read(&state, id).await?;
    let generations = state.store.generations(id, 0, MAX_GENERATIONS).await?;
    let rendered = state.compute(move |stop| {
        let experiments = job.trajectory(stop)?;
        let row = &job.row;
        let title = row.name.clone().unwrap_or_else(|| id.to_string());
        let finished_at = row.finished_at.map(|instant| instant.to_string());
        let page = report::render(&Report {
            title: &title,
            finished_at: finished_at.as_deref(),
            spec: &job.spec,
            outcome: &job.outcome,
            generations: &generations,
            experiments: &experiments,
        });
        let policy = [(header::CONTENT_SECURITY_POLICY, POLICY)];
        Ok((policy, Html(page)).into_response())
    });
    rendered.await
}
