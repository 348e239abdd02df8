//! Where the table of a text begins, and what has to be done to its rows: lines above the titles are left out, a row
//! of units goes into the titles, and a time in several columns becomes one.

use super::super::error::{ReadingFault, excerpt};
use super::super::{stamp, units, value};
use super::fields::{is_called_time, is_data, line_of};
use super::split_time::SplitTime;
use crate::Warning;
use ::csv::ByteRecord;
use std::collections::BTreeMap;

/// Titles of columns that number the rows, in small letters.
const NUMBERING: [&str; 9] = [
    "",
    "unnamed: 0",
    "#",
    "no",
    "no.",
    "nr",
    "nr.",
    "index",
    "row",
];

/// How the rows of a text become those of a table with one row of titles.
#[derive(Default)]
pub(super) struct Shape {
    /// The rows of the text above the first of the data.
    top: Vec<ByteRecord>,
    /// The index of the row of titles among them.
    header: usize,
    /// The index of the row of units among them.
    units: Option<usize>,
    numbers_rows: bool,
    time: Option<SplitTime>,
    /// How many columns hold numbers or times; none where the rows describe themselves.
    columns: usize,
    /// The rows that may all be the titles, by their lines.
    rivals: Vec<u64>,
}

/// A row as text, without empty fields at its end.
fn fields_of(record: &ByteRecord) -> Vec<String> {
    let field = |field: &[u8]| String::from_utf8_lossy(field).trim().to_owned();
    let mut fields: Vec<String> = record.iter().map(field).collect();
    while fields.last().is_some_and(String::is_empty) {
        fields.pop();
    }
    fields
}

/// What the first rows of a text are.
struct TopRows {
    rows: Vec<Vec<String>>,
    /// Which fields of the rows are data.
    are_data: Vec<Vec<bool>>,
    width: usize,
    /// The columns that hold data.
    data: Vec<usize>,
}

impl TopRows {
    /// The rows with the columns of their table; none where no rows look like one.
    fn of(records: &[ByteRecord]) -> Option<TopRows> {
        let rows: Vec<Vec<String>> = records.iter().map(fields_of).collect();
        let is_filled_data = |field: &String| !field.is_empty() && is_data(field);
        let flags = |row: &Vec<String>| row.iter().map(is_filled_data).collect();
        let are_data: Vec<Vec<bool>> = rows.iter().map(flags).collect();
        let has_data = |row: &&Vec<bool>| row.len() > 1 && row.contains(&true);
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        for row in are_data.iter().filter(has_data) {
            *counts.entry(row.len()).or_default() += 1;
        }
        let (width, _) = counts.into_iter().max_by_key(|(_, count)| *count)?;
        let of_width = |k: &usize| has_data(&&are_data[*k]) && rows[*k].len() == width;
        let holds_data = |column: &usize| {
            let of_width = (0..rows.len()).filter(of_width);
            let filled: Vec<usize> = of_width.filter(|k| !rows[*k][*column].is_empty()).collect();
            let data = filled.iter().filter(|k| are_data[**k][*column]).count();
            data > 0 && 2 * data >= filled.len()
        };
        let data = (0..width).filter(holds_data).collect();
        Some(TopRows {
            rows,
            are_data,
            width,
            data,
        })
    }

    /// Whether a row is one of data: the first and half of the columns that hold data have some.
    fn is_data(&self, row: usize) -> bool {
        let has_data = |column: &&usize| self.are_data[row].get(**column) == Some(&true);
        let filled = self.data.iter().filter(has_data).count();
        self.data.first().as_ref().is_some_and(has_data) && 2 * filled >= self.data.len()
    }

    /// Whether a row may be that of the titles.
    fn is_titles(&self, row: usize) -> bool {
        let words = self.rows[row].iter().filter(|field| !field.is_empty());
        self.rows[row].len() >= self.width
            && 2 * words.count() >= self.width
            && !self.are_data[row].contains(&true)
    }

    fn is_comment(&self, row: usize) -> bool {
        let first = self.rows[row].first();
        first.is_some_and(|field| field.starts_with('#'))
    }

    /// The row of titles and that of units above the first row of data, or all rows that may be that of titles.
    fn titles(&self, first: usize) -> Result<(usize, Option<usize>), Vec<usize>> {
        let may_be = (0..first).map(|k| self.is_titles(k) || is_units(&self.rows[k]));
        let may_be: Vec<bool> = may_be.collect();
        let all = || (0..first).filter(|k| may_be[*k]);
        let Some(last) = all().rfind(|k| !self.is_comment(*k)) else {
            return all().next_back().map(|k| (k, None)).ok_or_else(Vec::new);
        };
        let block = (0..=last).rev();
        let block = block.take_while(|k| may_be[*k] && !self.is_comment(*k));
        let mut block: Vec<usize> = block.collect();
        block.reverse();
        block.dedup_by(|later, earlier| self.rows[*later] == self.rows[*earlier]);
        let units = match block.len() {
            1 => None,
            _ => block.iter().rfind(|k| is_units(&self.rows[**k])).copied(),
        };
        block.retain(|k| Some(*k) != units);
        match block[..] {
            [titles] => Ok((titles, units)),
            _ => Err(block),
        }
    }
}

/// A unit as it stands in a row of units, without brackets; nothing for a word that names the row.
fn unit_of(field: &str) -> &str {
    const NAMES: [&str; 5] = ["unit", "units", "einheit", "einheiten", "uom"];
    let unit = field.trim_matches(['[', ']', '(', ')', ' ', ':']);
    match NAMES.contains(&unit.to_lowercase().as_str()) {
        true => "",
        false => unit,
    }
}

/// Whether most fields of a row are units.
fn is_units(row: &[String]) -> bool {
    let filled = || {
        row.iter()
            .map(|field| unit_of(field))
            .filter(|field| !field.is_empty())
    };
    let is_unit = |field: &&str| units::parse(field).is_some() || stamp::is_pattern(field);
    let is_word = |field: &str| field.contains(|c: char| c.is_alphabetic() || c == '%' || c == '°');
    filled().any(is_word)
        && filled().all(|field| field == "1" || !is_data(field))
        && 2 * filled().filter(is_unit).count() >= filled().count()
}

impl Shape {
    /// The shape of a text whose first row has the titles.
    pub(super) fn plain(records: &[ByteRecord]) -> Shape {
        Shape {
            top: records.first().cloned().into_iter().collect(),
            ..Shape::default()
        }
    }

    /// The shape of a text that begins with these rows; none where nothing tells which row has the titles.
    pub(super) fn of(records: &[ByteRecord]) -> Option<Shape> {
        let top = TopRows::of(records)?;
        let first = (0..top.rows.len()).find(|row| top.is_data(*row))?;
        let (header, units, rivals) = match top.titles(first) {
            Ok((header, units)) => (header, units, Vec::new()),
            Err(rivals) => (*rivals.first()?, None, rivals),
        };
        // What stands below the titles and is no row of units is a row of the table, right or wrong.
        let end = units.map_or(header, |units| units.max(header)) + 1;
        let end = (end..first).find(|k| !top.is_comment(*k)).unwrap_or(first);
        let below = top.rows.get(end..)?;
        let titles = &top.rows[header];
        Some(Shape {
            top: records[..end].to_vec(),
            header,
            units,
            numbers_rows: numbers_rows(titles, below),
            time: SplitTime::of(titles, below),
            columns: top.data.len(),
            rivals: rivals.into_iter().map(|k| line_of(&records[k])).collect(),
        })
    }

    /// How many columns hold numbers or times.
    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// How many rows of the text stand above the first of the data.
    pub(super) fn top(&self) -> usize {
        self.top.len()
    }

    /// The index of the row of titles among the rows above the data.
    pub(super) fn header(&self) -> usize {
        self.header
    }

    /// Whether a row stands above the data too.
    pub(super) fn repeats_top(&self, record: &ByteRecord) -> bool {
        self.columns > 0 && self.top.iter().any(|above| above == record)
    }

    /// Makes a row of the text one of the table.
    pub(super) fn fit(&self, record: &mut ByteRecord) {
        let time = self.time.as_ref().map(|time| time.text(record));
        if time.is_some() || self.numbers_rows {
            *record = self.row(record, &time.unwrap_or_default());
        }
    }

    /// Makes the row of the titles the titles of the table.
    pub(super) fn fit_titles(&self, record: &mut ByteRecord) {
        let time = self
            .time
            .as_ref()
            .map(|time| record.get(time.named_by()).unwrap_or_default().to_vec());
        let mut titles = ByteRecord::new();
        for (k, field) in record.iter().enumerate() {
            let Ok(title) = std::str::from_utf8(field) else {
                titles.push_field(field);
                continue;
            };
            let title = match k {
                0 if self.top.len() > 1 => title.trim().trim_start_matches(['#', ' ']),
                _ => title.trim(),
            };
            match self.unit(k) {
                Some(unit) if units::name_and_unit(title).1.is_empty() => {
                    titles.push_field(format!("{title} [{unit}]").as_bytes());
                }
                _ => titles.push_field(title.as_bytes()),
            }
        }
        titles.set_position(record.position().cloned());
        *record = self.row(&titles, &time.unwrap_or_default());
    }

    /// The fields of a row of the text as those of the table, with the field of its time.
    fn row(&self, record: &ByteRecord, time: &[u8]) -> ByteRecord {
        let mut row = ByteRecord::new();
        for (k, field) in record.iter().enumerate() {
            match &self.time {
                _ if k == 0 && self.numbers_rows => {}
                Some(split) if split.first() == k => row.push_field(time),
                Some(split) if split.has(k) => {}
                _ => row.push_field(field),
            }
        }
        row.set_position(record.position().cloned());
        row
    }

    /// The unit that the row of units has for a column.
    fn unit(&self, column: usize) -> Option<&str> {
        let field = self.top[self.units?].get(column)?;
        let unit = std::str::from_utf8(field).ok().map(unit_of);
        unit.filter(|unit| !unit.is_empty())
    }

    /// The fault of a text whose titles or units are in doubt.
    pub(super) fn fault(&self) -> Option<ReadingFault> {
        if let [first, second, ..] = self.rivals[..] {
            let detail = format!(
                "lines {first} and {second} may both be the titles of the columns; leave one row of titles above \
                 the data, and one of units at the most"
            );
            return Some(ReadingFault::at_line("titles_unclear", first, None, detail));
        }
        let titles = fields_of(self.top.get(self.header)?);
        let differs = |(k, title): (usize, &String)| {
            let (name, unit) = units::name_and_unit(title);
            let below = self.unit(k).filter(|_| !unit.is_empty())?;
            let detail = format!(
                "the title says `{unit}`, and the row of units `{below}`; leave one of them"
            );
            let line = line_of(&self.top[self.header]);
            let fault = ReadingFault::at_line("units_differ", line, Some(name), detail);
            (units::parse(unit) != units::parse(below)).then_some(fault)
        };
        titles.iter().enumerate().find_map(differs)
    }

    /// Warnings about how the rows became a table.
    pub(super) fn notes(&self) -> Vec<Warning> {
        let note = |code: &str, detail: String| Some(Warning::of_recording(code, detail));
        let skipped = (0..self.top.len()).filter(|k| *k != self.header && Some(*k) != self.units);
        let mut skipped = skipped.map(|k| fields_of(&self.top[k]).join(" "));
        let skipped = skipped.next().and_then(|first| {
            let (count, first) = (1 + skipped.count(), excerpt(&first));
            let detail = format!(
                "{count} lines above the data are no rows of the table, the first `{first}`"
            );
            note("lines_left_out", detail)
        });
        let units = self.units.and_then(|k| {
            let line = line_of(&self.top[k]);
            note(
                "row_of_units",
                format!("line {line} has the units of the columns"),
            )
        });
        let time = self.time.as_ref().and_then(|time| {
            let titles = fields_of(&self.top[self.header]);
            let titles = titles.iter().enumerate().filter(|(k, _)| time.has(*k));
            let titles: Vec<String> = titles.map(|(_, title)| format!("`{title}`")).collect();
            note(
                "joined_time",
                format!("{} together are the time", titles.join(" and ")),
            )
        });
        let numbers = || {
            note(
                "row_numbers",
                "the first column numbers the rows and was left out".to_owned(),
            )
        };
        let numbers = self.numbers_rows.then(numbers).flatten();
        [skipped, units, time, numbers]
            .into_iter()
            .flatten()
            .collect()
    }
}

/// Whether the first column counts the rows, and the second is a time by its title or by what stands in it.
fn numbers_rows(titles: &[String], below: &[Vec<String>]) -> bool {
    let is_numbering = |title: &String| NUMBERING.contains(&title.to_lowercase().as_str());
    let numbers = below.iter().filter(|row| !row.is_empty());
    let numbers: Option<Vec<f64>> = numbers.map(|row| value::number(&row[0], None)).collect();
    let mut second = below.iter().filter_map(|row| row.get(1));
    let are_stamps = second.all(|field| stamp::is_one(field));
    let count = |numbers: Vec<f64>| {
        numbers.len() > 1 && numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0)
    };
    titles.first().is_some_and(is_numbering)
        && titles
            .get(1)
            .is_some_and(|title| is_called_time(title) || are_stamps)
        && numbers.is_some_and(count)
}
