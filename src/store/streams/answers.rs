//! What was answered to batches that came with a key.

use uuid::Uuid;

use super::{Appended, BatchOutcome};
use crate::store::StoreError;
use crate::store::database;
use crate::store::idempotency::{self, Idempotency};
use crate::store::jobs::{from_json, json};
use crate::store::writer::Tx;

/// What the identifier of a batch begins with.
const BATCH: &str = "batch_";

/// The answer to a batch whose key came before.
pub(super) async fn earlier(
    tx: &mut Tx,
    idempotency: &Idempotency,
) -> Result<Option<BatchOutcome>, StoreError> {
    let Some(earlier) = idempotency::earlier(tx, idempotency).await? else {
        return Ok(None);
    };
    let made = earlier.made;
    let answer: Option<String> =
        database::query_scalar("select answer from stream_batches where id = $1")
            .bind(&made)
            .fetch_optional(&mut **tx)
            .await?;
    Ok(Some(match answer.filter(|_| earlier.is_same_body) {
        Some(answer) => BatchOutcome::Replayed(from_json("batch", &made, &answer)?),
        None => BatchOutcome::KeyReused,
    }))
}

/// Keeps the answer to a batch that came with a key.
pub(super) async fn remember(
    tx: &mut Tx,
    idempotency: &Idempotency,
    appended: &Appended,
) -> Result<(), StoreError> {
    let id = format!("{BATCH}{}", Uuid::now_v7().simple());
    database::query("insert into stream_batches (id, answer) values ($1, $2)")
        .bind(&id)
        .bind(json(appended))
        .execute(&mut **tx)
        .await?;
    idempotency::remember(tx, idempotency, &id).await
}
