//! The two databases under one store: statements with their values, rows, pools and transactions.
//!
//! A statement is written once, with its values as `$1`, `$2` …, and runs on SQLite and on
//! PostgreSQL. Where the two have different words for a thing, [`Kind::either`] picks one.

mod connection;
pub(super) mod postgres;
mod query;
mod query_builder;
mod row;
pub(super) mod sqlite;
mod value;

pub(super) use connection::{Connection, Pool, Target, Transaction};
pub(super) use query::{Query, query, query_as, query_scalar};
pub(super) use query_builder::{QueryBuilder, Separated};
pub(super) use row::{Record, Row};
pub(super) use value::Value;

use sqlx::migrate::{MigrateError, Migrator};

use super::StoreError;

/// The schema that the first migration makes of a new database. An older database came to the same schema by
/// migrations that are no longer kept, the last of which had the same number.
const FIRST_SCHEMA: i64 = 44;

/// The migrations that a database of a schema may still need; a new database has no schema.
fn migrations_after(schema: Option<i64>, all: &Migrator) -> Result<Migrator, StoreError> {
    let newest = all.iter().map(|migration| migration.version).max();
    match schema {
        Some(schema) if schema < FIRST_SCHEMA => {
            return Err(StoreError::TooOld {
                schema,
                oldest: FIRST_SCHEMA,
            });
        }
        Some(schema) if Some(schema) > newest => {
            return Err(MigrateError::VersionMissing(schema).into());
        }
        _ => {}
    }
    let is_made = |version| schema.is_some() && version == FIRST_SCHEMA;
    let rest = all.iter().filter(|migration| !is_made(migration.version));
    let mut rest = Migrator::with_migrations(rest.cloned().collect());
    rest.set_ignore_missing(true);
    Ok(rest)
}

/// Which database it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Sqlite,
    Postgres,
}

impl Kind {
    /// What this database has of two things that do the same.
    pub(super) fn either<T>(self, sqlite: T, postgres: T) -> T {
        match self {
            Self::Sqlite => sqlite,
            Self::Postgres => postgres,
        }
    }
}
