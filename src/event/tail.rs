//! The newest events of a job, read once for all who follow it.

use std::sync::Arc;

use crate::store::StoredEvent;

/// The newest events of a job that are kept for those who are abreast.
const SHARED: usize = 16;

/// The newest events of a job as they were read last.
#[derive(Default)]
pub(super) struct Tail {
    /// Without a gap, the last one the newest.
    pub(super) events: Vec<Arc<StoredEvent>>,
    /// The news before the reading.
    pub(super) news: u64,
    /// The id of the newest event.
    pub(super) end: i64,
    /// Nothing follows.
    pub(super) over: bool,
}

impl Tail {
    /// Notes what a reader found above the end; `news` where that was all there was.
    pub(super) fn take(&mut self, events: &[Arc<StoredEvent>], news: Option<u64>, over: bool) {
        self.news = news.unwrap_or(self.news);
        self.over = over;
        if let Some(last) = events.last() {
            self.end = last.id;
            self.over = last.is_last();
            self.events = events[events.len().saturating_sub(SHARED)..].to_vec();
        }
    }

    /// The events above `after`, if they are here; nothing if there are none yet.
    pub(super) fn above(&self, after: i64, news: u64) -> Option<Vec<Arc<StoredEvent>>> {
        if after >= self.end {
            return (news <= self.news).then(Vec::new);
        }
        let first = self.events.first()?.id;
        let skipped = usize::try_from(after + 1 - first).ok()?;
        let events = self.events.get(skipped..)?;
        (!events.is_empty()).then(|| events.to_vec())
    }
}
