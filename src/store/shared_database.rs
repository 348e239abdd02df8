//! What the handles of all resources work on.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::damage::Damage;
use super::database::Pool;
use super::lock::FileLock;
use super::secret_keys::SecretKeys;
use super::writer::Writer;

/// The database of a server, as every handle works with it.
pub(super) struct Database {
    /// Statements that only read run on these connections, several at the same time.
    pub(super) readers: Pool,
    /// Every write goes through the writer, which gathers writes in transactions.
    pub(super) writer: Arc<Writer>,
    /// The connections of the writer, which the clients of the queue share.
    pub(super) writer_pool: Pool,
    /// Every reader notes the damaged rows that it meets.
    pub(super) damage: Damage,
    /// The number of this server's life: jobs at work in another life are left alone.
    pub(super) life: i64,
    /// When the life began: a job that took servers down waits until the server has been up for a while.
    pub(super) opened: Instant,
    /// The keys under which secrets stand in the database.
    pub(super) keys: SecretKeys,
    /// Temporary files lie in the folder of the database.
    pub(super) folder: PathBuf,
    /// Keeps other servers from a file for as long as a handle is there.
    pub(super) _lock: Option<FileLock>,
}
