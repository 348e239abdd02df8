//! One server per database file: a lock that the operating system drops when the process ends.
//!
//! Where a file has a number of its own the lock is on the database itself, so that no other name
//! of it and no removed lock file lets a second server in. Closing a file drops what the process
//! has locked of it, SQLite's own locks included; so a database that this process serves already is
//! never opened again to try.

use std::fs::{File, TryLockError};
use std::path::Path;

use super::{StoreError, private_file};

/// Holds a database file for this process until it is dropped.
#[derive(Debug)]
pub(super) struct FileLock {
    _file: File,
    _served: platform::Served,
}

impl FileLock {
    /// Takes the lock of a database, or says that another server has it. Creates the file,
    /// for its owner alone.
    pub(super) fn take(database: &Path) -> Result<Self, StoreError> {
        let path = platform::locked_file(database);
        let cannot = |source| StoreError::File {
            path: path.clone(),
            source,
        };
        let taken = || StoreError::Locked {
            database: database.display().to_string(),
        };
        if platform::is_served(&path) {
            return Err(taken());
        }
        let file = private_file::open(&path).map_err(cannot)?;
        match file.try_lock() {
            Ok(()) => Ok(Self {
                _served: platform::Served::note(&file).map_err(cannot)?,
                _file: file,
            }),
            Err(TryLockError::WouldBlock) => Err(taken()),
            Err(TryLockError::Error(source)) => Err(cannot(source)),
        }
    }
}

#[cfg(unix)]
mod platform {
    //! Files have numbers.

    use std::collections::HashSet;
    use std::fs::{File, Metadata};
    use std::os::unix::fs::MetadataExt;
    use std::path::{Path, PathBuf};
    use std::sync::{LazyLock, Mutex, PoisonError};

    /// A file, whatever its names: its device and its number there.
    type Number = (u64, u64);

    /// The databases that this process serves.
    static SERVED: LazyLock<Mutex<HashSet<Number>>> = LazyLock::new(Mutex::default);

    fn number(metadata: &Metadata) -> Number {
        (metadata.dev(), metadata.ino())
    }

    pub(super) fn locked_file(database: &Path) -> PathBuf {
        database.to_owned()
    }

    /// Whether this process serves the file already.
    pub(super) fn is_served(path: &Path) -> bool {
        let metadata = std::fs::metadata(path);
        let served = SERVED.lock().unwrap_or_else(PoisonError::into_inner);
        metadata.is_ok_and(|metadata| served.contains(&number(&metadata)))
    }

    /// A file that is served, until it is dropped.
    #[derive(Debug)]
    pub(super) struct Served(Number);

    impl Served {
        pub(super) fn note(file: &File) -> std::io::Result<Self> {
            let number = number(&file.metadata()?);
            let mut served = SERVED.lock().unwrap_or_else(PoisonError::into_inner);
            served.insert(number);
            Ok(Self(number))
        }
    }

    impl Drop for Served {
        fn drop(&mut self) {
            let mut served = SERVED.lock().unwrap_or_else(PoisonError::into_inner);
            served.remove(&self.0);
        }
    }
}

#[cfg(not(unix))]
mod platform {
    //! A locked file cannot be read here, so the lock is on a file beside the database.

    use std::fs::File;
    use std::path::{Path, PathBuf};

    pub(super) fn locked_file(database: &Path) -> PathBuf {
        let mut name = database.as_os_str().to_owned();
        name.push(".lock");
        PathBuf::from(name)
    }

    pub(super) fn is_served(_path: &Path) -> bool {
        false
    }

    #[derive(Debug)]
    pub(super) struct Served;

    impl Served {
        pub(super) fn note(_file: &File) -> std::io::Result<Self> {
            Ok(Self)
        }
    }
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

    #[cfg(unix)]
    #[test]
    fn another_name_of_the_database_is_the_same_database() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let database = folder.path().join("jobs.db");
        let _first = FileLock::take(&database).expect("nobody has it");
        let link = folder.path().join("link.db");
        std::fs::hard_link(&database, &link).expect("a second name");
        for entry in std::fs::read_dir(folder.path()).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path
                .extension()
                .is_some_and(|extension| extension == "lock")
            {
                std::fs::remove_file(path).expect("a lock file that anybody may remove");
            }
        }
        for name in [&database, &link] {
            let refused = FileLock::take(name).expect_err("the first has it");
            assert!(matches!(refused, StoreError::Locked { .. }), "{refused}");
        }
    }
}
