//! Dates and times as people and programs write them.

mod zone;

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::Offset;

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
    let separated = text
        .bytes()
        .skip(1)
        .any(|byte| matches!(byte, b'-' | b':' | b'/'));
    let dotted = text.bytes().filter(|byte| *byte == b'.').count() > 1;
    (separated || dotted) && text.parse::<f64>().is_err()
}

/// Whether a text is a date, a time of day or both, whichever of day and month comes first.
pub(super) fn is_one(text: &str) -> bool {
    let is_read = |day_first| parse(text, Some(day_first)).is_ok();
    looks_like_one(text) && (span(text).is_some() || is_read(true) || is_read(false))
}

/// Whether a text is a date without a time.
pub(super) fn is_date(text: &str) -> bool {
    !text.contains(':') && is_one(text)
}

/// Whether a text is a time of day without a date.
pub(super) fn is_clock(text: &str) -> bool {
    text.contains(':') && clock_time(text).is_some()
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

/// The seconds of a time that no date belongs to: `0 days 00:00:00.100000`, `1 day, 0:00:01`, `08:15:00.5`.
pub(super) fn span(text: &str) -> Option<f64> {
    let text = text.trim();
    let (is_negative, text) = match text.strip_prefix('-') {
        Some(text) => (true, text),
        None => (false, text),
    };
    let (days, clock) = match text.split_once(" day") {
        Some((days, clock)) => (
            days.parse::<u32>().ok()?,
            clock.trim_start_matches(['s', ',', ' ', '+']),
        ),
        None => (0, text),
    };
    let is_clock = clock.is_empty() && text != clock || clock.split(':').count() > 2;
    let (hour, minute, second, nanosecond) = clock_time(clock).filter(|_| is_clock)?;
    let whole = f64::from(second) + 60.0 * (f64::from(minute) + 60.0 * f64::from(hour));
    let fraction = f64::from(nanosecond) / 1e9;
    // pandas counts negative days and adds the time of day to them.
    let days = if is_negative {
        -f64::from(days)
    } else {
        f64::from(days)
    };
    let is_told = !is_negative || days != 0.0;
    is_told.then_some(days * 86_400.0 + whole + fraction)
}

/// The instant that a text names.
///
/// # Errors
/// A code and a sentence.
pub(super) fn parse(text: &str, day_first: Option<bool>) -> Result<Stamp, (&'static str, String)> {
    if let Ok(instant) = text.parse::<Timestamp>() {
        return Ok(Stamp::Instant(instant, offset(text)));
    }
    if let Ok(local) = text.parse::<DateTime>() {
        return Ok(Stamp::Local(local));
    }
    let shown = super::error::excerpt(text);
    let (stamp, zone) = zone::split(text);
    let Some(written) = WrittenStamp::of(stamp) else {
        let detail =
            format!("`{shown}` is neither a number nor a timestamp such as 2026-03-02T08:15:00Z");
        return Err(("not_a_time", detail));
    };
    let day_first = day_first.or_else(|| written.day_first());
    let Some(day_first) = day_first else {
        let detail = format!(
            "`{shown}` may be of two days; say with `time_unit` whether the day comes first (dmy) \
             or the month (mdy)"
        );
        return Err(("ambiguous_date", detail));
    };
    let local = written.local(day_first);
    let stamp = local.and_then(|local| match zone {
        None => Some(Stamp::Local(local)),
        Some(zone) => match zone::offset(zone) {
            Some(seconds) => with_offset(local, seconds),
            None => Some(Stamp::Lettered(local, zone.to_owned())),
        },
    });
    stamp.ok_or_else(|| {
        let detail = format!("`{shown}` is not a date that there is");
        ("not_a_time", detail)
    })
}

/// The instant of a local time so many seconds ahead of UTC.
fn with_offset(local: DateTime, seconds: i32) -> Option<Stamp> {
    let instant = Offset::from_seconds(seconds)
        .ok()?
        .to_timestamp(local)
        .ok()?;
    let minutes = seconds.abs() / 60;
    let sign = if seconds < 0 { '-' } else { '+' };
    let offset = format!("{sign}{:02}:{:02}", minutes / 60, minutes % 60);
    Some(Stamp::Instant(instant, (seconds != 0).then_some(offset)))
}

/// Whether the day stands before the month, where the text leaves no doubt.
pub(super) fn day_first(text: &str) -> Option<bool> {
    WrittenStamp::of(zone::split(text.trim()).0)?.day_first()
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

/// A date of three parts that is not ISO 8601, and a time.
struct WrittenStamp {
    parts: [u16; 3],
    order: DateOrder,
    /// Hour, minute, second and nanosecond.
    time: (i8, i8, i8, i32),
}

#[derive(PartialEq)]
enum DateOrder {
    YearFirst,
    DayFirst,
    /// The day or the month.
    Unclear,
}

impl WrittenStamp {
    fn of(text: &str) -> Option<Self> {
        let (date, time) = match text.find([' ', 'T']) {
            Some(end) => (&text[..end], text[end + 1..].trim()),
            None => (text, ""),
        };
        let date = date.trim_end_matches(',');
        let separator = date.chars().find(|c| matches!(c, '.' | '/' | '-'))?;
        let mut fields = date.split(separator);
        let fields = [fields.next()?, fields.next()?, fields.next()?];
        let by_name = month(fields[1]);
        let part = |k: usize| match by_name.filter(|_| k == 1) {
            Some(month) => Some(month),
            None => fields[k].parse::<u16>().ok(),
        };
        let order = if fields[0].len() == 4 {
            DateOrder::YearFirst
        } else if by_name.is_some() || separator == '.' {
            DateOrder::DayFirst
        } else {
            DateOrder::Unclear
        };
        Some(Self {
            parts: [part(0)?, part(1)?, part(2)?],
            order,
            time: clock_time(time)?,
        })
    }

    fn day_first(&self) -> Option<bool> {
        match self.order {
            DateOrder::YearFirst | DateOrder::DayFirst => Some(true),
            DateOrder::Unclear if self.parts[0] > 12 => Some(true),
            DateOrder::Unclear if self.parts[1] > 12 => Some(false),
            DateOrder::Unclear => None,
        }
    }

    fn local(&self, day_first: bool) -> Option<DateTime> {
        let [a, b, c] = self.parts;
        let (year, month, day) = match self.order {
            DateOrder::YearFirst => (a, b, c),
            DateOrder::DayFirst => (c, b, a),
            DateOrder::Unclear if day_first => (c, b, a),
            DateOrder::Unclear => (c, a, b),
        };
        let year = if year < 100 { year + 2000 } else { year };
        let (hour, minute, second, nanosecond) = self.time;
        let small = |number: u16| i8::try_from(number).ok();
        DateTime::new(
            i16::try_from(year).ok()?,
            small(month)?,
            small(day)?,
            hour,
            minute,
            second,
            nanosecond,
        )
        .ok()
    }
}

/// A month by the start of its English or German name.
fn month(text: &str) -> Option<u16> {
    const MONTHS: [&str; 12] = [
        "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    ];
    const OTHERS: [(&str, u16); 4] = [("mär", 3), ("mai", 5), ("okt", 10), ("dez", 12)];
    let start: String = text.chars().take(3).flat_map(char::to_lowercase).collect();
    let english = MONTHS.iter().position(|month| *month == start);
    let german = OTHERS.iter().find(|(month, _)| *month == start);
    english
        .map(|k| k as u16 + 1)
        .or(german.map(|(_, month)| *month))
}

/// `8:15`, `08:15:00.5`, `08:15:00,5`, `08:15:00:500`, `8:15:00 PM`; midnight where there is none.
fn clock_time(text: &str) -> Option<(i8, i8, i8, i32)> {
    if text.is_empty() {
        return Some((0, 0, 0, 0));
    }
    let upper = text.to_ascii_uppercase();
    let (digits, shift) = match (upper.strip_suffix("PM"), upper.strip_suffix("AM")) {
        (Some(digits), _) => (digits, Some(12)),
        (_, Some(digits)) => (digits, Some(0)),
        _ => (upper.as_str(), None),
    };
    let mut fields = digits.trim().split(':');
    let hour: i8 = fields.next()?.parse().ok()?;
    let minute: i8 = fields.next()?.parse().ok()?;
    let seconds = fields.next().unwrap_or("0");
    let (second, fraction) = match fields.next() {
        // Three digits behind a colon are milliseconds.
        Some(milliseconds) if milliseconds.len() == 3 && fields.next().is_none() => {
            (seconds, milliseconds)
        }
        Some(_) => return None,
        None => seconds.split_once(['.', ',']).unwrap_or((seconds, "")),
    };
    let is_fraction = fraction.len() <= 9 && fraction.bytes().all(|byte| byte.is_ascii_digit());
    let nanosecond = is_fraction.then(|| format!("{fraction:0<9}").parse().ok())??;
    let hour = match shift {
        Some(shift) => hour % 12 + shift,
        None => hour,
    };
    Some((hour, minute, second.parse().ok()?, nanosecond))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_of_many_countries_are_one_instant() {
        let expected: DateTime = "2026-03-02T20:15:00.5".parse().unwrap();
        for (text, day_first) in [
            ("2026-03-02 20:15:00.5", None),
            ("2026/03/02 20:15:00.5", None),
            ("02.03.2026 20:15:00,5", None),
            ("2.3.26 20:15:00.5", None),
            ("02-Mar-2026 20:15:00.5", None),
            ("02-Mär-26 20:15:00.5", None),
            ("03/02/2026 8:15:00.5 PM", Some(false)),
            ("02/03/2026 20:15:00.5", Some(true)),
        ] {
            let stamp = parse(text, day_first).unwrap_or_else(|(_, why)| panic!("{why}"));
            assert_eq!(stamp, Stamp::Local(expected), "{text}");
        }
    }

    #[test]
    fn a_date_of_two_meanings_is_asked_about() {
        assert_eq!(parse("02/03/2026", None).unwrap_err().0, "ambiguous_date");
        assert_eq!(day_first("02/13/2026"), Some(false));
        assert_eq!(day_first("13/02/2026 8:00"), Some(true));
        assert_eq!(parse("31/02/2026", None).unwrap_err().0, "not_a_time");
        assert_eq!(parse("yesterday-ish", None).unwrap_err().0, "not_a_time");
    }

    #[test]
    fn serial_days_count_from_the_thirtieth_of_december_1899() {
        // 45353.5 is noon of 2024-03-02 in every spreadsheet.
        let noon = from_serial_days((45_353.5 * 86_400e6) as i64).unwrap();
        assert_eq!(noon, "2024-03-02T12:00:00".parse().unwrap());
    }
}
