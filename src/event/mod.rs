//! Who waits for news of a job, and how news reaches them: stored first, then told.
//!
//! The hub wakes those who wait for a job after something about it came to disk; they read from
//! where they stopped, the newest events once for all of them and what lies further back from the
//! store. A slow reader therefore holds up nobody and misses nothing, and the hub's memory is one
//! small entry for each job that somebody waits for.

mod everyone;
mod feed;
mod hub;
mod tail;

pub use everyone::ChangedJobs;
pub use feed::Feed;
pub use hub::{EventHub, Projects, Subscription};
