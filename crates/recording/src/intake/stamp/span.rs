//! Times that no date belongs to: from the beginning of a recording, or of a day.

use super::day_time::{DayTime, HalfDay, digits};
use crate::intake::options::Decimal;
use crate::intake::{units, value};

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// The seconds of a time that no date belongs to: `0 days 00:00:00.100000`, `08:15:00.5`, `00:00.5`, `10 ms`, `T#10ms`,
/// `PT0.5S`.
pub(in crate::intake) fn span(text: &str, decimal: Option<Decimal>) -> Option<f64> {
    let text = text.trim();
    let clock = || of_days(text).or_else(|| signed(text, of_clock));
    match text.contains(':') || text.contains(" day") {
        true => clock(),
        false => in_unit(text, decimal)
            .or_else(|| of_controller(text))
            .or_else(|| signed(text, of_iso)),
    }
}

/// A span with a minus before it or without.
fn signed(text: &str, read: impl Fn(&str) -> Option<f64>) -> Option<f64> {
    match text.strip_prefix('-') {
        Some(text) => read(text).map(|seconds| -seconds),
        None => read(text),
    }
}

/// `0 days 00:00:00.1`, `1 day, 0:00:01` and `2 days`.
fn of_days(text: &str) -> Option<f64> {
    let (days, clock) = text.split_once(" day")?;
    // pandas counts negative days and adds the time of day to them.
    let days = signed(days, |days| digits(days).map(f64::from))?;
    match clock.trim_start_matches(['s', ',', ' ', '+']) {
        "" => Some(days * DAY),
        clock => Some(days * DAY + hours(clock)?),
    }
}

/// `08:15:00.5`, `1.08:15:00.5` and `15:00.5`.
fn of_clock(text: &str) -> Option<f64> {
    let days = text
        .split_once('.')
        .filter(|(_, clock)| clock.contains(':'));
    if let Some((days, clock)) = days {
        return Some(f64::from(digits(days)?) * DAY + hours(clock)?);
    }
    hours(text).or_else(|| minutes(text))
}

/// The seconds of hours, minutes and seconds.
fn hours(text: &str) -> Option<f64> {
    let (time, half) = HalfDay::split(text);
    let has_seconds = time.split(':').count() > 2;
    let time = DayTime::of_colons(time.trim_end()).filter(|_| has_seconds)?;
    Some(time.in_half(half)?.seconds())
}

/// The seconds of minutes and seconds, which a fraction tells from hours and minutes.
fn minutes(text: &str) -> Option<f64> {
    let (minutes, seconds) = text.split_once(':')?;
    let (second, fraction) = seconds.split_once(['.', ','])?;
    let second = digits(second).filter(|second| *second < 60)?;
    let is_fraction = !fraction.is_empty() && fraction.bytes().all(|digit| digit.is_ascii_digit());
    let fraction: f64 = format!("0.{fraction}")
        .parse()
        .ok()
        .filter(|_| is_fraction)?;
    Some(60.0 * f64::from(digits(minutes)?) + f64::from(second) + fraction)
}

/// A number with a unit of time: `0.1 sec`, `10 ms`.
fn in_unit(text: &str, decimal: Option<Decimal>) -> Option<f64> {
    let number = text.trim_end_matches(|c: char| c.is_alphabetic() || c == '.');
    let unit = text.get(number.len()..).filter(|unit| !unit.is_empty())?;
    let factor = units::parse_time(unit)?.factor;
    Some(value::number(number.trim_end(), decimal)? * factor)
}

/// `T#1m30s`, `TIME#10ms` and `LTIME#5us` of IEC 61131-3.
fn of_controller(text: &str) -> Option<f64> {
    const UNITS: [(&str, f64); 7] = [
        ("d", DAY),
        ("h", 3600.0),
        ("m", 60.0),
        ("s", 1.0),
        ("ms", 1e-3),
        ("us", 1e-6),
        ("ns", 1e-9),
    ];
    let (word, parts) = text.split_once('#')?;
    let is_time = ["T", "LT", "TIME", "LTIME"]
        .iter()
        .any(|name| name.eq_ignore_ascii_case(word));
    signed(parts, |parts| total(parts, &UNITS)).filter(|_| is_time)
}

/// `PT0.5S` and `P1DT2H` of ISO 8601, whose months and years have no one length.
fn of_iso(text: &str) -> Option<f64> {
    let parts = text.strip_prefix('P')?;
    let (days, clock) = parts.split_once('T').unwrap_or((parts, ""));
    let days = total(days, &[("W", 7.0 * DAY), ("D", DAY)]);
    let clock = total(clock, &[("H", 3600.0), ("M", 60.0), ("S", 1.0)]);
    match parts {
        _ if days.is_none() && clock.is_none() => None,
        _ if parts.starts_with('T') => clock,
        _ if parts.contains('T') => Some(days? + clock?),
        _ => days,
    }
}

/// The seconds of numbers with units, the longest unit first; none where there is no number.
fn total(parts: &str, units: &[(&str, f64)]) -> Option<f64> {
    let mut rest = parts;
    let mut seconds = None;
    let mut units = units.iter();
    while !rest.is_empty() {
        let (number, behind) = rest.split_at(rest.find(char::is_alphabetic)?);
        let end = behind
            .find(|c: char| !c.is_alphabetic())
            .unwrap_or(behind.len());
        let (unit, behind) = behind.split_at(end);
        let (_, factor) = units.find(|(name, _)| name.eq_ignore_ascii_case(unit))?;
        let is_number = number.starts_with(|c: char| c.is_ascii_digit());
        let number: f64 = number
            .replace(',', ".")
            .parse()
            .ok()
            .filter(|_| is_number)?;
        seconds = Some(seconds.unwrap_or(0.0) + number * factor);
        rest = behind.trim_start_matches('_');
    }
    seconds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_without_a_date_are_seconds() {
        for (text, seconds) in [
            ("08:15:00.5", 29_700.5),
            ("8:15:00 PM", 72_900.0),
            ("0 days 00:00:00.100000", 0.1),
            ("1 day, 0:00:01", 86_401.0),
            ("-1 days +23:59:59", -1.0),
            ("-00:00:01", -1.0),
            ("0.00:00:00.500", 0.5),
            ("-1.02:00:00", -93_600.0),
            ("100:00:00", 360_000.0),
            ("00:00.5", 0.5),
            ("75:01,25", 4501.25),
            ("0.1 sec", 0.1),
            ("250 ms", 0.25),
            ("5us", 5e-6),
            ("2 hours", 7200.0),
            ("T#10ms", 0.01),
            ("t#1d_2h3m4s5ms", 93_784.005),
            ("TIME#-1.5s", -1.5),
            ("LTIME#5us", 5e-6),
            ("PT0.5S", 0.5),
            ("-PT0,5S", -0.5),
            ("P1DT2H3M4S", 93_784.0),
            ("P1W", 604_800.0),
        ] {
            let read = span(text, None).unwrap_or(f64::NAN);
            assert!((read - seconds).abs() < 1e-9, "{text}: {read}");
        }
        assert_eq!(span("0,5 s", Some(Decimal::Comma)), Some(0.5));
    }

    #[test]
    fn what_is_no_time_without_a_date_is_none() {
        for text in [
            "",
            "5",
            "s",
            "5 m",
            "5 bar",
            "08:15",
            "00:61.5",
            "00:00.",
            "P1M",
            "P1Y",
            "P",
            "PT",
            "PT101",
            "PT1H2",
            "P1DT",
            "T#",
            "T#5",
            "T#5x",
            "T#5ms1s",
            "X#5s",
            "02.03.2026 08:15:00",
            "1.2.08:15:00",
            "0,5 s",
            "1-2 s",
        ] {
            assert_eq!(span(text, None), None, "{text}");
        }
    }
}
