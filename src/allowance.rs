//! What somebody may do so often a second, and so often at once after a pause.

use std::time::{Duration, Instant};

/// How often something may be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    /// Times a second in the long run.
    pub per_second: f64,
    /// Times at once after a pause.
    pub at_once: f64,
}

/// How often somebody may do something now.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    left: f64,
    seen: Instant,
}

impl Allowance {
    /// The allowance of somebody who has done nothing yet.
    #[must_use]
    pub fn of(rate: Rate, now: Instant) -> Self {
        Self {
            left: rate.at_once,
            seen: now,
        }
    }

    /// Counts one time.
    ///
    /// # Errors
    /// It is too often: how long it takes until the next time is allowed.
    pub fn take(&mut self, rate: Rate, now: Instant) -> Result<(), Duration> {
        self.left = self.left_at(rate, now);
        self.seen = now;
        if self.left < 1.0 {
            let wait_s = (1.0 - self.left) / rate.per_second;
            return Err(Duration::try_from_secs_f64(wait_s).unwrap_or(Duration::MAX));
        }
        self.left -= 1.0;
        Ok(())
    }

    /// Whether nothing is left of what was done before.
    #[must_use]
    pub fn is_whole(&self, rate: Rate, now: Instant) -> bool {
        self.left_at(rate, now) >= rate.at_once
    }

    fn left_at(&self, rate: Rate, now: Instant) -> f64 {
        let passed = now.duration_since(self.seen).as_secs_f64();
        (self.left + passed * rate.per_second).min(rate.at_once)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_a_pause_as_much_is_allowed_as_at_once_and_no_more() {
        let rate = Rate {
            per_second: 2.0,
            at_once: 3.0,
        };
        let begin = Instant::now();
        let mut allowance = Allowance::of(rate, begin);
        let taken = |allowance: &mut Allowance, at: Instant| {
            (0..10)
                .take_while(|_| allowance.take(rate, at).is_ok())
                .count()
        };
        assert_eq!(taken(&mut allowance, begin), 3);
        let wait = allowance.take(rate, begin).expect_err("too often");
        assert_eq!(wait, Duration::from_millis(500));
        assert_eq!(taken(&mut allowance, begin + Duration::from_secs(1)), 2);
        let later = begin + Duration::from_secs(100);
        assert!(allowance.is_whole(rate, later));
        assert_eq!(taken(&mut allowance, later), 3);
        assert!(!allowance.is_whole(rate, later));
    }
}
