//! A row for each sample: `timestamp,tag,value,quality`, and the exports of AVEVA Historian
//! (`DateTime,TagName,Value,Quality,QualityDetail,OPCQuality`).

use super::super::cell::Cell;
use super::super::clock::Clock;
use super::super::error::{ReadError, at_line, invalid};
use super::super::memory::Memory;
use super::super::options::Options;
use super::super::tags::{Quality, RawSample, Tags};
use super::super::title;
use super::fields::{line_of, texts, time_name_and_unit};
use super::long_columns::LongColumns;
use super::rows::{TableRows, is_empty, read_row};
use crate::Warning;
use ::csv::ByteRecord;
use greybox_numerics::parsing::Fault;
use std::borrow::Cow;
use std::io::Read;

/// Tags of rows by which `WinCC` tells that its runtime stopped, was disabled or failed.
const STATE_OF_WINCC: &[u8] = b"$RT_";

/// The tags of all rows.
pub(super) fn read<'o>(
    mut rows: TableRows<'_, impl Read>,
    columns: Option<LongColumns>,
    options: &'o Options,
    memory: &Memory,
) -> Result<Tags<'o>, ReadError> {
    let mut record = ByteRecord::new();
    read_row(&mut rows, &mut record)?;
    let titles = texts(&record)?;
    let columns = columns.ok_or_else(|| {
        let detail = "a row for each sample needs columns for the time, the tag and the value, such as \
                      timestamp,tag,value: say `tag` and `value` where they are called otherwise";
        invalid(Fault {
            parameter: Some("tag".into()),
            ..at_line(1, None, "columns_missing", detail)
        })
    })?;
    let parts = columns
        .values
        .iter()
        .map(|column| match columns.values.len() {
            1 => Some((*column, None)),
            _ => Some((*column, Some(titles.get(*column)?.to_string()))),
        });
    let values = parts.flatten().collect();
    let places = RowPlaces { values, columns };
    let (name, unit) = time_name_and_unit(titles[places.columns.time]);
    let clock = Clock::new(name, unit, options);
    let scheme = places.columns.quality.and_then(|(_, scheme)| scheme);
    let mut tags = Tags::new(clock, options, scheme, memory);
    tags.notes.extend(places.columns.left_out(&titles));
    let mut states = 0;
    while !tags.is_full() && read_row(&mut rows, &mut record)? {
        let tag = record.get(places.columns.tag).unwrap_or_default();
        if tag.starts_with(STATE_OF_WINCC) {
            states += 1;
        } else if !is_empty(&record) {
            push(&mut tags, &places, &record)?;
        }
    }
    if states > 0 {
        let detail = format!(
            "{states} rows of `$RT_…` tell that logging stopped or failed, and are no samples"
        );
        let note = Warning::of_recording("lines_left_out", detail);
        tags.notes.push(note);
    }
    Ok(tags)
}

/// Where in a row things stand, and what the signals of a row are called.
struct RowPlaces {
    columns: LongColumns,
    /// The columns of values; where there are several, each with its title.
    values: Vec<(usize, Option<String>)>,
}

fn push(tags: &mut Tags<'_>, places: &RowPlaces, record: &ByteRecord) -> Result<(), ReadError> {
    let line = line_of(record);
    let fields = texts(record)?;
    let RowPlaces { columns, values } = places;
    let field = |place: usize| fields.get(place).copied().unwrap_or_default();
    for (column, title) in values {
        let (part, unit) = title.as_deref().map_or(("", ""), title::name_and_unit);
        let name = match part {
            "" => Cow::Borrowed(field(columns.tag)),
            part => Cow::Owned(format!("{}.{part}", field(columns.tag))),
        };
        let place = |code, mut detail: String| {
            if code == "quality_scheme_needed" {
                detail.push_str(", or quality=none where all samples are good");
            }
            at_line(line, Some(&name), code, detail)
        };
        let Some(tag) = tags.tag(&name, &place) else {
            continue;
        };
        let unit = match columns.unit {
            Some(place) => field(place),
            None => unit,
        };
        if !unit.is_empty() {
            tags.describe(tag, Some(unit), None, &place);
        }
        let sample = RawSample {
            tag,
            time: Cell::Text(field(columns.time)),
            value: Cell::Text(field(*column)),
            quality: match columns.quality {
                Some((place, _)) => Quality::Code(Cell::Text(field(place))),
                None => Quality::Unsaid,
            },
        };
        tags.push(&sample, &place);
    }
    Ok(())
}
