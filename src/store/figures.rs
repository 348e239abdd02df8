//! A few figures of the database, for those who watch the server.

use std::time::Duration;

use jiff::Timestamp;

use super::columns::time;
use super::shared_database::Database;
use super::{AuditHead, StoreError, StoredBytes, audit, database};

/// How the database is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figures {
    /// How long the oldest job that is queued has been.
    pub queue_age: Duration,
    /// The size of the file.
    pub bytes: u64,
    /// What of it holds nothing.
    pub free_bytes: u64,
    /// Deliveries that are to be sent.
    pub deliveries_waiting: u64,
    /// What all projects keep.
    pub stored: StoredBytes,
    /// Entries of the audit log, by their numbers.
    pub audit_entries: u64,
    /// The last entry of the audit log; nothing where no entry has a digest.
    pub audit_head: Option<AuditHead>,
}

/// The figures as they are now.
pub(super) async fn read(database: &Database) -> Result<Figures, StoreError> {
    let mut connection = database.readers.acquire().await?;
    let oldest: Option<(String, String)> = database::query_as(
        "select id, created_at from jobs where status = 'queued' order by id limit 1",
    )
    .fetch_optional(&mut connection)
    .await?;
    let queue_age = match oldest {
        None => Duration::ZERO,
        Some((id, created_at)) => {
            let age = Timestamp::now().duration_since(time(&id, &created_at)?);
            Duration::try_from(age).unwrap_or_default()
        }
    };
    let (bytes, free_bytes): (i64, i64) = database::query_as(connection.kind().either(
        "select page_count * page_size, freelist_count * page_size \
         from pragma_page_count, pragma_freelist_count, pragma_page_size",
        "select pg_database_size(current_database()), cast(0 as bigint)",
    ))
    .fetch_one(&mut connection)
    .await?;
    let deliveries_waiting: i64 =
        database::query_scalar("select count(*) from deliveries where state = 'waiting'")
            .fetch_one(&mut connection)
            .await?;
    let stored = database::query_as(
        "select cast(coalesce(sum(samples), 0) as bigint) as samples, \
         cast(coalesce(sum(jobs), 0) as bigint) as jobs, \
         cast(coalesce(sum(keys), 0) as bigint) as keys from stored_bytes",
    )
    .fetch_one(&mut connection)
    .await?;
    let audit_entries = audit::numbers(&mut connection).await?;
    let audit_head = audit::chain::head(&mut connection).await?;
    Ok(Figures {
        queue_age,
        bytes: bytes.unsigned_abs(),
        free_bytes: free_bytes.unsigned_abs(),
        deliveries_waiting: deliveries_waiting.unsigned_abs(),
        stored,
        audit_head,
        audit_entries: audit_entries.map_or(0, |(first, last)| first.abs_diff(last) + 1),
    })
}
