//! Where the rows of a series are in a PostgreSQL.

use super::time_column::TimeColumn;
use crate::collect::error::CollectError;
use crate::collect::series::SourceColumn;

/// Where the rows of a series are.
pub(super) struct RowsPlace {
    /// A table or a query in brackets.
    pub(super) from: String,
    /// The expression of the time.
    pub(super) time: String,
    /// What the time is.
    pub(super) kind: TimeColumn,
    /// The columns, whose fields are expressions.
    pub(super) columns: Vec<SourceColumn>,
    /// Conditions that each row meets, each with `AND` behind.
    pub(super) conditions: String,
}

/// A failure that asks for another connection.
pub(super) fn away(error: sqlx::Error) -> CollectError {
    CollectError::SourceAway(error.to_string())
}

/// A failure of a statement: the source refuses the statement, or is away.
pub(super) fn failure(error: sqlx::Error) -> CollectError {
    match &error {
        sqlx::Error::Database(refusal) => CollectError::SourceRefuses(refusal.message().to_owned()),
        _ => away(error),
    }
}
