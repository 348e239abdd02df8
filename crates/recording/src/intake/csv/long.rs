//! A row for each sample: `timestamp,tag,value,quality`, and the exports of AVEVA Historian
//! (`DateTime,TagName,Value,Quality,QualityDetail,OPCQuality`).

use super::super::cell::Cell;
use super::super::clock::Clock;
use super::super::error::{ReadError, ReadingFault, invalid};
use super::super::memory::Memory;
use super::super::options::Options;
use super::super::quality::Scheme;
use super::super::tags::{Quality, RawSample, Tags};
use super::rows::{BoundedRows, is_empty, line_of, read_row, texts};
use crate::ReceivedRecording;
use ::csv::{ByteRecord, Reader};
use std::io::Read;

/// Where in a row things stand.
#[derive(Clone, Copy, Debug)]
pub(super) struct LongColumns {
    time: usize,
    tag: usize,
    value: usize,
    quality: Option<(usize, Option<Scheme>)>,
    unit: Option<usize>,
}

impl LongColumns {
    /// What the titles say, where there are a time, a tag and a value among them.
    pub(super) fn of(titles: &[&str]) -> Option<Self> {
        let plain = |title: &&str| -> String {
            let letters = title.chars().filter(|c| c.is_alphanumeric());
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
            ])?,
            value: find(&["value", "val", "v", "vvalue", "reading", "floatvalue"])?,
            quality: qualities.find_map(|(name, scheme)| Some((find(&[name])?, scheme))),
            unit: find(&["unit", "units", "uom", "engunits", "unitsabbreviation"]),
        })
    }
}

/// Reads all rows.
pub(super) fn read(
    mut rows: Reader<BoundedRows<impl Read>>,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let mut record = ByteRecord::new();
    read_row(&mut rows, &mut record)?;
    let titles = texts(&record)?;
    let places = LongColumns::of(&titles).ok_or_else(|| {
        let detail = "a row for each sample needs columns for the time, the tag and the value, \
                      such as timestamp,tag,value";
        invalid(ReadingFault::at_line("columns_missing", 1, None, detail))
    })?;
    let clock = Clock::new(titles[places.time], "", options);
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
