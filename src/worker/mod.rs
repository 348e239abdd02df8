//! Works the jobs: River hands out slices, this module works them and ends those asked to stop.
//!
//! ```text
//! River ──entry──▶ slice ──spawn_blocking──▶ Run (the method)
//!                    ▲ │                        │ rows
//!       stop flag ───┘ └── store ◀── recorder ◀────┘
//! ```

mod active;
mod candidates;
mod design;
mod exchange;
mod helping;
mod identification;
mod kept_runs;
pub mod method;
mod recorder;
pub mod run;
mod selection;
mod slice;
mod stored_stream;
#[cfg(test)]
pub(crate) mod tests;
mod units;
mod wake;

use std::sync::Arc;
use std::time::Duration;

use riverqueue::{
    Client, Job, MaintenanceConfig, Retention, RetryPolicy, Stopper, WorkContext, WorkError,
    WorkOutcome, Workers,
};
use tokio::sync::{Semaphore, watch};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::event::EventHub;
use crate::store::{QUEUE, SliceOfJob, Store, StoreError, project_of};
use greybox::identification::JobId;

use crate::admission::Admission;
use active::ActiveJobs;
use kept_runs::KeptRuns;
use run::Method;
use slice::{After, SliceWorker};
use wake::Wake;

/// When River takes a slice for stuck. What a dead server left is taken over by others (see `nodes` of the
/// store), so this is only for a slice that never returns.
const RESCUE_AFTER: Duration = Duration::from_hours(24);
/// How long the entry of a job stays that was handed on with another one.
const ENTRIES_KEPT: Duration = Duration::from_secs(60);
/// How soon a slice that the database refused is tried again.
const RETRY_AFTER: Duration = Duration::from_secs(1);
/// How soon an entry whose job is at work is looked at again.
const LOOK_AGAIN_AFTER: Duration = Duration::from_millis(100);
/// How soon a job that lives of the server ended with is looked at again.
const NOT_YET_AFTER: Duration = Duration::from_secs(1);
/// How often it is looked whether the clock was set back.
const CLOCK_INTERVAL: Duration = Duration::from_millis(500);
/// The least time between two looks for jobs that were asked to stop.
const STOP_COOLDOWN: Duration = Duration::from_millis(20);

/// How jobs are worked.
#[derive(Clone, Copy, Debug)]
pub struct WorkerSettings {
    /// Jobs at work at the same time.
    pub jobs_at_once: usize,
    /// How long a slice works before others have their turn.
    pub slice_length: Duration,
    /// Candidates that are kept of a job at the most.
    pub max_candidates: u64,
}

/// Works the jobs of a store until it is shut down.
pub struct Worker {
    slices: SliceWorker,
    river: Stopper,
    closing: CancellationToken,
    tasks: JoinSet<()>,
    alive: watch::Receiver<bool>,
}

impl Worker {
    /// Begins to work.
    pub fn start(
        store: Store,
        hub: EventHub,
        method: Arc<dyn Method>,
        settings: WorkerSettings,
    ) -> Result<Self, StoreError> {
        let slices = SliceWorker {
            method,
            active: ActiveJobs::default(),
            kept_runs: KeptRuns::new(settings.jobs_at_once),
            admission: Admission::new(settings.jobs_at_once),
            slice_length: settings.slice_length,
            max_candidates: settings.max_candidates,
            store,
        };
        // Twice as many jobs are taken as run at once: each waiting job follows one that ends.
        let taken_at_once = settings.jobs_at_once.saturating_mul(2);
        let client = river(&slices, taken_at_once)?;
        let wake = Wake::new(client.clone(), taken_at_once);
        let mut running = client.start()?;
        let river = running.stopper();
        let closing = CancellationToken::new();
        let (alive_sender, alive) = watch::channel(true);
        let mut tasks = JoinSet::new();
        tasks.spawn(async move {
            if let Err(error) = running.wait().await {
                tracing::error!(%error, "the queue stopped working");
            }
            alive_sender.send_replace(false);
        });
        tasks.spawn(wake.run(slices.store.clone(), hub.clone(), closing.clone()));
        tasks.spawn(watch_clock(slices.store.clone(), closing.clone()));
        if slices.store.is_shared() {
            tasks.spawn(helping::run(slices.clone(), hub.clone(), closing.clone()));
        }
        tasks.spawn(watch_stop_requests(
            slices.clone(),
            hub,
            settings.jobs_at_once,
            closing.clone(),
        ));
        Ok(Self {
            slices,
            river,
            closing,
            tasks,
            alive,
        })
    }

    /// Whether slices are being worked; for readiness.
    pub fn alive(&self) -> watch::Receiver<bool> {
        self.alive.clone()
    }

    /// Hands the slices at work back to the queue, each with a checkpoint, and stops.
    pub async fn shutdown(mut self) {
        self.river.stop();
        self.closing.cancel();
        self.slices.active.stop_all();
        while let Some(ended) = self.tasks.join_next().await {
            if let Err(error) = ended {
                tracing::error!(%error, "a task of the worker ended badly");
            }
        }
    }
}

fn river(slices: &SliceWorker, taken_at_once: usize) -> Result<Client, StoreError> {
    let mut workers = Workers::new();
    workers.add(slices.clone())?;
    let maintenance = MaintenanceConfig::default()
        .with_rescue_after(RESCUE_AFTER)
        .with_completed_job_retention(Retention::DeleteAfter(ENTRIES_KEPT));
    Ok(slices
        .store
        .queue()
        .client()
        .workers(workers)
        .queue(QUEUE, wake::configuration(taken_at_once))
        .fetch_cooldown(wake::COOLDOWN)
        .without_notifications()
        .retry_policy(TryAgainSoon)
        .maintenance(maintenance)
        .without_job_timeout()
        .build()?)
}

impl riverqueue::Worker<SliceOfJob> for SliceWorker {
    type Error = StoreError;

    async fn work(
        &self,
        _context: WorkContext,
        entry: Job<SliceOfJob>,
    ) -> Result<WorkOutcome, StoreError> {
        let job = entry.args.job;
        let project = project_of(&entry.row.queue);
        match SliceWorker::work(self, project, job, entry.row.id).await {
            Ok(After::Later) => Ok(WorkOutcome::Snooze(LOOK_AGAIN_AFTER)),
            Ok(After::NotYet) => Ok(WorkOutcome::Snooze(NOT_YET_AFTER)),
            Ok(After::Done | After::Again) => Ok(WorkOutcome::Complete),
            Err(error) => {
                self.store.damage().note(&error);
                tracing::error!(%job, %error, "a slice could not be worked and is tried again");
                Err(error)
            }
        }
    }
}

/// The database refused a slice: it may not the next time.
struct TryAgainSoon;

impl RetryPolicy for TryAgainSoon {
    fn next_retry(
        &self,
        _entry: &riverqueue::JobRow,
        _error: &WorkError,
        _now: jiff::Timestamp,
    ) -> Duration {
        RETRY_AFTER
    }
}

/// Stops the jobs that are asked to: raises the flag of those at work, ends those between slices.
async fn watch_stop_requests(
    slices: SliceWorker,
    hub: EventHub,
    at_once: usize,
    closing: CancellationToken,
) {
    let permits = Arc::new(Semaphore::new(at_once));
    let mut settling = JoinSet::new();
    loop {
        match slices.store.jobs().stop_requests().await {
            Ok(jobs) => {
                for job in jobs {
                    settling.spawn(settle(slices.clone(), job, permits.clone()));
                }
            }
            Err(error) => tracing::error!(%error, "stop requests could not be read"),
        }
        tokio::time::sleep(STOP_COOLDOWN).await;
        tokio::select! {
            () = closing.cancelled() => break,
            () = hub.stop_requested() => {}
            // One that ended may have left a request that came too late for it.
            Some(_) = settling.join_next(), if !settling.is_empty() => {}
        }
    }
    while settling.join_next().await.is_some() {}
}

/// Lets no job wait for a clock that was set back: the queue goes by the time of day.
async fn watch_clock(store: Store, closing: CancellationToken) {
    let mut due = tokio::time::interval(CLOCK_INTERVAL);
    loop {
        tokio::select! {
            () = closing.cancelled() => return,
            _ = due.tick() => {}
        }
        if let Err(error) = store.queue().free_entries_of_the_future().await {
            tracing::error!(%error, "slices that wait for a clock could not be looked for");
        }
    }
}

async fn settle(slices: SliceWorker, job: JobId, permits: Arc<Semaphore>) {
    if slices.active.stop(job) {
        return;
    }
    let _permit = permits
        .acquire()
        .await
        .expect("the semaphore is never closed");
    if let Err(error) = slices.settle(job).await {
        tracing::error!(%job, %error, "a job could not be stopped and is tried again");
    }
}
