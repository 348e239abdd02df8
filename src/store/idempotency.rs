//! What was made by requests that came with a key.

use super::StoreError;
use super::database::{self, Connection};
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

/// What a key made before.
pub(super) struct Earlier {
    /// Whether it came with the same body.
    pub is_same_body: bool,
    /// The identifier of what was made.
    pub made: String,
}

/// What the key made before, if it came.
pub(super) async fn earlier(
    connection: &mut Connection,
    idempotency: &Idempotency,
) -> Result<Option<Earlier>, StoreError> {
    let row: Option<(String, String)> = database::query_as(
        "select body_digest, made from idempotency where project = $1 and key = $2",
    )
    .bind(idempotency.project.as_str())
    .bind(&idempotency.key)
    .fetch_optional(connection)
    .await?;
    Ok(row.map(|(digest, made)| Earlier {
        is_same_body: digest == idempotency.body_digest,
        made,
    }))
}

/// Keeps what a key made.
pub(super) async fn remember(
    tx: &mut Tx,
    idempotency: &Idempotency,
    made: &str,
) -> Result<(), StoreError> {
    database::query(
        "insert into idempotency (project, key, body_digest, made) values ($1, $2, $3, $4)",
    )
    .bind(idempotency.project.as_str())
    .bind(&idempotency.key)
    .bind(&idempotency.body_digest)
    .bind(made)
    .execute(&mut **tx)
    .await?;
    Ok(())
}
