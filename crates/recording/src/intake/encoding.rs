//! The bytes of a text as UTF-8 with plain line ends, piece by piece.
//!
//! A byte order mark decides, that of UTF-32 too; else what was said (a `charset`, an option); else UTF-8 is assumed,
//! and bytes that are not are passed on, for the reader to refuse with their place. `\r\n` becomes
//! `\n`, so that lines are counted right.

mod code_pages;
mod utf32;

use super::error::{ReadError, invalid};
use code_pages::CodePage;
use encoding_rs::{Decoder, Encoding, UTF_8};
use greybox_numerics::parsing::Fault;
use std::io::{self, BufRead, BufReader, Read};
use utf32::Utf32;

/// Bytes that are read at once.
const PIECE_BYTES: usize = 64 * 1024;

/// A text on its way in.
pub(super) struct DecodedText<R> {
    source: BufReader<R>,
    decoding: Decoding,
    decoded: Vec<u8>,
    given: usize,
    /// A carriage return at the end of a piece, of which it is not known what follows.
    pending_return: bool,
    is_at_end: bool,
}

/// How bytes become UTF-8.
enum Decoding {
    /// They are UTF-8 already.
    None,
    Listed(Decoder),
    Page(&'static CodePage),
    Utf32(Utf32),
}

/// An encoding that has a name.
pub(super) enum NamedEncoding {
    Listed(&'static Encoding),
    Page(&'static CodePage),
}

/// The encoding of that name.
pub(super) fn named(name: &str) -> Result<NamedEncoding, String> {
    let page = CodePage::named(name.trim()).map(NamedEncoding::Page);
    let listed = || Encoding::for_label(name.trim().as_bytes()).map(NamedEncoding::Listed);
    page.or_else(listed).ok_or_else(|| {
        format!(
            "`{name}` is no encoding that is known here, such as utf-8, utf-16le, windows-1252 or cp850"
        )
    })
}

impl From<NamedEncoding> for Decoding {
    fn from(named: NamedEncoding) -> Self {
        match named {
            NamedEncoding::Page(page) => Self::Page(page),
            NamedEncoding::Listed(encoding) if encoding == UTF_8 => Self::None,
            NamedEncoding::Listed(encoding) => {
                Self::Listed(encoding.new_decoder_without_bom_handling())
            }
        }
    }
}

impl<R: Read> DecodedText<R> {
    /// The text in `source`, of the encoding that was said, if any was.
    pub(super) fn new(source: R, declared: Option<&str>) -> Result<Self, ReadError> {
        let mut source = BufReader::with_capacity(PIECE_BYTES, source);
        let declared = match declared {
            Some(name) => Some(named(name).map_err(|detail| {
                invalid(Fault::of_parameter("encoding", "unknown_encoding", detail))
            })?),
            None => None,
        };
        let head = source.fill_buf()?;
        let utf32 = Utf32::of_mark(head).map(|utf32| (Decoding::Utf32(utf32), 4));
        let marked = || {
            let (encoding, bytes) = Encoding::for_bom(head)?;
            Some((NamedEncoding::Listed(encoding).into(), bytes))
        };
        let declared = declared.map_or(Decoding::None, Decoding::from);
        let (decoding, mark) = utf32.or_else(marked).unwrap_or((declared, 0));
        source.consume(mark);
        Ok(Self {
            source,
            decoding,
            decoded: Vec::new(),
            given: 0,
            pending_return: false,
            is_at_end: false,
        })
    }

    /// Fills `decoded` with the next piece; leaves it empty at the end.
    fn next_piece(&mut self) -> io::Result<()> {
        self.decoded.clear();
        self.given = 0;
        while self.decoded.is_empty() && !self.is_at_end {
            let piece = self.source.fill_buf()?;
            let length = piece.len();
            self.is_at_end = length == 0;
            let mut text = String::new();
            match &mut self.decoding {
                Decoding::None => self.decoded.extend_from_slice(piece),
                Decoding::Listed(decoder) => decode(decoder, piece, &mut self.decoded),
                Decoding::Page(page) => page.decode(piece, &mut text),
                Decoding::Utf32(utf32) => utf32.decode(piece, &mut text),
            }
            self.decoded.extend_from_slice(text.as_bytes());
            self.source.consume(length);
            self.without_returns();
        }
        Ok(())
    }

    fn without_returns(&mut self) {
        if self.pending_return {
            self.pending_return = false;
            if self.decoded.first() != Some(&b'\n') {
                self.decoded.insert(0, b'\r');
            }
        }
        if !self.decoded.contains(&b'\r') {
            return;
        }
        if self.decoded.last() == Some(&b'\r') && !self.is_at_end {
            self.decoded.pop();
            self.pending_return = true;
        }
        let mut kept = 0;
        for k in 0..self.decoded.len() {
            let byte = self.decoded[k];
            if byte == b'\r' && self.decoded.get(k + 1) == Some(&b'\n') {
                continue;
            }
            self.decoded[kept] = byte;
            kept += 1;
        }
        self.decoded.truncate(kept);
    }
}

fn decode(decoder: &mut Decoder, piece: &[u8], into: &mut Vec<u8>) {
    let room = decoder.max_utf8_buffer_length(piece.len());
    into.resize(room.unwrap_or(4 * piece.len() + 16), 0);
    let (_, _, written, _) = decoder.decode_to_utf8(piece, into, piece.is_empty());
    into.truncate(written);
}

impl<R: Read> Read for DecodedText<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.given == self.decoded.len() {
            self.next_piece()?;
        }
        let left = &self.decoded[self.given..];
        let length = left.len().min(buffer.len());
        buffer[..length].copy_from_slice(&left[..length]);
        self.given += length;
        Ok(length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(bytes: &[u8], said: Option<&str>) -> String {
        let mut text = String::new();
        let mut source = DecodedText::new(bytes, said).unwrap();
        source.read_to_string(&mut text).unwrap();
        text
    }

    /// Hands out a byte or two at a time.
    struct Drops<'a>(&'a [u8], usize);

    impl Read for Drops<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let length = self.1.min(self.0.len()).min(buffer.len());
            buffer[..length].copy_from_slice(&self.0[..length]);
            self.0 = &self.0[length..];
            Ok(length)
        }
    }

    #[test]
    fn a_byte_order_mark_wins_over_what_was_said() {
        let utf16: Vec<u8> = "\u{feff}t,é\n"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        assert_eq!(read(&utf16, Some("latin1")), "t,é\n");
        assert_eq!(read("\u{feff}t,é\n".as_bytes(), None), "t,é\n");
        assert_eq!(read(b"t,\xe9\n", Some("iso-8859-1")), "t,é\n");
    }

    #[test]
    fn code_pages_of_dos_are_said_and_utf_32_is_told_by_its_mark() {
        assert_eq!(
            read(b"\x9aberlauf [\xf8C]\r\n", Some("ibm850")),
            "Überlauf [°C]\n"
        );
        assert_eq!(
            read(b"\x9aberlauf [\xf8C]\r\n", Some("CP437")),
            "Überlauf [°C]\n"
        );
        let bytes = |ends: fn(u32) -> [u8; 4]| -> Vec<u8> {
            let signs = "\u{feff}t,é\r\n".chars();
            signs.flat_map(|sign| ends(u32::from(sign))).collect()
        };
        for utf32 in [bytes(u32::to_le_bytes), bytes(u32::to_be_bytes)] {
            assert_eq!(read(&utf32, Some("latin1")), "t,é\n");
        }
        let cut = &bytes(u32::to_le_bytes)[..14];
        assert_eq!(read(cut, None), "t,\u{fffd}");
    }

    #[test]
    fn an_encoding_that_is_not_known_is_a_fault_of_the_option() {
        let error = DecodedText::new(&b""[..], Some("klingon")).err().unwrap();
        assert_eq!(error.faults()[0].parameter.as_deref(), Some("encoding"));
    }

    proptest! {
        #[test]
        fn line_ends_are_plain_wherever_the_pieces_are_cut(text in "[a\\r\\n]{0,30}", cut in 1_usize..4) {
            let mut out = String::new();
            DecodedText::new(Drops(text.as_bytes(), cut), None).unwrap().read_to_string(&mut out).unwrap();
            prop_assert_eq!(out, text.replace("\r\n", "\n"));
        }
    }
}
