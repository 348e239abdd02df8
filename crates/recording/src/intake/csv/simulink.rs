//! Simulink's Simulation Data Inspector: `time,sig1,time,sig2`, where each signal has the time on
//! its left, with rows of `Unit: m/s` and `Interp: zoh` below the header.

use super::super::cell::Cell;
use super::super::clock::Clock;
use super::super::error::{ReadError, at_line, invalid};
use super::super::memory::Memory;
use super::super::options::Options;
use super::super::tags::{Quality, RawSample, Tags};
use super::fields::{line_of, texts};
use super::rows::{TableRows, is_empty, read_row};
use crate::{Interpolation, ReceivedRecording};
use ::csv::ByteRecord;
use std::io::Read;

/// A column of a signal and that of its time.
struct SimulinkColumns {
    tag: usize,
    time: usize,
    value: usize,
}

/// Reads all rows.
pub(super) fn read(
    mut rows: TableRows<'_, impl Read>,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let mut record = ByteRecord::new();
    read_row(&mut rows, &mut record)?;
    let mut tags = Tags::new(Clock::new("time", "s", options), options, None, memory);
    let places = signals(&mut tags, &record)?;
    while !tags.is_full() && read_row(&mut rows, &mut record)? {
        let line = line_of(&record);
        let fields = texts(&record)?;
        if is_empty(&record) {
            continue;
        }
        if fields.iter().any(|field| description(field).is_some()) {
            describe(&mut tags, &places, &fields, line);
            continue;
        }
        for SimulinkColumns { tag, time, value } in &places {
            let field = |place: usize| fields.get(place).copied().unwrap_or_default();
            if field(*time).is_empty() {
                continue;
            }
            let sample = RawSample {
                tag: *tag,
                time: Cell::Text(field(*time)),
                value: Cell::Text(field(*value)),
                quality: Quality::Unsaid,
            };
            let place = |code, detail: String| at_line(line, None, code, detail);
            tags.push(&sample, &place);
        }
    }
    tags.into_received("simulink_csv")
}

fn signals(tags: &mut Tags<'_>, header: &ByteRecord) -> Result<Vec<SimulinkColumns>, ReadError> {
    let line = line_of(header);
    let mut time = None;
    let mut places = Vec::new();
    for (k, title) in texts(header)?.into_iter().enumerate() {
        if title.eq_ignore_ascii_case("time") {
            time = Some(k);
        } else if let Some(time) = time.filter(|_| !title.is_empty()) {
            let place = |code, detail: String| at_line(line, None, code, detail);
            let tag = tags.tag(title, &place);
            places.extend(tag.map(|tag| SimulinkColumns {
                tag,
                time,
                value: k,
            }));
        }
    }
    if places.is_empty() {
        let detail = "a column `time` with signals to the right of it is needed";
        return Err(invalid(at_line(line, None, "columns_missing", detail)));
    }
    Ok(places)
}

/// `Unit: m/s` as `Unit` and `m/s`.
fn description(field: &str) -> Option<(&str, &str)> {
    let (key, value) = field.split_once(':')?;
    let is_key = ["Unit", "Interp", "Type", "BlockPath", "PortIndex", "Name"].contains(&key);
    is_key.then(|| (key, value.trim()))
}

fn describe(tags: &mut Tags<'_>, places: &[SimulinkColumns], fields: &[&str], line: u64) {
    for SimulinkColumns { tag, value, .. } in places {
        let place = |code, detail: String| at_line(line, None, code, detail);
        let described = fields.get(*value).and_then(|field| description(field));
        match described {
            Some(("Unit", unit)) => tags.describe(*tag, Some(unit), None, &place),
            Some(("Interp", how)) => {
                let how = match how {
                    "zoh" => Some(Interpolation::Hold),
                    "linear" => Some(Interpolation::Linear),
                    _ => None,
                };
                tags.describe(*tag, None, how, &place);
            }
            _ => {}
        }
    }
}
