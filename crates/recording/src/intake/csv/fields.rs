//! Single fields of a table: what a title and a cell are by their text, and where they stand.

use super::super::error::{ReadError, at_line, malformed};
use super::super::options::Decimal;
use super::super::{stamp, title, units, value};
use csv::{ByteRecord, Position};
use greybox_numerics::parsing::Fault;

/// Words that call a column a time.
const TIMES: [&str; 5] = ["time", "timestamp", "datetime", "zeit", "zeitstempel"];

/// Whether the first or the last word of a title is that of a time.
pub(super) fn is_called_time(title: &str) -> bool {
    let (name, _) = time_name_and_unit(title);
    let name = name.to_lowercase();
    let mut words = name.split(|symbol: char| !symbol.is_alphanumeric());
    let first = words.next().unwrap_or_default();
    TIMES.contains(&first) || words.next_back().is_some_and(|last| TIMES.contains(&last))
}

/// The name and the unit in the title of the time column, whose name may end with a unit of time: `t_s`,
/// `elapsed_min`, `time (seconds)`.
pub(in crate::intake) fn time_name_and_unit(title: &str) -> (&str, &str) {
    let (name, unit) = title::name_and_unit(title);
    if !unit.is_empty() {
        return (name, unit);
    }
    let is_unit = |unit: &str| !unit.is_empty() && units::parse_time(unit).is_some();
    let in_parentheses = title
        .strip_suffix(')')
        .and_then(|title| title.split_once('('));
    match (in_parentheses, title.rsplit_once('_')) {
        (Some((name, unit)), _) if is_unit(unit) => (name.trim_end(), unit),
        (_, Some((name, unit))) if !name.is_empty() && is_unit(unit) => (title, unit),
        _ => (title, ""),
    }
}

/// Whether a field is what stands in rows: nothing, a number or a time.
pub(super) fn is_data(field: &str) -> bool {
    let is_number = |field| {
        let reads = |decimal| value::number(field, Some(decimal)).is_some();
        reads(Decimal::Point) || reads(Decimal::Comma)
    };
    field.is_empty()
        || is_number(field)
        || stamp::is_one(field)
        || value::with_unit(field).is_some_and(|(number, _)| is_data(number))
        || value::status_behind(field).is_some_and(|(number, _)| is_number(number))
}

/// Whether a column has fields that are filled, and all of them are so.
pub(super) fn all_fields(rows: &[Vec<String>], column: usize, are: &dyn Fn(&str) -> bool) -> bool {
    let fields = rows.iter().filter_map(|row| row.get(column));
    let mut filled = fields.filter(|field| !field.is_empty()).peekable();
    filled.peek().is_some() && filled.all(|field| are(field))
}

/// Whether a field is a number, whichever sign stands before its fraction.
pub(super) fn is_number(field: &str) -> bool {
    let reads = |decimal| value::number(field, decimal).is_some();
    reads(None) || reads(Some(Decimal::Comma))
}

/// Whether each field is a number that is larger by 1 than the one before.
pub(super) fn count_up<'f>(fields: impl Iterator<Item = Option<&'f String>>) -> bool {
    let numbers = fields.map(|field| value::number(field?, None));
    let numbers: Option<Vec<f64>> = numbers.collect();
    numbers.is_some_and(|numbers| {
        numbers.len() > 1 && numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0)
    })
}

/// Whether a column holds timestamps, or numbers that rise.
pub(super) fn runs(rows: &[Vec<String>], column: usize) -> bool {
    let fields = rows.iter().filter_map(|row| row.get(column));
    let fields: Vec<&String> = fields.filter(|field| !field.is_empty()).collect();
    if fields.iter().all(|field| stamp::looks_like_one(field)) {
        return !fields.is_empty();
    }
    let numbers = fields.iter().map(|field| value::number(field, None));
    let numbers: Option<Vec<f64>> = numbers.collect();
    numbers.is_some_and(|numbers| {
        numbers.len() > 1 && numbers.windows(2).all(|pair| pair[1] > pair[0])
    })
}

/// The line at which a row begins.
pub(super) fn line_of(record: &ByteRecord) -> u64 {
    record.position().map_or(1, Position::line)
}

/// The fields of a row as text; a fault where it is none.
pub(super) fn texts(record: &ByteRecord) -> Result<Vec<&str>, ReadError> {
    let text = |field| std::str::from_utf8(field).map(str::trim);
    let fields: Result<Vec<&str>, _> = record.iter().map(text).collect();
    fields.map_err(|_| malformed(not_utf8(line_of(record))))
}

pub(super) fn not_utf8(line: u64) -> Fault {
    let detail = "the text is not UTF-8; say its encoding, such as encoding=windows-1252";
    at_line(line, None, "not_utf8", detail)
}
