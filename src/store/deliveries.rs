//! Events on their way to webhooks: stored in the transaction of what an event tells of, and sent after.

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use serde_json::{Value, json};
use sqlx::FromRow;

use super::columns::{self, project, time};
use super::database::{self, QueryBuilder, Row};
use super::jobs;
use super::page::Page;
use super::sealed::DELIVERIES;
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError, corrupt, unsigned};
use crate::access::Project;
use crate::job::{DeliveryId, WebhookId};
use greybox::identification::JobId;

/// The status by which a receiver says that nothing shall be delivered there any more (410 Gone).
const GONE: u16 = 410;
/// A delivery is tried for so long.
const TRIED_FOR: Duration = Duration::from_hours(72);
/// The wait after the first attempt; it doubles with each.
const FIRST_WAIT: Duration = Duration::from_secs(5);
/// The longest wait.
const LONGEST_WAIT: Duration = Duration::from_hours(6);

/// Deliveries to one place that are looked at: the first that is not damaged is made.
const FIRST_OF_A_PLACE: i64 = 3;

/// How far a delivery has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeliveryState {
    /// It is to be sent.
    Waiting,
    /// The receiver has taken it.
    Delivered,
    /// It was tried for three days.
    GivenUp,
}

impl DeliveryState {
    /// The word for it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Delivered => "delivered",
            Self::GivenUp => "given_up",
        }
    }
}

/// An event on its way to one place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeliveryRow {
    /// The identifier of the delivery, the same at each attempt.
    pub id: DeliveryId,
    /// The webhook that the event is delivered to.
    pub webhook: WebhookId,
    /// The type of the event.
    pub event: String,
    /// The document that is sent.
    pub payload: String,
    /// The state of the delivery.
    pub state: DeliveryState,
    /// Attempts so far.
    pub attempts: u32,
    /// When the next attempt is due.
    pub due_at: Timestamp,
    /// The status that the receiver answered last.
    pub last_status: Option<u16>,
    /// Why the last attempt failed.
    pub last_error: Option<String>,
    /// When the event happened.
    pub created_at: Timestamp,
    /// When the receiver took the delivery.
    pub delivered_at: Option<Timestamp>,
}

/// The outcome of an attempt to deliver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attempt {
    /// The status that the receiver answered.
    pub status: Option<u16>,
    /// Why the attempt failed; nothing where the receiver has taken the delivery.
    pub error: Option<String>,
}

#[derive(FromRow)]
struct DeliveryColumns {
    id: String,
    webhook: String,
    event: String,
    payload: String,
    state: String,
    #[sqlx(try_from = "i64")]
    attempts: u32,
    due_at_ms: i64,
    last_status: Option<i64>,
    last_error: Option<String>,
    created_at: String,
    delivered_at: Option<String>,
}

impl DeliveryColumns {
    fn read(self) -> Result<DeliveryRow, StoreError> {
        let of = &self.id;
        let all = [
            DeliveryState::Waiting,
            DeliveryState::Delivered,
            DeliveryState::GivenUp,
        ];
        let state = all.into_iter().find(|state| state.as_str() == self.state);
        let webhook = self.webhook.parse();
        let due_at = Timestamp::from_millisecond(self.due_at_ms);
        Ok(DeliveryRow {
            webhook: webhook.map_err(|why| corrupt("identifier", of, why))?,
            state: state.ok_or_else(|| corrupt("state", of, "it is none"))?,
            due_at: due_at.map_err(|why| corrupt("time", of, why))?,
            created_at: time(of, &self.created_at)?,
            delivered_at: self.delivered_at.map(|at| time(of, &at)).transpose()?,
            id: of.parse().map_err(|why| corrupt("identifier", of, why))?,
            event: self.event,
            payload: self.payload,
            attempts: self.attempts,
            last_status: (self.last_status)
                .map(|status| unsigned("status", of, status))
                .transpose()?,
            last_error: self.last_error,
        })
    }
}

/// A statement up to its condition that reads deliveries.
fn select() -> QueryBuilder {
    let mut select = DELIVERIES.select();
    select.push("deliveries");
    select
}

fn read(row: &Row) -> Result<DeliveryRow, StoreError> {
    DELIVERIES.verify(row)?;
    row.read::<DeliveryColumns>()?.read()
}

/// Events on their way to webhooks.
#[derive(Clone)]
pub struct Deliveries {
    pub(super) database: Arc<Database>,
}

impl Deliveries {
    /// Deliveries to a place, newest first, older than `before`.
    pub async fn list(
        &self,
        webhook: WebhookId,
        before: Option<DeliveryId>,
        limit: u32,
    ) -> Result<Page<DeliveryRow, DeliveryId>, StoreError> {
        let mut query = select();
        query
            .push(" where webhook = ")
            .push_bind(webhook.to_string());
        if let Some(before) = before {
            query.push(" and id < ").push_bind(before.to_string());
        }
        query.push(" order by id desc limit ");
        query.push_bind(i64::from(limit) + 1);
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let rows = rows.iter().map(read);
        Ok(Page::cut(rows.collect::<Result<_, _>>()?, limit, |row| {
            row.id
        }))
    }

    /// A delivery, if there is one.
    pub async fn find(&self, id: DeliveryId) -> Result<Option<DeliveryRow>, StoreError> {
        let mut query = select();
        query.push(" where id = ").push_bind(id.to_string());
        let row = query.build().fetch_optional(&self.database.readers).await?;
        row.as_ref().map(read).transpose()
    }

    /// Whose a delivery is, if there is one.
    pub async fn project_of(&self, id: DeliveryId) -> Result<Option<Project>, StoreError> {
        let key = id.to_string();
        let name: Option<String> = database::query_scalar(
            "select project from deliveries join webhooks on webhooks.id = webhook \
             where deliveries.id = $1",
        )
        .bind(&key)
        .fetch_optional(&self.database.readers)
        .await?;
        name.map(|name| project(&key, &name)).transpose()
    }

    /// Has a delivery sent once more, now. Says whether there is one.
    pub async fn resend(&self, id: DeliveryId) -> Result<bool, StoreError> {
        in_transaction!(self.database, |tx| resend(tx, id)).await
    }

    /// The delivery to each place that is due first, where that is by now, and when the next is.
    /// A wait that is longer than any can be is one for a clock that was set back.
    pub async fn due(
        &self,
        now: Timestamp,
    ) -> Result<(Vec<DeliveryRow>, Option<Timestamp>), StoreError> {
        let now_ms = now.as_millisecond();
        let longest = i64::try_from(LONGEST_WAIT.as_millis()).unwrap_or(i64::MAX);
        let mut query = DELIVERIES.select();
        query.push("deliveries where id in (select id from (select id, ");
        query.push("row_number() over (partition by webhook order by case when due_at_ms > ");
        query.push_bind(now_ms.saturating_add(longest));
        query.push(" then 0 else due_at_ms end, id) as place from deliveries ");
        query.push("where state = 'waiting') as waiting where place <= ");
        query.push_bind(FIRST_OF_A_PLACE);
        query.push(")");
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let mut waiting = Vec::with_capacity(rows.len());
        for row in &rows {
            match read(row) {
                Ok(row) => waiting.push(row),
                // A damaged delivery holds up no other.
                Err(error) if error.corrupt_row().is_some() => {
                    self.database.damage.note(&error);
                    tracing::error!(%error, "a delivery is left out");
                }
                Err(error) => return Err(error),
            }
        }
        let longest = jiff::SignedDuration::from_millis(longest);
        for row in &mut waiting {
            if row.due_at.duration_since(now) > longest {
                row.due_at = Timestamp::UNIX_EPOCH;
            }
        }
        waiting.sort_by_key(|row| (row.webhook, row.due_at, row.id));
        waiting.dedup_by_key(|row| row.webhook);
        let (due, later): (Vec<_>, Vec<_>) = waiting.into_iter().partition(|row| row.due_at <= now);
        Ok((due, later.iter().map(|row| row.due_at).min()))
    }

    /// Notes what came of an attempt.
    pub async fn note_attempt(&self, id: DeliveryId, attempt: Attempt) -> Result<(), StoreError> {
        in_transaction!(self.database, |tx| note(tx, id, attempt)).await
    }
}

/// Stores an event for each place of a project that wants events of its type, as part of the
/// caller's transaction: it is delivered when that is on disk, at least once.
pub(super) async fn tell(
    tx: &mut Tx,
    project: &Project,
    event: &str,
    data: &Value,
) -> Result<(), StoreError> {
    let all: Vec<(String, String)> =
        database::query_as("select id, events from webhooks where project = $1")
            .bind(project.as_str())
            .fetch_all(&mut **tx)
            .await?;
    let mut places = Vec::with_capacity(all.len());
    for (id, events) in all {
        let events: Result<Vec<String>, StoreError> = columns::from_json("webhook", &id, &events);
        match events {
            Ok(events) if events.iter().any(|wanted| wanted == event) => places.push(id),
            Ok(_) => {}
            // A damaged webhook is told nothing; what the event is about goes on.
            Err(error) => tracing::error!(%error, "a webhook is left out"),
        }
    }
    if places.is_empty() {
        return Ok(());
    }
    let now = Timestamp::now();
    let payload = json!({"type": event, "timestamp": now.to_string(), "data": data}).to_string();
    for place in places {
        database::query(
            "insert into deliveries (id, webhook, event, payload, state, due_at_ms, \
             tried_from_ms, created_at) values ($1, $2, $3, $4, 'waiting', $5, $6, $7)",
        )
        .bind(DeliveryId::new().to_string())
        .bind(place)
        .bind(event)
        .bind(&payload)
        .bind(now.as_millisecond())
        .bind(now.as_millisecond())
        .bind(now.to_string())
        .execute(&mut **tx)
        .await?;
    }
    tx.announce(Change::DeliveryWaits);
    Ok(())
}

/// Tells that a job came to its end.
pub(super) async fn tell_of_end(tx: &mut Tx, id: JobId) -> Result<(), StoreError> {
    let key = id.to_string();
    let row = match jobs::fetch(&mut *tx, id).await {
        Ok(Some(row)) => row,
        Ok(None) => return Ok(()),
        Err(error) if error.corrupt_row().is_some() => return tell_of_damaged(tx, &key).await,
        Err(error) => return Err(error),
    };
    let data = json!({
        "job": key,
        "name": row.name,
        "labels": row.labels,
        "model": row.model,
        "status": row.status,
        "error": row.error,
        "created_at": row.created_at.to_string(),
        "finished_at": row.finished_at.map(|at| at.to_string()),
        "links": {"self": format!("/v1/jobs/{key}"), "result": format!("/v1/jobs/{key}/result")},
    });
    tell(tx, &row.project, "job.ended", &data).await
}

/// Tells of the end of a job whose specification is damaged what does not stand in that.
async fn tell_of_damaged(tx: &mut Tx, id: &str) -> Result<(), StoreError> {
    let row = database::query("select project, status, error from jobs where id = $1")
        .bind(id)
        .fetch_one(&mut **tx)
        .await?;
    let data = json!({
        "job": id,
        "status": row.try_get::<&str>("status")?,
        "error": columns::optional::<Value>(&row, "error", id)?,
        "links": {"self": format!("/v1/jobs/{id}"), "result": format!("/v1/jobs/{id}/result")},
    });
    tell(
        tx,
        &project(id, row.try_get("project")?)?,
        "job.ended",
        &data,
    )
    .await
}

async fn resend(tx: &mut Tx, id: DeliveryId) -> Result<bool, StoreError> {
    let now = Timestamp::now().as_millisecond();
    let resent = database::query(
        "update deliveries set state = 'waiting', due_at_ms = $1, tried_from_ms = $1, \
         attempts = 0, delivered_at = null where id = $2",
    )
    .bind(now)
    .bind(id.to_string())
    .execute(&mut **tx)
    .await?;
    tx.announce(Change::DeliveryWaits);
    Ok(resent == 1)
}

async fn note(tx: &mut Tx, id: DeliveryId, attempt: Attempt) -> Result<(), StoreError> {
    let key = id.to_string();
    let mut select = select();
    select.push(" where id = ").push_bind(&key);
    // The place may have been forgotten meanwhile.
    let Some(before) = select.build().fetch_optional(&mut **tx).await? else {
        return Ok(());
    };
    DELIVERIES.verify(&before)?;
    let attempts: u32 = unsigned("attempts", &key, before.try_get("attempts")?)?;
    let tried_from_ms: i64 = before.try_get("tried_from_ms")?;
    let now = Timestamp::now();
    let tried_ms = now.as_millisecond().saturating_sub(tried_from_ms);
    let is_gone = attempt.status == Some(GONE);
    let state = match &attempt.error {
        None => DeliveryState::Delivered,
        Some(_) if is_gone => DeliveryState::GivenUp,
        Some(_) if u128::from(tried_ms.unsigned_abs()) >= TRIED_FOR.as_millis() => {
            DeliveryState::GivenUp
        }
        Some(_) => DeliveryState::Waiting,
    };
    let wait = i64::try_from(wait_after(attempts).as_millis()).unwrap_or(i64::MAX);
    database::query(
        "update deliveries set state = $1, attempts = attempts + 1, due_at_ms = $2, \
         last_status = $3, last_error = $4, delivered_at = $5 where id = $6",
    )
    .bind(state.as_str())
    .bind(now.as_millisecond().saturating_add(wait))
    .bind(attempt.status)
    .bind(&attempt.error)
    .bind((state == DeliveryState::Delivered).then(|| now.to_string()))
    .bind(&key)
    .execute(&mut **tx)
    .await?;
    if is_gone {
        give_up_all(tx, &key, attempt.error.as_deref()).await?;
    }
    tx.announce(Change::DeliveryWaits);
    Ok(())
}

/// Gives up all that waits for the receiver of a delivery.
async fn give_up_all(tx: &mut Tx, delivery: &str, why: Option<&str>) -> Result<(), StoreError> {
    database::query(
        "update deliveries set state = 'given_up', last_error = $1 where state = 'waiting' \
         and webhook = (select webhook from deliveries where id = $2)",
    )
    .bind(why.map(str::to_owned))
    .bind(delivery)
    .execute(&mut **tx)
    .await?;
    Ok(())
}

/// How long a delivery waits after so many attempts and one more.
fn wait_after(attempts: u32) -> Duration {
    FIRST_WAIT
        .saturating_mul(1 << attempts.min(20))
        .min(LONGEST_WAIT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delivery_is_tried_often_at_first_and_for_three_days() {
        let waits = (0..).map(wait_after);
        let mut tried = Duration::ZERO;
        let attempts = waits.take_while(|wait| {
            let goes_on = tried < TRIED_FOR;
            tried += *wait;
            goes_on
        });
        let attempts: Vec<u64> = attempts.map(|wait| wait.as_secs()).collect();
        assert_eq!(attempts[..4], [5, 10, 20, 40]);
        assert_eq!(*attempts.last().expect("some"), 6 * 3600);
        assert_eq!(attempts.len(), 24);
    }
}
