//! InfluxDB's line protocol: `measurement,tag=a field=1.5,other=2i 1465839830100400200`.
//!
//! The instant of a line is optional there, and needed here. In a recording times are nanoseconds unless
//! their size or `time_unit` says otherwise; what agents write (`written`) says its precision beside.

mod point;
mod reader;
mod written;

pub use point::LineFault;
pub use written::{Precision, written};

use super::cell::Cell;
use super::clock::Clock;
use super::error::{ReadError, at_line, excerpt, malformed};
use super::memory::{LONGEST_ROW, Memory};
use super::options::Options;
use super::tags::{Quality, RawSample, Tags};
use crate::ReceivedRecording;
use point::ProtocolLine;
use reader::LineReader;
use std::io::{BufReader, Read};

/// Whether a text begins like the protocol.
pub(super) fn looks_like(head: &[u8]) -> bool {
    let lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let mut lines = lines.filter(|line| !line.is_empty() && !line.starts_with(b"#"));
    let first = lines.next().and_then(|line| std::str::from_utf8(line).ok());
    let point = first.and_then(|line| ProtocolLine::parse(line).ok());
    point.is_some_and(|point| point.fields().any(|field| field.is_ok()))
}

/// Reads all lines.
pub(super) fn read(
    source: impl Read,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let mut lines = LineReader::new(BufReader::new(source));
    let mut tags = Tags::new(Clock::new("timestamp", "", options), options, None, memory);
    while let Some(line) = lines.next()? {
        if tags.is_full() {
            break;
        }
        match line.text {
            Ok(text) => push(&mut tags, text, line.number),
            Err(LineFault::TooLong) => return Err(too_long(line.number)),
            Err(fault) => {
                let place = at_line(line.number, None, "not_line_protocol", fault.to_string());
                tags.faults.malformed(place);
            }
        }
    }
    tags.into_received("influx_line_protocol")
}

fn too_long(number: u64) -> ReadError {
    let detail = format!("the line has more than {LONGEST_ROW} bytes");
    malformed(at_line(number, None, "line_too_long", detail))
}

fn push(tags: &mut Tags<'_>, text: &str, number: u64) {
    let place = |code, detail: String| at_line(number, None, code, detail);
    let point = match ProtocolLine::parse(text) {
        Ok(point) => point,
        Err(fault) => {
            let detail = format!("`{}` is no line of the protocol: {fault}", excerpt(text));
            return tags.faults.malformed(place("not_line_protocol", detail));
        }
    };
    if point.stamp.is_empty() {
        let detail = "the line has no time; the server's would not be that of the sample";
        return tags
            .faults
            .invalid(place("missing_time", detail.to_owned()));
    }
    let field = |key: &str| {
        let mut fields = point.fields().filter_map(Result::ok);
        fields.find(|(name, _)| name == key).map(|(_, value)| value)
    };
    // A field that is called a quality rates the one that is called a value.
    let has_quality = text.contains("quality=");
    let quality = has_quality.then(|| field("quality")).flatten();
    let quality = quality.filter(|_| field("value").is_some());
    for (name, value) in point.fields().filter_map(Result::ok) {
        if name == "quality" && quality.is_some() {
            continue;
        }
        let key = format!("{} {name}", point.series);
        let Some(tag) = tags.series(&key, &name, &place) else {
            continue;
        };
        let sample = RawSample {
            tag,
            time: Cell::Text(point.stamp),
            value: cell(value),
            quality: match quality.filter(|_| name == "value") {
                Some(code) => Quality::Code(cell(code.trim_matches('"'))),
                None => Quality::Unsaid,
            },
        };
        tags.push(&sample, &place);
    }
}

/// `1.5`, `2i`, `3u`, `t` or `"text"`.
fn cell(value: &str) -> Cell<'_> {
    match value {
        "t" | "T" => return Cell::Bool(true),
        "f" | "F" => return Cell::Bool(false),
        _ => {}
    }
    let digits = value.strip_suffix(['i', 'u']).unwrap_or(value);
    digits.parse().map_or(Cell::Text(value), Cell::Integer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_of_lines_is_told_from_a_table() {
        assert_eq!(cell("5i"), Cell::Integer(5));
        assert!(looks_like(
            b"# made by hand\nehsv,rig=A pos=0.1 1465839830100400200\n"
        ));
        assert!(!looks_like(b"time [s],a\n0,1\n"));
    }

    fn read_with(text: &str, given: &[(&str, &str)]) -> Result<crate::Recording, ReadError> {
        let mut options = Options::default();
        for (option, text) in given {
            options.set(option, text).unwrap();
        }
        crate::intake::read(text.as_bytes(), crate::intake::MediaKind::Text, &options)
    }

    #[test]
    fn a_field_of_quality_rates_the_value_beside_it() {
        let text = |quality: [&str; 2]| {
            let [first, second] = quality;
            format!(
                "pump value=1,quality={first} 1772439300000000000\npump value=2,quality={second} 1772439301000000000\n"
            )
        };
        for bad in [r#""Bad""#, "false"] {
            let recording = read_with(&text([r#""good""#, bad]), &[]).unwrap();
            assert_eq!(recording.signals.len(), 1);
            assert_eq!(recording.signals[0].values[0], 1.0);
            assert!(recording.signals[0].values[1].is_nan(), "{bad}");
        }
        let codes = text(["192i", "0i"]);
        let asked = read_with(&codes, &[]).unwrap_err();
        assert_eq!(&*asked.faults()[0].code, "quality_scheme_needed");
        let rated = read_with(&codes, &[("quality_scheme", "opc_da")]).unwrap();
        assert!(rated.signals[0].values[1].is_nan());
        let alone =
            "pump p=1,quality=5i 1772439300000000000\npump p=2,quality=6i 1772439301000000000\n";
        assert_eq!(read_with(alone, &[]).unwrap().signals.len(), 2);
    }
}
