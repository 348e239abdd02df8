//! Held quantities on their way to the plant.
//!
//! A quantity that is held from an instant on acts a delay later. Between two samples what acts
//! may change once or more often, for each candidate at an instant of its own, so that the time
//! between is cut into stretches. Before the record began the plant saw the first quantities,
//! standing still.

use super::equations::HeldQuantities;
use greybox_numerics::lanes::Real;
use std::collections::VecDeque;

/// Instants closer together than this share of the time between two samples are one.
pub const SAME: f64 = 1e-9;

/// No delay is longer than so many samples.
const LONGEST: usize = 100_000;

/// The way of a row of candidates.
#[derive(Clone, Debug)]
pub struct InputDelay<R> {
    /// The delay of each candidate `[s]`.
    seconds: R,
    /// The quantities that were held, each with the time from which on, the newest last.
    history: VecDeque<(f64, HeldQuantities<R>)>,
    /// For each candidate how many in the history are newer than what acts.
    newer: Vec<usize>,
}

/// A stretch of the time between two samples over which nothing jumps.
#[derive(Clone, Debug)]
pub struct HeldStretch<R> {
    /// What acts.
    pub held: HeldQuantities<R>,
    /// For how long `[s]`; 0 for candidates that have fewer stretches.
    pub duration: R,
}

impl<R: Real> InputDelay<R> {
    /// A delay of each candidate `[s]`.
    pub fn new(seconds: R) -> InputDelay<R> {
        InputDelay {
            seconds,
            history: VecDeque::new(),
            newer: vec![0; R::WIDTH],
        }
    }

    /// What acts from a sample at `start` to the next, `interval` later, where `held` is new.
    pub fn stretches(
        &mut self,
        held: &HeldQuantities<R>,
        start: f64,
        interval: f64,
    ) -> Vec<HeldStretch<R>> {
        if self.history.is_empty() {
            self.history.push_back((f64::NEG_INFINITY, held.standing()));
        }
        self.history.push_back((start, held.clone()));
        self.newer.iter_mut().for_each(|newer| *newer += 1);
        let close = SAME * interval;
        // Times from here on are those since the sample, so that a candidate without a delay has
        // the very interval.
        let mut reached = vec![0.0; R::WIDTH];
        // What has begun to act by now acts from the start on.
        for lane in 0..R::WIDTH {
            while self.next_change(lane, start).is_some_and(|at| at <= close) {
                self.newer[lane] -= 1;
            }
        }
        let mut stretches = Vec::new();
        loop {
            let mut stretch = HeldStretch {
                held: held.clone(),
                duration: R::splat(0.0),
            };
            let mut is_last = true;
            for (lane, reached) in reached.iter_mut().enumerate() {
                let change = self.next_change(lane, start);
                let change = change.filter(|at| *at < interval - close);
                let until = change.unwrap_or(interval);
                stretch.duration.set_lane(lane, until - *reached);
                self.put_acting(lane, start + *reached, &mut stretch.held);
                *reached = until;
                self.newer[lane] -= usize::from(change.is_some());
                is_last &= change.is_none();
            }
            stretches.push(stretch);
            if is_last {
                self.forget();
                return stretches;
            }
        }
    }

    /// How long after `start` the quantities after those that act on a candidate begin to.
    fn next_change(&self, lane: usize, start: f64) -> Option<f64> {
        let newer = self.newer[lane].checked_sub(1)?;
        let (from, _) = &self.history[self.history.len() - 1 - newer];
        Some((from - start) + self.seconds.lane(lane))
    }

    /// Writes what acts on a candidate at an instant.
    fn put_acting(&self, lane: usize, at: f64, held: &mut HeldQuantities<R>) {
        let (from, acting) = &self.history[self.history.len() - 1 - self.newer[lane]];
        let since = at - (from + self.seconds.lane(lane));
        let since = if since.is_finite() { since } else { 0.0 };
        held.set_lane(lane, acting, since);
    }

    /// Forgets what acts on no candidate any more.
    fn forget(&mut self) {
        let oldest = self.newer.iter().copied().max().unwrap_or(0).min(LONGEST);
        while self.history.len() > oldest + 1 {
            self.history.pop_front();
        }
        for newer in &mut self.newer {
            *newer = (*newer).min(oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::lanes::Lanes;

    type Row = Lanes<f64, 2>;

    fn held(value: f64) -> HeldQuantities<Row> {
        HeldQuantities {
            values: vec![Row::splat(value)],
            slopes: Vec::new(),
        }
    }

    /// (what acts, for how long) of one candidate, without the stretches that it does not have.
    fn of_lane(stretches: &[HeldStretch<Row>], lane: usize) -> Vec<(f64, f64)> {
        let all = stretches
            .iter()
            .map(|stretch| (stretch.held.values[0].0[lane], stretch.duration.0[lane]));
        all.filter(|(_, duration)| *duration > 0.0).collect()
    }

    #[test]
    fn each_candidate_sees_a_step_after_its_own_delay() {
        let mut delay = InputDelay::new(Lanes([0.25, 1.0]));
        let first = delay.stretches(&held(1.0), 0.0, 1.0);
        assert_eq!(
            of_lane(&first, 1),
            [(1.0, 1.0)],
            "before the record: the first value"
        );
        let second = delay.stretches(&held(2.0), 1.0, 1.0);
        assert_eq!(of_lane(&second, 0), [(1.0, 0.25), (2.0, 0.75)]);
        assert_eq!(of_lane(&second, 1), [(1.0, 1.0)]);
        let third = delay.stretches(&held(3.0), 2.0, 1.0);
        assert_eq!(of_lane(&third, 0), [(2.0, 0.25), (3.0, 0.75)]);
        assert_eq!(of_lane(&third, 1), [(2.0, 1.0)]);
    }

    #[test]
    fn between_samples_far_apart_several_changes_act() {
        let mut delay = InputDelay::new(Lanes([3.0, 3.0]));
        for (start, interval) in [(0.0, 1.0), (1.0, 1.0), (2.0, 0.5)] {
            delay.stretches(&held(start), start, interval);
        }
        let late = delay.stretches(&held(9.0), 2.5, 5.0);
        assert_eq!(
            of_lane(&late, 0),
            [(0.0, 0.5), (0.0, 1.0), (1.0, 1.0), (2.0, 0.5), (9.0, 2.0)]
        );
    }

    #[test]
    fn a_moving_quantity_is_seen_where_it_stood_a_delay_ago() {
        let mut delay = InputDelay::new(Lanes([0.5, 0.5]));
        let moving = HeldQuantities {
            values: vec![Row::splat(10.0)],
            slopes: vec![Row::splat(4.0)],
        };
        let first = delay.stretches(&moving, 0.0, 2.0);
        assert_eq!(of_lane(&first, 0), [(10.0, 0.5), (10.0, 1.5)]);
        let still = moving.standing();
        let second = delay.stretches(&still, 2.0, 2.0);
        assert_eq!(of_lane(&second, 0)[0], (16.0, 0.5));
    }
}
