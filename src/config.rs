//! Every setting, default and limit of a server, and the only reader of the environment.
//!
//! A setting is a flag or a `GREYBOX_*` variable; the flag wins.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use axum::http::HeaderName;
use clap::Args;
use directories::ProjectDirs;
use ipnet::IpNet;

use crate::access::{Role, Roles};
use crate::api::Limits;
use crate::api::access::AccessSettings;
use crate::api::origin::Names;
use crate::store::DatabaseSettings;
use crate::worker::WorkerSettings;

/// The database file's name in the user's data folder.
const DATABASE_FILE: &str = "greybox.db";
/// Connections that read the database at the same time.
const READERS: u32 = 4;
/// How long a statement waits for another connection's lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);
/// Candidates that are kept of a job: with four unknowns 45 MB.
const DEFAULT_MAX_CANDIDATES: u64 = 1_000_000;
/// Connections that are open at the same time at the most, where the system allows so many files.
pub const MAX_CONNECTIONS: u64 = 10_000;
/// Files that are kept for what is not a connection: the database, bodies on disk.
pub const FILES_KEPT: u64 = 128;
/// How long an ordered shutdown may take.
pub const SHUTDOWN_LIMIT: Duration = Duration::from_millis(4300);

/// Which database, for a command that runs no server.
#[derive(Clone, Debug, Args)]
pub struct DatabaseArguments {
    /// Database file, `sqlite://<path>` [default: greybox.db in the user's data folder]
    #[arg(long, env = "GREYBOX_DATABASE", value_name = "URL")]
    database: Option<String>,
}

impl DatabaseArguments {
    /// The file.
    pub fn path(&self) -> Result<PathBuf, SettingsError> {
        database_path(self.database.as_deref())
    }
}

/// How a server runs.
#[derive(Clone, Debug, Args)]
pub struct Settings {
    /// Address and port to listen on; port 0 takes a free one
    #[arg(long, env = "GREYBOX_LISTEN", default_value_t = default_listen())]
    pub listen: SocketAddr,

    /// Database file, `sqlite://<path>` [default: greybox.db in the user's data folder]
    #[arg(long, env = "GREYBOX_DATABASE", value_name = "URL")]
    pub database: Option<String>,

    /// Threads that compute [default: one for each processor]
    #[arg(long, env = "GREYBOX_THREADS")]
    pub threads: Option<NonZeroUsize>,

    /// Jobs at work at the same time; they share the threads [default: as many as threads]
    #[arg(long, env = "GREYBOX_JOBS_AT_ONCE", value_name = "N")]
    pub jobs_at_once: Option<NonZeroUsize>,

    /// How long a job works before it makes a checkpoint and others have their turn `[s]`
    #[arg(
        long,
        env = "GREYBOX_SLICE_S",
        value_name = "SECONDS",
        default_value_t = 10.0
    )]
    pub slice_s: f64,

    /// Largest recording that is taken `[MiB]`; until it is stored its samples need as much space
    /// beside the database
    #[arg(
        long,
        env = "GREYBOX_MAX_BODY_MIB",
        value_name = "MIB",
        default_value_t = 64
    )]
    pub max_body_mib: u16,

    /// Candidates that are kept of a job for `/candidates`; each takes 13 bytes of the database
    /// and 8 for each unknown, 0 keeps none
    #[arg(
        long,
        env = "GREYBOX_MAX_CANDIDATES",
        value_name = "N",
        default_value_t = DEFAULT_MAX_CANDIDATES
    )]
    pub max_candidates: u64,

    /// A name by which the server is asked, beside its addresses and `localhost`; repeat it or
    /// separate them by commas
    #[arg(
        long = "name",
        env = "GREYBOX_NAMES",
        value_name = "NAME",
        value_delimiter = ','
    )]
    pub names: Vec<String>,

    /// The address of a proxy that says who a person is, or a network of such (`10.0.0.0/8`); repeat
    /// it or separate them by commas. It must take the two headers below from nobody else
    #[arg(
        long = "trusted-proxy",
        env = "GREYBOX_TRUSTED_PROXIES",
        value_name = "ADDRESS",
        value_delimiter = ','
    )]
    pub trusted_proxies: Vec<String>,

    /// The header in which the proxy names the person
    #[arg(
        long,
        env = "GREYBOX_PROXY_USER_HEADER",
        value_name = "HEADER",
        default_value = "x-forwarded-user"
    )]
    pub proxy_user_header: HeaderName,

    /// The header in which the proxy lists the person's groups, separated by commas
    #[arg(
        long,
        env = "GREYBOX_PROXY_GROUPS_HEADER",
        value_name = "HEADER",
        default_value = "x-forwarded-groups"
    )]
    pub proxy_groups_header: HeaderName,

    /// What the members of a group may do, `group=read`, `group=submit` or `group=admin`, in the
    /// project `default` or in another one: `group=read:hall-2`. Repeat it or separate them by commas;
    /// of somebody's groups the first in this order counts
    #[arg(
        long = "role",
        env = "GREYBOX_ROLES",
        value_name = "GROUP=SCOPE",
        value_delimiter = ','
    )]
    pub roles: Vec<Role>,

    /// What is logged, e.g. `info` or `greybox=debug`
    #[arg(
        long,
        env = "GREYBOX_LOG",
        value_name = "FILTER",
        default_value = "info"
    )]
    pub log: String,
}

/// A setting that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// The database is not given as a SQLite file.
    #[error("the database `{0}` is not of the form sqlite://<path to a file>")]
    Database(String),
    /// There is no place for the default database.
    #[error("the user has no data folder; say where the database is with --database")]
    NoDataFolder,
    /// A network is not given as an address or a range of them.
    #[error("`{0}` is neither an address nor a network of the form 10.0.0.0/8")]
    Network(String),
    /// The length of a slice is not a time.
    #[error("a slice of {0} s is not between 0 and 3600 s")]
    Slice(f64),
}

fn default_listen() -> SocketAddr {
    (Ipv4Addr::LOCALHOST, 8080).into()
}

impl Default for Settings {
    /// The settings of a server that is given none, whatever the environment says.
    fn default() -> Self {
        Self {
            listen: default_listen(),
            database: None,
            threads: None,
            jobs_at_once: None,
            slice_s: 10.0,
            max_body_mib: 64,
            max_candidates: DEFAULT_MAX_CANDIDATES,
            names: Vec::new(),
            trusted_proxies: Vec::new(),
            proxy_user_header: AccessSettings::default().user_header,
            proxy_groups_header: AccessSettings::default().groups_header,
            roles: Vec::new(),
            log: "info".to_owned(),
        }
    }
}

impl Settings {
    /// Threads that compute.
    pub fn threads(&self) -> usize {
        self.threads
            .or_else(|| std::thread::available_parallelism().ok())
            .map_or(1, NonZeroUsize::get)
    }

    /// Where the database is and how it is used.
    pub fn database(&self) -> Result<DatabaseSettings, SettingsError> {
        Ok(DatabaseSettings {
            path: database_path(self.database.as_deref())?,
            readers: READERS,
            busy_timeout: BUSY_TIMEOUT,
        })
    }

    /// How jobs are worked.
    pub fn worker(&self) -> Result<WorkerSettings, SettingsError> {
        if !(0.0..=3600.0).contains(&self.slice_s) {
            return Err(SettingsError::Slice(self.slice_s));
        }
        Ok(WorkerSettings {
            jobs_at_once: self.jobs_at_once.map_or(self.threads(), NonZeroUsize::get),
            slice_length: Duration::from_secs_f64(self.slice_s),
            max_candidates: self.max_candidates,
        })
    }

    /// The names by which the server may be asked.
    pub fn names(&self) -> Names {
        Names::new(self.names.iter().map(|name| name.trim()))
    }

    /// Who may ask.
    pub fn access(&self) -> Result<AccessSettings, SettingsError> {
        let proxies = self.trusted_proxies.iter().map(|text| network(text.trim()));
        Ok(AccessSettings {
            proxies: proxies.collect::<Result<_, _>>()?,
            user_header: self.proxy_user_header.clone(),
            groups_header: self.proxy_groups_header.clone(),
            roles: Roles::new(self.roles.clone()),
        })
    }

    /// What one client may ask for.
    pub fn limits(&self) -> Limits {
        Limits {
            dataset_bytes: u64::from(self.max_body_mib) << 20,
            ..Limits::default()
        }
    }
}

/// A network, or the one address of a text.
fn network(text: &str) -> Result<IpNet, SettingsError> {
    let one = text.parse::<IpAddr>().map(IpNet::from);
    one.or_else(|_| text.parse())
        .map_err(|_| SettingsError::Network(text.to_owned()))
}

fn database_path(url: Option<&str>) -> Result<PathBuf, SettingsError> {
    url.map_or_else(default_database, path_of)
}

/// The file that a `sqlite://` address names. A database in memory would lose jobs.
fn path_of(url: &str) -> Result<PathBuf, SettingsError> {
    let path = url.strip_prefix("sqlite://").unwrap_or_default();
    let is_file = !path.is_empty() && !path.starts_with(':') && !path.contains('?');
    if is_file && !path.ends_with('/') {
        Ok(PathBuf::from(path))
    } else {
        Err(SettingsError::Database(url.to_owned()))
    }
}

fn default_database() -> Result<PathBuf, SettingsError> {
    ProjectDirs::from("", "", "greybox")
        .map(|folders| folders.data_dir().join(DATABASE_FILE))
        .ok_or(SettingsError::NoDataFolder)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        settings: Settings,
    }

    fn parse(flags: &[&str]) -> Settings {
        let command = std::iter::once("greybox").chain(flags.iter().copied());
        Command::try_parse_from(command).expect("flags").settings
    }

    #[test]
    fn flags_say_how_the_server_runs() {
        let settings = parse(&[
            "--listen=127.0.0.1:0",
            "--database=sqlite:///var/lib/greybox/jobs.db",
            "--threads=3",
            "--slice-s=0.005",
            "--max-body-mib=1",
            "--max-candidates=7",
        ]);
        let database = settings.database().expect("a path");
        assert_eq!(database.path, PathBuf::from("/var/lib/greybox/jobs.db"));
        let worker = settings.worker().expect("a slice");
        assert_eq!(worker.slice_length, Duration::from_millis(5));
        assert_eq!(worker.jobs_at_once, 3);
        assert_eq!(worker.max_candidates, 7);
        assert_eq!(settings.limits().dataset_bytes, 1 << 20);
    }

    #[test]
    fn the_defaults_of_the_flags_are_those_of_the_program() {
        let (flags, program) = (parse(&[]), Settings::default());
        assert_eq!(format!("{flags:?}"), format!("{program:?}"));
        assert_eq!(program.listen.to_string(), "127.0.0.1:8080");
    }

    #[test]
    fn what_is_no_database_file_is_refused() {
        for url in [
            "postgres://localhost/greybox",
            "sqlite::memory:",
            "sqlite://:memory:",
            "sqlite://",
            "sqlite:///var/lib/",
            "jobs.db",
        ] {
            let settings = parse(&[&format!("--database={url}")]);
            let refused = settings.database().err();
            assert_eq!(refused, Some(SettingsError::Database(url.to_owned())));
        }
    }

    #[test]
    fn proxies_and_roles_are_read() {
        let settings = parse(&[
            "--trusted-proxy=10.0.0.7,fd00::/8",
            "--role=plant it=admin",
            "--role=operators=read:hall-2",
            "--proxy-user-header=Remote-User",
        ]);
        let access = settings.access().expect("settings");
        assert_eq!(access.proxies.len(), 2);
        assert!(access.proxies[0].contains(&IpAddr::from([10, 0, 0, 7])));
        assert_eq!(access.user_header, "remote-user");
        assert!(access.roles.of("operators").is_some());
        let settings = parse(&["--trusted-proxy=gateway"]);
        let refused = settings.access().expect_err("a name is no address");
        assert_eq!(refused, SettingsError::Network("gateway".to_owned()));
    }

    #[test]
    fn a_slice_that_is_no_time_is_refused() {
        for slice_s in [-1.0, f64::NAN, 1e9] {
            let settings = Settings {
                slice_s,
                ..Settings::default()
            };
            assert!(matches!(settings.worker(), Err(SettingsError::Slice(_))));
        }
    }
}
