//! Threads for what takes the processor for long and for which a client waits: computations, and recordings of many
//! samples that are read or written. They give way to the threads of jobs, which would otherwise stand still while
//! somebody asks for one computation after another.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuilder};
use tokio::sync::oneshot;

/// Work whose thread panicked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it panicked")]
pub(super) struct Panicked;

/// Threads of lower priority. Cheap to clone.
#[derive(Clone)]
pub(super) struct Background(Arc<ThreadPool>);

impl Background {
    /// So many threads with a name. What they do in parallel they divide among themselves.
    pub(super) fn new(name: &'static str, threads: usize) -> Self {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(move |number| format!("{name}-{number}"))
            .start_handler(|_| platform::give_way())
            .build();
        Self(Arc::new(pool.expect("the system starts a thread")))
    }

    /// Runs work once a thread is free for it.
    ///
    /// # Errors
    /// The work panics.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Panicked> {
        let (sender, done) = oneshot::channel();
        self.0.spawn_fifo(move || {
            // Whoever waited may have left.
            let _ = sender.send(catch_unwind(AssertUnwindSafe(work)));
        });
        match done.await {
            Ok(Ok(value)) => Ok(value),
            Ok(Err(_)) | Err(_) => Err(Panicked),
        }
    }
}

#[cfg(target_os = "linux")]
mod platform {
    //! Each thread has a priority of its own.

    use rustix::process::{Pid, setpriority_process};
    use rustix::thread::gettid;

    /// How nice the threads are: against one thread of a job each has a sixth of a processor, and all of it where no job
    /// is at work.
    const NICENESS: i32 = 7;

    /// Lowers the priority of this thread.
    pub(super) fn give_way() {
        let thread: Pid = gettid();
        if let Err(error) = setpriority_process(Some(thread), NICENESS) {
            tracing::warn!(%error, "computations for requests have the priority of jobs");
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod platform {
    //! A priority is that of the whole process.

    pub(super) fn give_way() {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn work_is_done_beside_others_and_a_panic_is_told() {
        let background = Background::new("test", 1);
        let value = background.run(rayon::current_num_threads).await;
        assert_eq!(value, Ok(1));
        let panicked = background.run(|| panic!("on purpose")).await;
        assert_eq!(panicked, Err::<(), _>(Panicked));
        assert_eq!(background.run(|| 2).await, Ok(2));
    }

    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn its_threads_give_way_to_others() {
        let nice = || rustix::process::getpriority_process(Some(rustix::thread::gettid()));
        let background = Background::new("test", 1);
        let niceness = background.run(nice).await.expect("no panic");
        let niceness = niceness.expect("a priority");
        let of_this_thread = nice().expect("a priority");
        assert!(niceness > of_this_thread, "{niceness} {of_this_thread}");
    }
}
