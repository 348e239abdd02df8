//! JSON of historians: PI Web API, OMF, AVEVA OData, Canary, OPC UA, Cognite, pandas, and all else that has times
//! beside values.
//!
//! All of them are objects within arrays within objects. One walk ([`walk`]) hands over each object
//! as it is completed, with the fields of those around it that were read so far; what it means
//! is the format's ([`records`] where a sample is an object, [`frames`] where a row is one). Of a document of no format
//! that is known, what is in it is told by how it is built ([`shapes`]). No tree of the document is made.

mod cognite;
mod frames;
mod held_text;
mod leaf;
mod records;
mod shapes;
mod time_names;
mod walk;

use super::clock::Clock;
use super::memory::Memory;
use super::options::Options;
use super::tags::Tags;
use super::{Format, ReadError};
use crate::ReceivedRecording;
use frames::Frame;
use held_text::{DocumentText, ReadText};
use records::Records;
use shapes::Shapes;
use std::io::Read;
use walk::walk;

/// Whether the times of a document are an object of values and their unit, as this service takes them.
fn has_times_of_values(text: &str) -> bool {
    let behind = text.split("\"time\"").skip(1);
    let object = |behind: &str| -> Option<bool> {
        let object = behind.trim_start().strip_prefix(':')?.trim_start();
        let key = object.strip_prefix('{')?.trim_start();
        Some(key.starts_with("\"values\"") || key.starts_with("\"unit\""))
    };
    behind.filter_map(object).any(|is_of_values| is_of_values)
}

/// What kind of JSON begins so.
pub(super) fn recognised(head: &[u8]) -> Format {
    let text = String::from_utf8_lossy(head);
    let has = |key: &str| text.contains(&format!("\"{key}\""));
    let is_array = text.trim_start().starts_with('[');
    let is_influx = ["results", "series", "columns", "values"]
        .into_iter()
        .all(has);
    let are_lines = are_lines(&text);
    let marks: [(bool, Format); 10] = [
        (is_influx, Format::InfluxJson),
        (has("signals") && !is_array && !are_lines, Format::Json),
        (has("containerid") || has("streamingdata"), Format::Omf),
        (has("@odata.context") || has("FQN"), Format::AvevaOdata),
        (has("datapoints") && has("timestamp"), Format::Cognite),
        (
            has("SourceTimestamp") || has("ServerTimestamp") || has("UaType"),
            Format::OpcUaJson,
        ),
        (
            has("Timestamp") && (has("Good") || has("UnitsAbbreviation") || has("Items")),
            Format::PiWebApi,
        ),
        (
            has("data") && (has("statusCode") || has("continuation")),
            Format::Canary,
        ),
        (
            has("primaryKey") || has("pandas_version"),
            Format::PandasTable,
        ),
        (has("columns") && has("index"), Format::PandasSplit),
    ];
    let marked = marks.into_iter().find(|(marked, _)| *marked);
    match marked {
        Some((_, format)) => format,
        None if is_array || are_lines => Format::PandasRecords,
        None if has("sample_time_s") || has_times_of_values(&text) => Format::Json,
        None => Format::JsonSeries,
    }
}

/// Whether a text has an object on each line.
fn are_lines(text: &str) -> bool {
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let is_object = |line: &str| line.starts_with('{') && line.trim_end().ends_with('}');
    lines.next().is_some_and(is_object) && lines.next().is_some_and(|line| line.starts_with('{'))
}

/// Reads a document of one of the formats.
pub(super) fn read(
    source: impl Read,
    format: Format,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    // A sample of these takes so many bytes of text that the text beside it is little.
    let has_keys_in_samples = !matches!(
        format,
        Format::JsonSeries | Format::PandasSplit | Format::InfluxJson
    );
    let ReadText { text, replaced } = match has_keys_in_samples {
        true => ReadText::held(source, memory)?,
        false => ReadText::streamed(source),
    };
    let held = text.bytes();
    let read = read_text(text, format, options, memory);
    memory.release(held);
    let mut received = read?;
    received.header.notes.extend(replaced.note());
    Ok(received)
}

fn read_text(
    text: DocumentText<impl Read>,
    format: Format,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let clock = Clock::new("timestamp", "", options);
    let tags = Tags::new(clock, options, Records::scheme(format), memory);
    match format {
        Format::PandasRecords | Format::JsonSeries => {
            let mut shapes = Shapes::new(format, tags);
            walk(text, memory, &mut shapes)?;
            shapes.into_tags()
        }
        Format::PandasSplit | Format::PandasTable | Format::InfluxJson => {
            let mut frame = Frame::new(format, tags);
            walk(text, memory, &mut frame)?;
            frame.into_tags()
        }
        _ => {
            let mut records = Records::new(format, tags);
            walk(text, memory, &mut records)?;
            records.into_tags()
        }
    }
    .into_received(format.name())
}

#[cfg(test)]
mod tests;
