//! A time in several columns: a date and a time of day, and milliseconds beside a time to the second.

use super::super::stamp;
use super::fields::{all_fields, is_called_time};
use ::csv::ByteRecord;

/// Titles of columns of milliseconds, in small letters.
const MILLISECONDS: [&str; 8] = [
    "ms",
    "msec",
    "millis",
    "millitm",
    "millisec",
    "millisecond",
    "milliseconds",
    "millisekunden",
];

/// What a sheet has behind a date without a time.
const MIDNIGHT: &str = "T00:00:00.000";

/// The columns that together are the time.
pub(super) struct SplitTime {
    date: Option<usize>,
    clock: usize,
    milliseconds: Option<usize>,
    /// Whole nanoseconds beside Unix seconds.
    nanoseconds: Option<usize>,
    /// The first of six columns from the year to the second.
    year: Option<usize>,
}

/// Titles of the columns of a date and a time of day in parts, in small letters.
const PARTS: [&[&str]; 6] = [
    &["year", "jahr", "yyyy"],
    &["month", "mon", "monat", "mm"],
    &["day", "tag", "dd"],
    &["hour", "stunde", "hh", "h"],
    &["minute", "min", "mi"],
    &["second", "sec", "sekunde", "sek", "ss", "s"],
];

impl SplitTime {
    /// The columns by what stands in them; none where the time has one column.
    pub(super) fn of(titles: &[String], rows: &[Vec<String>]) -> Option<SplitTime> {
        let all = |column: usize, is: &dyn Fn(&str) -> bool| all_fields(rows, column, is);
        let is_pair = |date: usize, clock: usize| {
            let of_sheet = || {
                is_called_time(&titles[clock]) && all(date, &is_midnight) && all(clock, &is_of_day)
            };
            all(date, &stamp::is_date) && all(clock, &stamp::is_clock) || of_sheet()
        };
        let is_part = |(k, names): (usize, &&[&str])| {
            let title = titles.get(k).map(|title| title.to_lowercase());
            title.is_some_and(|title| names.contains(&title.as_str())) && all(k, &is_count)
        };
        let are_parts = |first: &usize| (*first..).zip(PARTS.iter()).all(is_part);
        if let Some(first) = (0..2).find(are_parts) {
            return Some(SplitTime {
                date: None,
                clock: first,
                milliseconds: None,
                nanoseconds: None,
                year: Some(first),
            });
        }
        if let Some((seconds, nanoseconds)) = seconds_and_nanoseconds(titles)
            && all(seconds, &is_of_digits)
            && all(nanoseconds, &is_of_digits)
        {
            return Some(SplitTime {
                date: None,
                clock: seconds,
                milliseconds: None,
                nanoseconds: Some(nanoseconds),
                year: None,
            });
        }
        // A time stands at the beginning, or behind a number of the row.
        let pairs = (1..titles.len().min(3)).flat_map(|k| [(k - 1, k), (k, k - 1)]);
        let pair = pairs
            .into_iter()
            .find(|(date, clock)| is_pair(*date, *clock));
        let is_to_second = |column: &usize| all(*column, &stamp::is_to_second);
        let clock = match pair {
            Some((_, clock)) => clock,
            None => (0..titles.len()).find(is_to_second)?,
        };
        let date = pair.map(|(date, _)| date);
        let next = clock.max(date.unwrap_or(0)) + 1;
        let is_milliseconds = |column: &usize| {
            let title = titles.get(*column).map(|title| title.to_lowercase());
            let is_named = title.is_some_and(|title| MILLISECONDS.contains(&title.as_str()));
            is_named && is_to_second(&clock) && all(*column, &is_of_digits)
        };
        let milliseconds = Some(next).filter(is_milliseconds);
        (date.is_some() || milliseconds.is_some()).then_some(SplitTime {
            date,
            clock,
            milliseconds,
            nanoseconds: None,
            year: None,
        })
    }

    /// The column in whose place the time stands.
    pub(super) fn first(&self) -> usize {
        self.clock.min(self.date.unwrap_or(self.clock))
    }

    /// Whether a column is one of those of the time.
    pub(super) fn has(&self, column: usize) -> bool {
        let is_part = |year: usize| (year..year + PARTS.len()).contains(&column);
        let parts = [
            self.date,
            Some(self.clock),
            self.milliseconds,
            self.nanoseconds,
        ];
        parts.contains(&Some(column)) || self.year.is_some_and(is_part)
    }

    /// The title of the time.
    pub(super) fn title(&self, titles: &ByteRecord) -> Vec<u8> {
        match self.year {
            Some(_) => b"time".to_vec(),
            None => titles.get(self.clock).unwrap_or_default().to_vec(),
        }
    }

    /// The time of a row.
    pub(super) fn text(&self, record: &ByteRecord) -> Vec<u8> {
        let field = |column: Option<usize>| {
            let field = column.and_then(|column| record.get(column));
            String::from_utf8_lossy(field.unwrap_or_default())
                .trim()
                .to_owned()
        };
        if let Some(year) = self.year {
            let part = |k: usize| field(Some(year + k));
            return parts_as_text(&std::array::from_fn(part));
        }
        if let Some(nanoseconds) = self.nanoseconds {
            let (seconds, nanoseconds) = (field(Some(self.clock)), field(Some(nanoseconds)));
            return unix_as_text(&seconds, &nanoseconds);
        }
        let date = field(self.date);
        let mut clock = field(Some(self.clock));
        if let Some(seconds) = seconds_of_day(&clock).filter(|_| is_midnight(&date)) {
            let (minutes, second) = ((seconds / 60.0).floor(), seconds % 60.0);
            clock = format!(
                "{}:{}:{second:09.6}",
                (minutes / 60.0).floor(),
                minutes % 60.0
            );
        }
        let date = date.strip_suffix(MIDNIGHT).unwrap_or(&date);
        let mut text = format!("{date} {clock}");
        let milliseconds = field(self.milliseconds);
        if is_below_a_second(&milliseconds) {
            text = format!("{text}.{milliseconds:0>3}");
        } else if !milliseconds.is_empty() {
            text = format!("{text} and {milliseconds} ms");
        }
        text.trim().as_bytes().to_vec()
    }
}

/// The columns of Unix seconds and of the nanoseconds beside them, as AWS `IoT` `SiteWise` titles them.
fn seconds_and_nanoseconds(titles: &[String]) -> Option<(usize, usize)> {
    let plain = |title: &String| title.to_lowercase().replace('_', "");
    let column = |name: &str| titles.iter().position(|title| plain(title) == name);
    Some((column("timeinseconds")?, column("offsetinnanos")?))
}

/// Unix seconds with their nanoseconds as a fraction, where there are any.
fn unix_as_text(seconds: &str, nanoseconds: &str) -> Vec<u8> {
    match nanoseconds.trim_start_matches('0') {
        "" => seconds.as_bytes().to_vec(),
        digits if digits.len() <= 9 => format!("{seconds}.{digits:0>9}").into_bytes(),
        _ => format!("{seconds} and {nanoseconds} ns").into_bytes(),
    }
}

/// A date and a time of day from the year to the second; a year of two digits is one of this century.
fn parts_as_text([year, month, day, hour, minute, second]: &[String; 6]) -> Vec<u8> {
    let century = if year.len() == 2 { "20" } else { "" };
    let whole = second.split('.').next().unwrap_or_default();
    let zero = if whole.len() == 1 { "0" } else { "" };
    let date = format!("{century}{year}-{month:0>2}-{day:0>2}");
    format!("{date} {hour:0>2}:{minute:0>2}:{zero}{second}").into_bytes()
}

fn is_count(text: &str) -> bool {
    text.parse::<f64>().is_ok_and(|number| number >= 0.0)
}

fn is_midnight(text: &str) -> bool {
    text.ends_with(MIDNIGHT)
}

fn is_of_day(text: &str) -> bool {
    seconds_of_day(text).is_some()
}

/// The seconds since midnight, as which a sheet has a time of day.
fn seconds_of_day(text: &str) -> Option<f64> {
    let seconds: f64 = text.parse().ok()?;
    (0.0..86_400.0).contains(&seconds).then_some(seconds)
}

/// Whether a text is a whole number of milliseconds within a second.
fn is_below_a_second(text: &str) -> bool {
    (1..=3).contains(&text.len()) && is_of_digits(text)
}

fn is_of_digits(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}
