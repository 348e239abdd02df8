//! The log of who did what: written before the answer is sent, and read by administrators.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::State;
use axum::http::{HeaderMap, Method, Uri};
use axum::response::Response;
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::ApiState;
use super::client::Client;
use super::error::Answer;
use super::http_headers::prefers;
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, Params, QueryReader};
use super::results::csv;
use super::session_cookie;
use crate::access::Project;
use crate::store::{AuditEntry, AuditRow, Store};

/// Refusals that are written down in so long at the most; of more, their number is.
const REFUSALS: u32 = 60;
/// How long.
const REFUSALS_IN: Duration = Duration::from_secs(60);
/// The characters of a path that are written down.
const PATH_CHARS: usize = 200;

/// Writes the log. Cheap to clone.
#[derive(Clone)]
pub struct Audit {
    store: Store,
    refusals: Arc<Mutex<Refusals>>,
}

/// How many refusals were written down lately.
struct Refusals {
    since: Instant,
    written: u32,
    left_out: u64,
}

impl Refusals {
    /// Whether one more is written down, and how many before it were not.
    fn one_more(&mut self) -> Option<u64> {
        if self.since.elapsed() >= REFUSALS_IN {
            (self.since, self.written) = (Instant::now(), 0);
        }
        if self.written >= REFUSALS {
            self.left_out += 1;
            return None;
        }
        self.written += 1;
        Some(std::mem::take(&mut self.left_out))
    }
}

/// A request that was answered.
pub(super) struct Asked<'a> {
    /// Who asked, where that is known.
    pub(super) client: Option<Client>,
    /// The address that it came from.
    pub(super) address: String,
    pub(super) method: &'a Method,
    pub(super) path: &'a str,
    pub(super) status: u16,
    pub(super) request_id: &'a str,
}

impl Audit {
    /// A log in a database.
    pub fn new(store: Store) -> Self {
        let refusals = Refusals {
            since: Instant::now(),
            written: 0,
            left_out: 0,
        };
        Self {
            store,
            refusals: Arc::new(Mutex::new(refusals)),
        }
    }

    /// Writes down what is to be: who was refused, and, where callers have to say who they are,
    /// what changes something.
    pub(super) async fn note(&self, asked: Asked<'_>) {
        let guesses = asked.status == 429 && asked.path == session_cookie::PATH;
        let refused = guesses || matches!(asked.status, 401 | 403 | 421);
        let is_known = asked.client.as_ref().is_some_and(|client| client.is_known);
        let changes = !matches!(*asked.method, Method::GET | Method::HEAD | Method::OPTIONS);
        let left_out = if refused {
            let mut refusals = self.refusals.lock();
            let refusals = refusals.as_mut().map_err(PoisonError::get_mut);
            match refusals.unwrap_or_else(|refusals| refusals).one_more() {
                Some(left_out) => left_out,
                None => return,
            }
        } else if changes && is_known {
            0
        } else {
            return;
        };
        let client = asked.client.filter(|client| client.is_known);
        let entry = AuditEntry {
            project: client.as_ref().map(|client| client.project.clone()),
            who: client.map_or_else(|| "unknown".to_owned(), |client| client.who),
            address: asked.address,
            method: asked.method.as_str().chars().take(20).collect(),
            path: asked.path.chars().take(PATH_CHARS).collect(),
            status: asked.status,
            request_id: asked.request_id.to_owned(),
            left_out,
        };
        if let Err(error) = self.store.audit(entry).await {
            tracing::error!(%error, request_id = asked.request_id, "the audit log was not written");
        }
    }
}

/// An entry of the log.
#[derive(Serialize, ToSchema)]
pub struct AuditRecord {
    /// Its number; later entries have larger ones.
    id: i64,
    /// When it was written.
    #[schema(value_type = String, format = DateTime)]
    at: Timestamp,
    /// Who asked: `token <name>`, `person <name>` or `unknown`.
    #[schema(example = "token mes")]
    who: String,
    /// In which project; `null` of a caller that is not known.
    #[schema(value_type = Option<String>)]
    project: Option<String>,
    /// The address that the request came from.
    address: String,
    /// The method.
    #[schema(example = "POST")]
    method: String,
    /// The path, without its query.
    #[schema(example = "/v1/jobs")]
    path: String,
    /// The status of the answer.
    status: u16,
    /// The request's identifier, under which the server logged it.
    request_id: String,
    /// Refusals before this one that were too many to be written down singly.
    left_out: u64,
}

impl From<AuditRow> for AuditRecord {
    fn from(AuditRow { id, at, entry }: AuditRow) -> Self {
        Self {
            id,
            at,
            who: entry.who,
            project: entry.project.map(|project| project.to_string()),
            address: entry.address,
            method: entry.method,
            path: entry.path,
            status: entry.status,
            request_id: entry.request_id,
            left_out: entry.left_out,
        }
    }
}

/// The page of the log.
pub struct WhichEntries(Cursor<i64>);

impl FromQuery for WhichEntries {
    fn read(query: &mut QueryReader) -> Self {
        Self(Cursor::read(query))
    }
}

/// Read who did what, newest first: every change, and whoever was refused. As JSON, or as CSV.
///
/// Callers that are not known are told of to the administrators of the project `default`.
#[utoipa::path(
    get, path = "/v1/audit", operation_id = "read_audit", tag = "access",
    params(PageParams),
    responses((status = 200, description = "A page of the log",
               content((Page<AuditRecord> = "application/json"), (String = "text/csv")),
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn list(
    State(state): State<ApiState>,
    client: Client,
    Params(WhichEntries(cursor)): Params<WhichEntries>,
    headers: HeaderMap,
    uri: Uri,
) -> Answer {
    let strangers = client.project == Project::default();
    let page = state
        .store
        .audit_log(&client.project, strangers, cursor.before, cursor.limit);
    let page = page.await?;
    let items: Vec<AuditRecord> = page.rows.into_iter().map(AuditRecord::from).collect();
    let as_csv = prefers(&headers, "text/csv").then(|| written(&items));
    let mut response = Page::new(items, page.next.map(|id| id.to_string())).answer(&uri);
    if let Some(text) = as_csv {
        let link = response.headers_mut().remove("link");
        response = csv(text);
        if let Some(link) = link {
            response.headers_mut().insert("link", link);
        }
    }
    Ok::<Response, _>(response)
}

fn written(items: &[AuditRecord]) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    for item in items {
        writer.serialize(item).expect("memory takes every row");
    }
    let bytes = writer.into_inner().expect("memory takes every row");
    String::from_utf8(bytes).expect("rows are text")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_refusals_is_counted() {
        let mut refusals = Refusals {
            since: Instant::now(),
            written: 0,
            left_out: 0,
        };
        for _ in 0..REFUSALS {
            assert_eq!(refusals.one_more(), Some(0));
        }
        assert_eq!(refusals.one_more(), None);
        assert_eq!(refusals.one_more(), None);
        refusals.since -= REFUSALS_IN;
        assert_eq!(refusals.one_more(), Some(2));
    }
}
