//! Who gives way to whom on the processors: threads that answer and write come first, those that compute jobs after
//! them, and what takes long for one request last.

/// Threads that give way to those that answer requests and write to the database.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LowerPriority {
    /// They simulate the candidates of jobs.
    Jobs,
    /// They compute, read or write for one request what takes long.
    Requests,
}

/// Lowers the priority of this thread, where each thread has one of its own.
pub fn give_way(of: LowerPriority) {
    platform::give_way(of);
}

#[cfg(target_os = "linux")]
mod platform {
    use rustix::process::{Pid, setpriority_process};
    use rustix::thread::gettid;

    use super::LowerPriority;

    impl LowerPriority {
        /// How nice a thread is. A step of 5 is a third of the processor's time against a thread that is not: a job
        /// gives way to answers of a few milliseconds, and a request that takes long has a sixth of a thread of a job.
        fn niceness(self) -> i32 {
            match self {
                Self::Jobs => 5,
                Self::Requests => 13,
            }
        }
    }

    pub(super) fn give_way(of: LowerPriority) {
        let thread: Pid = gettid();
        if let Err(error) = setpriority_process(Some(thread), of.niceness()) {
            tracing::warn!(%error, "threads that compute have the priority of those that answer");
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod platform {
    /// A priority is that of the whole process.
    pub(super) fn give_way(_: super::LowerPriority) {}
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn requests_that_take_long_give_way_to_jobs_and_both_to_answers() {
        let nice = || rustix::process::getpriority_process(Some(rustix::thread::gettid()));
        let niceness = |of| {
            let thread = std::thread::spawn(move || {
                give_way(of);
                nice()
            });
            thread.join().expect("no panic").expect("a priority")
        };
        let of_this_thread = nice().expect("a priority");
        assert!(niceness(LowerPriority::Jobs) > of_this_thread);
        assert!(niceness(LowerPriority::Requests) > niceness(LowerPriority::Jobs));
    }
}
