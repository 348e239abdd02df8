//! Lines of a text that are left out before the text is read, whatever stands in them.

use std::io::{self, Read};

/// The ranges of lines that one option names, at the most.
const MOST_RANGES: usize = 1000;

/// The lines of a text that are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct SkippedLines(Vec<LineRange>);

/// Lines that follow each other, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct LineRange {
    first: u64,
    /// The last line; the end of the text when absent.
    last: Option<u64>,
}

impl LineRange {
    /// `7`, `3-5` or `22-`.
    fn named(text: &str) -> Option<Self> {
        let line = |text: &str| text.trim().parse().ok().filter(|line| *line > 0);
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let range = Self {
            first: line(first)?,
            last: match last.trim() {
                "" => None,
                last => Some(line(last)?),
            },
        };
        range
            .last
            .is_none_or(|last| last >= range.first)
            .then_some(range)
    }

    fn contains(&self, line: u64) -> bool {
        self.first <= line && self.last.is_none_or(|last| line <= last)
    }
}

impl SkippedLines {
    /// `3-5,7,22-`: lines and ranges of lines, from 1.
    pub(super) fn named(text: &str) -> Result<Self, String> {
        let mut ranges = Vec::new();
        for part in text.split(',') {
            let range = LineRange::named(part).ok_or_else(|| {
                format!(
                    "`{}` names no lines, from 1, such as 7, 3-5 or 22-",
                    part.trim()
                )
            })?;
            ranges.push(range);
        }
        if ranges.len() > MOST_RANGES {
            return Err(format!("more than {MOST_RANGES} ranges of lines"));
        }
        Ok(Self(ranges))
    }

    /// The text without the lines; the lines that follow keep their numbers.
    pub(super) fn left_out_of<R: Read>(&self, text: R) -> TextWithoutLines<'_, R> {
        TextWithoutLines {
            text,
            lines: self,
            line: 1,
        }
    }

    /// The beginning of a text without the lines.
    pub(super) fn left_out(&self, head: &[u8]) -> io::Result<Vec<u8>> {
        let mut kept = Vec::with_capacity(head.len());
        self.left_out_of(head).read_to_end(&mut kept)?;
        Ok(kept)
    }

    fn contain(&self, line: u64) -> bool {
        self.0.iter().any(|range| range.contains(line))
    }
}

/// A text in which empty lines stand in the place of those that are left out.
pub(super) struct TextWithoutLines<'l, R> {
    text: R,
    lines: &'l SkippedLines,
    /// The line of the next byte, from 1.
    line: u64,
}

impl<R: Read> Read for TextWithoutLines<'_, R> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        if self.lines.0.is_empty() {
            return self.text.read(target);
        }
        loop {
            let count = self.text.read(target)?;
            let kept = self.keep(&mut target[..count]);
            if kept > 0 || count == 0 {
                return Ok(kept);
            }
        }
    }
}

impl<R> TextWithoutLines<'_, R> {
    /// Moves the bytes that are kept to the beginning of a piece; says how many they are.
    fn keep(&mut self, piece: &mut [u8]) -> usize {
        let mut kept = 0;
        let mut begin = 0;
        while begin < piece.len() {
            let end = piece[begin..].iter().position(|byte| *byte == b'\n');
            let content = end.map_or(piece.len(), |end| begin + end);
            let from = match self.lines.contain(self.line) {
                true => content,
                false => begin,
            };
            // The end of the line stays, so that lines are counted right.
            begin = piece.len().min(content + 1);
            piece.copy_within(from..begin, kept);
            kept += begin - from;
            self.line += u64::from(end.is_some());
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn without(lines: &str, text: &str) -> String {
        let skipped = SkippedLines::named(lines).unwrap();
        let mut kept = String::new();
        let mut text = skipped.left_out_of(text.as_bytes());
        text.read_to_string(&mut kept).unwrap();
        kept
    }

    #[test]
    fn lines_are_left_out_and_the_rest_keeps_its_numbers() {
        let text = "a\nb\nc\nd\ne";
        assert_eq!(without("2", text), "a\n\nc\nd\ne");
        assert_eq!(without("1,3-4", text), "\nb\n\n\ne");
        assert_eq!(without("4-, 2", text), "a\n\nc\n\n");
        assert_eq!(without("9-", text), text);
    }

    #[test]
    fn lines_that_are_none_are_told() {
        for text in ["", "0", "x", "3-2", "-", "-4", "1,,2", "1.5", "0-3"] {
            let told = SkippedLines::named(text).unwrap_err();
            assert!(told.contains("names no lines"), "{text}: {told}");
        }
    }

    /// A source that gives a few bytes at once.
    struct Pieces<'t>(&'t [u8], usize);

    impl Read for Pieces<'_> {
        fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
            let length = self.1.min(target.len());
            self.0.read(&mut target[..length])
        }
    }

    proptest! {
        #[test]
        fn pieces_of_any_length_leave_the_same(
            text in "[ab\n]{0,40}",
            first in 1_u64..8,
            more in 0_u64..4,
            length in 1_usize..9,
        ) {
            let skipped = SkippedLines::named(&format!("{first}-{}", first + more)).unwrap();
            let mut kept = String::new();
            let source = Pieces(text.as_bytes(), length);
            skipped.left_out_of(source).read_to_string(&mut kept).unwrap();
            let lines = text.split('\n').zip(1..);
            let expected = lines.map(|(line, k)| match (first..=first + more).contains(&k) {
                true => "",
                false => line,
            });
            prop_assert_eq!(kept, expected.collect::<Vec<_>>().join("\n"));
        }
    }
}
