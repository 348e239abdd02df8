//! The jobs that changed, for followers of all jobs.
//!
//! A follower holds the identifiers of the jobs that changed since its last call, each once: a slow follower
//! misses changes that were overtaken by later changes of the same job, and nothing else. Where the hub may
//! have missed changes, every follower has to begin again.

use std::collections::BTreeSet;
use std::sync::{Arc, Weak};

use parking_lot::Mutex;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

use greybox::identification::JobId;

/// Publishes changes of jobs to all followers.
#[derive(Default)]
pub(super) struct Broadcast(Mutex<Vec<Weak<Follower>>>);

#[derive(Default)]
struct Follower {
    changed: Mutex<BTreeSet<JobId>>,
    /// Notified when `changed` has grown.
    more: Notify,
    /// Cancelled when changes may have been missed.
    lost: CancellationToken,
}

impl Broadcast {
    /// Tells every follower that a job has changed.
    pub(super) fn publish(&self, job: JobId) {
        self.0.lock().retain(|follower| {
            let Some(follower) = follower.upgrade() else {
                return false;
            };
            follower.changed.lock().insert(job);
            follower.more.notify_one();
            true
        });
    }

    /// Ends all subscriptions, because changes may have been missed.
    pub(super) fn disconnect_all(&self) {
        let followers = std::mem::take(&mut *self.0.lock());
        followers
            .iter()
            .filter_map(Weak::upgrade)
            .for_each(|follower| follower.lost.cancel());
    }

    /// Begins to follow all jobs.
    pub(super) fn subscribe(&self, closing: CancellationToken) -> ChangedJobs {
        let follower = Arc::new(Follower::default());
        self.0.lock().push(Arc::downgrade(&follower));
        ChangedJobs { follower, closing }
    }
}

/// The jobs that change, as a follower receives them.
pub struct ChangedJobs {
    follower: Arc<Follower>,
    closing: CancellationToken,
}

impl ChangedJobs {
    fn taken(&self, limit: usize) -> Vec<JobId> {
        let mut changed = self.follower.changed.lock();
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
                () = self.follower.lost.cancelled() => return None,
                () = self.follower.more.notified() => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn each_job_that_changed_is_handed_out_once() {
        let (broadcast, closing) = (Broadcast::default(), CancellationToken::new());
        let mut follower = broadcast.subscribe(closing.clone());
        let mut jobs = [JobId::new(), JobId::new(), JobId::new()];
        jobs.sort();
        for job in [jobs[1], jobs[0], jobs[1], jobs[2], jobs[0]] {
            broadcast.publish(job);
        }
        assert_eq!(follower.next(2).await, Some(jobs[..2].to_vec()));
        assert_eq!(follower.next(2).await, Some(jobs[2..].to_vec()));
        broadcast.publish(jobs[1]);
        assert_eq!(follower.next(2).await, Some(vec![jobs[1]]));
        closing.cancel();
        assert_eq!(follower.next(2).await, None);
    }

    #[tokio::test]
    async fn followers_begin_again_where_changes_may_have_been_missed() {
        let (broadcast, closing) = (Broadcast::default(), CancellationToken::new());
        let mut follower = broadcast.subscribe(closing.clone());
        broadcast.disconnect_all();
        assert_eq!(follower.next(2).await, None);
        let mut follower = broadcast.subscribe(closing);
        let job = JobId::new();
        broadcast.publish(job);
        assert_eq!(follower.next(2).await, Some(vec![job]));
    }

    #[test]
    fn a_follower_that_left_is_forgotten() {
        let broadcast = Broadcast::default();
        drop(broadcast.subscribe(CancellationToken::new()));
        broadcast.publish(JobId::new());
        assert!(broadcast.0.lock().is_empty());
    }
}
