//! The keys of requests and what each request made, for as long as keys are kept.

use jiff::Timestamp;

use super::StoreError;
use super::database::{self, Connection, Row};
use super::sealed::KEYS;
use super::writer::Tx;
use crate::access::Project;

/// A client's key for a request, which makes a thing only once.
#[derive(Clone, Debug)]
pub struct Idempotency {
    /// Whose the key is.
    pub project: Project,
    /// The client's key.
    pub key: String,
    /// A digest of the body that came with it.
    pub body_digest: String,
}

/// The earlier request of a key.
pub(super) struct Earlier {
    /// Whether the key came with the same body.
    pub is_same_body: bool,
    /// The identifier of what was made.
    pub made: String,
}

/// What the key made before, if it came.
pub(super) async fn earlier(
    connection: &mut Connection,
    idempotency: &Idempotency,
) -> Result<Option<Earlier>, StoreError> {
    let row = database::query(
        "select project, key, body_digest, made, created_at, seal from idempotency \
         where project = $1 and key = $2",
    )
    .bind(idempotency.project.as_str())
    .bind(&idempotency.key)
    .fetch_optional(connection)
    .await?;
    let earlier = |row: Row| {
        KEYS.verify(&row)?;
        Ok(Earlier {
            is_same_body: row.try_get::<&str>("body_digest")? == idempotency.body_digest,
            made: row.try_get("made")?,
        })
    };
    row.map(earlier).transpose()
}

/// Keeps what a key made.
pub(super) async fn remember(
    tx: &mut Tx,
    idempotency: &Idempotency,
    made: &str,
) -> Result<(), StoreError> {
    database::query(
        "insert into idempotency (project, key, body_digest, made, created_at) \
         values ($1, $2, $3, $4, $5)",
    )
    .bind(idempotency.project.as_str())
    .bind(&idempotency.key)
    .bind(&idempotency.body_digest)
    .bind(made)
    .bind(Timestamp::now().to_string())
    .execute(&mut **tx)
    .await?;
    Ok(())
}

/// Removes some of the oldest keys that came before a time, and answers what they made. The key of a
/// job or a comparison that has not ended stays, and the key of a monitor that is there.
pub(super) async fn forget(
    tx: &mut Tx,
    cutoff: &str,
    at_most: i64,
) -> Result<Vec<String>, StoreError> {
    let made: Vec<String> = database::query_scalar(
        "delete from idempotency where (project, key) in (\
             select project, key from idempotency as old where created_at < $1 \
             and not exists (select 1 from jobs where id = old.made and finished_at is null) \
             and not exists (select 1 from comparison_jobs join jobs on id = job \
                 where comparison = old.made and finished_at is null) \
             and not exists (select 1 from monitors where id = old.made) \
             order by created_at limit $2) returning made",
    )
    .bind(cutoff)
    .bind(at_most)
    .fetch_all(&mut **tx)
    .await?;
    Ok(made)
}
