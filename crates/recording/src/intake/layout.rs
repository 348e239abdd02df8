//! The layout of a table of text as its first rows show it, under the options that are given: for people who
//! confirm it or say otherwise before the whole is read.

use crate::Warning;
use greybox_numerics::parsing::Fault;
use serde::Serialize;
use utoipa::ToSchema;

/// The most rows that are shown.
pub const MOST_ROWS: usize = 30;

/// How the beginning of a text is read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, ToSchema)]
pub struct Layout {
    /// The name of the format of the text, or of the rows of a file that is no text.
    #[schema(value_type = String, example = "wide_csv")]
    pub format: &'static str,
    /// The format of the file whose rows these are, `excel` or `parquet`; none of a text.
    #[schema(value_type = Option<String>, example = "excel")]
    pub file: Option<&'static str>,
    /// The worksheet of a workbook that is read.
    pub sheet: Option<String>,
    /// The worksheets of a workbook that can be seen.
    pub sheets: Vec<String>,
    /// What separates the fields; none where the source is no table of text.
    pub delimiter: Option<char>,
    /// The line of the titles, from 1.
    pub header_row: Option<u64>,
    /// The line of the units, from 1.
    pub unit_row: Option<u64>,
    /// The line of the first row of the table below its titles, from 1.
    pub first_row: Option<u64>,
    /// What the columns are, in the order of the text.
    pub columns: Vec<LayoutColumn>,
    /// The first rows, as they stand in the text.
    pub rows: Vec<LayoutRow>,
    /// What would be assumed or left out.
    pub warnings: Vec<Warning>,
    /// What would be refused.
    pub faults: Vec<Fault>,
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct LayoutColumn {
    /// The title as it stands in the text.
    pub title: String,
    /// The title without its unit.
    pub name: String,
    /// The unit in the title or in the row of units, as it is written.
    pub unit: String,
    /// What the column holds.
    pub role: ColumnRole,
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ColumnRole {
    /// The time, or a part of it.
    Time,
    /// A signal.
    Signal,
    /// The name of the signal of a row.
    Tag,
    /// The value of the signal that the row names.
    Value,
    /// How good the value is.
    Quality,
    /// The unit of the signal that the row names.
    Unit,
    /// Nothing that is read.
    LeftOut,
}

/// A row as it stands in the text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct LayoutRow {
    /// The line at which the row begins, from 1.
    pub line: u64,
    /// The fields.
    pub fields: Vec<String>,
}
