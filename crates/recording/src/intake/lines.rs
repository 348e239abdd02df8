//! InfluxDB's line protocol: `measurement,tag=a field=1.5,other=2i 1465839830100400200`.
//!
//! The instant of a line is optional there, and needed here. Times are nanoseconds unless their
//! size or `time_unit` says otherwise.

use super::cell::Cell;
use super::clock::Clock;
use super::error::{ReadError, ReadingFault, excerpt, malformed};
use super::memory::{LONGEST_ROW, Memory};
use super::options::Options;
use super::tags::{Quality, RawSample, Tags};
use crate::ReceivedRecording;
use std::io::{BufRead, BufReader, Read};

/// Whether a text begins like the protocol.
pub(super) fn looks_like(head: &[u8]) -> bool {
    let lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let mut lines = lines.filter(|line| !line.is_empty() && !line.starts_with(b"#"));
    let first = lines.next().and_then(|line| std::str::from_utf8(line).ok());
    first
        .and_then(ProtocolLine::parse)
        .is_some_and(|line| line.fields().next().is_some())
}

/// Reads all lines.
pub(super) fn read(
    source: impl Read,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let mut source = BufReader::new(source);
    let mut tags = Tags::new(Clock::new("timestamp", "", options), options, None, memory);
    let (mut text, mut number) = (String::new(), 0);
    loop {
        text.clear();
        number += 1;
        let length = (&mut source).take(LONGEST_ROW).read_line(&mut text)?;
        if length == 0 || tags.is_full() {
            break;
        }
        if length as u64 == LONGEST_ROW {
            let detail = format!("the line has more than {LONGEST_ROW} bytes");
            return Err(malformed(ReadingFault::at_line(
                "line_too_long",
                number,
                None,
                detail,
            )));
        }
        let line = text.trim();
        if !line.is_empty() && !line.starts_with('#') {
            push(&mut tags, line, number);
        }
    }
    tags.into_received("influx_line_protocol")
}

fn push(tags: &mut Tags<'_>, text: &str, number: u64) {
    let place = |code, detail: String| ReadingFault::at_line(code, number, None, detail);
    let Some(line) = ProtocolLine::parse(text) else {
        let detail = format!("`{}` is no line of the protocol", excerpt(text));
        return tags.faults.malformed(place("not_line_protocol", detail));
    };
    if line.time.is_empty() {
        let detail = "the line has no time; the server's would not be that of the sample";
        return tags
            .faults
            .invalid(place("missing_time", detail.to_owned()));
    }
    for (name, value) in line.fields() {
        let key = format!("{} {name}", line.series);
        let Some(tag) = tags.series(&key, &name, &place) else {
            continue;
        };
        let sample = RawSample {
            tag,
            time: Cell::Text(line.time),
            value: cell(value),
            quality: Quality::Unsaid,
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

/// The three parts of a line.
struct ProtocolLine<'t> {
    /// The measurement with its tags.
    series: &'t str,
    fields: &'t str,
    time: &'t str,
}

impl<'t> ProtocolLine<'t> {
    fn parse(text: &'t str) -> Option<Self> {
        let mut parts = split(text, ' ');
        let line = Self {
            series: parts.next()?,
            fields: parts.next()?,
            time: parts.next().unwrap_or_default().trim(),
        };
        let is_whole = parts.next().is_none() && line.fields.contains('=');
        is_whole.then_some(line)
    }

    /// The names and values of the fields.
    fn fields(&self) -> impl Iterator<Item = (String, &'t str)> {
        split(self.fields, ',').filter_map(|field| {
            let mut halves = split(field, '=');
            let name = halves.next()?.replace('\\', "");
            Some((name, halves.next()?))
        })
    }
}

/// Parts between separators that are neither escaped nor within quotes.
fn split(text: &str, separator: char) -> impl Iterator<Item = &str> {
    let (mut escaped, mut quoted) = (false, false);
    text.split(move |symbol: char| {
        let was_escaped = escaped;
        escaped = symbol == '\\' && !was_escaped;
        if symbol == '"' && !was_escaped {
            quoted = !quoted;
        }
        symbol == separator && !was_escaped && !quoted
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_that_are_escaped_or_quoted_separate_nothing() {
        let line = ProtocolLine::parse(
            r#"oil\ rig,a=b\ c pos\ x=1.5,s="a, b=c",n=5i 1465839830100400200"#,
        );
        let line = line.unwrap();
        assert_eq!(line.series, r"oil\ rig,a=b\ c");
        assert_eq!(line.time, "1465839830100400200");
        let fields: Vec<(String, &str)> = line.fields().collect();
        let expected = [("pos x", "1.5"), ("s", "\"a, b=c\""), ("n", "5i")];
        assert_eq!(
            fields,
            expected.map(|(name, value)| (name.to_owned(), value))
        );
        assert_eq!(cell("5i"), Cell::Integer(5));
        assert!(looks_like(
            b"# made by hand\nehsv,rig=A pos=0.1 1465839830100400200\n"
        ));
        assert!(!looks_like(b"time [s],a\n0,1\n"));
    }
}
