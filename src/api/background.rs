//! Threads for what takes the processor for long and for which a client waits: computations, and recordings of many
//! samples that are read or written. They give way to the threads of jobs, which would otherwise stand still while
//! somebody asks for one computation after another.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use parking_lot::Mutex;
use rayon::{ThreadPool, ThreadPoolBuilder};
use tokio::runtime::{Builder, Runtime};
use tokio::sync::oneshot;

use crate::admission::Permit;
use crate::priority::{self, LowerPriority};

/// Work whose thread panicked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it panicked")]
pub(super) struct Panicked;

/// Groups of threads of lower priority. Work has a group to itself, so that a short computation does not wait for the
/// parts of a long one. Cheap to clone.
#[derive(Clone)]
pub(super) struct Background(Arc<Mutex<Vec<Arc<ThreadPool>>>>);

impl Background {
    /// Makes `groups` groups of `threads` threads each; at most as much work is run at the same time as there are groups.
    pub(super) fn new(name: &'static str, groups: usize, threads: usize) -> Self {
        let group = |_| {
            let group = ThreadPoolBuilder::new()
                .num_threads(threads.max(1))
                .thread_name(move |number| format!("{name}-{number}"))
                .start_handler(|_| priority::give_way(LowerPriority::Requests))
                .build();
            Arc::new(group.expect("the system starts a thread"))
        };
        Self(Arc::new(Mutex::new((0..groups).map(group).collect())))
    }

    /// Runs work for whoever has one of as many places as there are groups. What the work does in parallel its group
    /// divides among its threads.
    ///
    /// # Errors
    /// The work panics.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        place: Permit,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Panicked> {
        let (sender, done) = oneshot::channel();
        let groups = self.0.clone();
        let group = groups
            .lock()
            .pop()
            .expect("there is a group for each place");
        let group_of_the_work = group.clone();
        group.spawn_fifo(move || {
            let value = catch_unwind(AssertUnwindSafe(work));
            groups.lock().push(group_of_the_work);
            drop(place);
            // Whoever waited may have left.
            let _ = sender.send(value);
        });
        match done.await {
            Ok(Ok(value)) => Ok(value),
            Ok(Err(_)) | Err(_) => Err(Panicked),
        }
    }
}

/// Tasks on a thread of lower priority, which take turns. Cheap to clone.
#[derive(Clone)]
pub(super) struct BackgroundTasks(Arc<Tasks>);

struct Tasks(Option<Runtime>);

impl BackgroundTasks {
    /// Starts the thread.
    pub(super) fn new(name: &'static str) -> Self {
        let runtime = Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name(name)
            .on_thread_start(|| priority::give_way(LowerPriority::Requests))
            .build();
        Self(Arc::new(Tasks(Some(
            runtime.expect("the system starts a thread"),
        ))))
    }

    /// Starts a task, which ends with the thread.
    pub(super) fn spawn(&self, task: impl Future<Output = ()> + Send + 'static) {
        if let Tasks(Some(runtime)) = &*self.0 {
            runtime.spawn(task);
        }
    }
}

impl Drop for Tasks {
    fn drop(&mut self) {
        // A runtime that is dropped waits for its thread, which a task of another runtime must not.
        if let Some(runtime) = self.0.take() {
            runtime.shutdown_background();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::admission::Admission;

    #[tokio::test]
    async fn work_is_done_beside_others_and_a_panic_is_told() {
        let (background, places) = (Background::new("test", 1, 3), Admission::new(1));
        let place = places.take("a").await;
        let value = background.run(place, rayon::current_num_threads).await;
        assert_eq!(value, Ok(3));
        let place = places.take("a").await;
        let panicked = background.run(place, || panic!("on purpose")).await;
        assert_eq!(panicked, Err::<(), _>(Panicked));
        let place = places.take("a").await;
        assert_eq!(background.run(place, || 2).await, Ok(2));
    }

    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn its_threads_give_way_to_others() {
        let nice = || rustix::process::getpriority_process(Some(rustix::thread::gettid()));
        let (background, places) = (Background::new("test", 1, 1), Admission::new(1));
        let place = places.take("a").await;
        let niceness = background.run(place, nice).await.expect("no panic");
        let niceness = niceness.expect("a priority");
        let of_this_thread = nice().expect("a priority");
        assert!(niceness > of_this_thread, "{niceness} {of_this_thread}");
    }
}
