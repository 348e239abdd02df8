//! Units of work on their way from the thread that computes to the task that writes.
//!
//! The task is woken when many units wait and when the computation has ended; between, it takes what has
//! come together as often as it writes. To be woken by every unit would cost a short job as much as its
//! writes do.

use std::sync::Arc;
use std::time::Instant;

use jiff::Timestamp;
use tokio::sync::Notify;
use tokio::sync::mpsc::{self, error::TryRecvError};

use super::run::Row;
use crate::store::SharedPart;
use greybox::estimation::Progress;

/// Units that may wait to be written before the computation waits.
const UNITS_WAITING: usize = 256;

/// What a unit of work left behind.
pub(super) struct Unit {
    pub(super) rows: Vec<Row>,
    /// What other nodes are to know of.
    pub(super) parts: Vec<SharedPart>,
    pub(super) progress: Progress,
    /// When the unit ended, by the time of day.
    pub(super) ended_at: Timestamp,
    pub(super) ended: Instant,
}

/// The end of the thread that computes.
pub(super) struct UnitSender {
    /// Taken away as the computation ends.
    units: Option<mpsc::Sender<Unit>>,
    wake: Arc<Notify>,
}

/// The end of the task that writes.
pub(super) struct UnitReceiver {
    units: mpsc::Receiver<Unit>,
    wake: Arc<Notify>,
}

/// A channel for the units of one slice.
pub(super) fn channel() -> (UnitSender, UnitReceiver) {
    let (sender, units) = mpsc::channel(UNITS_WAITING);
    let wake = Arc::new(Notify::new());
    let sender = UnitSender {
        units: Some(sender),
        wake: wake.clone(),
    };
    (sender, UnitReceiver { units, wake })
}

impl UnitSender {
    /// Sends a unit, after a wait where too many wait already. Says whether anybody takes units still.
    pub(super) fn send(&self, unit: Unit) -> bool {
        let Some(units) = &self.units else {
            return false;
        };
        let is_sent = units.blocking_send(unit).is_ok();
        if units.capacity() <= UNITS_WAITING / 2 {
            self.wake.notify_one();
        }
        is_sent
    }
}

impl Drop for UnitSender {
    fn drop(&mut self) {
        self.units = None;
        self.wake.notify_one();
    }
}

impl UnitReceiver {
    /// Returns when many units wait, or the computation has ended.
    pub(super) async fn woken(&self) {
        self.wake.notified().await;
    }

    /// Hands out the units that wait. Says whether more may come.
    pub(super) fn take_waiting(&mut self, mut take: impl FnMut(Unit)) -> bool {
        loop {
            match self.units.try_recv() {
                Ok(unit) => take(unit),
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use greybox::estimation::Phase;

    use super::*;

    fn unit(generation: u32) -> Unit {
        Unit {
            rows: Vec::new(),
            parts: Vec::new(),
            progress: Progress {
                phase: Phase::Search,
                generation,
                generations: 1000,
                evaluations: 0,
                best_cost: None,
                best_credit: None,
                fraction: 0.0,
                eta_s: None,
            },
            ended_at: Timestamp::UNIX_EPOCH,
            ended: Instant::now(),
        }
    }

    #[tokio::test]
    async fn every_unit_arrives_in_order_though_few_wake_the_receiver() {
        let (sender, mut receiver) = channel();
        let send_all = move || (1..=1000).all(|generation| sender.send(unit(generation)));
        let computing = tokio::task::spawn_blocking(send_all);
        let (mut wakes, mut generations) = (0, Vec::new());
        let mut is_open = true;
        while is_open {
            receiver.woken().await;
            wakes += 1;
            is_open = receiver.take_waiting(|unit| generations.push(unit.progress.generation));
        }
        assert!(computing.await.expect("a computation that ends"));
        assert_eq!(generations, (1..=1000).collect::<Vec<u32>>());
        assert!(wakes < 500, "{wakes}");
    }

    #[tokio::test]
    async fn a_computation_whose_units_nobody_takes_is_told_so() {
        let (sender, receiver) = channel();
        drop(receiver);
        let is_sent = tokio::task::spawn_blocking(move || sender.send(unit(1)));
        assert!(!is_sent.await.expect("an answer"));
    }
}
