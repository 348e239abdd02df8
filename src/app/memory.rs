//! The memory that the system allows the process, and a server that keeps within it.

use std::path::Path;

use super::system::limit_of;
use crate::api::Limits;
use crate::config::Settings;

/// The memory that a server needs at the least `[bytes]`: half of it takes a recording of 16 MiB.
const LEAST_MEMORY: u64 = 256 << 20;

/// Control groups of version 1 without a limit say a number that is larger `[bytes]`.
const NO_LIMIT: u64 = 1 << 50;

/// The system allows the process less memory than a server needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the system allows {} MiB of memory, and a server needs {}: raise the limit (`ulimit -v`, `MemoryMax` of a service, \
     the memory of a container)",
    .allowed >> 20,
    LEAST_MEMORY >> 20
)]
pub struct TooLittleMemory {
    /// The memory that the process may have `[bytes]`.
    pub allowed: u64,
}

/// The bytes of memory that the process may have at the most, by the limit of its address space or of a control group;
/// nothing where there is no limit.
pub(super) fn memory_limit() -> Result<Option<u64>, TooLittleMemory> {
    let limits = address_space().into_iter().chain(control_group());
    match limits.min() {
        Some(allowed) if allowed < LEAST_MEMORY => Err(TooLittleMemory { allowed }),
        limit => Ok(limit),
    }
}

/// What one client may ask for, where the memory has room for it.
pub(super) fn limits_within_memory(settings: &Settings) -> Result<Limits, TooLittleMemory> {
    let limits = settings.limits();
    let Some(bytes) = memory_limit()? else {
        return Ok(limits);
    };
    let within = limits.clone().within_memory(bytes);
    if within.recordings_at_once < limits.recordings_at_once {
        tracing::warn!(
            memory_mib = bytes >> 20,
            largest_recording_mib = within.dataset_bytes >> 20,
            recordings_at_once = within.recordings_at_once,
            "little memory: fewer recordings come in at once"
        );
    }
    Ok(within)
}

fn address_space() -> Option<u64> {
    limit_of(rlimit::Resource::AS)
}

/// The least limit of the control groups that the process is in.
fn control_group() -> Option<u64> {
    let groups = std::fs::read_to_string("/proc/self/cgroup").ok()?;
    let limits = groups.lines().filter_map(limit_of_group);
    limits.min().filter(|limit| *limit < NO_LIMIT)
}

/// The least limit of a control group and of those around it, by its line `number:controllers:path`.
fn limit_of_group(line: &str) -> Option<u64> {
    let (_number, group) = line.split_once(':')?;
    let (controllers, path) = group.split_once(':')?;
    let (root, file) = match controllers {
        // Version 2 has one hierarchy for all controllers.
        "" => (Path::new("/sys/fs/cgroup"), "memory.max"),
        "memory" => (Path::new("/sys/fs/cgroup/memory"), "memory.limit_in_bytes"),
        _ => return None,
    };
    let group = root.join(path.trim_start_matches('/'));
    let groups = group
        .ancestors()
        .take_while(|group| group.starts_with(root));
    let limits = groups.filter_map(|group| std::fs::read_to_string(group.join(file)).ok());
    limits.filter_map(|limit| limit.trim().parse().ok()).min()
}

/// Has the threads of a process whose address space is limited share few arenas of memory. The allocator of glibc
/// reserves 64 MiB of addresses for each arena, and eight arenas for each processor leave a recording no room. To be
/// called before there are threads.
pub fn spare_address_space() {
    if address_space().is_some() {
        share_arenas();
    }
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn share_arenas() {
    /// The one that a process begins with, and one for its threads.
    const ARENAS: i32 = 2;
    #[expect(unsafe_code, reason = "a setting of the allocator of the C library")]
    // SAFETY: `mallopt` takes numbers alone, and may be called at any time.
    let is_set = unsafe { libc::mallopt(libc::M_ARENA_MAX, ARENAS) };
    if is_set == 0 {
        tracing::warn!("threads reserve more of the limited address space than they need");
    }
}

/// Other allocators reserve no arenas.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn share_arenas() {}
