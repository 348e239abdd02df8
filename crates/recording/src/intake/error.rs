//! What can be wrong with a recording, and where.
//!
//! Reading goes on after a fault so that all of them (up to [`MAX_FAULTS`]) are reported at once.
//! What is wrong in the same way in the same column is told three times at the most; what
//! follows is counted.

use greybox_numerics::parsing::Fault;
use std::{fmt, io};

/// The most faults that one reading reports; it stops at the last of them.
pub const MAX_FAULTS: usize = 20;

/// Why a recording could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The source broke off or its limit was exceeded.
    #[error("the recording could not be read to its end: {0}")]
    Io(#[from] io::Error),
    /// The samples could not be put aside, which is not the source's fault.
    #[error("the samples of the recording could not be put aside: {0}")]
    Scratch(io::Error),
    /// The format is known, and is not read here.
    #[error("{0}")]
    Unsupported(String),
    /// The text is not CSV or not JSON.
    #[error("the recording is malformed: {}", sentences(.0))]
    Malformed(Vec<Fault>),
    /// The text was understood, and what it says is wrong.
    #[error("the recording is wrong: {}", sentences(.0))]
    Invalid(Vec<Fault>),
}

impl ReadError {
    /// What is wrong, in the order of the text; empty when the source itself failed.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        match self {
            Self::Io(_) | Self::Scratch(_) | Self::Unsupported(_) => &[],
            Self::Malformed(faults) | Self::Invalid(faults) => faults,
        }
    }

    /// The error with a further fault behind its own.
    pub(super) fn with(mut self, further: Fault) -> Self {
        if let Self::Malformed(faults) | Self::Invalid(faults) = &mut self {
            faults.push(further);
        }
        self
    }
}

fn sentences(faults: &[Fault]) -> String {
    let details: Vec<&str> = faults.iter().map(|fault| &*fault.detail).collect();
    details.join("; ")
}

/// Faults of one kind in one column that are told one by one.
const TOLD_OF_A_KIND: usize = 3;

/// A fault, and how many more like it there are.
#[derive(Debug)]
struct FaultGroup {
    fault: Fault,
    more: u64,
    last_line: Option<u64>,
}

/// The faults met so far.
#[derive(Debug, Default)]
pub(super) struct ReadingFaults {
    kept: Vec<FaultGroup>,
    malformed: bool,
}

impl ReadingFaults {
    /// Keeps a fault in what the text says.
    pub(super) fn invalid(&mut self, fault: Fault) {
        self.keep(FaultGroup {
            last_line: fault.line,
            fault,
            more: 0,
        });
    }

    /// Keeps a fault in the form of the text.
    pub(super) fn malformed(&mut self, fault: Fault) {
        self.malformed = true;
        self.invalid(fault);
    }

    /// Takes over what another has kept.
    pub(super) fn extend(&mut self, other: ReadingFaults) {
        self.malformed |= other.malformed;
        other.kept.into_iter().for_each(|told| self.keep(told));
    }

    fn keep(&mut self, new: FaultGroup) {
        let place = |fault: &Fault| fault.line.is_some() || fault.pointer.is_some();
        let same = |told: &&mut FaultGroup| {
            let (earlier, later) = (&told.fault, &new.fault);
            let is_of_a_kind = earlier.code == later.code && earlier.column == later.column;
            is_of_a_kind && place(earlier) && place(later)
        };
        let count = self.kept.iter_mut().filter(same).count();
        if count >= TOLD_OF_A_KIND
            && let Some(last) = self.kept.iter_mut().rfind(same)
        {
            last.more += 1 + new.more;
            last.last_line = new.last_line.or(last.last_line);
        } else if !self.full() {
            self.kept.push(new);
        }
    }

    /// Whether reading on is pointless because no more faults are kept.
    pub(super) fn full(&self) -> bool {
        self.kept.len() >= MAX_FAULTS
    }

    /// The first fault.
    pub(super) fn first(&self) -> Option<&Fault> {
        self.kept.first().map(|group| &group.fault)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }

    /// An error when there are faults.
    pub(super) fn result(self) -> Result<(), ReadError> {
        if self.kept.is_empty() {
            return Ok(());
        }
        let faults = self.kept.into_iter().map(FaultGroup::counted).collect();
        if self.malformed {
            Err(ReadError::Malformed(faults))
        } else {
            Err(ReadError::Invalid(faults))
        }
    }
}

impl FaultGroup {
    fn counted(self) -> Fault {
        let Self {
            mut fault,
            more,
            last_line,
        } = self;
        if more > 0 {
            let last = last_line.map(|line| format!(", the last on line {line}"));
            let last = last.unwrap_or_default();
            let detail = format!("{}; and {more} more like it{last}", fault.detail);
            fault.detail = detail.into();
        }
        fault
    }
}

/// A fault at a line and, where it is known, a column; the sentence names both.
pub(super) fn at_line(
    line: u64,
    column: Option<&str>,
    code: &'static str,
    detail: impl fmt::Display,
) -> Fault {
    let place = match column {
        Some(column) => format!("line {line}, column `{column}`"),
        None => format!("line {line}"),
    };
    Fault {
        line: Some(line),
        column: column.map(Box::from),
        ..Fault::of_whole(code, format!("{place}: {detail}"))
    }
}

/// A fault at a JSON pointer, which the sentence names too.
pub(super) fn at_pointer(pointer: String, code: &'static str, detail: impl fmt::Display) -> Fault {
    let detail = format!("`{pointer}`: {detail}");
    Fault::new(pointer, code, detail)
}

/// The fault of a source without numbers, at the first text where a number was expected.
pub(super) fn no_signals(detail: &str, text: Option<&Fault>) -> Fault {
    let code = "no_signals";
    match text {
        Some(text) => Fault {
            code: code.into(),
            detail: format!("{detail}: {}", text.detail).into(),
            ..text.clone()
        },
        None => Fault::of_whole(code, detail),
    }
}

/// An error of one fault in the form of the text.
pub(super) fn malformed(fault: Fault) -> ReadError {
    ReadError::Malformed(vec![fault])
}

/// An error of one fault in what the text says.
pub(super) fn invalid(fault: Fault) -> ReadError {
    ReadError::Invalid(vec![fault])
}

/// A fault on its way through readers of text.
#[derive(Debug)]
struct Broken(Fault);

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for Broken {}

/// A fault for a reader of text to pass on.
pub(super) fn broken(fault: Fault) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, Broken(fault))
}

/// The fault that a reader of text passed on.
pub(super) fn told(error: ReadError) -> ReadError {
    let ReadError::Io(error) = error else {
        return error;
    };
    match error.downcast::<Broken>() {
        Ok(Broken(fault)) => malformed(fault),
        Err(error) => ReadError::Io(error),
    }
}

/// The start of a text, short enough for a sentence.
pub(super) fn excerpt(text: &str) -> String {
    /// The longest piece that is repeated, in characters.
    const LONGEST: usize = 40;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}
