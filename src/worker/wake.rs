//! Has the queue looked at when something has come into it, so that no job waits for the clock.
//!
//! River looks at its queue at intervals and when a slice returns. It has no call that makes it
//! look at once, but it does so when the configuration of the queue changes; to wake it is
//! therefore to change the interval by some nanoseconds. Several changes may be seen as one, so the
//! interval does not come back to what it was before many more have been made.

use std::collections::HashSet;
use std::time::Duration;

use riverqueue::{Client, QueueConfig};
use tokio_util::sync::CancellationToken;

use crate::access::Project;
use crate::event::{EventHub, Projects};
use crate::store::{QUEUE, Store, StoreError, queue_of};

/// How often the queue is looked at when nothing wakes it: for entries that are to be looked at
/// again after a time. A look that finds nothing writes nothing.
const POLL_INTERVAL: Duration = Duration::from_millis(250);
/// Different intervals that follow each other.
const VARIATIONS: u64 = 1_000_000;
/// The least time between two looks at the queue.
pub(super) const COOLDOWN: Duration = Duration::from_millis(1);

/// How the queue is worked.
pub(super) fn configuration(taken_at_once: usize) -> QueueConfig {
    QueueConfig::new(taken_at_once).with_fetch_poll_interval(POLL_INTERVAL)
}

/// Wakes the queue.
pub(super) struct Wake {
    client: Client,
    configuration: QueueConfig,
    /// The queues that are worked: one for each project.
    queues: HashSet<String>,
    /// How often the queue was woken.
    woken: u64,
}

impl Wake {
    pub(super) fn new(client: Client, taken_at_once: usize) -> Self {
        Self {
            configuration: configuration(taken_at_once),
            queues: HashSet::from([QUEUE.to_owned()]),
            woken: 0,
            client,
        }
    }

    /// Wakes a project's queue when one of its jobs was submitted, resumed or handed on.
    pub(super) async fn run(mut self, store: Store, hub: EventHub, closing: CancellationToken) {
        let mut waiting = Projects::All;
        loop {
            match waiting {
                Projects::Some(projects) => self.wake_all(&projects),
                Projects::All => match store.queue().projects_at_work().await {
                    Ok(projects) => self.wake_all(&projects),
                    Err(error) => {
                        tracing::error!(%error, "the projects with jobs could not be read")
                    }
                },
            }
            waiting = tokio::select! {
                () = closing.cancelled() => return,
                projects = hub.slice_waits() => projects,
            };
        }
    }

    fn wake_all<'p>(&mut self, projects: impl IntoIterator<Item = &'p Project>) {
        for queue in projects.into_iter().map(queue_of) {
            if let Err(error) = self.wake(&queue) {
                tracing::error!(queue, %error, "the queue could not be woken; it is looked at later");
            }
        }
    }

    fn wake(&mut self, queue: &str) -> Result<(), StoreError> {
        self.woken += 1;
        let variation = Duration::from_nanos(self.woken % VARIATIONS);
        let configuration = self.configuration.clone();
        let configuration = configuration.with_fetch_poll_interval(POLL_INTERVAL + variation);
        let queues = self.client.local_queues();
        if self.queues.insert(queue.to_owned()) {
            return Ok(queues.add(queue, configuration)?);
        }
        Ok(queues.update(queue, configuration)?)
    }
}
