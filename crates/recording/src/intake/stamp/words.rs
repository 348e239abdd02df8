//! The words of a date with a time: a date in one word or three, a time of day, its half of the day and its zone, in
//! the orders in which people and programs write them.

use super::date::{WrittenDate, is_compact};
use super::day_time::{DayTime, HalfDay};
use super::zone::{self, WrittenZone};
use jiff::SignedDuration;
use jiff::civil::DateTime;
use std::borrow::Cow;

/// A date that is not ISO 8601, and a time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WrittenStamp {
    pub(super) date: WrittenDate,
    /// The time of day; a date alone has none.
    pub(super) time: Option<DayTime>,
    pub(super) zone: Option<WrittenZone>,
}

/// A time of day in one word.
struct ClockWord<'t> {
    time: DayTime,
    half: Option<HalfDay>,
    zone: Option<&'t str>,
}

impl<'t> ClockWord<'t> {
    fn of(word: &'t str, read: impl Fn(&str) -> Option<DayTime>) -> Option<Self> {
        let (time, half) = HalfDay::split(word);
        let (time, zone) = zone::split(time);
        let is_zone = zone.is_none_or(zone::is_zone);
        let time = read(time).filter(|_| is_zone)?;
        Some(Self { time, half, zone })
    }

    /// The place of the time among words, with the time; none where all are words of the date, or one is wrong.
    fn among(words: &[&'t str]) -> Option<(usize, Option<Self>)> {
        let begins = |word: &&str| word.starts_with(|c: char| c.is_ascii_digit());
        let colons = words
            .iter()
            .position(|word| begins(word) && word.contains(':'));
        if let Some(place) = colons {
            let clock = Self::of(words[place], DayTime::of_colons)?;
            return Some((place, Some(clock)));
        }
        // Without a colon the time stands behind the date.
        let Some((last, before)) = words.split_last() else {
            return Some((0, None));
        };
        let is_behind_date = matches!(before.len(), 1 | 3);
        let dotted = || Self::of(last, DayTime::of_dots);
        let compact = || {
            Self::of(last, DayTime::of_digits)
                .filter(|_| before.len() == 1 && is_compact(before[0]))
        };
        let clock = match is_behind_date {
            true => dotted().or_else(compact),
            false => None,
        };
        Some((before.len(), clock))
    }
}

impl WrittenStamp {
    /// The date and the time that a text is.
    pub(super) fn of(text: &str) -> Option<Self> {
        /// Longer texts are no date.
        const LONGEST: usize = 100;
        let text = text.trim();
        if text.len() > LONGEST || !text.contains(|c: char| c.is_ascii_digit()) {
            return None;
        }
        let (text, is_explained) = without_explanation(text);
        let text = separated(text);
        let mut words: Vec<&str> = text.split_whitespace().collect();
        if words.first().is_some_and(|word| is_weekday(word)) {
            words.remove(0);
        }
        let half = taken(&mut words, HalfDay::named);
        let mut zones = Vec::new();
        while let Some(zone) = words.iter().skip(1).position(|word| zone::is_zone(word)) {
            zones.push(words.remove(zone + 1));
        }
        let place_name = words.pop_if(|word| is_place(word));
        let (place, clock) = ClockWord::among(&words)?;
        let time = match clock {
            Some(clock) => {
                words.remove(place);
                zones.extend(clock.zone);
                if half.is_some() && clock.half.is_some() {
                    return None;
                }
                Some(clock.time.in_half(half.or(clock.half))?)
            }
            None if half.is_some() => return None,
            None => None,
        };
        let needs_offset = is_explained || place_name.is_some();
        let zone = match zones[..] {
            [] => None,
            _ => Some(WrittenZone::of(&zones)?),
        };
        let has_offset = matches!(zone, Some(WrittenZone::Ahead(_)));
        let of_year = WrittenDate::of_day_of_year(&words).filter(|_| time.is_some());
        let date = of_year.or_else(|| WrittenDate::of(&words))?;
        (has_offset || !needs_offset).then_some(Self { date, time, zone })
    }

    /// The local time; none where there is no such day or time.
    pub(super) fn local(&self, day_first: bool) -> Option<DateTime> {
        let date = self.date.civil(day_first)?;
        let time = self.time.unwrap_or_default();
        if time.is_end() {
            let midnight = date.at(0, 0, 0, 0);
            return midnight.checked_add(SignedDuration::from_hours(24)).ok();
        }
        let small = |number: u32| i8::try_from(number).ok();
        let nanosecond = i32::try_from(time.nanosecond).ok()?;
        let (hour, minute, second) = (small(time.hour)?, small(time.minute)?, small(time.second)?);
        let time = jiff::civil::Time::new(hour, minute, second, nanosecond).ok()?;
        Some(date.to_datetime(time))
    }
}

/// A text without what stands in parentheses behind it, and whether that is there: `(Central European Time)`.
fn without_explanation(text: &str) -> (&str, bool) {
    let explained = text
        .strip_suffix(')')
        .and_then(|text| text.rsplit_once(" ("));
    explained.map_or((text, false), |(text, _)| (text, true))
}

/// A text with blanks between a date and its time, and with the separators of dates and times.
fn separated(text: &str) -> Cow<'_, str> {
    let text = respelled(text);
    let bytes = text.as_bytes();
    let is_digit = |at: Option<usize>| {
        let byte = at.and_then(|at| bytes.get(at));
        byte.is_some_and(u8::is_ascii_digit)
    };
    let mut letters = text.match_indices('T').map(|(at, _)| at);
    match letters.find(|at| is_digit(at.checked_sub(1)) && is_digit(at.checked_add(1))) {
        Some(at) => Cow::Owned(format!("{} {}", &text[..at], &text[at + 1..])),
        None => text,
    }
}

/// A date of a controller, of East Asia, of digits alone or behind an apostrophe as others write it.
fn respelled(text: &str) -> Cow<'_, str> {
    if let Some(text) = of_controller(text) {
        return Cow::Owned(text);
    }
    if let Some(rest) = text.strip_prefix('\'') {
        // The apostrophe stands for the century of a year, or shows that the cell of a spreadsheet is text.
        let date = rest.split(' ').next().unwrap_or_default();
        let has_short_year = date.len() == 8 && date.find(['-', '/']) == Some(2);
        return match has_short_year {
            true => Cow::Owned(format!("20{rest}")),
            false => Cow::Borrowed(rest),
        };
    }
    if text.contains('年') {
        let signs = text.chars().map(|sign| match sign {
            '年' | '月' => '-',
            '日' | '秒' => ' ',
            '时' | '時' | '点' | '分' => ':',
            sign => sign,
        });
        let text: String = signs.collect();
        return Cow::Owned(text.trim_end_matches([' ', ':']).to_owned());
    }
    of_digits(text).map_or(Cow::Borrowed(text), Cow::Owned)
}

/// `DTL#2026-03-02-08:15:00` with a blank before its time.
fn of_controller(text: &str) -> Option<String> {
    /// Words of IEC 61131-3 before a date with a time.
    const WORDS: [&str; 5] = ["DT", "LDT", "DTL", "DATE_AND_TIME", "LDATE_AND_TIME"];
    let (word, stamp) = text.split_once('#')?;
    let is_stamp = WORDS.iter().any(|name| name.eq_ignore_ascii_case(word));
    let (behind_date, _) = stamp.match_indices('-').nth(2).filter(|_| is_stamp)?;
    let (date, time) = (stamp.get(..behind_date)?, stamp.get(behind_date + 1..)?);
    Some(format!("{date} {time}"))
}

/// `20260302081500`, with milliseconds or without, with a blank before its time.
fn of_digits(text: &str) -> Option<String> {
    let is_of_digits = text.bytes().all(|digit| digit.is_ascii_digit());
    let (date, time) = text.split_at_checked(8).filter(|_| is_of_digits)?;
    match time.split_at_checked(6)? {
        (time, "") => Some(format!("{date} {time}")),
        (time, fraction) if fraction.len() == 3 => Some(format!("{date} {time}.{fraction}")),
        _ => None,
    }
}

/// The first word that is something, taken out of the words.
fn taken<T>(words: &mut Vec<&str>, read: impl Fn(&str) -> Option<T>) -> Option<T> {
    let (place, value) = words
        .iter()
        .enumerate()
        .find_map(|(k, word)| Some((k, read(word)?)))?;
    words.remove(place);
    Some(value)
}

/// Whether a word is the English name of a day of the week, or its first three letters.
fn is_weekday(word: &str) -> bool {
    const DAYS: [&str; 7] = [
        "monday",
        "tuesday",
        "wednesday",
        "thursday",
        "friday",
        "saturday",
        "sunday",
    ];
    let word = word.trim_end_matches([',', '.']);
    let is_day = |day: &str| {
        let beginning = day.get(..word.len());
        let is_beginning = beginning.is_some_and(|start| start.eq_ignore_ascii_case(word));
        is_beginning && (word.len() == 3 || word.len() == day.len())
    };
    DAYS.iter().any(|day| is_day(day))
}

/// Whether a word is the name of a zone of the IANA database, or its last part: `New_York`.
fn is_place(word: &str) -> bool {
    word.starts_with(char::is_uppercase)
        && word.chars().all(|c| c.is_alphabetic() || "_/".contains(c))
}
