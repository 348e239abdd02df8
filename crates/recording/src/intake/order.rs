//! How times follow each other: newest first, or several samples at a time that is told too coarsely.

use crate::{Warning, shown};

/// Steps of times that are told too coarsely `[s]`: to the minute, the second, and fractions of it.
const STEPS: [f64; 5] = [60.0, 1.0, 0.1, 0.01, 0.001];

/// How much a step may differ by rounding.
const ROUNDING: f64 = 1e-6;

/// Times that are looked at to see their order.
const LOOKED_AT: usize = 10_000;

/// The rows of one time are at most so many times as many as usual.
pub(super) const MOST_TIMES_USUAL: usize = 2;

/// The order of the times of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TimeOrder {
    pub(super) is_newest_first: bool,
    pub(super) coarse: Option<CoarseTimes>,
}

/// Times that several rows share because they are told too coarsely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CoarseTimes {
    /// The step from one time to the next `[s]`.
    pub(super) step: f64,
    /// How many rows a time usually has.
    pub(super) rows: usize,
}

impl TimeOrder {
    /// The order of the times of the first rows `[s]`.
    pub(super) fn of(instants: &[f64]) -> TimeOrder {
        let instants = &instants[..instants.len().min(LOOKED_AT)];
        let groups: Vec<(f64, usize)> = instants
            .chunk_by(|a, b| a == b)
            .map(|group| (group[0], group.len()))
            .collect();
        let falls = groups
            .windows(2)
            .filter(|pair| pair[1].0 < pair[0].0)
            .count();
        TimeOrder {
            is_newest_first: groups.len() > 2 && falls + 1 == groups.len(),
            coarse: CoarseTimes::of(&groups),
        }
    }

    /// Whether a time comes after another one in this order.
    pub(super) fn follows(self, instant: f64, last: f64) -> bool {
        match self.is_newest_first {
            true => instant < last,
            false => instant > last,
        }
    }
}

impl CoarseTimes {
    /// The step and the usual number of rows of times with the number of their rows.
    fn of(groups: &[(f64, usize)]) -> Option<CoarseTimes> {
        let are_equal = groups.len() > 1 && groups.iter().all(|group| group.1 == groups[0].1);
        // The first and the last time may have begun before the rows and go on behind them.
        let whole = match are_equal {
            true => groups,
            false => groups
                .get(1..groups.len() - 1)
                .filter(|whole| whole.len() > 1)?,
        };
        let mut counts: Vec<usize> = whole.iter().map(|group| group.1).collect();
        counts.sort_unstable();
        let rows = counts[counts.len() / 2];
        let mut steps: Vec<f64> = groups
            .windows(2)
            .map(|pair| (pair[1].0 - pair[0].0).abs())
            .collect();
        steps.sort_unstable_by(f64::total_cmp);
        let usual = steps[steps.len() / 2];
        let step = STEPS
            .into_iter()
            .find(|step| (usual / step - 1.0).abs() < ROUNDING)?;
        let is_usual = |count: &&usize| count.abs_diff(rows) <= rows / 8;
        let is_one_step = |between: &&f64| (**between / step - 1.0).abs() < ROUNDING;
        let are_most = |count: usize, of: usize| 5 * count >= 4 * of;
        let are_even = are_most(counts.iter().filter(is_usual).count(), counts.len())
            && are_most(steps.iter().filter(is_one_step).count(), steps.len());
        (rows > 1 && are_even).then_some(CoarseTimes { step, rows })
    }

    /// Whether there is room for the rows of a time up to another one.
    pub(super) fn has_room(self, from: f64, to: f64) -> bool {
        (to - from).abs() > self.step * (1.0 - ROUNDING)
    }

    /// Says that the rows of a time were spread.
    pub(super) fn note(self) -> Warning {
        let detail = format!(
            "times are told to {} s only, and about {} rows have each: they were spread evenly up to the next time",
            shown(self.step),
            self.rows
        );
        Warning::of_recording("spread_rows", detail)
    }

    /// How far behind its time a row lies `[s]`, the k-th of so many of that time. The rows of a time that began
    /// before them are its last.
    pub(super) fn offset(self, k: usize, count: usize, has_begun: bool) -> f64 {
        let missing = match has_begun {
            true => self.rows.saturating_sub(count),
            false => 0,
        };
        self.step * (missing + k) as f64 / self.rows.max(count) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coarse(instants: &[f64]) -> Option<(f64, usize)> {
        let coarse = TimeOrder::of(instants).coarse;
        coarse.map(|coarse| (coarse.step, coarse.rows))
    }

    #[test]
    fn rows_share_a_time_where_nearly_each_time_has_as_many() {
        assert_eq!(coarse(&[0.0, 0.0, 1.0, 1.0]), Some((1.0, 2)));
        assert_eq!(coarse(&[0.0, 1.0, 1.0, 2.0, 2.0, 3.0]), Some((1.0, 2)));
        assert_eq!(coarse(&[60.0, 60.0, 0.0, 0.0]), Some((60.0, 2)));
        assert_eq!(coarse(&[0.0, 1.0, 1.0, 2.0]), None, "one row twice");
        assert_eq!(coarse(&[0.0, 1.0, 1.0, 2.0, 3.0, 4.0]), None);
        assert_eq!(
            coarse(&[0.0, 0.0, 5.0, 5.0, 10.0, 10.0]),
            None,
            "not too coarse"
        );
        assert_eq!(coarse(&[]), None);
    }

    #[test]
    fn the_rows_of_a_time_are_spread_up_to_the_next() {
        let coarse = CoarseTimes { step: 1.0, rows: 4 };
        assert_eq!(coarse.offset(1, 4, false), 0.25);
        assert_eq!(coarse.offset(0, 1, true), 0.75);
        assert_eq!(coarse.offset(4, 5, false), 0.8);
        assert_eq!(coarse.offset(1, 2, false), 0.25);
    }
}
