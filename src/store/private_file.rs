//! Files that their owner alone reads and writes, whatever the umask: a database holds the secrets of webhooks.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

/// Opens a file for writing, and creates the file for its owner alone where there is none.
pub(super) fn open(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.create(true).truncate(false).write(true);
    platform::for_the_owner(&mut options);
    options.open(path)
}

/// Takes a database and the files of its log away from everybody but their owner, and says so in the log of the
/// server. SQLite gives the files that it makes beside a database the rights of the database.
pub(super) fn mend(database: &Path) {
    for path in [
        database.to_owned(),
        beside(database, "-wal"),
        beside(database, "-shm"),
    ] {
        let file = path.display();
        match platform::mend(&path) {
            Ok(false) => {}
            Ok(true) => {
                tracing::warn!(%file, "others could read the file; now its owner alone can")
            }
            Err(error) => tracing::warn!(%file, %error, "others can read the file"),
        }
    }
}

/// The path of a file beside another, whose name it has with an end.
pub(super) fn beside(path: &Path, end: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(end);
    name.into()
}

#[cfg(unix)]
mod platform {
    //! Files have an owner and a mode.

    use std::fs::{OpenOptions, Permissions};
    use std::io;
    use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
    use std::path::Path;

    /// The mode of a file that its owner alone reads and writes.
    const OWNER_ALONE: u32 = 0o600;
    /// The rights of everybody but the owner.
    const OF_OTHERS: u32 = 0o077;

    pub(super) fn for_the_owner(options: &mut OpenOptions) {
        options.mode(OWNER_ALONE);
    }

    /// Says whether the file had to be mended. A file that is not there is sound.
    pub(super) fn mend(path: &Path) -> io::Result<bool> {
        let mode = match std::fs::metadata(path) {
            Ok(metadata) => metadata.permissions().mode(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(error),
        };
        if mode & OF_OTHERS == 0 {
            return Ok(false);
        }
        std::fs::set_permissions(path, Permissions::from_mode(OWNER_ALONE))?;
        Ok(true)
    }
}

#[cfg(not(unix))]
mod platform {
    //! The folder of a file says who reads the file.

    use std::fs::OpenOptions;
    use std::io;
    use std::path::Path;

    pub(super) fn for_the_owner(_options: &mut OpenOptions) {}

    pub(super) fn mend(_path: &Path) -> io::Result<bool> {
        Ok(false)
    }
}
