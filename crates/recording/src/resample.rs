//! Samples at irregular instants onto other instants, each signal in its own way.
//!
//! A *held* signal has the value of its last sample; a sample within half a sample time of an instant
//! counts as taken there, so that the jitter of a logger delays nothing. Any other signal goes
//! straight from one sample to the next. Where nothing says that it does and the two are more than
//! [`LONGEST_BRIDGE`] sample times apart, or where one of them is missing, what lies between is
//! missing: nothing is invented.

use super::{ExperimentError, Interpolation};
use greybox_numerics::interpolation::linear;

/// The longest interval that is interpolated over, in sample times.
pub const LONGEST_BRIDGE: f64 = 2.0;

/// The most samples of a grid for each irregular one: a grid of gaps is no experiment.
const MOST_GRID_SAMPLES: usize = 20;

/// How far an instant may be from a grid point to be on it, in sample times. It covers rounding.
pub(super) const ON_GRID: f64 = 1e-6;

/// How far a sample may be from a grid point to be of it, in sample times.
const OF_GRID: f64 = 0.5;

/// How far intervals may be from whole sample times on a grid, in sample times: the jitter of a
/// logger.
pub(super) const JITTER: f64 = 0.2;

/// The share of the intervals of a grid that may be further off.
pub(super) const STRAY: f64 = 0.05;

/// The most samples of a grid for each that is there, where instants are those of a grid with
/// gaps: with more, a grid would mean to invent samples.
const FEW_GAPS: f64 = 1.25;

/// Whether instants are those of a uniform grid, but for jitter and single gaps.
pub(super) fn is_of_grid(instants: &[f64], sample_time: f64) -> bool {
    let [first, .., last] = instants else {
        return true;
    };
    let is_whole = |pair: &&[f64]| {
        let times = (pair[1] - pair[0]) / sample_time;
        times > 0.5 && (times - times.round()).abs() <= JITTER
    };
    let whole = instants.windows(2).filter(is_whole).count() as f64;
    let intervals = (instants.len() - 1) as f64;
    whole >= (1.0 - STRAY) * intervals && (last - first) / sample_time <= FEW_GAPS * intervals
}

/// A signal with a value at each of its instants, as far as it goes on from one sample to
/// another; what lies before the first sample is missing.
pub(super) fn filled(
    instants: &[f64],
    values: &[f64],
    sample_time: f64,
    rule: ResampleRule,
) -> Vec<f64> {
    if rule.interpolation == Interpolation::Hold {
        return held(values);
    }
    let pairs = instants.iter().zip(values);
    let (sampled_at, present): (Vec<f64>, Vec<f64>) =
        pairs.filter(|(_, value)| !value.is_nan()).unzip();
    if sampled_at.is_empty() {
        return values.to_vec();
    }
    let on_line = resample(
        &sampled_at,
        &present,
        instants.iter().copied(),
        sample_time,
        rule,
    );
    // A line ends at its last sample; from there on the value stays.
    let after = values
        .iter()
        .rposition(|value| !value.is_nan())
        .unwrap_or(0);
    let (line, end) = on_line.split_at(after);
    line.iter()
        .copied()
        .chain(end.iter().map(|_| values[after]))
        .collect()
}

/// The last value that is there, at each sample.
fn held(values: &[f64]) -> Vec<f64> {
    let mut last = f64::NAN;
    let mut hold = |value: &f64| {
        last = if value.is_nan() { last } else { *value };
        last
    };
    values.iter().map(&mut hold).collect()
}

/// How a signal goes on between its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ResampleRule {
    pub(crate) interpolation: Interpolation,
    /// The longest interval that a straight line crosses, in sample times.
    pub(crate) longest_bridge: f64,
}

impl ResampleRule {
    /// For a signal whose own sample time is so many times that of the grid.
    pub(crate) fn scaled(self, times: f64) -> Self {
        Self {
            longest_bridge: self.longest_bridge * times.max(1.0),
            ..self
        }
    }

    /// By what is known of a signal; what is not known is `otherwise`.
    pub(crate) fn of(declared: Option<Interpolation>, otherwise: Interpolation) -> Self {
        Self {
            interpolation: declared.unwrap_or(otherwise),
            longest_bridge: match declared {
                Some(_) => f64::INFINITY,
                None => LONGEST_BRIDGE,
            },
        }
    }
}

/// The values at the instants `at`, strictly increasing, of a signal that has `values` at
/// `instants`; missing before the first and, of a straight line, after the last of them.
pub(crate) fn resample(
    instants: &[f64],
    values: &[f64],
    at: impl Iterator<Item = f64>,
    sample_time: f64,
    rule: ResampleRule,
) -> Vec<f64> {
    let mut right = 0;
    at.map(|time| {
        while right + 1 < instants.len() && instants[right] < time {
            right += 1;
        }
        let place = Between {
            instants,
            values,
            right,
        };
        match rule.interpolation {
            Interpolation::Hold => place.held(time, sample_time),
            Interpolation::Linear => {
                place.on_line(time, sample_time, rule.longest_bridge * sample_time)
            }
        }
    })
    .collect()
}

/// Two neighbouring samples: that at `right`, at or after the instant asked for where there is one,
/// and the one before.
struct Between<'a> {
    instants: &'a [f64],
    values: &'a [f64],
    right: usize,
}

impl Between<'_> {
    fn held(&self, time: f64, sample_time: f64) -> f64 {
        let Self {
            instants,
            values,
            right,
        } = *self;
        let left = right.saturating_sub(1);
        let distance = |k: usize| (instants[k] - time).abs();
        let nearest = if distance(right) < distance(left) {
            right
        } else {
            left
        };
        if distance(nearest) <= OF_GRID * sample_time {
            return values[nearest];
        }
        match [right, left].into_iter().find(|k| instants[*k] <= time) {
            Some(before) => values[before],
            None => f64::NAN,
        }
    }

    fn on_line(&self, time: f64, sample_time: f64, longest: f64) -> f64 {
        let Self {
            instants,
            values,
            right,
        } = *self;
        let left = right.saturating_sub(1);
        let tolerance = ON_GRID * sample_time;
        for k in [left, right] {
            if (instants[k] - time).abs() <= tolerance {
                return values[k];
            }
        }
        let interval = instants[right] - instants[left];
        let is_between = instants[left] < time && time < instants[right];
        if !is_between || interval > longest + tolerance {
            return f64::NAN;
        }
        let ends = [left, right];
        linear(ends.map(|k| instants[k]), ends.map(|k| values[k]), time)
    }
}

/// Where the samples of a uniform grid lie among strictly increasing instants.
#[derive(Clone, Debug)]
pub(super) struct ResampleGrid<'a> {
    instants: &'a [f64],
    sample_time: f64,
    samples: usize,
}

impl<'a> ResampleGrid<'a> {
    /// The grid that begins at the first instant and ends at the last or within a sample before.
    ///
    /// # Errors
    /// When more than 19 in 20 samples of the grid would be missing.
    pub(super) fn over(instants: &'a [f64], sample_time: f64) -> Result<Self, ExperimentError> {
        let duration = match instants {
            [first, .., last] => last - first,
            _ => 0.0,
        };
        let samples = (duration / sample_time + ON_GRID).floor() as usize;
        let samples = samples.saturating_add(1);
        if samples > MOST_GRID_SAMPLES * instants.len() {
            return Err(ExperimentError::TooSparse {
                sample_time,
                samples: instants.len(),
                grid_samples: samples,
            });
        }
        Ok(Self {
            instants,
            sample_time,
            samples,
        })
    }

    /// The number of samples.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// The values at the grid points of a signal that has `values` at the instants.
    pub(super) fn resample(&self, values: &[f64], rule: ResampleRule) -> Vec<f64> {
        resample(self.instants, values, self.times(), self.sample_time, rule)
    }

    fn times(&self) -> impl Iterator<Item = f64> {
        let first = self.instants[0];
        (0..self.samples).map(move |k| first + k as f64 * self.sample_time)
    }

    /// Values at the grid points, missing where no sample was taken near: nothing is measured.
    /// Where it is the stamps that jitter and not the samples, samples stand where the grid has them.
    pub(super) fn measured(&self, values: &[f64], rule: ResampleRule) -> Vec<f64> {
        let pairs = self.instants.iter().copied().zip(values.iter().copied());
        let samples: Vec<(f64, f64)> = pairs.filter(|(_, value)| !value.is_nan()).collect();
        let reach = OF_GRID * self.sample_time;
        let nearest = |time: f64| {
            let after = samples.partition_point(|(instant, _)| *instant < time - reach);
            let near = samples[after..].iter();
            let near = near.take_while(|(instant, _)| *instant <= time + reach);
            let nearest = near.min_by(|a, b| (a.0 - time).abs().total_cmp(&(b.0 - time).abs()));
            nearest.map_or(f64::NAN, |(_, value)| *value)
        };
        let at_samples = self.times().map(nearest);
        if self.is_straighter_on_grid(values) {
            return at_samples.collect();
        }
        let pairs = self.resample(values, rule).into_iter().zip(at_samples);
        pairs
            .map(|(value, near)| if near.is_nan() { f64::NAN } else { value })
            .collect()
    }

    /// Whether samples lie closer to the line through their neighbours when all are taken for those
    /// of the grid than when they are taken for those of their stamps.
    fn is_straighter_on_grid(&self, values: &[f64]) -> bool {
        let is_single = |pair: &[f64]| {
            let times = (pair[1] - pair[0]) / self.sample_time;
            (times - 1.0).abs() <= JITTER
        };
        let (mut on_grid, mut as_stamped) = (0.0, 0.0);
        for (instants, values) in self.instants.windows(3).zip(values.windows(3)) {
            let is_whole = is_single(&instants[..2]) && is_single(&instants[1..]);
            if !is_whole || values.iter().any(|value| value.is_nan()) {
                continue;
            }
            let share = (instants[1] - instants[0]) / (instants[2] - instants[0]);
            let beside = |share: f64| values[1] - values[0] - share * (values[2] - values[0]);
            on_grid += beside(0.5).powi(2);
            as_stamped += beside(share).powi(2);
        }
        on_grid < as_stamped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LINE: ResampleRule = ResampleRule {
        interpolation: Interpolation::Linear,
        longest_bridge: LONGEST_BRIDGE,
    };

    #[test]
    fn a_gap_of_more_than_two_sample_times_stays_empty() {
        let instants = [0.0, 1.0, 2.0, 4.0, 7.0, 8.0];
        let values = ResampleGrid::over(&instants, 1.0)
            .unwrap()
            .resample(&instants, LINE);
        assert_eq!(values[..5], [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert!(values[5].is_nan() && values[6].is_nan());
        assert_eq!(values[7..], [7.0, 8.0]);
    }

    /// A sine, sampled at some instants.
    fn sine(instants: &[f64]) -> Vec<f64> {
        instants.iter().map(|time| (0.1 * time).sin()).collect()
    }

    #[test]
    fn stamps_that_jitter_move_no_sample_and_samples_that_do_are_interpolated() {
        let jitter = |k: usize| 0.05 * ((k * 7 % 11) as f64 / 5.0 - 1.0);
        let grid: Vec<f64> = (0..60).map(|k| k as f64).collect();
        let stamps: Vec<f64> = (0..60).map(|k| k as f64 + jitter(k) - jitter(0)).collect();
        let placed = ResampleGrid::over(&stamps, 1.0).unwrap();
        let values = placed.measured(&sine(&grid), LINE);
        assert_eq!(values[..], sine(&grid)[..values.len()]);
        let values = placed.measured(&sine(&stamps), LINE);
        let moved = values
            .iter()
            .zip(sine(&grid))
            .map(|(own, truth)| (own - truth).abs());
        let stamped = sine(&stamps).into_iter().zip(sine(&grid));
        let stamped: f64 = stamped.map(|(own, truth)| (own - truth).abs()).sum();
        assert!(moved.sum::<f64>() < 0.2 * stamped);
    }

    #[test]
    fn a_missing_sample_is_not_bridged() {
        let grid = ResampleGrid::over(&[0.0, 0.9, 2.1, 3.0], 1.0).unwrap();
        let values = grid.resample(&[0.0, f64::NAN, 2.0, 3.0], LINE);
        assert_eq!((values[0], values[3]), (0.0, 3.0));
        assert!(values[1].is_nan() && values[2].is_nan());
    }

    #[test]
    fn a_held_signal_keeps_its_steps_whatever_is_missing_or_jitters() {
        let rule = ResampleRule::of(Some(Interpolation::Hold), Interpolation::Linear);
        // Samples at 0, 1, 2, 5 and 6 s, some a little early or late; the step is at 2 s.
        let instants = [0.0, 1.01, 1.98, 5.02, 6.0];
        let values = ResampleGrid::over(&instants, 1.0)
            .unwrap()
            .resample(&[0.0, 0.0, 7.0, 7.0, 3.0], rule);
        assert_eq!(values, [0.0, 0.0, 7.0, 7.0, 7.0, 7.0, 3.0]);
    }

    #[test]
    fn a_line_that_is_said_to_be_one_crosses_any_gap() {
        let declared = ResampleRule::of(Some(Interpolation::Linear), Interpolation::Hold);
        let instants = [0.0, 1.0, 2.0, 3.0, 7.0];
        let values = ResampleGrid::over(&instants, 1.0)
            .unwrap()
            .resample(&instants, declared);
        assert_eq!(values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    }

    #[test]
    fn a_grid_of_hardly_any_samples_is_refused_before_it_is_made() {
        let grid = ResampleGrid::over(&[0.0, 1e-9, 2e-9, 1e9], 1e-9);
        assert!(matches!(
            grid,
            Err(ExperimentError::TooSparse { samples: 4, .. })
        ));
    }

    proptest! {
        #[test]
        fn a_straight_line_stays_one(
            intervals in prop::collection::vec(0.5..1.5, 3..100), slope in -5.0..5.0_f64,
        ) {
            let mut instants = vec![0.0];
            for interval in intervals {
                instants.push(instants[instants.len() - 1] + interval);
            }
            let line: Vec<f64> = instants.iter().map(|t| slope * t).collect();
            let grid = ResampleGrid::over(&instants, 1.0).unwrap();
            let values = grid.resample(&line, LINE);
            prop_assert_eq!(values.len(), grid.samples());
            let last = instants[instants.len() - 1];
            prop_assert!((values.len() - 1) as f64 <= last + 1e-6 && values.len() as f64 > last);
            for (k, value) in values.iter().enumerate() {
                // An instant that is as good as on the grid is taken for it.
                let snapped = slope.abs() * ON_GRID;
                prop_assert!(f64::abs(value - slope * k as f64) < snapped + 1e-9 * (1.0 + last));
            }
        }
    }
}
