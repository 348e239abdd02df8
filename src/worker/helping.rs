//! Helps with what other nodes work, while this one has nothing to do.
//!
//! A helper resumes the job's run from its checkpoint as the next slice would, does refits of an analysis or
//! searches ahead of the one at work, of one share after the other, and writes them; the node that works the
//! job takes them over. It holds no right to the job: whatever becomes of a helper, the job comes to the same
//! bits.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tokio_util::sync::CancellationToken;

use super::exchange::Pace;
use super::run::{Assignment, Helped, Run, Share};
use super::slice::SliceWorker;
use crate::admission::Permit;
use crate::event::EventHub;
use crate::store::{SharedPart, StoreError};
use greybox::identification::JobId;

/// How soon it is looked again where nobody wants help.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);
/// How long a job is left alone at the most with which there was nothing to help.
const LONGEST_PAUSE: Duration = Duration::from_secs(30);
/// How often it is looked whether a helper has to make room.
const ROOM_INTERVAL: Duration = Duration::from_millis(20);

/// Helps until the server goes down.
pub(super) async fn run(slices: SliceWorker, hub: EventHub, closing: CancellationToken) {
    let mut pauses = Pauses::default();
    loop {
        match help_one(&slices, &pauses.at(Instant::now()), &closing).await {
            Ok(Some((id, parts))) => pauses.note(id, parts, Instant::now()),
            Ok(None) => {}
            Err(error) => {
                slices.store.damage().note(&error);
                tracing::error!(%error, "another node could not be helped");
            }
        }
        tokio::select! {
            () = closing.cancelled() => return,
            () = hub.help_wanted() => pauses = Pauses::default(),
            () = tokio::time::sleep(LOOK_INTERVAL) => {}
        }
    }
}

/// Jobs that are left alone for a while, because there was nothing to help with: for longer each time.
#[derive(Debug, Default)]
struct Pauses(HashMap<JobId, (Instant, Duration)>);

impl Pauses {
    /// The jobs that are left alone at `now`.
    fn at(&self, now: Instant) -> Vec<JobId> {
        let paused = self.0.iter().filter(|(_, (until, _))| *until > now);
        paused.map(|(id, _)| *id).collect()
    }

    /// Notes how much was done of a job.
    fn note(&mut self, id: JobId, parts: usize, now: Instant) {
        // Jobs that were not met for long have ended.
        self.0
            .retain(|_, (until, _)| now.duration_since(*until) < LONGEST_PAUSE);
        let before = self.0.get(&id).map(|(_, pause)| *pause * 2);
        let pause = before
            .filter(|_| parts == 0)
            .unwrap_or(LOOK_INTERVAL)
            .min(LONGEST_PAUSE);
        self.0.insert(id, (now + pause, pause));
    }
}

/// Helps with one job, for as long as nobody waits for the permit; answers which, and how many parts it did.
async fn help_one(
    slices: &SliceWorker,
    but: &[JobId],
    closing: &CancellationToken,
) -> Result<Option<(JobId, usize)>, StoreError> {
    if slices.store.nodes().share().is_none() {
        return Ok(None);
    }
    let Some(id) = slices.store.work_shares().job_to_help(but).await? else {
        return Ok(None);
    };
    let Some(job) = slices.store.jobs().find(id).await? else {
        return Ok(None);
    };
    let Some(permit) = slices.admission.take_free(job.project.as_str()) else {
        return Ok(None);
    };
    let (materials, checkpoint) = (
        slices.materials(&job).await?,
        slices.store.checkpoints().find(id).await?,
    );
    let (Ok(materials), Some(checkpoint)) = (materials, checkpoint) else {
        return Ok(Some((id, 0)));
    };
    let assignment = Assignment {
        job: (*job).clone(),
        model: materials.model,
        datasets: materials.datasets,
        past: materials.past,
        stream: materials.stream,
        checkpoint: Some(checkpoint.state),
    };
    let method = slices.method.clone();
    let begun = tokio::task::spawn_blocking(move || method.begin(assignment)).await;
    let Ok(Ok(run)) = begun else {
        return Ok(Some((id, 0)));
    };
    let helper = Helper {
        slices,
        id,
        stop: Arc::default(),
    };
    let parts = helper.help(run, permit, closing).await?;
    Ok(Some((id, parts)))
}

/// What a helper is to do.
struct Asked {
    /// Parts that other nodes did meanwhile.
    received: Vec<SharedPart>,
    share: Share,
    at_most: u32,
}

struct Helper<'a> {
    slices: &'a SliceWorker,
    id: JobId,
    stop: Arc<AtomicBool>,
}

impl Helper<'_> {
    /// Does shares until nothing is left, the job has ended, or the permit is wanted; answers how many parts.
    async fn help(
        &self,
        mut run: Box<dyn Run>,
        permit: Permit,
        closing: &CancellationToken,
    ) -> Result<usize, StoreError> {
        let store = &self.slices.store;
        let (mut last_part, mut shares_done, mut pace) = (0, 0, Pace::default());
        let mut parts = 0;
        while let Some((index, of)) = store.nodes().share().filter(|(_, of)| shares_done < *of) {
            let (received, last) = store.work_shares().after(self.id, last_part).await?;
            last_part = last;
            let share = Share {
                index: (index + shares_done) % of,
                of,
            };
            let asked = Asked {
                received,
                share,
                at_most: pace.at_most(),
            };
            let begun = Instant::now();
            let Some((again, helped)) = self.compute(run, asked, closing).await else {
                break;
            };
            run = again;
            parts += helped.parts.len();
            pace.note(helped.refits + helped.generations, begun.elapsed());
            if helped.parts.is_empty() {
                shares_done += 1;
            } else if !store.work_shares().help_with(self.id, helped.parts).await? {
                break;
            }
            let counter = |name, number: usize| metrics::counter!(name).increment(number as u64);
            counter("greybox_refits_for_others_total", helped.refits);
            counter("greybox_generations_for_others_total", helped.generations);
            if self.stop.load(Ordering::Relaxed) {
                break;
            }
        }
        drop(permit);
        Ok(parts)
    }

    /// Does something on a blocking thread; raises the flag when the permit is wanted. Nothing where the
    /// computation broke.
    async fn compute(
        &self,
        mut run: Box<dyn Run>,
        asked: Asked,
        closing: &CancellationToken,
    ) -> Option<(Box<dyn Run>, Helped)> {
        let stop = self.stop.clone();
        let mut computing = tokio::task::spawn_blocking(move || {
            run.take_parts(asked.received);
            let helped = run.help(asked.share, asked.at_most, &stop);
            (run, helped)
        });
        loop {
            tokio::select! {
                computed = &mut computing => return computed.ok(),
                () = tokio::time::sleep(ROOM_INTERVAL) => {
                    if closing.is_cancelled() || self.slices.admission.is_waited_for() {
                        self.stop.store(true, Ordering::Relaxed);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_with_nothing_to_help_is_looked_at_less_and_less_often() {
        let (id, begun, mut now) = (JobId::new(), Instant::now(), Instant::now());
        let mut pauses = Pauses::default();
        let mut looks = 0;
        while now < begun + Duration::from_mins(10) {
            if pauses.at(now).is_empty() {
                pauses.note(id, 0, now);
                looks += 1;
            }
            now += LOOK_INTERVAL;
        }
        assert!((20..40).contains(&looks), "{looks} in ten minutes");
        pauses.note(id, 5, now);
        assert!(pauses.at(now + LOOK_INTERVAL).is_empty(), "it helped");
    }
}
