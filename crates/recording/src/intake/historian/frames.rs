//! Frames of pandas with a schema: a row is an object (`orient="table"`) or an array beside the `columns` and the
//! `index` (`"split"`). What InfluxDB 1 answers is built like the latter.

use super::super::Format;
use super::super::cell::Cell;
use super::super::clock::Clock;
use super::super::csv::time_name_and_unit;
use super::super::tags::{Quality, RawSample, Tags};
use super::leaf::{Fields, JsonLeaf};
use super::time_names;
use super::walk::{Surroundings, Visit};

/// Rows on their way to their tags.
pub(super) struct Frame<'o> {
    tags: Tags<'o>,
    /// The name of the column that is the time, once a row was seen.
    time: Option<String>,
    format: Format,
}

impl<'o> Frame<'o> {
    pub(super) fn new(format: Format, tags: Tags<'o>) -> Self {
        Self {
            tags,
            time: None,
            format,
        }
    }

    pub(super) fn into_tags(self) -> Tags<'o> {
        self.tags
    }

    /// Which of the columns is the time: what the options say, else what the frame calls its key,
    /// else one with the name of a time, else the first.
    fn time_of(&mut self, columns: &[&str], key: Option<&str>) -> String {
        if let Some(time) = &self.time {
            return time.clone();
        }
        let time_option = self.tags.options.time.as_deref();
        let named = time_names::named(columns.iter().copied());
        let time = time_option.or(key).or(named).or(columns.first().copied());
        let time = time.unwrap_or_default().to_owned();
        let (_, unit) = time_name_and_unit(&time);
        self.tags.clock = Clock::new(&time, unit, self.tags.options);
        self.time = Some(time.clone());
        time
    }

    fn push<'c>(
        &mut self,
        around: &Surroundings<'_>,
        time: &Cell<'_>,
        cells: impl Iterator<Item = (&'c str, &'c JsonLeaf)>,
    ) {
        let series = match self.format {
            Format::InfluxJson => series_of(around),
            _ => String::new(),
        };
        for (name, leaf) in cells {
            let place = |code, detail: String| around.fault(code, &detail);
            let key = format!("{series} {name}");
            let Some(tag) = self.tags.series(key.trim_start(), name, &place) else {
                continue;
            };
            let sample = RawSample {
                tag,
                time: time.clone(),
                value: leaf.cell(),
                quality: Quality::Unsaid,
            };
            self.tags.push(&sample, &place);
        }
    }
}

/// The measurement and the tags of a series of InfluxDB.
fn series_of(around: &Surroundings<'_>) -> String {
    let name = around.field(&["name"]).and_then(JsonLeaf::text);
    let tags = match around.field(&["tags"]) {
        Some(JsonLeaf::Object(tags)) => &tags.0[..],
        _ => &[],
    };
    let tags = tags
        .iter()
        .filter_map(|(key, tag)| Some(format!("{key}={}", tag.text()?)));
    name.into_iter()
        .chain(tags)
        .collect::<Vec<String>>()
        .join(",")
}

impl Visit for Frame<'_> {
    fn object(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool {
        let in_schema = around.keys().any(|key| key == "schema");
        if around.objects.len() > 1
            || in_schema
            || fields.has("data")
            || self.format == Format::InfluxJson
        {
            return false;
        }
        let key = around
            .objects
            .first()
            .and_then(|frame| match frame.get("schema") {
                Some(JsonLeaf::Object(schema)) => schema.get("primaryKey").cloned(),
                _ => None,
            });
        let key = match &key {
            Some(JsonLeaf::List(names)) => names.first().and_then(JsonLeaf::text),
            _ => None,
        };
        let columns: Vec<&str> = fields.0.iter().map(|(name, _)| &**name).collect();
        let time = self.time_of(&columns, key.as_deref());
        let instant = fields.get(&time).map_or(Cell::Empty, JsonLeaf::cell);
        let values = fields.0.iter().filter(|(name, _)| **name != *time);
        self.push(around, &instant, values.map(|(name, leaf)| (&**name, leaf)));
        true
    }

    fn row(&mut self, around: &Surroundings<'_>, cells: &[JsonLeaf]) -> bool {
        let list = |name| match around.field(&[name]) {
            Some(JsonLeaf::List(list)) => Some(list),
            _ => None,
        };
        let Some(columns) = list("columns") else {
            let detail = "rows before `columns`: their names must come first";
            self.tags
                .faults
                .invalid(around.fault("columns_missing", detail));
            return true;
        };
        let names: Vec<String> = columns.iter().filter_map(JsonLeaf::text).collect();
        let of_row = list("index").and_then(|index| index.get(around.index()));
        let mut field_names: Vec<&str> = names.iter().map(String::as_str).collect();
        field_names.push("index");
        let time = self.time_of(&field_names, None);
        let of_column = names.iter().position(|name| *name == time);
        let instant = match of_column {
            Some(k) => cells.get(k),
            None => of_row,
        };
        let instant = instant.map_or(Cell::Empty, JsonLeaf::cell);
        let values = names.iter().zip(cells).filter(|(name, _)| **name != time);
        self.push(
            around,
            &instant,
            values.map(|(name, leaf)| (name.as_str(), leaf)),
        );
        true
    }

    fn is_full(&self) -> bool {
        self.tags.is_full()
    }
}
