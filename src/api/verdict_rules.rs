//! The rules of a verdict: what each code says, means and asks for.

use axum::http::HeaderMap;
use serde::Serialize;
use utoipa::ToSchema;

use super::error::Answer;
use super::http_headers::tagged_json;
use super::query::{NoQuery, Params};
use greybox::uncertainty::verdict::{Rule, RuleEntry};

/// The rules of a verdict.
#[derive(Serialize, ToSchema)]
pub struct VerdictRules {
    /// The rules, in the order of the guide.
    items: Vec<RuleEntry>,
}

/// Read what the reasons of a verdict mean: for each code a title, when it speaks, and what to do.
#[utoipa::path(
    get, path = "/v1/verdict-rules", operation_id = "list_verdict_rules", tag = "jobs",
    params(("If-None-Match" = Option<String>, Header, description = "The `ETag` that the client has")),
    responses(
        (status = 200, description = "All rules", body = VerdictRules,
         headers(("ETag" = String, description = "Changes with the answer"))),
        (status = 304, description = "The client has this already")
    )
)]
pub async fn list(_query: Params<NoQuery>, headers: HeaderMap) -> Answer {
    let items = Rule::ALL.iter().map(|rule| rule.entry()).collect();
    Ok(tagged_json(&headers, &VerdictRules { items }))
}
