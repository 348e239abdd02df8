//! A batch of samples for a recording that grows: rows at the instants at which they were taken,
//! and what reading them found.

use super::{DoubleHour, QualityReport, Recording, RowSignal, Rows, TimeAxis};

/// Samples on their way into a stream.
#[derive(Clone, Debug)]
pub struct Batch {
    /// What the rows hold.
    pub signals: Vec<RowSignal>,
    /// The samples, SI.
    pub rows: Rows,
    /// The time zone that the source counted in, where it is known: an IANA name or an offset.
    pub zone: Option<String>,
    /// What is odd about the samples, and what reading them assumed.
    pub report: QualityReport,
    /// The local hour that came twice, where nothing in the batch tells its passes apart.
    pub double_hour: Option<DoubleHour>,
}

/// A stretch of instants that come after the server's clock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FutureSamples {
    /// The signal.
    pub signal: String,
    /// How many of its samples there are.
    pub samples: usize,
    /// The first of their instants, nanoseconds since 1970.
    pub first_ns: i64,
}

impl Batch {
    /// The batch of a recording; nothing where it does not say when it began, or where its instants
    /// lie outside what nanoseconds since 1970 can say.
    #[must_use]
    pub fn of(mut recording: Recording) -> Option<Self> {
        let report = report(&mut recording);
        let (zone, double_hour) = (recording.zone.clone(), recording.double_hour);
        let (signals, rows) = Rows::of(recording)?;
        Some(Self {
            signals,
            rows,
            zone,
            report,
            double_hour,
        })
    }

    /// The signals that have samples after an instant, nanoseconds since 1970.
    #[must_use]
    pub fn after(&self, instant: i64) -> Vec<FutureSamples> {
        let begin = self
            .rows
            .instants
            .partition_point(|taken| *taken <= instant);
        let named = self.signals.iter().zip(&self.rows.columns);
        let ahead = named.filter_map(|(signal, column)| {
            let says = |row: &usize| !column.sample(*row).is_unsaid();
            let mut rows = (begin..self.rows.rows()).filter(says);
            let first = rows.next()?;
            Some(FutureSamples {
                signal: signal.name.clone(),
                samples: 1 + rows.count(),
                first_ns: self.rows.instants[first],
            })
        });
        ahead.collect()
    }
}

/// The quality report of samples whose instants are of a uniform grid but for rounding and jitter,
/// or of none.
fn report(recording: &mut Recording) -> QualityReport {
    let TimeAxis::Instants(instants) = &recording.time else {
        return recording.summary().report;
    };
    let nearest = TimeAxis::from_instants(instants.clone(), 0.0);
    let exact = std::mem::replace(&mut recording.time, nearest);
    let report = recording.summary().report;
    recording.time = exact;
    report
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Class, ClassSpan, Signal};

    fn recording(instants: Vec<f64>, signals: Vec<Signal>) -> Recording {
        Recording {
            start: "2026-03-02T08:15:00Z".parse().ok(),
            own_instants: true,
            ..Recording::new(TimeAxis::Instants(instants), signals)
        }
    }

    #[test]
    fn samples_of_a_year_keep_their_instants_to_a_tick() {
        // Stamps to 100 ns over a year, in seconds from the first, as a reader has them.
        let ticks = |k: i64| k * 12_345_678_901_237;
        let seconds = |k: i64| (ticks(k) * 100) as f64 / 1e9;
        let instants: Vec<f64> = (0..25).map(seconds).collect();
        let values = vec![1.0; instants.len()];
        let batch = Batch::of(recording(instants, vec![Signal::new("a", "m", values)]));
        let rows = batch.expect("it has a start").rows;
        let first = rows.instants[0];
        for (k, instant) in (0..).zip(&rows.instants) {
            assert_eq!(instant - first, ticks(k) * 100);
        }
    }

    #[test]
    fn what_lies_ahead_is_told_for_each_signal() {
        let gap = f64::NAN;
        let a = Signal::new("a", "m", vec![1.0, 2.0, gap, 3.0]);
        let mut b = Signal::new("b", "m", vec![1.0, gap, gap, gap]);
        b.classes = ClassSpan::of([Class::Good, Class::Good, Class::Bad, Class::Good].into_iter());
        let batch = Batch::of(recording(vec![0.0, 1.0, 2.0, 3.0], vec![a, b])).expect("a start");
        let first = batch.rows.instants[0];
        let ahead = |signal: &str, samples, after: i64| FutureSamples {
            signal: signal.to_owned(),
            samples,
            first_ns: first + after * 1_000_000_000,
        };
        assert_eq!(batch.after(first), [ahead("a", 2, 1), ahead("b", 1, 2)]);
        assert!(batch.after(first + 3_000_000_000).is_empty());
    }

    #[test]
    fn each_signal_is_looked_over_at_its_own_instants() {
        let gap = f64::NAN;
        let fast: Vec<f64> = (0..40)
            .map(|k| if k == 21 { gap } else { f64::from(k) })
            .collect();
        let mut slow = vec![gap; 40];
        for k in [0, 10, 20, 30] {
            slow[k] = 0.1 * k as f64;
        }
        slow[21] = 5.0;
        let instants = (0..40).map(f64::from).collect();
        let signals = vec![
            Signal::new("fast", "m", fast),
            Signal::new("slow", "", slow),
        ];
        let report = Batch::of(recording(instants, signals))
            .expect("a start")
            .report;
        let told: Vec<(&str, Option<&str>)> = report
            .warnings
            .iter()
            .map(|warning| (warning.code.as_str(), warning.signal.as_deref()))
            .collect();
        let expected = [
            ("non_uniform_time", Some("slow")),
            ("no_unit", Some("slow")),
        ];
        assert!(
            !told.contains(&("missing_samples", Some("slow"))),
            "{told:?}"
        );
        assert_eq!(
            told.iter().filter(|told| told.1 == Some("slow")).count(),
            2,
            "{told:?}"
        );
        assert_eq!(told[told.len() - 2..], expected);
    }
}
