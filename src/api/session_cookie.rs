//! The cookie of a session, and what a page of this server brings beside it.

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use axum::response::Response;

use super::error::{Kind, Problem};
use crate::access::Secret;

/// Where a session is begun, shown and ended.
pub(super) const PATH: &str = "/v1/session";
/// The cookie.
const COOKIE: &str = "greybox_session";
/// What a changing request brings beside it.
const CSRF_TOKEN: HeaderName = HeaderName::from_static("x-csrf-token");
/// The secret of the session that a request brings.
pub(super) fn cookie(headers: &HeaderMap) -> Option<Secret> {
    let all = headers.get_all(header::COOKIE).iter();
    let pairs = all
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(';'));
    let mut secrets = pairs.filter_map(|pair| {
        let (name, value) = pair.trim().split_once('=')?;
        (name == COOKIE).then(|| value.parse().ok())?
    });
    secrets.next()
}

/// Whether a request brings what belongs to its session.
pub(super) fn brings_csrf_token(headers: &HeaderMap) -> bool {
    let expected = cookie(headers).map(|secret| secret.csrf_token());
    let brought = headers
        .get(CSRF_TOKEN)
        .and_then(|value| value.to_str().ok());
    expected.is_some() && brought == expected.as_deref()
}

/// The refusal of one that does not.
pub(super) fn no_csrf_token() -> Problem {
    let detail = "a session's request that changes something brings the header `X-CSRF-Token`, which \
                  `GET /v1/session` tells";
    Problem::new(Kind::Forbidden, detail)
}

/// Has a browser keep a cookie for so long.
pub(super) fn set_cookie(response: &mut Response, value: &str, life_s: i64, is_secure: bool) {
    let secure = if is_secure { "; Secure" } else { "" };
    let cookie =
        format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Strict; Max-Age={life_s}{secure}");
    let cookie = HeaderValue::from_str(&cookie).expect("a secret is visible ASCII");
    let headers = response.headers_mut();
    headers.insert(header::SET_COOKIE, cookie);
    let no_store = HeaderValue::from_static("no-store");
    headers.insert(header::CACHE_CONTROL, no_store);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cookie_is_found_among_others() {
        let secret = Secret::new().expect("random bytes");
        let text = format!("a=b; {COOKIE}={}; c", secret.expose());
        let mut headers = HeaderMap::new();
        headers.insert(header::COOKIE, text.parse().unwrap());
        let found = cookie(&headers).expect("a cookie");
        assert_eq!(found.expose(), secret.expose());
        assert!(!brings_csrf_token(&headers));
        headers.insert(
            CSRF_TOKEN,
            secret.session_digest().as_str().parse().unwrap(),
        );
        assert!(!brings_csrf_token(&headers));
        headers.insert(CSRF_TOKEN, secret.csrf_token().parse().unwrap());
        assert!(brings_csrf_token(&headers));
        headers.insert(header::COOKIE, "greybox_session=x".parse().unwrap());
        assert!(cookie(&headers).is_none());
        assert!(!brings_csrf_token(&headers));
    }
}
