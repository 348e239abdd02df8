//! What is odd about a recording: the first things that go wrong with plant data.
//!
//! The report warns; it changes nothing. Thresholds are ours, chosen so that excitation signals
//! (which hold their levels on purpose) stay quiet; each stands with its constant.

use super::TimeAxis;
use super::profile::{Extreme, Profile};
use super::received::Named;
use super::resample::LONGEST_BRIDGE;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A signal is saturated when at least this part of its samples is at its exact extreme…
const SATURATED_FRACTION: f64 = 0.01;
/// …and at least so many are.
const SATURATED_SAMPLES: usize = 10;
/// A signal is frozen where it holds one value for at least so many samples…
const FROZEN_SAMPLES: usize = 50;
/// …and for so many times as long as it holds a value elsewhere on average.
const FROZEN_RATIO: f64 = 20.0;

/// The quality report of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct QualityReport {
    /// What is odd, in the order: the recording as a whole, then signal by signal.
    pub warnings: Vec<Warning>,
}

/// One oddity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Warning {
    /// Its kind, e.g. `gap` or `saturated_signal`.
    pub code: String,
    /// The signal that it is about; `null` for the recording as a whole.
    pub signal: Option<String>,
    /// A sentence with the numbers.
    pub detail: String,
}

impl Warning {
    /// About the recording as a whole.
    #[must_use]
    pub fn of_recording(code: &str, detail: String) -> Self {
        Self {
            code: code.to_owned(),
            signal: None,
            detail,
        }
    }

    /// About one signal.
    #[must_use]
    pub fn of_signal(code: &str, signal: &str, detail: String) -> Self {
        Self {
            code: code.to_owned(),
            signal: Some(signal.to_owned()),
            detail,
        }
    }

    pub(crate) fn duplicate_time(dropped: usize) -> Self {
        let detail = format!("{dropped} samples dropped that had the time of the one before");
        Self::of_recording("duplicate_time", detail)
    }
}

/// Looks over a recording whose signals have been gone through.
pub(super) fn report(
    time: &TimeAxis,
    notes: &[Warning],
    signals: &[(&Named, Profile)],
) -> QualityReport {
    let mut warnings = notes.to_vec();
    if let TimeAxis::Instants(instants) = time {
        let sample_time = time.sample_time();
        warnings.push(non_uniform(instants, sample_time));
        warnings.extend(gaps(instants, sample_time));
    }
    for (signal, profile) in signals {
        let found = of_signal(signal, profile, time);
        warnings.extend(
            found
                .into_iter()
                .map(|(code, detail)| Warning::of_signal(code, &signal.name, detail)),
        );
    }
    QualityReport { warnings }
}

fn non_uniform(instants: &[f64], sample_time: f64) -> Warning {
    let intervals = || instants.windows(2).map(|pair| pair[1] - pair[0]);
    let shortest = intervals().fold(f64::INFINITY, f64::min);
    let longest = intervals().fold(0.0, f64::max);
    let detail = format!(
        "intervals between {} s and {} s; an experiment resamples them to the median, {} s",
        shown(shortest),
        shown(longest),
        shown(sample_time)
    );
    Warning::of_recording("non_uniform_time", detail)
}

fn gaps(instants: &[f64], sample_time: f64) -> Option<Warning> {
    let mut count = 0;
    let (mut longest, mut place) = (LONGEST_BRIDGE * sample_time, 0.0);
    for pair in instants.windows(2) {
        let interval = pair[1] - pair[0];
        count += usize::from(interval > LONGEST_BRIDGE * sample_time);
        if interval > longest {
            (longest, place) = (interval, pair[0]);
        }
    }
    let detail = || {
        let (longest, place) = (shown(longest), shown(place));
        format!(
            "{count} gaps longer than {LONGEST_BRIDGE} sample times; the longest, {longest} s, \
             begins at {place} s"
        )
    };
    (count > 0).then(|| Warning::of_recording("gap", detail()))
}

/// A code and a sentence for each oddity of a signal.
fn of_signal(signal: &Named, profile: &Profile, time: &TimeAxis) -> Vec<(&'static str, String)> {
    let Some(values) = &profile.values else {
        return vec![("no_values", "every sample is missing".to_owned())];
    };
    let Profile {
        samples, missing, ..
    } = profile;
    let mut found = Vec::new();
    if *missing > 0 {
        found.push((
            "missing_samples",
            format!("{missing} of {samples} samples are missing"),
        ));
    }
    if signal.unit.is_empty() {
        let detail = "no unit given; the values are taken as SI".to_owned();
        found.push(("no_unit", detail));
    }
    if values.is_constant() {
        let detail = format!("every sample is {}", shown(values.min.value));
        found.push(("constant_signal", detail));
        return found;
    }
    if !values.is_stepped {
        let present = samples - missing;
        found.extend(saturated(values.min, present, "minimum"));
        found.extend(saturated(values.max, present, "maximum"));
    }
    found.extend(frozen(profile, time));
    found
}

fn saturated(extreme: Extreme, present: usize, which: &str) -> Option<(&'static str, String)> {
    let count = extreme.samples;
    let fraction = count as f64 / present as f64;
    (count >= SATURATED_SAMPLES && fraction >= SATURATED_FRACTION).then(|| {
        let percent = 100.0 * fraction;
        let extreme = shown(extreme.value);
        let detail =
            format!("{count} samples ({percent:.1} %) are at the {which} {extreme} exactly");
        ("saturated_signal", detail)
    })
}

/// The longest stretch of one value, where it is far longer than the others.
fn frozen(profile: &Profile, time: &TimeAxis) -> Option<(&'static str, String)> {
    let Profile {
        samples,
        runs,
        longest,
        ..
    } = profile;
    let elsewhere = (samples - longest.samples) as f64 / runs.saturating_sub(1).max(1) as f64;
    let frozen =
        longest.samples >= FROZEN_SAMPLES && longest.samples as f64 >= FROZEN_RATIO * elsewhere;
    frozen.then(|| {
        let detail = format!(
            "holds {} for {} samples from {} s on, and changes every {elsewhere:.1} samples \
             elsewhere",
            shown(longest.value),
            longest.samples,
            shown(time.instant(longest.start)),
        );
        ("frozen_signal", detail)
    })
}

/// A number to at most six significant digits.
fn shown(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    let plain = rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs());
    if plain {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Recording, Signal};

    fn codes(values: Vec<f64>) -> Vec<String> {
        let time = TimeAxis::Uniform {
            sample_time: 0.01,
            samples: values.len(),
        };
        let recording = Recording::new(time, vec![Signal::new("a", "m", values)]);
        recording
            .summary()
            .report
            .warnings
            .into_iter()
            .map(|warning| warning.code)
            .collect()
    }

    fn sine(samples: u32) -> impl Iterator<Item = f64> {
        (0..samples).map(|k| (0.1 * f64::from(k)).sin())
    }

    #[test]
    fn a_good_signal_gets_no_warning() {
        assert!(codes(sine(2000).collect()).is_empty());
    }

    #[test]
    fn a_binary_excitation_is_neither_saturated_nor_frozen() {
        // Levels held for 50, 100, … 400 samples, as a pseudo-random sequence does.
        let levels = (0..40_u32).flat_map(|k| {
            let level = f64::from(k % 2);
            std::iter::repeat_n(level, 50 * (1 + (k * 7 % 8)) as usize)
        });
        assert!(codes(levels.collect()).is_empty());
    }

    #[test]
    fn a_clipped_signal_is_saturated_on_both_sides() {
        let clipped = sine(2000).map(|value| value.clamp(-0.9, 0.9)).collect();
        assert_eq!(codes(clipped), ["saturated_signal", "saturated_signal"]);
    }

    #[test]
    fn a_constant_signal_is_only_constant() {
        assert_eq!(codes(vec![4.0; 500]), ["constant_signal"]);
    }

    #[test]
    fn a_sensor_that_stops_is_frozen() {
        let mut values: Vec<f64> = sine(2000).collect();
        values[700..800].fill(0.5);
        assert_eq!(codes(values), ["frozen_signal"]);
    }

    #[test]
    fn missing_samples_are_counted() {
        let mut values: Vec<f64> = sine(100).collect();
        values[3] = f64::NAN;
        assert_eq!(codes(values), ["missing_samples"]);
        assert_eq!(codes(vec![f64::NAN; 5]), ["no_values"]);
    }

    #[test]
    fn a_signal_without_unit_is_pointed_out() {
        let time = TimeAxis::Uniform {
            sample_time: 1.0,
            samples: 2,
        };
        let recording = Recording::new(time, vec![Signal::new("a", "", vec![1.0, 2.0])]);
        assert_eq!(recording.summary().report.warnings[0].code, "no_unit");
    }

    #[test]
    fn irregular_time_and_its_gaps_are_described() {
        let instants = vec![0.0, 1.0, 2.0, 3.0, 7.5, 8.5];
        let values = instants.clone();
        let recording = Recording::new(
            TimeAxis::Instants(instants),
            vec![Signal::new("a", "m", values)],
        );
        let warnings = recording.summary().report.warnings;
        assert_eq!(warnings[0].code, "non_uniform_time");
        assert_eq!(warnings[1].code, "gap");
        let expected = "1 gaps longer than 2 sample times; the longest, 4.5 s, begins at 3 s";
        assert_eq!(warnings[1].detail, expected);
    }

    #[test]
    fn what_reading_noted_comes_first() {
        let time = TimeAxis::Uniform {
            sample_time: 1.0,
            samples: 2,
        };
        let mut recording = Recording::new(time, vec![Signal::new("a", "m", vec![1.0, 2.0])]);
        recording.notes.push(Warning::duplicate_time(3));
        assert_eq!(
            recording.summary().report.warnings[0].code,
            "duplicate_time"
        );
    }
}
