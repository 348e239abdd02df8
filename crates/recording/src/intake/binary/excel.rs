//! A worksheet of an Excel workbook (`.xlsx`).

use super::super::error::{at_line, broken, invalid, malformed};
use super::super::memory::Memory;
use super::converted::{
    ConvertedRows, RowText, TEXT_AT_ONCE, Worksheets, WriteRows, push_field, push_number,
};
use super::workbook;
use crate::intake::ReadError;
use crate::intake::options::Options;
use crate::{MAX_SIGNALS, Warning};
use bytes::Bytes;
use calamine::{
    Cell, DataRef, ExcelDateTime, Reader, SheetType, SheetVisible, Xlsx, XlsxCellReader, XlsxError,
};
use greybox_numerics::parsing::Fault;
use std::io::{self, Cursor, Write};

/// The rows of a worksheet, at the most: those that Excel has.
const MOST_ROWS: u32 = 1 << 20;
/// Seconds in a day.
const DAY_S: f64 = 86_400.0;

type WorkbookBytes = Cursor<Bytes>;

/// Opens a workbook and hands the rows of a worksheet over.
pub(super) fn with_rows<T>(
    bytes: Bytes,
    options: &Options,
    memory: &Memory,
    take: impl FnOnce(ConvertedRows<'_>) -> Result<T, ReadError>,
) -> Result<T, ReadError> {
    if !bytes.starts_with(b"PK") {
        return Err(ReadError::Unsupported(
            "this is an Excel workbook of the form before 2007, or a protected one: recognised, \
             and not read here; save it as .xlsx without a password"
                .to_owned(),
        ));
    }
    let checked = workbook::checked(bytes, memory)?;
    let mut workbook = Xlsx::new(Cursor::new(checked)).map_err(|error| not_read(&error))?;
    let (sheet, notes) = sheet(&mut workbook, options)?;
    let seen = workbook
        .sheets_metadata()
        .iter()
        .filter(|sheet| is_seen(sheet));
    let sheets = Worksheets {
        seen: seen.map(|sheet| sheet.name.clone()).collect(),
        shown: Some(sheet.clone()),
    };
    let cells = workbook.worksheet_cells_reader(&sheet);
    let cells = cells.map_err(|error| not_read(&error))?;
    let rows = RowText::new(Sheet {
        cells,
        next: None,
        is_over: false,
        row: 0,
        header: None,
    });
    let other_sheets = notes.first().map(|note| note.detail.clone());
    let rows = ConvertedRows {
        text: Box::new(rows),
        notes,
        sheets,
    };
    take(rows).map_err(|error| match other_sheets {
        Some(detail) => error.with(Fault::of_parameter("sheet", "other_sheets", detail)),
        None => error,
    })
}

fn not_read(error: &XlsxError) -> ReadError {
    let detail = format!("this is no Excel workbook that can be read: {error}");
    malformed(Fault::of_whole("not_a_workbook", detail))
}

/// The sheet to read: the one that an option names, or the first that can be seen and has cells.
fn sheet(
    workbook: &mut Xlsx<WorkbookBytes>,
    options: &Options,
) -> Result<(String, Vec<Warning>), ReadError> {
    let sheets = workbook.sheets_metadata().iter();
    let sheets = sheets.filter(|sheet| sheet.typ == SheetType::WorkSheet);
    let sheets: Vec<_> = sheets.cloned().collect();
    let names = |sheets: &[calamine::Sheet]| {
        let names = sheets.iter().map(|sheet| format!("`{}`", sheet.name));
        names.collect::<Vec<_>>().join(", ")
    };
    if let Some(wanted) = &options.sheet {
        if sheets.iter().any(|sheet| sheet.name == *wanted) {
            return Ok((wanted.clone(), Vec::new()));
        }
        let detail = format!("the workbook has {}, not `{wanted}`", names(&sheets));
        let fault = Fault::of_parameter("sheet", "invalid_parameter", detail);
        return Err(invalid(fault));
    }
    let mut filled = Vec::new();
    for sheet in sheets {
        if is_seen(&sheet) && has_cells(workbook, &sheet.name)? {
            filled.push(sheet);
        }
    }
    let Some(first) = filled.first() else {
        let fault = Fault::of_whole(
            "empty",
            "no worksheet of the workbook has anything in it".to_owned(),
        );
        return Err(malformed(fault));
    };
    let note = (filled.len() > 1).then(|| {
        let (read, unread) = (&first.name, names(&filled[1..]));
        let detail = format!("`{read}` was read, not {unread}; `sheet` says otherwise");
        Warning::of_recording("other_sheets", detail)
    });
    Ok((first.name.clone(), note.into_iter().collect()))
}

/// Whether a sheet is one of cells that is not hidden.
fn is_seen(sheet: &calamine::Sheet) -> bool {
    sheet.typ == SheetType::WorkSheet && sheet.visible == SheetVisible::Visible
}

fn has_cells(workbook: &mut Xlsx<WorkbookBytes>, name: &str) -> Result<bool, ReadError> {
    let mut cells = match workbook.worksheet_cells_reader(name) {
        Ok(cells) => cells,
        Err(error) => return Err(not_read(&error)),
    };
    while let Some(cell) = cells.next_cell().map_err(|error| not_read(&error))? {
        if *cell.get_value() != DataRef::Empty {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The rows of a sheet.
struct Sheet<'w> {
    cells: XlsxCellReader<'w, WorkbookBytes>,
    /// The first cell of the next row.
    next: Option<Cell<DataRef<'w>>>,
    /// Whether there are no more cells; asked again, the reader would take that for an error.
    is_over: bool,
    /// The rows that have been written.
    row: u32,
    /// The columns of the header, the first and the one after the last.
    header: Option<(u32, u32)>,
}

impl<'w> Sheet<'w> {
    fn next(&mut self) -> io::Result<Option<Cell<DataRef<'w>>>> {
        if let Some(cell) = self.next.take() {
            return Ok(Some(cell));
        }
        while !self.is_over {
            let cell = self.cells.next_cell().map_err(|error| {
                let detail = format!("the worksheet is broken: {error}");
                broken(at_line(
                    u64::from(self.row) + 1,
                    None,
                    "not_a_workbook",
                    detail,
                ))
            })?;
            match cell {
                Some(cell) if *cell.get_value() == DataRef::Empty => {}
                Some(cell) => return Ok(Some(cell)),
                None => self.is_over = true,
            }
        }
        Ok(None)
    }

    /// Adds the row of this cell.
    fn write_row(&mut self, first: Cell<DataRef<'w>>, text: &mut Vec<u8>) -> io::Result<()> {
        let (row, _) = first.get_position();
        let out_of_place = |detail: &str| {
            let line = u64::from(row) + 1;
            broken(at_line(line, None, "out_of_place", detail))
        };
        if row < self.row || row >= MOST_ROWS {
            return Err(out_of_place("rows do not follow each other"));
        }
        text.resize(text.len() + (row - self.row) as usize, b'\n');
        let begin = self
            .header
            .map_or(first.get_position().1, |(begin, _)| begin);
        let mut column = begin;
        let mut cell = Some(first);
        while let Some(filled_cell) = cell.take() {
            let (of, place) = filled_cell.get_position();
            if of != row {
                self.next = Some(filled_cell);
                break;
            }
            if place < column {
                let detail = match place < begin {
                    true => "there is something left of the header",
                    false => "cells do not follow each other",
                };
                return Err(out_of_place(detail));
            }
            if place - begin > MAX_SIGNALS as u32 {
                return Err(out_of_place(
                    "there are more columns than signals can be stored",
                ));
            }
            text.resize(text.len() + (place - column) as usize, b',');
            column = place;
            write_value(text, filled_cell.get_value())?;
            cell = self.next()?;
        }
        // Cells at the end of a row that have nothing in them need not be there.
        let (_, end) = self.header.get_or_insert((begin, column + 1));
        *end = column.saturating_add(1).max(*end);
        text.resize(text.len() + end.saturating_sub(column + 1) as usize, b',');
        text.push(b'\n');
        self.row = row + 1;
        Ok(())
    }
}

impl WriteRows for Sheet<'_> {
    fn write(&mut self, text: &mut Vec<u8>) -> io::Result<bool> {
        while text.len() < TEXT_AT_ONCE {
            let Some(first) = self.next()? else {
                return Ok(!text.is_empty());
            };
            self.write_row(first, text)?;
        }
        Ok(true)
    }
}

fn write_value(text: &mut Vec<u8>, value: &DataRef<'_>) -> io::Result<()> {
    match value {
        DataRef::Empty => Ok(()),
        DataRef::Int(number) => write!(text, "{number}"),
        DataRef::Float(number) => {
            push_number(text, *number);
            Ok(())
        }
        DataRef::Bool(true) => write!(text, "TRUE"),
        DataRef::Bool(false) => write!(text, "FALSE"),
        DataRef::Error(error) => write!(text, "{error}"),
        DataRef::DateTime(time) => write_time(text, time),
        DataRef::String(words) | DataRef::DateTimeIso(words) | DataRef::DurationIso(words) => {
            push_field(text, words);
            Ok(())
        }
        DataRef::SharedString(words) => {
            push_field(text, words);
            Ok(())
        }
    }
}

/// A date in local time, to the millisecond that Excel shows; a duration or a time of day in seconds.
fn write_time(text: &mut Vec<u8>, time: &ExcelDateTime) -> io::Result<()> {
    let days = time.as_f64();
    if time.is_duration() || (0.0..1.0).contains(&days) {
        return write!(text, "{}", (days * DAY_S * 1e6).round() / 1e6);
    }
    let (year, month, day, hour, minute, second, millisecond) = time.to_ymd_hms_milli();
    write!(
        text,
        "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{millisecond:03}"
    )
}
