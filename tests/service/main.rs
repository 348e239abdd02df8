//! The service as its clients see it: over a real socket, with a fresh database for each test.

#![expect(clippy::unwrap_used, reason = "a test whose premise fails has failed")]

mod access;
mod app;
mod audit;
mod candidates;
#[path = "../../src/store/tests/cluster.rs"]
mod cluster;
mod collecting;
mod comparisons;

mod dataset_versions;
mod datasets;

mod designs;
mod disturbances;
mod posteriors;
mod prepared_datasets;

mod problems;

mod submission;

mod faults;

mod idempotency;

mod job_words;
mod layouts;

mod life;
mod limits;

mod listing;

mod events;
mod exports;

mod health;

mod simulations;

mod models;

mod monitor_windows;
mod monitors;

mod older;

mod quad_tank;

mod stream_marks;
mod streams;

mod named_layouts;
mod origin;

mod quotas;
mod selections;
mod sessions;
mod sign_in;
mod sinks;
mod sinks_access;
mod sinks_omf;

mod slow;

mod verdicts;
mod webhooks;
