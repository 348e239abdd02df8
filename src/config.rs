//! Every setting, default and limit of a server, and the only reader of the environment.
//!
//! A setting is a flag or a `GREYBOX_*` variable; the flag wins.

mod database;
mod error;
mod network;
mod oidc;
mod otlp;
pub mod tls;

use std::net::{Ipv4Addr, SocketAddr};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use axum::http::HeaderName;
use clap::Args;

use crate::access::{Role, Roles};
use crate::api::Limits;
use crate::api::access::AccessSettings;
use crate::api::origin::Names;
use crate::delivery::Destinations;
use crate::store::{DatabaseSettings, Quotas, Retention, SecretKeys};
use crate::worker::WorkerSettings;

pub use database::DatabaseArguments;
pub use error::SettingsError;
use network::network;
pub use oidc::OidcArguments;
pub use otlp::OtlpArguments;
use tls::TlsArguments;

/// Connections that read the database at the same time.
const READERS: u32 = 4;
/// How long a statement waits for another connection's lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);
/// How often a node says that it lives [s].
const DEFAULT_NODE_BEAT_S: f64 = 1.0;
/// Hours that stamps may lie ahead of the server's clock.
const DEFAULT_STAMPS_AHEAD_H: u32 = 24;
/// Candidates that are kept of a job: with four unknowns 45 MB.
const DEFAULT_MAX_CANDIDATES: u64 = 1_000_000;
/// Recordings of a project.
const DEFAULT_MAX_DATASETS: u64 = 100_000;
/// The size of all that a project keeps `[MiB]`.
const DEFAULT_MAX_STORED_MIB: u32 = 100 << 10;
/// Unfinished jobs of a project.
const DEFAULT_MAX_UNFINISHED_JOBS: u64 = 100_000;
/// Days that the audit log is kept.
const DEFAULT_KEEP_AUDIT_DAYS: u16 = 400;
/// Entries of the audit log: 30 days of three changes in two seconds, 0.6 GiB at 160 bytes each.
const DEFAULT_KEEP_AUDIT_ENTRIES: u64 = 4_000_000;
/// Days that idempotency keys are kept.
const DEFAULT_KEEP_KEYS_DAYS: u16 = 7;
/// Days that deliveries are kept that are over.
const DEFAULT_KEEP_DELIVERIES_DAYS: u16 = 30;
/// Connections that are open at the same time at the most, where the system allows so many files.
pub const MAX_CONNECTIONS: u64 = 10_000;
/// Files that are kept for what is not a connection: the database, bodies on disk.
pub const FILES_KEPT: u64 = 128;
/// How long an ordered shutdown may take.
pub const SHUTDOWN_LIMIT: Duration = Duration::from_millis(4300);

/// How a server runs.
#[derive(Clone, Debug, Args)]
pub struct Settings {
    /// Address and port to listen on; port 0 takes a free one
    #[arg(long, env = "GREYBOX_LISTEN", default_value_t = default_listen())]
    pub listen: SocketAddr,

    /// Which database
    #[command(flatten)]
    pub database: DatabaseArguments,

    /// A file with the keys under which secrets of webhooks stand in the database, 64 hexadecimal digits on a line:
    /// the first encrypts, every one decrypts [default: they stand as they are]
    #[arg(long, env = "GREYBOX_SECRET_KEYS_FILE", value_name = "FILE")]
    pub secret_keys_file: Option<PathBuf>,

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

    /// How often a server says in a PostgreSQL that it lives `[s]`; when five are missed, other servers
    /// go on with its jobs
    #[arg(
        long,
        env = "GREYBOX_NODE_BEAT_S",
        value_name = "SECONDS",
        default_value_t = DEFAULT_NODE_BEAT_S
    )]
    pub node_beat_s: f64,

    /// Largest recording that is taken `[MiB]`; until it is stored its samples need as much space
    /// beside the database
    #[arg(
        long,
        env = "GREYBOX_MAX_BODY_MIB",
        value_name = "MIB",
        default_value_t = 64
    )]
    pub max_body_mib: u16,

    /// How far the stamps of a stream's samples may lie ahead of the server's clock `[h]`; batches with
    /// later ones are refused
    #[arg(
        long,
        env = "GREYBOX_STAMPS_AHEAD_H",
        value_name = "HOURS",
        default_value_t = DEFAULT_STAMPS_AHEAD_H
    )]
    pub stamps_ahead_h: u32,

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

    /// Requests in a second of each token or person
    #[arg(
        long,
        env = "GREYBOX_REQUESTS_PER_SECOND",
        value_name = "N",
        default_value_t = Limits::default().requests_per_second
    )]
    pub requests_per_second: f64,

    /// Requests, event streams among them, that each token or person has under way at once
    #[arg(
        long,
        env = "GREYBOX_REQUESTS_AT_ONCE",
        value_name = "N",
        default_value_t = Limits::default().requests_at_once
    )]
    pub requests_at_once: u32,

    /// Connections that one address has open at once; a trusted proxy may have all [default: half of
    /// those that may be open]
    #[arg(long, env = "GREYBOX_CONNECTIONS_PER_ADDRESS", value_name = "N")]
    pub connections_per_address: Option<NonZeroUsize>,

    /// Recordings that a project keeps at the most
    #[arg(
        long,
        env = "GREYBOX_MAX_DATASETS",
        value_name = "N",
        default_value_t = DEFAULT_MAX_DATASETS
    )]
    pub max_datasets: u64,

    /// The size of what a project keeps `[MiB]`: the samples of its recordings and streams, its jobs with
    /// their candidates and results, and its idempotency keys
    #[arg(
        long,
        env = "GREYBOX_MAX_STORED_MIB",
        value_name = "MIB",
        default_value_t = DEFAULT_MAX_STORED_MIB
    )]
    pub max_stored_mib: u32,

    /// Jobs of a project that are queued, running or paused at the most
    #[arg(
        long,
        env = "GREYBOX_MAX_UNFINISHED_JOBS",
        value_name = "N",
        default_value_t = DEFAULT_MAX_UNFINISHED_JOBS
    )]
    pub max_unfinished_jobs: u64,

    /// Hours that the jobs of a project may be at work in a day (UTC), all together; then it is
    /// refused new ones until the next day [default: no limit]
    #[arg(long, env = "GREYBOX_WORK_HOURS_PER_DAY", value_name = "HOURS")]
    pub work_hours_per_day: Option<f64>,

    /// Derivatives that the search of a job may be predicted to take, as `validate_only` predicts
    /// them: evaluations times derivatives of one
    #[arg(
        long,
        env = "GREYBOX_MAX_JOB_DERIVATIVES",
        value_name = "N",
        default_value_t = Limits::default().job_derivatives
    )]
    pub max_job_derivatives: f64,

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

    /// The identity provider
    #[command(flatten)]
    pub oidc: OidcArguments,

    /// Where events may be delivered: a name (`mes.plant.example`, `*.plant.example`), an address, a
    /// network, or `*` for everything public. A private address is delivered to only where its network
    /// is named. Repeat it or separate them by commas [default: nowhere]
    #[arg(
        long = "webhook-to",
        env = "GREYBOX_WEBHOOK_TO",
        value_name = "DESTINATION",
        value_delimiter = ','
    )]
    pub webhook_to: Vec<String>,

    /// Days that jobs are kept after their end, with their events, history and result [default: for
    /// ever]
    #[arg(long, env = "GREYBOX_KEEP_JOBS_DAYS", value_name = "DAYS")]
    pub keep_jobs_days: Option<u16>,

    /// Jobs of each project that are kept after their end, the newest [default: all]
    #[arg(long, env = "GREYBOX_KEEP_JOBS", value_name = "N")]
    pub keep_jobs: Option<u32>,

    /// Days that the candidates of jobs are kept after their end [default: as long as the jobs]
    #[arg(long, env = "GREYBOX_KEEP_CANDIDATES_DAYS", value_name = "DAYS")]
    pub keep_candidates_days: Option<u16>,

    /// Days that the audit log is kept
    #[arg(
        long,
        env = "GREYBOX_KEEP_AUDIT_DAYS",
        value_name = "DAYS",
        default_value_t = DEFAULT_KEEP_AUDIT_DAYS,
        value_parser = clap::value_parser!(u16).range(30..)
    )]
    pub keep_audit_days: u16,

    /// Entries of the audit log that are kept, the newest; an entry says how many older ones went, and of when
    #[arg(
        long,
        env = "GREYBOX_KEEP_AUDIT_ENTRIES",
        value_name = "N",
        default_value_t = DEFAULT_KEEP_AUDIT_ENTRIES,
        value_parser = clap::value_parser!(u64).range(1000..)
    )]
    pub keep_audit_entries: u64,

    /// Days that idempotency keys are kept, at the least until the job that a key made has ended: for so long
    /// the same key makes nothing a second time
    #[arg(
        long,
        env = "GREYBOX_KEEP_KEYS_DAYS",
        value_name = "DAYS",
        default_value_t = DEFAULT_KEEP_KEYS_DAYS,
        value_parser = clap::value_parser!(u16).range(1..)
    )]
    pub keep_keys_days: u16,

    /// Days that deliveries are kept that are over
    #[arg(
        long,
        env = "GREYBOX_KEEP_DELIVERIES_DAYS",
        value_name = "DAYS",
        default_value_t = DEFAULT_KEEP_DELIVERIES_DAYS
    )]
    pub keep_deliveries_days: u16,

    /// The files of its TLS
    #[command(flatten)]
    pub tls: TlsArguments,

    /// What is logged, e.g. `info` or `greybox=debug`
    #[arg(
        long,
        env = "GREYBOX_LOG",
        value_name = "FILTER",
        default_value = "info"
    )]
    pub log: String,

    /// Where spans are sent.
    #[command(flatten)]
    pub otlp: OtlpArguments,
}

fn default_listen() -> SocketAddr {
    (Ipv4Addr::LOCALHOST, 8080).into()
}

impl Default for Settings {
    /// The settings of a server that is given none, whatever the environment says.
    fn default() -> Self {
        Self {
            listen: default_listen(),
            database: DatabaseArguments::default(),
            secret_keys_file: None,
            threads: None,
            jobs_at_once: None,
            slice_s: 10.0,
            node_beat_s: DEFAULT_NODE_BEAT_S,
            max_body_mib: 64,
            stamps_ahead_h: DEFAULT_STAMPS_AHEAD_H,
            max_candidates: DEFAULT_MAX_CANDIDATES,
            names: Vec::new(),
            requests_per_second: Limits::default().requests_per_second,
            requests_at_once: Limits::default().requests_at_once,
            connections_per_address: None,
            max_datasets: DEFAULT_MAX_DATASETS,
            max_stored_mib: DEFAULT_MAX_STORED_MIB,
            max_unfinished_jobs: DEFAULT_MAX_UNFINISHED_JOBS,
            work_hours_per_day: None,
            max_job_derivatives: Limits::default().job_derivatives,
            trusted_proxies: Vec::new(),
            proxy_user_header: AccessSettings::default().user_header,
            proxy_groups_header: AccessSettings::default().groups_header,
            roles: Vec::new(),
            oidc: OidcArguments::default(),
            webhook_to: Vec::new(),
            keep_jobs_days: None,
            keep_jobs: None,
            keep_candidates_days: None,
            keep_audit_days: DEFAULT_KEEP_AUDIT_DAYS,
            keep_audit_entries: DEFAULT_KEEP_AUDIT_ENTRIES,
            keep_keys_days: DEFAULT_KEEP_KEYS_DAYS,
            keep_deliveries_days: DEFAULT_KEEP_DELIVERIES_DAYS,
            tls: TlsArguments::default(),
            log: "info".to_owned(),
            otlp: OtlpArguments::default(),
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
        if !(0.02..=60.0).contains(&self.node_beat_s) {
            return Err(SettingsError::NodeBeat(self.node_beat_s));
        }
        Ok(DatabaseSettings {
            place: self.database.place()?,
            readers: READERS,
            busy_timeout: BUSY_TIMEOUT,
            beat: Duration::from_secs_f64(self.node_beat_s),
            keys: match &self.secret_keys_file {
                Some(file) => SecretKeys::of_file(file)?,
                None => SecretKeys::default(),
            },
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
        let public = self.oidc.public_name();
        let names = self.names.iter().map(|name| name.trim());
        Names::new(names.chain(public.as_deref()))
    }

    /// What a project may have.
    pub fn quotas(&self) -> Result<Quotas, SettingsError> {
        let work_per_day = self.work_hours_per_day.map(|hours| {
            let day = Duration::try_from_secs_f64(hours * 3600.0);
            day.map_err(|_| SettingsError::WorkHours(hours))
        });
        Ok(Quotas {
            datasets: self.max_datasets,
            stored_bytes: u64::from(self.max_stored_mib) << 20,
            unfinished_jobs: self.max_unfinished_jobs,
            work_per_day: work_per_day.transpose()?,
        })
    }

    /// For how long things are kept.
    pub fn retention(&self) -> Retention {
        let days = |days: u16| Duration::from_hours(24 * u64::from(days));
        Retention {
            jobs: self.keep_jobs_days.map(days),
            most_jobs: self.keep_jobs,
            candidates: self.keep_candidates_days.map(days),
            audit: Some(days(self.keep_audit_days)),
            most_audit: Some(self.keep_audit_entries),
            keys: Some(days(self.keep_keys_days)),
            deliveries: Some(days(self.keep_deliveries_days)),
        }
    }

    /// Where events may be delivered.
    pub fn destinations(&self) -> Result<Destinations, SettingsError> {
        let texts = self.webhook_to.iter().map(String::as_str);
        Destinations::new(texts).map_err(SettingsError::Destination)
    }

    /// Who may ask.
    pub fn access(&self) -> Result<AccessSettings, SettingsError> {
        let proxies = self.trusted_proxies.iter().map(|text| network(text.trim()));
        Ok(AccessSettings {
            proxies: proxies.collect::<Result<_, _>>()?,
            user_header: self.proxy_user_header.clone(),
            groups_header: self.proxy_groups_header.clone(),
            roles: Roles::new(self.roles.clone()),
            speaks_tls: self.tls.tls_cert.is_some(),
        })
    }

    /// What one client may ask for.
    pub fn limits(&self) -> Limits {
        Limits {
            dataset_bytes: u64::from(self.max_body_mib) << 20,
            stamps_ahead: Duration::from_hours(u64::from(self.stamps_ahead_h)),
            requests_per_second: self.requests_per_second.max(0.001),
            requests_at_once: self.requests_at_once,
            job_derivatives: self.max_job_derivatives,
            threads: self.threads(),
            ..Limits::default()
        }
    }
}

#[cfg(test)]
mod tests;
