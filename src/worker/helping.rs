//! Helps with what other nodes analyse, while this one has nothing to do.
//!
//! A helper resumes the job's run from its checkpoint as the next slice would, does refits of an analysis or
//! searches ahead of the one at work, of one share after the other, and writes them; the node that works the job takes them over. It holds no right to the
//! job: whatever becomes of a helper, the job comes to the same bits.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tokio_util::sync::CancellationToken;

use super::exchange::Pace;
use super::places::Place;
use super::run::{Assignment, Helped, Run, Share};
use super::slice::SliceWorker;
use crate::event::EventHub;
use crate::job::JobId;
use crate::store::{SharedPart, StoreError};

/// How soon it is looked again where nobody wants help, and where there was none to give.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);
/// How often it is looked whether a helper has to make room.
const ROOM_INTERVAL: Duration = Duration::from_millis(20);

/// Helps until the server goes down.
pub(super) async fn run(slices: SliceWorker, hub: EventHub, closing: CancellationToken) {
    // One that could not be helped with is not tried again at once.
    let mut but = Vec::new();
    loop {
        match help_one(&slices, &but, &closing).await {
            Ok(Some(helped)) => but = vec![helped],
            Ok(None) => but.clear(),
            Err(error) => tracing::error!(%error, "another node could not be helped"),
        }
        tokio::select! {
            () = closing.cancelled() => return,
            () = hub.help_wanted() => {}
            () = tokio::time::sleep(LOOK_INTERVAL) => {}
        }
    }
}

/// Helps with one job, for as long as nobody waits for the place; answers which.
async fn help_one(
    slices: &SliceWorker,
    but: &[JobId],
    closing: &CancellationToken,
) -> Result<Option<JobId>, StoreError> {
    if slices.store.share().is_none() {
        return Ok(None);
    }
    let Some(id) = slices.store.job_to_help(but).await? else {
        return Ok(None);
    };
    let Some(job) = slices.store.job(id).await? else {
        return Ok(None);
    };
    let Some(place) = slices.places.take_free(job.project.clone()) else {
        return Ok(None);
    };
    let (materials, checkpoint) = (
        slices.materials(&job).await?,
        slices.store.checkpoint(id).await?,
    );
    let (Ok(materials), Some(checkpoint)) = (materials, checkpoint) else {
        return Ok(Some(id));
    };
    let assignment = Assignment {
        job: (*job).clone(),
        model: materials.model,
        datasets: materials.datasets,
        past: materials.past,
        checkpoint: Some(checkpoint.state),
    };
    let method = slices.method.clone();
    let begun = tokio::task::spawn_blocking(move || method.begin(assignment)).await;
    if let Ok(Ok(run)) = begun {
        let helper = Helper {
            slices,
            id,
            stop: Arc::default(),
        };
        helper.help(run, place, closing).await?;
    }
    Ok(Some(id))
}

/// What a helper is to do.
struct Asked {
    /// What others did meanwhile.
    came: Vec<SharedPart>,
    share: Share,
    at_most: u32,
}

struct Helper<'a> {
    slices: &'a SliceWorker,
    id: JobId,
    stop: Arc<AtomicBool>,
}

impl Helper<'_> {
    /// Does shares until nothing is left, the job has ended, or the place is wanted.
    async fn help(
        &self,
        mut run: Box<dyn Run>,
        place: Place,
        closing: &CancellationToken,
    ) -> Result<(), StoreError> {
        let store = &self.slices.store;
        let (mut known, mut shares_done, mut pace) = (0, 0, Pace::default());
        while let Some((index, of)) = store.share().filter(|(_, of)| shares_done < *of) {
            let (came, last) = store.shared_parts(self.id, known).await?;
            known = last;
            let share = Share {
                index: (index + shares_done) % of,
                of,
            };
            let asked = Asked {
                came,
                share,
                at_most: pace.at_most(),
            };
            let begun = Instant::now();
            let Some((again, helped)) = self.compute(run, asked, closing).await else {
                break;
            };
            run = again;
            pace.note(helped.refits + helped.generations, begun.elapsed());
            if helped.parts.is_empty() {
                shares_done += 1;
            } else if !store.help_with(self.id, helped.parts).await? {
                break;
            }
            let counter = |name, number: usize| metrics::counter!(name).increment(number as u64);
            counter("greybox_refits_for_others_total", helped.refits);
            counter("greybox_generations_for_others_total", helped.generations);
            if self.stop.load(Ordering::Relaxed) {
                break;
            }
        }
        drop(place);
        Ok(())
    }

    /// Does something on a blocking thread; raises the flag when the place is wanted. Nothing where the
    /// computation broke.
    async fn compute(
        &self,
        mut run: Box<dyn Run>,
        asked: Asked,
        closing: &CancellationToken,
    ) -> Option<(Box<dyn Run>, Helped)> {
        let stop = self.stop.clone();
        let mut computing = tokio::task::spawn_blocking(move || {
            run.take_parts(asked.came);
            let helped = run.help(asked.share, asked.at_most, &stop);
            (run, helped)
        });
        loop {
            tokio::select! {
                computed = &mut computing => return computed.ok(),
                () = tokio::time::sleep(ROOM_INTERVAL) => {
                    if closing.is_cancelled() || self.slices.places.are_waited_for() {
                        self.stop.store(true, Ordering::Relaxed);
                    }
                }
            }
        }
    }
}
