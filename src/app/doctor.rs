//! What a server would meet where it is started with some settings: limits of the system, clock, settings,
//! database, keys, certificates, the identity provider. Nothing is changed, and no secret is said.

use std::fmt::Display;
use std::io;
use std::net::TcpListener;
use std::path::Path;

use jiff::Timestamp;
use serde::Serialize;

use super::memory::memory_limit;
use super::system::{self, ConnectionLimits};
use super::tls::Tls;
use crate::access::Secret;
use crate::config::Settings;
use crate::identity::{Provider, SignInAttempt};
use crate::store::{DatabaseFacts, DatabasePlace, schema_version};

/// Connections at once below which a server soon has too few.
const FEW_CONNECTIONS: usize = 500;
/// The memory of a process below which recordings take turns that otherwise come in together `[MiB]`.
const LITTLE_MEMORY_MIB: u64 = 2048;
/// The space on the disk below which a server soon has none `[MiB]`.
const LITTLE_SPACE_MIB: u64 = 2048;
/// How far two clocks may be apart before stamps and sessions go wrong `[s]`.
const CLOCKS_APART_S: f64 = 5.0;
/// The year in which this program was written: no clock is before it.
const FIRST_YEAR: i16 = 2026;
/// The days for which a certificate should be valid still.
const VALID_FOR_DAYS: u64 = 14;

/// The condition of a matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MatterCondition {
    /// As it should be.
    Good,
    /// A server starts, and somebody should look at this.
    Doubtful,
    /// A server does not start, or does not do what the settings ask.
    Bad,
}

/// One matter that a server would meet, and its condition.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DoctorFinding {
    /// The matter, a word.
    pub about: &'static str,
    /// The condition of the matter.
    pub condition: MatterCondition,
    /// The reason for the condition, a sentence.
    pub says: String,
}

/// The findings, in the order in which a server would meet what they are about.
#[derive(Default)]
struct Findings(Vec<DoctorFinding>);

impl Findings {
    fn add(&mut self, about: &'static str, condition: MatterCondition, says: impl Display) {
        let says = says.to_string();
        self.0.push(DoctorFinding {
            about,
            condition,
            says,
        });
    }

    fn good(&mut self, about: &'static str, says: impl Display) {
        self.add(about, MatterCondition::Good, says);
    }

    fn doubtful(&mut self, about: &'static str, says: impl Display) {
        self.add(about, MatterCondition::Doubtful, says);
    }

    fn bad(&mut self, about: &'static str, says: impl Display) {
        self.add(about, MatterCondition::Bad, says);
    }
}

/// Looks at all that a server with these settings would meet.
pub async fn examine(settings: &Settings) -> Vec<DoctorFinding> {
    let mut findings = Findings::default();
    let version = env!("CARGO_PKG_VERSION");
    let (os, arch) = (std::env::consts::OS, std::env::consts::ARCH);
    let schema = schema_version();
    findings.good(
        "program",
        format!("greybox {version}, schema {schema}, {os} on {arch}"),
    );
    system(settings, &mut findings);
    clock(&mut findings);
    limits(settings, &mut findings);
    let database = database(settings, &mut findings).await;
    secret_keys(settings, &mut findings);
    tls(settings, &mut findings);
    provider(settings, &mut findings).await;
    callers(settings, database.as_ref(), &mut findings);
    address(settings, database.as_ref(), &mut findings);
    findings.0
}

fn system(settings: &Settings, findings: &mut Findings) {
    let threads = settings.threads();
    findings.good("processors", format!("{threads} threads compute"));
    match ConnectionLimits::of_the_system(settings.connections_per_address) {
        Err(error) => findings.bad("files", error),
        Ok(limits) => {
            let says = format!("{} connections may be open at once", limits.at_once);
            match limits.at_once < FEW_CONNECTIONS {
                true => findings.doubtful("files", format!("{says}; raise `ulimit -n`")),
                false => findings.good("files", says),
            }
        }
    }
    match memory_limit() {
        Err(error) => findings.bad("memory", error),
        Ok(None) => findings.good("memory", "the process may have all of the machine's"),
        Ok(Some(bytes)) => {
            let limits = settings.limits().within_memory(bytes);
            let says = format!(
                "the process may have {} MiB: recordings of up to {} MiB, {} of them at once",
                bytes >> 20,
                limits.dataset_bytes >> 20,
                limits.recordings_at_once
            );
            match bytes >> 20 < LITTLE_MEMORY_MIB {
                true => findings.doubtful("memory", says),
                false => findings.good("memory", says),
            }
        }
    }
    if let Some(bytes) = system::largest_file() {
        let says = format!(
            "a file may have {} MiB at the most (`ulimit -f`)",
            bytes >> 20
        );
        findings.doubtful("files", says);
    }
}

fn clock(findings: &mut Findings) {
    let now = Timestamp::now();
    let year = now.to_zoned(jiff::tz::TimeZone::UTC).year();
    let shown = now.strftime("%Y-%m-%d %H:%M:%S UTC");
    match year < FIRST_YEAR {
        true => findings.bad("clock", format!("it shows {shown}, which has passed")),
        false => findings.good("clock", format!("it shows {shown}")),
    }
}

/// The settings that are read before anything is opened.
fn limits(settings: &Settings, findings: &mut Findings) {
    let refused = [
        settings.worker().err(),
        settings.access().err(),
        settings.quotas().err(),
        settings.destinations().err(),
    ];
    let mut are_read = true;
    for error in refused.into_iter().flatten() {
        findings.bad("settings", error);
        are_read = false;
    }
    if are_read {
        findings.good("settings", "they can be read");
    }
}

async fn database(settings: &Settings, findings: &mut Findings) -> Option<DatabaseFacts> {
    let place = match settings.database.place() {
        Ok(place) => place,
        Err(error) => {
            findings.bad("database", error);
            return None;
        }
    };
    if let DatabasePlace::File(path) = &place {
        folder(path, findings);
    }
    let facts = match DatabaseFacts::of(&place).await {
        Ok(facts) => facts,
        Err(error) => {
            findings.bad("database", format!("{place}: {error}"));
            return None;
        }
    };
    let of_program = schema_version();
    match facts.schema {
        None => findings.good("database", format!("{place} is new; a server makes it")),
        Some(schema) if schema > of_program => {
            let says = format!("{place} has the schema {schema} of a newer greybox");
            findings.bad("database", says);
        }
        Some(schema) if schema < of_program => {
            let says =
                format!("{place} has the schema {schema}; a server brings it to {of_program}");
            findings.doubtful("database", says);
        }
        Some(_) => {
            let served = if facts.is_served {
                "; a server works with it"
            } else {
                ""
            };
            findings.good("database", format!("{place}{served}"));
        }
    }
    if let Some(postgres) = &facts.postgres {
        findings.good("database", format!("PostgreSQL {}", postgres.version));
        if !postgres.is_over_tls {
            findings.doubtful("database", "the way to the PostgreSQL is not over TLS");
        }
        if postgres.clock_ahead_s.abs() > CLOCKS_APART_S {
            let ahead = postgres.clock_ahead_s;
            let says = format!("the clock of the PostgreSQL is {ahead:.0} s ahead of this one");
            findings.doubtful("clock", says);
        }
    }
    Some(facts)
}

/// The folder of a database that is a file: whether a server can write there, and how much.
fn folder(database: &Path, findings: &mut Findings) {
    let mut folder = database.parent().unwrap_or(Path::new("."));
    // A server makes folders that are not there.
    while !folder.as_os_str().is_empty() && !folder.exists() {
        folder = folder.parent().unwrap_or(Path::new("."));
    }
    if folder.as_os_str().is_empty() {
        folder = Path::new(".");
    }
    let shown = folder.display();
    if let Err(error) = tempfile::tempfile_in(folder) {
        findings.bad("disk", format!("{shown} cannot be written: {error}"));
        return;
    }
    match system::free_space(folder) {
        Err(error) => findings.doubtful("disk", format!("{shown}: {error}")),
        Ok(bytes) => {
            let says = format!("{} MiB are free at {shown}", bytes >> 20);
            match bytes >> 20 < LITTLE_SPACE_MIB {
                true => findings.doubtful("disk", says),
                false => findings.good("disk", says),
            }
        }
    }
    match system::is_open_to_others(database) {
        Ok(true) => {
            let says = format!(
                "others can read {}; a server mends that",
                database.display()
            );
            findings.doubtful("disk", says);
        }
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            findings.bad("disk", format!("{}: {error}", database.display()));
        }
        _ => {}
    }
}

fn secret_keys(settings: &Settings, findings: &mut Findings) {
    match (settings.database(), &settings.secret_keys_file) {
        // A database that cannot be is told of above.
        (Err(error), Some(_)) => findings.bad("secrets", error),
        (Err(_), None) => {}
        (Ok(_), Some(file)) => findings.good("secrets", format!("{} has keys", file.display())),
        (Ok(_), None) => findings.good("secrets", "there is no key: webhooks' stand as they are"),
    }
}

fn tls(settings: &Settings, findings: &mut Findings) {
    let Some(files) = settings.tls.files() else {
        let says = "the server speaks plain HTTP";
        match settings.listen.ip().to_canonical().is_loopback() {
            true => findings.good("tls", format!("{says}, to its of_program machine")),
            false => findings.doubtful("tls", format!("{says}, where others can read it")),
        }
        return;
    };
    let key = files.key.clone();
    let shown = files.certificate.display().to_string();
    match Tls::new(files) {
        Err(error) => findings.bad("tls", error),
        Ok(tls) if !tls.is_valid_in_days(0) => {
            findings.bad("tls", format!("{shown} has expired or is not valid yet"));
        }
        Ok(tls) if !tls.is_valid_in_days(VALID_FOR_DAYS) => {
            let says = format!("{shown} expires within {VALID_FOR_DAYS} days");
            findings.doubtful("tls", says);
        }
        Ok(_) => findings.good("tls", format!("{shown} is valid")),
    }
    if system::is_open_to_others(&key).unwrap_or(false) {
        let says = format!("others can read the key {}", key.display());
        findings.doubtful("tls", says);
    }
}

async fn provider(settings: &Settings, findings: &mut Findings) {
    let provider = match settings.oidc.provider() {
        Ok(None) => return,
        Ok(Some(provider)) => Provider::new(provider),
        Err(error) => return findings.bad("provider", error),
    };
    let secret = match Secret::new() {
        Ok(secret) => secret,
        Err(error) => return findings.bad("provider", error),
    };
    match provider
        .authorization_url(&SignInAttempt::new(secret))
        .await
    {
        Err(error) => findings.bad("provider", error),
        Ok(url) => {
            let says = format!("people sign in at {}", url.origin().ascii_serialization());
            match settings.roles.is_empty() {
                true => findings.bad(
                    "provider",
                    format!("{says}, and no group has a role (--role)"),
                ),
                false => findings.good("provider", says),
            }
        }
    }
}

/// Whether callers have to say who they are, where others than the machine itself reach the server.
fn callers(settings: &Settings, database: Option<&DatabaseFacts>, findings: &mut Findings) {
    let tokens = database.map_or(0, |facts| facts.tokens);
    let knows_people = settings.oidc.oidc_issuer.is_some() || !settings.trusted_proxies.is_empty();
    if tokens > 0 || knows_people {
        let says = format!("callers have to say who they are (tokens: {tokens})");
        findings.good("callers", says);
    } else if settings.listen.ip().to_canonical().is_loopback() {
        let says = "nobody has to say who they are, and this machine alone can ask";
        findings.good("callers", says);
    } else {
        let says = "nobody would have to say who they are: a server does not start before a token is made, or a \
                    provider or proxy is named that knows people";
        findings.bad("callers", says);
    }
}

fn address(settings: &Settings, database: Option<&DatabaseFacts>, findings: &mut Findings) {
    let address = settings.listen;
    let is_served = database.is_some_and(|facts| facts.is_served);
    match TcpListener::bind(address) {
        Ok(_) => findings.good("address", format!("{address} is free")),
        Err(error) if error.kind() == io::ErrorKind::AddrInUse && is_served => {
            let says = format!(
                "{address} is taken, by the server that works with the database or by another program"
            );
            findings.good("address", says);
        }
        Err(error) => findings.bad("address", format!("{address}: {error}")),
    }
}
