//! The protocols that collecting agents speak: how a server of each says what went wrong.
//!
//! Agents decide by the status whether they send again. Telegraf drops what InfluxDB 1 answers with any 4xx but
//! an unknown database, so that whatever may pass later is a 503 there, and so it is for the Open Message Format (OMF). Sources: InfluxData,
//! *InfluxDB API reference*, versions 1.8 and 2.7; AVEVA, *OMF with PI Web API*, 2025, for the form of answers.

use axum::body::Body;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::Response;
use serde_json::json;

use super::omf_answer::OmfAnswer;
use crate::api::error::{Kind, Problem};

/// The version that agents are told, whose protocol is spoken.
pub(in crate::api) const VERSION: &str = "1.8.10";
/// The header that says which version answers.
const VERSION_HEADER: HeaderName = HeaderName::from_static("x-influxdb-version");
/// The header that says whose build answers.
const BUILD_HEADER: HeaderName = HeaderName::from_static("x-influxdb-build");
/// The header in which InfluxDB 1 repeats its error.
const ERROR_HEADER: HeaderName = HeaderName::from_static("x-influxdb-error");
/// The header in which InfluxDB 2 repeats the code of its error.
const CODE_HEADER: HeaderName = HeaderName::from_static("x-platform-error-code");
/// The characters of an error that a header repeats.
const HEADER_CHARACTERS: usize = 1024;
/// When an agent may send again where nothing says better `[s]`.
const RETRY_S: u32 = 10;
/// When an agent may send again whose project has as much as it may `[s]`.
const QUOTA_RETRY_S: u32 = 60;

/// A mark of an answer that has its form already, although it is an error.
#[derive(Clone, Copy)]
pub(in crate::api) struct IsWhole;

/// A protocol in which lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::api) enum Protocol {
    /// InfluxDB 1: `POST /write`.
    Influx1,
    /// InfluxDB 2: `POST /api/v2/write`.
    Influx2,
    /// The Open Message Format: `POST /omf` and `POST /omf/{name}`.
    Omf,
}

impl Protocol {
    /// The protocol that is spoken at a path.
    pub(in crate::api) fn of_path(path: &str) -> Option<Self> {
        match path {
            "/write" => Some(Self::Influx1),
            "/api/v2/write" => Some(Self::Influx2),
            "/omf" => Some(Self::Omf),
            path if path.starts_with("/omf/") => Some(Self::Omf),
            _ => None,
        }
    }

    /// The problem of a database or bucket that there is no mapping for.
    pub(super) fn unknown_target(self, name: &str) -> Problem {
        let name: String = name.chars().take(100).collect();
        let detail = match self {
            Self::Influx1 => format!("database not found: \"{name}\""),
            Self::Influx2 => format!("bucket \"{name}\" not found"),
            Self::Omf => format!("there is no mapping called \"{name}\""),
        };
        Problem::new(Kind::NotFound, detail)
    }

    /// The answer to a request that was not served, as a server of the protocol gives it.
    pub(in crate::api) fn refusal(self, problem: Problem) -> Response {
        let (kind, detail, headers) = problem.into_parts();
        let status = self.status(kind);
        let message = match (self, status) {
            (Self::Influx1, StatusCode::UNAUTHORIZED) => format!("authorization failed: {detail}"),
            (Self::Influx2, StatusCode::UNAUTHORIZED) => format!("unauthorized access: {detail}"),
            _ => detail,
        };
        let body = match self {
            Self::Influx1 => json!({ "error": message }),
            Self::Influx2 => json!({ "code": code(status), "message": message }),
            Self::Omf => json!(OmfAnswer::refusal(status, message.clone())),
        };
        let mut response = Response::new(Body::from(format!("{body}\n")));
        *response.status_mut() = status;
        let answered = response.headers_mut();
        answered.extend(headers);
        let application_json = HeaderValue::from_static("application/json");
        answered.insert(header::CONTENT_TYPE, application_json);
        match self {
            Self::Influx1 => {
                let text: String = message.chars().take(HEADER_CHARACTERS).collect();
                let text = text.replace(|c: char| !c.is_ascii_graphic(), " ");
                let text = HeaderValue::from_str(&text).expect("visible ASCII with spaces");
                answered.insert(ERROR_HEADER, text);
            }
            Self::Influx2 => {
                answered.insert(CODE_HEADER, HeaderValue::from_static(code(status)));
            }
            Self::Omf => {}
        }
        if status == StatusCode::UNAUTHORIZED && self != Self::Influx2 {
            let basic = HeaderValue::from_static("Basic realm=\"greybox\"");
            answered.insert(header::WWW_AUTHENTICATE, basic);
        }
        let comes_again = matches!(
            status,
            StatusCode::TOO_MANY_REQUESTS | StatusCode::SERVICE_UNAVAILABLE
        );
        if comes_again && !answered.contains_key(header::RETRY_AFTER) {
            let seconds = match kind {
                Kind::Quota => QUOTA_RETRY_S,
                _ => RETRY_S,
            };
            answered.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if self != Self::Omf {
            name_version(answered);
        }
        response
    }

    /// The status that a server of the protocol answers with.
    fn status(self, kind: Kind) -> StatusCode {
        match kind {
            Kind::Invalid | Kind::KeyReused | Kind::WrongState => StatusCode::BAD_REQUEST,
            Kind::RequestTimeout | Kind::NoRoom => StatusCode::SERVICE_UNAVAILABLE,
            Kind::TooMany | Kind::Quota if self != Self::Influx2 => StatusCode::SERVICE_UNAVAILABLE,
            kind => kind.status(),
        }
    }
}

/// The code of InfluxDB 2 for a status.
fn code(status: StatusCode) -> &'static str {
    match status.as_u16() {
        400 => "invalid",
        401 => "unauthorized",
        403 => "forbidden",
        404 => "not found",
        405 => "method not allowed",
        413 => "request too large",
        429 => "too many requests",
        503 => "unavailable",
        500.. => "internal error",
        _ => "invalid",
    }
}

/// Says which version answers.
pub(super) fn name_version(headers: &mut HeaderMap) {
    headers.insert(VERSION_HEADER, HeaderValue::from_static(VERSION));
    headers.insert(BUILD_HEADER, HeaderValue::from_static("greybox"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_pass_later_is_never_what_an_agent_drops() {
        for (kind, first, second) in [
            (Kind::Malformed, 400, 400),
            (Kind::Invalid, 400, 400),
            (Kind::Unauthorised, 401, 401),
            (Kind::NotFound, 404, 404),
            (Kind::TooLarge, 413, 413),
            (Kind::Quota, 503, 429),
            (Kind::TooMany, 503, 429),
            (Kind::RequestTimeout, 503, 503),
            (Kind::NoRoom, 503, 503),
            (Kind::Busy, 503, 503),
            (Kind::Internal, 500, 500),
        ] {
            for (protocol, status) in [
                (Protocol::Influx1, first),
                (Protocol::Influx2, second),
                (Protocol::Omf, first),
            ] {
                let refusal = protocol.refusal(Problem::new(kind, "why\nso"));
                assert_eq!(refusal.status(), status, "{kind:?}");
                let comes_again = matches!(status, 429 | 503);
                let has_time = refusal.headers().contains_key(header::RETRY_AFTER);
                assert_eq!(has_time, comes_again, "{kind:?}");
            }
        }
    }
}
