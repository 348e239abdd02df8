//! Runs a job on a recording in this process, as a worker does.

use greybox::{Identification, Outcome, Recording};
use serde_json::Value;

/// The result of the job on the recording, from which every experiment is cut; its model may be a
/// document.
pub fn run(job: Value, recording: Recording) -> Outcome {
    let found = Identification::of_job(job, recording).run();
    found.unwrap_or_else(|error| panic!("{error}"))
}
