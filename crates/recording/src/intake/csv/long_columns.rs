//! What the columns of a table are whose rows name their signals.

use super::super::error::{ReadError, excerpt, invalid};
use super::super::layout::ColumnRole;
use super::super::options::Options;
use super::super::quality::{Scheme, word};
use super::super::{title, value};
use super::fields::{all_fields, count_up, is_called_time, is_number};
use crate::{Class, Warning};
use greybox_numerics::parsing::Fault;
use greybox_numerics::parsing::reader::did_you_mean;
use std::collections::HashSet;

const TIMES: [&str; 14] = [
    "timestring",
    "timestamp",
    "datetime",
    "time",
    "tstamp",
    "ts",
    "date",
    "sourcetimestamp",
    "lastchanged",
    "lastupdated",
    "iptrendtime",
    "timestampseconds",
    "timeinseconds",
    "timestamps",
];
const TAGS: [&str; 27] = [
    "tag",
    "tagname",
    "tagpath",
    "fqn",
    "signal",
    "point",
    "pointname",
    "variable",
    "series",
    "sensor",
    "channel",
    "name",
    "path",
    "tagid",
    "metric",
    "device",
    "item",
    "measurement",
    "messstelle",
    "messpunkt",
    "kanal",
    "topic",
    "entityid",
    "sensorid",
    "varname",
    "tagindex",
    "alias",
];
const VALUES: [&str; 17] = [
    "value",
    "val",
    "v",
    "vvalue",
    "reading",
    "floatvalue",
    "wert",
    "messwert",
    "avg",
    "average",
    "mean",
    "data",
    "payload",
    "state",
    "varvalue",
    "iptrendvalue",
    "doublevalue",
];
const QUALITIES: [(&str, Option<Scheme>); 26] = [
    ("opcquality", Some(Scheme::OpcDa)),
    ("qualitydetail", Some(Scheme::AvevaQualityDetail)),
    ("quality", None),
    ("qualitycode", None),
    ("status", None),
    ("q", None),
    ("dataquality", None),
    ("qualitytext", None),
    ("qualitydescription", None),
    ("tagquality", None),
    ("valuequality", None),
    ("valuestatus", None),
    ("pointstatus", None),
    ("qualität", None),
    ("qualitaet", None),
    ("güte", None),
    ("statuscode", None),
    ("isgood", Some(Scheme::IsGood)),
    ("good", Some(Scheme::IsGood)),
    ("isvalid", Some(Scheme::IsGood)),
    ("valid", Some(Scheme::IsGood)),
    ("validity", Some(Scheme::IsGood)),
    ("iptrendqstatus", None),
    ("bad", Some(Scheme::IsBad)),
    ("isbad", Some(Scheme::IsBad)),
    ("questionable", Some(Scheme::IsBad)),
];
const UNITS: [&str; 5] = ["unit", "units", "uom", "engunits", "unitsabbreviation"];

/// Where in a row things stand.
#[derive(Clone, Debug)]
pub(in crate::intake) struct LongColumns {
    pub(in crate::intake) time: usize,
    pub(in crate::intake) tag: usize,
    /// One column, or several whose titles are a part of the names of the signals.
    pub(in crate::intake) values: Vec<usize>,
    pub(in crate::intake) quality: Option<(usize, Option<Scheme>)>,
    pub(in crate::intake) unit: Option<usize>,
}

/// The titles of a table in small letters, without units and signs.
struct PlainTitles(Vec<String>);

impl PlainTitles {
    fn of(titles: &[&str]) -> Self {
        let plain = |title: &&str| -> String {
            let (name, _) = title::name_and_unit(title);
            let letters = name.chars().filter(|c| c.is_alphanumeric());
            letters.flat_map(char::to_lowercase).collect()
        };
        Self(titles.iter().map(plain).collect())
    }

    /// The column with the first of these titles that there is.
    fn column(&self, names: &[&str]) -> Option<usize> {
        let mut places = names.iter();
        places.find_map(|name| self.0.iter().position(|title| title == name))
    }

    fn quality(&self) -> Option<(usize, Option<Scheme>)> {
        let mut qualities = QUALITIES.into_iter();
        qualities.find_map(|(name, scheme)| Some((self.column(&[name])?, scheme)))
    }

    fn value_columns(&self) -> ValueColumns {
        ValueColumns {
            value: self.column(&VALUES),
            quality: self.quality(),
            unit: self.column(&UNITS),
        }
    }
}

/// Where in a row the value of a sample stands, and what is said of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::intake) struct ValueColumns {
    pub(in crate::intake) value: Option<usize>,
    pub(in crate::intake) quality: Option<(usize, Option<Scheme>)>,
    pub(in crate::intake) unit: Option<usize>,
}

impl ValueColumns {
    /// The columns that have the titles of a value, a quality and a unit.
    pub(in crate::intake) fn of(titles: &[&str]) -> Self {
        PlainTitles::of(titles).value_columns()
    }
}

impl LongColumns {
    /// What the titles say, where there are a time, a tag and a value among them.
    pub(in crate::intake) fn of(titles: &[&str]) -> Option<Self> {
        let titles = PlainTitles::of(titles);
        let ValueColumns {
            value,
            quality,
            unit,
        } = titles.value_columns();
        Some(Self {
            time: titles.column(&TIMES)?,
            tag: titles.column(&TAGS)?,
            values: vec![value?],
            quality,
            unit,
        })
    }

    /// The columns by what stands in them, below any titles: a column of words that repeat beside times that repeat,
    /// and a column of numbers. None where the rows are no such list, or several columns have numbers.
    pub(super) fn guessed(rows: &[Vec<String>], time: usize) -> Option<Self> {
        let tag = Self::mixed_column(rows, time)?;
        let numbers = numbers(rows, &[time, tag]);
        (numbers.len() == 1).then_some(Self {
            time,
            tag,
            values: numbers,
            quality: None,
            unit: None,
        })
    }

    /// The column of words that tells apart rows of one time, where the times of a column repeat.
    pub(super) fn mixed_column(rows: &[Vec<String>], time: usize) -> Option<usize> {
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        let field = |row: &Vec<String>, column: usize| row.get(column).cloned().unwrap_or_default();
        let times: HashSet<String> = rows.iter().map(|row| field(row, time)).collect();
        let is_word = |text: &str| {
            text.chars().any(char::is_alphabetic) && value::number(text, None).is_none()
        };
        let tells_apart = |column: &usize| {
            let words = rows.iter().map(|row| field(row, *column));
            let words: Vec<String> = words.collect();
            let different: HashSet<&String> = words.iter().collect();
            let pairs = rows.iter().zip(&words);
            let pairs: HashSet<(String, &String)> =
                pairs.map(|(row, word)| (field(row, time), word)).collect();
            words.iter().all(|word| is_word(word))
                && (2..=words.len() / 2).contains(&different.len())
                && pairs.len() == rows.len()
        };
        let repeat = times.len() < rows.len();
        let mut columns = (0..width).filter(|column| *column != time);
        columns.find(tells_apart).filter(|_| repeat)
    }

    /// The columns that options name; the others by their titles, or by what stands in the first rows. None where
    /// nothing says that each row names its signal.
    pub(super) fn chosen(
        titles: &[&str],
        rows: &[Vec<String>],
        likely_time: usize,
        options: &Options,
    ) -> Result<Option<Self>, ReadError> {
        let told = Self::of(titles).or_else(|| Self::guessed(rows, likely_time));
        let table = &options.table;
        if told.is_none() && !table.has_signals_in_rows() {
            return Ok(None);
        }
        let plain = PlainTitles::of(titles);
        let tag = named(titles, "tag", table.tag.as_deref())?
            .or(told.as_ref().map(|told| told.tag))
            .or_else(|| plain.column(&TAGS));
        let tag = tag.ok_or_else(|| missing("tag", "names the signal of a row"))?;
        let by_title = || {
            let called = (0..titles.len()).find(|column| is_called_time(titles[*column]));
            plain.column(&TIMES).or(called).unwrap_or(likely_time)
        };
        let time = named(titles, "time", options.time.as_deref())?
            .or(told.as_ref().map(|told| told.time))
            .unwrap_or_else(by_title);
        if time == tag {
            let detail = format!("`{}` cannot be the time too: say `time`", titles[tag]);
            return Err(invalid(Fault::of_parameter(
                "time",
                "columns_missing",
                detail,
            )));
        }
        let quality = quality(titles, &plain, table.quality.as_deref())?;
        let mut columns = Self {
            time,
            tag,
            values: Vec::new(),
            quality,
            unit: plain.column(&UNITS),
        };
        if columns.quality.is_none() && table.quality.is_none() {
            columns.quality = columns.ratings(rows).map(|column| (column, None));
        }
        for title in &table.values {
            columns.values.push(column(titles, "value", title)?);
        }
        if columns.values.is_empty() {
            let titled = plain.column(&VALUES).filter(|column| *column != tag);
            columns.values =
                titled.map_or_else(|| columns.numbers_beside(rows), |value| vec![value]);
        }
        match columns.values[..] {
            [] => Err(missing("value", "has the values")),
            _ => Ok(Some(columns)),
        }
    }

    /// What a column holds.
    pub(super) fn role(&self, column: usize) -> ColumnRole {
        let quality = self.quality.map(|(place, _)| place);
        match column {
            _ if column == self.time => ColumnRole::Time,
            _ if column == self.tag => ColumnRole::Tag,
            _ if self.values.contains(&column) => ColumnRole::Value,
            _ if quality == Some(column) => ColumnRole::Quality,
            _ if self.unit == Some(column) => ColumnRole::Unit,
            _ => ColumnRole::LeftOut,
        }
    }

    /// Tells which columns hold nothing of a sample; nothing where all of them do.
    pub(in crate::intake) fn left_out(&self, titles: &[&str]) -> Option<Warning> {
        // Where a row has several qualities, the one that says most is taken.
        let plain = PlainTitles::of(titles);
        let is_quality = |column: usize| QUALITIES.iter().any(|(name, _)| *name == plain.0[column]);
        let is_rated = self.quality.is_some();
        let is_left_out = |column: &usize| {
            self.role(*column) == ColumnRole::LeftOut && !(is_rated && is_quality(*column))
        };
        let names = (0..titles.len())
            .filter(is_left_out)
            .map(|column| titles[column].trim());
        let names = names.filter(|name| !name.is_empty());
        let names: Vec<String> = names.map(|name| format!("`{}`", excerpt(name))).collect();
        let (first, detail) = (names.first()?, names.join(", "));
        let detail = format!(
            "{detail} was left out: neither time, tag, value, unit nor quality; where one of them says how good the \
             values are, say quality={}",
            first.trim_matches('`')
        );
        Some(Warning::of_recording("left_out_columns", detail))
    }

    /// A column that is nothing else and has nothing but words of quality, some of them bad.
    fn ratings(&self, rows: &[Vec<String>]) -> Option<usize> {
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        let are_ratings = |column: &usize| {
            let fields = rows.iter().filter_map(|row| row.get(*column));
            let filled: Vec<&String> = fields.filter(|field| !field.is_empty()).collect();
            let classes: Option<Vec<Class>> = filled.iter().map(|field| word(field)).collect();
            let is_rating = |classes: Vec<Class>| classes.iter().any(|class| *class != Class::Good);
            self.role(*column) == ColumnRole::LeftOut && classes.is_some_and(is_rating)
        };
        (0..width).find(are_ratings)
    }

    /// The columns of numbers that are nothing else.
    fn numbers_beside(&self, rows: &[Vec<String>]) -> Vec<usize> {
        let quality = self.quality.map(|(place, _)| place);
        let apart = [Some(self.time), Some(self.tag), quality, self.unit];
        numbers(rows, &apart.into_iter().flatten().collect::<Vec<usize>>())
    }
}

/// The columns of numbers, but for those that are `apart`.
fn numbers(rows: &[Vec<String>], apart: &[usize]) -> Vec<usize> {
    let width = rows.iter().map(Vec::len).max().unwrap_or(0);
    let is_of_numbers = |column: &usize| all_fields(rows, *column, &is_number);
    // The first column of an export of a database often numbers its rows.
    let is_count = |column: usize| column == 0 && count_up(rows.iter().map(|row| row.first()));
    let columns = (0..width).filter(|column| !apart.contains(column) && !is_count(*column));
    columns.filter(is_of_numbers).collect()
}

/// The column of the quality with its scheme: the one that the option names, none where the option is `none`, or the
/// one that is titled so.
fn quality(
    titles: &[&str],
    plain: &PlainTitles,
    option: Option<&str>,
) -> Result<Option<(usize, Option<Scheme>)>, ReadError> {
    if option == Some("none") && !titles.contains(&"none") {
        return Ok(None);
    }
    let titled = plain.quality();
    let Some(place) = named(titles, "quality", option)? else {
        return Ok(titled);
    };
    let titled = titled.filter(|(titled, _)| *titled == place);
    Ok(titled.or(Some((place, None))))
}

/// The column that an option names, where it names one.
fn named(titles: &[&str], option: &str, title: Option<&str>) -> Result<Option<usize>, ReadError> {
    title.map(|title| column(titles, option, title)).transpose()
}

/// The column with the title that an option names, with its unit or without.
fn column(titles: &[&str], option: &str, title: &str) -> Result<usize, ReadError> {
    let names = || titles.iter().map(|title| title::name_and_unit(title).0);
    let places = titles.iter().zip(names());
    let place = places
        .enumerate()
        .find(|(_, (whole, name))| **whole == title || *name == title);
    place.map(|(place, _)| place).ok_or_else(|| {
        let detail = format!(
            "there is no column `{title}`{}",
            did_you_mean(title, names())
        );
        invalid(Fault::of_parameter(option, "unknown_column", detail))
    })
}

fn missing(option: &str, what: &str) -> ReadError {
    let detail = format!("no column {what}: say `{option}`");
    invalid(Fault::of_parameter(option, "columns_missing", detail))
}
