//! Reads what columns hold: times, identifiers, JSON and words.

use jiff::Timestamp;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::database::Row;
use super::error::{StoreError, corrupt};
use crate::access::Project;
use crate::job::Status;
use greybox::identification::JobId;

/// A number of a row that is not negative.
pub(super) fn unsigned<T: TryFrom<i64>>(
    what: &'static str,
    of: &str,
    value: i64,
) -> Result<T, StoreError> {
    T::try_from(value).map_err(|_| corrupt(what, of, format_args!("it is {value}")))
}

/// Reads a job's state.
pub(super) fn parse_status(of: &str, word: &str) -> Result<Status, StoreError> {
    word.parse().map_err(|why| corrupt("status", of, why))
}

/// The project of a name.
pub(super) fn project(of: &str, name: &str) -> Result<Project, StoreError> {
    name.parse().map_err(|why| corrupt("project", of, why))
}

/// A job's identifier.
pub(super) fn parse_id(text: &str) -> Result<JobId, StoreError> {
    text.parse().map_err(|why| corrupt("identifier", text, why))
}

/// What a column of JSON holds.
pub(super) fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("what is stored has only text keys")
}

/// Reads a column of JSON.
pub(super) fn from_json<T: DeserializeOwned>(
    what: &'static str,
    of: &str,
    text: &str,
) -> Result<T, StoreError> {
    serde_json::from_str(text).map_err(|why| corrupt(what, of, why))
}

/// Reads a column of JSON that may be null.
pub(super) fn optional<T: DeserializeOwned>(
    row: &Row,
    column: &'static str,
    of: &str,
) -> Result<Option<T>, StoreError> {
    let text: Option<&str> = row.try_get(column)?;
    text.map(|text| from_json(column, of, text)).transpose()
}

/// Reads a time.
pub(super) fn time(of: &str, text: &str) -> Result<Timestamp, StoreError> {
    text.parse().map_err(|why| corrupt("time", of, why))
}

/// Reads a time that may be null.
pub(super) fn optional_time(of: &str, text: Option<&str>) -> Result<Option<Timestamp>, StoreError> {
    text.map(|text| time(of, text)).transpose()
}
