//! A TOML document whose entries are taken one after the other. All faults are kept, each with its line.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt;

use jiff::Timestamp;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Something in a sources file that is wrong.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SourcesFault {
    /// The line, from 1.
    pub line: usize,
    /// A sentence that says why, and what would be right.
    pub detail: String,
}

impl fmt::Display for SourcesFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.detail)
    }
}

/// The text of a document and the faults in it.
pub(super) struct SourcesDocument<'t> {
    text: &'t str,
    faults: RefCell<Vec<SourcesFault>>,
}

impl<'t> SourcesDocument<'t> {
    pub(super) fn new(text: &'t str) -> Self {
        Self {
            text,
            faults: RefCell::default(),
        }
    }

    /// Keeps a fault at a byte of the text.
    pub(super) fn fault(&self, byte: usize, detail: impl Into<String>) {
        let before = &self.text.as_bytes()[..byte.min(self.text.len())];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        let detail = detail.into();
        self.faults.borrow_mut().push(SourcesFault { line, detail });
    }

    /// The table that the whole text is.
    pub(super) fn root<'d>(&'d self) -> SourcesTable<'d, 't> {
        let (table, errors) = DeTable::parse_recoverable(self.text);
        for error in errors {
            let byte = error.span().map_or(0, |span| span.start);
            self.fault(byte, error.message());
        }
        SourcesTable::new(self, "the file", 0, table.into_inner())
    }

    /// The faults in the order of their lines; none where the document is right.
    pub(super) fn faults(self) -> Vec<SourcesFault> {
        let mut faults = self.faults.into_inner();
        faults.sort();
        faults.dedup();
        faults
    }
}

/// A table whose entries are taken by their names.
pub(super) struct SourcesTable<'d, 't> {
    document: &'d SourcesDocument<'t>,
    /// How faults call the table.
    name: String,
    /// The byte at which the table begins.
    start: usize,
    entries: BTreeMap<String, (usize, DeValue<'t>)>,
}

impl<'d, 't> SourcesTable<'d, 't> {
    fn new(
        document: &'d SourcesDocument<'t>,
        name: &str,
        start: usize,
        table: DeTable<'t>,
    ) -> Self {
        let entries = table.into_iter().map(|(key, value)| {
            let byte = key.span().start;
            (key.into_inner().into_owned(), (byte, value.into_inner()))
        });
        Self {
            document,
            name: name.to_owned(),
            start,
            entries: entries.collect(),
        }
    }

    /// Keeps a fault at the beginning of the table.
    pub(super) fn fault(&self, detail: impl Into<String>) {
        self.document.fault(self.start, detail);
    }

    /// Keeps a fault at an entry that is still to be taken, or at the beginning of the table.
    pub(super) fn fault_at(&self, key: &str, detail: impl Into<String>) {
        let byte = self.entries.get(key).map_or(self.start, |entry| entry.0);
        self.document.fault(byte, detail);
    }

    /// Whether there is an entry that was not taken yet.
    pub(super) fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// Whether an entry that was not taken yet is a table.
    pub(super) fn is_table(&self, key: &str) -> bool {
        let entry = self.entries.get(key);
        entry.is_some_and(|(_, value)| value.is_table())
    }

    /// Leaves out an entry of which a fault was told already.
    pub(super) fn skip(&mut self, key: &str) {
        self.entries.remove(key);
    }

    /// Takes an entry that is read by `read`, which says what it should be where it is something else.
    fn take<T>(
        &mut self,
        key: &str,
        read: impl FnOnce(DeValue<'t>) -> Result<T, String>,
    ) -> Option<T> {
        let (byte, value) = self.entries.remove(key)?;
        match read(value) {
            Ok(value) => Some(value),
            Err(should_be) => {
                let detail = format!("`{key}` of {} {should_be}", self.name);
                self.document.fault(byte, detail);
                None
            }
        }
    }

    /// Takes a text.
    pub(super) fn text(&mut self, key: &str) -> Option<String> {
        self.take(key, |value| match value {
            DeValue::String(text) if !text.trim().is_empty() => Ok(text.into_owned()),
            _ => Err("is a text in quotes with something in it".to_owned()),
        })
    }

    /// Takes a text that `parse` understands, or says why not.
    pub(super) fn parsed<T>(
        &mut self,
        key: &str,
        parse: impl FnOnce(&str) -> Result<T, String>,
    ) -> Option<T> {
        self.take(key, |value| match value.as_str() {
            Some(text) => parse(text),
            None => Err("is a text in quotes".to_owned()),
        })
    }

    /// Takes a text that must be there. Nothing is read twice: a fault is kept where the text is absent.
    pub(super) fn required<T>(
        &mut self,
        key: &str,
        take: impl FnOnce(&mut Self, &str) -> Option<T>,
    ) -> Option<T> {
        if !self.has(key) {
            self.fault(format!("{} has no `{key}`", self.name));
            return None;
        }
        take(self, key)
    }

    /// Takes a number of seconds, not below `least`.
    pub(super) fn seconds(&mut self, key: &str, least: f64) -> Option<f64> {
        self.take(key, |value| {
            let number = match &value {
                DeValue::Integer(integer) => integer.as_str().parse().ok(),
                DeValue::Float(float) => float.as_str().parse().ok(),
                _ => None,
            };
            let fits = |seconds: &f64| seconds.is_finite() && (least..=1e10).contains(seconds);
            let refusal = || format!("is a number of seconds, {least} at the least");
            number.filter(fits).ok_or_else(refusal)
        })
    }

    /// Takes a whole number between two bounds.
    pub(super) fn count(&mut self, key: &str, least: u32, most: u32) -> Option<u32> {
        self.take(key, |value| {
            let number = value.as_integer();
            let number = number.and_then(|integer| integer.as_str().parse().ok());
            let refusal = || format!("is a whole number from {least} to {most}");
            number
                .filter(|number| (least..=most).contains(number))
                .ok_or_else(refusal)
        })
    }

    /// Takes an instant, as TOML writes one with an offset.
    pub(super) fn instant(&mut self, key: &str) -> Option<Timestamp> {
        self.take(key, |value| {
            let written = match &value {
                DeValue::Datetime(instant) => instant.to_string(),
                DeValue::String(text) => text.to_string(),
                _ => String::new(),
            };
            let refusal = "is an instant with its offset, such as 2026-01-01T00:00:00Z";
            written.parse().map_err(|_| refusal.to_owned())
        })
    }

    /// Takes a table, which faults call `name`.
    pub(super) fn table(&mut self, key: &str, name: &str) -> Option<SourcesTable<'d, 't>> {
        let start = self.entries.get(key)?.0;
        let table = self.take(key, |value| match value {
            DeValue::Table(table) => Ok(table),
            _ => Err("is a table".to_owned()),
        })?;
        Some(SourcesTable::new(self.document, name, start, table))
    }

    /// Takes the tables of an array, which faults call by `name` and their number.
    pub(super) fn tables(&mut self, key: &str, name: &str) -> Vec<SourcesTable<'d, 't>> {
        let array = self.take(key, |value| match value {
            DeValue::Array(array) => Ok(array),
            _ => Err(format!("is a list of tables: [[{key}]]")),
        });
        let numbered = array.into_iter().flatten().zip(1..);
        let table = |(value, number): (Spanned<DeValue<'t>>, usize)| {
            let start = value.span().start;
            let DeValue::Table(table) = value.into_inner() else {
                let detail = format!("`{key}` is a list of tables: [[{key}]]");
                self.document.fault(start, detail);
                return None;
            };
            let name = format!("{name} {number}");
            Some(SourcesTable::new(self.document, &name, start, table))
        };
        numbered.filter_map(table).collect()
    }

    /// Takes the texts of a table by their names.
    pub(super) fn texts(&mut self, key: &str) -> BTreeMap<String, String> {
        let name = format!("`{key}` of {}", self.name);
        let Some(mut table) = self.table(key, &name) else {
            return BTreeMap::new();
        };
        let names = table.names();
        let texts = names.into_iter().filter_map(|name| {
            let text = table.text(&name)?;
            Some((name, text))
        });
        texts.collect()
    }

    /// The names of the entries that were not taken yet.
    pub(super) fn names(&self) -> Vec<String> {
        self.entries.keys().cloned().collect()
    }

    /// Refuses what was not taken; `names` are the names that there are.
    pub(super) fn end(&self, names: &[&str]) {
        for (name, (byte, _)) in &self.entries {
            let near = names.iter().find(|entry| is_near(entry, name));
            let near = near.map_or(String::new(), |near| format!("; is `{near}` meant?"));
            let detail = format!("{} has no entry `{name}`{near}", self.name);
            self.document.fault(*byte, detail);
        }
    }
}

/// Whether a name is a misspelling of an entry: the letters are the same but for one or two.
fn is_near(entry: &str, name: &str) -> bool {
    strsim::damerau_levenshtein(entry, name) <= 2
}
