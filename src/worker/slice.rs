//! One slice of one job: begin, work in whole units, and hand on or end.
//!
//! The computation runs on a blocking thread and sends its units through a bounded channel (see
//! `units`); this side writes their rows about every 200 ms. A slice ends when its time is up, when the run has
//! finished, when the stop flag is raised (cancel, pause, the job's time limit, shutdown), or when
//! a write finds that another slice has begun.

mod conclusion;
mod current;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use jiff::Timestamp;
use tracing::Instrument as _;

use super::active::ActiveJob;
use super::candidates::Candidates;
use super::exchange::Exchange;
use super::recorder::Recorder;
use super::run::{Advance, Assignment, Past, Run, Share, StreamReader};
use super::stored_stream::stored_stream;
use super::units::{self, Unit, UnitReceiver, UnitSender};
use crate::access::Project;
use crate::admission::Permit;
use crate::job::Failure;
use crate::span;
use crate::store::{Begin, Hold, JobRow, Lease, Meaning, ModelRow, Slice, StoreError};
use conclusion::{Conclusion, broke};
pub(super) use current::{After, SliceWorker};
use current::{Computed, Current, End};
use greybox::identification::{DatasetId, JobId};
use greybox::recording::Recording;

/// How often what a slice did is written.
const FLUSH_INTERVAL: Duration = Duration::from_millis(200);

/// Candidates that are read back at a time when a slice goes on.
const CANDIDATES_AT_ONCE: usize = 50_000;

/// Lives of the server in a row that may end with a job, none of them without it, before it fails.
const DEATH_LIMIT: u32 = 10;

/// What a job is worked from: the stored model, where a user wrote the model, the recordings with
/// their digests, the finished job that the job goes on from, and the stream that it goes through.
pub(super) struct Materials {
    pub(super) model: Option<ModelRow>,
    pub(super) datasets: Vec<(String, Arc<Recording>)>,
    pub(super) past: Option<Past>,
    pub(super) stream: Option<Arc<dyn StreamReader>>,
}

/// What lets a slice compute.
struct Turn {
    /// The entry of the queue.
    entry: i64,
    permit: Permit,
}

/// What a slice works on.
enum Begun {
    /// The run that the slice before left.
    Kept(Box<dyn Run>),
    /// A run that is begun, or resumed from its checkpoint, with what it is made of.
    New(Box<Materials>),
}

impl SliceWorker {
    /// Works slices for an entry of the project's queue, for as long as nobody else waits.
    pub(super) async fn work(
        &self,
        project: Project,
        id: JobId,
        entry: i64,
    ) -> Result<After, StoreError> {
        let taken = Instant::now();
        loop {
            let permit = self.admission.take(project.as_str()).await;
            if self.active.all_are_stopped() {
                self.store.queue().give_back(id, entry).await?;
                return Ok(After::Done);
            }
            let Some(job) = self.active.take(id) else {
                return Ok(After::Later);
            };
            let slice = self.slice(&job, Some(Turn { entry, permit }), taken);
            match slice.instrument(span::slice(id, &project)).await? {
                After::Again => {}
                after => return Ok(after),
            }
        }
    }

    /// Ends a job that was asked to stop and is between two slices; a job at work is reported to.
    pub(super) async fn settle(&self, id: JobId) -> Result<(), StoreError> {
        if let Some(job) = self.active.take(id) {
            job.stop_flag().store(true, Ordering::Relaxed);
            self.slice(&job, None, Instant::now()).await?;
        } else {
            self.active.stop(id);
        }
        Ok(())
    }

    async fn slice(
        &self,
        job: &ActiveJob,
        turn: Option<Turn>,
        entry_taken: Instant,
    ) -> Result<After, StoreError> {
        let (entry, permit) = turn.map(|turn| (turn.entry, turn.permit)).unzip();
        let slices = self.store.slices();
        let slice = match slices.begin(job.id(), entry, DEATH_LIMIT).await? {
            Begin::Slice(slice) => *slice,
            Begin::NotYet => return Ok(After::NotYet),
            Begin::Nothing | Begin::Ended => return Ok(After::Done),
        };
        let stop = job.stop_flag();
        if slice.stop_request().is_some() {
            stop.store(true, Ordering::Relaxed);
        }
        let kept = self.kept_runs.take(slice.lease);
        let last_part = kept.as_ref().map_or(0, |kept| kept.last_part);
        let current = Current {
            lease: slice.lease,
            started: Instant::now(),
            entry_taken,
            forgot_candidates: kept.is_none() && !slice.is_first,
            time_left: time_left(&slice),
            stop,
            exchange: Arc::new(Exchange::new(
                self.store.nodes().share().is_some(),
                slice.is_shared,
                last_part,
            )),
        };
        let (run, candidates) = kept.map(|kept| (kept.run, kept.candidates)).unzip();
        let candidates = candidates.unwrap_or_else(|| Candidates::new(self.max_candidates));
        let mut recorder = Recorder::new(&slice, candidates);
        let begun = match run {
            Some(run) => Ok(Begun::Kept(run)),
            None => self
                .or_damage(self.materials(&slice.job).await)?
                .flatten()
                .map(|materials| Begun::New(Box::new(materials))),
        };
        let computed = match begun {
            Ok(begun) => {
                let (sender, units) = units::channel();
                let computation = self.compute(slice, begun, &current, sender);
                let written = self.write_units(&current, &mut recorder, units).await;
                let computed = computation.await;
                match self.or_damage(written)? {
                    Ok(Hold::Kept) => computed,
                    Ok(Hold::Lost) => return Ok(After::Done),
                    Err(failure) => Err(failure),
                }
            }
            Err(failure) => Err(failure),
        };
        let conclusion = Conclusion {
            worker: self,
            permit,
            current,
            recorder,
        };
        conclusion.draw(computed).await
    }

    /// The value that was read or written, or why the job fails: a damaged row does not read at another attempt.
    fn or_damage<T>(&self, done: Result<T, StoreError>) -> Result<Result<T, Failure>, StoreError> {
        match done {
            Err(error) if error.meaning() == Meaning::Damaged => {
                self.store.damage().note(&error);
                Ok(Err(Failure::damaged_data(&error)))
            }
            done => done.map(Ok),
        }
    }

    /// What a job is worked from.
    pub(super) async fn materials(
        &self,
        job: &JobRow,
    ) -> Result<Result<Materials, Failure>, StoreError> {
        let model = self.store.models().by_reference(&job.model).await?;
        let datasets = match self.recordings(&job.task.datasets()).await? {
            Ok(datasets) => datasets,
            Err(failure) => return Ok(Err(failure)),
        };
        let past = match job.task.past_job() {
            Some(id) => self.past(id).await?.map(Some),
            None => Ok(None),
        };
        let past = match past {
            Ok(past) => past,
            Err(failure) => return Ok(Err(failure)),
        };
        let stream = match job.task.stream() {
            Some(name) => stored_stream(&self.store, &job.project, name)
                .await?
                .map(Some),
            None => Ok(None),
        };
        Ok(stream.map(|stream| Materials {
            model,
            datasets,
            past,
            stream,
        }))
    }

    /// The finished job that a job goes on from.
    async fn past(&self, id: JobId) -> Result<Result<Past, Failure>, StoreError> {
        let job = self.store.jobs().find(id).await?;
        let result = self.store.results().find(id).await?;
        let spec = job.as_ref().and_then(|job| job.task.identification());
        let (Some(spec), Some(result)) = (spec, result) else {
            let detail = format!("the job {id} or its result is no longer stored");
            return Ok(Err(Failure::cannot_run(detail, Vec::new())));
        };
        let past = result.outcome().map(|outcome| Past {
            spec: spec.clone(),
            outcome,
        });
        Ok(past.map_err(|error| {
            let detail = format!("a stored job does not read back: {error}");
            Failure::cannot_run(detail, Vec::new())
        }))
    }

    /// Recordings with their digests.
    async fn recordings(
        &self,
        datasets: &[DatasetId],
    ) -> Result<Result<Vec<(String, Arc<Recording>)>, Failure>, StoreError> {
        let mut recordings = Vec::new();
        for id in datasets.iter().copied() {
            let row = self.store.datasets().find(id).await?;
            let recording = self.store.datasets().recording(id).await?;
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
        begun: Begun,
        current: &Current,
        units: UnitSender,
    ) -> impl Future<Output = Computed> + use<> {
        let method = self.method.clone();
        let (stop, exchange) = (current.stop.clone(), current.exchange.clone());
        // After a crash a single unit, so that a job which is not to blame has a checkpoint again
        // before the server may go down once more.
        let slice_length = match slice.job.attempt {
            0 | 1 => self.slice_length,
            _ => Duration::ZERO,
        };
        let computation = tokio::task::spawn_blocking(move || {
            let mut run = match begun {
                Begun::Kept(run) => run,
                Begun::New(materials) => method.begin(Assignment {
                    job: slice.job,
                    model: materials.model,
                    datasets: materials.datasets,
                    past: materials.past,
                    stream: materials.stream,
                    checkpoint: slice.checkpoint.map(|checkpoint| checkpoint.state),
                })?,
            };
            let end = advance(&mut *run, slice_length, &stop, &exchange, &units);
            Ok((run, end))
        });
        async { computation.await.unwrap_or_else(|error| Err(broke(error))) }
    }

    /// Writes what the computation sends until it returns.
    async fn write_units(
        &self,
        current: &Current,
        recorder: &mut Recorder,
        mut units: UnitReceiver,
    ) -> Result<Hold, StoreError> {
        if current.forgot_candidates
            && let Err(error) = self.recall(current.lease, recorder).await
        {
            current.stop.store(true, Ordering::Relaxed);
            return Err(error);
        }
        let first = tokio::time::Instant::now() + FLUSH_INTERVAL;
        let mut flush = tokio::time::interval_at(first, FLUSH_INTERVAL);
        let out_of_time = tokio::time::sleep(current.time_left.unwrap_or(Duration::MAX));
        tokio::pin!(out_of_time);
        loop {
            let is_due = tokio::select! {
                () = units.woken() => false,
                _ = flush.tick() => true,
                () = &mut out_of_time, if !out_of_time.is_elapsed() => {
                    current.stop.store(true, Ordering::Relaxed);
                    false
                }
            };
            if !units.take_waiting(|unit| take(recorder, unit, current.started)) {
                return Ok(Hold::Kept);
            }
            if !is_due {
                continue;
            }
            let written = self.flush(current.lease, recorder).await;
            if !matches!(written, Ok(Hold::Kept)) {
                current.stop.store(true, Ordering::Relaxed);
                return written;
            }
            if let Some(after) = current.exchange.wanted_after() {
                self.receive_parts(current, after).await?;
            }
        }
    }

    /// Receives the parts of other nodes after the part with a number.
    async fn receive_parts(&self, current: &Current, after: i64) -> Result<(), StoreError> {
        let work_shares = self.store.work_shares();
        let parts = work_shares.after(current.lease.job, after).await;
        let (parts, last) = parts.inspect_err(|_| {
            current.stop.store(true, Ordering::Relaxed);
        })?;
        let share = self.store.nodes().share();
        let share = share.map(|(index, of)| Share { index, of });
        current.exchange.receive(parts, last, share);
        Ok(())
    }

    /// Reads back which candidates are kept, beside a computation that has forgotten them.
    async fn recall(&self, lease: Lease, recorder: &mut Recorder) -> Result<(), StoreError> {
        let mut after = Some(0);
        while let Some(generation) = after {
            let kept =
                self.store
                    .candidates()
                    .page(lease.job, generation, u32::MAX, CANDIDATES_AT_ONCE);
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
        self.store.slices().record(lease, recorder.record()).await
    }
}

/// Records a unit of a slice that began at an instant.
fn take(recorder: &mut Recorder, unit: Unit, slice_began: Instant) {
    for row in unit.rows {
        recorder.take(row, unit.ended_at);
    }
    recorder.take_parts(unit.parts);
    recorder.note(unit.progress, unit.ended.duration_since(slice_began));
}

/// Works units until the run has finished, the time is up or the flag is raised.
fn advance(
    run: &mut dyn Run,
    slice_length: Duration,
    stop: &AtomicBool,
    exchange: &Exchange,
    units: &UnitSender,
) -> End {
    let started = Instant::now();
    loop {
        if stop.load(Ordering::Relaxed) {
            return End::Stopped;
        }
        if exchange.deliver(run) {
            return End::TimeIsUp;
        }
        let mut rows = Vec::new();
        let begun = Instant::now();
        let advance = run.advance(stop, &mut |row| rows.push(row));
        let unit = Unit {
            rows,
            parts: exchange.collect(run, begun.elapsed()),
            progress: run.progress(),
            ended_at: Timestamp::now(),
            ended: Instant::now(),
        };
        if !units.send(unit) {
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

/// The time that a job may still work, where it has a limit.
fn time_left(slice: &Slice) -> Option<Duration> {
    let limit = slice.job.task.limits().max_duration_s;
    let limit = Duration::try_from_secs_f64(limit).ok()?;
    Some(limit.saturating_sub(Duration::from_millis(slice.running_ms)))
}
