//! Wakes those who wait for news of jobs, monitors, slices and deliveries.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;
use std::time::Duration;

use parking_lot::Mutex;
use tokio::sync::{Notify, watch};
use tokio_util::sync::CancellationToken;

use super::broadcast::{Broadcast, ChangedJobs};
use super::tail::Tail;
use crate::access::Project;
use crate::store::{Change, OnChange};
use greybox::identification::JobId;

/// How often it is looked whether there is news of which nobody told.
const LOOK_INTERVAL: Duration = Duration::from_secs(10);

/// Wakes those who wait for news of jobs. Cheap to clone.
#[derive(Clone, Default)]
pub struct EventHub {
    inner: Arc<Inner>,
}

#[derive(Default)]
struct Inner {
    waiting: Mutex<HashMap<JobId, Arc<Topic>>>,
    broadcast: Broadcast,
    slice_waits: Notify,
    slices_wait_in: Mutex<Projects>,
    stop_requested: Notify,
    monitors_may_step: Notify,
    /// How often there was news of monitors.
    monitors: watch::Sender<u64>,
    delivery_waits: Notify,
    help_wanted: Notify,
    closing: CancellationToken,
}

/// Some projects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Projects {
    /// Any.
    All,
    /// These.
    Some(BTreeSet<Project>),
}

impl Default for Projects {
    /// None.
    fn default() -> Self {
        Self::Some(BTreeSet::new())
    }
}

/// A job that somebody waits for.
pub(super) struct Topic {
    /// How often there was news.
    pub(super) news: watch::Sender<u64>,
    /// The newest events, for all who follow the job.
    pub(super) tail: Arc<tokio::sync::Mutex<Tail>>,
}

impl Default for Topic {
    fn default() -> Self {
        Self {
            news: watch::Sender::new(1),
            tail: Arc::default(),
        }
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
            Change::Job(job) => {
                hub.wake(job);
                hub.inner.monitors_may_step.notify_one();
            }
            Change::SliceWaits(project) => {
                if let Projects::Some(projects) = &mut *hub.inner.slices_wait_in.lock() {
                    projects.insert(project);
                }
                hub.inner.slice_waits.notify_one();
            }
            Change::StopRequested(_) => hub.inner.stop_requested.notify_one(),
            Change::DeliveryWaits => hub.inner.delivery_waits.notify_one(),
            Change::Stream => hub.inner.monitors_may_step.notify_one(),
            Change::Monitor(_) => hub.inner.monitors.send_modify(|news| *news += 1),
            Change::HelpWanted => hub.inner.help_wanted.notify_one(),
            Change::DatasetRemoved(_) => {}
            Change::Missed => {
                hub.inner.broadcast.disconnect_all();
                hub.look_again();
            }
        })
    }

    /// Wakes everyone who waits for anything, to look whether there is news of which nobody told.
    pub fn look_again(&self) {
        for topic in self.inner.waiting.lock().values() {
            topic.news.send_modify(|news| *news += 1);
        }
        *self.inner.slices_wait_in.lock() = Projects::All;
        self.inner.slice_waits.notify_one();
        self.inner.stop_requested.notify_one();
        self.inner.delivery_waits.notify_one();
        self.inner.help_wanted.notify_one();
        self.inner.monitors_may_step.notify_one();
        self.inner.monitors.send_modify(|news| *news += 1);
    }

    /// Wakes everyone now and then until `closing`: a node may have gone down between a commit and telling
    /// of it.
    pub async fn look_again_and_again(self, closing: CancellationToken) {
        let mut due = tokio::time::interval(LOOK_INTERVAL);
        loop {
            tokio::select! {
                () = closing.cancelled() => return,
                _ = due.tick() => self.look_again(),
            }
        }
    }

    /// Wakes those who wait for a job.
    fn wake(&self, job: JobId) {
        self.inner.broadcast.publish(job);
        if let Some(topic) = self.inner.waiting.lock().get(&job) {
            topic.news.send_modify(|news| *news += 1);
        }
    }

    /// Begins to wait for news of a job. Subscribe first and read the store after: what comes
    /// between the two then wakes the subscription.
    pub fn subscribe(&self, job: JobId) -> Subscription {
        let mut waiting = self.inner.waiting.lock();
        let topic = waiting.entry(job).or_default();
        Subscription {
            hub: self.clone(),
            job,
            news: topic.news.subscribe(),
            topic: topic.clone(),
        }
    }

    /// Which jobs change, from now on.
    pub fn changed_jobs(&self) -> ChangedJobs {
        self.inner.broadcast.subscribe(self.inner.closing.clone())
    }

    /// Returns when slices came into the queue since the last call, with the projects that they are
    /// of.
    pub async fn slice_waits(&self) -> Projects {
        self.inner.slice_waits.notified().await;
        std::mem::take(&mut *self.inner.slices_wait_in.lock())
    }

    /// Returns when a delivery came to be due, or is due at another time, since the last call.
    pub async fn delivery_waits(&self) {
        self.inner.delivery_waits.notified().await;
    }

    /// Returns when an analysis began with which other nodes can help, since the last call.
    pub async fn help_wanted(&self) {
        self.inner.help_wanted.notified().await;
    }

    /// Returns when a running job was asked to stop since the last call.
    pub async fn stop_requested(&self) {
        self.inner.stop_requested.notified().await;
    }

    /// Returns when a stream or a job changed since the last call, for which monitors may wait.
    pub async fn monitors_may_step(&self) {
        self.inner.monitors_may_step.notified().await;
    }

    /// Told when there is news of any monitor.
    pub fn monitor_news(&self) -> watch::Receiver<u64> {
        self.inner.monitors.subscribe()
    }

    /// Ends every subscription and feed: the server is going down.
    pub fn close(&self) {
        self.inner.closing.cancel();
    }

    /// Returns when the server is going down.
    pub async fn closed(&self) {
        self.inner.closing.cancelled().await;
    }

    /// Jobs that somebody waits for.
    pub fn n_jobs_waited_for(&self) -> usize {
        self.inner.waiting.lock().len()
    }
}

/// Waits for news of one job.
pub struct Subscription {
    pub(super) hub: EventHub,
    pub(super) job: JobId,
    pub(super) topic: Arc<Topic>,
    pub(super) news: watch::Receiver<u64>,
}

impl Subscription {
    /// Returns when there has been news since the last call; `false` when the server is going
    /// down and no more will come.
    pub async fn changed(&mut self) -> bool {
        tokio::select! {
            biased;
            () = self.hub.inner.closing.cancelled() => false,
            news = self.news.changed() => news.is_ok(),
        }
    }

    /// Returns when there has been news more than `count` times, with the number; nothing when
    /// the server is going down.
    pub(super) async fn more_than(&mut self, count: u64) -> Option<u64> {
        tokio::select! {
            biased;
            () = self.hub.inner.closing.cancelled() => None,
            news = self.news.wait_for(|news| *news > count) => news.ok().map(|news| *news),
        }
    }
}

impl Drop for Subscription {
    fn drop(&mut self) {
        let mut waiting = self.hub.inner.waiting.lock();
        let only_this_one = |topic: &Arc<Topic>| topic.news.receiver_count() <= 1;
        if waiting.get(&self.job).is_some_and(only_this_one) {
            waiting.remove(&self.job);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Feed;
    use crate::store::Store;
    use crate::store::{DatabaseSettings, NewJob, Submitted};

    struct Fixture {
        hub: EventHub,
        store: Store,
        _folder: tempfile::TempDir,
    }

    async fn fixture() -> Fixture {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let settings = DatabaseSettings {
            place: crate::store::DatabasePlace::File(folder.path().join("jobs.db")),
            readers: 2,
            busy_timeout: Duration::from_secs(5),
            beat: Duration::from_millis(50),
            keys: Default::default(),
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
            project: Default::default(),
            name: None,
            labels: Default::default(),
            model: "positioning_drive".to_owned(),
            task: crate::job::JobTask::nominal(),
            datasets: Vec::new(),
            idempotency: None,
        };
        match store.submissions().submit(job).await.expect("a submission") {
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
            store.jobs().pause(job).await.expect("a wish");
            store.jobs().resume(job).await.expect("a wish");
        }
        store.jobs().cancel(job).await.expect("a wish");
        let seen = reader.await.expect("a reader");
        assert_eq!(seen, (1..=43).collect::<Vec<i64>>());
        assert_eq!(hub.n_jobs_waited_for(), 0);
    }

    #[tokio::test]
    async fn readers_abreast_behind_and_ahead_each_get_all_after_their_own_last() {
        let Fixture { hub, store, .. } = &fixture().await;
        let job = submit(store).await;
        for _ in 0..10 {
            store.jobs().pause(job).await.expect("a wish");
            store.jobs().resume(job).await.expect("a wish");
        }
        let starts = [0, 0, 3, 15, 21, 22, 1000];
        let readers =
            starts.map(|after| tokio::spawn(read_all(hub.feed(store.clone(), job, after))));
        for _ in 0..10 {
            store.jobs().pause(job).await.expect("a wish");
            store.jobs().resume(job).await.expect("a wish");
        }
        store.jobs().cancel(job).await.expect("a wish");
        for (reader, after) in readers.into_iter().zip(starts) {
            let seen = reader.await.expect("a reader");
            assert_eq!(
                seen,
                (after + 1..=43).collect::<Vec<i64>>(),
                "after {after}"
            );
        }
        let late = read_all(hub.feed(store.clone(), job, 40)).await;
        assert_eq!(late, [41, 42, 43]);
        assert_eq!(hub.n_jobs_waited_for(), 0);
    }

    #[tokio::test]
    async fn a_reader_who_names_an_event_that_is_yet_to_come_hides_none_from_the_others() {
        let Fixture { hub, store, .. } = &fixture().await;
        let job = submit(store).await;
        let mut first = hub.feed(store.clone(), job, 0);
        let mut second = hub.feed(store.clone(), job, 0);
        for feed in [&mut first, &mut second] {
            assert!(feed.next().await.expect("a read").is_some());
        }
        store.jobs().pause(job).await.expect("a wish");
        assert!(first.next().await.expect("a read").is_some());
        store.jobs().cancel(job).await.expect("a wish");
        let ahead = read_all(hub.feed(store.clone(), job, 1000)).await;
        assert!(ahead.is_empty());
        let rest = tokio::time::timeout(Duration::from_secs(10), read_all(second)).await;
        assert_eq!(rest.expect("an end"), [2, 3, 4]);
    }

    #[tokio::test]
    async fn a_reader_that_has_seen_the_end_gets_nothing_more() {
        let Fixture { hub, store, .. } = &fixture().await;
        let job = submit(store).await;
        store.jobs().cancel(job).await.expect("a wish");
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
