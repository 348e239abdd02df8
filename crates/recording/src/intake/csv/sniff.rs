//! What the first lines of a CSV tell: its delimiter, its kind, and how it writes numbers.

use super::super::options::Decimal;
use super::super::{Format, value};
use super::long;
use ::csv::ReaderBuilder;

/// Rows that are looked at.
const ROWS: usize = 50;

/// The first rows of a text.
pub(super) struct Sniff {
    pub(super) delimiter: u8,
    rows: Vec<Vec<String>>,
}

impl Sniff {
    pub(super) fn new(head: &[u8]) -> Self {
        let start = head.trim_ascii_start();
        let first_line = start.split(|byte| *byte == b'\n').next().unwrap_or(start);
        let delimiter = delimiter(first_line);
        // The last line of the head may be cut.
        let whole = match head.iter().rposition(|byte| *byte == b'\n') {
            Some(end) => &head[..end],
            None => head,
        };
        let reader = ReaderBuilder::new()
            .delimiter(delimiter)
            .flexible(true)
            .has_headers(false)
            .from_reader(whole);
        let records = reader.into_byte_records().take(ROWS).flatten();
        let field = |field: &[u8]| String::from_utf8_lossy(field).trim().to_owned();
        let rows = records.map(|record| record.iter().map(field).collect());
        Self {
            delimiter,
            rows: rows.collect(),
        }
    }

    /// What kind of CSV it is.
    pub(super) fn format(&self) -> Format {
        let Some(first) = self.rows.first() else {
            return Format::WideCsv;
        };
        let has = |name: &str| first.iter().any(|title| title == name);
        let is_annotation = |title: &String| {
            ["#group", "#datatype", "#default", "#constant"].contains(&title.as_str())
        };
        if first.first().is_some_and(is_annotation) || (has("_time") && has("_value")) {
            return Format::InfluxCsv;
        }
        let times = first
            .iter()
            .filter(|title| title.eq_ignore_ascii_case("time"));
        let second = self.rows.get(1).into_iter().flatten();
        let is_description = |field: &String| {
            ["Unit:", "Interp:", "Type:"]
                .iter()
                .any(|key| field.starts_with(key))
        };
        if times.count() > 1 || second.clone().any(is_description) {
            return Format::SimulinkCsv;
        }
        let titles: Vec<&str> = first.iter().map(String::as_str).collect();
        match long::LongColumns::of(&titles) {
            Some(_) => Format::LongCsv,
            None => Format::WideCsv,
        }
    }

    /// The fields of a column below the header.
    pub(super) fn column(&self, index: usize) -> Vec<String> {
        let below = self.rows.iter().skip(1);
        below.filter_map(|row| row.get(index).cloned()).collect()
    }

    /// Whether there are numbers that can only have a decimal comma, and none with a point.
    pub(super) fn has_decimal_commas(&self) -> bool {
        if self.delimiter == b',' {
            return false;
        }
        let mut has_comma = false;
        for field in self.rows.iter().skip(1).flatten() {
            if field.contains('.') && value::number(field, None).is_some() {
                return false;
            }
            let fraction = field.split_once(',').map(|(_, fraction)| fraction);
            let is_number = value::number(field, Some(Decimal::Comma)).is_some();
            // `1,234` may be a thousand and more.
            let is_clear = |fraction: &str| fraction.len() != 3 || field.starts_with("0,");
            has_comma |= is_number && fraction.is_some_and(is_clear);
        }
        has_comma
    }
}

/// The delimiter that stands most often in the header row, outside quotes.
fn delimiter(head: &[u8]) -> u8 {
    let mut counts = [(b',', 0_usize), (b';', 0), (b'\t', 0)];
    let mut quoted = false;
    for byte in head.trim_ascii() {
        quoted ^= *byte == b'"';
        for (delimiter, count) in &mut counts {
            *count += usize::from(!quoted && byte == delimiter);
        }
    }
    counts
        .into_iter()
        .rev()
        .max_by_key(|(_, count)| *count)
        .map_or(b',', |(delimiter, _)| delimiter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_delimiter_is_told_from_the_header() {
        assert_eq!(delimiter(b"time [s],a,b\r"), b',');
        assert_eq!(delimiter(b"time [s];\"a, b, c, d\";b"), b';');
        assert_eq!(delimiter(b"time [s]\ta\tb"), b'\t');
        assert_eq!(delimiter(b"time"), b',');
    }

    #[test]
    fn a_comma_is_a_decimal_one_only_where_it_cannot_be_another() {
        let decimal = |text: &str| Sniff::new(text.as_bytes()).has_decimal_commas();
        assert!(decimal("t;a\n0;0,5\n"));
        assert!(decimal("t;a\n0;12,25\n"));
        assert!(!decimal("t;a\n0;1,234\n"));
        assert!(!decimal("t;a\n0;1,5\n1;2.5\n"));
        assert!(!decimal("t,a\n0,5\n"));
    }
}
