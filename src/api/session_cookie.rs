//! The cookies of a session and of an attempt to sign in, and what a page of this server brings beside a session's.

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};

use super::error::{Kind, Problem};
use crate::access::Secret;

/// Where a session is begun, shown and ended.
pub(super) const PATH: &str = "/v1/session";
/// Where a person goes to sign in at the identity provider.
pub(super) const PROVIDER: &str = "/v1/session/provider";
/// Where the identity provider sends a person back to.
pub const CALLBACK: &str = "/v1/session/callback";
/// What a changing request brings beside the cookie of a session.
const CSRF_TOKEN: HeaderName = HeaderName::from_static("x-csrf-token");

/// A cookie that scripts do not see.
#[derive(Clone, Copy)]
pub(super) struct Cookie {
    name: &'static str,
    path: &'static str,
    /// The requests from pages of other sites that the cookie comes with.
    same_site: &'static str,
}

/// The cookie of a session, which comes with no request that a page of another site makes.
pub(super) const SESSION: Cookie = Cookie {
    name: "greybox_session",
    path: "/",
    same_site: "Strict",
};

/// The cookie of an attempt to sign in. The cookie comes along where the identity provider, which is another site,
/// sends a browser back.
pub(super) const ATTEMPT: Cookie = Cookie {
    name: "greybox_sign_in",
    path: PATH,
    same_site: "Lax",
};

impl Cookie {
    /// The secret in the cookie, where a request brings one.
    pub(super) fn of(self, headers: &HeaderMap) -> Option<Secret> {
        let all = headers.get_all(header::COOKIE).iter();
        let pairs = all
            .filter_map(|value| value.to_str().ok())
            .flat_map(|value| value.split(';'));
        let mut secrets = pairs.filter_map(|pair| {
            let (name, value) = pair.trim().split_once('=')?;
            (name == self.name).then(|| value.parse().ok())?
        });
        secrets.next()
    }

    /// Has a browser keep a secret for so long.
    pub(super) fn keep(
        self,
        headers: &mut HeaderMap,
        secret: &Secret,
        life_s: i64,
        is_secure: bool,
    ) {
        self.set(headers, secret.expose(), life_s, is_secure);
    }

    /// Has a browser forget the cookie.
    pub(super) fn forget(self, headers: &mut HeaderMap, is_secure: bool) {
        self.set(headers, "", 0, is_secure);
    }

    fn set(self, headers: &mut HeaderMap, value: &str, life_s: i64, is_secure: bool) {
        let Self {
            name,
            path,
            same_site,
        } = self;
        let secure = if is_secure { "; Secure" } else { "" };
        let cookie = format!(
            "{name}={value}; Path={path}; HttpOnly; SameSite={same_site}; Max-Age={life_s}{secure}"
        );
        let cookie = HeaderValue::from_str(&cookie).expect("a secret is visible ASCII");
        headers.append(header::SET_COOKIE, cookie);
        let no_store = HeaderValue::from_static("no-store");
        headers.insert(header::CACHE_CONTROL, no_store);
    }
}

/// Whether a request brings what belongs to its session.
pub(super) fn brings_csrf_token(headers: &HeaderMap) -> bool {
    let expected = SESSION.of(headers).map(|secret| secret.csrf_token());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cookie_is_found_among_others() {
        let secret = Secret::new().expect("random bytes");
        let text = format!("a=b; greybox_session={}; c", secret.expose());
        let mut headers = HeaderMap::new();
        headers.insert(header::COOKIE, text.parse().unwrap());
        let session = SESSION.of(&headers).expect("a cookie");
        assert_eq!(session.expose(), secret.expose());
        assert!(ATTEMPT.of(&headers).is_none());
        assert!(!brings_csrf_token(&headers));
        headers.insert(
            CSRF_TOKEN,
            secret.session_digest().as_str().parse().unwrap(),
        );
        assert!(!brings_csrf_token(&headers));
        headers.insert(CSRF_TOKEN, secret.csrf_token().parse().unwrap());
        assert!(brings_csrf_token(&headers));
        headers.insert(header::COOKIE, "greybox_session=x".parse().unwrap());
        assert!(SESSION.of(&headers).is_none());
        assert!(!brings_csrf_token(&headers));
    }
}
