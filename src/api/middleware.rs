//! What every answer has, whoever made it: a request id, a log line, a problem document where it
//! is an error, gzip where the client takes it.

use std::any::Any;
use std::sync::Arc;
use std::time::Instant;

use axum::Router;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::decompression::RequestDecompressionLayer;
use tracing::Instrument as _;
use uuid::Uuid;

use super::audit::{ActedOn, AnsweredRequest, Audit};
use super::background::BackgroundTasks;
use super::client::{Client, PeerAddress};
use super::error::{PROBLEM_JSON, Problem};
use super::http_headers::{GZIP_TAG_END, prefers};
use super::origin::{self, Names};
use super::sinks::protocol::{IsWhole, Protocol};
use super::unpacking;
use super::unread_body::UnreadBody;
use crate::span;

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
/// The characters of a client's request id at the most; a longer one is replaced.
const MAX_ID_CHARS: usize = 128;
/// A browser takes the type of an answer from its header and does not guess another from its bytes.
const NO_GUESSED_TYPE: HeaderValue = HeaderValue::from_static("nosniff");
/// The connection ends after the answer.
const CLOSES: HeaderValue = HeaderValue::from_static("close");
/// A browser that was answered over TLS asks this server over TLS alone, for a year.
const TLS_ALONE: HeaderValue = HeaderValue::from_static("max-age=31536000");

/// What stands around the routes.
#[derive(Clone, Default)]
pub struct Around {
    /// The names by which the server may be asked.
    pub names: Arc<Names>,
    /// The log of who did what.
    pub audit: Option<Audit>,
    /// Whether the server speaks TLS, so that browsers are told to ask in no other way.
    pub speaks_tls: bool,
}

/// Puts what every answer shares around routes. Unknown paths and methods get it too.
pub fn with_middleware(routes: Router, around: Around) -> Router {
    let outermost = Outermost {
        audit: around.audit,
        speaks_tls: around.speaks_tls,
    };
    let unpackers = BackgroundTasks::new("unpack");
    routes
        .fallback(|| async { StatusCode::NOT_FOUND })
        .layer(from_fn_with_state(around.names, origin::check))
        .layer(from_fn_with_state(unpackers, unpacking::bound))
        .layer(RequestDecompressionLayer::new())
        .layer(from_fn(unpacking::count))
        .layer(CatchPanicLayer::custom(panicked))
        .layer(CompressionLayer::new())
        .layer(from_fn_with_state(outermost, answer))
}

fn panicked(panic: Box<dyn Any + Send + 'static>) -> Response {
    let message = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    metrics::counter!("greybox_panics_total").increment(1);
    tracing::error!(message, "a handler panicked");
    StatusCode::INTERNAL_SERVER_ERROR.into_response()
}

/// The settings of the outermost layer.
#[derive(Clone)]
struct Outermost {
    audit: Option<Audit>,
    speaks_tls: bool,
}

/// The outermost layer.
async fn answer(State(outermost): State<Outermost>, request: Request, next: Next) -> Response {
    let begun = Instant::now();
    let id = request_id(request.headers());
    let path = request.uri().path().to_owned();
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().cloned();
    let address = request.extensions().get::<PeerAddress>();
    let address = address.map_or_else(String::new, PeerAddress::to_text);
    let span = {
        let route = route.as_ref().map_or("", MatchedPath::as_str);
        span::request(&method, route, (&path, &id), request.headers())
    };
    let as_page = method == Method::GET && prefers(request.headers(), "text/html");
    let (request, unread) = UnreadBody::of(request);
    let mut response = next.run(request).instrument(span.clone()).await;
    let client = response.extensions_mut().remove::<Client>();
    let acted_on = response.extensions_mut().remove::<ActedOn>();
    let mut response = with_problem(response, &path, &id, as_page);
    mark_compressed(response.headers_mut());
    let value = HeaderValue::from_str(&id).expect("the id was checked or made here");
    response.headers_mut().insert(REQUEST_ID, value);
    protect(response.headers_mut(), outermost.speaks_tls);
    if unread.is_left() && response.status().as_u16() >= 400 {
        response.headers_mut().insert(header::CONNECTION, CLOSES);
    }

    let status = response.status().as_u16();
    span::answered(&span, status);
    let duration_s = begun.elapsed().as_secs_f64();
    let duration_ms = duration_s * 1e3;
    let who = client.as_ref().map_or("unknown", |client| &client.who);
    tracing::info!(%method, path, status, duration_ms, who, request_id = id, "answered");
    if let Some(audit) = outermost.audit {
        let asked = AnsweredRequest {
            client,
            address,
            method: &method,
            path: acted_on.as_ref().map_or(&path, |ActedOn(text)| text),
            status,
            request_id: &id,
        };
        audit.note(asked).await;
    }
    let route = route.map_or_else(|| "none".to_owned(), |route| route.as_str().to_owned());
    let labels = [
        ("method", known(&method).to_owned()),
        ("route", route),
        ("status", status.to_string()),
    ];
    metrics::counter!("greybox_http_requests_total", &labels).increment(1);
    metrics::histogram!("greybox_http_request_duration_seconds", &labels).record(duration_s);
    response
}

/// Tells browsers not to guess the type of an answer, and to keep to TLS where the server speaks TLS.
fn protect(headers: &mut HeaderMap, speaks_tls: bool) {
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, NO_GUESSED_TYPE);
    if speaks_tls {
        headers.insert(header::STRICT_TRANSPORT_SECURITY, TLS_ALONE);
    }
}

/// A method as it is counted. Clients may invent others; those count as one.
fn known(method: &Method) -> &'static str {
    const KNOWN: [Method; 7] = [
        Method::GET,
        Method::HEAD,
        Method::POST,
        Method::PUT,
        Method::PATCH,
        Method::DELETE,
        Method::OPTIONS,
    ];
    const NAMES: [&str; 7] = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"];
    let place = KNOWN.iter().position(|name| name == method);
    place.map_or("other", |place| NAMES[place])
}

/// The client's id when it is one line of visible text, else a new one.
fn request_id(headers: &HeaderMap) -> String {
    let given = headers.get(REQUEST_ID).and_then(|id| id.to_str().ok());
    given
        .filter(|id| (1..=MAX_ID_CHARS).contains(&id.len()))
        .map_or_else(|| Uuid::now_v7().to_string(), str::to_owned)
}

/// An error without a problem document gets one, or the form that the protocol of its path has for errors. A browser
/// that goes to a place gets the problem as a page.
fn with_problem(mut response: Response, path: &str, id: &str, as_page: bool) -> Response {
    let status = response.status();
    let is_error = status.is_client_error() || status.is_server_error();
    let is_whole = response.extensions().get::<IsWhole>().is_some();
    if !is_error || is_whole || is_problem(response.headers()) {
        return response;
    }
    let problem = response.extensions_mut().remove::<Problem>();
    let problem = problem.unwrap_or_else(|| Problem::of_status(status));
    let mut document = match Protocol::of_path(path) {
        Some(protocol) => protocol.refusal(problem),
        None if as_page => problem.page(id),
        None => problem.document(path, id),
    };
    for name in [header::ALLOW, header::ACCEPT_ENCODING] {
        if let Some(value) = response.headers_mut().remove(&name) {
            document.headers_mut().insert(name, value);
        }
    }
    document
}

fn is_problem(headers: &HeaderMap) -> bool {
    let content_type = headers.get(header::CONTENT_TYPE);
    content_type.is_some_and(|value| value.as_bytes() == PROBLEM_JSON.as_bytes())
}

/// Compressed bytes are other bytes, so a strong tag must be another one too.
fn mark_compressed(headers: &mut HeaderMap) {
    let Some(tag) = headers.get(header::ETAG).and_then(|tag| tag.to_str().ok()) else {
        return;
    };
    if headers.contains_key(header::CONTENT_ENCODING) && tag.starts_with('"') {
        let marked = format!("{}{GZIP_TAG_END}", tag.trim_end_matches('"'));
        let marked = HeaderValue::from_str(&marked).expect("an addition to a valid value");
        headers.insert(header::ETAG, marked);
    }
}

#[cfg(test)]
mod tests {
    use axum::body::{Body, to_bytes};
    use axum::routing::get;
    use serde_json::Value;
    use tower::util::ServiceExt;

    use super::*;
    use crate::api::error::Kind;

    async fn ask(request: Request) -> (Response<()>, Value) {
        let routes = Router::new()
            .route("/fine", get(|| async { "fine" }))
            .route("/broken", get(|| async { panic!("at the disco") as () }))
            .route("/none", get(|| async { Problem::not_found("job", "x") }));
        let response = with_middleware(routes, Around::default())
            .oneshot(request)
            .await
            .unwrap();
        let (parts, body) = response.into_parts();
        let body = to_bytes(body, 10_000).await.unwrap();
        let json = serde_json::from_slice(&body).unwrap_or(Value::Null);
        (Response::from_parts(parts, ()), json)
    }

    fn get_request(path: &str) -> Request {
        let request = Request::get(path).header("host", "localhost");
        request.body(Body::empty()).unwrap()
    }

    #[tokio::test]
    async fn every_error_is_a_problem_document_with_path_and_request_id() {
        for (request, status, kind) in [
            (get_request("/nowhere"), 404, "/problems/not-found"),
            (get_request("/none"), 404, "/problems/not-found"),
            (get_request("/broken"), 500, "/problems/internal"),
            (
                Request::delete("/fine")
                    .header("host", "localhost")
                    .body(Body::empty())
                    .unwrap(),
                405,
                "/problems/method-not-allowed",
            ),
        ] {
            let path = request.uri().path().to_owned();
            let (response, problem) = ask(request).await;
            assert_eq!(response.status(), status);
            assert_eq!(response.headers()["content-type"], PROBLEM_JSON);
            assert_eq!(problem["type"], kind);
            assert_eq!(problem["status"], status);
            assert_eq!(problem["instance"], path);
            let id = response.headers()["x-request-id"].to_str().unwrap();
            assert_eq!(problem["request_id"], id);
        }
    }

    #[tokio::test]
    async fn a_browser_that_goes_to_a_place_reads_the_problem_as_a_page() {
        let routes = || {
            let cut = async || Problem::new(Kind::WrongState, "the job <b>7</b> is running");
            with_middleware(Router::new().route("/report", get(cut)), Around::default())
        };
        let browser = "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8";
        for (accept, is_page) in [(browser, true), ("*/*", false), ("application/json", false)] {
            let mut request = get_request("/report");
            let accepts = HeaderValue::from_str(accept).unwrap();
            request.headers_mut().insert(header::ACCEPT, accepts);
            let response = routes().oneshot(request).await.unwrap();
            assert_eq!(response.status(), 409);
            let kind = response.headers()[header::CONTENT_TYPE].clone();
            let body = to_bytes(response.into_body(), 10_000).await.unwrap();
            let text = std::str::from_utf8(&body).unwrap();
            assert_eq!(kind == "text/html; charset=utf-8", is_page, "{accept}");
            assert_eq!(
                text.contains("&lt;b&gt;7&lt;/b&gt; is running"),
                is_page,
                "{text}"
            );
        }
    }

    #[tokio::test]
    async fn a_browser_is_told_to_guess_no_type_and_to_keep_to_tls_where_there_is_tls() {
        let fine = Router::new().route("/fine", get(|| async { "fine" }));
        for (speaks_tls, path) in [(false, "/fine"), (true, "/fine"), (true, "/nowhere")] {
            let around = Around {
                speaks_tls,
                ..Around::default()
            };
            let routes = with_middleware(fine.clone(), around);
            let response = routes.oneshot(get_request(path)).await.unwrap();
            let headers = response.headers();
            assert_eq!(headers["x-content-type-options"], "nosniff", "{path}");
            let keeps_to_tls = headers.contains_key("strict-transport-security");
            assert_eq!(keeps_to_tls, speaks_tls, "{path}");
        }
    }

    #[tokio::test]
    async fn a_wrong_method_is_answered_with_the_right_ones() {
        let request = Request::put("/fine").header("host", "localhost");
        let (response, _) = ask(request.body(Body::empty()).unwrap()).await;
        assert_eq!(response.headers()["allow"], "GET,HEAD");
    }

    #[tokio::test]
    async fn an_encoding_that_is_not_understood_is_refused_with_those_that_are() {
        let request = Request::get("/fine")
            .header("host", "localhost")
            .header("content-encoding", "br");
        let (response, problem) = ask(request.body(Body::empty()).unwrap()).await;
        assert_eq!(response.status(), 415);
        assert_eq!(response.headers()["accept-encoding"], "gzip");
        assert_eq!(problem["type"], "/problems/unsupported-media-type");
    }

    #[tokio::test]
    async fn a_request_id_is_echoed_or_made() {
        let id = async |given: &str| {
            let request = Request::get("/fine")
                .header("host", "localhost")
                .header("x-request-id", given);
            let (response, _) = ask(request.body(Body::empty()).unwrap()).await;
            let id = response.headers()["x-request-id"].to_str().unwrap();
            id.to_owned()
        };
        assert_eq!(id("plant-7").await, "plant-7");
        assert_ne!(id("").await, id("").await);
        assert_ne!(id(&"x".repeat(129)).await, "x".repeat(129));
    }
}
