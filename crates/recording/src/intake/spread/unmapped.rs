//! Series that no rule names: seen, listed, and not taken.

use super::point::FieldValue;
use super::routes::Route;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use utoipa::ToSchema;

/// Series that are listed at the most; samples of further series are counted.
pub const MAX_UNMAPPED: usize = 1000;
/// The bytes of a series' measurement, tags and field that are listed; samples of a longer one are counted.
const LONGEST_SERIES: usize = 1000;
/// The characters of a text that are shown.
const TEXT_CHARACTERS: usize = 100;

/// A series of an agent that no rule names.
#[derive(Clone, Debug, PartialEq)]
pub struct UnmappedSeries {
    /// The measurement of the series.
    pub measurement: String,
    /// The tags of the series.
    pub tags: BTreeMap<String, String>,
    /// The field.
    pub field: String,
    /// How many samples came.
    pub samples: u64,
    /// The value of the sample with the latest instant.
    pub last_value: LastValue,
    /// The latest instant, nanoseconds since 1970.
    pub last_ns: i64,
}

/// A value as an agent wrote it, a text cut to 100 characters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum LastValue {
    /// True or false.
    Boolean(bool),
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

impl LastValue {
    fn of(value: &FieldValue<'_>) -> Self {
        match value {
            FieldValue::Number(number) => Self::Number(*number),
            FieldValue::Boolean(value) => Self::Boolean(*value),
            FieldValue::Text(text) => Self::Text(text.chars().take(TEXT_CHARACTERS).collect()),
        }
    }
}

/// The series of a body that no rule names.
#[derive(Default)]
pub(super) struct UnmappedList {
    series: Vec<UnmappedSeries>,
    /// Places in the list, by measurement with tags and by field.
    places: HashMap<String, HashMap<String, usize>>,
    unlisted: u64,
}

impl UnmappedList {
    /// Counts a sample of a field of a series.
    pub(super) fn add(&mut self, route: &Route, field: &str, value: &FieldValue<'_>, instant: i64) {
        let key = key(route);
        if key.len() + field.len() > LONGEST_SERIES {
            self.unlisted += 1;
            return;
        }
        let listed = self.places.get(&key).and_then(|fields| fields.get(field));
        let Some(place) = listed.copied() else {
            if self.series.len() >= MAX_UNMAPPED {
                self.unlisted += 1;
                return;
            }
            let fields = self.places.entry(key).or_default();
            fields.insert(field.to_owned(), self.series.len());
            self.series.push(UnmappedSeries {
                measurement: route.measurement.clone(),
                tags: route.tags.clone(),
                field: field.to_owned(),
                samples: 1,
                last_value: LastValue::of(value),
                last_ns: instant,
            });
            return;
        };
        let series = &mut self.series[place];
        series.samples += 1;
        if instant >= series.last_ns {
            series.last_ns = instant;
            series.last_value = LastValue::of(value);
        }
    }

    /// The series that are listed, and how many samples of others there were.
    pub(super) fn into_parts(self) -> (Vec<UnmappedSeries>, u64) {
        (self.series, self.unlisted)
    }
}

/// A measurement and its tags as one text. Control characters stand between them, which no two series share.
fn key(route: &Route) -> String {
    let mut key = route.measurement.clone();
    for (tag, value) in &route.tags {
        key.push('\u{1e}');
        key.push_str(tag);
        key.push('\u{1f}');
        key.push_str(value);
    }
    key
}
