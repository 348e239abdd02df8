//! Rows of a head, each a label with what it says of the columns.

use crate::intake::csv::top_rows::fields_of;
use crate::intake::options::Decimal;
use crate::intake::value;
use ::csv::ByteRecord;

/// The first rows of a text.
pub(super) struct Facts {
    pub(super) rows: Vec<Vec<String>>,
}

impl Facts {
    pub(super) fn of(records: &[ByteRecord]) -> Self {
        let rows = records.iter().map(fields_of).collect();
        Self { rows }
    }

    /// A field of a row.
    pub(super) fn field(&self, row: usize, column: usize) -> Option<&str> {
        self.rows.get(row)?.get(column).map(String::as_str)
    }

    /// The last row that begins with a label.
    pub(super) fn row(&self, label: &str) -> Option<usize> {
        let begins = |row: &Vec<String>| row.first().is_some_and(|first| first == label);
        self.rows.iter().rposition(begins)
    }

    /// What the last row of a label says behind it.
    pub(super) fn of_label(&self, label: &str) -> Option<&[String]> {
        self.rows.get(self.row(label)?)?.get(1..)
    }

    /// The one thing that the row of a label says of all columns.
    pub(super) fn single(&self, label: &str) -> Option<&str> {
        let (first, further) = self.of_label(label)?.split_first()?;
        let is_same = further.iter().all(|field| field == first);
        is_same.then_some(first.as_str())
    }

    /// The number that the row of a label says of all columns.
    pub(super) fn number(&self, label: &str) -> Option<f64> {
        number(self.single(label)?)
    }
}

/// A number, whichever sign stands before its fraction.
pub(super) fn number(text: &str) -> Option<f64> {
    let read = |decimal| value::number(text, Some(decimal));
    let number = read(Decimal::Point).or_else(|| read(Decimal::Comma));
    number.filter(|number| number.is_finite())
}

/// A name with its unit.
pub(super) fn titled(name: &str, unit: &str) -> String {
    match unit {
        "" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    }
}

/// Names with their units, which may be fewer.
pub(super) fn all_titled(names: &[String], units: &[String]) -> Vec<String> {
    let unit = |column: usize| units.get(column).map_or("", String::as_str);
    let names = names.iter().enumerate();
    names.map(|(k, name)| titled(name, unit(k))).collect()
}
