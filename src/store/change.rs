//! What a transaction changed, for those who wait for it.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::access::Project;
use crate::job::MonitorId;
use greybox::identification::{DatasetId, JobId};

/// What a committed transaction changed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// A job has more events or another state.
    Job(JobId),
    /// A slice of a job of the project waits in the queue.
    SliceWaits(Project),
    /// A delivery is due, or is due at another time.
    DeliveryWaits,
    /// A running job was asked to stop.
    StopRequested(JobId),
    /// A recording was removed.
    DatasetRemoved(DatasetId),
    /// A stream has more samples.
    Stream,
    /// A monitor has more events.
    Monitor(MonitorId),
    /// An analysis has begun with which other nodes can help.
    HelpWanted,
    /// Anything: another node changed what this one was not told of.
    Missed,
}

/// Is told of each change after it is on disk. Called by the writer: it must not block.
pub type OnChange = Arc<dyn Fn(Change) + Send + Sync>;
