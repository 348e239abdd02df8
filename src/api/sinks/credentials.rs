//! The ways in which collecting agents send credentials, as the one way of this server: a bearer.
//!
//! The secret of a token is the password of `u` and `p` in the query or of `Authorization: Basic`, or what
//! stands behind `Token`, and `producertoken` of OMF 1.0. The name of the user is not looked at: the token says who asks.

use axum::extract::{Query, Request};
use axum::http::{HeaderValue, header};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;

use super::protocol::Protocol;

/// Writes the credentials of a request to a path of agents as `Authorization: Bearer`.
pub(in crate::api) fn as_bearer(request: &mut Request) {
    let secret = match Protocol::of_path(request.uri().path()) {
        None => return,
        Some(Protocol::Influx1 | Protocol::Influx2) => {
            password_of_query(request).or_else(|| secret_of_header(request))
        }
        Some(Protocol::Omf) => secret_of_header(request).or_else(|| producer_token(request)),
    };
    let Some(secret) = secret else {
        return;
    };
    if let Ok(bearer) = HeaderValue::from_str(&format!("Bearer {secret}")) {
        request.headers_mut().insert(header::AUTHORIZATION, bearer);
    }
}

/// `p` of the query, where `u` stands beside it.
fn password_of_query(request: &Request) -> Option<String> {
    let Query(pairs) = Query::<Vec<(String, String)>>::try_from_uri(request.uri()).ok()?;
    let value = |name: &str| {
        let value = pairs.iter().find(|(key, _)| key == name);
        value
            .map(|(_, value)| value.clone())
            .filter(|value| !value.is_empty())
    };
    value("u").and_then(|_user| value("p"))
}

/// The token of OMF 1.0, where nothing else says who asks.
fn producer_token(request: &Request) -> Option<String> {
    let headers = request.headers();
    let is_said = headers.contains_key(header::AUTHORIZATION);
    let token = headers.get("producertoken").filter(|_| !is_said)?;
    Some(token.to_str().ok()?.trim().to_owned())
}

/// The secret behind `Token` or within `Basic`. Whatever else the header has stays as it is.
fn secret_of_header(request: &Request) -> Option<String> {
    let given = request
        .headers()
        .get(header::AUTHORIZATION)?
        .to_str()
        .ok()?;
    let (scheme, credentials) = given.split_once(' ')?;
    let credentials = credentials.trim();
    if scheme.eq_ignore_ascii_case("token") {
        let secret = credentials
            .rsplit_once(':')
            .map_or(credentials, |(_user, secret)| secret);
        return Some(secret.to_owned());
    }
    if !scheme.eq_ignore_ascii_case("basic") {
        return None;
    }
    let decoded = BASE64_STANDARD.decode(credentials).ok()?;
    let decoded = String::from_utf8(decoded).ok()?;
    let (_user, password) = decoded.split_once(':')?;
    Some(password.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;

    fn bearer(uri: &str, authorization: Option<&str>) -> Option<String> {
        let mut request = Request::post(uri);
        if let Some(authorization) = authorization {
            request = request.header(header::AUTHORIZATION, authorization);
        }
        let mut request = request.body(Body::empty()).unwrap();
        as_bearer(&mut request);
        let bearer = request.headers().get(header::AUTHORIZATION)?;
        Some(bearer.to_str().unwrap().to_owned())
    }

    #[test]
    fn every_way_of_influxdb_is_a_bearer() {
        // `mes:gbx_1` in Base64.
        let basic = "Basic bWVzOmdieF8x";
        for (uri, authorization) in [
            ("/write?db=a&u=mes&p=gbx_1", None),
            ("/write?db=a&u=mes&p=gbx_1", Some("Token gbx_2")),
            ("/write?db=a", Some(basic)),
            ("/write?db=a", Some("Token mes:gbx_1")),
            ("/api/v2/write?bucket=a", Some("Token gbx_1")),
            ("/api/v2/write?bucket=a", Some("token  gbx_1")),
            ("/api/v2/write?bucket=a", Some("Bearer gbx_1")),
        ] {
            let bearer = bearer(uri, authorization);
            assert_eq!(
                bearer.as_deref(),
                Some("Bearer gbx_1"),
                "{uri} {authorization:?}"
            );
        }
        assert_eq!(bearer("/v1/jobs", Some(basic)).as_deref(), Some(basic));
        assert_eq!(bearer("/v1/jobs?u=a&p=gbx_1", None), None);
        assert_eq!(bearer("/write?db=a&p=gbx_1", None), None);
        let broken = bearer("/write?db=a", Some("Basic ?"));
        assert_eq!(broken.as_deref(), Some("Basic ?"));
    }
}
