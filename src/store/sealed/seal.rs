//! A seal: how it is computed, verified and told of.

use sha2::{Digest, Sha256};

use crate::store::database::{QueryBuilder, Row, Value};
use crate::store::{StoreError, corrupt};
use Column::{Bytes, Integer, Real, Text};

/// A table whose rows are sealed.
#[derive(Debug)]
pub(in crate::store) struct Sealed {
    /// What a row is, for people.
    pub(super) what: &'static str,
    /// The name of the table.
    pub(in crate::store) table: &'static str,
    /// The columns of the key, in its order.
    pub(in crate::store) key: &'static [Column],
    /// The columns that are sealed with the key.
    pub(in crate::store) content: &'static [Column],
    /// The column with the seal.
    pub(in crate::store) seal: &'static str,
}

/// A column of a sealed row.
#[derive(Clone, Copy, Debug)]
pub(in crate::store) enum Column {
    Text(&'static str),
    Integer(&'static str),
    Bytes(&'static str),
    Real(&'static str),
}

/// What one column of a row holds.
#[derive(Clone, Copy, Debug)]
pub(in crate::store) enum Part<'a> {
    Text(Option<&'a str>),
    Integer(Option<i64>),
    Bytes(&'a [u8]),
    Real(Option<f64>),
}

impl Column {
    /// The name of the column.
    pub(in crate::store) fn name(self) -> &'static str {
        match self {
            Text(name) | Integer(name) | Bytes(name) | Real(name) => name,
        }
    }

    fn read(self, row: &Row) -> Result<Part<'_>, sqlx::Error> {
        Ok(match self {
            Text(name) => Part::Text(row.try_get(name)?),
            Integer(name) => Part::Integer(row.try_get(name)?),
            Bytes(name) => Part::Bytes(row.try_get(name)?),
            Real(name) => Part::Real(row.try_get(name)?),
        })
    }

    /// What the column holds in a row, as a statement takes it.
    pub(in crate::store) fn value(self, row: &Row) -> Result<Value, sqlx::Error> {
        Ok(match self.read(row)? {
            Part::Text(text) => Value::Text(text.map(str::to_owned)),
            Part::Integer(number) => Value::Integer(number),
            Part::Bytes(bytes) => bytes.into(),
            Part::Real(number) => Value::Real(number),
        })
    }
}

impl Sealed {
    /// The columns that a seal covers, in the order in which it does.
    pub(in crate::store) fn columns(&self) -> impl Iterator<Item = Column> {
        self.key.iter().chain(self.content).copied()
    }

    /// A statement up to the name of its table that reads what a seal covers.
    pub(in crate::store) fn select(&self) -> QueryBuilder {
        let mut select = QueryBuilder::new("select ");
        for column in self.columns() {
            select.push(format_args!("\"{}\", ", column.name()));
        }
        select.push(format_args!("{} from ", self.seal));
        select
    }

    /// The seal of a row that holds these parts, one for each of the columns.
    pub(in crate::store) fn seal(&self, parts: &[Part<'_>]) -> i64 {
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
    pub(in crate::store) fn seal_of(&self, row: &Row) -> Result<i64, StoreError> {
        let parts: Result<Vec<Part<'_>>, sqlx::Error> =
            self.columns().map(|column| column.read(row)).collect();
        let parts = parts.map_err(|why| self.damaged(row, why))?;
        Ok(self.seal(&parts))
    }

    /// Whether a row has a seal.
    ///
    /// # Errors
    /// The row has one, and it is not that of what the row holds.
    pub(in crate::store) fn verify(&self, row: &Row) -> Result<bool, StoreError> {
        let stored: Option<i64> = row
            .try_get(self.seal)
            .map_err(|why| self.damaged(row, why))?;
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
        Part::Text(None) | Part::Integer(None) | Part::Real(None) => (0, &[]),
        Part::Text(Some(text)) => (1, text.as_bytes()),
        Part::Integer(Some(value)) => {
            number = value.to_le_bytes();
            (2, &number)
        }
        Part::Bytes(bytes) => (3, bytes),
        Part::Real(Some(value)) => {
            number = value.to_le_bytes();
            (4, &number)
        }
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
    use crate::store::sealed::{EVENTS, MONITOR_EVENTS};

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
