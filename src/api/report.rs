//! A result for the file: as a page, as Markdown, or as a document for programs.

use axum::extract::State;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{Html, IntoResponse};
use serde::Deserialize;
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::error::Answer;
use super::extract::Named;
use super::finished_job::FinishedJob;
use super::http_headers::json;
use super::query::{FromQuery, Params, QueryReader};
use crate::store::DatasetRow;
use greybox::identification::{JobId, JobSpec};
use greybox::report::{self, GenerationCosts, RecordingFacts, Report, ReportDocument};

/// Generations that a page shows at the most.
const MAX_GENERATIONS: u32 = 100_000;

/// What the page may load: nothing but its own style.
const POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'",
);

/// What a report is written as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReportFormat {
    /// A page with its plots inside.
    #[default]
    Html,
    /// Text with tables.
    Markdown,
    /// A document for programs.
    Json,
}

/// In which form.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ReportQuery {
    /// The format of the report.
    #[param(inline)]
    pub format: Option<ReportFormat>,
}

impl FromQuery for ReportQuery {
    fn read(query: &mut QueryReader) -> Self {
        let format = query.parsed("format", |word| {
            serde_json::from_value(Value::from(word)).map_err(|error| error.to_string())
        });
        Self { format }
    }
}

/// Read a result for the file.
///
/// As one self-contained page that prints on A4 and Letter: verdict, estimates, model, recordings,
/// fit, plots, sign-off, and what made it; as Markdown without the plots; or as JSON, with what the
/// residuals look like.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/report", operation_id = "read_report", tag = "jobs",
    params(("id" = JobId, Path, description = "The job"), ReportQuery),
    responses(
        (status = 200, description = "The report",
         content((String = "text/html"), (String = "text/markdown"),
                 (ReportDocument = "application/json"))),
        (status = 409, description = "There is no result, or not yet, or its recording is gone")
    )
)]
pub async fn report(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    Params(query): Params<ReportQuery>,
) -> Answer {
    let job = FinishedJob::read(&state, id).await?;
    let generations = state
        .store
        .generations()
        .after(id, 0, MAX_GENERATIONS)
        .await?;
    let generations: Vec<_> = generations.iter().map(GenerationCosts::from).collect();
    let recordings = recordings(&state, &job.spec).await?;
    let rendered = state.work.compute(move |stop| {
        let experiments = job.trajectory(stop)?;
        // A result without process noise, or with more samples than a smoother takes, has a report too.
        let disturbances = job.disturbances(stop).unwrap_or_default();
        let row = &job.row;
        let title = row.name.clone().unwrap_or_else(|| id.to_string());
        let finished_at = row.finished_at.map(|instant| instant.to_string());
        let report = Report {
            title: &title,
            finished_at: finished_at.as_deref(),
            spec: &job.spec,
            model: job.model().description(),
            recordings: &recordings,
            outcome: &job.outcome,
            generations: &generations,
            experiments: &experiments,
            disturbances: &disturbances,
        };
        Ok(match query.format.unwrap_or_default() {
            ReportFormat::Html => {
                let policy = [(header::CONTENT_SECURITY_POLICY, POLICY)];
                (policy, Html(report::render(&report))).into_response()
            }
            ReportFormat::Markdown => {
                let kind = HeaderValue::from_static("text/markdown; charset=utf-8");
                let kind = [(header::CONTENT_TYPE, kind)];
                (kind, report::markdown::render(&report)).into_response()
            }
            ReportFormat::Json => json(StatusCode::OK, &report::document(&report)),
        })
    });
    rendered.await
}

/// The recordings of a job, one for each experiment.
async fn recordings(state: &ApiState, spec: &JobSpec) -> Answer<Vec<RecordingFacts>> {
    let mut facts = Vec::with_capacity(spec.experiments.len());
    for experiment in &spec.experiments {
        if let Some(row) = state.store.datasets().find(experiment.dataset).await? {
            facts.push(facts_of(&row));
        }
    }
    Ok(facts)
}

fn facts_of(row: &DatasetRow) -> RecordingFacts {
    RecordingFacts {
        id: row.id.to_string(),
        name: row.name.clone(),
        digest: row.digest.clone(),
        start: row.summary.start.map(|instant| instant.to_string()),
        zone: row.summary.zone.clone(),
        samples: row.summary.samples,
        duration_s: row.summary.duration_s,
    }
}
