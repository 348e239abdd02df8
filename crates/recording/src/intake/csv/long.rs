//! A row for each sample: `timestamp,tag,value,quality`, and the exports of AVEVA Historian
//! (`DateTime,TagName,Value,Quality,QualityDetail,OPCQuality`).

use super::super::cell::Cell;
use super::super::clock::Clock;
use super::super::error::{ReadError, ReadingFault, invalid};
use super::super::memory::Memory;
use super::super::options::Options;
use super::super::quality::Scheme;
use super::super::tags::{Quality, RawSample, Tags};
use super::super::{units, value};
use super::fields::{line_of, texts, time_name_and_unit};
use super::rows::{TableRows, is_empty, read_row};
use crate::ReceivedRecording;
use ::csv::ByteRecord;
use std::collections::HashSet;
use std::io::Read;

/// Where in a row things stand.
#[derive(Clone, Copy, Debug)]
pub(in crate::intake) struct LongColumns {
    pub(in crate::intake) time: usize,
    pub(in crate::intake) tag: usize,
    pub(in crate::intake) value: usize,
    pub(in crate::intake) quality: Option<(usize, Option<Scheme>)>,
    pub(in crate::intake) unit: Option<usize>,
}

impl LongColumns {
    /// What the titles say, where there are a time, a tag and a value among them.
    pub(in crate::intake) fn of(titles: &[&str]) -> Option<Self> {
        let plain = |title: &&str| -> String {
            let (name, _) = units::name_and_unit(title);
            let letters = name.chars().filter(|c| c.is_alphanumeric());
            letters.flat_map(char::to_lowercase).collect()
        };
        let titles: Vec<String> = titles.iter().map(plain).collect();
        let find = |names: &[&str]| {
            let mut places = names.iter();
            places.find_map(|name| titles.iter().position(|title| title == name))
        };
        let quality = [
            ("opcquality", Some(Scheme::OpcDa)),
            ("qualitydetail", Some(Scheme::AvevaQualityDetail)),
            ("quality", None),
            ("qualitycode", None),
            ("status", None),
            ("q", None),
        ];
        let mut qualities = quality.into_iter();
        Some(Self {
            time: find(&[
                "timestamp",
                "datetime",
                "time",
                "tstamp",
                "ts",
                "date",
                "sourcetimestamp",
            ])?,
            tag: find(&[
                "tag",
                "tagname",
                "tagpath",
                "fqn",
                "signal",
                "point",
                "pointname",
                "variable",
                "series",
                "sensor",
                "channel",
                "name",
                "path",
                "tagid",
                "metric",
                "device",
                "item",
                "measurement",
                "messstelle",
                "messpunkt",
                "kanal",
            ])?,
            value: find(&[
                "value",
                "val",
                "v",
                "vvalue",
                "reading",
                "floatvalue",
                "wert",
                "messwert",
                "avg",
                "average",
                "mean",
                "data",
            ])?,
            quality: qualities.find_map(|(name, scheme)| Some((find(&[name])?, scheme))),
            unit: find(&["unit", "units", "uom", "engunits", "unitsabbreviation"]),
        })
    }
}

impl LongColumns {
    /// The columns by what stands in them, below any titles: a column of words that repeat beside times that repeat,
    /// and a column of numbers. None where the rows are no such list, or several columns have numbers.
    pub(super) fn guessed(rows: &[Vec<String>]) -> Option<Self> {
        let tag = Self::mixed_column(rows)?;
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        let is_number = |column: usize| {
            let mut fields = rows
                .iter()
                .map(|row| row.get(column).map_or("", String::as_str));
            fields.all(|field| value::number(field, None).is_some())
        };
        let mut numbers = (1..width).filter(|column| *column != tag && is_number(*column));
        match (numbers.next(), numbers.next()) {
            (Some(value), None) => Some(Self {
                time: 0,
                tag,
                value,
                quality: None,
                unit: None,
            }),
            _ => None,
        }
    }

    /// The column of words that tells apart rows of one time, where the times of the first column repeat.
    pub(super) fn mixed_column(rows: &[Vec<String>]) -> Option<usize> {
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        let field = |row: &Vec<String>, column: usize| row.get(column).cloned().unwrap_or_default();
        let times: HashSet<String> = rows.iter().map(|row| field(row, 0)).collect();
        let is_word = |text: &str| {
            text.chars().any(char::is_alphabetic) && value::number(text, None).is_none()
        };
        let tells_apart = |column: &usize| {
            let words = rows.iter().map(|row| field(row, *column));
            let words: Vec<String> = words.collect();
            let different: HashSet<&String> = words.iter().collect();
            let pairs = rows.iter().zip(&words);
            let pairs: HashSet<(String, &String)> =
                pairs.map(|(row, word)| (field(row, 0), word)).collect();
            words.iter().all(|word| is_word(word))
                && (2..=words.len() / 2).contains(&different.len())
                && pairs.len() == rows.len()
        };
        let repeat = times.len() < rows.len();
        (1..width).find(tells_apart).filter(|_| repeat)
    }
}

/// Reads all rows; `guessed` are the columns by what stands in them, where their titles do not say it.
pub(super) fn read(
    mut rows: TableRows<'_, impl Read>,
    guessed: Option<LongColumns>,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let mut record = ByteRecord::new();
    read_row(&mut rows, &mut record)?;
    let titles = texts(&record)?;
    let places = LongColumns::of(&titles).or(guessed).ok_or_else(|| {
        let detail = "a row for each sample needs columns for the time, the tag and the value, \
                      such as timestamp,tag,value";
        invalid(ReadingFault::at_line("columns_missing", 1, None, detail))
    })?;
    let (name, unit) = time_name_and_unit(titles[places.time]);
    let clock = Clock::new(name, unit, options);
    let scheme = places.quality.and_then(|(_, scheme)| scheme);
    let mut tags = Tags::new(clock, options, scheme, memory);
    while !tags.is_full() && read_row(&mut rows, &mut record)? {
        if !is_empty(&record) {
            push(&mut tags, places, &record)?;
        }
    }
    tags.into_received("long_csv")
}

fn push(tags: &mut Tags<'_>, places: LongColumns, record: &ByteRecord) -> Result<(), ReadError> {
    let line = line_of(record);
    let fields = texts(record)?;
    let field = |place: usize| fields.get(place).copied().unwrap_or_default();
    let name = field(places.tag);
    let place = |code, detail: String| ReadingFault::at_line(code, line, Some(name), detail);
    let Some(tag) = tags.tag(name, &place) else {
        return Ok(());
    };
    if let Some(unit) = places.unit {
        tags.describe(tag, Some(field(unit)), None, &place);
    }
    let sample = RawSample {
        tag,
        time: Cell::Text(field(places.time)),
        value: Cell::Text(field(places.value)),
        quality: match places.quality {
            Some((place, _)) => Quality::Code(Cell::Text(field(place))),
            None => Quality::Unsaid,
        },
    };
    tags.push(&sample, &place);
    Ok(())
}
