//! The lives of servers: how one begins, ends, and is taken over from.

use std::time::Duration;

use jiff::Timestamp;

use crate::store::database::{self, Kind};
use crate::store::node_name::node_name;
use crate::store::writer::{Tx, Writer};
use crate::store::{Change, StoreError, queue};

/// Lives that ended of which a row is kept.
const LIVES_KEPT: i64 = 1000;

/// Begins a life that says every `beat` that it is there. From now on only its transactions are taken.
pub(in crate::store) async fn begin(writer: &Writer, beat: Duration) -> Result<i64, StoreError> {
    let life = writer.write(move |tx| Box::pin(begin_in(tx, beat))).await?;
    writer.fence().set(life);
    Ok(life)
}

async fn begin_in(tx: &mut Tx, beat: Duration) -> Result<i64, StoreError> {
    let last: i64 = database::query_scalar("select coalesce(max(life), 0) from nodes")
        .fetch_one(&mut **tx)
        .await?;
    let life = last + 1;
    if tx.kind() == Kind::Sqlite {
        let cut_off: Vec<i64> =
            database::query_scalar("select life from nodes where state = 'live'")
                .fetch_all(&mut **tx)
                .await?;
        for life in cut_off {
            note_death(tx, life).await?;
        }
    }
    database::query(
        "insert into nodes (life, name, beat_ms, state, begun_at) values ($1, $2, $3, 'live', $4)",
    )
    .bind(life)
    .bind(node_name())
    .bind(i64::try_from(beat.as_millis()).unwrap_or(i64::MAX))
    .bind(Timestamp::now().to_string())
    .execute(&mut **tx)
    .await?;
    database::query("delete from nodes where state <> 'live' and life < $1")
        .bind(life - LIVES_KEPT)
        .execute(&mut **tx)
        .await?;
    Ok(life)
}

/// Notes that a life was cut off, and what that says of the jobs.
async fn note_death(tx: &mut Tx, life: i64) -> Result<(), StoreError> {
    for statement in [
        "update nodes set state = 'dead' where life = $1",
        "update jobs set deaths = case when at_work_in = $1 then deaths + 1 else 0 end \
         where at_work_in = $1 or (deaths > 0 and at_work_in is null)",
        "update jobs set at_work_in = null where at_work_in = $1",
    ] {
        database::query(statement)
            .bind(life)
            .execute(&mut **tx)
            .await?;
    }
    Ok(())
}

/// Declares a node dead that has not said that it lives since `beat`, and has others go on with its jobs.
pub(super) async fn take_over(tx: &mut Tx, life: i64, beat: i64) -> Result<(), StoreError> {
    let silent = database::query(
        "update nodes set state = 'dead' where life = $1 and beat = $2 and state = 'live'",
    )
    .bind(life)
    .bind(beat)
    .execute(&mut **tx)
    .await?;
    if silent == 0 {
        return Ok(());
    }
    note_death(tx, life).await?;
    queue::let_go_of_leadership(tx, &queue::client_name(life)).await?;
    let jobs = queue::reassign(tx).await?;
    metrics::counter!("greybox_nodes_taken_over_total").increment(1);
    tracing::warn!(
        node = life,
        jobs,
        "a node is dead; others go on with its jobs"
    );
    tx.announce(Change::Missed);
    Ok(())
}

/// Ends a life in order: what was still at work in it others go on with.
pub(super) async fn end(tx: &mut Tx, life: i64) -> Result<(), StoreError> {
    for statement in [
        "update nodes set state = 'ended' where life = $1",
        "update jobs set at_work_in = null where at_work_in = $1",
    ] {
        database::query(statement)
            .bind(life)
            .execute(&mut **tx)
            .await?;
    }
    queue::let_go_of_leadership(tx, &queue::client_name(life)).await?;
    queue::reassign(tx).await?;
    Ok(())
}
