//! Every answer that is not a success: one RFC 9457 problem document.
//!
//! A handler returns a [`Problem`]; the outermost layer ([`super::with_middleware()`]) turns it, and every bare
//! error status that the framework made, into the document with the path and the request's id.

use axum::body::Body;
use axum::http::{Extensions, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::problem_page;
use crate::job::IllegalTransition;
use greybox::parsing::Fault;
use std::sync::Arc;

use crate::store::{Meaning, QuotaExceeded, StoreError};

/// The faults that one answer tells at the most; the rest are counted.
const MAX_FAULTS: usize = 100;

/// What kind of problem, as the `type` of the document names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The body is not what its content type says.
    Malformed,
    /// Nothing is there.
    NotFound,
    /// The resource does not know the method.
    MethodNotAllowed,
    /// The body came too slowly.
    RequestTimeout,
    /// The resource is not in a state for that.
    WrongState,
    /// The body is larger than allowed.
    TooLarge,
    /// The body is of a type or encoding that is not understood.
    UnsupportedMediaType,
    /// The request was understood but is wrong.
    Invalid,
    /// The idempotency key was used with another body.
    KeyReused,
    /// Too much at once.
    Busy,
    /// There is no room to store it.
    NoRoom,
    /// The request is for a server of another name.
    WrongHost,
    /// The request comes from a page of another site.
    WrongOrigin,
    /// The request does not say who asks, or wrongly.
    Unauthorised,
    /// The caller may not do that.
    Forbidden,
    /// The caller asks too much at once.
    TooMany,
    /// The project has as much as it may.
    Quota,
    /// The headers are more or longer than any request needs.
    HeadersTooLarge,
    /// The path is longer than any that names something.
    PathTooLong,
    /// Stored data are not what was written.
    DamagedData,
    /// The server failed.
    Internal,
    /// Another error status, made by the framework.
    Other(StatusCode),
}

impl Kind {
    pub(super) fn status(self) -> StatusCode {
        match self {
            Kind::Malformed => StatusCode::BAD_REQUEST,
            Kind::NotFound => StatusCode::NOT_FOUND,
            Kind::MethodNotAllowed => StatusCode::METHOD_NOT_ALLOWED,
            Kind::RequestTimeout => StatusCode::REQUEST_TIMEOUT,
            Kind::WrongState => StatusCode::CONFLICT,
            Kind::TooLarge => StatusCode::PAYLOAD_TOO_LARGE,
            Kind::UnsupportedMediaType => StatusCode::UNSUPPORTED_MEDIA_TYPE,
            Kind::Invalid | Kind::KeyReused => StatusCode::UNPROCESSABLE_ENTITY,
            // The server is at fault and not the caller, and the same request is served once what is stored was
            // brought back.
            Kind::Busy | Kind::DamagedData => StatusCode::SERVICE_UNAVAILABLE,
            Kind::NoRoom => StatusCode::INSUFFICIENT_STORAGE,
            Kind::WrongHost => StatusCode::MISDIRECTED_REQUEST,
            Kind::WrongOrigin => StatusCode::FORBIDDEN,
            Kind::Unauthorised => StatusCode::UNAUTHORIZED,
            Kind::Forbidden => StatusCode::FORBIDDEN,
            Kind::TooMany | Kind::Quota => StatusCode::TOO_MANY_REQUESTS,
            Kind::HeadersTooLarge => StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE,
            Kind::PathTooLong => StatusCode::URI_TOO_LONG,
            Kind::Internal => StatusCode::INTERNAL_SERVER_ERROR,
            Kind::Other(status) => status,
        }
    }

    /// The `type` of the document.
    pub(super) fn uri(self) -> &'static str {
        match self {
            Kind::Malformed => "/problems/malformed",
            Kind::NotFound => "/problems/not-found",
            Kind::MethodNotAllowed => "/problems/method-not-allowed",
            Kind::RequestTimeout => "/problems/request-timeout",
            Kind::WrongState => "/problems/wrong-state",
            Kind::TooLarge => "/problems/too-large",
            Kind::UnsupportedMediaType => "/problems/unsupported-media-type",
            Kind::Invalid => "/problems/invalid",
            Kind::KeyReused => "/problems/idempotency-key-reused",
            Kind::Busy => "/problems/busy",
            Kind::NoRoom => "/problems/no-room",
            Kind::WrongHost => "/problems/wrong-host",
            Kind::WrongOrigin => "/problems/wrong-origin",
            Kind::Unauthorised => "/problems/unauthorised",
            Kind::Forbidden => "/problems/forbidden",
            Kind::TooMany => "/problems/too-many-requests",
            Kind::Quota => "/problems/quota",
            Kind::HeadersTooLarge => "/problems/headers-too-large",
            Kind::PathTooLong => "/problems/path-too-long",
            Kind::DamagedData => "/problems/damaged-data",
            Kind::Internal => "/problems/internal",
            Kind::Other(_) => "about:blank",
        }
    }

    /// Counts a refusal of this kind.
    fn count(self) {
        let reason = self.uri().trim_start_matches("/problems/");
        metrics::counter!("greybox_rejected_total", "reason" => reason).increment(1);
    }

    fn title(self) -> &'static str {
        match self {
            Kind::Malformed => "The body cannot be read",
            Kind::NotFound => "There is no such thing here",
            Kind::MethodNotAllowed => "The method is not allowed here",
            Kind::RequestTimeout => "The body came too slowly",
            Kind::WrongState => "The state does not allow that",
            Kind::TooLarge => "The body is too large",
            Kind::UnsupportedMediaType => "The body's type is not understood",
            Kind::Invalid => "The request is wrong",
            Kind::KeyReused => "The idempotency key was used before with another body",
            Kind::Busy => "The server is busy",
            Kind::NoRoom => "The disk is full",
            Kind::WrongHost => "This server has another name",
            Kind::WrongOrigin => "Pages of other sites may not ask this server",
            Kind::Unauthorised => "It is not known who asks",
            Kind::Forbidden => "The caller may not do that",
            Kind::TooMany => "The caller asks too much at once",
            Kind::Quota => "The project has as much as it may",
            Kind::HeadersTooLarge => "The headers are too large",
            Kind::PathTooLong => "The path is too long",
            Kind::DamagedData => "What is stored is damaged",
            Kind::Internal => "The server failed",
            Kind::Other(status) => status.canonical_reason().unwrap_or("Error"),
        }
    }

    fn of_status(status: StatusCode) -> Self {
        match status.as_u16() {
            400 => Kind::Malformed,
            404 => Kind::NotFound,
            405 => Kind::MethodNotAllowed,
            408 => Kind::RequestTimeout,
            413 => Kind::TooLarge,
            414 => Kind::PathTooLong,
            415 => Kind::UnsupportedMediaType,
            422 => Kind::Invalid,
            500 => Kind::Internal,
            503 => Kind::Busy,
            _ => Kind::Other(status),
        }
    }
}

/// A request that was not served, and why.
#[derive(Clone, Debug)]
pub struct Problem {
    kind: Kind,
    detail: String,
    errors: Vec<Fault>,
    headers: Vec<(HeaderName, HeaderValue)>,
    damage: Option<Arc<StoreError>>,
    /// Notes for the layers around the handlers, which the answer carries.
    notes: Extensions,
}

/// What a handler answers.
pub type Answer<T = Response> = Result<T, Problem>;

impl Problem {
    /// A problem without single faults.
    pub fn new(kind: Kind, detail: impl Into<String>) -> Self {
        Self {
            kind,
            detail: detail.into(),
            errors: Vec::new(),
            headers: Vec::new(),
            damage: None,
            notes: Extensions::new(),
        }
    }

    /// A problem that lists its faults.
    pub fn of_faults(kind: Kind, faults: impl IntoIterator<Item = Fault>) -> Self {
        let mut errors: Vec<Fault> = faults.into_iter().collect();
        let detail = match errors.as_slice() {
            [] => "something is wrong".to_owned(),
            [fault] => fault.to_string(),
            [first, rest @ ..] => format!("{first} (and {} more)", rest.len()),
        };
        errors.truncate(MAX_FAULTS);
        Self {
            errors,
            ..Self::new(kind, detail)
        }
    }

    /// The document of a job is wrong.
    pub fn of_document(faults: Vec<Fault>) -> Self {
        Self::of_faults(Kind::Invalid, faults)
    }

    /// There is no `what` of that name.
    pub fn not_found(what: &str, name: &str) -> Self {
        /// Longer names are cut in the sentence.
        const LONGEST: usize = 80;
        let name: String = name.chars().take(LONGEST).collect();
        Self::new(Kind::NotFound, format!("there is no {what} `{name}`"))
    }

    /// The error that tells of the damage, where the problem is one of damage.
    pub fn damage(&self) -> Option<&StoreError> {
        self.damage.as_deref()
    }

    /// What kind of problem it is.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The body is larger than `limit` bytes.
    pub fn too_large(limit: u64) -> Self {
        let detail = format!("the body has more than {limit} bytes, the limit here");
        Self::new(Kind::TooLarge, detail)
    }

    /// Adds what the client can do instead, where a body is too large.
    pub fn or_instead(mut self, remedy: &str) -> Self {
        if self.kind == Kind::TooLarge {
            self.detail = format!("{}; {remedy}", self.detail);
        }
        self
    }

    /// The client may try again after so many seconds.
    pub fn retry_after(self, seconds: u32) -> Self {
        self.with_header(header::RETRY_AFTER, HeaderValue::from(seconds))
    }

    /// Puts `parent`, the place of the document in the body, before the pointer of each fault.
    pub fn below(mut self, parent: &str) -> Self {
        let faults = self.errors.into_iter();
        self.errors = faults.map(|fault| fault.below(parent)).collect();
        self
    }

    /// Adds a header to the answer.
    pub fn with_header(mut self, name: HeaderName, value: HeaderValue) -> Self {
        self.headers.push((name, value));
        self
    }

    /// The problem with a note for the layers around the handlers.
    pub(super) fn with_note<T: Clone + Send + Sync + 'static>(mut self, note: T) -> Self {
        self.notes.insert(note);
        self
    }

    /// The server is going down.
    pub fn shutting_down() -> Self {
        Self::new(Kind::Busy, "the server is shutting down").retry_after(2)
    }

    /// What the failure of the store means to a client. Nothing of it was stored, and the same
    /// request may be sent again.
    pub fn of_meaning(meaning: Meaning) -> Self {
        match meaning {
            Meaning::ShuttingDown => Self::shutting_down(),
            Meaning::NoText => Self::new(Kind::Invalid, "a text has a NUL character"),
            Meaning::NoRoom => {
                let detail = "the disk of the server is full: nothing can be stored until there \
                              is room";
                Self::new(Kind::NoRoom, detail).retry_after(5)
            }
            Meaning::Unavailable => {
                let detail = "the server's database cannot be written just now";
                Self::new(Kind::Busy, detail).retry_after(5)
            }
            Meaning::Damaged => Self::new(Kind::DamagedData, "the server's database is damaged"),
            Meaning::Fault => Self::of_status(StatusCode::INTERNAL_SERVER_ERROR),
        }
    }

    /// What a bare error status of the framework means.
    pub fn of_status(status: StatusCode) -> Self {
        let kind = Kind::of_status(status);
        let detail = match kind {
            Kind::NotFound => "no resource has this path",
            Kind::MethodNotAllowed => "the header `Allow` lists the methods of this resource",
            Kind::UnsupportedMediaType => {
                "the body's encoding is not understood; the header `Accept-Encoding` lists those \
                 that are"
            }
            Kind::Internal => "the failure was logged under the request's id",
            kind => kind.title(),
        };
        Self::new(kind, detail)
    }

    /// The kind, the sentence and the headers, for an answer in another form; the refusal is counted.
    pub(super) fn into_parts(self) -> (Kind, String, Vec<(HeaderName, HeaderValue)>) {
        self.kind.count();
        (self.kind, self.detail, self.headers)
    }

    /// The document, as the answer to the request to `instance`.
    pub fn document(self, instance: &str, request_id: &str) -> Response {
        let document = ProblemDocument {
            kind: self.kind.uri(),
            title: self.kind.title(),
            status: self.kind.status().as_u16(),
            detail: self.detail.clone(),
            instance: instance.to_owned(),
            errors: self.errors.clone(),
            request_id: request_id.to_owned(),
        };
        let body = serde_json::to_vec(&document).expect("a problem has only text keys");
        let kind = HeaderValue::from_static(PROBLEM_JSON);
        self.answer(kind, Body::from(body))
    }

    /// The problem as a page that a person reads.
    pub fn page(self, request_id: &str) -> Response {
        let faults = self.errors.iter().map(ToString::to_string);
        let page = problem_page::page(self.kind.title(), &self.detail, faults, request_id);
        let kind = HeaderValue::from_static("text/html; charset=utf-8");
        let mut response = self.answer(kind, Body::from(page));
        let policy = HeaderValue::from_static(problem_page::POLICY);
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
        response
    }

    /// The answer with a body; the refusal is counted.
    fn answer(self, kind: HeaderValue, body: Body) -> Response {
        self.kind.count();
        let mut response = Response::new(body);
        *response.status_mut() = self.kind.status();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, kind);
        for (name, value) in self.headers {
            headers.insert(name, value);
        }
        response
    }
}

/// The media type of a problem document.
pub const PROBLEM_JSON: &str = "application/problem+json";

impl IntoResponse for Problem {
    /// A bare status that carries the problem to the outermost layer.
    fn into_response(self) -> Response {
        let mut response = self.kind.status().into_response();
        response.extensions_mut().extend(self.notes.clone());
        response.extensions_mut().insert(self);
        response
    }
}

impl From<QuotaExceeded> for Problem {
    fn from(exceeded: QuotaExceeded) -> Self {
        let problem = Self::new(Kind::Quota, exceeded.to_string());
        match exceeded.retry_after(Timestamp::now()) {
            None => problem,
            Some(wait) => problem.retry_after(wait.as_secs() as u32 + 1),
        }
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        if let StoreError::Quota(exceeded) = error {
            return exceeded.into();
        }
        let meaning = error.meaning();
        if meaning != Meaning::ShuttingDown {
            tracing::error!(%error, "the store failed while a request was served");
        }
        let problem = Self::of_meaning(meaning);
        if meaning != Meaning::Damaged {
            return problem;
        }
        let detail = match error.corrupt_row() {
            Some(_) => error.to_string(),
            None => problem.detail,
        };
        Self {
            detail,
            damage: Some(Arc::new(error)),
            ..problem
        }
    }
}

impl From<IllegalTransition> for Problem {
    fn from(illegal: IllegalTransition) -> Self {
        Self::new(Kind::WrongState, illegal.to_string())
    }
}

/// RFC 9457 problem details.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Problem)]
pub struct ProblemDocument {
    /// What kind of problem, for programs.
    #[serde(rename = "type")]
    #[schema(value_type = String, example = "/problems/invalid")]
    kind: &'static str,
    /// What kind of problem, for people.
    #[schema(value_type = String, example = "The request is wrong")]
    title: &'static str,
    /// The status of the answer.
    #[schema(minimum = 400, maximum = 599, example = 422)]
    status: u16,
    /// What is wrong with this request.
    detail: String,
    /// The path of the request.
    #[schema(example = "/v1/jobs")]
    instance: String,
    /// Each single fault; empty where there is only the one that `detail` tells.
    errors: Vec<Fault>,
    /// The `X-Request-Id` of the answer, under which the server logged it.
    request_id: String,
}
