//! What the first lines of a CSV tell: its delimiter, its kind, and how it writes numbers.

use super::super::clock::names;
use super::super::error::ReadError;
use super::super::format::{HEAD_BYTES, whole_lines};
use super::super::options::{Decimal, Options};
use super::super::table_options::TableOptions;
use super::super::{Format, stamp, units, value};
use super::fields::{all_fields, is_called_time, is_data, is_number, time_name_and_unit};
use super::instruments;
use super::long_columns::LongColumns;
use super::paired::PairedColumns;
use super::rows::{TableRows, TextRows, read_row};
use super::shape::Shape;
use ::csv::ByteRecord;

/// Signs between fields, the likelier first.
const DELIMITERS: [u8; 4] = [b',', b';', b'\t', b'|'];

/// Rows that are looked at.
const ROWS: usize = 50;

/// Rows among which the titles are looked for.
const TOP_ROWS: usize = 100;

/// The first rows of a text.
pub(super) struct Sniff {
    pub(super) delimiter: u8,
    pub(super) shape: Shape,
    rows: Vec<Vec<String>>,
    /// An option says what numbers of time are.
    are_numbers_times: bool,
}

impl Sniff {
    pub(super) fn new(head: &[u8], options: &Options) -> Self {
        let whole = without_cut_line(head);
        let (delimiter, shape) =
            headed(whole, &options.table).unwrap_or_else(|| shape_of(whole, &options.table));
        Self {
            are_numbers_times: options.says_numbers_of_time(),
            delimiter,
            rows: table_rows(whole, delimiter, &shape, ROWS),
            shape,
        }
    }

    /// What kind of CSV it is.
    pub(super) fn format(&self, options: &Options) -> Format {
        if let Some(format) = described(&self.rows) {
            return format;
        }
        // Columns that options name and that are missing are a fault of such a table.
        if !matches!(self.long_columns(options), Ok(None)) {
            return Format::LongCsv;
        }
        match self.paired_columns() {
            Some(_) => Format::PairedCsv,
            None => Format::WideCsv,
        }
    }

    /// The titles of the columns of the table.
    pub(super) fn titles(&self) -> Vec<&str> {
        let titles = self.rows.first().into_iter().flatten();
        titles.map(String::as_str).collect()
    }

    /// The columns of signals with a time or a quality of their own beside them.
    pub(super) fn paired_columns(&self) -> Option<PairedColumns> {
        let (_, rows) = self.rows.split_first()?;
        PairedColumns::of(&self.titles(), rows, self.time())
    }

    /// The column of the time where no option names one: the first, or the one whose title or fields are those of a
    /// time where the first has neither.
    pub(super) fn time(&self) -> usize {
        match self.rows.split_first() {
            Some((_, rows)) if self.are_numbers_times && all_fields(rows, 0, &is_number) => 0,
            Some((_, rows)) => likely_time(&self.titles(), rows),
            None => 0,
        }
    }

    /// The columns of a table whose rows name their signals; none of another table.
    pub(super) fn long_columns(&self, options: &Options) -> Result<Option<LongColumns>, ReadError> {
        match self.rows.split_first() {
            Some((_, rows)) => LongColumns::chosen(&self.titles(), rows, self.time(), options),
            None => Ok(None),
        }
    }

    /// The title of the column whose words tell apart rows of one time: such a text has a row for each sample, or for
    /// each device.
    pub(super) fn mixed_column(&self) -> Option<&str> {
        let (titles, rows) = self.rows.split_first()?;
        let column = LongColumns::mixed_column(rows, self.time())?;
        titles.get(column).map(String::as_str)
    }

    /// The fields of a column below the header, as far as the head of the text goes.
    pub(super) fn column(&self, head: &[u8], index: usize) -> Vec<String> {
        let field = |row: Vec<String>| row.into_iter().nth(index).unwrap_or_default();
        let rows = table_rows(
            without_cut_line(head),
            self.delimiter,
            &self.shape,
            usize::MAX,
        );
        rows.into_iter().skip(1).map(field).collect()
    }

    /// Whether the first rows that share the field of a column are the same row again.
    pub(super) fn are_repeated(&self, column: usize) -> bool {
        let pairs = self.rows.windows(2).skip(1);
        let mut of_one_time = pairs.filter(|pair| pair[0].get(column) == pair[1].get(column));
        of_one_time.all(|pair| pair[0] == pair[1])
    }

    /// How the numbers of all columns together write fractions: whether they have a decimal comma, or cannot tell.
    pub(super) fn fractions(&self) -> Fractions {
        let plain = |field: &String| match value::with_unit(field).or(value::status_behind(field)) {
            Some((number, _)) => number.to_owned(),
            None => field.clone(),
        };
        let fields = || self.rows.iter().skip(1).flatten().map(plain);
        let is_in_thousands = |field: &str| value::is_in_thousands(field, '.');
        let is_clear_point = |field: String| {
            field.contains('.') && value::number(&field, None).is_some() && !is_in_thousands(&field)
        };
        if fields().any(is_clear_point) {
            return Fractions::Point;
        }
        let is_comma = |field: String| {
            let is_number = value::number(&field, Some(Decimal::Comma)).is_some();
            // `1,234` may be a thousand and more; behind a thousand a comma stands before a fraction.
            let is_large =
                |whole: &str| value::number(whole, None).is_some_and(|whole| whole.abs() >= 1e3);
            let is_clear = |(whole, fraction): (&str, &str)| {
                fraction.len() != 3 || whole == "0" || is_large(whole)
            };
            is_number && field.split_once(',').is_some_and(is_clear)
        };
        if fields().any(is_comma) {
            return Fractions::Comma;
        }
        // Who writes three digits behind a point writes them behind 998 too.
        let width = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let is_open = |column: usize| {
            let fields = || {
                let fields = self.rows.iter().skip(1).filter_map(|row| row.get(column));
                fields.map(plain)
            };
            let is_whole = |field: String| {
                field.len() == 3 && field.bytes().all(|digit| digit.is_ascii_digit())
            };
            fields().any(is_whole) && fields().any(|field| is_in_thousands(&field))
        };
        match (0..width).find(|column| is_open(*column)) {
            Some(column) => Fractions::Open { column },
            None => Fractions::Point,
        }
    }

    /// The column of a table between semicolons or tabs whose fields all may be thousands, as `1.452` of a plant that writes
    /// commas before fractions.
    pub(super) fn thousands(&self) -> Option<usize> {
        let width = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let may_be = |column: &usize| {
            let fields = self.rows.iter().skip(1).filter_map(|row| row.get(*column));
            let filled: Vec<&String> = fields.filter(|field| !field.is_empty()).collect();
            let mut fields = filled.iter();
            let are_thousands = fields.all(|field| value::is_in_thousands(field, '.'));
            filled.len() > 1 && are_thousands
        };
        (0..width)
            .filter(|_| [b';', b'\t'].contains(&self.delimiter))
            .find(may_be)
    }

    /// The title of a column.
    pub(super) fn title(&self, column: usize) -> &str {
        let titles = self.rows.first();
        titles
            .and_then(|titles| titles.get(column))
            .map_or("", String::as_str)
    }
}

/// The column of the time by its title, or by fields that are all times.
fn likely_time(titles: &[&str], rows: &[Vec<String>]) -> usize {
    let are_stamps = |column: &usize| all_fields(rows, *column, &stamp::is_one);
    let is_called =
        |column: &usize| is_called_time(titles[*column]) && all_fields(rows, *column, &is_data);
    let is_titled = |title: &str| {
        let (name, unit) = time_name_and_unit(title);
        let letters = name.chars().filter(|letter| letter.is_alphanumeric());
        let plain: String = letters.flat_map(char::to_lowercase).collect();
        names::TIMES.contains(&plain.as_str())
            || !unit.is_empty() && units::parse_time(unit).is_some()
    };
    let is_first = titles.first().is_none_or(|title| is_titled(title));
    let is_first = is_first || is_called(&0) || are_stamps(&0);
    let mut called = (1..titles.len()).filter(is_called);
    match (called.next(), called.next()) {
        _ if is_first => 0,
        (Some(time), None) => time,
        _ => (1..titles.len()).find(are_stamps).unwrap_or(0),
    }
}

/// A head up to its last line, which may be cut; that of a whole text is not.
fn without_cut_line(head: &[u8]) -> &[u8] {
    match head.len() as u64 >= HEAD_BYTES {
        true => whole_lines(head),
        false => head,
    }
}

/// The first rows of a table, so many at the most, with that of its titles.
fn table_rows(text: &[u8], delimiter: u8, shape: &Shape, most: usize) -> Vec<Vec<String>> {
    let mut table = TableRows::of(text, delimiter, shape);
    let field = |field: &[u8]| String::from_utf8_lossy(field).trim().to_owned();
    let mut record = ByteRecord::new();
    let mut rows = Vec::new();
    while rows.len() < most && read_row(&mut table, &mut record).is_ok_and(|is_one| is_one) {
        rows.push(record.iter().map(field).collect());
    }
    rows
}

/// The format of rows that describe themselves.
fn described(rows: &[Vec<String>]) -> Option<Format> {
    let first = rows.first()?;
    let has = |name: &str| first.iter().any(|title| title == name);
    let is_annotation =
        |title: &String| ["#group", "#datatype", "#default", "#constant"].contains(&title.as_str());
    if first.first().is_some_and(is_annotation) || (has("_time") && has("_value")) {
        return Some(Format::InfluxCsv);
    }
    let times = first
        .iter()
        .filter(|title| title.eq_ignore_ascii_case("time"));
    let mut second = rows.get(1).into_iter().flatten();
    let is_description = |field: &String| {
        let mut keys = ["Unit:", "Interp:", "Type:"].iter();
        keys.any(|key| field.starts_with(key) && field.len() > key.len())
    };
    let is_simulink = times.count() > 1 || second.any(is_description);
    is_simulink.then_some(Format::SimulinkCsv)
}

/// The delimiter and the shape of a text that begins with the head of an instrument, where no option says which rows
/// have the titles and the units.
fn headed(text: &[u8], options: &TableOptions) -> Option<(u8, Shape)> {
    let is_open = options.header_row.is_none() && options.unit_row.is_none();
    let first_line = text.split(|byte| *byte == b'\n').next()?;
    if !is_open || !instruments::may_begin(first_line) {
        return None;
    }
    let mut delimiters = DELIMITERS.into_iter().chain([b' ']);
    delimiters.find_map(|delimiter| {
        let rows = first_rows(text, delimiter);
        let head = instruments::head_of(&rows)?;
        Some((delimiter, Shape::of_head(&rows, head)?))
    })
}

/// The delimiter of a text and the shape of its rows: those with the most columns of data.
fn shape_of(text: &[u8], options: &TableOptions) -> (u8, Shape) {
    let start = text.trim_ascii_start();
    let first_line = start.split(|byte| *byte == b'\n').next().unwrap_or(start);
    let likely = delimiter(first_line);
    let first = first_rows(text, likely);
    let words = |record: &ByteRecord| {
        let fields = record
            .iter()
            .map(|field| String::from_utf8_lossy(field).trim().to_owned());
        fields.collect::<Vec<String>>()
    };
    let of_blanks = first_rows(text, b' ');
    let are_numbers = |record: &ByteRecord| {
        let mut fields = record.iter().map(String::from_utf8_lossy);
        record.len() > 1 && fields.all(|field| is_data(&field))
    };
    let plain = match of_blanks.first().is_some_and(are_numbers) {
        true if !DELIMITERS.iter().any(|sign| first_line.contains(sign)) => {
            (b' ', Shape::plain(&of_blanks))
        }
        _ => (likely, Shape::plain(&first)),
    };
    if described(&first.iter().take(2).map(words).collect::<Vec<_>>()).is_some() {
        return plain;
    }
    let unlikely = DELIMITERS.into_iter();
    let unlikely = unlikely.filter(|delimiter| *delimiter != likely && text.contains(delimiter));
    let unlikely =
        unlikely.map(|delimiter| (delimiter, Shape::of(&first_rows(text, delimiter), options)));
    // Among delimiters with as many columns the last is taken.
    let all = unlikely.chain([(likely, Shape::of(&first, options))]);
    let best = all.filter_map(|(delimiter, shape)| Some((delimiter, shape?)));
    let best = best.max_by_key(|(_, shape)| shape.columns());
    if best.as_ref().is_some_and(|(_, shape)| shape.columns() > 1) {
        return best.unwrap_or(plain);
    }
    let of_blanks = Shape::of(&of_blanks, options);
    let of_blanks = of_blanks.filter(|shape| shape.columns() > 1 && shape.is_even());
    of_blanks
        .map(|shape| (b' ', shape))
        .or(best)
        .unwrap_or(plain)
}

/// The first rows of a text, from its first line on.
pub(super) fn first_rows(text: &[u8], delimiter: u8) -> Vec<ByteRecord> {
    let mut rows = TextRows::of(text, delimiter);
    let mut first = Vec::new();
    let mut record = ByteRecord::new();
    while first.len() < TOP_ROWS && rows.read(&mut record).is_ok_and(|is_one| is_one) {
        first.push(record.clone());
    }
    first
}

/// How numbers write fractions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fractions {
    /// With a point, or not at all.
    Point,
    /// With a comma.
    Comma,
    /// The points of a column may stand before fractions or between thousands.
    Open { column: usize },
}

/// The delimiter that stands most often in the header row, outside quotes.
fn delimiter(head: &[u8]) -> u8 {
    let mut counts = DELIMITERS.map(|delimiter| (delimiter, 0_usize));
    let mut quoted = false;
    for byte in head.trim_ascii() {
        quoted ^= *byte == b'"';
        for (delimiter, count) in &mut counts {
            *count += usize::from(!quoted && byte == delimiter);
        }
    }
    counts
        .into_iter()
        .rev()
        .max_by_key(|(_, count)| *count)
        .map_or(b',', |(delimiter, _)| delimiter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_delimiter_is_told_from_the_header() {
        assert_eq!(delimiter(b"time [s],a,b\r"), b',');
        assert_eq!(delimiter(b"time [s];\"a, b, c, d\";b"), b';');
        assert_eq!(delimiter(b"time [s]\ta\tb"), b'\t');
        assert_eq!(delimiter(b"time"), b',');
    }

    #[test]
    fn fractions_are_judged_over_all_columns_together() {
        let fractions = |text: &str| Sniff::new(text.as_bytes(), &Options::default()).fractions();
        assert_eq!(fractions("t;a\n0;0,5\n"), Fractions::Comma);
        assert_eq!(fractions("t;a\n0;12,25\n"), Fractions::Comma);
        assert_eq!(fractions("t;a\n0;1,234\n"), Fractions::Point);
        assert_eq!(fractions("t;a\n0;1,5\n1;2.5\n"), Fractions::Point);
        assert_eq!(fractions("t,a\n0,5\n"), Fractions::Point);
        assert_eq!(
            fractions("t;p;T\n0;998;20,5\n1;1.052;20,6\n"),
            Fractions::Comma
        );
        assert_eq!(
            fractions("t;p\n0;998\n1;1.052\n"),
            Fractions::Open { column: 1 }
        );
        assert_eq!(fractions("t;p\n0;998\n1;1.052\n2;1.05\n"), Fractions::Point);
        assert_eq!(fractions("t;p\n0.001;1\n0.002;1\n"), Fractions::Point);
        assert_eq!(fractions("t;p\n1.052;1\n1.053;1\n"), Fractions::Point);
    }
}
