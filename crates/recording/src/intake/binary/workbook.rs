//! A workbook on its way to the library that reads it: unpacked once, within bounds, and without what
//! nothing is read of.

use super::super::error::malformed;
use super::super::memory::{MOST_RATIO, Memory, may_unpack};
use super::markup::{Excess, LONGEST_BYTES, Scan};
use crate::intake::ReadError;
use bytes::Bytes;
use greybox_numerics::parsing::Fault;
use std::fmt;
use std::io::{Cursor, Read};
use zip::{ZipArchive, ZipWriter};

/// The bytes of a workbook's parts together when they are unpacked, at the most.
const MOST_UNPACKED: u64 = 512 << 20;
/// The parts of a workbook, at the most.
const MOST_PARTS: usize = 10_000;
/// What begins the entry of a part in the directory of a zip file.
const ENTRY: &[u8] = b"PK\x01\x02";
/// What begins the end of the directory of a large zip file …
const LARGE_END: &[u8] = b"PK\x06\x06";
/// … and how far behind it the number of parts stands `[bytes]`.
const LARGE_COUNT_AT: usize = 24;
/// What points to the end of the directory of a large zip file …
const LARGE_POINTER: &[u8] = b"PK\x06\x07";
/// … and how far from the end of the file it may stand: a comment has 64 KiB at the most `[bytes]`.
const LARGE_POINTER_WITHIN: usize = (64 << 10) + 64;
/// Bytes that are unpacked at once.
const PIECE_BYTES: usize = 64 << 10;

/// The workbook with nothing but its parts of markup, all of which are within bounds.
///
/// What the library will hold of the parts is taken from the memory.
///
/// # Errors
/// When the bytes are no workbook, or with the bound that the workbook exceeds.
pub(super) fn checked(bytes: Bytes, memory: &Memory) -> Result<Bytes, ReadError> {
    check_parts(&bytes)?;
    let packed = bytes.len() as u64;
    // The parts of markup are copied.
    memory.take(packed);
    let archive = ZipArchive::new(Cursor::new(bytes));
    let mut archive = archive.map_err(|error| no_workbook(&error))?;
    let mut copy = ZipWriter::new(Cursor::new(Vec::new()));
    let mut check = Check {
        packed,
        unpacked: 0,
        scan: Scan::new(),
    };
    for place in 0..archive.len() {
        let is_markup = {
            let mut part = archive
                .by_index(place)
                .map_err(|error| no_workbook(&error))?;
            let name = part.name().map_err(|error| no_workbook(&error))?;
            let is_markup = is_markup(&name);
            check.part(&mut part, is_markup, memory)?;
            is_markup
        };
        if is_markup {
            let part = archive.by_index_raw(place);
            let copied = part.and_then(|part| copy.raw_copy_file(part));
            copied.map_err(|error| no_workbook(&error))?;
        }
    }
    memory.take(check.scan.held);
    let copy = copy.finish().map_err(|error| no_workbook(&error))?;
    Ok(Bytes::from(copy.into_inner()))
}

/// Refuses a file of more parts than the directory of a workbook has, before room is made for them.
fn check_parts(bytes: &[u8]) -> Result<(), ReadError> {
    let tail = &bytes[bytes.len().saturating_sub(LARGE_POINTER_WITHIN)..];
    let claimed = match places(tail, LARGE_POINTER).next() {
        None => 0,
        Some(_) => places(bytes, LARGE_END)
            .filter_map(|place| claimed_parts(&bytes[place..]))
            .max()
            .unwrap_or(0),
    };
    let parts = (places(bytes, ENTRY).count() as u64).max(claimed);
    if parts <= MOST_PARTS as u64 {
        return Ok(());
    }
    Err(too_large(format!(
        "the workbook has {parts} parts; {MOST_PARTS} are read at the most"
    )))
}

/// The larger of the two numbers of parts that the end of a large directory says.
fn claimed_parts(end: &[u8]) -> Option<u64> {
    let counts = end.get(LARGE_COUNT_AT..LARGE_COUNT_AT + 16)?;
    let (counts, _) = counts.as_chunks();
    counts.iter().map(|count| u64::from_le_bytes(*count)).max()
}

/// Where some bytes stand in others.
fn places<'b>(bytes: &'b [u8], wanted: &'b [u8]) -> impl Iterator<Item = usize> + 'b {
    let windows = bytes.windows(wanted.len()).enumerate();
    windows.filter_map(move |(place, window)| (window == wanted).then_some(place))
}

/// Whether a part of that name is one of those that the library reads.
fn is_markup(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.ends_with(".xml") || name.ends_with(".rels")
}

/// The sizes and the markup of the parts of a workbook that have been read.
struct Check {
    /// Bytes of the file.
    packed: u64,
    /// Bytes of the parts that were unpacked.
    unpacked: u64,
    scan: Scan,
}

impl Check {
    /// Unpacks a part.
    fn part(
        &mut self,
        part: &mut impl Read,
        is_markup: bool,
        memory: &Memory,
    ) -> Result<(), ReadError> {
        let mut piece = vec![0; PIECE_BYTES];
        loop {
            let length = part.read(&mut piece);
            let length = length.map_err(|error| no_workbook(&error))?;
            if length == 0 {
                break;
            }
            self.unpacked += length as u64;
            self.check_unpacked()?;
            if is_markup {
                self.scan.take(&piece[..length]).map_err(refused)?;
                let what = "the shared strings, styles and names of the workbook";
                memory.hold(self.scan.held, what, "send CSV")?;
            }
        }
        match is_markup {
            true => self.scan.end_part().map_err(refused),
            false => Ok(()),
        }
    }

    fn check_unpacked(&self) -> Result<(), ReadError> {
        if !may_unpack(self.packed, self.unpacked) {
            return Err(too_large(format!(
                "the workbook unpacks to more than {MOST_RATIO} times its size; send CSV"
            )));
        }
        if self.unpacked > MOST_UNPACKED {
            return Err(too_large(format!(
                "the workbook unpacks to more than {} MiB; send CSV or Parquet",
                MOST_UNPACKED >> 20
            )));
        }
        Ok(())
    }
}

fn refused(excess: Excess) -> ReadError {
    match excess {
        Excess::Long => too_large(format!(
            "a cell or a tag of the workbook has more than {LONGEST_BYTES} bytes; Excel writes \
             32 767 characters at the most; send CSV"
        )),
        Excess::Unsound(what) => no_workbook(&format_args!("it has {what}")),
    }
}

fn too_large(detail: String) -> ReadError {
    malformed(Fault::of_whole("too_large", detail))
}

fn no_workbook(why: &dyn fmt::Display) -> ReadError {
    let detail = format!("this is no Excel workbook that can be read: {why}");
    malformed(Fault::of_whole("not_a_workbook", detail))
}
