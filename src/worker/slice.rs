//! One slice of one job: begin, work in whole units, and hand on or end.
//!
//! The computation runs on a blocking thread and sends its rows through a bounded channel; this
//! side writes them about every 200 ms. A slice ends when its time is up, when the run has
//! finished, when the stop flag is raised (cancel, pause, the job's time limit, shutdown), or when
//! a write finds that another slice has begun.

use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use jiff::Timestamp;
use serde_json::Value;
use tokio::sync::{Semaphore, SemaphorePermit, mpsc};
use tokio::task::JoinError;

use super::active::{ActiveJob, ActiveJobs};
use super::recorder::Recorder;
use super::run::{Advance, Assignment, Method, Row, Run, StopReason};
use crate::job::{DatasetId, Failure, JobId, Progress, Status};
use crate::recording::Recording;
use crate::store::{
    Begin, Checkpoint, Ending, Hold, JobRow, Lease, Record, Slice, StopRequest, Store, StoreError,
};

/// How often what a slice did is written.
const FLUSH_INTERVAL: Duration = Duration::from_millis(200);

/// Units whose rows may wait to be written before the computation waits.
const UNITS_WAITING: usize = 256;

/// Candidates that are read back at a time when a slice goes on.
const CANDIDATES_AT_ONCE: usize = 50_000;

/// Slices in a row that may end without a checkpoint before their job fails.
const ATTEMPT_LIMIT: u32 = 5;

/// What the queue is to do with the entry of a slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum After {
    /// The job has more to do: another slice, now.
    Again,
    /// The job is at work already: look again soon.
    Later,
    /// Nothing more to do with this entry.
    Done,
}

/// Works slices. Cheap to clone.
#[derive(Clone)]
pub(super) struct SliceWorker {
    pub(super) store: Store,
    pub(super) method: Arc<dyn Method>,
    pub(super) active: ActiveJobs,
    /// Computations at the same time. More entries may have been taken from the queue: the next
    /// ones wait here, so that no place is empty while the queue is asked or an end is written.
    pub(super) places: Arc<Semaphore>,
    pub(super) slice_length: Duration,
    pub(super) max_candidates: u64,
}

/// Why the computation of a slice returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Finished,
    TimeIsUp,
    Stopped,
}

/// The slice at work.
struct Current {
    lease: Lease,
    started: Instant,
    /// The time that the job may still work, where it has a limit.
    time_left: Option<Duration>,
    stop: Arc<AtomicBool>,
}

impl Current {
    fn is_out_of_time(&self) -> bool {
        self.time_left
            .is_some_and(|left| self.started.elapsed() >= left)
    }
}

/// What a job is worked from: the document of its model, where a user wrote it, and its
/// recordings with their digests.
struct Materials {
    model: Option<Value>,
    datasets: Vec<(String, Recording)>,
}

/// What a unit of work left behind.
struct Unit {
    rows: Vec<Row>,
    progress: Progress,
}

type Computed = Result<(Box<dyn Run>, End), Failure>;

impl SliceWorker {
    /// Works a slice for a queue entry.
    pub(super) async fn work(&self, id: JobId, entry: i64) -> Result<After, StoreError> {
        let place = self.places.acquire().await;
        let place = place.expect("the semaphore is never closed");
        if self.active.all_are_stopped() {
            return Ok(After::Again);
        }
        match self.active.take(id) {
            Some(job) => self.slice(id, Some((entry, place)), &job).await,
            None => Ok(After::Later),
        }
    }

    /// Ends a job that was asked to stop and is between two slices; a job at work is reported to.
    pub(super) async fn settle(&self, id: JobId) -> Result<(), StoreError> {
        if let Some(job) = self.active.take(id) {
            job.stop_flag().store(true, Ordering::Relaxed);
            self.slice(id, None, &job).await?;
        } else {
            self.active.stop(id);
        }
        Ok(())
    }

    async fn slice(
        &self,
        id: JobId,
        entry: Option<(i64, SemaphorePermit<'_>)>,
        job: &ActiveJob,
    ) -> Result<After, StoreError> {
        let (entry, place) = entry.unzip();
        let slice = match self.store.begin_slice(id, entry, ATTEMPT_LIMIT).await? {
            Begin::Slice(slice) => *slice,
            Begin::Nothing | Begin::Poisoned => return Ok(After::Done),
        };
        let stop = job.stop_flag();
        if slice.stop_request().is_some() {
            stop.store(true, Ordering::Relaxed);
        }
        let current = Current {
            lease: slice.lease,
            started: Instant::now(),
            time_left: time_left(&slice),
            stop,
        };
        let mut recorder = Recorder::new(&slice, self.max_candidates);
        let computed = match self.materials(&slice.job).await? {
            Ok(materials) => {
                let (sender, units) = mpsc::channel(UNITS_WAITING);
                let computation = self.compute(slice, materials, current.stop.clone(), sender);
                let written = self.write_units(&current, &mut recorder, units).await;
                let computed = computation.await;
                if written? == Hold::Lost {
                    return Ok(After::Done);
                }
                computed
            }
            Err(failure) => Err(failure),
        };
        let conclusion = Conclusion {
            worker: self,
            place,
            current,
            recorder,
        };
        conclusion.draw(computed).await
    }

    /// What a job is worked from.
    async fn materials(&self, job: &JobRow) -> Result<Result<Materials, Failure>, StoreError> {
        let model = self.store.model(&job.model).await?;
        let datasets = self.recordings(&job.spec).await?;
        Ok(datasets.map(|datasets| Materials {
            model: model.map(|row| row.document),
            datasets,
        }))
    }

    /// The recordings that a job reads, with their digests.
    async fn recordings(
        &self,
        spec: &Value,
    ) -> Result<Result<Vec<(String, Recording)>, Failure>, StoreError> {
        let mut recordings = Vec::new();
        for id in datasets_of(spec) {
            let row = self.store.dataset(id).await?;
            let recording = self.store.recording(id).await?;
            let (Some(row), Some(recording)) = (row, recording) else {
                let detail = format!("the dataset {id} is no longer stored");
                return Ok(Err(Failure::cannot_run(detail, Vec::new())));
            };
            recordings.push((row.digest.clone(), recording));
        }
        Ok(Ok(recordings))
    }

    /// Starts the computation of a slice on a blocking thread.
    fn compute(
        &self,
        slice: Slice,
        Materials { model, datasets }: Materials,
        stop: Arc<AtomicBool>,
        units: mpsc::Sender<Unit>,
    ) -> impl Future<Output = Computed> {
        let method = self.method.clone();
        // After a crash a single unit, so that a job which is not to blame has a checkpoint again
        // before the server may go down once more.
        let slice_length = match slice.job.attempt {
            0 | 1 => self.slice_length,
            _ => Duration::ZERO,
        };
        let assignment = Assignment {
            job: slice.job,
            model,
            datasets,
            checkpoint: slice.checkpoint.map(|checkpoint| checkpoint.state),
        };
        let computation = tokio::task::spawn_blocking(move || {
            let mut run = method.begin(assignment)?;
            let end = advance(&mut *run, slice_length, &stop, &units);
            Ok((run, end))
        });
        async { computation.await.unwrap_or_else(|error| Err(broke(error))) }
    }

    /// Writes what the computation sends until it returns.
    async fn write_units(
        &self,
        current: &Current,
        recorder: &mut Recorder,
        mut units: mpsc::Receiver<Unit>,
    ) -> Result<Hold, StoreError> {
        if let Err(error) = self.recall(current.lease, recorder).await {
            current.stop.store(true, Ordering::Relaxed);
            return Err(error);
        }
        let first = tokio::time::Instant::now() + FLUSH_INTERVAL;
        let mut flush = tokio::time::interval_at(first, FLUSH_INTERVAL);
        let out_of_time = tokio::time::sleep(current.time_left.unwrap_or(Duration::MAX));
        tokio::pin!(out_of_time);
        loop {
            tokio::select! {
                unit = units.recv() => match unit {
                    Some(unit) => take(recorder, unit, current.started.elapsed()),
                    None => return Ok(Hold::Kept),
                },
                _ = flush.tick() => {
                    let written = self.flush(current.lease, recorder).await;
                    if !matches!(written, Ok(Hold::Kept)) {
                        current.stop.store(true, Ordering::Relaxed);
                        return written;
                    }
                }
                () = &mut out_of_time, if !out_of_time.is_elapsed() => {
                    current.stop.store(true, Ordering::Relaxed);
                }
            }
        }
    }

    /// Reads back which candidates are kept, beside the computation, which has forgotten them.
    async fn recall(&self, lease: Lease, recorder: &mut Recorder) -> Result<(), StoreError> {
        let mut after = Some(0);
        while let Some(generation) = after {
            let kept = self
                .store
                .candidates(lease.job, generation, u32::MAX, CANDIDATES_AT_ONCE);
            let kept = kept.await?;
            recorder.recall(&kept);
            // Once the record is cut nothing more is kept.
            after = kept.more_after.filter(|_| kept.cut_in_generation.is_none());
        }
        Ok(())
    }

    async fn flush(&self, lease: Lease, recorder: &mut Recorder) -> Result<Hold, StoreError> {
        recorder.report_if_due(Timestamp::now());
        if recorder.is_empty() {
            return Ok(Hold::Kept);
        }
        self.store.record(lease, recorder.record()).await
    }
}

fn take(recorder: &mut Recorder, unit: Unit, worked: Duration) {
    let now = Timestamp::now();
    for row in unit.rows {
        recorder.take(row, now);
    }
    recorder.note(unit.progress, worked);
}

/// Works units until the run has finished, the time is up or the flag is raised.
fn advance(
    run: &mut dyn Run,
    slice_length: Duration,
    stop: &AtomicBool,
    units: &mpsc::Sender<Unit>,
) -> End {
    let started = Instant::now();
    loop {
        if stop.load(Ordering::Relaxed) {
            return End::Stopped;
        }
        let mut rows = Vec::new();
        let advance = run.advance(stop, &mut |row| rows.push(row));
        let unit = Unit {
            rows,
            progress: run.progress(),
        };
        if units.blocking_send(unit).is_err() {
            return End::Stopped;
        }
        match advance {
            Advance::Finished => return End::Finished,
            Advance::Interrupted => return End::Stopped,
            Advance::Working if started.elapsed() >= slice_length => return End::TimeIsUp,
            Advance::Working => {}
        }
    }
}

/// What remains to be done with a slice whose computation has returned.
struct Conclusion<'a> {
    worker: &'a SliceWorker,
    /// Given up when nothing is left to be computed.
    place: Option<SemaphorePermit<'a>>,
    current: Current,
    recorder: Recorder,
}

impl Conclusion<'_> {
    /// Hands the job on, or ends it.
    async fn draw(mut self, computed: Computed) -> Result<After, StoreError> {
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
                match self.worker.store.record(self.current.lease, record).await? {
                    Hold::Kept => Ok(After::Again),
                    Hold::Lost => Ok(After::Done),
                }
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

/// The time that a job may still work, where it has a limit.
fn time_left(slice: &Slice) -> Option<Duration> {
    let limit = slice.job.spec.pointer("/limits/max_duration_s")?.as_f64()?;
    let limit = Duration::try_from_secs_f64(limit).ok()?;
    Some(limit.saturating_sub(Duration::from_millis(slice.running_ms)))
}

/// The recordings that a specification names, one for each experiment.
fn datasets_of(spec: &Value) -> Vec<DatasetId> {
    let experiments = spec.get("experiments").and_then(Value::as_array);
    experiments
        .into_iter()
        .flatten()
        .filter_map(|experiment| experiment.get("dataset")?.as_str()?.parse().ok())
        .collect()
}

/// A computation that did not return: its thread panicked.
fn broke(error: JoinError) -> Failure {
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
