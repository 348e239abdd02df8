//! Fewer samples for a plot, without losing a peak.

use super::{Recording, Signal};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use utoipa::ToSchema;

/// Samples of some signals at common instants.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct Samples {
    /// The instants of the samples `[s]`, from the first sample of the recording.
    pub time_s: Vec<f64>,
    /// The signals by name, in the order of the recording.
    #[serde(serialize_with = "as_map")]
    #[schema(value_type = std::collections::HashMap<String, SampledSignal>)]
    pub signals: Vec<(String, SampledSignal)>,
}

/// One signal of [`Samples`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SampledSignal {
    /// The SI unit.
    pub unit: String,
    /// The values in SI; `null` is a missing sample.
    pub values: Vec<Option<f64>>,
}

fn as_map<S: Serializer>(
    signals: &[(String, SampledSignal)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(signals.len()))?;
    for (name, signal) in signals {
        map.serialize_entry(name, signal)?;
    }
    map.end()
}

impl Recording {
    /// The samples between `from` and `to` `[s]` from the first sample, both included; all signals
    /// where `signals` is `None`, else those of the given names that exist. Where there are more
    /// than `max_points`, the time is cut into buckets and the minimum and the maximum of each
    /// signal in each bucket stay, at the instants at which they were measured.
    #[must_use]
    pub fn decimate(
        &self,
        signals: Option<&[String]>,
        from: Option<f64>,
        to: Option<f64>,
        max_points: usize,
    ) -> Samples {
        let wanted = |signal: &&Signal| signals.is_none_or(|names| names.contains(&signal.name));
        let signals: Vec<&Signal> = self.signals.iter().filter(wanted).collect();
        let columns: Vec<&[f64]> = signals
            .iter()
            .map(|signal| signal.values.as_slice())
            .collect();
        let kept = kept_indices(&columns, self.time.between(from, to), max_points);
        let values = |signal: &Signal| {
            kept.iter()
                .map(|&k| signal.values[k])
                .map(|v| (!v.is_nan()).then_some(v))
                .collect()
        };
        Samples {
            time_s: kept.iter().map(|&k| self.time.instant(k)).collect(),
            signals: signals
                .iter()
                .map(|signal| {
                    let sampled = SampledSignal {
                        unit: signal.unit.clone(),
                        values: values(signal),
                    };
                    (signal.name.clone(), sampled)
                })
                .collect(),
        }
    }
}

/// The indices in `range` to plot: all of them where they are at most `max_points`, else those of
/// the minimum and the maximum of each column in each bucket, at most `max_points` together (but at
/// least one bucket). Columns are as long as `range` reaches; a bucket without any value keeps its
/// first index, so that a gap shows.
#[must_use]
pub fn kept_indices(columns: &[&[f64]], range: Range<usize>, max_points: usize) -> Vec<usize> {
    if range.len() <= max_points || columns.is_empty() {
        return range.take(max_points).collect();
    }
    let buckets = (max_points / (2 * columns.len())).max(1);
    let mut kept = Vec::with_capacity(max_points);
    let mut in_bucket = Vec::with_capacity(2 * columns.len());
    for bucket in 0..buckets {
        let start = range.start + range.len() * bucket / buckets;
        let end = range.start + range.len() * (bucket + 1) / buckets;
        in_bucket.clear();
        for column in columns {
            in_bucket.extend(extremes(column, start..end));
        }
        if in_bucket.is_empty() {
            in_bucket.push(start);
        }
        in_bucket.sort_unstable();
        in_bucket.dedup();
        kept.extend_from_slice(&in_bucket);
    }
    kept
}

/// The indices of the smallest and the largest value that is not missing.
fn extremes(column: &[f64], range: Range<usize>) -> impl Iterator<Item = usize> {
    let mut bounds: Option<(usize, usize)> = None;
    for k in range {
        let value = column[k];
        if value.is_nan() {
            continue;
        }
        let (mut low, mut high) = bounds.unwrap_or((k, k));
        if value < column[low] {
            low = k;
        }
        if value > column[high] {
            high = k;
        }
        bounds = Some((low, high));
    }
    bounds.into_iter().flat_map(|(low, high)| [low, high])
}

#[cfg(test)]
mod tests {
    use super::super::TimeAxis;
    use super::*;
    use proptest::prelude::*;

    fn recording(values: Vec<f64>) -> Recording {
        let time = TimeAxis::Uniform {
            sample_time: 0.1,
            samples: values.len(),
        };
        Recording::new(time, vec![Signal::new("a", "m", values)])
    }

    proptest! {
        #[test]
        fn the_extremes_of_a_recording_survive(
            values in prop::collection::vec(-1.0..1.0, 50..500), max_points in 2_usize..60,
        ) {
            let samples = recording(values.clone()).decimate(None, None, None, max_points);
            prop_assert!(samples.time_s.len() <= max_points);
            prop_assert!(samples.time_s.is_sorted());
            let kept = &samples.signals[0].1.values;
            let extreme = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick);
            prop_assert!(kept.contains(&extreme(f64::min)));
            prop_assert!(kept.contains(&extreme(f64::max)));
        }

        #[test]
        fn a_kept_value_is_the_sample_of_its_instant(
            values in prop::collection::vec(-1.0..1.0, 10..200),
        ) {
            let samples = recording(values.clone()).decimate(None, None, None, 8);
            for (time, value) in samples.time_s.iter().zip(&samples.signals[0].1.values) {
                let k = (time / 0.1).round() as usize;
                prop_assert_eq!(*value, Some(values[k]));
            }
        }
    }

    #[test]
    fn a_short_range_is_kept_whole_with_both_ends() {
        let samples = recording((0..100).map(f64::from).collect());
        let samples = samples.decimate(None, Some(1.0), Some(2.0), 1000);
        assert_eq!(samples.time_s.len(), 11);
        assert_eq!(samples.signals[0].1.values[10], Some(20.0));
    }

    #[test]
    fn missing_samples_are_null_in_json() {
        let samples = recording(vec![1.0, f64::NAN]).decimate(None, None, None, 10);
        let json = serde_json::to_string(&samples).unwrap();
        assert_eq!(
            json,
            r#"{"time_s":[0.0,0.1],"signals":{"a":{"unit":"m","values":[1.0,null]}}}"#
        );
    }

    #[test]
    fn a_stretch_without_any_value_still_shows_as_a_gap() {
        let samples = recording(vec![f64::NAN; 100]).decimate(None, None, None, 10);
        assert_eq!(samples.signals[0].1.values, vec![None; 5]);
    }

    #[test]
    fn only_the_signals_asked_for_are_there() {
        let mut recording = recording(vec![1.0, 2.0]);
        recording.signals.push(Signal::new("b", "", vec![3.0, 4.0]));
        let samples = recording.decimate(Some(&["b".to_owned()]), None, None, 10);
        assert_eq!(samples.signals.len(), 1);
        assert_eq!(samples.signals[0].0, "b");
    }
}
