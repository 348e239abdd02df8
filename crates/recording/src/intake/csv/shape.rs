//! Where the table of a text begins, and what has to be done to its rows: lines above the titles are left out, a row
//! of units goes into the titles, and a time in several columns becomes one.

use super::super::error::{at_line, excerpt};
use super::super::table_options::TableOptions;
use super::super::{stamp, title, units};
use super::fields::{count_up, is_called_time, line_of, runs};
use super::instruments::InstrumentHead;
use super::split_time::SplitTime;
use super::top_rows::{NamedRows, Titles, TopRows, fields_of, unit_of};
use crate::Warning;
use ::csv::ByteRecord;
use greybox_numerics::parsing::Fault;

/// Titles of a last column of remarks, which programs leave out of rows without any, in small letters.
const REMARKS: [&str; 8] = [
    "",
    "comment",
    "comments",
    "remark",
    "remarks",
    "note",
    "kommentar",
    "bemerkung",
];

/// Titles of columns that number the rows, in small letters.
const NUMBERING: [&str; 13] = [
    "", "#", "no", "no.", "nr", "nr.", "number", "index", "row", "record", "scan", "sample", "id",
];

/// How the rows of a text become those of a table with one row of titles.
#[derive(Default)]
pub(super) struct Shape {
    /// The rows of the text above the first of the data.
    top: Vec<ByteRecord>,
    /// The index of the row of titles among them; none where columns are called by their numbers.
    header: Option<usize>,
    /// The columns of a text without titles.
    width: usize,
    /// The index of the row of units among them.
    units: Option<usize>,
    /// How many columns before all others count the rows.
    counters: usize,
    time: Option<SplitTime>,
    /// How many columns hold numbers or times; none where the rows describe themselves.
    columns: usize,
    /// Titles of remarks that no row has.
    surplus: Vec<String>,
    /// Whether all rows of data have as many fields as the titles.
    is_even: bool,
    /// The rows that may all be the titles, by their lines.
    rivals: Vec<u64>,
    /// The head of an instrument above the table.
    pub(super) head: Option<InstrumentHead>,
    /// An option that names a line on which no row of the beginning stands.
    missing_line: Option<(&'static str, u64)>,
}

impl Shape {
    /// The shape of a text whose first row has the titles.
    pub(super) fn plain(records: &[ByteRecord]) -> Shape {
        Shape {
            top: records.first().cloned().into_iter().collect(),
            header: Some(0),
            ..Shape::default()
        }
    }

    /// The shape of a text that begins with these rows and the head of an instrument.
    pub(super) fn of_head(records: &[ByteRecord], head: InstrumentHead) -> Option<Shape> {
        let (top, below) = records.split_at_checked(head.rows)?;
        let below: Vec<Vec<String>> = below.iter().map(fields_of).collect();
        Some(Shape {
            top: top.to_vec(),
            width: head.titles.len(),
            counters: head.left_out,
            time: SplitTime::of(&head.titles, &below),
            columns: head.titles.len(),
            head: Some(head),
            ..Shape::default()
        })
    }

    /// The shape of a text that begins with these rows; none where nothing tells which row has the titles.
    pub(super) fn of(records: &[ByteRecord], options: &TableOptions) -> Option<Shape> {
        let top = TopRows::of(records)?;
        let named = NamedRows::of(records, options);
        if named.header.is_none() && top.first_data(0) == top.rows.len() {
            return None;
        }
        let (Titles { header, units }, rivals) = match top.named_titles(&named) {
            Ok(titles) => (titles, Vec::new()),
            Err(rivals) => {
                let header = Some(*rivals.first()?);
                let units = None;
                (Titles { header, units }, rivals)
            }
        };
        let end = header.max(units).map_or(0, |last| last + 1);
        let first = top.first_data(end);
        // What stands below the titles and is no row of units is a row of the table, right or wrong.
        let mut below_titles =
            (end..first).filter(|k| header.is_some() && top.has_data(*k) && !top.is_comment(*k));
        let end = below_titles.next().unwrap_or(first);
        let below = top.rows.get(end..)?;
        let width = below.iter().map(Vec::len).max().unwrap_or(0);
        let mut top_rows = records[..end].to_vec();
        let mut surplus = Vec::new();
        let lengths = || records[end..].iter().map(ByteRecord::len);
        if let Some(header) = header {
            let fitted = fitted_titles(&top_rows[header], below, lengths());
            surplus = fitted.surplus;
            top_rows[header] = fitted.titles;
        }
        let titles = match header {
            Some(header) => fields_of(&top_rows[header]),
            None => numbered_titles(width),
        };
        let time = SplitTime::of(&titles, below);
        Some(Shape {
            is_even: lengths().all(|length| length == titles.len()),
            surplus,
            top: top_rows,
            header,
            width,
            units,
            counters: counters(&titles, below, time.as_ref()),
            time,
            columns: top.data.len(),
            rivals: rivals.into_iter().map(|k| line_of(&records[k])).collect(),
            missing_line: named.missing,
            head: None,
        })
    }

    /// How many columns hold numbers or times.
    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Whether all rows of data have as many fields as the titles.
    pub(super) fn is_even(&self) -> bool {
        self.is_even
    }

    /// How many rows of the text stand above the first of the data.
    pub(super) fn top(&self) -> usize {
        self.top.len()
    }

    /// Rows of the text to read before the first of the data. A text without a row has none for its titles.
    pub(super) fn rows_above(&self) -> usize {
        let titles = usize::from(self.header.is_some());
        self.top.len().max(titles)
    }

    /// Whether a row stands above the data too.
    pub(super) fn repeats_top(&self, record: &ByteRecord) -> bool {
        self.columns > 0 && self.top.iter().any(|above| above == record)
    }

    /// The rows of the text above the first of the data.
    pub(super) fn above(&self) -> &[ByteRecord] {
        &self.top
    }

    /// Makes a row of the text one of the table, before which so many came.
    pub(super) fn fit(&self, record: &mut ByteRecord, before: u64) {
        let time = self.time.as_ref().map(|time| time.text(record));
        let count = self.count_title().map(|_| before.to_string());
        if time.is_some() || count.is_some() || self.counters > 0 {
            *record = self.row(record, &time.unwrap_or_default(), count.as_deref());
        }
    }

    /// The title of the count of rows that stands in for their time.
    fn count_title(&self) -> Option<&'static str> {
        self.head.as_ref()?.count_title()
    }

    /// The titles of the table.
    pub(super) fn table_titles(&self) -> ByteRecord {
        let record = match self.header {
            Some(header) => self.top.get(header).cloned().unwrap_or_default(),
            None => ByteRecord::from(self.titles()),
        };
        let time = self.time.as_ref().map(|time| time.title(&record));
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
                Some(unit) if title_unit(title).is_empty() => {
                    titles.push_field(format!("{title} [{unit}]").as_bytes());
                }
                _ => titles.push_field(title.as_bytes()),
            }
        }
        titles.set_position(record.position().cloned());
        self.row(&titles, &time.unwrap_or_default(), self.count_title())
    }

    /// The fields of a row of the text as those of the table, with the field of its time or a count in its place.
    fn row(&self, record: &ByteRecord, time: &[u8], count: Option<&str>) -> ByteRecord {
        let mut row = ByteRecord::from_iter(count);
        for (k, field) in record.iter().enumerate() {
            match &self.time {
                _ if k < self.counters => {}
                Some(split) if split.first() == k => row.push_field(time),
                Some(split) if split.has(k) => {}
                _ => row.push_field(field),
            }
        }
        row.set_position(record.position().cloned());
        row
    }

    /// The titles as they stand in the text, or those of a text that has none.
    pub(super) fn titles(&self) -> Vec<String> {
        match (self.header, &self.head) {
            (Some(header), _) => self.top.get(header).map(fields_of).unwrap_or_default(),
            (None, Some(head)) => head.titles.clone(),
            (None, None) => numbered_titles(self.width),
        }
    }

    /// The line of the titles.
    pub(super) fn header_line(&self) -> Option<u64> {
        self.header.and_then(|row| self.top.get(row)).map(line_of)
    }

    /// The line of the units.
    pub(super) fn unit_line(&self) -> Option<u64> {
        self.units.and_then(|row| self.top.get(row)).map(line_of)
    }

    /// Whether a column of the text is one of several that together are the time.
    pub(super) fn is_time(&self, column: usize) -> bool {
        self.time.as_ref().is_some_and(|time| time.has(column))
    }

    /// The column of the table that a column of the text is; none where the column is left out.
    pub(super) fn table_column(&self, column: usize) -> Option<usize> {
        let is_left_out = |k: usize| {
            let is_joined = self
                .time
                .as_ref()
                .is_some_and(|time| time.has(k) && time.first() != k);
            is_joined || k < self.counters
        };
        let counted = usize::from(self.count_title().is_some());
        (!is_left_out(column)).then(|| counted + (0..column).filter(|k| !is_left_out(*k)).count())
    }

    /// The unit that the row of units has for a column.
    pub(super) fn unit(&self, column: usize) -> Option<&str> {
        let field = self.top[self.units?].get(column)?;
        let unit = std::str::from_utf8(field).ok().map(unit_of);
        unit.filter(|unit| !unit.is_empty() && !is_called_time(unit))
    }

    /// The fault of a text whose titles or units are in doubt.
    pub(super) fn fault(&self) -> Option<Fault> {
        if let Some((option, line)) = self.missing_line {
            let detail = format!("no row begins on line {line} of the first rows of the text");
            return Some(Fault::of_parameter(option, "unknown_line", detail));
        }
        if let [first, second, ..] = self.rivals[..] {
            let detail = format!(
                "lines {first} and {second} may both be the titles of the columns: say which with `header_row`, and \
                 with `unit_row` which has the units, or `none`"
            );
            return Some(Fault {
                parameter: Some("header_row".into()),
                ..at_line(first, None, "titles_unclear", detail)
            });
        }
        let line = self.header_line()?;
        let titles = self.titles();
        let differs = |(k, title): (usize, &String)| {
            let (name, unit) = (title::name_and_unit(title).0, title_unit(title));
            let below = self.unit(k).filter(|_| !unit.is_empty())?;
            let detail = format!(
                "the title says `{unit}`, and the row of units `{below}`: say `unit_row=none`, or mend the title"
            );
            let fault = at_line(line, Some(name), "units_differ", detail);
            (units::parse(unit) != units::parse(below)).then_some(fault)
        };
        titles.iter().enumerate().find_map(differs)
    }

    /// Warnings about how the rows became a table.
    pub(super) fn notes(&self) -> Vec<Warning> {
        let note = |code: &str, detail: String| Some(Warning::of_recording(code, detail));
        let skipped =
            (0..self.top.len()).filter(|k| ![self.header, self.units].contains(&Some(*k)));
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
            let titles = self.titles().into_iter().enumerate();
            let titles = titles.filter(|(k, _)| time.has(*k));
            let titles: Vec<String> = titles.map(|(_, title)| format!("`{title}`")).collect();
            note(
                "joined_time",
                format!("{} together are the time", titles.join(" and ")),
            )
        });
        let numbers = (self.counters > 0 && self.head.is_none()).then(|| {
            let detail = "the first column numbers the rows and was left out";
            note("row_numbers", detail.to_owned())
        });
        let surplus = self.surplus.iter().find(|title| !title.is_empty());
        let surplus = surplus.and_then(|title| {
            let title = excerpt(title);
            note(
                "left_out_columns",
                format!("no row has a field below `{title}`"),
            )
        });
        let titles = (self.header.is_none() && self.head.is_none()).then(|| {
            let detail =
                "no line has titles: the columns are called `column_1`, `column_2` and so on";
            note("no_titles", detail.to_owned())
        });
        [
            skipped,
            titles.flatten(),
            units,
            surplus,
            time,
            numbers.flatten(),
            self.head.as_ref().map(InstrumentHead::note),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// The titles of columns that have none.
fn numbered_titles(columns: usize) -> Vec<String> {
    (1..=columns).map(|k| format!("column_{k}")).collect()
}

/// The titles of a text, one for each field of its rows.
struct FittedTitles {
    titles: ByteRecord,
    /// Titles of remarks that no row has.
    surplus: Vec<String>,
}

/// The titles without one of remarks that no row has, with an empty one for numbers of rows that have none.
fn fitted_titles(
    titles: &ByteRecord,
    below: &[Vec<String>],
    lengths: impl Iterator<Item = usize> + Clone,
) -> FittedTitles {
    let (least, most) = (lengths.clone().min(), lengths.clone().max());
    let most = most.unwrap_or(titles.len());
    let is_even = least == Some(most) && lengths.count() > 1;
    let fields: Vec<&[u8]> = titles.iter().collect();
    let begins = |row: &Vec<String>| row.first().is_some_and(|number| number == "1");
    let are_numbered = || {
        let is_count = count_up(below.iter().map(|row| row.first()));
        is_count && below.first().is_some_and(begins) && runs(below, 1)
    };
    let is_remark = |title: &&[u8]| {
        let title = String::from_utf8_lossy(title).trim().to_lowercase();
        REMARKS.contains(&title.as_str())
    };
    let mut surplus = Vec::new();
    let kept: Vec<&[u8]> = match fields.len() {
        length if is_even && length + 1 == most && length > 0 && are_numbered() => {
            [&[&b""[..]], &fields[..]].concat()
        }
        length if most > 1 && length == most + 1 && fields.last().is_some_and(is_remark) => {
            surplus = fields_of(titles).into_iter().skip(most).collect();
            fields[..most].to_vec()
        }
        _ => fields,
    };
    let mut fitted = ByteRecord::from(kept);
    fitted.set_position(titles.position().cloned());
    FittedTitles {
        titles: fitted,
        surplus,
    }
}

/// The unit in a title. A number in parentheses tells columns of one name apart and is no unit.
fn title_unit(title: &str) -> &str {
    let (_, unit) = title::name_and_unit(title);
    match unit.bytes().all(|byte| byte.is_ascii_digit()) {
        true => "",
        false => unit,
    }
}

/// How many columns count the rows before one that is the time by its title or by what stands in it.
fn counters(titles: &[String], below: &[Vec<String>], time: Option<&SplitTime>) -> usize {
    let filled = || below.iter().filter(|row| !row.is_empty());
    let counts = |column: &usize| {
        let title = titles[*column].to_lowercase();
        let is_numbering = NUMBERING.contains(&title.as_str()) || title.starts_with("unnamed: ");
        is_numbering && count_up(filled().map(|row| row.get(*column)))
    };
    let count = (0..titles.len()).take_while(counts).count();
    let mut fields = below.iter().filter_map(|row| row.get(count));
    let are_stamps = fields.all(|field| stamp::is_one(field) || stamp::is_date(field));
    let is_split = time.is_some_and(|time| time.first() == count);
    let is_time = |title: &String| is_called_time(title) || are_stamps || is_split;
    match titles.get(count).is_some_and(is_time) {
        true => count,
        false => 0,
    }
}
