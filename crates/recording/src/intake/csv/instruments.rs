//! Heads of instruments that say of a table what its rows do not: what its columns are called, in which units they are,
//! how far its samples lie apart and when the first was taken. Each is known by the words of its program alone.

mod facts;
mod head;
mod loggers;
mod scopes;

use ::csv::ByteRecord;
use facts::Facts;
pub(super) use head::InstrumentHead;

/// Whether the first line of a text may be that of a head.
pub(super) fn may_begin(line: &[u8]) -> bool {
    const BEGINNINGS: [&str; 8] = [
        "LabVIEW Measurement",
        "Name",
        "# Created by Octave",
        "Device",
        "Model Name",
        "Record Length",
        "Type",
        "X",
    ];
    let line = String::from_utf8_lossy(line);
    let line = line.trim_start_matches(['"', ' ']);
    BEGINNINGS.iter().any(|word| line.starts_with(word)) || line.contains("tInc =")
}

/// The head that a text begins with, whose first rows these are.
pub(super) fn head_of(records: &[ByteRecord]) -> Option<InstrumentHead> {
    let facts = Facts::of(records);
    let first = facts.field(0, 0)?;
    match first {
        "LabVIEW Measurement" => loggers::labview(&facts),
        "Name" => loggers::twincat(&facts),
        "Created" => loggers::octave(&facts),
        "Device" => loggers::gx20(&facts),
        "Model Name" => scopes::dl850(&facts),
        "Record Length" => scopes::tds(&facts),
        "Type" => scopes::infiniium(&facts),
        "X" => scopes::rigol_sequence(&facts),
        _ => scopes::rigol_increment(&facts),
    }
}
