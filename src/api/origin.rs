//! Who a request is for and from which page it comes.
//!
//! A browser asks any server that a page names, one on the same machine or in the plant's network
//! too. A page of another site must neither read nor change anything here: not by a form or a script
//! (`Origin` names its site), and not under a name of its own that it has pointed at this server
//! (DNS rebinding: `Host` is that name). An address is no such name, and neither is `localhost`.

use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::error::{Answer, Kind, Problem};

/// The bytes of a path with its query at the most.
const LONGEST_PATH: usize = 8 << 10;

/// The headers of a request at the most.
const MOST_HEADERS: usize = 100;
/// The bytes of all headers at the most.
const LARGEST_HEADERS: usize = 32 << 10;

/// The names by which a server may be asked, beside its addresses and `localhost`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names(Vec<String>);

impl Names {
    /// These names, whatever their case.
    pub fn new<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        Self(names.into_iter().map(str::to_ascii_lowercase).collect())
    }

    fn contain(&self, host: &str) -> bool {
        let bare = host.trim_start_matches('[').trim_end_matches(']');
        let is_address = host.parse::<IpAddr>().is_ok() || bare.parse::<Ipv6Addr>().is_ok();
        let host = host.trim_end_matches('.').to_ascii_lowercase();
        is_address || host == "localhost" || host.ends_with(".localhost") || self.0.contains(&host)
    }
}

/// Lets a request on that is for this server and comes from no other site.
pub(super) async fn check(
    State(names): State<Arc<Names>>,
    request: Request,
    next: Next,
) -> Response {
    match checked(&names, request.method(), request.uri(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    }
}

fn checked(names: &Names, method: &Method, uri: &Uri, headers: &HeaderMap) -> Answer<()> {
    if uri
        .path_and_query()
        .is_some_and(|path| path.as_str().len() > LONGEST_PATH)
    {
        let detail = format!("a path with its query has at most {LONGEST_PATH} bytes");
        return Err(Problem::new(Kind::PathTooLong, detail));
    }
    let bytes = |(name, value): (&HeaderName, &HeaderValue)| name.as_str().len() + value.len();
    if headers.len() > MOST_HEADERS || headers.iter().map(bytes).sum::<usize>() > LARGEST_HEADERS {
        let detail = format!(
            "a request has at most {MOST_HEADERS} headers, of {LARGEST_HEADERS} bytes together"
        );
        return Err(Problem::new(Kind::HeadersTooLarge, detail));
    }
    let host = host(uri, headers)?;
    if !names.contain(host.host()) {
        let name: String = host.host().chars().take(80).collect();
        let detail = format!(
            "`{name}` is no name of this server; it is asked by its address, by `localhost`, and \
             by the names that it is started with (--name)"
        );
        return Err(Problem::new(Kind::WrongHost, detail));
    }
    if let Some(origin) = headers.get(header::ORIGIN)
        && !is_same_site(origin.to_str().unwrap_or_default(), &host)
    {
        return Err(wrong_origin());
    }
    // A browser that names no origin says at least this much.
    let site = headers.get("sec-fetch-site");
    let is_foreign = site.is_some_and(|site| site == "cross-site" || site == "same-site");
    if is_foreign && !matches!(*method, Method::GET | Method::HEAD) {
        return Err(wrong_origin());
    }
    Ok(())
}

fn wrong_origin() -> Problem {
    let detail = "the request comes from a page of another site";
    Problem::new(Kind::WrongOrigin, detail)
}

/// Whom the request is for: one `Host`, the same as in the address where that has one.
fn host(uri: &Uri, headers: &HeaderMap) -> Answer<Authority> {
    let bad = |detail: &str| Problem::new(Kind::Malformed, detail);
    let mut hosts = headers.get_all(header::HOST).iter();
    let host = hosts
        .next()
        .ok_or_else(|| bad("the request has no `Host`"))?;
    if hosts.next().is_some() {
        return Err(bad("the request has more than one `Host`"));
    }
    let host = Authority::try_from(host.as_bytes());
    let host = host.ok().filter(|host| !host.as_str().contains('@'));
    let host = host.ok_or_else(|| bad("the header `Host` is not the name of a server"))?;
    if uri.authority().is_some_and(|authority| *authority != host) {
        return Err(bad("the request's address and its `Host` are not the same"));
    }
    Ok(host)
}

/// Whether a page of the origin is a page of this server. A proxy in front of it may speak TLS.
fn is_same_site(origin: &str, host: &Authority) -> bool {
    let (port, rest) = match origin.split_once("://") {
        Some(("http", rest)) => (80, rest),
        Some(("https", rest)) => (443, rest),
        _ => return false,
    };
    let Ok(site) = rest.parse::<Authority>() else {
        return false;
    };
    let same_port = site.port_u16().unwrap_or(port) == host.port_u16().unwrap_or(port);
    same_port && site.host().eq_ignore_ascii_case(host.host())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(headers: &[(&'static str, &str)]) -> Result<(), u16> {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(*name, value.parse().unwrap());
        }
        let names = Names::new(["Rig4.plant.example"]);
        let uri = Uri::from_static("/v1/jobs");
        let checked = checked(&names, &Method::POST, &uri, &map);
        checked.map_err(|problem| problem.into_response().status().as_u16())
    }

    #[test]
    fn a_server_is_asked_by_its_addresses_and_its_names_alone() {
        for host in [
            "127.0.0.1:8080",
            "192.168.1.7",
            "[::1]:8080",
            "localhost:8080",
            "rig4.plant.example",
            "RIG4.plant.example.:8080",
        ] {
            assert_eq!(ask(&[("host", host)]), Ok(()), "{host}");
        }
        for host in [
            "attacker.example",
            "localhost.attacker.example:8080",
            "rig4",
        ] {
            assert_eq!(ask(&[("host", host)]), Err(421), "{host}");
        }
    }

    #[test]
    fn a_request_without_a_host_or_with_two_is_malformed() {
        assert_eq!(ask(&[]), Err(400));
        let twice = [("host", "localhost"), ("host", "127.0.0.1")];
        assert_eq!(ask(&twice), Err(400));
        assert_eq!(ask(&[("host", "a b")]), Err(400));
        assert_eq!(ask(&[("host", "a@localhost")]), Err(400));
    }

    #[test]
    fn pages_of_other_sites_are_refused() {
        let own = ("host", "127.0.0.1:8080");
        assert_eq!(ask(&[own, ("origin", "http://127.0.0.1:8080")]), Ok(()));
        let proxied = ("host", "rig4.plant.example");
        assert_eq!(
            ask(&[proxied, ("origin", "https://rig4.plant.example")]),
            Ok(())
        );
        for origin in [
            "http://attacker.example",
            "http://127.0.0.1:8081",
            "http://localhost:8080",
            "null",
            "",
        ] {
            assert_eq!(ask(&[own, ("origin", origin)]), Err(403), "{origin}");
        }
        assert_eq!(ask(&[own, ("sec-fetch-site", "cross-site")]), Err(403));
        assert_eq!(ask(&[own, ("sec-fetch-site", "same-origin")]), Ok(()));
    }
}
