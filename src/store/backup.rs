//! A copy of a database that a server works with, the way back, and whether a file is sound.
//!
//! The file of a database in use is not a copy of it: what was committed last stands in the log
//! beside it. A backup is one consistent state in one file, made while the server works; every job
//! that was acknowledged before it began is in it.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::time::Duration;

use serde_json::Value;
use sha2::{Digest, Sha256};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePoolOptions};
use sqlx::{Connection, FromRow, SqliteConnection};

use super::database::{Pool, sqlite};
use super::lock::FileLock;
use super::private_file::{self, beside};
use super::sealed::check::{self, Checked};
use super::{AuditEntry, StoreError, audit, schema_version};

/// How long a statement waits for the server's lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(30);

/// Copies the database, which a server may work with meanwhile, into a new file. The file is there
/// once it is whole and on disk.
pub async fn backup(database: &Path, into: &Path) -> Result<(), StoreError> {
    if into.exists() {
        return Err(file_error(into, io::ErrorKind::AlreadyExists.into()));
    }
    let partial = beside(into, ".partial");
    remove(&partial)?;
    enter_command(database, format!("backup {}", into.display())).await;
    private_file::open(&partial).map_err(|source| file_error(&partial, source))?;
    let mut source = open(database).await?;
    let copied = sqlx::query("vacuum into ?")
        .bind(partial.to_string_lossy())
        .execute(&mut source)
        .await;
    source.close().await?;
    copied?;
    let mut copy = open(&partial).await?;
    // Nobody cut the copy off from its server.
    sqlx::query("update nodes set state = 'ended'")
        .execute(&mut copy)
        .await?;
    copy.close().await?;
    put(&partial, into)
}

/// What a restored database has from the database in its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Restored {
    /// The names of the tokens that were revoked after the backup was made and stay revoked; nothing where no database
    /// was replaced that could tell.
    pub revoked: Option<Vec<String>>,
}

/// Puts a backup in the place of a database that no server works with. One that is there is
/// replaced only where `replace` says so; the tokens that were revoked there stay revoked.
///
/// # Errors
/// The backup is damaged or of a newer version, the database is in use or there already.
pub async fn restore(
    backup: &Path,
    database: &Path,
    replace: bool,
) -> Result<Restored, StoreError> {
    if let Some(finding) = check(backup).await?.findings.into_iter().next() {
        return Err(super::corrupt("backup", backup.display(), finding));
    }
    let there = fs::metadata(database).is_ok_and(|file| file.len() > 0);
    if there && !replace {
        return Err(file_error(database, io::ErrorKind::AlreadyExists.into()));
    }
    let _lock = FileLock::take(database)?;
    let revocations = match there {
        true => revocations(database).await.ok(),
        false => None,
    };
    let partial = beside(database, ".partial");
    copy(backup, &partial).map_err(|source| file_error(&partial, source))?;
    enter_command(&partial, format!("restore {}", backup.display())).await;
    let revoked = match revocations {
        Some(revocations) => Some(revoke_again(&partial, revocations).await?),
        None => None,
    };
    // The log of the database that was here is none of this one's.
    remove(&beside(database, "-wal"))?;
    remove(&beside(database, "-shm"))?;
    put(&partial, database)?;
    Ok(Restored { revoked })
}

/// A token that was revoked.
#[derive(FromRow)]
struct Revocation {
    digest: String,
    revoked_at: String,
}

/// The tokens that were revoked in a database.
async fn revocations(database: &Path) -> Result<Vec<Revocation>, StoreError> {
    let mut connection = open(database).await?;
    let revocations =
        sqlx::query_as("select digest, revoked_at from tokens where revoked_at is not null")
            .fetch_all(&mut connection)
            .await?;
    connection.close().await?;
    Ok(revocations)
}

/// Revokes the tokens of a database that were revoked elsewhere and count here. Says their names.
async fn revoke_again(
    database: &Path,
    revocations: Vec<Revocation>,
) -> Result<Vec<String>, StoreError> {
    let mut connection = open(database).await?;
    let mut revoked = Vec::new();
    for Revocation { digest, revoked_at } in revocations {
        let name: Option<String> = sqlx::query_scalar(
            "update tokens set revoked_at = ? where digest = ? and revoked_at is null returning name",
        )
        .bind(revoked_at)
        .bind(digest)
        .fetch_optional(&mut connection)
        .await?;
        revoked.extend(name);
    }
    connection.close().await?;
    revoked.sort();
    for name in &revoked {
        enter_command(database, format!("token revoke {name}")).await;
    }
    Ok(revoked)
}

/// Enters a command into the audit log of a database, where the log can be written: a backup of a full disk is made
/// all the same, and a database of an older schema has no chain yet.
async fn enter_command(database: &Path, command: String) {
    let enter = async {
        if !is_up_to_date(database).await? {
            return Ok(());
        }
        let pool = pool(database).await?;
        let mut tx = pool.begin_write_in_turn().await?;
        audit::add(&mut tx, AuditEntry::of_command(command, None)).await?;
        tx.commit().await?;
        pool.close().await;
        Ok::<_, StoreError>(())
    };
    if let Err(error) = enter.await {
        tracing::warn!(%error, "the audit log was not written");
    }
}

pub use check::{check_postgres, seal_postgres};

/// Looks at all of a database: its pages, its rows, and whether they are what was written.
pub async fn check(database: &Path) -> Result<Checked, StoreError> {
    let mut checked = Checked {
        findings: check_file(database).await?,
        ..Checked::default()
    };
    if checked.findings.is_empty() && is_up_to_date(database).await? {
        let pool = pool(database).await?;
        let looked = check::look(&pool, &mut checked).await;
        pool.close().await;
        looked?;
    }
    Ok(checked)
}

/// Seals all rows of a database that have no seal, while a server may work with it; answers how many.
pub async fn seal(database: &Path) -> Result<u64, StoreError> {
    let pool = pool(database).await?;
    let sealed = check::seal_all(&pool).await;
    pool.close().await;
    sealed
}

/// A connection to a database that is there.
pub(super) async fn pool(database: &Path) -> Result<Pool, StoreError> {
    let pool = SqlitePoolOptions::new().max_connections(1);
    Ok(Pool::Sqlite(pool.connect_with(options(database)?).await?))
}

async fn is_up_to_date(database: &Path) -> Result<bool, StoreError> {
    let mut connection = open(database).await?;
    let newest = newest(&mut connection).await?;
    connection.close().await?;
    Ok(newest == schema_version())
}

/// The schema of a database.
async fn newest(connection: &mut SqliteConnection) -> Result<i64, StoreError> {
    let newest: Option<i64> = sqlx::query_scalar("select max(version) from _sqlx_migrations")
        .fetch_one(connection)
        .await?;
    Ok(newest.unwrap_or(0))
}

async fn check_file(database: &Path) -> Result<Vec<String>, StoreError> {
    let mut connection = open(database).await?;
    let mut findings: Vec<String> = sqlx::query_scalar("pragma integrity_check")
        .fetch_all(&mut connection)
        .await?;
    findings.retain(|line| line != "ok");
    if findings.is_empty() {
        let newest = newest(&mut connection).await?;
        if newest > schema_version() {
            findings.push(format!(
                "its schema {newest} is newer than {}, which this program knows",
                schema_version()
            ));
        } else if newest == schema_version() {
            findings = sqlite::missing(&mut connection).await?;
            if findings.is_empty() {
                look_inside(&mut connection, &mut findings).await?;
            }
        }
    }
    connection.close().await?;
    Ok(findings)
}

async fn look_inside(
    connection: &mut SqliteConnection,
    findings: &mut Vec<String>,
) -> Result<(), StoreError> {
    let strangers: Vec<(String, String)> =
        sqlx::query_as("select \"table\", parent from pragma_foreign_key_check")
            .fetch_all(&mut *connection)
            .await?;
    for (table, parent) in strangers {
        findings.push(format!("a row of {table} belongs to none of {parent}"));
    }
    let unreadable: Vec<(String, String)> = sqlx::query_as(
        "select 'job', id from jobs where not (json_valid(spec) and json_valid(labels)) \
         union all select 'result', job from results where not json_valid(outcome) \
         union all select 'dataset', id from datasets \
         where not (json_valid(description) and json_valid(summary)) \
         union all select 'model', reference from models where not json_valid(document)",
    )
    .fetch_all(&mut *connection)
    .await?;
    for (what, id) in unreadable {
        findings.push(format!("the {what} {id} does not read back"));
    }
    let without: Vec<(String, String)> = sqlx::query_as(
        "select job, dataset from job_datasets join jobs on jobs.id = job \
         where status in ('queued', 'running', 'paused') \
         and dataset not in (select id from datasets)",
    )
    .fetch_all(&mut *connection)
    .await?;
    for (job, dataset) in without {
        findings.push(format!("{job} reads {dataset}, which is not there"));
    }
    look_at_models(connection, findings).await?;
    look_at_recordings(connection, findings).await
}

/// A model's digest is that of its document.
async fn look_at_models(
    connection: &mut SqliteConnection,
    findings: &mut Vec<String>,
) -> Result<(), StoreError> {
    let models: Vec<(String, String, String)> =
        sqlx::query_as("select reference, digest, document from models")
            .fetch_all(&mut *connection)
            .await?;
    for (reference, digest, document) in models {
        let computed = hex::encode(Sha256::digest(&document));
        if digest != format!("sha256:{computed}") {
            findings.push(format!("the document of {reference} is not the one stored"));
        }
    }
    Ok(())
}

/// A recording has as many samples as it says, of each signal. (Its digest is of the file that came,
/// which is not kept.)
async fn look_at_recordings(
    connection: &mut SqliteConnection,
    findings: &mut Vec<String>,
) -> Result<(), StoreError> {
    let recordings: Vec<(String, String)> = sqlx::query_as("select id, description from datasets")
        .fetch_all(&mut *connection)
        .await?;
    for (id, description) in recordings {
        let description: Value = serde_json::from_str(&description).unwrap_or_default();
        let samples = description["samples"].as_i64().unwrap_or(-1);
        let signals = description["signals"].as_array().map_or(0, Vec::len);
        let axes = usize::from(description["sample_time"].is_null());
        let lengths: Vec<i64> = sqlx::query_scalar(
            "select sum(length(samples)) from dataset_chunks where dataset = ? group by position",
        )
        .bind(&id)
        .fetch_all(&mut *connection)
        .await?;
        let whole = samples == 0 || lengths.len() == signals + axes;
        if !whole || lengths.iter().any(|bytes| *bytes != 8 * samples) {
            findings.push(format!("samples of {id} are missing"));
        }
    }
    Ok(())
}

async fn open(path: &Path) -> Result<SqliteConnection, StoreError> {
    Ok(SqliteConnection::connect_with(&options(path)?).await?)
}

fn options(path: &Path) -> Result<SqliteConnectOptions, StoreError> {
    if !path.is_file() {
        return Err(file_error(path, io::ErrorKind::NotFound.into()));
    }
    let options = SqliteConnectOptions::new().filename(path);
    Ok(options.busy_timeout(BUSY_TIMEOUT))
}

/// Brings a file to disk, and then under its name.
fn put(partial: &Path, name: &Path) -> Result<(), StoreError> {
    let put = || {
        File::open(partial)?.sync_all()?;
        fs::rename(partial, name)?;
        let folder = name.parent().filter(|path| !path.as_os_str().is_empty());
        // A folder that cannot be opened is brought to disk by the system, later.
        if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
            folder.sync_all()?;
        }
        Ok(())
    };
    put().map_err(|source| file_error(name, source))
}

/// Copies a file into a new file, which its owner alone reads.
fn copy(from: &Path, into: &Path) -> io::Result<()> {
    remove_file(into)?;
    io::copy(&mut File::open(from)?, &mut private_file::open(into)?)?;
    Ok(())
}

fn remove(path: &Path) -> Result<(), StoreError> {
    remove_file(path).map_err(|source| file_error(path, source))
}

/// Removes a file, where there is one.
fn remove_file(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

fn file_error(path: &Path, source: io::Error) -> StoreError {
    StoreError::File {
        path: path.to_owned(),
        source,
    }
}
