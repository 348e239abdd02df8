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
