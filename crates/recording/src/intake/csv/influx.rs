//! InfluxDB's annotated CSV: tables with a row for each value (`_time,_value,_field`) or, pivoted, a
//! column for each field; a table may repeat annotations and header.

use super::super::cell::Cell;
use super::super::clock::Clock;
use super::super::error::{ReadError, at_line};
use super::super::memory::Memory;
use super::super::options::Options;
use super::super::tags::{Quality, RawSample, Tags};
use super::fields::{line_of, texts};
use super::rows::{TableRows, is_empty, read_row};
use crate::ReceivedRecording;
use ::csv::ByteRecord;
use std::io::Read;

/// What the columns of the present table are.
#[derive(Default)]
struct InfluxTable {
    titles: Vec<String>,
    datatypes: Vec<String>,
    defaults: Vec<String>,
}

/// Columns that say how a series came about, not what it is.
const OWN: [&str; 7] = ["", "result", "table", "_start", "_stop", "_time", "_value"];

/// Reads all tables.
pub(super) fn read(
    mut rows: TableRows<'_, impl Read>,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let mut record = ByteRecord::new();
    let mut tags = Tags::new(Clock::new("_time", "", options), options, None, memory);
    let mut table = InfluxTable::default();
    while !tags.is_full() && read_row(&mut rows, &mut record)? {
        let fields = texts(&record)?;
        let owned = || fields.iter().map(|field| (*field).to_owned()).collect();
        match fields.first().copied().unwrap_or_default() {
            "#datatype" => table.datatypes = owned(),
            "#default" => table.defaults = owned(),
            start if start.starts_with('#') => {}
            _ if is_empty(&record) => {}
            _ if fields.contains(&"_time") => table.titles = owned(),
            _ => table.push(&mut tags, &fields, line_of(&record)),
        }
    }
    tags.into_received("influx_csv")
}

impl InfluxTable {
    /// Takes a row.
    fn push(&self, tags: &mut Tags<'_>, fields: &[&str], line: u64) {
        let field = |k: usize| {
            let cell = fields.get(k).copied().filter(|field| !field.is_empty());
            cell.unwrap_or_else(|| self.defaults.get(k).map_or("", String::as_str))
        };
        let of = |title: &str| {
            self.titles
                .iter()
                .position(|column| column == title)
                .map(field)
        };
        let place = |code, detail: String| at_line(line, None, code, detail);
        let Some(time) = of("_time") else {
            let detail = "a row before any header with `_time`".to_owned();
            return tags.faults.invalid(place("columns_missing", detail));
        };
        let mut push = |name: &str, key: &str, value: &str| {
            let Some(tag) = tags.series(key, name, &place) else {
                return;
            };
            let sample = RawSample {
                tag,
                time: Cell::Text(time),
                value: Cell::Text(value),
                quality: Quality::Unsaid,
            };
            tags.push(&sample, &place);
        };
        let tagged = |k: &usize| !OWN.contains(&self.titles[*k].as_str()) && self.is_text(*k);
        let places = 0..self.titles.len();
        let key: Vec<&str> = places.clone().filter(tagged).map(field).collect();
        let key = key.join(" ");
        if let Some(value) = of("_value") {
            let name = of("_field").unwrap_or("value");
            return push(name, &key, value);
        }
        let is_value = |k: &usize| !OWN.contains(&self.titles[*k].as_str()) && !self.is_text(*k);
        for k in places.filter(is_value) {
            let name = &self.titles[k];
            push(name, &format!("{key} {name}"), field(k));
        }
    }

    /// Whether a column is of text; where nothing says so, all but numbers are.
    fn is_text(&self, column: usize) -> bool {
        let name = self.titles[column].as_str();
        match self.datatypes.get(column).map(String::as_str) {
            Some(datatype) => datatype == "string",
            None => name == "_field" || name == "_measurement" || self.has_values(),
        }
    }

    fn has_values(&self) -> bool {
        self.titles.iter().any(|title| title == "_value")
    }
}
