//! Which jobs changed, for those who follow all of them.
//!
//! A follower holds the identifiers of the jobs that changed since it looked last, each once: a slow
//! one misses changes that were overtaken by later ones of the same job, and nothing else. Where the hub
//! itself may have missed some, those who follow have to begin again.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

use greybox::identification::JobId;

/// The followers of all jobs.
#[derive(Default)]
pub(super) struct Followers(Mutex<Vec<Weak<Waiting>>>);

#[derive(Default)]
struct Waiting {
    changed: Mutex<BTreeSet<JobId>>,
    more: Notify,
    /// Some changes may have been missed.
    lost: CancellationToken,
}

impl Waiting {
    fn changed(&self) -> MutexGuard<'_, BTreeSet<JobId>> {
        self.changed.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Followers {
    fn list(&self) -> MutexGuard<'_, Vec<Weak<Waiting>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells everyone that a job has changed.
    pub(super) fn tell(&self, job: JobId) {
        self.list().retain(|follower| {
            let Some(follower) = follower.upgrade() else {
                return false;
            };
            follower.changed().insert(job);
            follower.more.notify_one();
            true
        });
    }

    /// Ends all who follow: some changes may have been missed.
    pub(super) fn lose(&self) {
        let all = std::mem::take(&mut *self.list());
        all.iter()
            .filter_map(Weak::upgrade)
            .for_each(|follower| follower.lost.cancel());
    }

    /// One more who follows, from now on.
    pub(super) fn join(&self, closing: CancellationToken) -> ChangedJobs {
        let waiting = Arc::new(Waiting::default());
        self.list().push(Arc::downgrade(&waiting));
        ChangedJobs { waiting, closing }
    }
}

/// The jobs that change, as one follower sees it.
pub struct ChangedJobs {
    waiting: Arc<Waiting>,
    closing: CancellationToken,
}

impl ChangedJobs {
    fn taken(&self, limit: usize) -> Vec<JobId> {
        let mut changed = self.waiting.changed();
        let some: Vec<JobId> = changed.iter().take(limit).copied().collect();
        for job in &some {
            changed.remove(job);
        }
        some
    }

    /// At most `limit` of the jobs that changed since the last call, once there are any; nothing
    /// when the server is going down, and when changes may have been missed.
    pub async fn next(&mut self, limit: usize) -> Option<Vec<JobId>> {
        loop {
            let some = self.taken(limit);
            if !some.is_empty() {
                return Some(some);
            }
            tokio::select! {
                biased;
                () = self.closing.cancelled() => return None,
                () = self.waiting.lost.cancelled() => return None,
                () = self.waiting.more.notified() => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn each_job_that_changed_is_handed_out_once() {
        let (followers, closing) = (Followers::default(), CancellationToken::new());
        let mut follower = followers.join(closing.clone());
        let mut jobs = [JobId::new(), JobId::new(), JobId::new()];
        jobs.sort();
        for job in [jobs[1], jobs[0], jobs[1], jobs[2], jobs[0]] {
            followers.tell(job);
        }
        assert_eq!(follower.next(2).await, Some(jobs[..2].to_vec()));
        assert_eq!(follower.next(2).await, Some(jobs[2..].to_vec()));
        followers.tell(jobs[1]);
        assert_eq!(follower.next(2).await, Some(vec![jobs[1]]));
        closing.cancel();
        assert_eq!(follower.next(2).await, None);
    }

    #[tokio::test]
    async fn where_changes_may_have_been_missed_those_who_follow_begin_again() {
        let (followers, closing) = (Followers::default(), CancellationToken::new());
        let mut follower = followers.join(closing.clone());
        followers.lose();
        assert_eq!(follower.next(2).await, None);
        let mut follower = followers.join(closing);
        let job = JobId::new();
        followers.tell(job);
        assert_eq!(follower.next(2).await, Some(vec![job]));
    }

    #[test]
    fn one_who_left_is_forgotten() {
        let followers = Followers::default();
        drop(followers.join(CancellationToken::new()));
        followers.tell(JobId::new());
        assert!(followers.list().is_empty());
    }
}
