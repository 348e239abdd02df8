//! Work for requests beside the threads that serve: few at a time, and none that nobody waits for.
//!
//! Nothing here is held while a client is waited for: a body has come before its work begins, and an
//! answer is made before it is sent. Reading and writing documents takes moments and has places of
//! its own; computing may take seconds, is bounded in time, and is told to stop when its client
//! leaves, when its time is up and when the server goes down.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::http::StatusCode;

use super::admission::Limited;
use super::background::Background;
use super::error::{Answer, Kind, Problem};
use super::limits::Limits;
use crate::admission::Permit;
use crate::event::EventHub;

/// How long a client may let the server compute.
const LONGEST_COMPUTATION: Duration = Duration::from_secs(20);
/// How long a computation whose time is up may take to say what it has.
const LAST_ANSWER: Duration = Duration::from_secs(2);

/// From how many bytes on a recording is read and written in the background.
pub(super) const LARGE_BYTES: usize = 128 << 10;
/// How many small recordings there may be in memory for each large one.
const SMALL_FOR_A_LARGE: usize = 16;

const TOO_MANY_RECORDINGS: &str = "too many recordings at once";

/// Raises a stop flag when it goes out of scope.
struct StopOnDrop(Arc<AtomicBool>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Where work for requests is done. Cheap to clone.
#[derive(Clone)]
pub struct Work {
    /// Ends computations when the server goes down.
    hub: EventHub,
    /// Documents and small recordings that are read or written at the same time.
    conversions: Limited,
    /// Large recordings that are read or written at the same time; they keep no small one waiting.
    large_conversions: Limited,
    /// Computations for clients that wait.
    computations: Limited,
    /// Recordings that are in memory.
    recordings: Limited,
    /// Small recordings that are in memory; none waits for a large one.
    small_recordings: Limited,
    /// Threads that compute for clients that wait.
    computing: Background,
    /// Threads that read and write large recordings.
    converting: Background,
}

impl Work {
    /// Work within limits.
    pub(super) fn new(limits: &Limits, hub: EventHub) -> Self {
        Self {
            hub,
            conversions: Limited::new(limits.conversions_at_once, "too many documents at once"),
            large_conversions: Limited::new(
                limits.conversions_at_once,
                "too many large recordings at once",
            ),
            computations: Limited::new(
                limits.computations_at_once,
                "too many computations at once",
            ),
            recordings: Limited::new(limits.recordings_at_once, TOO_MANY_RECORDINGS),
            small_recordings: Limited::new(
                SMALL_FOR_A_LARGE * limits.recordings_at_once,
                TOO_MANY_RECORDINGS,
            ),
            computing: Background::new("request", limits.computations_at_once, limits.threads / 2),
            converting: Background::new("recording", limits.conversions_at_once, 1),
        }
    }

    /// A whole recording takes memory: only so many at once, others wait.
    pub(super) async fn recording_permit(&self) -> Answer<Permit> {
        self.recordings.take().await
    }

    /// As [`Self::recording_permit`], for a recording of so many bytes.
    pub(super) async fn recording_permit_of(&self, bytes: usize) -> Answer<Permit> {
        let recordings = match bytes < LARGE_BYTES {
            true => &self.small_recordings,
            false => &self.recordings,
        };
        recordings.take().await
    }

    /// Runs what reads or writes a document: moments, whatever it holds.
    pub(super) async fn convert<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> Answer<T> + Send + 'static,
    ) -> Answer<T> {
        let place = self.conversions.take().await?;
        let done = tokio::task::spawn_blocking(move || {
            let _place = place;
            work()
        });
        done.await.unwrap_or_else(|panic| Err(panicked(panic)))
    }

    /// Runs what reads or writes so many bytes of a recording: many of them in the background.
    pub(super) async fn convert_bytes<T: Send + 'static>(
        &self,
        bytes: usize,
        work: impl FnOnce() -> Answer<T> + Send + 'static,
    ) -> Answer<T> {
        if bytes < LARGE_BYTES {
            return self.convert(work).await;
        }
        let place = self.large_conversions.take().await?;
        let done = self.converting.run(place, work).await;
        done.unwrap_or_else(|panic| Err(panicked(panic)))
    }

    /// Runs what computes. It looks at the flag, and comes to its end soon after that was raised.
    pub(super) async fn compute<T: Send + 'static>(
        &self,
        work: impl FnOnce(&AtomicBool) -> Answer<T> + Send + 'static,
    ) -> Answer<T> {
        let place = self.computations.take().await?;
        let stop = Arc::new(AtomicBool::new(false));
        let _stop_when_the_client_leaves = StopOnDrop(stop.clone());
        let flag = stop.clone();
        let computing = self.computing.clone();
        let done = async move {
            let done = computing.run(place, move || work(&flag)).await;
            done.unwrap_or_else(|panic| Err(panicked(panic)))
        };
        tokio::pin!(done);
        tokio::select! {
            done = &mut done => done,
            () = tokio::time::sleep(LONGEST_COMPUTATION) => {
                stop.store(true, Ordering::Relaxed);
                // The computation may have an answer by now.
                match tokio::time::timeout(LAST_ANSWER, &mut done).await {
                    Ok(Ok(answer)) => Ok(answer),
                    _ => Err(too_long()),
                }
            }
            () = self.hub.closed() => Err(Problem::shutting_down()),
        }
    }
}

/// The answer to a request whose work panicked.
fn panicked(panic: impl std::fmt::Display) -> Problem {
    metrics::counter!("greybox_panics_total").increment(1);
    tracing::error!(%panic, "work for a request panicked");
    Problem::of_status(StatusCode::INTERNAL_SERVER_ERROR)
}

fn too_long() -> Problem {
    let detail = format!(
        "this takes longer than {} s; ask for a shorter part of the recording",
        LONGEST_COMPUTATION.as_secs()
    );
    Problem::new(Kind::Invalid, detail)
}

/// A computation that was told to stop; whoever told it does not wait for the answer.
pub(super) fn stopped() -> Problem {
    Problem::new(Kind::Busy, "the computation was stopped").retry_after(2)
}

#[cfg(test)]
mod tests {
    use std::sync::{Barrier, mpsc};

    use axum::response::IntoResponse;
    use rayon::prelude::*;

    use super::*;
    use crate::api::admission::as_caller;
    use crate::api::state::tests::state;

    /// Computes until it is told to stop, and says so.
    fn endless(told: mpsc::Sender<()>) -> impl FnOnce(&AtomicBool) -> Answer<()> + Send + 'static {
        move |stop| {
            wait_for(stop);
            told.send(()).expect("somebody waits");
            Ok(())
        }
    }

    async fn ask(work: Work, told: mpsc::Sender<()>) -> Answer<()> {
        work.compute(endless(told)).await
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_computation_that_nobody_waits_for_is_told_to_stop() {
        let (state, _folder) = state().await;
        let (told, stopped) = mpsc::channel();
        let client = tokio::spawn(ask(state.work.clone(), told));
        while state.work.computations.free() == 3 {
            tokio::task::yield_now().await;
        }
        client.abort();
        stopped.recv().expect("it stops");
        // Its place is free again for others.
        for _ in 0..4 {
            state.work.compute(|_| Ok(())).await.expect("a place");
        }
    }

    /// Computes in parallel for a caller until it is told to stop, from when others have begun too.
    async fn compute_in_parallel(who: &str, work: Work, begun: Arc<Barrier>) -> Answer<()> {
        let computing = work.compute(move |stop| {
            begun.wait();
            let parts = 4 * rayon::current_num_threads();
            (0..parts).into_par_iter().for_each(|_| wait_for(stop));
            Ok(())
        });
        as_caller(who, computing).await
    }

    /// Keeps the processor until a flag is raised.
    fn wait_for(flag: &AtomicBool) {
        while !flag.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_job_goes_on_while_requests_have_all_places_for_computing() {
        let (state, _folder) = state().await;
        let begun = Arc::new(Barrier::new(4));
        for who in ["a", "b", "c"] {
            tokio::spawn(compute_in_parallel(who, state.work.clone(), begun.clone()));
        }
        let slice = tokio::task::spawn_blocking(move || {
            begun.wait();
            (0..1000_u64).into_par_iter().sum::<u64>()
        });
        let sum = tokio::time::timeout(LONGEST_COMPUTATION / 2, slice).await;
        assert_eq!(sum.expect("the job goes on").expect("no panic"), 499_500);
        state.hub.close();
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn computations_end_with_the_server() {
        let (state, _folder) = state().await;
        let (told, stopped) = mpsc::channel();
        let computing = state.work.compute(endless(told));
        let closing = async { state.hub.close() };
        let (refused, ()) = tokio::join!(computing, closing);
        let refused = refused.expect_err("the server goes down").into_response();
        assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
        stopped.recv().expect("it stops");
    }
}
