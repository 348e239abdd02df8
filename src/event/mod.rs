//! Who waits for news of a job, and how news reaches them: stored first, then told.
//!
//! The hub carries no events. It wakes those who wait for a job after something about it came to
//! disk; they read the store from where they stopped. A slow reader therefore holds up nobody and
//! misses nothing, and the hub's memory is one small entry for each job that somebody waits for.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{Notify, watch};
use tokio_util::sync::CancellationToken;

use crate::job::JobId;
use crate::store::{Change, OnChange, Store, StoreError, StoredEvent};

/// Events that a feed reads at once.
const PAGE: u32 = 500;

/// Wakes those who wait for news of jobs. Cheap to clone.
#[derive(Clone, Default)]
pub struct EventHub {
    inner: Arc<Inner>,
}

#[derive(Default)]
struct Inner {
    waiting: Mutex<HashMap<JobId, watch::Sender<()>>>,
    stop_requested: Notify,
    closing: CancellationToken,
}

impl Inner {
    fn waiting(&self) -> MutexGuard<'_, HashMap<JobId, watch::Sender<()>>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl EventHub {
    /// A hub with nobody waiting.
    pub fn new() -> Self {
        Self::default()
    }

    /// What the store calls after each commit.
    pub fn on_change(&self) -> OnChange {
        let hub = self.clone();
        Arc::new(move |change| match change {
            Change::Job(job) => hub.wake(job),
            Change::StopRequested(_) => hub.inner.stop_requested.notify_one(),
        })
    }

    /// Wakes those who wait for a job.
    fn wake(&self, job: JobId) {
        if let Some(sender) = self.inner.waiting().get(&job) {
            sender.send_replace(());
        }
    }

    /// Begins to wait for news of a job. Subscribe first and read the store after: what comes
    /// between the two then wakes the subscription.
    pub fn subscribe(&self, job: JobId) -> Subscription {
        let mut waiting = self.inner.waiting();
        let sender = waiting.entry(job).or_insert_with(|| watch::channel(()).0);
        Subscription {
            hub: self.clone(),
            job,
            receiver: sender.subscribe(),
        }
    }

    /// The events of a job with an id above `after`: those stored, then those to come.
    pub fn feed(&self, store: Store, job: JobId, after: i64) -> Feed {
        Feed {
            subscription: self.subscribe(job),
            store,
            after,
            ended: false,
        }
    }

    /// Returns when a running job was asked to stop since the last call.
    pub async fn stop_requested(&self) {
        self.inner.stop_requested.notified().await;
    }

    /// Ends every subscription and feed: the server is going down.
    pub fn close(&self) {
        self.inner.closing.cancel();
    }

    /// Jobs that somebody waits for.
    pub fn n_jobs_waited_for(&self) -> usize {
        self.inner.waiting().len()
    }
}

/// Waits for news of one job.
pub struct Subscription {
    hub: EventHub,
    job: JobId,
    receiver: watch::Receiver<()>,
}

impl Subscription {
    /// Returns when there has been news since the last call; `false` when the server is going
    /// down and no more will come.
    pub async fn changed(&mut self) -> bool {
        tokio::select! {
            biased;
            () = self.hub.inner.closing.cancelled() => false,
            news = self.receiver.changed() => news.is_ok(),
        }
    }
}

impl Drop for Subscription {
    fn drop(&mut self) {
        let mut waiting = self.hub.inner.waiting();
        let only_this_one = |sender: &watch::Sender<()>| sender.receiver_count() <= 1;
        if waiting.get(&self.job).is_some_and(only_this_one) {
            waiting.remove(&self.job);
        }
    }
}

/// The events of one job, stored and to come, each once and in order.
pub struct Feed {
    subscription: Subscription,
    store: Store,
    after: i64,
    ended: bool,
}

impl Feed {
    /// The next events; nothing when the last has been handed out, when the job is gone or when
    /// the server is going down.
    pub async fn next(&mut self) -> Result<Option<Vec<StoredEvent>>, StoreError> {
        while !self.ended {
            let job = self.subscription.job;
            let events = self.store.events_after(job, self.after, PAGE).await?;
            if let Some(last) = events.last() {
                self.after = last.id;
                self.ended = last.is_last();
                return Ok(Some(events));
            }
            self.ended = self.nothing_will_come().await? || !self.subscription.changed().await;
        }
        Ok(None)
    }

    async fn nothing_will_come(&self) -> Result<bool, StoreError> {
        let job = self.store.job(self.subscription.job).await?;
        Ok(job.is_none_or(|job| job.status.is_terminal() && job.last_event <= self.after))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::store::{DatabaseSettings, NewJob, Submitted};

    struct Fixture {
        hub: EventHub,
        store: Store,
        _folder: tempfile::TempDir,
    }

    async fn fixture() -> Fixture {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let settings = DatabaseSettings {
            path: folder.path().join("jobs.db"),
            readers: 2,
            busy_timeout: Duration::from_secs(5),
        };
        let hub = EventHub::new();
        let store = Store::open(&settings, hub.on_change()).await;
        Fixture {
            store: store.expect("a database"),
            hub,
            _folder: folder,
        }
    }

    async fn submit(store: &Store) -> JobId {
        let job = NewJob {
            name: None,
            labels: Default::default(),
            model: "positioning_drive".to_owned(),
            spec: serde_json::json!({}),
            datasets: Vec::new(),
            idempotency: None,
        };
        match store.submit(job).await.expect("a submission") {
            Submitted::Created(row) => row.id,
            other => panic!("not created: {other:?}"),
        }
    }

    async fn read_all(mut feed: Feed) -> Vec<i64> {
        let mut seen = Vec::new();
        while let Some(events) = feed.next().await.expect("a read") {
            seen.extend(events.into_iter().map(|event| event.id));
        }
        seen
    }

    #[tokio::test]
    async fn a_feed_hands_out_each_event_once_and_ends_after_the_last() {
        let Fixture { hub, store, .. } = &fixture().await;
        let job = submit(store).await;
        let reader = tokio::spawn(read_all(hub.feed(store.clone(), job, 0)));
        for _ in 0..20 {
            store.request_pause(job).await.expect("a wish");
            store.request_resume(job).await.expect("a wish");
        }
        store.request_cancel(job).await.expect("a wish");
        let seen = reader.await.expect("a reader");
        assert_eq!(seen, (1..=43).collect::<Vec<i64>>());
        assert_eq!(hub.n_jobs_waited_for(), 0);
    }

    #[tokio::test]
    async fn a_reader_that_has_seen_the_end_gets_nothing_more() {
        let Fixture { hub, store, .. } = &fixture().await;
        let job = submit(store).await;
        store.request_cancel(job).await.expect("a wish");
        let mut feed = hub.feed(store.clone(), job, 3);
        assert_eq!(feed.next().await.expect("a read"), None);
    }

    #[tokio::test]
    async fn a_feed_ends_when_its_job_is_deleted_or_the_server_goes_down() {
        let Fixture { hub, store, .. } = &fixture().await;
        let mut nobody = hub.feed(store.clone(), JobId::new(), 0);
        assert_eq!(nobody.next().await.expect("a read"), None);

        let job = submit(store).await;
        let mut feed = hub.feed(store.clone(), job, 1);
        let reader = tokio::spawn(async move { feed.next().await });
        hub.close();
        let last = reader.await.expect("a reader").expect("a read");
        assert_eq!(last, None);
    }

    #[tokio::test]
    async fn the_hub_forgets_a_job_that_nobody_waits_for() {
        let hub = EventHub::new();
        let job = JobId::new();
        let first = hub.subscribe(job);
        let second = hub.subscribe(job);
        drop(first);
        assert_eq!(hub.n_jobs_waited_for(), 1);
        drop(second);
        assert_eq!(hub.n_jobs_waited_for(), 0);
    }
}
