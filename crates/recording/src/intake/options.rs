//! What a source does not say itself: options that come with it, and are kept with what was read.

use super::epochs::Epoch;
use super::error::{ReadError, ReadingFaults};
use super::format::Format;
use super::quality::Scheme;
use super::skipped_lines::SkippedLines;
use super::table_options::TableOptions;
use super::{encoding, offset, table_options, units};
use crate::{Interpolation, MIN_SAMPLES, RecordingSource, TimeAxis, Warning};
use greybox_numerics::parsing::Fault;
use greybox_numerics::parsing::reader::did_you_mean;
use jiff::tz::{Offset, TimeZone};
use std::collections::BTreeMap;

/// What the text itself does not say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// The name of the time column; the first column when absent.
    pub time: Option<String>,
    /// The name for the recording.
    pub name: Option<String>,
    pub(super) format: Option<Format>,
    pub(super) zone: Option<(String, TimeZone)>,
    pub(super) time_unit: Option<TimeUnit>,
    pub(super) decimal: Option<Decimal>,
    pub(super) encoding: Option<String>,
    pub(super) missing: Missing,
    pub(super) ignore: Vec<String>,
    pub(super) units: BTreeMap<String, String>,
    pub(super) rename: BTreeMap<String, String>,
    pub(super) quality_scheme: Option<Scheme>,
    pub(super) interpolation: BTreeMap<String, Interpolation>,
    /// For signals that `interpolation` does not name.
    pub(super) all_interpolation: Option<Interpolation>,
    pub(super) grid: Option<GridOption>,
    /// The worksheet of a workbook.
    pub(super) sheet: Option<String>,
    pub(super) table: TableOptions,
    /// The lines that are left out of the text.
    pub(super) skip: SkippedLines,
    pub(super) purpose: ReadingPurpose,
    /// When the numbers of a time begin, as the head of the text has it.
    pub(super) begin: Option<String>,
    pub(super) given: BTreeMap<String, String>,
}

/// What samples are read for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReadingPurpose {
    /// A recording: its signals share their instants.
    #[default]
    Recording,
    /// A batch of a stream: each sample keeps the instant at which it was taken, and one sample is
    /// enough. Of two statements about one instant the later one counts, as between two batches.
    Stream,
}

impl ReadingPurpose {
    /// The fewest instants that a source must have.
    pub(super) fn least_instants(self) -> usize {
        match self {
            Self::Recording => MIN_SAMPLES,
            Self::Stream => 1,
        }
    }

    /// The axis of strictly increasing instants that begin at 0. `scale` is the largest number
    /// that the source wrote for a time `[s]`.
    pub(super) fn axis(self, instants: Vec<f64>, scale: f64) -> TimeAxis {
        match self {
            Self::Recording => TimeAxis::from_instants(instants, scale),
            Self::Stream => TimeAxis::Instants(instants),
        }
    }

    /// Says what became of samples that had the time of another one.
    pub(super) fn duplicate_time(self, samples: usize) -> Warning {
        let detail = match self {
            Self::Recording => {
                format!("{samples} samples dropped that had the time of the one before")
            }
            Self::Stream => format!(
                "{samples} samples had the time of another one of the batch; the later ones count"
            ),
        };
        Warning::of_recording("duplicate_time", detail)
    }

    /// Whether the later one of two statements about one instant counts.
    pub(super) fn is_later_right(self) -> bool {
        self == Self::Stream
    }
}

/// What the numbers of a time are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TimeUnit {
    /// Numbers whose unit is this many seconds.
    Seconds(f64),
    /// Numbers that count from an instant of their own.
    Counted(Epoch),
    /// Not numbers: dates whose day stands before the month, or behind it.
    Dates { day_first: bool },
}

/// What separates a number's whole part from its fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decimal {
    Point,
    Comma,
}

/// What stands for a sample that is missing, as it was recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Missing {
    pub(super) words: Vec<String>,
    pub(super) numbers: Vec<f64>,
    /// All other numbers are values, even where they look as if they stood for none.
    pub(super) keeps_sentinels: bool,
}

/// The instants that sources of different instants are put on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum GridOption {
    /// The instants of all signals together; a signal is missing where it has no sample.
    None,
    /// Every so many seconds.
    Every(f64),
}

impl Options {
    /// Whether an option says what numbers of time are.
    pub(super) fn says_numbers_of_time(&self) -> bool {
        let is_of_numbers = |unit: &TimeUnit| !matches!(unit, TimeUnit::Dates { .. });
        self.time_unit.as_ref().is_some_and(is_of_numbers)
    }

    /// The options by their names but for `time`, in the order in which a digest counts them.
    pub const NAMES: [&'static str; 19] = [
        "format",
        "tz",
        "time_unit",
        "decimal",
        "encoding",
        "missing",
        "ignore",
        "units",
        "rename",
        "quality_scheme",
        "interpolation",
        "grid",
        "sheet",
        "header_row",
        "unit_row",
        "tag",
        "value",
        "quality",
        "skip",
    ];

    /// Sets the option of that name.
    ///
    /// # Errors
    /// A sentence on what is wrong with `text`.
    pub fn set(&mut self, option: &str, text: &str) -> Result<(), String> {
        match option {
            "time" => {
                self.time = Some(text.to_owned());
                return Ok(());
            }
            "format" => self.format = Some(Format::named(text)?),
            "tz" => self.zone = Some(zone(text)?),
            "time_unit" => self.time_unit = Some(time_unit(text)?),
            "decimal" => self.decimal = Some(decimal(text)?),
            "encoding" => {
                encoding::named(text)?;
                self.encoding = Some(text.to_owned());
            }
            "missing" => self.missing = missing(text),
            "ignore" => self.ignore = list(text)?,
            "units" => {
                self.units = pairs(text)?;
                let unknown = self
                    .units
                    .values()
                    .find(|unit| units::parse(unit).is_none());
                if let Some(unit) = unknown {
                    return Err(units::unknown(unit, units::UNITS_OPTION));
                }
            }
            "rename" => self.rename = pairs(text)?,
            "quality_scheme" => self.quality_scheme = Some(Scheme::named(text)?),
            "interpolation" => self.set_interpolation(text)?,
            "grid" => self.grid = Some(grid(text)?),
            "sheet" => self.sheet = Some(text.to_owned()),
            "header_row" => self.table.header_row = Some(table_options::named_row(text)?),
            "unit_row" => self.table.unit_row = Some(table_options::named_row(text)?),
            "tag" => self.table.tag = Some(text.to_owned()),
            "value" => self.table.values = list(text)?,
            "quality" => self.table.quality = Some(text.to_owned()),
            "skip" => self.skip = SkippedLines::named(text)?,
            _ => return Err(format!("there is no option `{option}`")),
        }
        self.given.insert(option.to_owned(), text.to_owned());
        Ok(())
    }

    /// Says what samples are read for.
    #[must_use]
    pub fn for_purpose(self, purpose: ReadingPurpose) -> Self {
        Self { purpose, ..self }
    }

    /// Whether an option asks for other instants than those of the samples.
    #[must_use]
    pub fn asks_for_a_grid(&self) -> bool {
        matches!(self.grid, Some(GridOption::Every(_)))
    }

    /// What the type of a body says of its encoding, where no option does. A name that is not known
    /// is left to the text itself.
    pub fn assume_encoding(&mut self, charset: &str) {
        let is_known = encoding::named(charset).is_ok();
        self.encoding = self
            .encoding
            .take()
            .or(is_known.then(|| charset.to_owned()));
    }

    /// Refuses options that would do nothing.
    pub(super) fn refuse(&self, useless: &[&str], format: &str) -> Result<(), ReadError> {
        let mut faults = ReadingFaults::default();
        let is_given = |option: &&&str| {
            self.given.contains_key(**option) || (**option == "time" && self.time.is_some())
        };
        for option in useless.iter().filter(is_given) {
            let detail = format!("`{option}` says nothing about {format}");
            faults.invalid(Fault::of_parameter(option, "invalid_parameter", detail));
        }
        faults.result()
    }

    /// The options for the rows of a file that is no text, once they are text.
    #[cfg(any(feature = "excel", feature = "parquet"))]
    pub(super) fn of_rows(&self) -> Self {
        let mut options = self.clone();
        options.sheet = None;
        options.given.remove("sheet");
        options
    }

    /// What is kept of them beside what was read.
    pub(super) fn source(&self, format: &str) -> RecordingSource {
        let mut options = self.given.clone();
        if let Some(time) = &self.time {
            options.insert("time".to_owned(), time.clone());
        }
        RecordingSource {
            format: format.to_owned(),
            options,
        }
    }

    fn set_interpolation(&mut self, text: &str) -> Result<(), String> {
        let of = |text: &str| match text {
            "hold" => Ok(Interpolation::Hold),
            "linear" => Ok(Interpolation::Linear),
            word => Err(format!("`{word}` is neither hold nor linear")),
        };
        if !text.contains(':') {
            self.all_interpolation = Some(of(text)?);
            return Ok(());
        }
        for (name, text) in pairs(text)? {
            self.interpolation.insert(name, of(&text)?);
        }
        Ok(())
    }

    /// How the signal of that name goes on between samples, where an option says so.
    pub(super) fn interpolation_of(&self, name: &str) -> Option<Interpolation> {
        let named = self.interpolation.get(name).copied();
        named.or(self.all_interpolation)
    }

    /// Refuses options that speak of signals that there are not.
    pub(super) fn check_names(&self, names: &[&str], faults: &mut ReadingFaults) {
        for (option, name) in self.named_signals() {
            let renamed = self.rename.values().any(|new| new == name);
            if !names.contains(&name.as_str()) && !renamed {
                let hint = did_you_mean(name, names.iter().copied());
                let detail = format!("there is no signal `{name}`{hint}");
                faults.invalid(Fault::of_parameter(option, "unknown_signal", detail));
            }
        }
    }

    /// The names that options speak of, each with its option.
    fn named_signals(&self) -> impl Iterator<Item = (&'static str, &String)> {
        let ignore = self.ignore.iter().map(|name| ("ignore", name));
        let units = self.units.keys().map(|name| ("units", name));
        let rename = self.rename.keys().map(|name| ("rename", name));
        let interpolation = self.interpolation.keys();
        let interpolation = interpolation.map(|name| ("interpolation", name));
        ignore.chain(units).chain(rename).chain(interpolation)
    }
}

/// The name of a time zone with the zone: one of the IANA database, or an offset from UTC.
fn zone(text: &str) -> Result<(String, TimeZone), String> {
    // A plus that stands in a query as it is arrives as a blank.
    let ahead = offset::seconds(&text.replacen(' ', "+", 1));
    if let Some(seconds) = ahead
        && let Ok(ahead) = Offset::from_seconds(seconds)
    {
        return Ok((offset::written(seconds), TimeZone::fixed(ahead)));
    }
    let zone = TimeZone::get(text).map_err(|_| {
        format!(
            "`{text}` is no time zone of the IANA database, such as Europe/Berlin or UTC, nor an offset such as +01:00"
        )
    })?;
    Ok((text.to_owned(), zone))
}

fn time_unit(text: &str) -> Result<TimeUnit, String> {
    match text {
        "dmy" => return Ok(TimeUnit::Dates { day_first: true }),
        "mdy" => return Ok(TimeUnit::Dates { day_first: false }),
        _ => {}
    }
    if let Some(epoch) = Epoch::named(text) {
        return Ok(TimeUnit::Counted(epoch));
    }
    duration(text).map(TimeUnit::Seconds).ok_or_else(|| {
        format!(
            "`{text}` is no unit of time ({}), sample time (such as 10ms), `excel`, `datenum`, `julian`, \
             `labview`, `filetime`, `ticks`, `dmy` or `mdy`",
            units::known_times()
        )
    })
}

/// `10ms`, `0.5 s` or `ms`, in seconds.
fn duration(text: &str) -> Option<f64> {
    let is_unit = |c: char| c.is_alphabetic();
    let (number, unit) = text.split_at(text.find(is_unit)?);
    let number = match number.trim() {
        "" => 1.0,
        number => number.parse::<f64>().ok()?,
    };
    let seconds = number * units::parse_time(unit.trim())?.factor;
    (seconds.is_finite() && seconds > 0.0).then_some(seconds)
}

fn grid(text: &str) -> Result<GridOption, String> {
    if text == "none" {
        return Ok(GridOption::None);
    }
    let rate = text
        .strip_suffix("Hz")
        .map(|rate| rate.trim().parse::<f64>());
    let seconds = match rate {
        Some(Ok(rate)) if rate.is_finite() && rate > 0.0 => Some(1.0 / rate),
        Some(_) => None,
        None => duration(text),
    };
    let seconds = seconds.ok_or_else(|| {
        format!("`{text}` is neither `none` nor a sample time or rate, such as 10ms or 100Hz")
    })?;
    Ok(GridOption::Every(seconds))
}

fn decimal(text: &str) -> Result<Decimal, String> {
    match text {
        "." | "point" => Ok(Decimal::Point),
        "," | "comma" => Ok(Decimal::Comma),
        word => Err(format!("`{word}` is neither `,` nor `.`")),
    }
}

fn missing(text: &str) -> Missing {
    let mut missing = Missing::default();
    for item in text
        .split(',')
        .map(str::trim)
        .filter(|item| !item.is_empty())
    {
        match item.parse::<f64>() {
            Ok(number) => missing.numbers.push(number),
            Err(_) if item == "none" => missing.keeps_sentinels = true,
            Err(_) => missing.words.push(item.to_lowercase()),
        }
    }
    missing
}

/// `a,b`, or a JSON array where names have commas in them.
fn list(text: &str) -> Result<Vec<String>, String> {
    if text.starts_with('[') {
        return serde_json::from_str(text).map_err(|error| format!("not a JSON array: {error}"));
    }
    let names = text.split(',').map(|name| name.trim().to_owned());
    Ok(names.filter(|name| !name.is_empty()).collect())
}

/// `a:bar,b:mm`, or a JSON object where names have commas in them.
fn pairs(text: &str) -> Result<BTreeMap<String, String>, String> {
    if text.starts_with('{') {
        return serde_json::from_str(text).map_err(|error| format!("not a JSON object: {error}"));
    }
    let items = text
        .split(',')
        .map(str::trim)
        .filter(|item| !item.is_empty());
    let pair = |item: &str| {
        let (name, value) = item
            .rsplit_once(':')
            .ok_or_else(|| format!("`{item}` is not written as name:value"))?;
        Ok((name.trim().to_owned(), value.trim().to_owned()))
    };
    items.map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(option: &str, text: &str) -> Result<Options, String> {
        let mut options = Options::default();
        options.set(option, text).map(|()| options)
    }

    #[test]
    fn options_are_understood_and_kept_as_they_came() {
        let options = with("time_unit", "10ms").unwrap();
        assert_eq!(options.time_unit, Some(TimeUnit::Seconds(0.01)));
        assert_eq!(options.source("x").options["time_unit"], "10ms");
        assert_eq!(
            with("grid", "50 Hz").unwrap().grid,
            Some(GridOption::Every(0.02))
        );
        assert_eq!(with("grid", "none").unwrap().grid, Some(GridOption::None));
        let missing = with("missing", "-9999, Bad").unwrap().missing;
        assert_eq!(
            (missing.numbers, missing.words),
            (vec![-9999.0], vec!["bad".to_owned()])
        );
        let units = with("units", r#"{"a,b:c": "bar"}"#).unwrap().units;
        assert_eq!(units["a,b:c"], "bar");
        let held = with("interpolation", "u:hold").unwrap();
        assert_eq!(held.interpolation_of("u"), Some(Interpolation::Hold));
        assert_eq!(held.interpolation_of("y"), None);
    }

    #[test]
    fn a_zone_may_be_an_offset() {
        for (text, name) in [
            ("+01:00", "+01:00"),
            (" 01:00", "+01:00"),
            ("-0500", "-05:00"),
            ("Etc/GMT-1", "Etc/GMT-1"),
        ] {
            let (zone, _) = with("tz", text).unwrap().zone.unwrap();
            assert_eq!(zone, name);
        }
        assert!(with("tz", "GMT+1").is_err(), "programs differ in its sign");
    }

    #[test]
    fn what_is_not_understood_is_told_with_an_example() {
        for (option, text, part) in [
            ("tz", "Mars/Olympus", "Europe/Berlin"),
            ("time_unit", "parsec", "10ms"),
            ("decimal", "x", "`,`"),
            ("encoding", "klingon", "windows-1252"),
            ("units", "p:parsec", "parsec"),
            ("units", "p", "name:value"),
            ("interpolation", "cubic", "hold"),
            ("grid", "-1s", "100Hz"),
            ("quality_scheme", "x", "opc_da"),
            ("format", "x", "long_csv"),
        ] {
            let detail = with(option, text).expect_err(text);
            assert!(detail.contains(part), "{option}={text}: {detail}");
        }
    }
}
