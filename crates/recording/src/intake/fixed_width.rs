//! Tables whose columns begin below a line of dashes, as `sqlcmd` prints them: tabs are put between the columns.

use super::format::{HEAD_BYTES, whole_lines};
use super::memory::LONGEST_ROW;
use std::io::{self, BufRead, BufReader, Cursor, Read};

/// Lines that must be blank between the columns.
const LOOKED_AT: usize = 50;

/// Where the columns of a text end, which blanks stand between.
#[derive(Clone, Debug, PartialEq)]
struct ColumnEnds(Vec<usize>);

impl ColumnEnds {
    /// The ends of the columns of a text that begins so; none where its second line has no dashes below the titles.
    fn of(head: &[u8]) -> Option<Self> {
        let head = std::str::from_utf8(head).or_else(|error| {
            let whole = head.get(..error.valid_up_to()).unwrap_or_default();
            std::str::from_utf8(whole)
        });
        let head = head.ok()?;
        let mut lines = head.lines();
        let titles = lines.next()?;
        let dashes = lines.next()?.trim_end();
        // A row of units may have a dash for a number without one.
        let is_of_dashes = dashes.contains("---")
            && dashes.starts_with('-')
            && dashes.bytes().all(|sign| b"- ".contains(&sign));
        let starts = dashes.match_indices("- ");
        let ends: Vec<usize> = starts.map(|(place, _)| place + 1).collect();
        let ends = Self(ends);
        let is_apart = |line: &str| ends.cut(line).is_some();
        let has_delimiter = titles.contains(['\t', ';', '|']);
        // The last line of a head may be cut.
        let mut looked_at = lines.take(LOOKED_AT).filter(|line| !line.trim().is_empty());
        let are_apart = is_apart(titles)
            && looked_at
                .by_ref()
                .all(|line| is_apart(line) || is_foot(line));
        (is_of_dashes && !ends.0.is_empty() && !has_delimiter && are_apart).then_some(ends)
    }

    /// A line with tabs in place of the blanks between its columns; none where something else stands there.
    fn cut(&self, line: &str) -> Option<String> {
        let mut ends = self.0.iter().peekable();
        let mut fields = String::with_capacity(line.len());
        for (place, sign) in line.chars().enumerate() {
            match ends.next_if(|end| **end == place) {
                Some(_) if sign != ' ' => return None,
                Some(_) => fields.push('\t'),
                None => fields.push(sign),
            }
        }
        Some(fields)
    }
}

/// Whether a line counts the rows above it: `(40 rows affected)`.
fn is_foot(line: &str) -> bool {
    let line = line.trim();
    line.starts_with('(') && line.ends_with("affected)")
}

/// The beginning of a text and the text, with tabs between the columns where a line of dashes tells where they end.
pub(super) fn apart<'t>(
    mut head: Vec<u8>,
    text: impl Read + 't,
) -> io::Result<(Vec<u8>, Box<dyn Read + 't>)> {
    let Some(ends) = ColumnEnds::of(&head) else {
        return Ok((head, Box::new(text)));
    };
    if head.len() as u64 >= HEAD_BYTES {
        head.truncate(whole_lines(&head).len());
    }
    let mut tabbed = Vec::new();
    TabbedText::of(&head[..], ends.clone()).read_to_end(&mut tabbed)?;
    Ok((tabbed, Box::new(TabbedText::of(text, ends))))
}

/// A text with tabs between its columns. The line of dashes and the count of rows are left empty.
struct TabbedText<R> {
    source: BufReader<R>,
    ends: ColumnEnds,
    lines: usize,
    line: Cursor<Vec<u8>>,
}

impl<R: Read> TabbedText<R> {
    fn of(source: R, ends: ColumnEnds) -> Self {
        Self {
            source: BufReader::new(source),
            ends,
            lines: 0,
            line: Cursor::default(),
        }
    }

    fn next_line(&mut self) -> io::Result<()> {
        let mut line = std::mem::take(&mut self.line).into_inner();
        line.clear();
        let mut source = self.source.by_ref().take(LONGEST_ROW);
        source.read_until(b'\n', &mut line)?;
        self.lines += 1;
        self.line = Cursor::new(self.tabbed(line));
        Ok(())
    }

    /// A line with tabs between its columns; the line as it is where something else stands there.
    fn tabbed(&self, line: Vec<u8>) -> Vec<u8> {
        let Ok(text) = std::str::from_utf8(&line) else {
            return line;
        };
        let (plain, end) = match text.strip_suffix('\n') {
            Some(plain) => (plain, "\n"),
            None => (text, ""),
        };
        let fields = match self.lines == 2 || is_foot(plain) {
            true => Some(String::new()),
            false => self.ends.cut(plain),
        };
        match fields {
            Some(fields) => (fields + end).into_bytes(),
            None => line,
        }
    }
}

impl<R: Read> Read for TabbedText<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.line.read(buffer)?;
        if count > 0 || buffer.is_empty() {
            return Ok(count);
        }
        self.next_line()?;
        self.line.read(buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tabbed(text: &str) -> Option<String> {
        let ends = ColumnEnds::of(text.as_bytes())?;
        let mut tabbed = String::new();
        TabbedText::of(text.as_bytes(), ends)
            .read_to_string(&mut tabbed)
            .unwrap();
        Some(tabbed)
    }

    #[test]
    fn a_line_of_dashes_tells_where_columns_end() {
        let text = "time       name\n---------- ----\n2026-03-02 P 1 \n2026-03-03 Té\n\n(2 rows affected)\n";
        let expected = "time      \tname\n\n2026-03-02\tP 1 \n2026-03-03\tTé\n\n\n";
        assert_eq!(tabbed(text).as_deref(), Some(expected));
        assert_eq!(
            tabbed("a b\n--- ---\n1234567\n"),
            None,
            "a number across two columns"
        );
        assert_eq!(tabbed("a;  b\n--- ---\n1;  2\n"), None);
        assert_eq!(tabbed("a\n---\n1\n"), None, "one column");
        assert_eq!(tabbed("t p\n- -\n0 1\n"), None, "a row of units");
        assert_eq!(tabbed("a b\n1 2\n"), None);
        assert_eq!(tabbed("\n"), None);
    }

    #[test]
    fn a_line_that_is_not_cut_so_stays_as_it_is() {
        let ends = ColumnEnds(vec![1]);
        let mut read = String::new();
        TabbedText::of(&b"a b\n- -\n1 2\n345\n"[..], ends)
            .read_to_string(&mut read)
            .unwrap();
        assert_eq!(read, "a\tb\n\n1\t2\n345\n");
    }
}
