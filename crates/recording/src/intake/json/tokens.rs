//! Numbers that are none, as Python and others write them into what is else JSON: `NaN`, `Infinity` and `-Infinity`.

use crate::Warning;
use memchr::memmem;
use std::cell::Cell;
use std::io::{self, Read};
use std::rc::Rc;

/// The words for numbers that are none.
const WORDS: [&str; 3] = ["NaN", "Infinity", "-Infinity"];

/// Whether a text has one of the words anywhere.
pub(in crate::intake) fn may_have_words(text: &[u8]) -> bool {
    // The third word has the second within.
    let mut words = WORDS[..2].iter();
    words.any(|word| memmem::find(text, word.as_bytes()).is_some())
}

/// A text of JSON in which `null` stands for each number that is none.
pub(in crate::intake) struct PlainNumbers<R> {
    source: R,
    is_in_text: bool,
    is_escaped: bool,
    /// The beginning of what may be such a word.
    word: Vec<u8>,
    /// Bytes that were looked at and have not been read yet.
    ahead: io::Cursor<Vec<u8>>,
    replaced: ReplacedNumbers,
}

/// How often each word was replaced.
#[derive(Clone, Default)]
pub(in crate::intake) struct ReplacedNumbers(Rc<Cell<[u64; 3]>>);

impl ReplacedNumbers {
    /// Says what was replaced.
    pub(in crate::intake) fn note(&self) -> Option<Warning> {
        let counts = WORDS.iter().zip(self.0.get());
        let counts = counts.filter(|(_, count)| *count > 0);
        let told: Vec<String> = counts
            .map(|(word, count)| format!("{count} values are `{word}`"))
            .collect();
        let detail = format!("{}: missing", told.join(", "));
        (!told.is_empty()).then(|| Warning::of_recording("words_for_missing", detail))
    }

    fn add(&self, word: usize) {
        let mut counts = self.0.get();
        counts[word] += 1;
        self.0.set(counts);
    }
}

impl<R: Read> PlainNumbers<R> {
    pub(in crate::intake) fn of(source: R) -> (Self, ReplacedNumbers) {
        let replaced = ReplacedNumbers::default();
        let text = Self {
            source,
            is_in_text: false,
            is_escaped: false,
            word: Vec::new(),
            ahead: io::Cursor::default(),
            replaced: replaced.clone(),
        };
        (text, replaced)
    }

    /// Looks at bytes of the source.
    fn look(&mut self, mut bytes: &[u8], plain: &mut Vec<u8>) {
        loop {
            if self.word.is_empty() && !self.is_escaped {
                bytes = self.copied(bytes, plain);
            }
            let Some((byte, behind)) = bytes.split_first() else {
                return;
            };
            self.step(*byte, plain);
            bytes = behind;
        }
    }

    /// Copies bytes up to one that may begin or end a text, or begin a word, and gives the bytes from there on.
    fn copied<'b>(&self, bytes: &'b [u8], plain: &mut Vec<u8>) -> &'b [u8] {
        let ends: &[u8] = match self.is_in_text {
            true => b"\"\\",
            false => b"\"-NI",
        };
        let end = bytes.iter().position(|byte| ends.contains(byte));
        let (before, behind) = bytes.split_at(end.unwrap_or(bytes.len()));
        plain.extend_from_slice(before);
        behind
    }

    /// Looks at a byte of the source.
    fn step(&mut self, byte: u8, plain: &mut Vec<u8>) {
        if self.is_in_text {
            let is_escaped = std::mem::take(&mut self.is_escaped);
            self.is_escaped = byte == b'\\' && !is_escaped;
            self.is_in_text = byte != b'"' || is_escaped;
            return plain.push(byte);
        }
        if self.word.is_empty() && !b"-NI".contains(&byte) {
            self.is_in_text = byte == b'"';
            return plain.push(byte);
        }
        self.word.push(byte);
        let begins = |word: &str| word.as_bytes().starts_with(&self.word);
        if !WORDS.iter().any(|word| begins(word)) {
            self.word.pop();
            plain.append(&mut self.word);
            self.word.push(byte);
            if !b"-NI".contains(&byte) {
                plain.append(&mut self.word);
            }
            self.is_in_text = byte == b'"';
        } else if let Some(word) = WORDS.iter().position(|word| word.as_bytes() == self.word) {
            self.word.clear();
            plain.extend_from_slice(b"null");
            self.replaced.add(word);
        }
    }
}

impl<R: Read> Read for PlainNumbers<R> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        /// Bytes of the source that are looked at together.
        const CHUNK: usize = 8192;
        loop {
            let count = self.ahead.read(target)?;
            if count > 0 || target.is_empty() {
                return Ok(count);
            }
            let mut chunk = [0; CHUNK];
            let count = self.source.read(&mut chunk)?;
            let mut plain = std::mem::take(self.ahead.get_mut());
            plain.clear();
            self.look(chunk.get(..count).unwrap_or_default(), &mut plain);
            if count == 0 {
                plain.append(&mut self.word);
            }
            let is_end = count == 0 && plain.is_empty();
            self.ahead = io::Cursor::new(plain);
            if is_end {
                return Ok(0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(text: &str) -> (String, Option<String>) {
        let (mut reader, replaced) = PlainNumbers::of(text.as_bytes());
        let mut plain = String::new();
        reader.read_to_string(&mut plain).unwrap();
        (plain, replaced.note().map(|note| note.detail))
    }

    #[test]
    fn words_for_no_number_are_replaced_outside_of_texts_alone() {
        let text = r#"{"NaN": [NaN, -Infinity, -1, Infinity,NaN], "a\"NaN": "\\", "b": [-0.5]}"#;
        let (replaced, told) = plain(text);
        let expected = r#"{"NaN": [null, null, -1, null,null], "a\"NaN": "\\", "b": [-0.5]}"#;
        assert_eq!(replaced, expected);
        let told = told.unwrap();
        assert_eq!(
            told,
            "2 values are `NaN`, 1 values are `Infinity`, 1 values are `-Infinity`: missing"
        );
    }

    #[test]
    fn all_else_stays_as_it_is() {
        for text in [
            "",
            "-",
            "N",
            "[1, Na]",
            "[-I, Inf, --1]",
            "{\"a\": \"NaN",
            "[null, true]",
            "NNaNIInfinity",
        ] {
            let (replaced, told) = plain(text);
            match text {
                "NNaNIInfinity" => assert_eq!(replaced, "NnullInull"),
                text => assert_eq!((replaced.as_str(), told), (text, None)),
            }
        }
    }
}
