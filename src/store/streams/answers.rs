//! The answers to batches that came with a key, for as long as keys are kept. The signals of the
//! stream, which are most of an answer, are kept once for all answers that list the same signals.

use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::stream::{Appended, BatchOutcome, StreamRow};
use crate::store::columns::{from_json, json};
use crate::store::database::{self, QueryBuilder, Row};
use crate::store::idempotency::{self, Idempotency};
use crate::store::sealed::{SIGNAL_LISTS, STREAM_BATCHES, Sealed};
use crate::store::writer::Tx;
use crate::store::{StoreError, corrupt};

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
    let kept = row(tx, &STREAM_BATCHES, &made).await?;
    let Some(kept) = kept.filter(|_| earlier.is_same_body) else {
        return Ok(Some(BatchOutcome::KeyReused));
    };
    let mut appended: Box<Appended> = from_json("batch", &made, kept.try_get("answer")?)?;
    if let Some(list) = kept.try_get::<Option<&str>>("signals")? {
        let list = row(tx, &SIGNAL_LISTS, list).await?;
        let list = list.ok_or_else(|| corrupt("batch", &made, "its list of signals is gone"))?;
        appended.stream.signals = from_json("signals", &made, list.try_get("signals")?)?;
    }
    Ok(Some(BatchOutcome::Replayed(appended)))
}

/// The row with an identifier of one of the two tables.
async fn row(tx: &mut Tx, table: &Sealed, id: &str) -> Result<Option<Row>, StoreError> {
    let mut select = table.select();
    select
        .push(format_args!("{} where id = ", table.table))
        .push_bind(id);
    let row = select.build().fetch_optional(&mut **tx).await?;
    row.map(|row| table.verify(&row).map(|_| row)).transpose()
}

/// Keeps the answer to a batch that came with a key.
pub(super) async fn remember(
    tx: &mut Tx,
    idempotency: &Idempotency,
    appended: &Appended,
) -> Result<(), StoreError> {
    let id = format!("{BATCH}{}", Uuid::now_v7().simple());
    let signals = json(&appended.stream.signals);
    let digest = hex::encode(Sha256::digest(&signals));
    let list = format!("{} {digest}", idempotency.project);
    database::query(
        "insert into signal_lists (id, project, signals) values ($1, $2, $3) \
         on conflict (id) do nothing",
    )
    .bind(&list)
    .bind(idempotency.project.as_str())
    .bind(signals)
    .execute(&mut **tx)
    .await?;
    let without_signals = Appended {
        stream: StreamRow {
            signals: Vec::new(),
            ..appended.stream.clone()
        },
        ..appended.clone()
    };
    database::query("insert into stream_batches (id, answer, signals) values ($1, $2, $3)")
        .bind(&id)
        .bind(json(&without_signals))
        .bind(list)
        .execute(&mut **tx)
        .await?;
    idempotency::remember(tx, idempotency, &id).await
}

/// Removes the answers to batches whose keys have gone, given what each key made, and the lists of signals that
/// no answer names any more.
pub(in crate::store) async fn forget(tx: &mut Tx, made: &[String]) -> Result<(), StoreError> {
    let batches: Vec<&String> = made.iter().filter(|id| id.starts_with(BATCH)).collect();
    if batches.is_empty() {
        return Ok(());
    }
    let mut removal = QueryBuilder::new("delete from stream_batches where id in (");
    let mut listed = removal.separated(", ");
    for id in batches {
        listed.push_bind(id.clone());
    }
    removal.push(")");
    // Each number of answers is another statement; they are not worth keeping.
    let removal = removal.build().persistent(false);
    removal.execute(&mut **tx).await?;
    database::query(
        "delete from signal_lists where not exists \
         (select 1 from stream_batches where stream_batches.signals = signal_lists.id)",
    )
    .execute(&mut **tx)
    .await?;
    Ok(())
}
