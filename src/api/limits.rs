//! What the service lets one client ask for.

use std::time::Duration;

use greybox::intake::{MEMORY_ALWAYS, MEMORY_PER_BYTE};

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

impl Limits {
    /// Limits of a process that may have so many bytes of memory. Half of the memory is for recordings that come
    /// in, each with the most that reading takes: where one of the largest size has no room, smaller ones are taken.
    #[must_use]
    pub fn within_memory(self, bytes: u64) -> Self {
        let for_recordings = bytes / 2;
        let of_largest = for_recordings.saturating_sub(MEMORY_ALWAYS) / MEMORY_PER_BYTE;
        let dataset_bytes = self.dataset_bytes.min(of_largest);
        let at_once = for_recordings / (MEMORY_ALWAYS + MEMORY_PER_BYTE * dataset_bytes);
        let at_once = usize::try_from(at_once).unwrap_or(usize::MAX);
        Self {
            dataset_bytes,
            recordings_at_once: self.recordings_at_once.min(at_once.max(1)),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_that_come_in_keep_within_half_of_the_memory() {
        let within = |mib: u64| {
            let limits = Limits::default().within_memory(mib << 20);
            (limits.recordings_at_once, limits.dataset_bytes >> 20)
        };
        // One of 64 MiB takes four times as much and 64 MiB beside.
        assert_eq!(within(24 << 10), (4, 64));
        assert_eq!(within(2048), (3, 64));
        assert_eq!(within(1000), (1, 64));
        assert_eq!(within(512), (1, 48));
        assert_eq!(within(256), (1, 16));
    }
}
