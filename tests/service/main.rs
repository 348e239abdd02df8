//! The service as its clients see it: over a real socket, with a fresh database for each test.

mod app;
mod fake;

mod datasets;

mod problems;

mod submission;

mod faults;

mod idempotency;

mod life;

mod listing;

mod events;

mod health;
