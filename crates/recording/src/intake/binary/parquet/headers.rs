//! The headers of a Parquet file (Thrift's compact protocol), walked before the library reads them.
//!
//! Where a header has a field that the library does not know, it steps over it; over a list of truth
//! values it steps in as many steps as the list says it has, for which the file needs no bytes. A few
//! bytes would so keep a thread at work for hours. No header of Parquet has such a list, and every other
//! list takes a byte at least for each of its elements.
//!
//! Source: the compact protocol, <https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md>;
//! the file's layout and the page's header, <https://parquet.apache.org/docs/file-format/>.

use crate::intake::memory::may_unpack;
use ::parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};

/// What ends a file: four bytes with the length of the footer, and these.
const END: &[u8; 4] = b"PAR1";
/// The fields of a page's header: the bytes that it unpacks to, the bytes that follow it, and what is said
/// of a page of data of the first and of the second version.
const UNCOMPRESSED_PAGE_SIZE: i64 = 2;
const COMPRESSED_PAGE_SIZE: i64 = 3;
const DATA_PAGE: i64 = 5;
const DATA_PAGE_V2: i64 = 8;
/// The field of each that says how values are encoded.
const ENCODING: i64 = 2;
const ENCODING_V2: i64 = 4;
/// The encoding in which a value says how much of the value before it begins with.
const DELTA_BYTE_ARRAY: i64 = 7;
/// Structures within each other, at the most.
const MOST_DEPTH: u32 = 64;

/// Whether the footer can be stepped through.
pub(super) fn footer_is_sound(bytes: &[u8]) -> bool {
    let footer = || {
        let (rest, end) = bytes.split_last_chunk::<4>()?;
        let (rest, length) = rest.split_last_chunk::<4>()?;
        let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
        let begin = rest.len().checked_sub(length)?;
        (end == END).then_some(())?;
        HeaderBytes(&rest[begin..]).step_over(MOST_DEPTH)
    };
    footer().is_some()
}

/// What the headers of pages say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Pages {
    /// Bytes of the largest pages of all columns together, unpacked: they are in memory at once.
    pub(super) unpacked: u64,
    /// Whether values say how much of the value before they begin with: short ones may be long then.
    pub(super) have_prefixes: bool,
}

/// What the headers of all pages say; nothing where they cannot be stepped through, or say that a page
/// unpacks to more than a compressed body may.
pub(super) fn pages(bytes: &[u8], metadata: &ParquetMetaData) -> Option<Pages> {
    let mut all = Pages::default();
    for group in metadata.row_groups() {
        let mut unpacked = 0;
        for column in group.columns() {
            let pages = walk_pages(bytes, column)?;
            unpacked += pages.unpacked;
            all.have_prefixes |= pages.have_prefixes;
        }
        all.unpacked = all.unpacked.max(unpacked);
    }
    Some(all)
}

fn walk_pages(bytes: &[u8], column: &ColumnChunkMetaData) -> Option<Pages> {
    let begin = column
        .dictionary_page_offset()
        .unwrap_or(column.data_page_offset());
    let begin = usize::try_from(begin).ok()?;
    let length = usize::try_from(column.compressed_size()).ok()?;
    let mut header = HeaderBytes(bytes.get(begin..begin.checked_add(length)?)?);
    let mut pages = Pages::default();
    while !header.0.is_empty() {
        let page = header.page()?;
        header.skip(usize::try_from(page.packed).ok()?)?;
        if !may_unpack(page.packed, page.unpacked) {
            return None;
        }
        // A dictionary stays in memory beside the page at hand.
        pages.unpacked = pages.unpacked.max(2 * page.unpacked);
        pages.have_prefixes |= page.encoding == DELTA_BYTE_ARRAY;
    }
    Some(pages)
}

/// The header of a page.
#[derive(Default)]
struct PageHeader {
    packed: u64,
    unpacked: u64,
    encoding: i64,
}

/// What is left of a header.
struct HeaderBytes<'b>(&'b [u8]);

impl HeaderBytes<'_> {
    fn page(&mut self) -> Option<PageHeader> {
        let mut page = PageHeader::default();
        self.structure(&mut |header, id, kind| match (id, kind) {
            (UNCOMPRESSED_PAGE_SIZE, 4..=6) => {
                page.unpacked = u64::try_from(header.number()?).ok()?;
                Some(())
            }
            (COMPRESSED_PAGE_SIZE, 4..=6) => {
                page.packed = u64::try_from(header.number()?).ok()?;
                Some(())
            }
            (DATA_PAGE, 12) => header.encoding(ENCODING, &mut page),
            (DATA_PAGE_V2, 12) => header.encoding(ENCODING_V2, &mut page),
            _ => header.value(kind, MOST_DEPTH),
        })?;
        Some(page)
    }

    /// Steps over what is said of a page of data, and notes how its values are encoded.
    fn encoding(&mut self, field: i64, page: &mut PageHeader) -> Option<()> {
        self.structure(&mut |header, id, kind| match (id, kind) {
            (id, 4..=6) if id == field => {
                page.encoding = header.number()?;
                Some(())
            }
            _ => header.value(kind, MOST_DEPTH),
        })
    }

    /// Steps over a structure.
    fn step_over(&mut self, depth: u32) -> Option<()> {
        self.structure(&mut |header, _, kind| header.value(kind, depth))
    }

    /// Goes through the fields of a structure: `take` gets the number and the kind of each, and steps
    /// over its value.
    fn structure(&mut self, take: &mut dyn FnMut(&mut Self, i64, u8) -> Option<()>) -> Option<()> {
        let mut id = 0_i64;
        loop {
            let field = self.byte()?;
            if field == 0 {
                return Some(());
            }
            id = match field >> 4 {
                0 => self.number()?,
                delta => id + i64::from(delta),
            };
            match field & 0xf {
                // A truth value is in the kind itself.
                1 | 2 => {}
                kind => take(self, id, kind)?,
            }
        }
    }

    /// Steps over a value that is not a truth value.
    fn value(&mut self, kind: u8, depth: u32) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        match kind {
            3 => self.skip(1),
            4..=6 => self.number().map(|_| ()),
            7 => self.skip(8),
            8 => {
                let length = self.unsigned()?;
                self.skip(usize::try_from(length).ok()?)
            }
            9 | 10 => {
                let list = self.byte()?;
                let length = match list >> 4 {
                    15 => self.unsigned()?,
                    short => u64::from(short),
                };
                (0..length).try_for_each(|_| self.value(list & 0xf, depth))
            }
            11 => {
                let length = self.unsigned()?;
                let kinds = if length == 0 { 0 } else { self.byte()? };
                (0..length).try_for_each(|_| {
                    self.value(kinds >> 4, depth)?;
                    self.value(kinds & 0xf, depth)
                })
            }
            12 => self.step_over(depth),
            13 => self.skip(16),
            _ => None,
        }
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn skip(&mut self, n: usize) -> Option<()> {
        self.0 = self.0.get(n..)?;
        Some(())
    }

    /// A number of seven bits a byte, the lowest first.
    fn unsigned(&mut self) -> Option<u64> {
        let mut number = 0;
        for place in 0..10 {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << (7 * place);
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    /// A signed number of seven bits a byte, the sign in the lowest bit.
    fn number(&mut self) -> Option<i64> {
        let number = self.unsigned()?;
        Some((number >> 1).cast_signed() ^ -((number & 1).cast_signed()))
    }
}
