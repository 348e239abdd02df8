//! Seals: a digest beside each row that something is computed from or answered with, so that a row which is
//! not what was written is found when it is read, and is named.
//!
//! A seal covers the name of the table, the key and the content, so that rows which stand in each other's place
//! are found too. It has 64 bits of SHA-256: a row that is damaged by chance passes once in 2⁶⁴ times, and a
//! number of 64 bits is what both databases store and compare without a detour. A seal has no secret, so it is
//! no guard against somebody who changes a row and its seal; no width would be.
//!
//! Rows from before there were seals have none. Such a row is taken as it is, and `greybox check` counts it.

pub(super) mod check;

use sha2::{Digest, Sha256};

use super::database::{Row, Value};
use super::{StoreError, corrupt};

/// A table whose rows are sealed.
#[derive(Debug)]
pub(super) struct Sealed {
    /// What a row is, for people.
    what: &'static str,
    /// The name of the table.
    pub(super) table: &'static str,
    /// The columns of the key, in its order.
    pub(super) key: &'static [Column],
    /// The columns that are sealed with the key.
    pub(super) content: &'static [Column],
}

/// A column of a sealed row.
#[derive(Clone, Copy, Debug)]
pub(super) enum Column {
    Text(&'static str),
    Integer(&'static str),
    Bytes(&'static str),
}

use Column::{Bytes, Integer, Text};

pub(super) const JOBS: Sealed = Sealed {
    what: "specification",
    table: "jobs",
    key: &[Text("id")],
    content: &[
        Text("project"),
        Text("name"),
        Text("labels"),
        Text("model"),
        Text("spec"),
    ],
};

pub(super) const DATASETS: Sealed = Sealed {
    what: "description",
    table: "datasets",
    key: &[Text("id")],
    content: &[
        Text("project"),
        Text("name"),
        Text("digest"),
        Text("description"),
        Text("summary"),
        Text("created_at"),
    ],
};

pub(super) const DATASET_CHUNKS: Sealed = Sealed {
    what: "part of the samples",
    table: "dataset_chunks",
    key: &[Text("dataset"), Integer("position"), Integer("chunk")],
    content: &[Bytes("samples")],
};

pub(super) const STREAM_BLOCKS: Sealed = Sealed {
    what: "block",
    table: "stream_blocks",
    key: &[Text("stream"), Integer("first_ns")],
    content: &[Integer("last_ns"), Integer("rows"), Bytes("samples")],
};

pub(super) const STREAM_EXTREMES: Sealed = Sealed {
    what: "list of extremes",
    table: "stream_extremes",
    key: &[Text("stream"), Integer("first_ns")],
    content: &[Integer("rows"), Bytes("samples")],
};

pub(super) const CHECKPOINTS: Sealed = Sealed {
    what: "checkpoint",
    table: "checkpoints",
    key: &[Text("job")],
    content: &[Bytes("state"), Integer("refinements")],
};

pub(super) const RESULTS: Sealed = Sealed {
    what: "result",
    table: "results",
    key: &[Text("job")],
    content: &[Text("outcome")],
};

pub(super) const EVENTS: Sealed = Sealed {
    what: "event",
    table: "events",
    key: &[Text("job"), Integer("id")],
    content: &[Text("name"), Text("data")],
};

pub(super) const GENERATIONS: Sealed = Sealed {
    what: "generation",
    table: "generations",
    key: &[Text("job"), Integer("generation")],
    content: &[Text("row")],
};

pub(super) const CANDIDATE_RECORDS: Sealed = Sealed {
    what: "list of candidates",
    table: "candidate_records",
    key: &[Text("job")],
    content: &[
        Text("columns"),
        Integer("kept"),
        Integer("cut_in_generation"),
    ],
};

pub(super) const CANDIDATES: Sealed = Sealed {
    what: "generation of candidates",
    table: "candidates",
    key: &[Text("job"), Integer("generation")],
    content: &[Bytes("candidates")],
};

pub(super) const MONITORS: Sealed = Sealed {
    what: "state",
    table: "monitors",
    key: &[Text("id")],
    content: &[
        Text("project"),
        Text("name"),
        Text("stream"),
        Text("spec"),
        Text("state"),
        Integer("due_ns"),
    ],
};

pub(super) const MONITOR_WINDOWS: Sealed = Sealed {
    what: "window",
    table: "monitor_windows",
    key: &[Text("monitor"), Integer("number")],
    content: &[Text("row")],
};

pub(super) const MONITOR_ALARMS: Sealed = Sealed {
    what: "alarm",
    table: "monitor_alarms",
    key: &[Text("monitor"), Integer("id")],
    content: &[Text("row")],
};

pub(super) const MONITOR_EVENTS: Sealed = Sealed {
    what: "event",
    table: "monitor_events",
    key: &[Text("monitor"), Integer("id")],
    content: &[Text("name"), Text("data")],
};

pub(super) const MODELS: Sealed = Sealed {
    what: "model",
    table: "models",
    key: &[Text("project"), Text("reference")],
    content: &[Text("digest"), Text("document"), Text("created_at")],
};

pub(super) const TOKENS: Sealed = Sealed {
    what: "token",
    table: "tokens",
    key: &[Text("digest")],
    // When a token was revoked and last used is written later, by older nodes too.
    content: &[
        Text("name"),
        Text("scope"),
        Text("streams"),
        Text("project"),
        Text("created_at"),
        Text("expires_at"),
    ],
};

pub(super) const SHARED_PARTS: Sealed = Sealed {
    what: "part",
    table: "shared_parts",
    key: &[Text("job"), Text("name")],
    content: &[Text("part")],
};

/// All tables whose rows are sealed.
pub(super) const TABLES: [&Sealed; 18] = [
    &JOBS,
    &DATASETS,
    &DATASET_CHUNKS,
    &STREAM_BLOCKS,
    &STREAM_EXTREMES,
    &CHECKPOINTS,
    &RESULTS,
    &EVENTS,
    &GENERATIONS,
    &CANDIDATE_RECORDS,
    &CANDIDATES,
    &MONITORS,
    &MONITOR_WINDOWS,
    &MONITOR_ALARMS,
    &MONITOR_EVENTS,
    &MODELS,
    &TOKENS,
    &SHARED_PARTS,
];

/// What one column of a row holds.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part<'a> {
    Text(Option<&'a str>),
    Integer(Option<i64>),
    Bytes(&'a [u8]),
}

impl Column {
    /// The name of the column.
    pub(super) fn name(self) -> &'static str {
        match self {
            Text(name) | Integer(name) | Bytes(name) => name,
        }
    }

    fn read(self, row: &Row) -> Result<Part<'_>, sqlx::Error> {
        Ok(match self {
            Text(name) => Part::Text(row.try_get(name)?),
            Integer(name) => Part::Integer(row.try_get(name)?),
            Bytes(name) => Part::Bytes(row.try_get(name)?),
        })
    }

    /// What the column holds in a row, as a statement takes it.
    pub(super) fn value(self, row: &Row) -> Result<Value, sqlx::Error> {
        Ok(match self.read(row)? {
            Part::Text(text) => Value::Text(text.map(str::to_owned)),
            Part::Integer(number) => Value::Integer(number),
            Part::Bytes(bytes) => bytes.into(),
        })
    }
}

impl Sealed {
    /// The columns that a seal covers, in the order in which it does.
    pub(super) fn columns(&self) -> impl Iterator<Item = Column> {
        self.key.iter().chain(self.content).copied()
    }

    /// The seal of a row that holds these parts, one for each of the columns.
    pub(super) fn seal(&self, parts: &[Part<'_>]) -> i64 {
        debug_assert_eq!(parts.len(), self.columns().count(), "{}", self.table);
        let mut digest = Sha256::new();
        take(&mut digest, Part::Text(Some(self.table)));
        for part in parts {
            take(&mut digest, *part);
        }
        let digest = digest.finalize();
        i64::from_le_bytes(*digest.first_chunk().expect("a digest has 32 bytes"))
    }

    /// The seal of a row as it is stored now.
    pub(super) fn seal_of(&self, row: &Row) -> Result<i64, StoreError> {
        let parts: Result<Vec<Part<'_>>, sqlx::Error> =
            self.columns().map(|column| column.read(row)).collect();
        let parts = parts.map_err(|why| self.damaged(row, why))?;
        Ok(self.seal(&parts))
    }

    /// Whether a row has a seal.
    ///
    /// # Errors
    /// The row has one, and it is not that of what the row holds.
    pub(super) fn verify(&self, row: &Row) -> Result<bool, StoreError> {
        let stored: Option<i64> = row.try_get("seal").map_err(|why| self.damaged(row, why))?;
        // Parts that do not read are damage, in a row without a seal too.
        let seal = self.seal_of(row)?;
        match stored {
            Some(stored) if stored != seal => Err(self.damaged(row, "it is not what was written")),
            stored => Ok(stored.is_some()),
        }
    }

    /// Says which row is damaged.
    fn damaged(&self, row: &Row, why: impl ToString) -> StoreError {
        let key = self.key.iter().map(|column| match column.read(row) {
            Ok(Part::Text(Some(text))) => text.to_owned(),
            Ok(Part::Integer(Some(number))) => number.to_string(),
            _ => "?".to_owned(),
        });
        corrupt(self.what, key.collect::<Vec<_>>().join(" "), why)
    }
}

fn take(digest: &mut Sha256, part: Part<'_>) {
    let number;
    let (kind, bytes): (u8, &[u8]) = match part {
        Part::Text(None) | Part::Integer(None) => (0, &[]),
        Part::Text(Some(text)) => (1, text.as_bytes()),
        Part::Integer(Some(value)) => {
            number = value.to_le_bytes();
            (2, &number)
        }
        Part::Bytes(bytes) => (3, bytes),
    };
    digest.update([kind]);
    digest.update((bytes.len() as u64).to_le_bytes());
    digest.update(bytes);
}

/// How a type becomes a part of a row.
macro_rules! parts {
    ($($type:ty => $value:ident, $part:expr;)*) => {$(
        impl<'a> From<$type> for Part<'a> {
            fn from($value: $type) -> Self {
                $part
            }
        }
    )*};
}

parts! {
    &'a str => value, Self::Text(Some(value));
    &'a String => value, Self::Text(Some(value));
    &'a Option<String> => value, Self::Text(value.as_deref());
    i64 => value, Self::Integer(Some(value));
    u32 => value, Self::Integer(Some(i64::from(value)));
    Option<u32> => value, Self::Integer(value.map(i64::from));
    &'a [u8] => value, Self::Bytes(value);
    &'a Vec<u8> => value, Self::Bytes(value);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_in_another_column_row_or_table_has_another_seal() {
        let seals = [
            EVENTS.seal(&["a".into(), 1_i64.into(), "b".into(), "c".into()]),
            EVENTS.seal(&["a".into(), 1_i64.into(), "".into(), "bc".into()]),
            EVENTS.seal(&["a".into(), 2_i64.into(), "b".into(), "c".into()]),
            EVENTS.seal(&["b".into(), 1_i64.into(), "a".into(), "c".into()]),
            MONITOR_EVENTS.seal(&["a".into(), 1_i64.into(), "b".into(), "c".into()]),
        ];
        for (place, seal) in seals.iter().enumerate() {
            assert!(!seals[..place].contains(seal), "{place}");
        }
    }
}
