//! Times of any spelling, in seconds from the first one: numbers in a unit of time, Unix times,
//! serial days of a spreadsheet, timestamps with an offset or in a zone. The first decides which.
//!
//! The unit of numbers is that of the option, else that of the header, else what the size of
//! the numbers leaves no doubt about; else it is asked for.

mod local;
mod midnight;
pub(super) mod names;
mod notes;
mod spelling;

use super::cell::Cell;
use super::epochs::{Epoch, UNIX, UNIX_SCALES};
use super::options::{Options, TimeUnit};
use super::stamp::{self, Stamp};
use super::units;
use super::value::number;
use crate::{DoubleHour, TICK, nanoseconds};
use jiff::Timestamp;
use jiff::tz::TimeZone;
use names::{COUNTERS, TIMES};
use spelling::Spelling;
use std::borrow::Cow;

/// Nanoseconds of a second.
const NANOSECONDS: f64 = 1e9;

/// A code and a sentence.
pub(super) type ClockFault = (&'static str, String);

/// Reads the times of one source.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    /// The name that the source has for the time.
    name: String,
    /// The unit in the header.
    recorded_unit: String,
    /// Somebody said that this column is the time.
    is_said: bool,
    options: ClockOptions,
    kind: Option<TimeKind>,
    /// How many local times came twice because clocks were set back.
    folds: usize,
    /// The hour that came twice, as long as no order of times told its two passes apart.
    double_hour: Option<DoubleHour>,
    is_told_by_order: bool,
    /// Whether the times are texts without a date: hours, minutes and seconds, or numbers with their unit.
    is_span: bool,
    /// Whether the times are hours, minutes and seconds without a date.
    lacks_date: bool,
    /// How many midnights times of day without a date have passed.
    midnights: usize,
    /// When the first time that is a number of seconds was, as the head of the source has it: nanoseconds since 1970.
    begin: Option<i64>,
    /// Whether a time is no multiple of [`TICK`].
    is_fine: bool,
    /// The longest time from the first to another one `[s]`.
    farthest: f64,
    guessed_unit: Option<&'static str>,
    /// Nothing says the unit of the numbers, which were read as seconds.
    are_supposed_seconds: bool,
    offset: Option<String>,
}

#[derive(Clone, Debug)]
struct ClockOptions {
    zone: Option<(String, TimeZone)>,
    unit: Option<TimeUnit>,
    decimal: Option<super::options::Decimal>,
    /// When the numbers of the time begin.
    begin: Option<String>,
}

/// What the times turned out to be.
#[derive(Clone, Copy, Debug)]
enum TimeKind {
    /// Numbers of so many seconds from an instant that nobody knows.
    Relative {
        factor: f64,
        first: f64,
        largest: f64,
    },
    /// Instants, in nanoseconds of Unix time.
    Absolute { spelling: Spelling, first: i64 },
}

impl TimeKind {
    /// Numbers of so many seconds that begin with this one.
    fn since(first: f64, factor: f64) -> Self {
        Self::Relative {
            factor,
            first,
            largest: first.abs(),
        }
    }
}

impl Clock {
    pub(super) fn new(name: &str, recorded_unit: &str, options: &Options) -> Self {
        Self {
            name: name.to_owned(),
            recorded_unit: recorded_unit.to_owned(),
            is_said: options.time.is_some(),
            options: ClockOptions {
                zone: options.zone.clone(),
                unit: options.time_unit,
                decimal: options.decimal,
                begin: options.begin.clone(),
            },
            kind: None,
            folds: 0,
            double_hour: None,
            is_told_by_order: false,
            is_span: false,
            lacks_date: false,
            midnights: 0,
            begin: None,
            is_fine: false,
            farthest: 0.0,
            guessed_unit: None,
            are_supposed_seconds: false,
            offset: None,
        }
    }

    /// Learns from times further down whether the day or the month comes first.
    pub(super) fn look_ahead<'t>(&mut self, mut times: impl Iterator<Item = &'t str>) {
        if self.options.unit.is_none()
            && let Some(day_first) = times.find_map(stamp::day_first)
        {
            self.options.unit = Some(TimeUnit::Dates { day_first });
        }
    }

    /// A time in seconds from the first that was read. `before` is the time of the sample before it
    /// in its series, which tells apart the two passes of a local hour that came twice.
    ///
    /// # Errors
    /// A sentence on what is wrong with it.
    pub(super) fn read(&mut self, cell: &Cell<'_>, before: Option<f64>) -> Result<f64, ClockFault> {
        if matches!(cell, Cell::Empty) || matches!(cell, Cell::Text(text) if text.trim().is_empty())
        {
            return Err(("missing_time", "there are values but no time".to_owned()));
        }
        let mut kind = match self.kind {
            Some(kind) => kind,
            None => self.first(cell)?,
        };
        let seconds = match &mut kind {
            TimeKind::Relative {
                factor,
                first,
                largest,
            } => {
                let value = self.number(cell)?;
                let value = self.on_its_day(value, *first, before);
                *largest = largest.max(value.abs());
                (value - *first) * *factor
            }
            TimeKind::Absolute { spelling, first } => {
                let before = before.map(|before| first.saturating_add(nanoseconds(before)));
                let instant = self.instant(cell, *spelling, before)?;
                self.is_fine |= instant % TICK != 0;
                let seconds = (instant - *first) as f64 / NANOSECONDS;
                self.farthest = self.farthest.max(seconds.abs());
                seconds
            }
        };
        if !seconds.is_finite() {
            return Err(not_a_time(cell));
        }
        self.kind = Some(kind);
        Ok(seconds)
    }

    /// The instant of the time `from` `[s]` after the first that was read, nanoseconds since 1970.
    fn start_ns(&self, from: f64) -> Option<i64> {
        match self.kind? {
            TimeKind::Absolute { first, .. } => first.checked_add(nanoseconds(from)),
            TimeKind::Relative { .. } => self.begin?.checked_add(nanoseconds(from)),
        }
    }

    /// The instant of the time `from` `[s]` after the first that was read.
    pub(super) fn start(&self, from: f64) -> Option<Timestamp> {
        Timestamp::from_nanosecond(self.start_ns(from)?.into()).ok()
    }

    /// The hour that came twice, where the earliest time, `from` `[s]` after the first that was
    /// read, lies in it and nothing told which of its two passes the times are of. They were taken
    /// for times of the first.
    pub(super) fn double_hour(&self, from: f64) -> Option<DoubleHour> {
        let earliest = self.start_ns(from)?;
        let hour = self.double_hour.filter(|_| !self.is_told_by_order)?;
        hour.first_pass().contains(&earliest).then_some(hour)
    }

    /// Whether the times are instants of Unix time, exact to the nanosecond.
    pub(super) fn is_absolute(&self) -> bool {
        matches!(self.kind, Some(TimeKind::Absolute { .. }))
    }

    /// The zone in which the source counted, where it is not UTC.
    pub(super) fn zone(&self) -> Option<String> {
        let declared = self.options.zone.as_ref().map(|(name, _)| name.clone());
        match self.kind {
            Some(TimeKind::Relative { .. }) if self.begin.is_none() => None,
            Some(_) => declared.or_else(|| self.offset.clone()),
            None => None,
        }
    }

    /// The largest number that was read `[s]`.
    pub(super) fn scale(&self) -> f64 {
        match self.kind {
            Some(TimeKind::Relative {
                factor, largest, ..
            }) => largest * factor,
            _ => 0.0,
        }
    }

    fn number(&self, cell: &Cell<'_>) -> Result<f64, ClockFault> {
        let number = match cell {
            Cell::Integer(number) => Some(*number as f64),
            Cell::Number(number) => Some(*number),
            Cell::Text(text) if self.is_span => stamp::span(text, self.options.decimal),
            Cell::Text(text) => number(text.trim(), self.options.decimal),
            _ => None,
        };
        number
            .filter(|number| number.is_finite())
            .ok_or_else(|| not_a_time(cell))
    }

    /// What the first time tells about all of them.
    fn first(&mut self, cell: &Cell<'_>) -> Result<TimeKind, ClockFault> {
        let spelling = match cell {
            Cell::Text(text) if let Some(first) = stamp::span(text, self.options.decimal) => {
                self.refuse_unit_of_stamps(text)?;
                self.is_span = true;
                self.lacks_date = text.contains(':');
                return Ok(TimeKind::since(first, 1.0));
            }
            Cell::Text(text) if stamp::looks_like_one(text) => {
                self.refuse_unit_of_stamps(text)?;
                let day_first = match self.options.unit {
                    Some(TimeUnit::Dates { day_first }) => Some(day_first),
                    _ => None,
                };
                Spelling::Stamp { day_first }
            }
            _ if self.is_of_digits(cell) => {
                self.guessed_unit = Some("dates of digits alone (yyyymmddhhmmss)");
                Spelling::Stamp { day_first: None }
            }
            _ => match self.numbers(self.number(cell)?)? {
                TimeNumbers::Instants(spelling) => spelling,
                TimeNumbers::Seconds(factor) => {
                    let first = self.number(cell)?;
                    self.begin = self.begin_of_numbers(first * factor)?;
                    return Ok(TimeKind::since(first, factor));
                }
            },
        };
        let first = self.instant(cell, spelling, None)?;
        Ok(TimeKind::Absolute { spelling, first })
    }

    /// Whether a number is a date of digits alone, and nothing says its unit.
    fn is_of_digits(&self, cell: &Cell<'_>) -> bool {
        let has_unit = !matches!(self.options.unit, None | Some(TimeUnit::Dates { .. }));
        let text = cell.to_string();
        !has_unit && stamp::is_of_digits(&text) && self.refuse_unit_of_stamps(&text).is_ok()
    }

    fn refuse_unit_of_stamps(&self, text: &str) -> Result<(), ClockFault> {
        let named = self.recorded_unit.to_ascii_lowercase().replace(' ', "");
        if matches!(
            named.as_str(),
            "" | "rfc3339" | "iso8601" | "utc" | "datetime"
        ) || stamp::is_pattern(&self.recorded_unit)
            || text.trim().ends_with(&self.recorded_unit)
        {
            return Ok(());
        }
        let unit = &self.recorded_unit;
        let detail = format!(
            "`{}` is a timestamp, but the column's unit is `{unit}`",
            text.trim()
        );
        Err(("unknown_unit", detail))
    }

    /// What numbers of this size are.
    fn numbers(&mut self, value: f64) -> Result<TimeNumbers, ClockFault> {
        let factor = match self.options.unit {
            Some(TimeUnit::Seconds(factor)) => Some(factor),
            Some(TimeUnit::Counted(epoch)) => return Ok(TimeNumbers::Instants(epoch.into())),
            Some(TimeUnit::Dates { .. }) | None if !self.recorded_unit.is_empty() => {
                let unit = units::parse_time(&self.recorded_unit).ok_or_else(|| {
                    let (unit, known_units) = (&self.recorded_unit, units::known_times());
                    let detail = format!("unit `{unit}` is not a time; known: {known_units}");
                    ("unknown_unit", detail)
                })?;
                Some(unit.factor)
            }
            _ => None,
        };
        let is_said = matches!(self.options.unit, Some(TimeUnit::Seconds(_)));
        let is_whole = factor.is_none_or(|factor| factor == 1.0);
        if !is_said && is_whole && Epoch::LabView.numbers().contains(&value) {
            return self.asked("may be seconds since 1904 (LabVIEW) or Unix times after 2055");
        }
        let unix = |factor: f64| TimeNumbers::Instants(Spelling::Unix { before: 0, factor });
        if let Some(factor) = factor {
            return Ok(match UNIX.contains(&(value * factor)) {
                true => unix(factor),
                false => TimeNumbers::Seconds(factor),
            });
        }
        // Ticks of today are Unix nanoseconds of 1990, in which nobody records to the nanosecond.
        let of_windows = [Epoch::FileTime, Epoch::Ticks];
        let mut of_windows = of_windows.into_iter();
        if let Some(epoch) = of_windows.find(|epoch| epoch.numbers().contains(&value)) {
            self.guessed_unit = Some(epoch.words());
            return Ok(TimeNumbers::Instants(epoch.into()));
        }
        for (factor, name) in UNIX_SCALES {
            if UNIX.contains(&(value * factor)) {
                self.guessed_unit = Some(name);
                return Ok(unix(factor));
            }
        }
        self.small_numbers(value)
    }

    /// The fault that asks what the numbers of the time are.
    fn asked(&self, what: &str) -> Result<TimeNumbers, ClockFault> {
        let epochs = Epoch::OF_PROGRAMS.map(|epoch| format!("`{}`", epoch.option()));
        let detail = format!(
            "`{}` {what}; say what its numbers are with `time_unit`: a unit (s, ms, …), the sample time of a \
             counter (10ms), `excel` or {}",
            self.name,
            epochs.join(", ")
        );
        Err(("time_unit_needed", detail))
    }

    /// What numbers without a unit are that are no Unix times.
    fn small_numbers(&mut self, value: f64) -> Result<TimeNumbers, ClockFault> {
        let letters = self.name.chars().filter(|c| c.is_alphanumeric());
        let name: String = letters.flat_map(char::to_lowercase).collect();
        for epoch in [Epoch::Excel, Epoch::Datenum, Epoch::Julian] {
            if !epoch.numbers().contains(&value) {
                continue;
            }
            if epoch.is_named_by(&name) {
                self.guessed_unit = Some(epoch.words());
                return Ok(TimeNumbers::Instants(epoch.into()));
            }
            if epoch != Epoch::Excel || value.fract() != 0.0 {
                return self.asked(&format!("may be {} or seconds", epoch.words()));
            }
        }
        if COUNTERS.contains(&name.as_str()) && !self.is_said {
            return self.asked("counts samples");
        }
        if TIMES.contains(&name.as_str()) || self.is_said {
            self.are_supposed_seconds = true;
            return Ok(TimeNumbers::Seconds(1.0));
        }
        self.asked("does not say its unit")
    }

    /// An instant in nanoseconds of Unix time.
    fn instant(
        &mut self,
        cell: &Cell<'_>,
        spelling: Spelling,
        before: Option<i64>,
    ) -> Result<i64, ClockFault> {
        match spelling {
            Spelling::Unix {
                before: earlier,
                factor,
            } => {
                if earlier == 0
                    && factor == 1.0
                    && let Some(instant) = spelling::unix_with_nanoseconds(cell)
                {
                    return Ok(instant);
                }
                let exact = match cell {
                    Cell::Integer(number) => Some(*number),
                    Cell::Text(text) => text.trim().parse().ok(),
                    _ => None,
                };
                let whole = (factor * NANOSECONDS).round() as i64;
                let exact =
                    exact.and_then(|number: i64| number.checked_sub(earlier)?.checked_mul(whole));
                // A double of a Unix time in seconds is good to a quarter of a microsecond.
                let rounded = || {
                    let number = self.number(cell)? - earlier as f64;
                    Ok((number * factor * 1e6).round() as i64 * 1000)
                };
                exact.map_or_else(rounded, Ok)
            }
            Spelling::Days { before: earlier } => {
                // Spreadsheets write days to eleven digits or so behind the point: a microsecond.
                let days = self.number(cell)? - earlier;
                let tens_of_microseconds = (days * 86_400e5).round() as i64;
                let microseconds = tens_of_microseconds.saturating_mul(10);
                let local =
                    stamp::from_serial_days(microseconds).ok_or_else(|| not_a_time(cell))?;
                self.local(local, cell, before)
            }
            Spelling::Stamp { day_first } => self.stamp(cell, day_first, before),
        }
    }

    fn stamp(
        &mut self,
        cell: &Cell<'_>,
        day_first: Option<bool>,
        before: Option<i64>,
    ) -> Result<i64, ClockFault> {
        let text = match cell {
            Cell::Text(text) => Cow::Borrowed(text.trim()),
            Cell::Integer(_) | Cell::Number(_) => Cow::Owned(cell.to_string()),
            _ => return Err(not_a_time(cell)),
        };
        match stamp::parse(&text, day_first)? {
            Stamp::Instant(instant, offset) => {
                if self.kind.is_none() {
                    self.offset = offset;
                }
                unix_nanoseconds(instant).ok_or_else(|| not_a_time(cell))
            }
            Stamp::Local(local) => self.local(local, cell, before),
            Stamp::Lettered(local, letters) => self.lettered(local, &letters),
        }
    }
}

/// What the numbers of a time turned out to be.
enum TimeNumbers {
    Seconds(f64),
    Instants(Spelling),
}

fn unix_nanoseconds(instant: Timestamp) -> Option<i64> {
    i64::try_from(instant.as_nanosecond()).ok()
}

fn not_a_time(cell: &Cell<'_>) -> ClockFault {
    let detail = format!(
        "`{}` is neither a finite number nor a timestamp such as 2026-03-02T08:15:00Z",
        cell
    );
    ("not_a_time", detail)
}

#[cfg(test)]
mod tests;
