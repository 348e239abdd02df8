//! What can go wrong with the store: the database, the file, or what was read from it.
//!
//! "Not found", "in use" and the like are answers, not errors; they are values of the methods.

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use sqlx::postgres::PgDatabaseError;

use super::StoredBytes;
use crate::encrypted_file::EncryptedFileError;

/// A project has as much as it may.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum QuotaExceeded {
    /// Too many recordings.
    #[error("the project has as many recordings as it may, {0}; remove some first")]
    Datasets(u64),
    /// Too many bytes, because of new samples.
    #[error(
        "the project has {has}, and this adds {adds}; together they may have {limit}; remove some first"
    )]
    Stored {
        /// What the project has.
        has: StoredBytes,
        /// Bytes of the samples that came.
        adds: u64,
        /// Bytes that the project may have.
        limit: u64,
    },
    /// Too many bytes for another job, which would write more.
    #[error(
        "the project has {has}; together they may have {limit}; remove some before more jobs are taken"
    )]
    StoredForJobs {
        /// What the project has.
        has: StoredBytes,
        /// Bytes that the project may have.
        limit: u64,
    },
    /// Too many unfinished jobs.
    #[error("the project has as many unfinished jobs as it may, {0}; wait until some have ended")]
    UnfinishedJobs(u64),
    /// Too much working time in a day.
    #[error(
        "the jobs of the project were at work for the {limit_s} s that they may be in a day; this \
         begins anew at {until}"
    )]
    Work {
        /// Seconds in a day.
        limit_s: u64,
        /// When the next day begins.
        until: Timestamp,
    },
}

impl QuotaExceeded {
    /// When the same request may be served, where that is a matter of time.
    #[must_use]
    pub fn retry_after(self, now: Timestamp) -> Option<Duration> {
        match self {
            Self::Datasets(_) | Self::Stored { .. } | Self::StoredForJobs { .. } => None,
            Self::UnfinishedJobs(_) => Some(Duration::from_secs(60)),
            Self::Work { until, .. } => {
                let left = until.duration_since(now);
                Some(Duration::try_from(left).unwrap_or_default())
            }
        }
    }
}

/// A failure of the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The database refused a statement.
    #[error("the database failed: {0}")]
    Database(#[from] sqlx::Error),
    /// A transaction of several writes could not be committed; none of them happened.
    #[error("the database could not commit: {0}")]
    Commit(WriteFailure),
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
    /// A secret is encrypted under a key that the server does not have.
    #[error(
        "the database has secrets that are encrypted under the key {id}, which the server does not have: name the \
         file with the key (--secret-keys-file)"
    )]
    SecretKey {
        /// What names the key.
        id: String,
    },
    /// Another server has the database.
    #[error("the database {database} is in use by another greybox server")]
    Locked {
        /// Where the database is.
        database: String,
    },
    /// The database is of a newer program, and this one cannot work with it.
    #[error(
        "the database {database} has the schema {schema}, with which servers of the schema {oldest} or a newer \
         one can work; this one is of {program_schema}: use a newer greybox"
    )]
    TooNew {
        /// Where the database is.
        database: String,
        /// The schema of the database.
        schema: i64,
        /// The oldest schema whose servers can work with the database.
        oldest: i64,
        /// The schema of this program.
        program_schema: i64,
    },
    /// The database is of a program that is too old.
    #[error(
        "the database has the schema {schema}; this greybox opens databases of the schema {oldest} and of newer ones"
    )]
    TooOld {
        /// The schema of the database.
        schema: i64,
        /// The oldest schema that is brought up to date.
        oldest: i64,
    },
    /// Servers that are too old work with the database that is to be brought up to date.
    #[error(
        "the database {database} is to be brought from the schema {schema} to {program_schema}, which the servers that work \
         with it cannot work with: stop all of them first"
    )]
    InTheWay {
        /// Where the database is.
        database: String,
        /// The schema of the database.
        schema: i64,
        /// The schema of this program.
        program_schema: i64,
    },
    /// A pooler stands before the database that gives a connection to one client after the other.
    #[error(
        "the pooler before the database {database} gives a connection to another client after each transaction; a \
         server needs connections for itself: pool_mode = session"
    )]
    SharedSessions {
        /// Where the database is.
        database: String,
    },
    /// A database that is to be copied into has something.
    #[error("the database {0} is not empty")]
    NotEmpty(String),
    /// A database is copied from a file to a PostgreSQL or back.
    #[error(
        "one of the two has to be a file and the other a PostgreSQL; a file is copied by `greybox backup`, \
         a PostgreSQL by its own tools"
    )]
    SameKind,
    /// The database file or its folder cannot be used.
    #[error("the database {} cannot be opened: {source}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// An encrypted backup cannot be written or opened.
    #[error("the backup {} cannot be used: {source}", path.display())]
    EncryptedFile {
        /// The file.
        path: PathBuf,
        /// Why.
        source: EncryptedFileError,
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
    /// The project has as much as it may.
    #[error(transparent)]
    Quota(#[from] QuotaExceeded),
    /// The store is closed.
    #[error("the store is closed")]
    Closed,
}

/// Why a write did not come to disk.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{why}")]
pub struct WriteFailure {
    why: String,
    pub(super) meaning: Meaning,
}

/// SQLite's result codes, without their extensions: <https://www.sqlite.org/rescode.html>.
mod code {
    pub(super) const BUSY: i32 = 5;
    pub(super) const LOCKED: i32 = 6;
    pub(super) const READONLY: i32 = 8;
    pub(super) const IOERR: i32 = 10;
    pub(super) const FULL: i32 = 13;
    pub(super) const CANTOPEN: i32 = 14;
    pub(super) const CORRUPT: i32 = 11;
    pub(super) const NOTADB: i32 = 26;
}

/// PostgreSQL's: <https://www.postgresql.org/docs/current/errcodes-appendix.html>.
mod postgres_code {
    pub(super) const READ_ONLY: &str = "25006";
    /// A transaction stood still for too long.
    pub(super) const IDLE_TRANSACTION: &str = "25P03";
    /// Others had a lock for too long.
    pub(super) const NO_LOCK: &str = "55P03";
    /// A character that a text cannot have.
    pub(super) const NO_TEXT: &str = "22021";
    pub(super) const DISK_FULL: &str = "53100";
    /// The class of data, and of indices, that are not sound.
    pub(super) const CORRUPT: &str = "XX";
    /// A fault of the program, of the same class.
    pub(super) const INTERNAL: &str = "XX000";
}

impl WriteFailure {
    pub(super) fn of(error: &StoreError) -> Self {
        match error {
            StoreError::Commit(failure) => failure.clone(),
            StoreError::Together(error) => Self::of(error),
            StoreError::Database(error) | StoreError::Queue(riverqueue::Error::Database(error)) => {
                Self::of_database(error)
            }
            other => Self {
                why: other.to_string(),
                meaning: match other {
                    StoreError::Corrupt { .. } => Meaning::Damaged,
                    _ => Meaning::Fault,
                },
            },
        }
    }

    pub(super) fn of_database(error: &sqlx::Error) -> Self {
        let of_database = error.as_database_error();
        let postgres = of_database.and_then(|error| error.try_downcast_ref::<PgDatabaseError>());
        let meaning = match (postgres, of_database, error) {
            (Some(error), ..) => of_postgres(error.code()),
            (None, Some(error), _) => of_sqlite(error.code().map_or(0, primary)),
            // The connection went with what happened to it; the next one is another.
            (
                None,
                None,
                sqlx::Error::PoolTimedOut
                | sqlx::Error::WorkerCrashed
                | sqlx::Error::Io(_)
                | sqlx::Error::Tls(_),
            ) => Meaning::Unavailable,
            // A text that is none, a number where there has to be a text.
            (None, None, sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_)) => {
                Meaning::Damaged
            }
            _ => Meaning::Fault,
        };
        Self {
            why: error.to_string(),
            meaning,
        }
    }

    /// Other nodes have declared this one dead.
    pub(super) fn superseded() -> Self {
        Self {
            why: "other nodes have declared this one dead and gone on without it".to_owned(),
            meaning: Meaning::Unavailable,
        }
    }

    /// The database has not answered; what came of the transaction is not known.
    pub(super) fn no_answer() -> Self {
        Self {
            why: "the database has not answered".to_owned(),
            meaning: Meaning::Unavailable,
        }
    }

    /// Whether the disk or what stands for it refuses, whatever is written: it may not the next
    /// time.
    pub(super) fn is_of_the_disk(&self) -> bool {
        matches!(self.meaning, Meaning::NoRoom | Meaning::Unavailable)
    }
}

fn of_sqlite(code: i32) -> Meaning {
    match code {
        code::FULL => Meaning::NoRoom,
        code::BUSY | code::LOCKED | code::READONLY | code::IOERR | code::CANTOPEN => {
            Meaning::Unavailable
        }
        code::CORRUPT | code::NOTADB => Meaning::Damaged,
        _ => Meaning::Fault,
    }
}

/// By its classes: a connection, no resources, an operator or a crash, an error of the system.
fn of_postgres(code: &str) -> Meaning {
    match code {
        postgres_code::DISK_FULL => Meaning::NoRoom,
        postgres_code::READ_ONLY | postgres_code::IDLE_TRANSACTION | postgres_code::NO_LOCK => {
            Meaning::Unavailable
        }
        postgres_code::NO_TEXT => Meaning::NoText,
        postgres_code::INTERNAL => Meaning::Fault,
        _ if code.starts_with(postgres_code::CORRUPT) => Meaning::Damaged,
        _ if ["08", "40", "53", "57", "58"].contains(&&code[..2]) => Meaning::Unavailable,
        _ => Meaning::Fault,
    }
}

/// The code without its extension, which stands in the upper bits.
fn primary(code: Cow<'_, str>) -> i32 {
    code.parse::<i32>().map_or(0, |code| code & 0xff)
}

/// What a failure of the store means to whoever asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// The server is going down.
    ShuttingDown,
    /// A text has a NUL character, which the database does not take.
    NoText,
    /// There is no room left on the disk.
    NoRoom,
    /// The database cannot be written or read just now.
    Unavailable,
    /// Stored data are not what was written.
    Damaged,
    /// The program is at fault.
    Fault,
}

impl StoreError {
    /// What the error means to the caller.
    #[must_use]
    pub fn meaning(&self) -> Meaning {
        match self {
            Self::Closed | Self::Database(sqlx::Error::PoolClosed) => Meaning::ShuttingDown,
            Self::Scratch(error) | Self::File { source: error, .. } => Meaning::of_file(error),
            error => WriteFailure::of(error).meaning,
        }
    }

    /// What a damaged row is and which it is, where the error names one.
    #[must_use]
    pub fn corrupt_row(&self) -> Option<(&'static str, &str)> {
        match self {
            Self::Corrupt { what, of, .. } => Some((what, of)),
            Self::Together(error) => error.corrupt_row(),
            _ => None,
        }
    }
}

impl Meaning {
    /// What a failure of a file beside the database means.
    #[must_use]
    pub fn of_file(error: &std::io::Error) -> Self {
        use std::io::ErrorKind;
        match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
                Self::NoRoom
            }
            ErrorKind::ReadOnlyFilesystem => Self::Unavailable,
            _ => Self::Fault,
        }
    }
}

/// What is wrong with a row, as an error.
pub(super) fn corrupt(what: &'static str, of: impl ToString, why: impl ToString) -> StoreError {
    StoreError::Corrupt {
        what,
        of: of.to_string(),
        why: why.to_string(),
    }
}
