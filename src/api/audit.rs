//! The log of who did what: written before the answer is sent, and read by administrators.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, Method, Uri, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::client::Client;
use super::error::Answer;
use super::http_headers::prefers;
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, Params, QueryReader};
use super::results::csv;
use super::session_cookie;
use super::spreadsheet::inert;
use crate::access::Project;
use crate::store::{AuditEntry, AuditLog, AuditRow};

/// Requests of a caller that changed nothing and are written down singly at once, at the most. Further requests are
/// counted.
const AT_ONCE: u32 = 60;
/// After so long one more of them is written down: about a thousand in a day.
const ONE_MORE_AFTER: Duration = Duration::from_secs(90);
/// Callers that are remembered before those that are owed nothing are forgotten.
const REMEMBERED: usize = 10_000;
/// The type of an answer that has a JSON document on each line.
const JSON_LINES: &str = "application/x-ndjson";
/// What callers that are not known are called, all of them together.
const UNKNOWN: &str = "unknown";
/// The characters of a path that are written down.
const PATH_CHARS: usize = 200;

/// Writes the log. Cheap to clone.
#[derive(Clone)]
pub struct Audit {
    log: AuditLog,
    callers: Arc<Mutex<HashMap<String, InVain>>>,
}

/// What a caller asked lately that changed nothing.
struct InVain {
    /// How many more are written down now.
    room: f64,
    seen: Instant,
    /// How many were not written down since the last entry.
    left_out: u64,
}

impl InVain {
    /// The count of a caller that has not asked yet.
    fn none(now: Instant) -> Self {
        Self {
            room: f64::from(AT_ONCE),
            seen: now,
            left_out: 0,
        }
    }

    /// Counts one more. Says whether it is written down, and how many before it were not.
    fn one_more(&mut self, now: Instant) -> Option<u64> {
        let passed = now.duration_since(self.seen).as_secs_f64();
        let room = self.room + passed / ONE_MORE_AFTER.as_secs_f64();
        (self.room, self.seen) = (room.min(f64::from(AT_ONCE)), now);
        if self.room < 1.0 {
            self.left_out += 1;
            return None;
        }
        self.room -= 1.0;
        Some(std::mem::take(&mut self.left_out))
    }
}

/// What a request acted on, as its handler says it where the path alone does not. An answer carries it to
/// the log.
#[derive(Clone)]
pub(super) struct ActedOn(pub(super) String);

/// A request that was answered.
pub(super) struct AnsweredRequest<'a> {
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
    pub fn new(log: AuditLog) -> Self {
        Self {
            log,
            callers: Arc::default(),
        }
    }

    /// Counts a request of a caller. Says whether it is written down, and how many before it were not. What
    /// changed something always is.
    fn count(&self, who: &str, in_vain: bool) -> Option<u64> {
        let now = Instant::now();
        let mut callers = self.callers.lock().unwrap_or_else(PoisonError::into_inner);
        if !in_vain {
            let caller = callers.get_mut(who);
            return Some(caller.map_or(0, |caller| std::mem::take(&mut caller.left_out)));
        }
        if callers.len() >= REMEMBERED && !callers.contains_key(who) {
            let long_ago = ONE_MORE_AFTER * AT_ONCE;
            callers.retain(|_, caller| caller.left_out > 0 || caller.seen.elapsed() < long_ago);
        }
        let caller = callers.entry(who.to_owned());
        caller.or_insert_with(|| InVain::none(now)).one_more(now)
    }

    /// Writes down what is to be: who was refused, and, where callers have to say who they are,
    /// what changes something or was to.
    pub(super) async fn note(&self, asked: AnsweredRequest<'_>) {
        let returns = asked.path == session_cookie::CALLBACK;
        let guesses = asked.status == 429 && (returns || asked.path == session_cookie::PATH);
        let refused = guesses || matches!(asked.status, 401 | 403 | 421);
        // A person who comes back from the identity provider has a session from then on.
        let looks = matches!(*asked.method, Method::GET | Method::HEAD | Method::OPTIONS);
        // A collector says every half minute how its sources are.
        let reports = *asked.method == Method::PUT
            && asked.path.starts_with("/v1/sources/")
            && asked.status < 400;
        let changes = returns || !(looks || reports);
        let client = asked.client.filter(|client| client.is_known);
        let is_noted = refused || (changes && client.is_some());
        if !is_noted {
            return;
        }
        let who = client.as_ref().map_or(UNKNOWN, |client| &client.who);
        let Some(left_out) = self.count(who, asked.status >= 400) else {
            return;
        };
        let entry = AuditEntry {
            who: who.to_owned(),
            project: client.map(|client| client.project),
            address: asked.address,
            method: asked.method.as_str().chars().take(20).collect(),
            path: asked.path.chars().take(PATH_CHARS).collect(),
            status: asked.status,
            request_id: asked.request_id.to_owned(),
            left_out,
        };
        if let Err(error) = self.log.add(entry).await {
            tracing::error!(%error, request_id = asked.request_id, "the audit log was not written");
        }
    }
}

/// An entry of the log.
#[derive(Clone, Serialize, ToSchema)]
pub struct AuditRecord {
    /// The number of the entry; later entries have larger numbers.
    id: i64,
    /// When the entry was written.
    #[schema(value_type = String, format = DateTime)]
    at: Timestamp,
    /// The caller: `token <name>`, `person <name>` or `unknown`; `operator` for a command on the server's machine,
    /// `greybox` where entries were lost.
    #[schema(example = "token mes")]
    who: String,
    /// The project of the caller; `null` for an unknown caller.
    #[schema(value_type = Option<String>)]
    project: Option<String>,
    /// The address that the request came from.
    address: String,
    /// The HTTP method; `DELIVER` for a delivery that was refused, `COMMAND` for a command of the operator.
    #[schema(example = "POST")]
    method: String,
    /// The path, without its query; of an operator, the command.
    #[schema(example = "/v1/jobs")]
    path: String,
    /// The status of the answer.
    status: u16,
    /// The request's identifier, under which the server logged it.
    request_id: String,
    /// Requests of this caller before this one that changed nothing and were too many to be written down
    /// singly. Where entries were lost, how many, of all projects.
    left_out: u64,
    /// Where entries were let go because the log had too many, when the first of them was written.
    #[schema(value_type = Option<String>, format = DateTime)]
    lost_from: Option<Timestamp>,
    /// Where entries were let go because the log had too many, when the last of them was written.
    #[schema(value_type = Option<String>, format = DateTime)]
    lost_to: Option<Timestamp>,
    /// SHA-256 over the entry and the digest of the entry before it, of whichever project: who changes an entry has
    /// to change all later digests. `null` for an entry from before there was a chain.
    chain: Option<String>,
}

impl From<AuditRow> for AuditRecord {
    fn from(row: AuditRow) -> Self {
        let AuditRow {
            id,
            at,
            entry,
            loss,
            chain,
        } = row;
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
            lost_from: loss.map(|loss| loss.from),
            lost_to: loss.map(|loss| loss.to),
            chain,
        }
    }
}

impl AuditRecord {
    /// The entry with no formula in what callers wrote.
    fn for_a_spreadsheet(&self) -> Self {
        let mut shown = self.clone();
        for text in [
            &mut shown.who,
            &mut shown.method,
            &mut shown.path,
            &mut shown.request_id,
        ] {
            *text = inert(text).into_owned();
        }
        shown
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
/// Callers that are not known are told of to the administrators of the project `default`. Of each caller 60
/// requests that changed nothing are written down at once and one every 90 s after that; the others are counted in
/// `left_out` of the caller's next entry. Where the log had too many entries (`--keep-audit-entries`), one entry
/// says how many of the oldest went, and of when.
#[utoipa::path(
    get, path = "/v1/audit", operation_id = "read_audit", tag = "access",
    params(PageParams),
    responses((status = 200, description = "A page of the log",
               content((Page<AuditRecord> = "application/json"), (String = "text/csv"),
                       (String = "application/x-ndjson")),
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn list(
    State(log): State<AuditLog>,
    client: Client,
    Params(WhichEntries(cursor)): Params<WhichEntries>,
    headers: HeaderMap,
    uri: Uri,
) -> Answer {
    let strangers = client.project == Project::default();
    let page = log.list(&client.project, strangers, cursor.before, cursor.limit);
    let page = page.await?;
    let items: Vec<AuditRecord> = page.rows.into_iter().map(AuditRecord::from).collect();
    let exported = if prefers(&headers, "text/csv") {
        Some(csv(written(&items)))
    } else if prefers(&headers, JSON_LINES) {
        Some(json_lines(&items))
    } else {
        None
    };
    let mut response = Page::new(items, page.next.map(|id| id.to_string())).answer(&uri);
    if let Some(exported) = exported {
        let link = response.headers_mut().remove("link");
        response = exported;
        if let Some(link) = link {
            response.headers_mut().insert("link", link);
        }
    }
    Ok::<Response, _>(response)
}

/// An entry on each line.
fn json_lines(items: &[AuditRecord]) -> Response {
    let line = |item| serde_json::to_string(item).expect("an entry has only text keys") + "\n";
    let text: String = items.iter().map(line).collect();
    let json_lines = HeaderValue::from_static(JSON_LINES);
    ([(header::CONTENT_TYPE, json_lines)], text).into_response()
}

fn written(items: &[AuditRecord]) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    for item in items {
        let shown = item.for_a_spreadsheet();
        writer.serialize(shown).expect("memory takes every row");
    }
    let bytes = writer.into_inner().expect("memory takes every row");
    String::from_utf8(bytes).expect("rows are text")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_requests_that_change_nothing_is_counted() {
        let begun = Instant::now();
        let mut caller = InVain::none(begun);
        for _ in 0..AT_ONCE {
            assert_eq!(caller.one_more(begun), Some(0));
        }
        assert_eq!(caller.one_more(begun), None);
        assert_eq!(caller.one_more(begun), None);
        assert_eq!(caller.one_more(begun + ONE_MORE_AFTER), Some(2));
        assert_eq!(caller.one_more(begun + ONE_MORE_AFTER), None);
    }

    #[test]
    fn a_day_of_refusals_is_a_thousand_entries_that_count_all_others() {
        let begun = Instant::now();
        let mut caller = InVain::none(begun);
        let (mut entries, mut counted) = (0_u64, 0);
        let day = Duration::from_hours(24);
        let requests = day.as_secs() * 2;
        for request in 0..requests {
            let at = begun + Duration::from_millis(500 * request);
            if let Some(left_out) = caller.one_more(at) {
                entries += 1;
                counted += left_out + 1;
            }
        }
        assert!(entries <= u64::from(AT_ONCE) + 960, "{entries}");
        assert_eq!(counted + caller.left_out, requests);
    }
}
