//! The events of one job as one reader gets them: those stored, then those to come.
//!
//! Readers that are abreast share what the first of them reads, so that a thousand of them cost
//! the store no more than one. One that lags behind reads for itself.

use std::sync::Arc;

use tokio::sync::OwnedMutexGuard;

use super::hub::{EventHub, Subscription};
use super::tail::Tail;
use crate::store::{Store, StoreError, StoredEvent};
use greybox::identification::JobId;

/// Events that a feed reads at once.
const PAGE: u32 = 500;
/// The events of one job, stored and to come, each once and in order.
pub struct Feed {
    subscription: Subscription,
    store: Store,
    after: i64,
    /// The news that has been read.
    read: u64,
    ended: bool,
}

/// Some events of a job, as the store has them.
struct Page {
    events: Vec<Arc<StoredEvent>>,
    /// Whether the store had no more.
    is_last: bool,
}

impl EventHub {
    /// The events of a job with an id above `after`: those stored, then those to come.
    pub fn feed(&self, store: Store, job: JobId, after: i64) -> Feed {
        Feed::new(self.subscribe(job), store, after)
    }
}

impl Feed {
    pub(super) fn new(subscription: Subscription, store: Store, after: i64) -> Self {
        Self {
            subscription,
            store,
            after,
            read: 0,
            ended: false,
        }
    }

    /// The next events; nothing when the last has been handed out, when the job is gone or when
    /// the server is going down.
    pub async fn next(&mut self) -> Result<Option<Vec<Arc<StoredEvent>>>, StoreError> {
        while !self.ended {
            let Some(news) = self.subscription.more_than(self.read).await else {
                self.ended = true;
                break;
            };
            let events = self.look(news).await?;
            if let Some(last) = events.last() {
                self.after = last.id;
                self.ended = last.is_last();
                return Ok(Some(events));
            }
        }
        Ok(None)
    }

    /// The events after the last one that was handed out; none where there are none yet.
    async fn look(&mut self, news: u64) -> Result<Vec<Arc<StoredEvent>>, StoreError> {
        let tail = self.subscription.topic.tail.clone();
        let tail = tail.lock_owned().await;
        if let Some(events) = tail.above(self.after, news) {
            self.read = tail.news;
            self.ended = events.is_empty() && tail.over;
            return Ok(events);
        }
        // Put aside, for it is large, and most readers of most events never need it.
        Box::pin(self.read_on(tail, news)).await
    }

    /// The events after the last one that was handed out, from the store.
    async fn read_on(
        &mut self,
        mut tail: OwnedMutexGuard<Tail>,
        news: u64,
    ) -> Result<Vec<Arc<StoredEvent>>, StoreError> {
        if self.after < tail.end {
            drop(tail);
            return self.catch_up(news).await;
        }
        // Whatever came until here is in the reading; what comes from here on is news.
        let news = *self.subscription.news.borrow();
        let Page {
            events,
            is_last: all,
        } = self.page().await?;
        self.ended = events.is_empty() && self.nothing_will_come().await?;
        if all {
            self.read = news;
        }
        // A reader that names an event which is yet to come has seen nothing of those before it.
        if !events.is_empty() || self.after == tail.end {
            tail.take(&events, all.then_some(news), self.ended);
        }
        Ok(events)
    }

    /// A page for this reader alone.
    async fn catch_up(&mut self, news: u64) -> Result<Vec<Arc<StoredEvent>>, StoreError> {
        let Page { events, .. } = self.page().await?;
        if events.is_empty() {
            self.ended = self.nothing_will_come().await?;
            self.read = news;
        }
        Ok(events)
    }

    async fn page(&self) -> Result<Page, StoreError> {
        let job = self.subscription.job;
        let (events, limit) = match self.store.events().after(job, self.after, PAGE).await {
            // Events before a damaged one are handed out one by one.
            Err(error) if error.corrupt_row().is_some() => {
                self.store.damage().note(&error);
                (self.store.events().after(job, self.after, 1).await?, 1)
            }
            events => (events?, PAGE),
        };
        Ok(Page {
            is_last: events.len() < limit as usize,
            events: events.into_iter().map(Arc::new).collect(),
        })
    }

    async fn nothing_will_come(&self) -> Result<bool, StoreError> {
        let job = self.store.jobs().find(self.subscription.job).await?;
        Ok(job.is_none_or(|job| job.status.is_terminal() && job.last_event <= self.after))
    }
}
