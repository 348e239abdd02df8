//! When the samples of a recording were taken.

use super::columns::SampleSeries;
use super::resample::{JITTER, ON_GRID, STRAY};
use std::io;
use std::ops::Range;

/// How far a sample may lie from its place on a uniform grid, in sample times.
pub const JITTER_TOLERANCE: f64 = 1e-3;

/// How far a sample may lie from an instant that names it, in sample times. It covers rounding.
const ON_TIME: f64 = 1e-6;

/// The nanoseconds of a second.
const SECOND_NS: f64 = 1e9;

/// The times up to which a double of seconds tells neighbouring nanoseconds apart: 26 days.
const TOLD_TO_A_NANOSECOND_S: f64 = (1_u64 << 51) as f64 / SECOND_NS;

/// Longer times are told to so many nanoseconds, the finest that historians write.
pub(crate) const TICK: i64 = 100;

/// Whether a time `[s]` is so long that a double does not tell neighbouring nanoseconds apart.
pub(crate) fn is_beyond_nanoseconds(seconds: f64) -> bool {
    seconds.abs() > TOLD_TO_A_NANOSECOND_S
}

/// A time `[s]` in nanoseconds: exact for whole nanoseconds up to 26 days, and beyond that for whole
/// [`TICK`]s up to seven years.
pub(crate) fn nanoseconds(seconds: f64) -> i64 {
    match is_beyond_nanoseconds(seconds) {
        true => ((seconds * (SECOND_NS / TICK as f64)).round() as i64).saturating_mul(TICK),
        false => (seconds * SECOND_NS).round() as i64,
    }
}

/// The instants of the samples, in seconds from the first one.
#[derive(Clone, Debug, PartialEq)]
pub enum TimeAxis {
    /// Sample k was taken at `k * sample_time`.
    Uniform {
        /// The sample time `[s]`.
        sample_time: f64,
        /// The number of samples.
        samples: usize,
    },
    /// Sample k was taken at the k-th instant; strictly increasing from 0.
    Instants(Vec<f64>),
}

impl TimeAxis {
    /// The axis of strictly increasing instants that begin at 0: uniform where every instant is
    /// within a thousandth of a sample time of the grid between the first and the last.
    ///
    /// `scale` is the largest number that the source wrote for a time `[s]`; its rounding limits
    /// what the instants can tell about the sample time.
    #[must_use]
    pub fn from_instants(instants: Vec<f64>, scale: f64) -> Self {
        let last = instants.last().copied().unwrap_or(0.0);
        let grid = UniformGrid::through(instants.len(), last, scale);
        match grid.filter(|grid| grid.holds(0, &instants)) {
            Some(grid) => grid.axis(instants.len()),
            None => Self::Instants(instants),
        }
    }

    /// The sample time `[s]` of the axis of such instants.
    pub(crate) fn sample_time_of(instants: &[f64], scale: f64) -> f64 {
        let last = instants.last().copied().unwrap_or(0.0);
        let grid = UniformGrid::through(instants.len(), last, scale);
        match grid.filter(|grid| grid.holds(0, instants)) {
            Some(grid) => grid.sample_time,
            None => usual_interval(instants),
        }
    }

    /// The axis of so many instants up to the `last` one that need not be in memory.
    pub(crate) fn of_series(
        instants: &mut dyn SampleSeries,
        samples: usize,
        last: f64,
        scale: f64,
    ) -> io::Result<Self> {
        let mut grid = UniformGrid::through(samples, last, scale);
        let mut first = 0;
        instants.visit(&mut |piece| {
            grid = grid.filter(|grid| grid.holds(first, piece));
            first += piece.len();
            Ok(())
        })?;
        match grid {
            Some(grid) => Ok(grid.axis(samples)),
            None => Ok(Self::Instants(instants.collect()?)),
        }
    }

    /// The number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        match self {
            Self::Uniform { samples, .. } => *samples,
            Self::Instants(instants) => instants.len(),
        }
    }

    /// When sample `k` was taken `[s]`.
    ///
    /// # Panics
    /// When `k` is past the end of a non-uniform axis.
    #[must_use]
    pub fn instant(&self, k: usize) -> f64 {
        match self {
            Self::Uniform { sample_time, .. } => k as f64 * sample_time,
            Self::Instants(instants) => instants[k],
        }
    }

    /// The time from the first to the last sample `[s]`.
    #[must_use]
    pub fn duration(&self) -> f64 {
        match self.samples() {
            0 => 0.0,
            samples => self.instant(samples - 1),
        }
    }

    /// Whether the samples lie on a uniform grid.
    #[must_use]
    pub fn is_uniform(&self) -> bool {
        matches!(self, Self::Uniform { .. })
    }

    /// The sample time `[s]`; where the samples are not uniform that of the grid that they are of
    /// but for jitter and gaps, or else the median interval.
    #[must_use]
    pub fn sample_time(&self) -> f64 {
        match self {
            Self::Uniform { sample_time, .. } => *sample_time,
            Self::Instants(instants) => usual_interval(instants),
        }
    }

    /// The samples between two times `[s]`, both included; from the first, up to the last when
    /// absent.
    #[must_use]
    pub fn between(&self, from: Option<f64>, to: Option<f64>) -> Range<usize> {
        let samples = self.samples();
        let start = from.map_or(0, |from| self.first_from(from));
        let end = to.map_or(samples, |to| {
            let k = self.first_from(to);
            let on_time = |k| self.instant(k) <= to + ON_TIME * self.sample_time();
            if k < samples && on_time(k) { k + 1 } else { k }
        });
        start..end.max(start)
    }

    /// The first sample at or after `time` `[s]`.
    fn first_from(&self, time: f64) -> usize {
        let early = time - ON_TIME * self.sample_time();
        match self {
            Self::Uniform {
                sample_time,
                samples,
            } => {
                let k = (early / sample_time).ceil().clamp(0.0, *samples as f64);
                k as usize
            }
            Self::Instants(instants) => instants.partition_point(|instant| *instant < early),
        }
    }
}

/// A uniform grid from 0 to the last of some instants.
#[derive(Clone, Copy)]
struct UniformGrid {
    sample_time: f64,
}

impl UniformGrid {
    fn through(samples: usize, last: f64, scale: f64) -> Option<Self> {
        if samples < 2 || last <= 0.0 {
            return None;
        }
        let intervals = (samples - 1) as f64;
        let rounding = 2.0 * f64::EPSILON * scale.abs().max(last) / intervals;
        Some(Self {
            sample_time: shortest_decimal(last / intervals, rounding),
        })
    }

    /// Whether `instants`, the first of which has the index `first`, lie on the grid.
    fn holds(&self, first: usize, instants: &[f64]) -> bool {
        let Self { sample_time } = *self;
        (first..).zip(instants).all(|(k, instant)| {
            (instant - k as f64 * sample_time).abs() <= JITTER_TOLERANCE * sample_time
        })
    }

    fn axis(self, samples: usize) -> TimeAxis {
        TimeAxis::Uniform {
            sample_time: self.sample_time,
            samples,
        }
    }
}

/// The decimal number of the fewest digits within `tolerance` of `value`: 0.01, not
/// 0.009999999999999998, where the difference is rounding.
fn shortest_decimal(value: f64, tolerance: f64) -> f64 {
    (0..15)
        .filter_map(|digits| format!("{value:.digits$e}").parse::<f64>().ok())
        .find(|decimal| (decimal - value).abs() <= tolerance)
        .unwrap_or(value)
}

/// The time from one sample to the next: that of the grid which the instants are of but for jitter
/// and gaps, or else the median. The median alone is off by a part of the jitter, which adds up over
/// a recording; the time from the first sample of a grid to its last is not.
fn usual_interval(instants: &[f64]) -> f64 {
    let intervals = || instants.windows(2).map(|pair| pair[1] - pair[0]);
    let mut sorted: Vec<f64> = intervals().collect();
    if sorted.is_empty() {
        return 0.0;
    }
    let middle = sorted.len() / 2;
    let (_, median, _) = sorted.select_nth_unstable_by(middle, f64::total_cmp);
    let median = *median;
    let is_whole = |interval: &f64| {
        let times = interval / median;
        times > 0.5 && (times - times.round()).abs() <= JITTER
    };
    let (mut time, mut times, mut whole) = (0.0, 0.0, 0);
    for interval in intervals().filter(is_whole) {
        time += interval;
        times += (interval / median).round();
        whole += 1;
    }
    // Where half of them are the median to the last digit it is what the source intends, and the
    // others came late.
    let same = intervals().filter(|interval| (interval - median).abs() <= ON_GRID * median);
    let is_intended = 2 * same.count() >= sorted.len();
    if is_intended || (whole as f64) < (1.0 - STRAY) * sorted.len() as f64 {
        return shortest_decimal(median, 1e-9 * median);
    }
    shortest_decimal(time / times, 1e-9 * median)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(instants: &[f64]) -> TimeAxis {
        TimeAxis::from_instants(instants.to_vec(), 0.0)
    }

    #[test]
    fn rounding_in_the_times_does_not_show_in_the_sample_time() {
        let instants: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.01).collect();
        assert_eq!(
            axis(&instants),
            TimeAxis::Uniform {
                sample_time: 0.01,
                samples: 1000
            }
        );
    }

    #[test]
    fn a_sample_time_that_is_no_short_decimal_is_kept() {
        let third = 1.0 / 3.0;
        let instants: Vec<f64> = (0..100).map(|k| f64::from(k) * third).collect();
        assert_eq!(axis(&instants).sample_time(), third);
    }

    #[test]
    fn jitter_above_a_thousandth_of_the_sample_time_is_not_uniform() {
        assert!(axis(&[0.0, 1.0009, 2.0, 3.0]).is_uniform());
        assert!(!axis(&[0.0, 1.0011, 2.0, 3.0]).is_uniform());
    }

    #[test]
    fn the_sample_time_of_a_non_uniform_axis_is_its_median_interval() {
        assert_eq!(axis(&[0.0, 1.0, 2.0, 10.0]).sample_time(), 1.0);
    }

    #[test]
    fn jitter_does_not_add_up_over_a_grid() {
        // Each instant is off by up to 1 % of the sample time, one in seven is missing.
        let jitter = |k: u32| 1e-4 * (f64::from(k * k % 2001 * 7919 % 2001) / 1000.0 - 1.0);
        let kept = (0..2000).filter(|k| k % 7 != 3);
        let instants: Vec<f64> = kept.map(|k| f64::from(k) * 0.01 + jitter(k)).collect();
        let found = TimeAxis::Instants(instants).sample_time();
        // The first and the last instant are off by 1e-4 at the most; the median comes to 4e-2.
        assert!((found - 0.01).abs() * 2000.0 < 2e-4, "{found}");
    }

    #[test]
    fn first_from_finds_the_same_sample_on_both_kinds_of_axis() {
        let uniform = TimeAxis::Uniform {
            sample_time: 0.1,
            samples: 11,
        };
        let instants = TimeAxis::Instants((0..11).map(|k| f64::from(k) * 0.1).collect());
        for (time, k) in [
            (-1.0, 0),
            (0.0, 0),
            (0.3, 3),
            (0.31, 4),
            (1.0, 10),
            (1.1, 11),
            (9.0, 11),
        ] {
            assert_eq!(uniform.first_from(time), k, "uniform, {time} s");
            assert_eq!(instants.first_from(time), k, "instants, {time} s");
        }
    }
}
