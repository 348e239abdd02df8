//! Recordings from CSV, in one pass over the text.
//!
//! A header row names the columns and their units: `time [s],reference [m],position [mm]`. One
//! column, the first unless [`Options::time`] names another or another one alone looks so, is the time (`clock`). An
//! empty field and `NaN` are missing samples. Comma, semicolon, tab, `|` or blanks are told from the
//! first rows; empty rows and empty fields at the ends of lines are understood. Lines above the titles, a row of units, a time in
//! several columns and titles that come again are put right first (`shape`), for every kind of table.
//!
//! Of a text with a column for each signal (`table`) memory holds the values (eight bytes each)
//! or, where there is a scratch, a few MiB of them; never the text. Those with a row for each sample
//! (`long`), with times or qualities beside each signal (`paired`), of Simulink (`simulink`) and of InfluxDB (`influx`) are held as tags.

mod below;
mod fields;
mod header;
mod influx;
mod instruments;
mod layout;
mod long;
mod long_columns;
mod paired;
mod rows;
mod shape;
mod simulink;
mod sniff;
mod split_time;
mod table;
mod tag_units;
mod top_rows;

use super::error::{at_line, invalid};
use super::memory::Memory;
use super::options::{Decimal, Options, TimeUnit};
use super::title::name_and_unit;
use super::{Format, ReadError};
use crate::{NewScratch, ReceivedRecording, Warning};
use ::csv::ByteRecord;
pub(super) use fields::time_name_and_unit;
use greybox_numerics::parsing::Fault;
use header::Header;
pub(super) use layout::layout;
pub(super) use long_columns::{LongColumns, ValueColumns};
use rows::{TableRows, read_row};
use sniff::{Fractions, Sniff};
use std::io::Read;
use table::CsvTable;

/// What kind of CSV begins so.
pub(super) fn recognised(head: &[u8], options: &Options) -> Format {
    Sniff::new(head, options).format(options)
}

/// A text whose beginning has been read to see what it is: the `whole` begins with the `head`.
pub(super) struct SniffedText<'h, R> {
    pub(super) head: &'h [u8],
    pub(super) whole: R,
}

/// Reads a text as one of the formats that are CSV.
pub(super) fn receive_as(
    format: Format,
    text: SniffedText<'_, impl Read>,
    options: &Options,
    scratch: Option<NewScratch>,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let sniff = Sniff::new(text.head, options);
    let mut notes = Vec::new();
    let mut options = options.clone();
    match sniff.fractions() {
        _ if options.decimal.is_some() => {}
        Fractions::Point => {
            let detail = "the points were read before fractions; where they stand between thousands, say `decimal=,`";
            let note = |column| {
                Warning::of_signal(
                    "decimal_point",
                    name_and_unit(sniff.title(column)).0,
                    detail.to_owned(),
                )
            };
            notes.extend(sniff.thousands().map(note));
        }
        Fractions::Comma => {
            options.decimal = Some(Decimal::Comma);
            let detail = "numbers have a decimal comma; `decimal` says otherwise".to_owned();
            notes.push(Warning::of_recording("decimal_comma", detail));
        }
        Fractions::Open { column } => {
            let title = sniff.title(column);
            let detail = "the points may stand before fractions or between thousands, as in `1.052` beside `998`: \
                          say `decimal`, `.` or `,`";
            let fault = at_line(1, Some(title), "decimal_unclear", detail);
            return Err(invalid(fault));
        }
    }
    if let Some(fault) = sniff.shape.fault() {
        return Err(invalid(fault));
    }
    notes.extend(sniff.shape.notes());
    if let Some(head) = &sniff.shape.head {
        options.begin.clone_from(&head.begin);
        let step = head.step.map(TimeUnit::Seconds);
        options.time_unit = options.time_unit.or(step);
    }
    // Every row ends with its line, the last one too.
    let whole = text.whole.chain(&b"\n"[..]);
    let rows = TableRows::of(whole, sniff.delimiter, &sniff.shape);
    let repeated = rows.repeated();
    let mut received = match format {
        Format::LongCsv => {
            let columns = sniff.long_columns(&options)?;
            let mut tags = long::read(rows, columns, &options, memory)?;
            tag_units::describe(&mut tags, sniff.shape.above());
            tags.into_received("long_csv")
        }
        Format::PairedCsv => paired::read(rows, sniff.paired_columns(), &options, memory),
        Format::SimulinkCsv => simulink::read(rows, &options, memory),
        Format::InfluxCsv => influx::read(rows, &options, memory),
        _ => {
            let sniffed = SniffedText {
                head: text.head,
                whole: rows,
            };
            wide(sniffed, &sniff, &options, scratch)
        }
    }?;
    if repeated.get() > 0 {
        let detail = format!("{} rows left out that repeat the titles", repeated.get());
        notes.push(Warning::of_recording("repeated_titles", detail));
    }
    received.header.notes.splice(0..0, notes);
    Ok(received)
}

fn wide(
    text: SniffedText<'_, TableRows<'_, impl Read>>,
    sniff: &Sniff,
    options: &Options,
    scratch: Option<NewScratch>,
) -> Result<ReceivedRecording, ReadError> {
    if let Some(title) = sniff.mixed_column() {
        let detail = format!(
            "rows of one time differ by `{title}`, and several columns have numbers: say `tag`, such as `{title}`, \
             and each of these columns is a signal of what that column names"
        );
        return Err(invalid(Fault {
            parameter: Some("tag".into()),
            ..at_line(1, None, "layout_unclear", detail)
        }));
    }
    let mut rows = text.whole;
    let mut record = ByteRecord::new();
    read_row(&mut rows, &mut record)?;
    let header = Header::parse(&record, sniff.time(), options)?;
    let times = sniff.column(text.head, header.time);
    let are_repeated = sniff.are_repeated(header.time);
    let time_column = (header.time > 0 && options.time.is_none()).then(|| {
        let detail = format!(
            "`{}` was taken for the time, which the first column is not; `time` says otherwise",
            header.names[header.time]
        );
        Warning::of_recording("time_column", detail)
    });
    let mut table = CsvTable::new(header, options, scratch);
    table.look_ahead(&times, are_repeated);
    while !table.is_full() && read_row(&mut rows, &mut record)? {
        table.push(&record).map_err(ReadError::Scratch)?;
    }
    let mut received = table.into_received()?;
    received.header.notes.splice(0..0, time_column);
    Ok(received)
}

#[cfg(test)]
mod tests;
