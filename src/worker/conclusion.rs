//! How a slice ends: its job is handed on, or ended with a result, or without one.

use std::any::Any;

use jiff::Timestamp;
use tokio::sync::SemaphorePermit;
use tokio::task::JoinError;

use super::between_slices::Left;
use super::recorder::Recorder;
use super::run::{Run, StopReason};
use super::slice::{After, Computed, Current, End, SliceWorker};
use crate::job::{Failure, Status};
use crate::store::{Checkpoint, Ending, Hold, Record, StopRequest, StoreError};

/// What remains to be done with a slice whose computation has returned.
pub(super) struct Conclusion<'a> {
    pub(super) worker: &'a SliceWorker,
    /// Given up when nothing is left to be computed.
    pub(super) place: Option<SemaphorePermit<'a>>,
    pub(super) current: Current,
    pub(super) recorder: Recorder,
}

impl Conclusion<'_> {
    /// Hands the job on, or ends it.
    pub(super) async fn draw(mut self, computed: Computed) -> Result<After, StoreError> {
        let id = self.current.lease.job;
        let request = match self.worker.store.job(id).await? {
            Some(job) => job.stop_request,
            None => return Ok(After::Done),
        };
        let (run, end) = match computed {
            Ok(computed) => computed,
            Err(failure) => return self.end_without_result(request, failure).await,
        };
        match (end, request) {
            (End::Finished, _) => self.end_with(run, None, Status::Succeeded).await,
            (_, Some(StopRequest::Cancel)) => {
                self.end_with(run, Some(StopReason::Cancelled), Status::Cancelled)
                    .await
            }
            (_, Some(StopRequest::Pause)) => {
                self.end_with(run, Some(StopReason::Paused), Status::Paused)
                    .await
            }
            (_, None) if self.current.is_out_of_time() => {
                self.end_with(run, Some(StopReason::TimeLimit), Status::Succeeded)
                    .await
            }
            (_, None) => {
                let mut record = self.last_record();
                record.checkpoint = Some(self.checkpoint(&*run));
                drop(self.place.take());
                let lease = self.current.lease;
                if self.worker.store.record(lease, record).await? == Hold::Lost {
                    return Ok(After::Done);
                }
                let candidates = self.recorder.into_candidates();
                let left = Left { run, candidates };
                self.worker.between_slices.put(lease, left);
                Ok(After::Again)
            }
        }
    }

    /// Ends or pauses the job with its result, or the best so far.
    async fn end_with(
        mut self,
        mut run: Box<dyn Run>,
        stopped: Option<StopReason>,
        status: Status,
    ) -> Result<After, StoreError> {
        let computed = tokio::task::spawn_blocking(move || {
            let outcome = run.outcome(stopped)?;
            Ok((run, outcome))
        })
        .await
        .unwrap_or_else(|error| Err(broke(error)));
        drop(self.place.take());
        let (run, outcome) = match computed {
            Ok(computed) => computed,
            Err(failure) => return self.end_without_result(None, failure).await,
        };
        if outcome.is_none() && status == Status::Succeeded {
            return self.end_without_result(None, Failure::no_estimate()).await;
        }
        self.recorder.report(Timestamp::now());
        let mut record = self.last_record();
        if status == Status::Paused {
            record.checkpoint = Some(self.checkpoint(&*run));
        }
        let ending = Ending {
            status,
            outcome,
            error: None,
        };
        self.finish(record, ending).await
    }

    /// Ends a job whose computation broke. One that was to be cancelled is.
    async fn end_without_result(
        mut self,
        request: Option<StopRequest>,
        failure: Failure,
    ) -> Result<After, StoreError> {
        let (status, error) = match request {
            Some(StopRequest::Cancel) => (Status::Cancelled, None),
            _ => (Status::Failed, Some(failure)),
        };
        if let Some(failure) = &error {
            tracing::warn!(job = %self.current.lease.job, detail = failure.detail, "a job failed");
        }
        self.recorder.report(Timestamp::now());
        let record = self.last_record();
        let ending = Ending {
            status,
            outcome: None,
            error,
        };
        self.finish(record, ending).await
    }

    async fn finish(&self, record: Record, ending: Ending) -> Result<After, StoreError> {
        let hold = self
            .worker
            .store
            .finish(self.current.lease, record, ending)
            .await?;
        if hold == Hold::Lost {
            tracing::info!(job = %self.current.lease.job, "another slice has begun; this one is void");
        }
        Ok(After::Done)
    }

    fn last_record(&mut self) -> Record {
        let worked = self.current.started.elapsed();
        Record {
            worked_ms: u64::try_from(worked.as_millis()).unwrap_or(u64::MAX),
            ..self.recorder.record()
        }
    }

    fn checkpoint(&self, run: &dyn Run) -> Checkpoint {
        Checkpoint {
            state: run.checkpoint(),
            refinements: self.recorder.refinements(),
        }
    }
}

/// A computation that did not return: its thread panicked.
pub(super) fn broke(error: JoinError) -> Failure {
    match error.try_into_panic() {
        Ok(panic) => Failure::panicked(panic_message(&*panic)),
        Err(error) => Failure::panicked(&error.to_string()),
    }
}

fn panic_message(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("without a message")
}
