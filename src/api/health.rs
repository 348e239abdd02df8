//! Whether the process lives, whether it can work, what it is, what it counted.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use tokio::time::error::Elapsed;
use utoipa::ToSchema;

use super::ApiState;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::http_headers::json;
use super::metric_lines;
use crate::job::Status;
use crate::store::{Damage, Meaning, StoreError};

/// How long an unready client may wait before it asks again `[s]`.
const RETRY_S: u32 = 2;
/// How long the database may take to answer and to take a write: who asks has an answer within a second.
const LONGEST_PROBE: Duration = Duration::from_millis(800);

/// A word about the state of the process.
#[derive(Serialize, ToSchema)]
pub struct Health {
    /// `alive` or `ready`.
    #[schema(value_type = String, example = "ready")]
    status: &'static str,
    /// Damaged rows that this process has met since it began; absent where it met none. What needs one of them
    /// is refused, the rest is served.
    #[serde(skip_serializing_if = "is_zero")]
    #[schema(ignore)]
    damaged_rows: usize,
}

impl Health {
    fn of(status: &'static str) -> Self {
        Self {
            status,
            damaged_rows: 0,
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// What this process is.
#[derive(Serialize, ToSchema)]
pub struct Version {
    /// The name of the program.
    #[schema(value_type = String, example = "greybox")]
    name: &'static str,
    /// The version of the program.
    #[schema(value_type = String, example = "0.1.0")]
    version: &'static str,
    /// The version of the API, the first part of the API's paths.
    #[schema(value_type = String, example = "v1")]
    api: &'static str,
    /// The version of the database's schema.
    schema: i64,
}

/// The process is alive.
#[utoipa::path(
    get, path = "/livez", operation_id = "livez", tag = "health",
    responses((status = 200, description = "It is", body = Health))
)]
pub async fn livez() -> Response {
    json(StatusCode::OK, &Health::of("alive"))
}

/// The database answers, takes writes, and the workers run.
#[utoipa::path(
    get, path = "/readyz", operation_id = "readyz", tag = "health",
    responses((status = 200, description = "Ready to work", body = Health),
              (status = 503, description = "Not ready; `detail` says why"))
)]
pub async fn readyz(State(state): State<ApiState>) -> Answer {
    Ok(json(StatusCode::OK, &ready(&state).await?))
}

/// That the server is ready to work, or why it is not.
pub(super) async fn ready(state: &ApiState) -> Answer<Health> {
    let begun = Instant::now();
    let answers = tokio::time::timeout(LONGEST_PROBE, state.store.ping()).await;
    if let Some(why) = why_not(state, answers, "the database does not answer") {
        return Err(not_ready(why));
    }
    let left = LONGEST_PROBE.saturating_sub(begun.elapsed());
    let writes = tokio::time::timeout(left, state.store.probe()).await;
    if let Some(why) = why_not(state, writes, "the database cannot be written") {
        return Err(not_ready(why));
    }
    if !(state.workers_run)() {
        return Err(not_ready("the workers do not run"));
    }
    // One damaged row is no reason to take a server away that serves all others and takes in what comes. Where
    // the database is not sound itself, more would be harmed by writing on.
    let damage = state.store.damage().seen();
    if damage.is_of_the_database {
        return Err(Problem::new(
            Kind::DamagedData,
            "the database is damaged: stop the server and restore a backup",
        ));
    }
    Ok(Health {
        damaged_rows: damage.rows,
        ..Health::of("ready")
    })
}

fn not_ready(detail: &str) -> Problem {
    Problem::new(Kind::Busy, detail).retry_after(RETRY_S)
}

/// Why the server cannot work after the database was probed, in `otherwise` where the failure says nothing more.
fn why_not(
    state: &ApiState,
    probed: Result<Result<(), StoreError>, Elapsed>,
    otherwise: &'static str,
) -> Option<&'static str> {
    let Ok(probed) = probed else {
        return Some("the database takes long to answer");
    };
    let error = probed.err()?;
    state.store.damage().note(&error);
    tracing::warn!(%error, otherwise);
    Some(match error.meaning() {
        Meaning::NoRoom => "the disk is full: nothing can be stored",
        _ => otherwise,
    })
}

/// Notes the damage that a request met.
pub(super) async fn note_damage(
    State(met): State<Damage>,
    request: Request,
    next: Next,
) -> Response {
    let response = next.run(request).await;
    if let Some(problem) = response.extensions().get::<Problem>()
        && let Some(damage) = problem.damage()
    {
        met.note(damage);
    }
    response
}

/// The build and the schema.
#[utoipa::path(
    get, path = "/version", operation_id = "version", tag = "health",
    responses((status = 200, description = "What this process is", body = Version))
)]
pub async fn version() -> Response {
    let version = Version {
        name: env!("CARGO_PKG_NAME"),
        version: env!("CARGO_PKG_VERSION"),
        api: "v1",
        schema: crate::store::schema_version(),
    };
    json(StatusCode::OK, &version)
}

/// Counters and timings, as Prometheus reads them.
///
/// A token of the project `default` reads the lines of the server and of its project, with the scope `admin` the lines
/// of all projects and the head of the audit log. A token of another project reads the lines that name this project.
#[utoipa::path(
    get, path = "/metrics", operation_id = "metrics", tag = "health",
    responses((status = 200, description = "Prometheus text format 0.0.4",
               content_type = "text/plain; version=0.0.4", body = String))
)]
pub async fn metrics(State(state): State<ApiState>, client: Client) -> Answer {
    let counts: HashMap<_, _> = state.store.jobs().counts().await?.into_iter().collect();
    for status in Status::ALL {
        // A state that no job is in any more is told too.
        let count = counts.get(&status).copied().unwrap_or(0);
        metrics::gauge!("greybox_jobs", "status" => status.as_str()).set(count as f64);
    }
    let figures = state.store.figures().await?;
    metrics::gauge!("greybox_queue_age_seconds").set(figures.queue_age.as_secs_f64());
    metrics::gauge!("greybox_database_bytes").set(figures.bytes as f64);
    metrics::gauge!("greybox_database_free_bytes").set(figures.free_bytes as f64);
    metrics::gauge!("greybox_deliveries_waiting").set(figures.deliveries_waiting as f64);
    metrics::gauge!("greybox_audit_entries").set(figures.audit_entries as f64);
    for (of, bytes) in [
        ("samples", figures.stored.samples),
        ("jobs", figures.stored.jobs),
        ("keys", figures.stored.keys),
    ] {
        metrics::gauge!("greybox_stored_bytes", "of" => of).set(bytes as f64);
    }
    metrics::gauge!("greybox_streams_open").set(state.event_streams.count() as f64);
    for (project, worked) in state.store.jobs().work_by_project().await? {
        let project = project.to_string();
        let counter = metrics::counter!("greybox_work_seconds_total", "project" => project);
        counter.absolute(worked.as_secs());
    }
    let text_type = HeaderValue::from_static("text/plain; version=0.0.4");
    let headers = [(header::CONTENT_TYPE, text_type)];
    let mut lines = metric_lines::shown_to(&client, &state.metrics.render());
    if let Some(head) = figures.audit_head
        && metric_lines::are_all_shown_to(&client)
    {
        lines.push_str(&metric_lines::of_audit_head(&head));
    }
    Ok((headers, lines).into_response())
}
