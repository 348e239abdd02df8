//! What the service lets one client ask for.

use std::time::Duration;

/// What the service lets one client ask for.
#[derive(Clone, Debug)]
pub struct Limits {
    /// The bytes of a recording at the most, uncompressed.
    pub dataset_bytes: u64,
    /// How far the stamps of a stream's samples may lie ahead of the server's clock.
    pub stamps_ahead: Duration,
    /// The bytes of a JSON document (a job, a simulation) at the most, uncompressed.
    pub document_bytes: u64,
    /// Derivatives that the search of a job may be predicted to take.
    pub job_derivatives: f64,
    /// The longest computing time that a job may ask for `[s]`.
    pub max_duration_s: f64,
    /// Recordings that are in memory at the same time at the most.
    pub recordings_at_once: usize,
    /// Computations for clients that wait, at the same time at the most.
    pub computations_at_once: usize,
    /// Documents and recordings that are read or written at the same time at the most.
    pub conversions_at_once: usize,
    /// Threads that compute for clients that wait.
    pub threads: usize,
    /// The bytes that bodies on their way take of the disk at the most, all together.
    pub spool_bytes: u64,
    /// Event streams that are open at the same time at the most.
    pub streams_at_once: usize,
    /// Requests in a second of each caller that says who it is.
    pub requests_per_second: f64,
    /// Requests, streams among them, that each such caller has under way at the most.
    pub requests_at_once: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            dataset_bytes: 64 << 20,
            stamps_ahead: Duration::from_hours(24),
            document_bytes: 1 << 20,
            job_derivatives: 1e15,
            max_duration_s: 86_400.0,
            recordings_at_once: 4,
            computations_at_once: 3,
            conversions_at_once: 4,
            threads: 2,
            spool_bytes: 1 << 30,
            streams_at_once: 5000,
            requests_per_second: 200.0,
            requests_at_once: 1000,
        }
    }
}
