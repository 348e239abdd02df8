//! The limits of the operating system: how many files may be open, and how large a file may grow.

use std::io;
use std::num::NonZeroUsize;
use std::path::Path;

use crate::config::{FILES_KEPT, MAX_CONNECTIONS};

/// Files that a server needs at the least: one of them is a connection.
const FEWEST_FILES: u64 = FILES_KEPT + 1;

/// The system allows the process fewer files than a server needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the system allows {allowed} open files, and a server needs {FEWEST_FILES}: raise the limit (`ulimit -n`, or \
     `LimitNOFILE` of a service)"
)]
pub struct TooFewFiles {
    /// Files that may be open.
    pub allowed: u64,
}

/// How many connections may be open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ConnectionLimits {
    /// Connections that are open at the same time.
    pub(super) at_once: usize,
    /// How many of them one address may have.
    pub(super) of_an_address: usize,
}

impl ConnectionLimits {
    /// Asks the system for as many files as it allows, and leaves a connection for each that the server does not need.
    pub(super) fn of_the_system(of_an_address: Option<NonZeroUsize>) -> Result<Self, TooFewFiles> {
        let files = rlimit::increase_nofile_limit(MAX_CONNECTIONS + FILES_KEPT);
        let files = files.unwrap_or_else(|error| {
            tracing::warn!(%error, "it is not known how many files may be open");
            MAX_CONNECTIONS
        });
        Self::with_files(files, of_an_address)
    }

    /// The connections of a server that may open so many files. An address has half of them where nothing else is
    /// said, and one at the least.
    fn with_files(files: u64, of_an_address: Option<NonZeroUsize>) -> Result<Self, TooFewFiles> {
        if files < FEWEST_FILES {
            return Err(TooFewFiles { allowed: files });
        }
        let at_once = (files - FILES_KEPT).min(MAX_CONNECTIONS);
        let at_once = usize::try_from(at_once).unwrap_or(usize::MAX);
        let of_an_address = of_an_address.map_or((at_once / 2).max(1), NonZeroUsize::get);
        Ok(Self {
            at_once,
            of_an_address,
        })
    }
}

/// Has a write beyond the largest size of a file (`RLIMIT_FSIZE`) fail as on a full disk. The system ends a process
/// that does not handle the signal of such a write.
#[cfg(unix)]
pub(super) fn outlive_the_largest_file() {
    use tokio::signal::unix::{SignalKind, signal};
    /// SIGXFSZ, on Linux and on the BSDs.
    const FILE_TOO_LARGE: i32 = 25;
    // The handler stays for as long as the process lives.
    if let Err(error) = signal(SignalKind::from_raw(FILE_TOO_LARGE)) {
        tracing::warn!(%error, "a file that reaches the largest size of files ends the server");
    }
}

/// Other systems have no such limit.
#[cfg(not(unix))]
pub(super) fn outlive_the_largest_file() {}

/// The bytes of a file at the most; nothing where there is no limit.
pub(super) fn largest_file() -> Option<u64> {
    limit_of(rlimit::Resource::FSIZE)
}

/// A limit of the process.
pub(super) fn limit_of(resource: rlimit::Resource) -> Option<u64> {
    let (soft, _hard) = resource.get().ok()?;
    (soft != rlimit::INFINITY).then_some(soft)
}

/// The bytes that are free in a folder for whoever runs the program.
#[cfg(unix)]
pub(super) fn free_space(folder: &Path) -> io::Result<u64> {
    let space = rustix::fs::statvfs(folder)?;
    Ok(space.f_bavail.saturating_mul(space.f_frsize))
}

/// Other systems are not asked.
#[cfg(not(unix))]
pub(super) fn free_space(_folder: &Path) -> io::Result<u64> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Whether others than the owner and the group of a file can read the file.
#[cfg(unix)]
pub(super) fn is_open_to_others(file: &Path) -> io::Result<bool> {
    use std::os::unix::fs::PermissionsExt as _;
    Ok(std::fs::metadata(file)?.permissions().mode() & 0o004 != 0)
}

/// Other systems have no such rights.
#[cfg(not(unix))]
pub(super) fn is_open_to_others(file: &Path) -> io::Result<bool> {
    std::fs::metadata(file).map(|_file| false)
}

/// Returns when the process is asked to end.
#[cfg(unix)]
pub(super) async fn terminated() -> std::io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut terminate = signal(SignalKind::terminate())?;
    tokio::select! {
        _ = terminate.recv() => Ok(()),
        interrupted = tokio::signal::ctrl_c() => interrupted,
    }
}

/// Returns when the process is asked to end.
#[cfg(not(unix))]
pub(super) async fn terminated() -> std::io::Result<()> {
    tokio::signal::ctrl_c().await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_a_connection_however_few_there_are() {
        let limits = |files| ConnectionLimits::with_files(files, None);
        for (files, at_once, of_an_address) in [
            (FILES_KEPT + 1, 1, 1),
            (FILES_KEPT + 10, 10, 5),
            (u64::MAX, 10_000, 5000),
        ] {
            let limits = limits(files).expect("enough files");
            assert_eq!(limits.at_once, at_once, "{files}");
            assert_eq!(limits.of_an_address, of_an_address, "{files}");
        }
        let refused = limits(FILES_KEPT).expect_err("too few files").to_string();
        assert!(
            refused.contains("allows 128 open files, and a server needs 129"),
            "{refused}"
        );
    }
}
