//! The lines of a text of the protocol, one after the other. A text in quotes may have line breaks in it.

use super::point::{LineFault, LineScanner};
use crate::intake::memory::LONGEST_ROW;
use std::io::{self, BufRead, Cursor, Read};

/// Reads a text line by line; holds one line at a time, [`LONGEST_ROW`] bytes at the most.
pub(super) struct LineReader<R> {
    source: R,
    /// Bytes that were read ahead and have not been lines yet.
    ahead: Cursor<Vec<u8>>,
    line: Vec<u8>,
    /// The number of the last line that was read, from 1.
    number: u64,
}

/// A line of a text, with its number from 1.
pub(super) struct NumberedLine<'l> {
    pub(super) number: u64,
    /// The line without its end, or why it is no text.
    pub(super) text: Result<&'l str, LineFault>,
}

impl<R: BufRead> LineReader<R> {
    pub(super) fn new(source: R) -> Self {
        Self {
            source,
            ahead: Cursor::default(),
            line: Vec::new(),
            number: 0,
        }
    }

    /// The next line that is neither empty nor a comment; nothing at the end.
    pub(super) fn next(&mut self) -> io::Result<Option<NumberedLine<'_>>> {
        loop {
            let first = self.number + 1;
            let Some(is_whole) = self.read()? else {
                return Ok(None);
            };
            if !is_whole {
                return Ok(Some(NumberedLine {
                    number: first,
                    text: Err(LineFault::TooLong),
                }));
            }
            let trimmed = self.line.trim_ascii();
            if !trimmed.is_empty() && !trimmed.starts_with(b"#") {
                return Ok(Some(NumberedLine {
                    number: first,
                    text: std::str::from_utf8(self.line.trim_ascii())
                        .map_err(|_| LineFault::NotText),
                }));
            }
        }
    }

    /// Reads a line; says whether all of it is there, and nothing at the end of the text.
    fn read(&mut self) -> io::Result<Option<bool>> {
        self.line.clear();
        let mut scanner = LineScanner::new();
        let mut first_end = None;
        loop {
            let begin = self.line.len();
            self.read_part()?;
            let part = &self.line[begin..];
            let ends = part.last() == Some(&b'\n');
            part.iter().for_each(|byte| scanner.step(*byte));
            if self.line.is_empty() {
                return Ok(None);
            }
            if ends {
                self.number += 1;
                first_end.get_or_insert(self.line.len());
            }
            if ends && !scanner.is_in_text() {
                return Ok(Some(true));
            }
            if ends {
                continue;
            }
            if scanner.is_in_text()
                && let Some(first_end) = first_end
            {
                self.give_back(first_end);
                return Ok(Some(true));
            }
            let is_whole = (self.line.len() as u64) < LONGEST_ROW;
            if !is_whole {
                self.skip()?;
            }
            self.number += 1;
            return Ok(Some(is_whole));
        }
    }

    /// Reads on to the end of a line, of the text, or of what a line may have.
    fn read_part(&mut self) -> io::Result<()> {
        let begin = self.line.len();
        let room = LONGEST_ROW - begin as u64;
        (&mut self.ahead)
            .take(room)
            .read_until(b'\n', &mut self.line)?;
        if self.line[begin..].last() != Some(&b'\n') {
            let room = LONGEST_ROW - self.line.len() as u64;
            (&mut self.source)
                .take(room)
                .read_until(b'\n', &mut self.line)?;
        }
        Ok(())
    }

    /// A text that does not end is a fault of its first line alone: what was read behind that is read again.
    fn give_back(&mut self, first_end: usize) {
        let mut behind = self.line.split_off(first_end);
        let ends = behind.iter().filter(|byte| **byte == b'\n').count();
        self.number -= ends as u64;
        let read = self.ahead.position() as usize;
        behind.extend_from_slice(&self.ahead.get_ref()[read..]);
        self.ahead = Cursor::new(behind);
    }

    /// Skips the rest of a line that is too long.
    fn skip(&mut self) -> io::Result<()> {
        self.ahead.skip_until(b'\n')?;
        let read = self.ahead.position() as usize;
        if self.ahead.get_ref()[..read].last() != Some(&b'\n') {
            self.source.skip_until(b'\n')?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<(u64, Result<String, LineFault>)> {
        let mut reader = LineReader::new(text.as_bytes());
        let mut lines = Vec::new();
        while let Some(line) = reader.next().unwrap() {
            lines.push((line.number, line.text.map(str::to_owned)));
        }
        lines
    }

    #[test]
    fn a_text_in_quotes_goes_over_several_lines() {
        let text = "# made by hand\n\nlog m=\"two\nlines\" 1\r\nrig a=1 2\nrig a=2 3";
        let expected = [
            (3, Ok("log m=\"two\nlines\" 1".to_owned())),
            (5, Ok("rig a=1 2".to_owned())),
            (6, Ok("rig a=2 3".to_owned())),
        ];
        assert_eq!(lines(text), expected);
    }

    #[test]
    fn a_text_that_does_not_end_takes_no_other_line_with_it() {
        let expected = [
            (1, Ok("log m=\"open 1".to_owned())),
            (2, Ok("rig a=1 2".to_owned())),
            (3, Ok("rig a=2 3".to_owned())),
        ];
        assert_eq!(lines("log m=\"open 1\nrig a=1 2\nrig a=2 3\n"), expected);
        assert_eq!(lines("log m=\"open 1\nrig a=1 2\nrig a=2 3"), expected);
    }

    #[test]
    fn a_line_that_is_too_long_takes_no_other_line_with_it() {
        let long = format!("rig a=1,b={} 1\nrig a=2 2\n", "1".repeat(2 << 20));
        let expected = [
            (1, Err(LineFault::TooLong)),
            (2, Ok("rig a=2 2".to_owned())),
        ];
        assert_eq!(lines(&long), expected);
        let open = format!("log m=\"{}\nrig a=2 2\n", "x\n".repeat(1 << 20));
        let all = lines(&open);
        // The first line, each further `x`, and the line behind them; the one that is empty is none.
        assert_eq!(all.len(), 1 + (1 << 20));
        assert_eq!(all.last().unwrap().1, Ok("rig a=2 2".to_owned()));
    }
}
