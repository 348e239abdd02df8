//! A copy of a database that a server works with, the way back, and whether a file is sound.
//!
//! The file of a database in use is not a copy of it: what was committed last stands in the log
//! beside it. A backup is one consistent state in one file, made while the server works; every job
//! that was acknowledged before it began is in it.

use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;
use std::time::Duration;

use serde_json::Value;
use sha2::{Digest, Sha256};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePoolOptions};
use sqlx::{Connection, FromRow, SqliteConnection};
use tempfile::TempDir;

use super::database::{Pool, query, sqlite};
use super::lock::FileLock;
use super::private_file::{self, beside};
use super::sealed::changes::seal_changed;
use super::sealed::check::{self, Checked};
use super::{AuditEntry, StoreError, audit, schema_version};
use crate::encrypted_file::{self, EncryptedFileError, Identities, Recipients};

/// How long a statement waits for the server's lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(30);

/// The name of a copy in a folder of its own.
const COPY: &str = "copy.db";

/// Copies the database, which a server may work with meanwhile, into a new file, which the recipients alone can read
/// where there are some. The file is there once it is whole and on disk.
pub async fn backup(
    database: &Path,
    into: &Path,
    recipients: Option<&Recipients>,
) -> Result<(), StoreError> {
    if into.exists() {
        return Err(file_error(into, io::ErrorKind::AlreadyExists.into()));
    }
    enter_command(database, format!("backup {}", into.display())).await;
    let partial = beside(into, ".partial");
    remove(&partial)?;
    let Some(recipients) = recipients else {
        copy_database(database, &partial).await?;
        return put(&partial, into);
    };
    // What everybody could read stays where the database is, and not for long.
    let folder = folder_beside(database)?;
    let copy = folder.path().join(COPY);
    copy_database(database, &copy).await?;
    let encrypted = encrypt(&copy, &partial, recipients);
    encrypted.map_err(|source| encrypted_error(&partial, source))?;
    put(&partial, into)
}

/// Copies a database that a server may be working with into a new file.
async fn copy_database(database: &Path, into: &Path) -> Result<(), StoreError> {
    private_file::open(into).map_err(|source| file_error(into, source))?;
    let mut source = open(database).await?;
    let copied = sqlx::query("vacuum into ?")
        .bind(into.to_string_lossy())
        .execute(&mut source)
        .await;
    source.close().await?;
    copied?;
    let has_seals = is_up_to_date(into).await?;
    let copy = pool(into).await?;
    let mut tx = copy.begin_write_in_turn().await?;
    // Nobody cut the copy off from its server.
    query("update nodes set state = 'ended'")
        .execute(&mut tx)
        .await?;
    if has_seals {
        seal_changed(&mut tx).await?;
    }
    tx.commit().await?;
    copy.close().await;
    Ok(())
}

fn encrypt(
    database: &Path,
    into: &Path,
    recipients: &Recipients,
) -> Result<(), EncryptedFileError> {
    let mut writer = BufWriter::new(private_file::open(into)?);
    encrypted_file::encrypt(recipients, &mut File::open(database)?, &mut writer)?;
    Ok(writer.flush()?)
}

/// What a restored database has from the database in its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Restored {
    /// The names of the tokens that were revoked after the backup was made and stay revoked; nothing where no database
    /// was replaced that could tell.
    pub revoked: Option<Vec<String>>,
}

/// How a backup is put in the place of a database.
#[derive(Debug, Default)]
pub struct Restoring {
    /// Whether a database that is there is replaced.
    pub replace: bool,
    /// The keys with which an encrypted backup is opened.
    pub identities: Option<Identities>,
}

/// Puts a backup in the place of a database that no server works with; the tokens that were revoked in a database that
/// is replaced stay revoked.
///
/// # Errors
/// The backup is damaged, of a newer version, or encrypted for others; the database is in use or there already.
pub async fn restore(
    backup: &Path,
    database: &Path,
    how: Restoring,
) -> Result<Restored, StoreError> {
    let there = fs::metadata(database).is_ok_and(|file| file.len() > 0);
    if there && !how.replace {
        return Err(file_error(database, io::ErrorKind::AlreadyExists.into()));
    }
    let folder = folder_beside(database)?;
    let restored = folder.path().join(COPY);
    let copied = copy(backup, &restored, how.identities);
    copied.map_err(|source| encrypted_error(backup, source))?;
    if let Some(finding) = check(&restored).await?.findings.into_iter().next() {
        return Err(super::corrupt("backup", backup.display(), finding));
    }
    let _lock = FileLock::take(database)?;
    enter_command(&restored, format!("restore {}", backup.display())).await;
    let revoked = match there {
        true => match revocations(database).await {
            Ok(revocations) => Some(revoke_again(&restored, revocations).await?),
            // A database that does not read tells nothing.
            Err(_) => None,
        },
        false => None,
    };
    // The log of the database that was here is none of this one's.
    remove(&beside(database, "-wal"))?;
    remove(&beside(database, "-shm"))?;
    put(&restored, database)?;
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
        seal_changed(&mut tx).await?;
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
    let has_schema = is_up_to_date(database).await;
    if has_schema.is_ok_and(|is_up_to_date| is_up_to_date) {
        let pool = pool(database).await?;
        let looked = check::look(&pool, &mut checked).await;
        pool.close().await;
        // Rows cannot all be looked at where a page or a table is damaged.
        if let Err(error) = looked {
            checked.findings.push(error.to_string());
        }
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
        // A folder that cannot be opened is brought to disk by the system, later.
        if let Ok(folder) = File::open(folder_of(name)) {
            folder.sync_all()?;
        }
        Ok(())
    };
    put().map_err(|source| file_error(name, source))
}

/// Copies what a backup holds into a new file, which its owner alone reads.
fn copy(
    backup: &Path,
    into: &Path,
    identities: Option<Identities>,
) -> Result<(), EncryptedFileError> {
    let mut source = BufReader::new(File::open(backup)?);
    let mut writer = BufWriter::new(private_file::open(into)?);
    match encrypted_file::is_encrypted(&mut source)? {
        false => io::copy(&mut source, &mut writer).map(drop)?,
        true => {
            let identities = identities.ok_or(EncryptedFileError::KeyNeeded)?;
            encrypted_file::decrypt(&identities, &mut source, &mut writer)?;
        }
    }
    Ok(writer.flush()?)
}

fn remove(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(file_error(path, error)),
        _ => Ok(()),
    }
}

/// A folder beside a database for a copy on its way, for its owner alone; it goes with the value.
fn folder_beside(database: &Path) -> Result<TempDir, StoreError> {
    let folder = folder_of(database);
    let made = tempfile::Builder::new()
        .prefix(".greybox-copy-")
        .tempdir_in(folder);
    made.map_err(|source| file_error(folder, source))
}

/// The folder of a file.
fn folder_of(path: &Path) -> &Path {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

fn file_error(path: &Path, source: io::Error) -> StoreError {
    StoreError::File {
        path: path.to_owned(),
        source,
    }
}

fn encrypted_error(path: &Path, source: EncryptedFileError) -> StoreError {
    match source {
        EncryptedFileError::Io(source) => file_error(path, source),
        source => StoreError::EncryptedFile {
            path: path.to_owned(),
            source,
        },
    }
}
