//! A stretch of a series as a body that a stream takes.

use std::collections::BTreeMap;
use std::ops::Range;

use jiff::Timestamp;

use super::series::SourceColumn;

/// Rows of a series in the order of their instants, or a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SeriesPage {
    /// CSV with a line of titles, or the bytes of a file.
    pub body: Vec<u8>,
    /// The type of the body.
    pub content_type: &'static str,
    /// The rows; 0 for a file.
    pub rows: u64,
    /// The instant of the last row, or that at which the file came; absent where there is none.
    pub newest: Option<Timestamp>,
    /// The name of the file.
    pub file: Option<String>,
    /// Why the file is not read, which keeps no later file back.
    pub refusal: Option<String>,
    /// How the server is to read the body, beside what the series says: options of a batch by their names.
    pub options: BTreeMap<&'static str, String>,
}

/// Which rows of a series are asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadStretch {
    /// Rows after the start of it, up to and with its end.
    pub between: Range<Timestamp>,
    /// About as many rows at the most.
    pub rows: u32,
}

/// A page that is written row by row.
pub(super) struct PageWriter(SeriesPage);

impl PageWriter {
    /// A page with the titles of columns: the time, then each signal with its unit and perhaps its quality.
    pub(super) fn new(columns: &[SourceColumn]) -> Self {
        let mut titles = vec!["time".to_owned()];
        for column in columns {
            let signal = &column.signal;
            let unit = column.unit.as_ref();
            let unit = unit.map_or(String::new(), |unit| format!(" [{unit}]"));
            titles.push(format!("{signal}{unit}"));
            titles.extend(
                column
                    .quality
                    .is_some()
                    .then(|| format!("{signal}.Quality")),
            );
        }
        let mut writer = Self(SeriesPage {
            content_type: "text/csv",
            ..SeriesPage::default()
        });
        let titles: Vec<&str> = titles.iter().map(String::as_str).collect();
        writer.line(&titles);
        writer
    }

    /// Adds a row of cells, its time first.
    pub(super) fn row(&mut self, instant: Timestamp, cells: &[&str]) {
        let time = instant.to_string();
        let cells: Vec<&str> = std::iter::once(&*time)
            .chain(cells.iter().copied())
            .collect();
        self.line(&cells);
        self.0.rows += 1;
        self.0.newest = Some(instant);
    }

    /// Says how the server is to read the page.
    pub(super) fn option(&mut self, name: &'static str, text: &str) {
        self.0.options.insert(name, text.to_owned());
    }

    /// Adds rows that are CSV already.
    pub(super) fn lines(&mut self, csv: &[u8]) {
        self.0.body.extend_from_slice(csv);
    }

    /// The page.
    pub(super) fn done(self) -> SeriesPage {
        self.0
    }

    fn line(&mut self, cells: &[&str]) {
        for (place, cell) in cells.iter().enumerate() {
            if place > 0 {
                self.0.body.push(b',');
            }
            let is_plain = !cell.contains([',', '"', '\n', '\r']);
            match is_plain {
                true => self.0.body.extend_from_slice(cell.as_bytes()),
                false => {
                    let quoted = format!("\"{}\"", cell.replace('"', "\"\""));
                    self.0.body.extend_from_slice(quoted.as_bytes());
                }
            }
        }
        self.0.body.push(b'\n');
    }
}
