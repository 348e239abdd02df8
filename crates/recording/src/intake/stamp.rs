//! Dates and times as people and programs write them.

mod date;
mod day_time;
mod span;
mod words;
mod zone;

use super::offset;
use super::options::Decimal;
use super::value;
use day_time::{DayTime, HalfDay};
use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::Offset;
pub(super) use span::span;
use words::WrittenStamp;
use zone::WrittenZone;

/// A date and time that was understood.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Stamp {
    /// With its offset, as text where that is not zero.
    Instant(Timestamp, Option<String>),
    /// Without one.
    Local(DateTime),
    /// With letters for a zone, which zones share.
    Lettered(DateTime, String),
}

/// Whether a text is meant as a date rather than as a number.
pub(super) fn looks_like_one(text: &str) -> bool {
    let text = text.trim();
    let is_number = |decimal| value::number(text, Some(decimal)).is_some();
    let separated = text
        .bytes()
        .skip(1)
        .any(|byte| matches!(byte, b'-' | b':' | b'/'));
    let dotted = text.bytes().filter(|byte| *byte == b'.').count() > 1;
    let is_date = separated || dotted || WrittenStamp::of(text).is_some();
    is_date && !is_number(Decimal::Point) && !is_number(Decimal::Comma)
}

/// Whether a text is a date, a time of day or both, whichever of day and month comes first.
pub(super) fn is_one(text: &str) -> bool {
    let is_read = |day_first| parse(text, Some(day_first)).is_ok();
    looks_like_one(text) && (span(text, None).is_some() || is_read(true) || is_read(false))
}

/// Whether a text is a date without a time.
pub(super) fn is_date(text: &str) -> bool {
    is_one(text) && WrittenStamp::of(text).is_some_and(|stamp| stamp.time.is_none())
}

/// Whether a text is a time of day without a date.
pub(super) fn is_clock(text: &str) -> bool {
    let (time, half) = HalfDay::split(text);
    let time = DayTime::of_colons(time.trim_end());
    time.and_then(|time| time.in_half(half)).is_some()
}

/// Whether digits alone are a date of a plant with its time: `20260302081500`.
pub(super) fn is_of_digits(text: &str) -> bool {
    /// Years of plants.
    const YEARS: std::ops::Range<i16> = 1990..2100;
    let stamp = WrittenStamp::of(text).filter(|stamp| stamp.time.is_some());
    let local = stamp.and_then(|stamp| stamp.local(true));
    let is_number = text.bytes().all(|digit| digit.is_ascii_digit());
    is_number && local.is_some_and(|local| YEARS.contains(&local.year()))
}

/// Whether a text ends with a time of day to the second.
pub(super) fn is_to_second(text: &str) -> bool {
    let clock = text.rsplit([' ', 'T']).next().unwrap_or_default();
    let is_pair = |part: &str| {
        (1..=2).contains(&part.len()) && part.bytes().all(|byte| byte.is_ascii_digit())
    };
    clock.split(':').count() == 3 && clock.split(':').all(is_pair)
}

/// Whether a text says how times are written: `hh:mm:ss`, `dd.MM.yyyy HH:mm`.
pub(super) fn is_pattern(text: &str) -> bool {
    let lower = text.to_ascii_lowercase();
    let is_of_pattern = |c: char| "ymdhsfapt :./-,".contains(c);
    let has_two = lower.contains("hh") || lower.contains("yy");
    lower.contains("mm") && has_two && lower.chars().all(is_of_pattern)
}

/// The instant that a text names.
///
/// # Errors
/// A code and a sentence.
pub(super) fn parse(text: &str, day_first: Option<bool>) -> Result<Stamp, (&'static str, String)> {
    if let Some(stamp) = of_iso(text) {
        return Ok(stamp);
    }
    let shown = super::error::excerpt(text);
    let Some(written) = WrittenStamp::of(text) else {
        let detail =
            format!("`{shown}` is neither a number nor a timestamp such as 2026-03-02T08:15:00Z");
        return Err(("not_a_time", detail));
    };
    let day_first = day_first.or_else(|| written.date.day_first());
    let Some(day_first) = day_first else {
        let detail = format!(
            "`{shown}` may be of two days; say with `time_unit` whether the day comes first (dmy) \
             or the month (mdy)"
        );
        return Err(("ambiguous_date", detail));
    };
    let local = written.local(day_first);
    let stamp = local.and_then(|local| match written.zone {
        None => Some(Stamp::Local(local)),
        Some(WrittenZone::Ahead(seconds)) => with_offset(local, seconds),
        Some(WrittenZone::Letters(letters)) => Some(Stamp::Lettered(local, letters)),
    });
    stamp.ok_or_else(|| {
        let detail = format!("`{shown}` is not a date that there is");
        ("not_a_time", detail)
    })
}

/// A date of ISO 8601, whose year has four digits or a sign before it.
fn of_iso(text: &str) -> Option<Stamp> {
    let year = text.as_bytes().get(..4)?;
    if !year.iter().all(u8::is_ascii_digit) && !text.starts_with(['-', '+']) {
        return None;
    }
    match text.parse::<Timestamp>() {
        Ok(instant) => Some(Stamp::Instant(instant, offset(text))),
        Err(_) => text.parse::<DateTime>().ok().map(Stamp::Local),
    }
}

/// The instant of a local time so many seconds ahead of UTC.
fn with_offset(local: DateTime, seconds: i32) -> Option<Stamp> {
    let instant = Offset::from_seconds(seconds)
        .ok()?
        .to_timestamp(local)
        .ok()?;
    let offset = (seconds != 0).then(|| offset::written(seconds));
    Some(Stamp::Instant(instant, offset))
}

/// Whether the day stands before the month, where the text leaves no doubt.
pub(super) fn day_first(text: &str) -> Option<bool> {
    WrittenStamp::of(text)?.date.day_first()
}

/// The date and time of so many microseconds since 1899-12-30.
pub(super) fn from_serial_days(microseconds: i64) -> Option<DateTime> {
    let epoch = jiff::civil::date(1899, 12, 30).at(0, 0, 0, 0);
    let span = jiff::SignedDuration::from_micros(microseconds);
    epoch.checked_add(span).ok()
}

/// The offset at the end of an RFC 3339 timestamp, where it is not zero.
fn offset(text: &str) -> Option<String> {
    let at = text.len().checked_sub(6)?;
    let offset = text.get(at..)?;
    let is_offset = offset.starts_with(['+', '-']) && offset.as_bytes()[3] == b':';
    (is_offset && !offset.ends_with("00:00")).then(|| offset.to_owned())
}

#[cfg(test)]
mod tests;
