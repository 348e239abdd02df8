//! Heads of oscilloscopes.

use super::facts::{Facts, all_titled, number, titled};
use super::head::InstrumentHead;

/// A DL850 of Yokogawa: a fact of all channels in each row, and samples without times.
pub(super) fn dl850(facts: &Facts) -> Option<InstrumentHead> {
    let is_seconds = facts.single("HUnit")? == "s" && facts.number("HOffset")? == 0.0;
    let step = facts
        .number("HResolution")
        .filter(|step| *step > 0.0 && is_seconds)?;
    let (date, time) = (facts.single("Date")?, facts.single("Time")?);
    let is_sample = |row: &Vec<String>| row.len() > 1 && row[0].is_empty();
    let rows = facts.rows.iter().position(is_sample)?;
    let signals = all_titled(facts.of_label("TraceName")?, facts.of_label("VUnit")?);
    Some(InstrumentHead {
        titles: [vec![String::new()], signals].concat(),
        left_out: 1,
        lacks_time: true,
        step: Some(step),
        begin: Some(format!("{date} {time}")),
        ..InstrumentHead::of_source("a DL850 oscilloscope", rows)
    })
}

/// A TDS of Tektronix: the facts stand in columns before the first samples.
pub(super) fn tds(facts: &Facts) -> Option<InstrumentHead> {
    /// Facts of a row and the column behind them, which is empty.
    const BEFORE: usize = 3;
    let fact = |label: &str| facts.field(facts.row(label)?, 1);
    let signal = titled(fact("Source")?, fact("Vertical Units")?);
    let time = titled("time", fact("Horizontal Units")?);
    let has_samples = |row: &Vec<String>| row.len() == BEFORE + 2;
    let before = vec![String::new(); BEFORE];
    facts.rows.iter().all(has_samples).then(|| InstrumentHead {
        titles: [before, vec![time, signal]].concat(),
        left_out: BEFORE,
        ..InstrumentHead::of_source("a Tektronix oscilloscope", 0)
    })
}

/// An Infiniium of Keysight: `YUnits` and `XUnits` stand above the titles.
pub(super) fn infiniium(facts: &Facts) -> Option<InstrumentHead> {
    let titles = facts.row("Time").filter(|_| facts.row("XOrg").is_some())?;
    let time = titled("Time", facts.single("XUnits")?);
    let (names, units) = (facts.of_label("Time")?, facts.of_label("YUnits")?);
    let signals = all_titled(names, units);
    (names.len() == units.len()).then(|| InstrumentHead {
        titles: [vec![time], signals].concat(),
        ..InstrumentHead::of_source("an Infiniium oscilloscope", titles + 1)
    })
}

/// A DS1000Z of Rigol: a count of samples, with the sample time in the last column of the second row.
pub(super) fn rigol_sequence(facts: &Facts) -> Option<InstrumentHead> {
    let (titles, units) = (facts.rows.first()?, facts.rows.get(1)?);
    let signals = titles.len().checked_sub(2)?;
    let is_head =
        titles[signals..] == ["Start", "Increment"] && facts.field(1, 0) == Some("Sequence");
    let step = number(units.get(signals + 1)?).filter(|step| *step > 0.0 && is_head)?;
    let names = all_titled(titles.get(1..signals)?, units.get(1..signals)?);
    Some(InstrumentHead {
        titles: [vec!["X".to_owned()], names].concat(),
        step: Some(step),
        ..InstrumentHead::of_source("a Rigol oscilloscope", 2)
    })
}

/// An MSO5000 of Rigol: samples without times, with the sample time among the titles, which end with their units.
pub(super) fn rigol_increment(facts: &Facts) -> Option<InstrumentHead> {
    let titles = facts.rows.first()?;
    let signals = titles.iter().position(|title| title.starts_with("t0 ="))?;
    let increment = titles.get(signals + 1)?.strip_prefix("tInc =")?;
    let step = number(increment.trim()).filter(|step| *step > 0.0)?;
    let unit = |title: &str| {
        let of_channel = title.strip_prefix("CH")?;
        let unit = of_channel.trim_start_matches(|digit: char| digit.is_ascii_digit());
        Some(unit.to_owned())
    };
    let names = titles[..signals].iter();
    let names = names.map(|title| Some(titled(title, &unit(title)?)));
    let names: Option<Vec<String>> = names.collect();
    Some(InstrumentHead {
        titles: names.filter(|names| !names.is_empty())?,
        lacks_time: true,
        step: Some(step),
        ..InstrumentHead::of_source("a Rigol oscilloscope", 1)
    })
}
