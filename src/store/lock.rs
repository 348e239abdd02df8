//! One server per database file: a lock that the operating system drops when the process ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};

use super::StoreError;

/// Holds a database file for this process until it is dropped.
#[derive(Debug)]
pub(super) struct FileLock {
    _file: File,
}

impl FileLock {
    /// Takes the lock of a database, or says that another server has it.
    pub(super) fn take(database: &Path) -> Result<Self, StoreError> {
        let path = lock_path(database);
        let file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(|source| StoreError::File {
                path: path.clone(),
                source,
            })?;
        match file.try_lock() {
            Ok(()) => Ok(Self { _file: file }),
            Err(TryLockError::WouldBlock) => Err(StoreError::Locked {
                path: database.to_owned(),
            }),
            Err(TryLockError::Error(source)) => Err(StoreError::File { path, source }),
        }
    }
}

fn lock_path(database: &Path) -> PathBuf {
    let mut name = database.as_os_str().to_owned();
    name.push(".lock");
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_server_is_refused_until_the_first_is_gone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let database = folder.path().join("jobs.db");
        let first = FileLock::take(&database).expect("nobody has it");
        let refused = FileLock::take(&database).expect_err("the first has it");
        assert_eq!(
            refused.to_string(),
            format!(
                "the database {} is in use by another greybox server",
                database.display()
            )
        );
        drop(first);
        FileLock::take(&database).expect("the first is gone");
    }
}
