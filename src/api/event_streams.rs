//! Streams of events that are open: each takes a connection, so there are only so many at once.

use super::admission::Limited;
use super::error::Answer;
use crate::admission::Permit;
use crate::event::EventHub;
use crate::store::Store;

/// What event streams are opened with. Cheap to clone.
#[derive(Clone)]
pub struct EventStreams {
    /// Events that are stored are read from here.
    pub(super) store: Store,
    /// Tells of events to come.
    pub(super) hub: EventHub,
    at_once: usize,
    open: Limited,
}

impl EventStreams {
    /// So many streams at once.
    pub(super) fn new(at_once: usize, store: Store, hub: EventHub) -> Self {
        Self {
            store,
            hub,
            at_once,
            open: Limited::new(at_once, "too many event streams are open"),
        }
    }

    /// A permit for one more stream.
    pub(super) fn permit(&self) -> Answer<Permit> {
        self.open.try_take()
    }

    /// How many streams are open.
    pub(super) fn count(&self) -> usize {
        self.at_once - self.open.free()
    }
}
