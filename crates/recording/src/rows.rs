//! Samples by their instant: what recordings that follow on each other are put together from.
//!
//! Instants are nanoseconds since 1970. A later statement about a sample wins over an earlier one;
//! a sample about which nothing is said changes nothing.

use super::{
    Class, ClassSpan, Interpolation, NamedSignal, Recording, RecordingSource, Signal, TimeAxis,
    kept_indices, nanoseconds,
};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

/// What rounding to a nanosecond does to an instant, as the rounding of a number of this size `[s]`.
const ROUNDED_AS: f64 = 1e-9 / f64::EPSILON;

/// A signal of samples by their instant.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct RowSignal {
    /// The name.
    #[schema(example = "position")]
    pub name: String,
    /// The SI unit of the values; empty where the source gave none.
    #[schema(example = "m")]
    pub unit: String,
    /// The unit as it first came; empty where the source gave none.
    #[schema(example = "mm")]
    pub recorded_unit: String,
    /// How the signal goes on between samples; `null` where nothing said so.
    pub interpolation: Option<Interpolation>,
}

/// Samples of several signals, a row for each instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// When, in nanoseconds since 1970; strictly increasing.
    pub instants: Vec<i64>,
    /// The samples of each signal; NaN is a missing one.
    pub columns: Vec<RowColumn>,
}

/// The samples of one signal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowColumn {
    /// The values, SI.
    pub values: Vec<f64>,
    /// How good each is.
    pub classes: Vec<Class>,
}

/// What became of rows that were merged into others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Merged {
    /// Samples at instants that were not there.
    pub added: u64,
    /// Samples that said something else of an instant that was there; they replaced it.
    pub changed: u64,
    /// Samples that were there already.
    pub repeated: u64,
}

impl std::ops::AddAssign for Merged {
    fn add_assign(&mut self, other: Self) {
        self.added += other.added;
        self.changed += other.changed;
        self.repeated += other.repeated;
    }
}

impl RowColumn {
    fn push(&mut self, sample: RowSample) {
        self.values.push(sample.value);
        self.classes.push(sample.class);
    }

    pub(super) fn sample(&self, row: usize) -> RowSample {
        RowSample {
            value: self.values[row],
            class: self.classes[row],
        }
    }
}

/// The sample of one signal in one row.
#[derive(Clone, Copy)]
pub(super) struct RowSample {
    pub(super) value: f64,
    pub(super) class: Class,
}

impl RowSample {
    /// A sample about which the source says nothing.
    const UNSAID: Self = Self {
        value: f64::NAN,
        class: Class::Good,
    };

    /// Whether the sample says nothing: the value is missing, and the source did not call it bad.
    pub(super) fn is_unsaid(self) -> bool {
        self.value.is_nan() && self.class == Class::Good
    }

    fn is_same(self, other: Self) -> bool {
        let both_missing = self.value.is_nan() && other.value.is_nan();
        self.class == other.class && (self.value == other.value || both_missing)
    }
}

impl Rows {
    /// The rows of a recording, and its signals; nothing where it does not say when it began, or
    /// where its instants lie outside what nanoseconds since 1970 can say.
    #[must_use]
    pub fn of(recording: Recording) -> Option<(Vec<RowSignal>, Self)> {
        let start = i64::try_from(recording.start?.as_nanosecond()).ok()?;
        let time = &recording.time;
        let samples = time.samples();
        start.checked_add(nanoseconds(time.duration()))?;
        let instant = |k| start + nanoseconds(time.instant(k));
        let instants: Vec<i64> = (0..samples).map(instant).collect();
        let signals = recording.signals.iter().map(|signal| RowSignal {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            recorded_unit: signal.recorded_unit.clone(),
            interpolation: signal.interpolation,
        });
        let signals = signals.collect();
        let columns = recording.signals.into_iter().map(|signal| RowColumn {
            classes: signal.class_of_each(),
            values: signal.values,
        });
        let rows = Self {
            columns: columns.collect(),
            instants,
        };
        // Instants that are one nanosecond are one instant.
        let distinct = rows.instants.windows(2).all(|pair| pair[0] < pair[1]);
        Some((signals, if distinct { rows } else { rows.distinct() }))
    }

    fn distinct(self) -> Self {
        let mut kept = Self::of_columns(self.columns.len());
        for row in 0..self.rows() {
            if kept.instants.last() == Some(&self.instants[row]) {
                kept.say_last(&self, row);
            } else {
                kept.push(&self, row);
            }
        }
        kept
    }

    /// No rows of so many signals.
    #[must_use]
    pub fn of_columns(columns: usize) -> Self {
        Self {
            instants: Vec::new(),
            columns: vec![RowColumn::default(); columns],
        }
    }

    /// How many there are.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.instants.len()
    }

    /// The rows from one up to another.
    #[must_use]
    pub fn slice(&self, rows: std::ops::Range<usize>) -> Self {
        Self {
            instants: self.instants[rows.clone()].to_vec(),
            columns: self
                .columns
                .iter()
                .map(|column| RowColumn {
                    values: column.values[rows.clone()].to_vec(),
                    classes: column.classes[rows.clone()].to_vec(),
                })
                .collect(),
        }
    }

    /// The rows with the least and the greatest value of each signal in each of as many stretches as `most`
    /// rows allow, but of one at the least; all rows where there are not more than `most`.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let columns: Vec<&[f64]> = self.columns.iter().map(|column| &*column.values).collect();
        let mut thinned = Self::of_columns(self.columns.len());
        for row in kept_indices(&columns, 0..self.rows(), most) {
            thinned.push(self, row);
        }
        thinned
    }

    /// The rows whose instants lie at or after one and before another.
    #[must_use]
    pub fn within(&self, from: i64, to: i64) -> Self {
        let place = |bound| self.instants.partition_point(|instant| *instant < bound);
        self.slice(place(from)..place(to))
    }

    /// The rows so many nanoseconds later.
    #[must_use]
    pub fn shifted(&self, by_ns: i64) -> Self {
        Self {
            instants: self.instants.iter().map(|ns| ns + by_ns).collect(),
            columns: self.columns.clone(),
        }
    }

    /// The places of the signals of which some row says something.
    #[must_use]
    pub fn signals_said(&self) -> Vec<usize> {
        let speaks = |column: &RowColumn| (0..self.rows()).any(|k| !column.sample(k).is_unsaid());
        let columns = self.columns.iter().enumerate();
        columns
            .filter(|(_, column)| speaks(column))
            .map(|(place, _)| place)
            .collect()
    }

    /// The instants of the rows that say something of one of these signals.
    pub fn says_of(&self, signals: &[usize]) -> impl DoubleEndedIterator<Item = i64> {
        let says = |row: &usize| {
            let mut columns = signals.iter().map(|place| &self.columns[*place]);
            columns.any(|column| !column.sample(*row).is_unsaid())
        };
        let rows = (0..self.rows()).filter(says);
        rows.map(|row| self.instants[row])
    }

    /// How many of `others`, rows of the same signals, say nothing that these rows do not say.
    #[must_use]
    pub fn repeated(&self, later: &Self) -> usize {
        let is_repeated = |row: &usize| {
            let Ok(place) = self.instants.binary_search(&later.instants[*row]) else {
                return false;
            };
            let mut pairs = self.columns.iter().zip(&later.columns);
            pairs.all(|(column, later_column)| {
                let sample = later_column.sample(*row);
                sample.is_unsaid() || sample.is_same(column.sample(place))
            })
        };
        (0..later.rows()).filter(is_repeated).count()
    }

    /// The rows with `columns` signals: column `k` becomes column `places[k]`.
    #[must_use]
    pub fn spread(self, places: &[usize], columns: usize) -> Self {
        let rows = self.rows();
        let mut all: Vec<Option<RowColumn>> = vec![None; columns];
        for (place, column) in places.iter().zip(self.columns) {
            all[*place] = Some(column);
        }
        let unsaid = || RowColumn {
            values: vec![RowSample::UNSAID.value; rows],
            classes: vec![RowSample::UNSAID.class; rows],
        };
        Self {
            instants: self.instants,
            columns: all
                .into_iter()
                .map(|column| column.unwrap_or_else(unsaid))
                .collect(),
        }
    }

    /// These rows and later statements together, of the same signals.
    #[must_use]
    pub fn merge(self, later: &Self) -> (Self, Merged) {
        let columns = self.columns.len();
        debug_assert_eq!(columns, later.columns.len(), "the same signals");
        let mut merged = Self::of_columns(columns);
        let mut told = Merged::default();
        let (mut mine, mut theirs) = (0, 0);
        while mine < self.rows() || theirs < later.rows() {
            let instant = self.instants.get(mine).copied();
            let later_instant = later.instants.get(theirs).copied();
            match (instant, later_instant) {
                (Some(instant), Some(later_instant)) if instant == later_instant => {
                    merged.push(&self, mine);
                    let is_changed = u64::from(merged.say_last(later, theirs));
                    told.changed += is_changed;
                    told.repeated += 1 - is_changed;
                    (mine, theirs) = (mine + 1, theirs + 1);
                }
                (Some(instant), later_instant)
                    if later_instant.is_none_or(|later_instant| instant < later_instant) =>
                {
                    merged.push(&self, mine);
                    mine += 1;
                }
                _ => {
                    merged.push(later, theirs);
                    told.added += 1;
                    theirs += 1;
                }
            }
        }
        (merged, told)
    }

    /// Adds rows that all come after these.
    pub fn append(&mut self, mut later: Self) {
        debug_assert_eq!(self.columns.len(), later.columns.len(), "the same signals");
        self.instants.append(&mut later.instants);
        for (column, mut more) in self.columns.iter_mut().zip(later.columns) {
            column.values.append(&mut more.values);
            column.classes.append(&mut more.classes);
        }
    }

    fn push(&mut self, from: &Self, row: usize) {
        self.instants.push(from.instants[row]);
        for (column, source) in self.columns.iter_mut().zip(&from.columns) {
            column.push(source.sample(row));
        }
    }

    /// Has a row of others speak about the last of these; says whether that changed anything.
    fn say_last(&mut self, from: &Self, row: usize) -> bool {
        let last = self.rows() - 1;
        let mut changes = false;
        for (column, source) in self.columns.iter_mut().zip(&from.columns) {
            let statement = source.sample(row);
            if !statement.is_unsaid() && !statement.is_same(column.sample(last)) {
                column.values[last] = statement.value;
                column.classes[last] = statement.class;
                changes = true;
            }
        }
        changes
    }

    /// SHA-256 of the rows and of what their signals are.
    #[must_use]
    pub fn digest(&self, signals: &[RowSignal]) -> Sha256 {
        let mut digest = Sha256::new();
        digest.update(serde_json::to_vec(signals).expect("signals have only text keys"));
        for instant in &self.instants {
            digest.update(instant.to_le_bytes());
        }
        for column in &self.columns {
            for value in &column.values {
                digest.update(value.to_le_bytes());
            }
            let classes: Vec<u8> = column.classes.iter().map(|class| *class as u8).collect();
            digest.update(classes);
        }
        digest
    }

    /// The recording of these rows; nothing where there are fewer than two.
    #[must_use]
    pub fn into_recording(
        self,
        signals: &[RowSignal],
        source: RecordingSource,
    ) -> Option<Recording> {
        let (first, last) = match self.instants[..] {
            [first, .., last] => (first, last),
            _ => return None,
        };
        let says_all = |column: &RowColumn| (0..self.rows()).all(|k| !column.sample(k).is_unsaid());
        let own_instants = !self.columns.iter().all(says_all);
        let instants = self.instants.iter();
        let instants: Vec<f64> = instants.map(|ns| (ns - first) as f64 * 1e-9).collect();
        let scale = ROUNDED_AS.max((last - first) as f64 * 1e-9);
        let named = signals.iter().zip(self.columns);
        let signals = named.map(|(signal, column)| {
            let named = NamedSignal {
                name: signal.name.clone(),
                unit: signal.unit.clone(),
                recorded_unit: signal.recorded_unit.clone(),
                interpolation: signal.interpolation,
                classes: ClassSpan::of(column.classes.into_iter()),
                column: 0,
            };
            named.with_values(column.values)
        });
        let signals: Vec<Signal> = signals.collect();
        Some(Recording {
            start: Timestamp::from_nanosecond(first.into()).ok(),
            source,
            own_instants,
            ..Recording::new(TimeAxis::from_instants(instants, scale), signals)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rows(samples: &[(i64, f64)]) -> Rows {
        let mut rows = Rows::of_columns(1);
        for (instant, value) in samples {
            rows.instants.push(*instant);
            rows.columns[0].push(RowSample {
                value: *value,
                class: Class::Good,
            });
        }
        rows
    }

    #[test]
    fn a_later_statement_wins_and_a_missing_sample_says_nothing() {
        let before = rows(&[(1, 1.0), (2, 2.0), (4, 4.0)]);
        let later = rows(&[(2, 2.0), (3, 3.0), (4, f64::NAN), (5, 5.0)]);
        let (merged, told) = before.merge(&later);
        assert_eq!(
            merged,
            rows(&[(1, 1.0), (2, 2.0), (3, 3.0), (4, 4.0), (5, 5.0)])
        );
        let expected = Merged {
            added: 2,
            changed: 0,
            repeated: 2,
        };
        assert_eq!(told, expected);
        let (merged, told) = merged.merge(&rows(&[(4, 4.5)]));
        assert_eq!(merged.columns[0].values[3], 4.5);
        assert_eq!((told.changed, told.added), (1, 0));
    }

    #[test]
    fn a_recording_comes_back_with_its_start_its_axis_and_its_classes() {
        let time = TimeAxis::Uniform {
            sample_time: 1.0 / 3.0,
            samples: 1000,
        };
        let mut signal = Signal::new("a", "m", (0..1000).map(f64::from).collect());
        signal.classes = ClassSpan::of((0..1000).map(|k| match k {
            3 | 4 => Class::Uncertain,
            _ => Class::Good,
        }));
        let mut recording = Recording::new(time, vec![signal.clone()]);
        recording.start = "2026-03-02T08:15:00.5Z".parse().ok();
        let start = recording.start;
        let (signals, rows) = Rows::of(recording).expect("it has a start");
        let back = rows
            .into_recording(&signals, RecordingSource::default())
            .expect("samples");
        assert_eq!(back.start, start);
        assert!(back.time.is_uniform(), "{:?}", back.time);
        assert!((back.time.sample_time() * 3.0 - 1.0).abs() < 1e-9);
        assert_eq!(back.signals[0].values, signal.values);
        assert_eq!(back.signals[0].classes, signal.classes);
    }

    proptest! {
        #[test]
        fn rows_are_the_same_in_whatever_order_their_parts_come(
            parts in prop::collection::vec(
                prop::collection::btree_set(0_i64..60, 0..20), 1..6),
            order in any::<u64>(),
        ) {
            let value = |instant: &i64| (*instant, *instant as f64 / 7.0);
            let parts: Vec<Rows> = parts
                .iter()
                .map(|part| rows(&part.iter().map(value).collect::<Vec<_>>()))
                .collect();
            let mut places: Vec<usize> = (0..parts.len()).collect();
            places.sort_by_key(|place| (order >> (place * 8)) & 0xff);
            let put = |order: &mut dyn Iterator<Item = usize>| {
                order.fold(Rows::of_columns(1), |all, place| all.merge(&parts[place]).0)
            };
            let in_order = put(&mut (0..parts.len()));
            prop_assert!(in_order.instants.is_sorted_by(|a, b| a < b));
            prop_assert_eq!(put(&mut places.into_iter()), in_order);
        }
    }
}
