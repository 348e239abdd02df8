//! HTTP to domain types and back.
//!
//! No SQL and no numerics here. [`resources`] is the API (see `routes`), whose handlers take the part of the
//! state that they need (see `state`); [`with_middleware()`] puts what every answer
//! shares (request id, problem documents, compression, logging) around it and around the pages that
//! stand beside it.

pub mod access;
mod admission;
pub mod audit;
mod authorise;
mod background;
pub mod body;
pub mod candidates;
pub mod changes;
pub mod client;
pub mod comparisons;
mod computed;
mod dataset_samples;
mod dataset_versions;
pub mod datasets;
pub mod demonstration;
pub mod designs;
pub mod disturbance;
pub mod error;
pub mod event_streams;
pub mod events;
pub mod extract;
pub mod finished_job;
pub mod health;
pub mod http_headers;
pub mod job_list;
pub mod job_words;
pub mod jobs;
mod layouts;
mod limits;
pub mod mappings;
mod metric_lines;
pub mod middleware;
mod model_library;
pub mod models;
pub mod monitors;
mod named_layouts;
pub mod openapi;
pub mod origin;
pub mod page;
pub mod posterior;
mod prepared_datasets;
mod problem_page;
pub mod query;
mod rates;
pub mod reading;
pub mod report;
pub mod results;
mod routes;
pub mod selections;
pub mod session;
pub mod session_cookie;
mod simulated;
pub mod simulations;
pub mod sinks;
pub mod sources;
mod spec_cache;
mod spool;
mod spreadsheet;
mod state;
pub mod streams;
pub mod submit;
mod time_left;
pub mod trajectory;
mod unpacking;
mod unread_body;
pub mod verdict_rules;
mod watched_body;
pub mod webhooks;
mod work;

pub use limits::Limits;
pub use middleware::{Around, with_middleware};
pub use routes::{openapi, resources};
pub use state::{ApiState, Parts};
