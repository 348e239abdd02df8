//! What can go wrong with the store: the database, the file, or what was read from it.
//!
//! "Not found", "in use" and the like are answers, not errors; they are values of the methods.

use std::path::PathBuf;
use std::sync::Arc;

/// A failure of the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The database refused a statement.
    #[error("the database failed: {0}")]
    Database(#[from] sqlx::Error),
    /// A transaction of several writes could not be committed; none of them happened.
    #[error("the database could not commit: {0}")]
    Commit(Arc<sqlx::Error>),
    /// Submissions that were to be written together were refused; none of them happened.
    #[error("{0}")]
    Together(Arc<StoreError>),
    /// The schema could not be brought up to date.
    #[error("the database schema could not be brought up to date: {0}")]
    Migration(#[from] sqlx::migrate::MigrateError),
    /// The queue refused an operation.
    #[error("the queue failed: {0}")]
    Queue(#[from] riverqueue::Error),
    /// The queue's schema could not be brought up to date.
    #[error("the schema of the queue could not be brought up to date: {0}")]
    QueueMigration(#[from] riverqueue::migrate::Error),
    /// Another server has the database.
    #[error("the database {} is in use by another greybox server", path.display())]
    Locked {
        /// The database file.
        path: PathBuf,
    },
    /// The database file or its folder cannot be used.
    #[error("the database {} cannot be opened: {source}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The samples of a recording that is to be stored do not read back.
    #[error("the samples of a recording could not be read back: {0}")]
    Scratch(#[source] std::io::Error),
    /// A stored value does not read back.
    #[error("the stored {what} of {of} does not read back: {why}")]
    Corrupt {
        /// Which column.
        what: &'static str,
        /// Whose.
        of: String,
        /// Why.
        why: String,
    },
    /// The store is closed.
    #[error("the store is closed")]
    Closed,
}
