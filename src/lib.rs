//! greybox finds the physical parameters of a plant from recorded data.
//!
//! A job travels through these modules in the order in which they are declared:
//!
//! ```text
//! client ─HTTP→ api ─JobSpec→ store ──queue→ worker ─Problem→ estimation
//!                                              │   one generation after another
//!                        simulation(model) → credit → genetic ─┘   then refine → uncertainty
//! client ←SSE── api ←── event hub ←── store(events) ←── worker ←── observer
//! ```
//!
//! Two halves meet in [`worker`]: the *service* (async, I/O) above it and the *method*
//! (synchronous, seeded, no I/O, no clock, no environment) below it. Who may import whom is a
//! table in `tests/architecture.rs`, and a test.

pub mod cli;

pub mod app;

pub mod config;

pub mod api;

pub mod dashboard;

pub mod report;

pub mod job;

pub mod store;

pub mod event;

pub mod worker;

pub mod estimation;

pub mod credit;

pub mod genetic;

pub mod uncertainty;

pub mod demo;

pub mod model;

pub mod simulation;

pub mod intake;

pub mod recording;

pub mod document;

pub mod numerics;
