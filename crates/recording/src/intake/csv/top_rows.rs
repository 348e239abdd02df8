//! What the first rows of a text are: titles, units, comments and data.

use super::super::table_options::{NamedRow, TableOptions};
use super::super::{stamp, units};
use super::fields::{count_up, is_data, line_of};
use ::csv::ByteRecord;
use std::collections::{BTreeMap, BTreeSet};

/// A row as text, without empty fields at its end.
pub(super) fn fields_of(record: &ByteRecord) -> Vec<String> {
    let field = |field: &[u8]| String::from_utf8_lossy(field).trim().to_owned();
    let mut fields: Vec<String> = record.iter().map(field).collect();
    while fields.last().is_some_and(String::is_empty) {
        fields.pop();
    }
    fields
}

/// What the first rows of a text are.
pub(super) struct TopRows {
    pub(super) rows: Vec<Vec<String>>,
    /// Which fields of the rows are data.
    are_data: Vec<Vec<bool>>,
    width: usize,
    /// The columns that hold data.
    pub(super) data: Vec<usize>,
    /// The first column counts the rows of data, for which there may be no title.
    are_numbered: bool,
}

impl TopRows {
    /// The rows with the columns of their table; none where no rows look like one.
    pub(super) fn of(records: &[ByteRecord]) -> Option<TopRows> {
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
        let are_numbered = {
            let of_width = (0..rows.len()).filter(of_width);
            count_up(of_width.map(|k| rows[k].first()))
        };
        Some(TopRows {
            are_numbered,
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
        self.rows[row].len() + usize::from(self.are_numbered) >= self.width
            && 2 * words.count() >= self.width
            && !self.are_data[row].contains(&true)
    }

    pub(super) fn is_comment(&self, row: usize) -> bool {
        let first = self.rows[row].first();
        first.is_some_and(|field| field.starts_with('#'))
    }

    /// Whether a row has a number or a time in any of its fields.
    pub(super) fn has_data(&self, row: usize) -> bool {
        self.are_data[row].contains(&true)
    }

    /// The first row of data from a row on; the number of rows where there is none.
    pub(super) fn first_data(&self, from: usize) -> usize {
        let mut rows = from..self.rows.len();
        rows.find(|row| self.is_data(*row))
            .unwrap_or(self.rows.len())
    }

    /// The row of titles and that of units, as options name them or as they look, or all rows that may be that of
    /// titles.
    pub(super) fn named_titles(&self, named: &NamedRows) -> Result<Titles, Vec<usize>> {
        if let Some(header) = named.header {
            let from = header.map_or(0, |header| header + 1);
            let above_data = from..self.first_data(from);
            let mut units = above_data.filter(|k| is_units(&self.rows[*k]) && !self.is_comment(*k));
            let units = named.units.unwrap_or_else(|| units.next_back());
            return Ok(Titles { header, units });
        }
        let first = self.first_data(0);
        let Some(units) = named.units else {
            return self.titles(first);
        };
        let with_units = |header| Titles {
            header: Some(header),
            units,
        };
        match self.titles(first) {
            Ok(titles) if titles.header != units => Ok(Titles { units, ..titles }),
            Ok(_) => {
                let mut above = (0..first).filter(|k| Some(*k) != units && self.is_titles(*k));
                above.next_back().map(with_units).ok_or_else(Vec::new)
            }
            Err(mut rivals) => {
                rivals.retain(|k| Some(*k) != units);
                match rivals[..] {
                    [header] => Ok(with_units(header)),
                    _ => Err(rivals),
                }
            }
        }
    }

    /// The row of titles and that of units above the first row of data, or all rows that may be that of titles.
    fn titles(&self, first: usize) -> Result<Titles, Vec<usize>> {
        let titles = |header, units| Titles {
            header: Some(header),
            units,
        };
        // A dataset of Ignition names its parts: names in the second row, types in the fourth.
        let is_dataset = |row: &Vec<String>| row.first().is_some_and(|field| field == "#NAMES");
        if self.rows.first().is_some_and(is_dataset) {
            return Ok(titles(1, None));
        }
        let may_be = (0..first).map(|k| self.is_titles(k) || is_units(&self.rows[k]));
        let may_be: Vec<bool> = may_be.collect();
        let all = || (0..first).filter(|k| may_be[*k]);
        let Some(last) = all().rfind(|k| !self.is_comment(*k)) else {
            // Titles that are numbers, as those of channels, stand right above the data.
            let above = first.checked_sub(1).filter(|k| self.may_call_columns(*k));
            let last = all().next_back().or(above);
            return last.map(|k| titles(k, None)).ok_or_else(Vec::new);
        };
        let block = (0..=last).rev();
        let block = block.take_while(|k| may_be[*k] && !self.is_comment(*k));
        let mut block: Vec<usize> = block.collect();
        block.reverse();
        block.dedup_by(|later, earlier| self.rows[*later] == self.rows[*earlier]);
        if let [only] = block[..]
            && only > 0
            && self.are_units_below_titles(only)
        {
            return Ok(titles(only - 1, Some(only)));
        }
        let units = match block.len() {
            1 => None,
            _ => block.iter().rfind(|k| is_units(&self.rows[**k])).copied(),
        };
        // Loggers have a row below that of the units which says how samples were made.
        let above_units = block.iter().filter(|k| Some(**k) < units).count();
        block.retain(|k| Some(*k) != units && (above_units != 1 || Some(*k) < units));
        match block[..] {
            [header] => {
                let units = units.or_else(|| self.labelled_units(header));
                Ok(titles(header, units))
            }
            _ => Err(block),
        }
    }

    /// The row of units farther above the titles, which begins with a word that says so.
    fn labelled_units(&self, header: usize) -> Option<usize> {
        let is_labelled = |row: &usize| {
            let first = self.rows[*row].first().filter(|first| !first.is_empty());
            first.is_some_and(|first| unit_of(first).is_empty()) && is_units(&self.rows[*row])
        };
        (0..header).rfind(is_labelled)
    }
}

impl TopRows {
    /// Whether a row has a field for each column and begins with a word.
    fn may_call_columns(&self, row: usize) -> bool {
        let first = self.rows[row].first();
        self.rows[row].len() >= self.width && first.is_some_and(|first| !is_data(first))
    }

    /// Whether the fields of a row are units, one of them of two columns, and the row above calls columns by numbers.
    fn are_units_below_titles(&self, row: usize) -> bool {
        let may_call = self.may_call_columns(row - 1);
        let (above, row) = (&self.rows[row - 1], &self.rows[row]);
        let mut units = row.iter().map(|field| unit_of(field));
        let is_unit = |unit: &str| {
            units::parse(unit)
                .or_else(|| units::parse_time(unit))
                .is_some()
        };
        let are_units = units.all(is_unit);
        let different: BTreeSet<&String> = row.iter().collect();
        let titles: BTreeSet<&String> = above.iter().filter(|title| !title.is_empty()).collect();
        are_units && different.len() < row.len() && titles.len() == row.len() && may_call
    }
}

/// The rows of titles and of units, where there are such.
pub(super) struct Titles {
    pub(super) header: Option<usize>,
    pub(super) units: Option<usize>,
}

/// The rows that options name by their lines.
pub(super) struct NamedRows {
    /// The row of titles, or that there is none.
    pub(super) header: Option<Option<usize>>,
    /// The row of units, or that there is none.
    units: Option<Option<usize>>,
    pub(super) missing: Option<(&'static str, u64)>,
}

impl NamedRows {
    pub(super) fn of(records: &[ByteRecord], options: &TableOptions) -> NamedRows {
        let mut missing = None;
        let mut row = |option, line: u64| {
            let place = records.iter().position(|record| line_of(record) == line);
            missing = missing.or(place.is_none().then_some((option, line)));
            place
        };
        NamedRows {
            header: options.header_row.and_then(|header| match header {
                NamedRow::None => Some(None),
                NamedRow::Line(line) => row("header_row", line).map(Some),
            }),
            units: options.unit_row.map(|units| match units {
                NamedRow::None => None,
                NamedRow::Line(line) => row("unit_row", line),
            }),
            missing,
        }
    }
}

/// A unit as it stands in a row of units, without brackets; nothing for a word that names the row.
pub(super) fn unit_of(field: &str) -> &str {
    const NAMES: [&str; 12] = [
        "unit",
        "units",
        "einheit",
        "einheiten",
        "uom",
        "vertical units",
        "y_unit_label",
        "yunits",
        "no",
        "no.",
        "ts",
        "rn",
    ];
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
