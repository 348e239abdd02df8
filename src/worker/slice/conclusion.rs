//! The end of a slice: the job is handed on, or ended with what it came to.

use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::current::{After, Computed, Current, End, SliceWorker};
use crate::admission::Permit;
use crate::job::{Failure, ResultOfJob};
use crate::store::{Checkpoint, Ending, HandedOn, Hold, Record, StopRequest, StoreError};
use crate::worker::kept_runs::KeptRun;
use crate::worker::recorder::Recorder;
use crate::worker::run::{Run, StopReason};
use jiff::Timestamp;
use tokio::task::JoinError;

/// How long the best estimate so far of a job that was stopped may be analysed.
const ANALYSIS_TIME: Duration = Duration::from_millis(500);
/// How often it is looked whether an analysis has to hurry.
const HURRY_INTERVAL: Duration = Duration::from_millis(20);

/// What remains to be done with a slice whose computation has returned.
pub(in crate::worker) struct Conclusion<'a> {
    pub(in crate::worker) worker: &'a SliceWorker,
    /// Given up when nothing is left to be computed.
    pub(in crate::worker) permit: Option<Permit>,
    pub(in crate::worker) current: Current,
    pub(in crate::worker) recorder: Recorder,
}

impl Conclusion<'_> {
    /// Hands the job on, or ends it.
    pub(in crate::worker) async fn draw(self, computed: Computed) -> Result<After, StoreError> {
        let run = match computed {
            Ok((run, End::Finished)) => return self.end_with(run, None).await,
            Ok((run, End::TimeIsUp | End::Stopped)) => run,
            Err(failure) => return self.finish(None, Ending::Failed(failure)).await,
        };
        let id = self.current.lease.job;
        let request = match self.worker.store.jobs().find(id).await? {
            Some(job) => job.stop_request,
            None => return Ok(After::Done),
        };
        match request {
            Some(StopRequest::Cancel) => self.end_with(run, Some(StopReason::Cancelled)).await,
            Some(StopRequest::Pause) => self.end_with(run, Some(StopReason::Paused)).await,
            None if self.current.is_out_of_time() => {
                self.end_with(run, Some(StopReason::TimeLimit)).await
            }
            None => self.hand_on(run).await,
        }
    }

    /// Has another slice go on with the job, on this node where nobody waits.
    async fn hand_on(mut self, run: Box<dyn Run>) -> Result<After, StoreError> {
        let mut record = self.last_record();
        record.checkpoint = Some(self.checkpoint(&*run));
        record.is_shared = run.is_shareable() && self.worker.store.nodes().share().is_some();
        let must = self.worker.active.all_are_stopped()
            || self.worker.admission.is_waited_for()
            || self.current.entry_is_old();
        drop(self.permit.take());
        let lease = self.current.lease;
        let handed_on = self
            .worker
            .store
            .slices()
            .hand_on(lease, record, must)
            .await?;
        if handed_on == HandedOn::Lost {
            return Ok(After::Done);
        }
        let kept = KeptRun {
            run,
            candidates: self.recorder.into_candidates(),
            last_part: self.current.exchange.last_part(),
        };
        self.worker.kept_runs.put(lease, kept);
        match handed_on {
            HandedOn::Stays => Ok(After::Again),
            HandedOn::ToTheQueue | HandedOn::Lost => Ok(After::Done),
        }
    }

    /// Ends or pauses the job with its result, or the best so far.
    async fn end_with(
        mut self,
        run: Box<dyn Run>,
        stopped: Option<StopReason>,
    ) -> Result<After, StoreError> {
        let (run, outcome) = match self.outcome(run, stopped).await {
            Ok(computed) => computed,
            Err(failure) => return self.finish(None, Ending::Failed(failure)).await,
        };
        if stopped == Some(StopReason::TimeLimit) && self.worker.active.all_are_stopped() {
            // The next server has the time that this one had not.
            return self.hand_on(run).await;
        }
        drop(self.permit.take());
        let ending = match (stopped, outcome) {
            (Some(StopReason::Cancelled | StopReason::Paused), outcome) => Ending::Stopped(outcome),
            (_, Some(outcome)) => Ending::Succeeded(outcome),
            (_, None) => Ending::Failed(Failure::no_estimate()),
        };
        let checkpoint = self.checkpoint(&*run);
        self.finish(Some(checkpoint), ending).await
    }

    /// The result. Analyses that take long are left out where the job was asked to stop or the server goes
    /// down.
    async fn outcome(
        &self,
        mut run: Box<dyn Run>,
        stopped: Option<StopReason>,
    ) -> Result<(Box<dyn Run>, Option<ResultOfJob>), Failure> {
        let hurry = Arc::new(AtomicBool::new(false));
        let raised = hurry.clone();
        let computing = tokio::task::spawn_blocking(move || {
            let outcome = run.outcome(stopped, &raised)?;
            Ok((run, outcome))
        });
        let asked_to_stop = !matches!(stopped, None | Some(StopReason::TimeLimit));
        let begun = Instant::now();
        let mut looks = tokio::time::interval(HURRY_INTERVAL);
        let mut computing = std::pin::pin!(computing);
        loop {
            tokio::select! {
                computed = computing.as_mut() => {
                    return computed.unwrap_or_else(|error| Err(broke(error)));
                }
                _ = looks.tick() => {
                    let is_late = asked_to_stop && begun.elapsed() >= ANALYSIS_TIME;
                    if is_late || self.worker.active.all_are_stopped() {
                        hurry.store(true, Ordering::Relaxed);
                    }
                }
            }
        }
    }

    /// Writes what the job came to. A checkpoint lets a job go on that was asked to pause while its result
    /// was computed: the next slice comes to the result with the same bits.
    async fn finish(
        mut self,
        checkpoint: Option<Checkpoint>,
        ending: Ending,
    ) -> Result<After, StoreError> {
        if let Ending::Failed(failure) = &ending {
            tracing::warn!(job = %self.current.lease.job, detail = failure.detail, "a job failed");
        }
        self.recorder.report(Timestamp::now());
        let record = Record {
            checkpoint,
            ..self.last_record()
        };
        let lease = self.current.lease;
        let hold = self
            .worker
            .store
            .slices()
            .finish(lease, record, ending)
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
pub(in crate::worker) fn broke(error: JoinError) -> Failure {
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
