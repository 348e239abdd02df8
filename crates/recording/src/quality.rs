//! What is odd about a recording: the first things that go wrong with plant data.
//!
//! The report warns; it changes nothing. Thresholds are ours, chosen so that excitation signals
//! (which hold their levels on purpose) stay quiet; each stands with its constant.

use super::profile::{ConstantRun, Extreme, LONG_RUN, SignalProfile};
use super::resample::LONGEST_BRIDGE;
use super::warning::{MOST_SPANS, TimeSpan, Warning};
use super::{Class, ClassCounts, MIN_SAMPLES, NamedSignal, TimeAxis};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A signal is saturated when at least this part of its samples is at its exact extreme…
const SATURATED_FRACTION: f64 = 0.01;
/// …at least so many are…
const SATURATED_SAMPLES: usize = 10;
/// …and so many times as many as at the value next to it: a rounded signal has its samples at
/// every level, a clipped one has them at the last.
const SATURATED_RATIO: usize = 8;
/// A signal is frozen where it holds one value for at least [`LONG_RUN`] samples and for so many
/// times as long as it holds a value elsewhere on average.
const FROZEN_RATIO: f64 = 20.0;
/// A signal is padded when at least this share of its values stand for equally many samples…
const PADDED_SHARE: f64 = 0.8;
/// …and there are at least so many values.
const PADDED_RUNS: usize = 20;

/// The quality report of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct QualityReport {
    /// What is odd, in the order: the recording as a whole, then signal by signal.
    pub warnings: Vec<Warning>,
}

/// Looks over a recording whose signals have been gone through.
pub(super) fn report(
    time: &TimeAxis,
    notes: &[Warning],
    signals: &[(&NamedSignal, SignalProfile)],
) -> QualityReport {
    let mut warnings = notes.to_vec();
    if let TimeAxis::Instants(instants) = time {
        let sample_time = time.sample_time();
        if instants.len() >= MIN_SAMPLES {
            warnings.push(non_uniform(instants, sample_time));
        }
        warnings.extend(gaps(instants, sample_time));
    }
    for (signal, profile) in signals {
        warnings.extend(Look {
            signal,
            profile,
            time,
        });
    }
    QualityReport { warnings }
}

fn non_uniform(instants: &[f64], sample_time: f64) -> Warning {
    let intervals = || instants.windows(2).map(|pair| pair[1] - pair[0]);
    let shortest = intervals().fold(f64::INFINITY, f64::min);
    let longest = intervals().fold(0.0, f64::max);
    let detail = format!(
        "intervals between {} s and {} s; where they are of a grid but for jitter and single gaps, \
         an experiment takes that, {} s",
        shown(shortest),
        shown(longest),
        shown(sample_time)
    );
    Warning::of_recording("non_uniform_time", detail)
}

fn gaps(instants: &[f64], sample_time: f64) -> Option<Warning> {
    let mut spans = Vec::new();
    let mut count = 0;
    let (mut longest, mut place) = (LONGEST_BRIDGE * sample_time, 0.0);
    for pair in instants.windows(2) {
        let interval = pair[1] - pair[0];
        if interval <= LONGEST_BRIDGE * sample_time {
            continue;
        }
        count += 1;
        if spans.len() < MOST_SPANS {
            let (from_s, to_s) = (pair[0], pair[1]);
            spans.push(TimeSpan { from_s, to_s });
        }
        if interval > longest {
            (longest, place) = (interval, pair[0]);
        }
    }
    let detail = || {
        let (longest, place) = (shown(longest), shown(place));
        let gaps = if count == 1 { "gap" } else { "gaps" };
        format!(
            "{count} {gaps} longer than {LONGEST_BRIDGE} sample times; the longest, {longest} s, \
             begins at {place} s"
        )
    };
    (count > 0).then(|| Warning {
        spans,
        ..Warning::of_recording("gap", detail())
    })
}

/// A signal that is looked over.
#[derive(Clone, Copy)]
struct Look<'a> {
    signal: &'a NamedSignal,
    profile: &'a SignalProfile,
    time: &'a TimeAxis,
}

impl IntoIterator for Look<'_> {
    type Item = Warning;
    type IntoIter = std::vec::IntoIter<Warning>;

    /// A warning for each oddity.
    fn into_iter(self) -> Self::IntoIter {
        let Self {
            signal, profile, ..
        } = self;
        let Some(values) = &profile.values else {
            let none = self.warning("no_values", "every sample is missing".to_owned());
            return vec![none].into_iter();
        };
        let (samples, missing) = (profile.samples, profile.missing);
        let mut warnings = self.classes();
        if missing > 0 {
            let detail = format!("{missing} of {samples} samples are missing");
            warnings.push(self.warning("missing_samples", detail));
        }
        if signal.unit.is_empty() {
            let detail = "no unit given; the values are taken as SI".to_owned();
            warnings.push(self.warning("no_unit", detail));
        }
        if samples - missing < MIN_SAMPLES {
            return warnings.into_iter();
        }
        if values.is_constant() {
            let detail = format!("every sample is {}", shown(values.min.value));
            warnings.push(self.warning("constant_signal", detail));
            return warnings.into_iter();
        }
        if !values.is_stepped {
            warnings.extend(self.saturated(values.min, "minimum"));
            warnings.extend(self.saturated(values.max, "maximum"));
            warnings.extend(self.padded());
        }
        warnings.extend(self.frozen());
        warnings.extend(self.spikes());
        warnings.into_iter()
    }
}

impl Look<'_> {
    fn warning(&self, code: &str, detail: String) -> Warning {
        Warning::of_signal(code, &self.signal.name, detail)
    }

    /// What the source said of its samples.
    fn classes(&self) -> Vec<Warning> {
        let spans = &self.signal.classes;
        let counts = ClassCounts::of(self.profile.samples, spans);
        let notable = [
            (
                Class::Bad,
                "bad_samples",
                counts.bad,
                "bad: they are missing",
            ),
            (
                Class::Uncertain,
                "uncertain_samples",
                counts.uncertain,
                "uncertain: they are used unless a job excludes them",
            ),
            (
                Class::Substituted,
                "substituted_samples",
                counts.substituted,
                "substituted, not measured: they are used unless a job excludes them",
            ),
        ];
        let present = notable.into_iter().filter(|(_, _, count, _)| *count > 0);
        present
            .map(|(class, code, count, what)| {
                let detail = format!("{count} samples are {what}");
                let of_class = spans.iter().filter(|span| span.class == class);
                let places = of_class.map(|span| (span.first, span.samples));
                self.warning(code, detail).at(self.time, places)
            })
            .collect()
    }

    fn saturated(&self, extreme: Extreme, which: &str) -> Option<Warning> {
        let present = self.profile.samples - self.profile.missing;
        let count = extreme.samples;
        let fraction = count as f64 / present as f64;
        let is_saturated = count >= SATURATED_SAMPLES
            && fraction >= SATURATED_FRACTION
            && count >= SATURATED_RATIO * extreme.next_samples;
        is_saturated.then(|| {
            let percent = 100.0 * fraction;
            let extreme = shown(extreme.value);
            let detail =
                format!("{count} samples ({percent:.1} %) are at the {which} {extreme} exactly");
            self.warning("saturated_signal", detail)
        })
    }

    /// Values that stand for equally many samples each: recorded at a slower rate.
    fn padded(&self) -> Option<Warning> {
        let SignalProfile { missing, runs, .. } = self.profile;
        let (length, count) = self.profile.commonest_length;
        let values = runs - missing;
        let is_padded =
            length > 1 && values >= PADDED_RUNS && count as f64 >= PADDED_SHARE * values as f64;
        is_padded.then(|| {
            let percent = 100.0 * count as f64 / values as f64;
            let detail = format!(
                "changes only every {length} samples ({percent:.0} % of its values): it was \
                 measured at {} s and repeated",
                shown(length as f64 * self.time.sample_time())
            );
            self.warning("step_padded", detail)
        })
    }

    fn frozen(&self) -> Option<Warning> {
        let runs: Vec<&ConstantRun> = frozen_runs(self.profile).collect();
        let longest = runs.iter().max_by_key(|run| run.samples)?;
        let more = match runs.len() {
            1 => String::new(),
            n => format!("; {} more stretches like it", n - 1),
        };
        let detail = format!(
            "holds {} for {} samples from {} s on, and changes every {:.1} samples elsewhere\
             {more}",
            shown(longest.value),
            longest.samples,
            shown(self.time.instant(longest.start)),
            elsewhere(self.profile),
        );
        let places = runs.iter().map(|run| (run.start, run.samples));
        Some(self.warning("frozen_signal", detail).at(self.time, places))
    }

    fn spikes(&self) -> Option<Warning> {
        let spikes = &self.profile.spikes;
        let first = *spikes.first()?;
        let detail = format!(
            "{} single samples are far from both their neighbours, the first at {} s",
            spikes.len(),
            shown(self.time.instant(first))
        );
        let places = spikes.iter().map(|k| (*k, 1));
        Some(self.warning("spikes", detail).at(self.time, places))
    }
}

/// For how many samples a signal holds a value on average, but for the longest stretch.
fn elsewhere(profile: &SignalProfile) -> f64 {
    let other_runs = profile.runs.saturating_sub(1).max(1);
    (profile.samples - profile.longest.samples) as f64 / other_runs as f64
}

/// Stretches of one value that are far longer than the others.
pub(super) fn frozen_runs(profile: &SignalProfile) -> impl Iterator<Item = &ConstantRun> {
    let constant = profile.values.as_ref().is_some_and(|v| v.is_constant());
    let long = FROZEN_RATIO * elsewhere(profile);
    let runs = profile.long_runs.iter();
    runs.filter(move |run| !constant && run.samples >= LONG_RUN && run.samples as f64 >= long)
}

/// A number to at most six significant digits.
pub fn shown(value: f64) -> String {
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
    use crate::{Recording, Signal};

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
    fn a_rounded_signal_is_not_saturated_and_a_rounded_clipped_one_is() {
        // A slow sine rounded to 200 levels stays at its extremes for many samples.
        let slow = (0..20_000).map(|k| (1e-3 * f64::from(k)).sin());
        let rounded = |value: f64| (100.0 * value).round() / 100.0;
        assert!(codes(slow.clone().map(rounded).collect()).is_empty());
        let clipped = slow.map(|value| rounded(value).clamp(-2.0, 0.5));
        let codes = codes(clipped.collect());
        assert!(codes.contains(&"saturated_signal".to_owned()), "{codes:?}");
    }

    #[test]
    fn a_single_sample_far_from_its_neighbours_is_a_spike_with_its_place() {
        let mut values: Vec<f64> = sine(2000).collect();
        values[700] += 50.0;
        let time = TimeAxis::Uniform {
            sample_time: 0.01,
            samples: values.len(),
        };
        let recording = Recording::new(time, vec![Signal::new("a", "m", values)]);
        let warnings = recording.summary().report.warnings;
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert_eq!(warnings[0].code, "spikes");
        let place = TimeSpan {
            from_s: 7.0,
            to_s: 7.0,
        };
        assert_eq!(warnings[0].spans, [place]);
    }

    #[test]
    fn a_signal_that_was_measured_more_slowly_is_padded() {
        let values = (0..2000_u32).map(|k| (0.1 * f64::from(k / 10)).sin());
        assert_eq!(codes(values.collect()), ["step_padded"]);
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
        let expected = "1 gap longer than 2 sample times; the longest, 4.5 s, begins at 3 s";
        assert_eq!(warnings[1].detail, expected);
    }

    #[test]
    fn what_reading_noted_comes_first() {
        let time = TimeAxis::Uniform {
            sample_time: 1.0,
            samples: 2,
        };
        let mut recording = Recording::new(time, vec![Signal::new("a", "m", vec![1.0, 2.0])]);
        recording
            .notes
            .push(Warning::of_recording("duplicate_time", String::new()));
        assert_eq!(
            recording.summary().report.warnings[0].code,
            "duplicate_time"
        );
    }
}
