//! The two databases under one store: statements with their values, rows, pools and transactions.
//!
//! A statement is written once, with its values as `$1`, `$2` …, and runs on SQLite and on
//! PostgreSQL. Where the two have different words for a thing, [`Kind::either`] picks one.

mod connection;
mod kind;
mod losses;
mod migrations;
pub(super) mod postgres;
mod query;
mod query_builder;
mod row;
pub(super) mod sqlite;
mod value;

pub(super) use connection::{Connection, Pool, Target, Transaction};
pub(super) use kind::Kind;
pub(super) use losses::Losses;
pub(super) use query::{Query, query, query_as, query_scalar};
pub(super) use query_builder::{QueryBuilder, Separated};
pub(super) use row::{Record, Row};
pub(super) use value::Value;
