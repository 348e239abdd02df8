//! Heads of programs that record: `LabVIEW`, `TwinCAT`, Octave and paperless recorders.

use super::facts::{Facts, all_titled, number, titled};
use super::head::InstrumentHead;
use jiff::Timestamp;

/// `LabVIEW Measurement`: `Date` and `Time` of the channels, from which `X_Value` counts where all have the same ones,
/// and their units.
pub(super) fn labview(facts: &Facts) -> Option<InstrumentHead> {
    let row = facts.row("X_Value")?;
    let moment = facts.single("Date").zip(facts.single("Time"));
    // A comment is a column that rows have no field for.
    let below = facts.rows.get(row + 1..)?;
    let width = below.iter().map(Vec::len).max()?;
    let names = facts.rows[row].get(1..width)?;
    let is_again = |name: &String| name == "X_Value";
    let units = facts.of_label("Y_Unit_Label").unwrap_or_default();
    let time_title = match facts.single("X_Dimension") {
        Some("Time") => "X_Value [s]",
        _ => "X_Value",
    };
    let titles = [vec![time_title.to_owned()], all_titled(names, units)].concat();
    let begin = moment.map(|(date, time)| format!("{date} {time}"));
    (!names.iter().any(is_again)).then(|| InstrumentHead {
        titles,
        begin,
        ..InstrumentHead::of_source("a LabVIEW measurement", row + 1)
    })
}

/// The export of a `TwinCAT` scope: a block of facts for each signal, whose times are milliseconds from `Starttime of
/// export`, which Windows counts.
pub(super) fn twincat(facts: &Facts) -> Option<InstrumentHead> {
    /// From 1601 to 1970 in tenths of a microsecond.
    const BEFORE_1970: i128 = 116_444_736_000_000_000;
    let start = facts.of_label("Starttime of export")?.first()?;
    let start = (start.parse::<i128>().ok()?.checked_sub(BEFORE_1970)?).checked_mul(100)?;
    let begin = Timestamp::from_nanosecond(start).ok()?.to_string();
    let (names, units) = (facts.row("Name")?, facts.row("Unit")?);
    let steps = facts.rows.get(facts.row("SampleTime[ms]")?)?;
    let is_data = |row: &Vec<String>| row.first().is_some_and(|time| number(time).is_some());
    let mut data = (units..facts.rows.len()).filter(|row| is_data(&facts.rows[*row]));
    let (first, second) = (data.next()?, data.next()?);
    let fields = &facts.rows[names];
    let title = |column: usize| match column % 2 {
        0 => Some("Time [ms]".to_owned()),
        _ => Some(titled(
            fields.get(column)?,
            facts.field(units, column).unwrap_or_default(),
        )),
    };
    // The times are in milliseconds where their steps are those of the head.
    let is_stepped = |column: usize| {
        let time = |row| number(facts.field(row, column)?);
        let step = || Some(time(second)? - time(first)?);
        let label = facts.field(names, column) == Some("Name");
        label && step() == steps.get(column + 1).and_then(|step| number(step))
    };
    let are_stepped = (0..fields.len()).step_by(2).all(is_stepped);
    let titles: Option<Vec<String>> = (0..fields.len()).map(title).collect();
    Some(InstrumentHead {
        titles: titles.filter(|titles| are_stepped && titles.len() % 2 == 0)?,
        begin: Some(begin),
        ..InstrumentHead::of_source("a TwinCAT scope", first)
    })
}

/// A matrix that Octave saved as text, without titles.
pub(super) fn octave(facts: &Facts) -> Option<InstrumentHead> {
    let is_octave = facts.field(0, 2) == Some("Octave") && facts.single("type:") == Some("matrix");
    let begins = |row: &&Vec<String>| row.first().is_some_and(|first| first == "name:");
    let is_single = facts.rows.iter().filter(begins).count() == 1;
    let columns = facts
        .number("columns:")
        .filter(|_| is_octave && is_single)? as usize;
    let rows = facts.row("columns:")? + 1;
    let width = facts.rows.get(rows)?.len();
    let titles = (1..=columns).map(|column| format!("column_{column}"));
    (columns == width).then(|| InstrumentHead {
        titles: titles.collect(),
        ..InstrumentHead::of_source("Octave", rows)
    })
}

/// The standard format of a recorder GX20: names and units stand in rows with labels, above the titles of the time.
pub(super) fn gx20(facts: &Facts) -> Option<InstrumentHead> {
    let (channels, times) = (facts.row("Channel")?, facts.row("Date")?);
    let names = &facts.rows[channels];
    let units = facts.rows.get(facts.row("Unit")?)?;
    let time_titles = &facts.rows[times];
    let is_head = time_titles[..] == ["Date", "Time", "msec"] && channels < times;
    let begins = time_titles.len();
    let names = names
        .get(begins..)
        .filter(|names| is_head && !names.is_empty())?;
    let signals = all_titled(names, units.get(begins..)?);
    Some(InstrumentHead {
        titles: [&time_titles[..], &signals].concat(),
        ..InstrumentHead::of_source("a GX20 recorder", times + 1)
    })
}
