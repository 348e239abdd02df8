//! A date as people and programs write it.

use super::day_time::digits;
use jiff::civil::Date;

/// A date of three parts, of which the day and the month may be in doubt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WrittenDate {
    parts: [u32; 3],
    order: DateOrder,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum DateOrder {
    YearFirst,
    DayFirst,
    /// The day or the month.
    Unclear,
}

impl WrittenDate {
    /// The date in one word, or in three: a day, the name of a month and a year.
    pub(super) fn of(words: &[&str]) -> Option<Self> {
        match words {
            [word] => Self::of_word(word.trim_end_matches(',')),
            [first, second, third] => Self::of_names([first, second, third]),
            _ => None,
        }
    }

    fn of_word(word: &str) -> Option<Self> {
        if is_compact(word) {
            let parts = [word.get(..4)?, word.get(4..6)?, word.get(6..)?];
            return Self::of_digits(parts, DateOrder::YearFirst);
        }
        let separator = word.chars().find(|c| matches!(c, '.' | '/' | '-'))?;
        let mut fields = word.split(separator);
        let (first, second) = (fields.next()?, fields.next()?);
        let third = fields.next()?;
        if !fields.all(str::is_empty) {
            return None;
        }
        let fields = [first, second, third];
        let order = match separator {
            _ if first.len() == 4 => DateOrder::YearFirst,
            '.' => DateOrder::DayFirst,
            _ => DateOrder::Unclear,
        };
        Self::of_digits(fields, order).or_else(|| Self::of_names(fields))
    }

    fn of_digits(fields: [&str; 3], order: DateOrder) -> Option<Self> {
        let [first, second, third] = fields.map(digits);
        let parts = [first?, second?, third?];
        Some(Self { parts, order })
    }

    /// `02`, `Mar` and `2026`, or `Mar`, `2` and `2026`, or `2026`, `Mar` and `02`.
    fn of_names(fields: [&str; 3]) -> Option<Self> {
        let [first, second, third] = fields.map(|field| field.trim_end_matches(['.', ',']));
        if let Some(month) = month(second) {
            let parts = [digits(first)?, month, digits(third)?];
            let order = match first.len() {
                4 => DateOrder::YearFirst,
                _ => DateOrder::DayFirst,
            };
            return Some(Self { parts, order });
        }
        let parts = [digits(second)?, month(first)?, digits(third)?];
        // Any number of `Mar 02 03` may be the year.
        (third.len() == 4).then_some(Self {
            parts,
            order: DateOrder::DayFirst,
        })
    }

    /// `2026-061`: a year and the number of a day in it, which without a time may be anything.
    pub(super) fn of_day_of_year(words: &[&str]) -> Option<Self> {
        let [word] = words else {
            return None;
        };
        let (year, day) = word.split_once('-')?;
        if year.len() != 4 || day.len() != 3 {
            return None;
        }
        let first = Date::new(i16::try_from(digits(year)?).ok()?, 1, 1).ok()?;
        let day = digits(day).filter(|day| (1..=366).contains(day))?;
        let ahead = jiff::SignedDuration::from_hours(24 * (i64::from(day) - 1));
        let date = first.checked_add(ahead).ok()?;
        let part = |number: i8| u32::try_from(number).ok();
        let parts = [digits(year)?, part(date.month())?, part(date.day())?];
        (date.year() == first.year()).then_some(Self {
            parts,
            order: DateOrder::YearFirst,
        })
    }

    /// Whether the day stands before the month, where the text leaves no doubt.
    pub(super) fn day_first(&self) -> Option<bool> {
        match self.order {
            DateOrder::YearFirst | DateOrder::DayFirst => Some(true),
            DateOrder::Unclear if self.parts[0] > 12 => Some(true),
            DateOrder::Unclear if self.parts[1] > 12 => Some(false),
            DateOrder::Unclear => None,
        }
    }

    /// The date; none where there is no such day.
    pub(super) fn civil(&self, day_first: bool) -> Option<Date> {
        let [a, b, c] = self.parts;
        let (year, month, day) = match self.order {
            DateOrder::YearFirst => (a, b, c),
            DateOrder::DayFirst => (c, b, a),
            DateOrder::Unclear if day_first => (c, b, a),
            DateOrder::Unclear => (c, a, b),
        };
        let year = if year < 100 { year + 2000 } else { year };
        let small = |number: u32| i8::try_from(number).ok();
        Date::new(i16::try_from(year).ok()?, small(month)?, small(day)?).ok()
    }
}

/// Whether a word is eight digits, as which ISO 8601 writes a date without separators.
pub(super) fn is_compact(word: &str) -> bool {
    word.len() == 8 && word.bytes().all(|digit| digit.is_ascii_digit())
}

/// A month by the start of its English or German name.
pub(super) fn month(text: &str) -> Option<u32> {
    const MONTHS: [&str; 12] = [
        "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    ];
    const GERMAN: [(&str, u32); 5] = [("mär", 3), ("mrz", 3), ("mai", 5), ("okt", 10), ("dez", 12)];
    let start: String = text.chars().take(3).flat_map(char::to_lowercase).collect();
    let english = (1..).zip(MONTHS).map(|(number, name)| (name, number));
    let mut names = english.chain(GERMAN);
    names
        .find(|(name, _)| *name == start)
        .map(|(_, number)| number)
}
