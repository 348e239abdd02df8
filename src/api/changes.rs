//! The changes of all jobs as one stream, for lists that show many.
//!
//! A client lists the jobs once its stream is open and from then on takes what the stream says: each
//! job that changed, in short, as it stands. Changes that are overtaken before they are sent are left
//! out, so that a slow client costs nobody anything. What happens to one job without a gap is told by
//! the stream of that job.

use std::convert::Infallible;
use std::fmt::Write as _;
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::State;
use futures_util::stream;
use utoipa::ToSchema;

use super::client::Client;
use super::error::Answer;
use super::event_streams::EventStreams;
use super::events::{COMMENT, KEEP_ALIVE, RETRY, streamed};
use super::job_list::JobSummary;
use super::query::{NoQuery, Params};
use crate::access::Project;
use crate::admission::Permit;
use crate::event::ChangedJobs;
use crate::store::{Jobs, StoreError};
use greybox::identification::JobId;

/// Changes are gathered for so long.
const GATHERING: Duration = Duration::from_millis(250);
/// Jobs in one piece of the stream.
const PIECE: usize = 200;

/// Follow all jobs.
///
/// Server-sent events `job`, whose data are the job as `GET /v1/jobs?view=summary` shows it, whenever
/// that changes, and `removed` with its `id` when it was deleted; at most four pieces a second. The
/// stream has no past: list the jobs once it is open, and again whenever it was lost.
#[utoipa::path(
    get, path = "/v1/events", operation_id = "follow_jobs", tag = "jobs",
    responses((status = 200, content_type = "text/event-stream", body = StreamedChange,
               description = "The changes, one after the other"))
)]
pub async fn changes(
    State(streams): State<EventStreams>,
    client: Client,
    _query: Params<NoQuery>,
) -> Answer {
    let permit = streams.permit()?;
    let follower = Follower {
        changed: streams.hub.changed_jobs(),
        jobs: streams.store.jobs().clone(),
        project: client.project,
        greeted: false,
        _permit: permit,
    };
    let pieces = stream::unfold(follower, |mut follower| async move {
        let piece = follower.next().await?;
        Some((Ok::<_, Infallible>(piece), follower))
    });
    Ok(streamed(Body::from_stream(pieces)))
}

/// A change as it is streamed. Comments and `retry` come between.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it describes what is written by hand")]
pub struct StreamedChange {
    /// `job` or `removed`.
    #[schema(example = "job")]
    event: String,
    /// One line of JSON: a `JobSummary`, or the `id` of what was removed.
    #[schema(example = r#"{"id":"job_0198c0de-0000-7000-8000-000000000001"}"#)]
    data: String,
}

/// One client's way through the changes.
struct Follower {
    changed: ChangedJobs,
    jobs: Jobs,
    /// Whose jobs are followed.
    project: Project,
    greeted: bool,
    _permit: Permit,
}

impl Follower {
    /// The next piece of the stream; `None` at its end.
    async fn next(&mut self) -> Option<Bytes> {
        if !self.greeted {
            self.greeted = true;
            return Some(Bytes::from_static(RETRY.as_bytes()));
        }
        let changed = tokio::time::timeout(KEEP_ALIVE, self.changed.next(PIECE)).await;
        let Ok(changed) = changed else {
            return Some(Bytes::from_static(COMMENT.as_bytes()));
        };
        let written = self.written(&changed?).await;
        // What changes meanwhile goes into the next piece.
        tokio::time::sleep(GATHERING).await;
        match written {
            Ok(piece) => Some(piece),
            Err(error) => {
                tracing::error!(%error, "the stream of all jobs broke off");
                None
            }
        }
    }

    async fn written(&self, changed: &[JobId]) -> Result<Bytes, StoreError> {
        let rows = self.jobs.summaries_of(changed).await?;
        let mut text = String::new();
        let mut push = |name: &str, data: String| {
            write!(text, "event: {name}\ndata: {data}\n\n")
                .expect("writing to a string does not fail");
        };
        let there: Vec<JobId> = rows.iter().map(|row| row.id).collect();
        for row in rows.into_iter().filter(|row| row.project == self.project) {
            let shown = serde_json::to_string(&JobSummary::from(row));
            push("job", shown.expect("a summary has only text keys"));
        }
        for id in changed.iter().filter(|id| !there.contains(id)) {
            push("removed", format!("{{\"id\":\"{id}\"}}"));
        }
        Ok(text.into())
    }
}
