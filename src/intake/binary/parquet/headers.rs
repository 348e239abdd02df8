//! The headers of a Parquet file (Thrift's compact protocol), walked before the library reads them.
//!
//! Where a header has a field that the library does not know, it steps over it; over a list of truth
//! values it steps in as many steps as the list says it has, for which the file needs no bytes. A few
//! bytes would so keep a thread at work for hours. No header of Parquet has such a list, and every other
//! list takes a byte at least for each of its elements.
//!
//! Source: the compact protocol, <https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md>;
//! the file's layout and the page's header, <https://parquet.apache.org/docs/file-format/>.

use ::parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};

/// What ends a file: four bytes with the length of the footer, and these.
const END: &[u8; 4] = b"PAR1";
/// The field of a page's header that says how many bytes follow it.
const COMPRESSED_PAGE_SIZE: i64 = 3;
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
        Header(&rest[begin..]).structure(MOST_DEPTH)
    };
    footer().is_some()
}

/// Whether the headers of all pages can be stepped through.
pub(super) fn pages_are_sound(bytes: &[u8], metadata: &ParquetMetaData) -> bool {
    let groups = metadata.row_groups().iter();
    groups
        .flat_map(|group| group.columns())
        .all(|column| walk_pages(bytes, column).is_some())
}

fn walk_pages(bytes: &[u8], column: &ColumnChunkMetaData) -> Option<()> {
    let begin = column
        .dictionary_page_offset()
        .unwrap_or(column.data_page_offset());
    let begin = usize::try_from(begin).ok()?;
    let length = usize::try_from(column.compressed_size()).ok()?;
    let mut header = Header(bytes.get(begin..begin.checked_add(length)?)?);
    while !header.0.is_empty() {
        let size = header.structure(MOST_DEPTH)?;
        header.skip(usize::try_from(size).ok()?)?;
    }
    Some(())
}

/// What is left of a header.
struct Header<'b>(&'b [u8]);

impl Header<'_> {
    /// Steps over a structure; answers its field [`COMPRESSED_PAGE_SIZE`], 0 where it has none.
    fn structure(&mut self, depth: u32) -> Option<i64> {
        let (mut id, mut size) = (0_i64, 0);
        loop {
            let field = self.byte()?;
            if field == 0 {
                return Some(size);
            }
            id = match field >> 4 {
                0 => self.number()?,
                delta => id + i64::from(delta),
            };
            match field & 0xf {
                4..=6 if id == COMPRESSED_PAGE_SIZE => size = self.number()?,
                // A truth value is in the kind itself.
                1 | 2 => {}
                kind => self.value(kind, depth)?,
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
            12 => self.structure(depth).map(|_| ()),
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

    /// The same with its sign in the lowest bit.
    fn number(&mut self) -> Option<i64> {
        let number = self.unsigned()?;
        Some((number >> 1).cast_signed() ^ -((number & 1).cast_signed()))
    }
}
