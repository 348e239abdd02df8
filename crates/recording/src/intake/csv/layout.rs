//! What the first rows of a table are taken for.

use super::super::layout::{ColumnRole, Layout, LayoutColumn, LayoutRow, MOST_ROWS};
use super::super::options::Options;
use super::super::{Format, title};
use super::fields::line_of;
use super::header::time_column;
use super::sniff::{Sniff, first_rows};
use super::top_rows::fields_of;
use std::io;

/// How a table is read that begins so.
///
/// # Errors
/// When no memory can be had.
pub(in crate::intake) fn layout(
    format: Format,
    head: &[u8],
    options: &Options,
) -> io::Result<Layout> {
    let table = options.skip.left_out(head)?;
    let sniff = Sniff::new(&table, options);
    let records = first_rows(&table, sniff.delimiter);
    // The lines that are left out are shown too.
    let shown = first_rows(head, sniff.delimiter);
    let rows = shown.iter().take(MOST_ROWS).map(|record| LayoutRow {
        line: line_of(record),
        fields: fields_of(record),
    });
    let shape = &sniff.shape;
    let describes_itself = matches!(format, Format::SimulinkCsv | Format::InfluxCsv);
    let roles = match describes_itself {
        true => Vec::new(),
        false => roles(format, &sniff, options),
    };
    let titles = shape.titles().into_iter().enumerate();
    let columns = titles.map(|(k, title)| {
        let role = match shape.is_time(k) {
            true => Some(ColumnRole::Time),
            false => shape
                .table_column(k)
                .and_then(|column| roles.get(column).copied()),
        };
        let (name, unit) = title::name_and_unit(&title);
        LayoutColumn {
            name: name.to_owned(),
            unit: shape.unit(k).unwrap_or(unit).to_owned(),
            role: role.unwrap_or(ColumnRole::LeftOut),
            title,
        }
    });
    Ok(Layout {
        delimiter: Some(char::from(sniff.delimiter)),
        header_row: shape.header_line(),
        unit_row: shape.unit_line(),
        first_row: records.get(shape.top()).map(line_of),
        columns: columns.filter(|_| !describes_itself).collect(),
        rows: rows.collect(),
        ..Layout::default()
    })
}

/// What the columns of the table hold, whose time is one column.
fn roles(format: Format, sniff: &Sniff, options: &Options) -> Vec<ColumnRole> {
    let titles = sniff.titles();
    let columns = 0..titles.len();
    if let (Format::LongCsv, Ok(Some(long))) = (format, sniff.long_columns(options)) {
        return columns.map(|column| long.role(column)).collect();
    }
    if let (Format::PairedCsv, Some(paired)) = (format, sniff.paired_columns()) {
        return columns.map(|column| paired.role(column)).collect();
    }
    let time = match options.time.as_deref() {
        Some(wanted) => time_column(&titles, wanted),
        None => Some(sniff.time()),
    };
    let is_ignored = |column: usize| {
        let name = title::name_and_unit(titles[column]).0;
        options.ignore.iter().any(|ignored| ignored == name)
    };
    columns
        .map(|column| match Some(column) == time {
            true => ColumnRole::Time,
            false if is_ignored(column) => ColumnRole::LeftOut,
            false => ColumnRole::Signal,
        })
        .collect()
}
