//! Whether an estimate has changed from window to window by more than its standard errors allow.
//!
//! A window gives an estimate `z` with the variance `R`. While nothing changes, its score
//!
//! ```text
//! e = (z − m) / √(R + V)        m, V: weighted mean of all windows before, and its variance
//! ```
//!
//! is normal with mean 0 and variance 1, and independent of all scores before (recursive residuals;
//! Brown, Durbin and Evans, J. R. Stat. Soc. B 37, 1975; as self-starting charts: Hawkins, The
//! Statistician 36, 1987). Two detectors look at the scores:
//!
//! - CUSUM with the allowance ½ (Page, Biometrika 41, 1954), which is quickest for changes of about
//!   one standard error that last. Its threshold follows Siegmund's approximation of the run length
//!   (Sequential Analysis, 1985, section 2.6).
//! - GLR: the most likely of all changes to an unknown size at an unknown window,
//!   `max |Σ e| / √n` over the last `n` scores, which also dates the change. Its threshold follows
//!   Siegmund and Venkatraman (Ann. Stat. 23, 1995, equation 3.2).
//!
//! Where estimates scatter more than their standard errors say, scores are divided by what the scores before
//! scattered. What a few scores scatter is itself uncertain: a score has Student's distribution with as many
//! degrees of freedom as there were scores, and is taken to the normal score of the same probability (Wallace,
//! Ann. Math. Stat. 30, 1959, as charts that start themselves do). Early windows so need a larger change.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The allowance of the CUSUM, in standard deviations of a score.
const ALLOWANCE: f64 = 0.5;
/// What a discrete sum goes beyond its threshold on average (Siegmund 1985, twice 0.583).
const OVERSHOOT: f64 = 1.166;
/// Windows that are remembered: a change that began before is dated to the oldest.
const REMEMBERED: usize = 200;
/// The scatter that standard errors promise counts as much as so many scores.
const PROMISED: f64 = 2.0;
/// The square of a score counts no more for the scatter than so many times what is usual: one change
/// is not scatter.
const LARGEST_SQUARE: f64 = 9.0;

/// Which detector raised an alarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DetectorName {
    /// The cumulative sum of the scores.
    Cusum,
    /// The generalised likelihood ratio.
    Glr,
}

/// An estimate of a window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectorPoint {
    /// The window's number.
    pub window: i64,
    /// The estimate.
    pub value: f64,
    /// The variance of the estimate.
    pub variance: f64,
}

/// The thresholds of both detectors for a false-alarm rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    cusum: f64,
    glr: f64,
}

impl Thresholds {
    /// Both detectors together raise an alarm in one of `1 / rate` windows in which nothing
    /// changes, or in fewer.
    #[must_use]
    pub fn of_rate(rate: f64) -> Self {
        let run_length = 2.0 / rate;
        Self {
            cusum: solve(cusum_run_length, run_length),
            glr: solve(glr_run_length, run_length),
        }
    }
}

/// Windows to a false alarm of a two-sided CUSUM.
fn cusum_run_length(threshold: f64) -> f64 {
    let b = 2.0 * ALLOWANCE * (threshold + OVERSHOOT);
    let one_sided = (libm::exp(b) - b - 1.0) / (2.0 * ALLOWANCE * ALLOWANCE);
    0.5 * one_sided
}

/// Windows to a false alarm of a two-sided GLR: `√(2π) exp(b²/2) / (b ∫₀ᵇ x ν²(x) dx)` with
/// `ν(x) ≈ exp(−0.583 x)`.
fn glr_run_length(b: f64) -> f64 {
    // ∫₀ᵇ x exp(−a x) dx = (1 − (1 + a b) exp(−a b)) / a²
    let a = OVERSHOOT;
    let integral = (1.0 - (1.0 + a * b) * libm::exp(-a * b)) / (a * a);
    (2.0 * std::f64::consts::PI).sqrt() * libm::exp(0.5 * b * b) / (b * integral)
}

/// The threshold at which a run length, which grows with it, is reached.
fn solve(run_length: impl Fn(f64) -> f64, wanted: f64) -> f64 {
    let (mut low, mut high) = (1.0, 40.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if run_length(middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// The normal score with about the probability of a value of Student's distribution (Wallace 1959): below by 0.12 at
/// one degree of freedom and 1.96, by 0.03 at two.
fn as_normal(student: f64, degrees: f64) -> f64 {
    let share = (8.0 * degrees + 1.0) / (8.0 * degrees + 3.0);
    let size = share * (degrees * libm::log1p(student * student / degrees)).sqrt();
    size.copysign(student)
}

/// A weighted mean of estimates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mean {
    /// The mean.
    pub value: f64,
    /// The sum of the weights: one over its variance.
    weight: f64,
}

impl Mean {
    fn with(self, point: &DetectorPoint) -> Self {
        let weight = self.weight + 1.0 / point.variance;
        Self {
            value: self.value + (point.value - self.value) / (weight * point.variance),
            weight,
        }
    }

    fn of(points: &[DetectorPoint]) -> Self {
        points.iter().fold(Self::default(), Self::with)
    }

    /// The standard deviation of the mean.
    #[must_use]
    pub fn deviation(&self) -> f64 {
        (1.0 / self.weight).sqrt()
    }
}

/// A change that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// The detector that found the change.
    pub detector: DetectorName,
    /// The value that the statistic of the detector reached.
    pub statistic: f64,
    /// The threshold that the statistic exceeded.
    pub threshold: f64,
    /// The window from which on the estimates most likely are others.
    pub since: i64,
    /// The mean of the estimates before the change.
    pub before: Mean,
    /// The mean of the estimates since the change.
    pub after: Mean,
}

/// What the detectors know of one parameter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detector {
    /// The estimates since the last change that are not among the `points`.
    base: Mean,
    /// All estimates since the last change.
    mean: Mean,
    /// The last estimates, the oldest first.
    points: Vec<DetectorPoint>,
    /// The scores of the `points`.
    scores: Vec<f64>,
    /// The mean square of the scores, and of how many.
    scatter: f64,
    scored: u32,
    /// The CUSUM of rises and of falls.
    rise: f64,
    fall: f64,
}

impl Detector {
    /// Takes the estimate of the next window; says what has changed.
    pub fn take(&mut self, point: DetectorPoint, thresholds: &Thresholds) -> Option<Change> {
        if self.mean.weight == 0.0 {
            self.mean = self.mean.with(&point);
            self.base = self.mean;
            return None;
        }
        let variance = point.variance + 1.0 / self.mean.weight;
        self.score((point.value - self.mean.value) / variance.sqrt());
        self.points.push(point);
        if self.points.len() > REMEMBERED {
            self.base = self.base.with(&self.points.remove(0));
            self.scores.remove(0);
        }
        let change = self.change(thresholds);
        match &change {
            Some(change) => self.begin_at(change.since),
            None => self.mean = self.mean.with(&point),
        }
        change
    }

    fn score(&mut self, score: f64) {
        if self.scored == 0 {
            self.scatter = 1.0;
        }
        let scatter = self.scatter.max(1.0);
        // What standard errors promise counts as the first.
        let scores_before = f64::from(self.scored) + 1.0;
        self.scored = self.scored.saturating_add(1);
        let counted = f64::from(self.scored.min(REMEMBERED as u32));
        let square = score.powi(2).min(LARGEST_SQUARE * scatter);
        self.scatter += (square - self.scatter) / (counted + PROMISED);
        let score = as_normal(score / scatter.sqrt(), scores_before);
        self.rise = (self.rise + score - ALLOWANCE).max(0.0);
        self.fall = (self.fall - score - ALLOWANCE).max(0.0);
        self.scores.push(score);
    }

    fn change(&self, thresholds: &Thresholds) -> Option<Change> {
        let (glr, length) = self.likeliest()?;
        let cusum = self.rise.max(self.fall);
        let (detector, statistic, threshold) = if glr > thresholds.glr {
            (DetectorName::Glr, glr, thresholds.glr)
        } else if cusum > thresholds.cusum {
            (DetectorName::Cusum, cusum, thresholds.cusum)
        } else {
            return None;
        };
        let (old, new) = self.points.split_at(self.points.len() - length);
        Some(Change {
            detector,
            statistic,
            threshold,
            since: new.first()?.window,
            before: old.iter().fold(self.base, Mean::with),
            after: Mean::of(new),
        })
    }

    /// The largest `|Σ e| / √n` over the last scores, and the `n` where it is.
    fn likeliest(&self) -> Option<(f64, usize)> {
        let mut sum = 0.0;
        let statistics = self.scores.iter().rev().enumerate().map(|(k, score)| {
            sum += score;
            let length = k + 1;
            (f64::abs(sum) / (length as f64).sqrt(), length)
        });
        statistics.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Begins again with the estimates since a change.
    fn begin_at(&mut self, window: i64) {
        self.points.retain(|point| point.window >= window);
        self.mean = Mean::of(&self.points);
        self.base = self.mean;
        self.points.clear();
        self.scores.clear();
        (self.rise, self.fall) = (0.0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox::numerics::rng;

    /// Estimates with these true values and standard errors of one.
    fn estimates(seed: u64, truth: impl Fn(i64) -> f64) -> impl Iterator<Item = DetectorPoint> {
        let mut random = rng::stream(seed, 0, rng::Purpose::Noise);
        (0..).map(move |window| DetectorPoint {
            window,
            value: truth(window) + rng::normal(&mut random),
            variance: 1.0,
        })
    }

    fn changes(points: impl Iterator<Item = DetectorPoint>, rate: f64) -> Vec<(i64, Change)> {
        let thresholds = Thresholds::of_rate(rate);
        let mut detector = Detector::default();
        let found = points.map(|point| (point.window, detector.take(point, &thresholds)));
        found
            .filter_map(|(window, change)| Some((window, change?)))
            .collect()
    }

    #[test]
    fn a_plant_that_does_not_change_raises_no_more_false_alarms_than_stated() {
        // Three standard deviations of a Poisson count above what is stated.
        for (rate, windows) in [(0.01, 1000), (0.001, 1000)] {
            let runs = 200;
            let alarms: usize = (0..runs)
                .map(|seed| changes(estimates(seed, |_| 5.0).take(windows), rate).len())
                .sum();
            let stated = rate * (windows as f64) * (runs as f64);
            assert!(
                (alarms as f64) < stated + 3.0 * stated.sqrt(),
                "{alarms} alarms, {stated} stated"
            );
            assert!((alarms as f64) > 0.3 * stated, "{alarms} of {stated}");
        }
    }

    #[test]
    fn estimates_that_scatter_more_than_they_say_raise_hardly_more_from_the_first_window_on() {
        for scatter in [1.5, 2.0, 3.0] {
            let scattered = |seed| {
                estimates(seed, |_| 0.0).map(move |point| DetectorPoint {
                    value: scatter * point.value,
                    ..point
                })
            };
            let all = (0..1000).flat_map(|seed| changes(scattered(seed).take(500), 0.001));
            let windows: Vec<i64> = all.map(|(window, _)| window).collect();
            // Stated are 500; a scatter that is estimated adds a fifth to a third.
            assert!(
                windows.len() <= 750,
                "{} alarms at {scatter}",
                windows.len()
            );
            let early = windows.iter().filter(|window| **window < 20).count();
            assert!(
                early < 60,
                "{early} alarms in the first 20 windows at {scatter}"
            );
        }
    }

    #[test]
    fn values_of_students_distribution_become_the_normal_scores_of_their_probability() {
        // Quantiles of 0.975, 0.999 and 0.9 from published tables.
        for (student, degrees, normal) in [
            (4.303, 2.0, 1.960),
            (2.571, 5.0, 1.960),
            (5.893, 5.0, 3.090),
            (1.325, 20.0, 1.282),
            (-2.086, 20.0, -1.960),
        ] {
            let transformed = as_normal(student, degrees);
            assert!(
                (transformed - normal).abs() < 0.1,
                "{transformed} for {normal}"
            );
        }
    }

    #[test]
    fn a_step_of_five_standard_errors_is_found_at_once_and_dated() {
        for seed in 0..50 {
            let step = |window| if window < 40 { 0.0 } else { 5.0 };
            let found = changes(estimates(seed, step).take(46), 1e-4);
            let (at, change) = found.last().expect("it is found");
            assert!((40..=43).contains(at), "found at {at}");
            assert!((change.since - 40).abs() <= 2, "dated {}", change.since);
            assert!(change.before.value.abs() < 1.0);
            assert!((change.after.value - 5.0).abs() < 5.0 * change.after.deviation());
        }
    }

    #[test]
    fn a_slow_fall_is_found_before_it_is_four_standard_errors() {
        let fall = |window: i64| {
            if window < 20 {
                0.0
            } else {
                -0.2 * (window - 20) as f64
            }
        };
        let mut delays: Vec<i64> = (0..100)
            .map(|seed| changes(estimates(seed, fall).take(80), 1e-3)[0].0 - 20)
            .collect();
        delays.sort_unstable();
        assert!(
            delays[50] <= 16,
            "the middle delay is {} windows",
            delays[50]
        );
        assert!(delays[95] <= 24, "the longest are {} windows", delays[95]);
    }

    #[test]
    fn after_a_change_the_new_level_is_the_usual_one() {
        let step = |window| if window < 30 { 0.0 } else { 8.0 };
        let found = changes(estimates(3, step).take(300), 1e-4);
        assert_eq!(found.len(), 1, "{found:?}");
    }
}
