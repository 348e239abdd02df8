//! The HTTP service and the command line of greybox. The method that they serve is the library
//! [`greybox`].
//!
//! A job travels through these modules in the order in which they are declared:
//!
//! ```text
//! client ─HTTP→ api ─JobTask→ store ──queue→ worker → identification ─Problem→ estimation
//!                                              │        one generation after another
//!                             simulation(model) → credit → genetic ─┘   then refine → uncertainty
//! client ←SSE── api ←── event hub ←── store(events) ←── worker ←── observer
//! ```
//!
//! Two halves meet in [`worker`]: the *service* (async, I/O) above it and the *method*
//! (synchronous, seeded, no I/O, no clock, no environment) below it. Who may import whom is a
//! table in `tests/architecture.rs`, and a test.

pub mod cli;

pub mod app;

pub mod collect;

pub mod config;

pub mod api;

pub mod access;

pub(crate) mod admission;

pub(crate) mod priority;

pub(crate) mod allowance;

pub mod dashboard;

pub mod job;

pub mod monitor;

pub mod store;

pub mod encrypted_file;

pub mod delivery;

pub mod identity;

pub(crate) mod outbound;

pub mod event;

pub mod span;

pub mod watcher;

pub mod worker;
