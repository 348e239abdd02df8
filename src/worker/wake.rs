//! Has the queue looked at when something has come into it, so that no job waits for the clock.
//!
//! River looks at its queue at intervals and when a slice returns. It has no call that makes it
//! look at once, but it does so when the configuration of the queue changes; to wake it is
//! therefore to change the interval by some nanoseconds. Several changes may be seen as one, so the
//! interval does not come back to what it was before many more have been made.

use std::time::Duration;

use riverqueue::{Client, EventKind, EventReceiver, EventRecvError, QueueConfig};
use tokio_util::sync::CancellationToken;

use crate::event::EventHub;
use crate::store::{QUEUE, StoreError};

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
    /// Slices that were handed on, once they are in the queue again.
    handed_on: EventReceiver,
    configuration: QueueConfig,
    /// How often the queue was woken.
    woken: u64,
}

impl Wake {
    pub(super) fn new(client: Client, taken_at_once: usize) -> Result<Self, StoreError> {
        Ok(Self {
            handed_on: client.subscribe(&[EventKind::JobSnoozed])?,
            configuration: configuration(taken_at_once),
            woken: 0,
            client,
        })
    }

    /// Wakes the queue when a job was submitted or resumed and when a slice was handed on.
    pub(super) async fn run(mut self, hub: EventHub, closing: CancellationToken) {
        loop {
            tokio::select! {
                () = closing.cancelled() => return,
                () = hub.slice_waits() => {}
                handed_on = self.handed_on.recv() => match handed_on {
                    Ok(_) | Err(EventRecvError::Lagged(_)) => {}
                    Err(_closed) => return,
                }
            }
            if let Err(error) = self.wake() {
                tracing::error!(%error, "the queue could not be woken; it is looked at later");
            }
        }
    }

    fn wake(&mut self) -> Result<(), StoreError> {
        self.woken += 1;
        let variation = Duration::from_nanos(self.woken % VARIATIONS);
        let configuration = self.configuration.clone();
        let configuration = configuration.with_fetch_poll_interval(POLL_INTERVAL + variation);
        let queues = self.client.local_queues();
        Ok(queues.update(QUEUE, configuration)?)
    }
}
