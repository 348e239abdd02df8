//! Lets a request on that its caller may ask, and ends a stream whose reader may ask no more.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;

use super::access::Callers;
use super::admission::as_caller;
use super::client::PeerAddress;
use super::error::{Kind, Problem};
use super::events::EVENT_STREAM;
use super::session_cookie;
use super::sinks::credentials;
use super::sinks::protocol::Protocol;
use crate::access::Scope;

/// How often it is looked whether the reader of a stream may still ask.
const LOOKED_AGAIN: Duration = Duration::from_secs(2);

/// What a request takes; nothing where everybody may ask.
fn needed(method: &Method, path: &str) -> Option<Scope> {
    let looks = matches!(*method, Method::GET | Method::HEAD);
    let below = |place: &str| {
        let rest = path.strip_prefix(place);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    if path == "/metrics" {
        Some(Scope::Read)
    } else if Protocol::of_path(path).is_some()
        || (*method == Method::POST && is_stream(path))
        || (*method == Method::PUT && below("/v1/sources"))
    {
        Some(Scope::Append)
    } else if !below("/v1")
        || (path == session_cookie::PATH && *method == Method::POST)
        || [session_cookie::PROVIDER, session_cookie::CALLBACK].contains(&path)
    {
        None
    } else if path == session_cookie::PATH {
        Some(Scope::Read)
    } else if ["/v1/audit", "/v1/webhooks", "/v1/deliveries"]
        .into_iter()
        .any(below)
    {
        Some(Scope::Admin)
    } else if looks {
        Some(Scope::Read)
    } else {
        Some(Scope::Submit)
    }
}

/// Whether a path names a stream, and not a part of one.
fn is_stream(path: &str) -> bool {
    let name = path.strip_prefix("/v1/streams/");
    name.is_some_and(|name| !name.is_empty() && !name.contains('/'))
}

/// Lets a request on whose caller is known and may ask it; notes who that is, for the handlers and
/// for the log.
pub(super) async fn authorise(
    State(callers): State<Arc<Callers>>,
    mut request: Request,
    next: Next,
) -> Response {
    let Some(needed) = needed(request.method(), request.uri().path()) else {
        return next.run(request).await;
    };
    credentials::as_bearer(&mut request);
    let peer = request.extensions().get::<PeerAddress>().copied();
    let client = callers.client(peer, request.headers()).await;
    let client = match client {
        Ok(client) => client,
        Err(problem) => {
            callers.count_guess(peer).await;
            return callers.with_way_in(problem).into_response();
        }
    };
    let forgeable = client.has_session && !matches!(*request.method(), Method::GET | Method::HEAD);
    let counted = match client.is_known {
        true => Some(callers.requests.count(&client.who).await),
        false => None,
    };
    let mut response = match counted.transpose() {
        Err(problem) => problem.into_response(),
        Ok(_) if forgeable && !session_cookie::brings_csrf_token(request.headers()) => {
            session_cookie::no_csrf_token().into_response()
        }
        Ok(_) if !client.scope.holds(needed) => {
            let detail = format!(
                "this takes the scope `{needed}`; yours is `{}`",
                client.scope
            );
            Problem::new(Kind::Forbidden, detail).into_response()
        }
        Ok(counted) => {
            request.extensions_mut().insert(client.clone());
            let who = match client.is_known {
                true => &client.who,
                false => &client.address,
            };
            let headers = request.headers().clone();
            let response = as_caller(who, next.run(request)).await;
            match counted {
                Some(under_way) => {
                    let response = until_refused(response, callers, peer, headers);
                    under_way.until_the_end_of(response)
                }
                None => response,
            }
        }
    };
    response.extensions_mut().insert(client);
    response
}

/// The answer, which ends if it is a stream of events and whoever asked for it may ask no more.
fn until_refused(
    answer: Response,
    callers: Arc<Callers>,
    peer: Option<PeerAddress>,
    headers: HeaderMap,
) -> Response {
    let kind = answer.headers().get(header::CONTENT_TYPE);
    if kind.is_none_or(|kind| kind != EVENT_STREAM) {
        return answer;
    }
    let refused = async move {
        loop {
            tokio::time::sleep(LOOKED_AGAIN).await;
            let client = callers.client(peer, &headers).await;
            let kind = client.err().map(|problem| problem.kind());
            if let Some(Kind::Unauthorised | Kind::Forbidden) = kind {
                return;
            }
        }
    };
    answer.map(|body| Body::from_stream(body.into_data_stream().take_until(Box::pin(refused))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_needed_goes_by_the_path_and_the_method() {
        for (method, path, expected) in [
            (Method::GET, "/livez", None),
            (Method::GET, "/openapi.json", None),
            (Method::GET, "/metrics", Some(Scope::Read)),
            (Method::GET, "/v1/jobs", Some(Scope::Read)),
            (Method::HEAD, "/v1/jobs", Some(Scope::Read)),
            (Method::POST, "/v1/jobs", Some(Scope::Submit)),
            (Method::DELETE, "/v1/jobs/x", Some(Scope::Submit)),
            (Method::OPTIONS, "/v1/anything", Some(Scope::Submit)),
            (Method::GET, "/v1/audit", Some(Scope::Admin)),
            (Method::POST, "/write", Some(Scope::Append)),
            (Method::POST, "/api/v2/write", Some(Scope::Append)),
            (Method::GET, "/ping", None),
            (Method::GET, "/health", None),
            (Method::POST, "/v1/streams/rig-4", Some(Scope::Append)),
            (Method::PUT, "/v1/sources/hall", Some(Scope::Append)),
            (Method::DELETE, "/v1/sources/hall", Some(Scope::Submit)),
            (Method::GET, "/v1/sources", Some(Scope::Read)),
            (Method::GET, "/v1/streams/rig-4", Some(Scope::Read)),
            (Method::DELETE, "/v1/streams/rig-4", Some(Scope::Submit)),
            (
                Method::POST,
                "/v1/streams/rig-4/recordings",
                Some(Scope::Submit),
            ),
            (Method::PUT, "/v1/mappings/plant", Some(Scope::Submit)),
            (Method::POST, "/v1/session", None),
            (Method::GET, "/v1/session/provider", None),
            (Method::GET, "/v1/session/callback", None),
            (Method::GET, "/v1/session/else", Some(Scope::Read)),
            (Method::GET, "/v1/session", Some(Scope::Read)),
            (Method::DELETE, "/v1/session", Some(Scope::Read)),
            (Method::GET, "/v1/webhooks/x/deliveries", Some(Scope::Admin)),
        ] {
            assert_eq!(needed(&method, path), expected, "{method} {path}");
        }
    }
}
