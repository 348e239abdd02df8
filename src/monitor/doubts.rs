//! Whether estimates can be trusted less than they could.
//!
//! Now and then chance makes a good window look doubtful, at one plant more often than at another. How often it
//! does is counted. Trust has fallen where so many windows in a row have less than usual that chance does this no
//! more often than the false-alarm rate of the monitor allows: with `d` doubtful windows of `n` before, and nothing
//! known of their share before that, `k` in a row have the probability `∏ (d + 1 + i) / (n + 2 + i)`, `i` from 0 to
//! `k − 1` (the rule of succession of Laplace).

use serde::{Deserialize, Serialize};

use greybox::identification::outcome::Trust;

/// How far the estimates of windows could be trusted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Doubts {
    /// How many windows there were of low, moderate and high trust, without those of the row that lasts.
    windows: [u32; 3],
    /// The trust of the windows of the row that lasts: each can be trusted less than usual.
    row: Vec<Trust>,
}

impl Doubts {
    /// Takes the trust of a window into account beside the usual one; says whether it has fallen.
    pub fn take(&mut self, trust: Trust, usual: Trust, rate: f64) -> bool {
        if trust >= usual {
            self.end_row();
            self.windows[trust as usize] += 1;
            return false;
        }
        self.row.push(trust);
        let windows: u32 = self.windows.iter().sum();
        let doubtful: u32 = self.windows[..usual as usize].iter().sum();
        let next =
            |i: usize| (f64::from(doubtful + 1) + i as f64) / (f64::from(windows + 2) + i as f64);
        let by_chance: f64 = (0..self.row.len()).map(next).product();
        let has_fallen = by_chance <= rate;
        if has_fallen {
            self.end_row();
        }
        has_fallen
    }

    fn end_row(&mut self) {
        for trust in self.row.drain(..) {
            self.windows[trust as usize] += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox::numerics::rng;
    use rand::RngExt;

    /// The windows in which trust is told to have fallen.
    fn told(trusts: impl Iterator<Item = Trust>) -> Vec<usize> {
        let (mut doubts, mut usual) = (Doubts::default(), Trust::Low);
        let falls = trusts.enumerate().filter_map(|(window, trust)| {
            let has_fallen = doubts.take(trust, usual, 1e-3);
            usual = if has_fallen { trust } else { usual.max(trust) };
            has_fallen.then_some(window)
        });
        falls.collect()
    }

    #[test]
    fn what_chance_does_is_told_no_more_often_than_stated() {
        for share in [0.01, 0.05, 0.2, 0.5, 0.8] {
            let falls = (0..200).map(|seed| {
                let mut random = rng::stream(seed, 0, rng::Purpose::Noise);
                let trusts = (0..500).map(|_| match random.random::<f64>() < share {
                    true if random.random::<f64>() < 0.3 => Trust::Low,
                    true => Trust::Moderate,
                    false => Trust::High,
                });
                told(trusts).len()
            });
            let falls: usize = falls.sum();
            // Stated are 100 of 100 000 windows, and three Poisson deviations.
            assert!(falls <= 130, "{falls} where chance doubts {share}");
        }
    }

    #[test]
    fn trust_that_falls_for_good_is_told_once_and_soon() {
        for (good, within) in [(10, 4), (40, 3), (1000, 1)] {
            let trusts = (0..good + 50).map(|window| match window < good {
                true => Trust::High,
                false => Trust::Moderate,
            });
            let falls = told(trusts);
            assert_eq!(falls.len(), 1, "{falls:?}");
            assert!(
                (good..good + within).contains(&falls[0]),
                "{falls:?} after {good}"
            );
        }
    }
}
