//! The steps of monitors: windows of a stream become jobs, one after the other.
//!
//! ```text
//! stream ──window is due──▶ recording + job ──ended──▶ estimate ──▶ detectors ──▶ alarms
//!                               ▲                          │
//!                               └── prior, start ◀─────────┘
//! ```
//!
//! A step of a monitor is one transaction ([`crate::store::Monitors::advance`]): what is known by
//! then stands in the database, and a server that dies goes on where it was. Time is that of the
//! stream: equal samples make equal windows, whenever they come. Only that data have stopped is
//! told by the clock.

mod signals;
mod step;

use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinHandle;

use crate::event::EventHub;
use crate::store::Store;
use greybox::model::Catalogue;
use step::Steps;

/// How often it is looked whether data have stopped.
const LOOK_INTERVAL: Duration = Duration::from_secs(2);
/// The least time between two looks: many samples and many jobs are looked at together.
const COOLDOWN: Duration = Duration::from_millis(20);

/// Takes the steps of all monitors until the server goes down.
pub struct Watcher {
    task: JoinHandle<()>,
}

impl Watcher {
    /// Begins to take them. It ends when the hub is closed.
    pub fn start(store: Store, hub: EventHub, catalogue: Catalogue) -> Self {
        let steps = Steps {
            store,
            catalogue: Arc::new(catalogue),
        };
        Self {
            task: tokio::spawn(run(steps, hub)),
        }
    }

    /// Returns when no more steps are taken.
    pub async fn ended(self) {
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the monitors ended badly");
        }
    }
}

async fn run(steps: Steps, hub: EventHub) {
    let mut looks = tokio::time::interval(LOOK_INTERVAL);
    loop {
        tokio::select! {
            biased;
            () = hub.closed() => return,
            () = hub.monitors_may_step() => {}
            _ = looks.tick() => {}
        }
        while steps.store.nodes().is_in_charge() {
            let taken = tokio::select! {
                biased;
                () = hub.closed() => return,
                taken = steps.take_all() => taken,
            };
            match taken {
                Ok(0) => break,
                Ok(_) => {}
                Err(error) => {
                    tracing::error!(%error, "monitors cannot go on just now");
                    break;
                }
            }
        }
        tokio::time::sleep(COOLDOWN).await;
    }
}
