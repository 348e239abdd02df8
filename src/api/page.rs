//! Pages of a list that is sorted newest first, by opaque cursor.
//!
//! A page token is the identifier of the last item seen, so that items that come or go between
//! two pages shift nothing.

use std::str::FromStr;

use axum::http::{HeaderValue, Uri, header};
use axum::response::Response;
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::query::QueryReader;

/// Items on a page when the client does not say.
pub const DEFAULT_LIMIT: u64 = 50;
/// Items on a page at the most.
pub const MAX_LIMIT: u64 = 500;

/// Which page of a list.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PageParams {
    /// Where to go on, as the answer before it said.
    #[param(required = false)]
    pub page_token: Option<String>,
    /// Items on the page at the most.
    #[param(minimum = 1, maximum = 500, default = 50)]
    pub limit: Option<u64>,
}

/// A place in a list.
#[derive(Clone, Copy, Debug)]
pub struct Cursor<Id> {
    /// Items older than this one, from the newest when absent.
    pub before: Option<Id>,
    /// Items on the page at the most.
    pub limit: u32,
}

impl<Id: FromStr> Cursor<Id> {
    /// Reads `page_token` and `limit`.
    pub fn read(query: &mut QueryReader) -> Self {
        let before = query.parsed("page_token", |token| {
            let id = token
                .strip_prefix(TOKEN_START)
                .and_then(|id| id.parse().ok());
            id.ok_or_else(|| "not a token that an earlier page gave".to_owned())
        });
        let limit = query
            .integer("limit", 1, MAX_LIMIT)
            .unwrap_or(DEFAULT_LIMIT);
        Self {
            before,
            limit: u32::try_from(limit).expect("the limit is small"),
        }
    }
}

/// Tokens are marked, so that no one takes them for identifiers.
const TOKEN_START: &str = "before.";

/// One page of a list.
#[derive(Serialize, ToSchema)]
pub struct Page<T> {
    /// The items, newest first.
    pub items: Vec<T>,
    /// What to pass as `page_token` for the next page; `null` on the last one.
    pub next_page_token: Option<String>,
}

impl<T: Serialize> Page<T> {
    /// The page, and how to go on after its last item when there is more.
    pub fn new(items: Vec<T>, more_after: Option<String>) -> Self {
        Self {
            items,
            next_page_token: more_after.map(|id| format!("{TOKEN_START}{id}")),
        }
    }

    /// The answer to `uri`, with `Link: rel="next"`.
    pub fn answer(&self, uri: &Uri) -> Response {
        let mut response = super::http_headers::json(axum::http::StatusCode::OK, self);
        if let Some(token) = &self.next_page_token {
            let link = format!("<{}>; rel=\"next\"", with_token(uri, token));
            if let Ok(link) = HeaderValue::from_str(&link) {
                response.headers_mut().insert(header::LINK, link);
            }
        }
        response
    }
}

/// The path and query of `uri` with `token` as the `page_token`: another part of the list.
fn with_token(uri: &Uri, token: &str) -> String {
    let pairs = uri.query().unwrap_or_default().split('&');
    let pairs = pairs.filter(|pair| !pair.is_empty() && !pair.starts_with("page_token="));
    let mut pairs: Vec<&str> = pairs.collect();
    let token = format!("page_token={token}");
    pairs.push(&token);
    format!("{}?{}", uri.path(), pairs.join("&"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_page_keeps_the_filter_and_replaces_the_token() {
        let uri: Uri = "/v1/jobs?status=queued&page_token=before.a&limit=2"
            .parse()
            .unwrap();
        let page = Page::new(vec![1, 2], Some("b".into()));
        let response = page.answer(&uri);
        assert_eq!(
            response.headers()[header::LINK],
            "</v1/jobs?status=queued&limit=2&page_token=before.b>; rel=\"next\""
        );
    }

    #[test]
    fn the_last_page_has_no_link() {
        let response = Page::<u8>::new(vec![], None).answer(&Uri::from_static("/v1/jobs"));
        assert!(!response.headers().contains_key(header::LINK));
    }
}
