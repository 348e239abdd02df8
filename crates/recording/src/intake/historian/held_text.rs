//! The text of a document: held where memory has room for it, because a text that is held is read faster than one that
//! comes byte by byte, or read as it comes.

use super::super::json::{PlainNumbers, ReplacedNumbers, may_have_words};
use super::super::memory::Memory;
use std::io::{self, BufReader, Chain, Cursor, Read};

/// Bytes that are read before it is looked whether memory has room for more.
const PIECE_BYTES: u64 = 1 << 20;

/// The text of a document, in which no number is none.
pub(super) enum DocumentText<R> {
    /// All of the text.
    Held(Vec<u8>),
    /// The beginning of the text, and the rest as it comes.
    Streamed(BufReader<PlainNumbers<Chain<Cursor<Vec<u8>>, R>>>),
}

/// A text on its way in, and which numbers of it are none.
pub(super) struct ReadText<R> {
    pub(super) text: DocumentText<R>,
    pub(super) replaced: ReplacedNumbers,
}

impl<R: Read> ReadText<R> {
    /// Reads a text for as long as it takes no more than half of the memory that is left.
    pub(super) fn held(mut source: R, memory: &Memory) -> io::Result<Self> {
        let mut text = Vec::new();
        loop {
            let count = source.by_ref().take(PIECE_BYTES).read_to_end(&mut text)?;
            if count == 0 {
                memory.take(text.len() as u64);
                return Self::whole(text);
            }
            if text.len() as u64 > memory.left() / 2 {
                return Ok(Self::behind(text, source));
            }
        }
    }

    fn whole(text: Vec<u8>) -> io::Result<Self> {
        if !may_have_words(&text) {
            return Ok(Self {
                text: DocumentText::Held(text),
                replaced: ReplacedNumbers::default(),
            });
        }
        let (mut reader, replaced) = PlainNumbers::of(&text[..]);
        let mut plain = Vec::with_capacity(text.len());
        reader.read_to_end(&mut plain)?;
        Ok(Self {
            text: DocumentText::Held(plain),
            replaced,
        })
    }

    /// A text that is read as it comes.
    pub(super) fn streamed(source: R) -> Self {
        Self::behind(Vec::new(), source)
    }

    fn behind(beginning: Vec<u8>, source: R) -> Self {
        let (plain, replaced) = PlainNumbers::of(Cursor::new(beginning).chain(source));
        Self {
            text: DocumentText::Streamed(BufReader::new(plain)),
            replaced,
        }
    }
}

impl<R> DocumentText<R> {
    /// The bytes that are held.
    pub(super) fn bytes(&self) -> u64 {
        match self {
            Self::Held(text) => text.len() as u64,
            Self::Streamed(_) => 0,
        }
    }
}
