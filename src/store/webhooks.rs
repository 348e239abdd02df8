//! Webhooks: the places that events are delivered to.

use std::sync::Arc;

use jiff::Timestamp;
use sqlx::FromRow;

use super::columns::{self, from_json, project, time};
use super::database::{self, QueryBuilder, Row};
use super::sealed::WEBHOOKS;
use super::shared_database::Database;
use super::writer::in_transaction;
use super::{SecretKeys, StoreError, corrupt};
use crate::access::Project;
use crate::job::WebhookId;

/// Webhooks that a project can have.
pub const MAX_WEBHOOKS: i64 = 50;

/// A place that events are delivered to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WebhookRow {
    /// The identifier of the webhook.
    pub id: WebhookId,
    /// The project whose events go to the webhook.
    pub project: Project,
    /// The address.
    pub url: String,
    /// The types of events that are sent to the webhook.
    pub events: Vec<String>,
    /// What deliveries are signed with.
    pub secret: String,
    /// When the webhook was made.
    pub created_at: Timestamp,
}

#[derive(FromRow)]
struct WebhookColumns {
    id: String,
    project: String,
    url: String,
    events: String,
    secret: String,
    created_at: String,
}

/// A statement up to its condition that reads webhooks.
fn select() -> QueryBuilder {
    let mut select = WEBHOOKS.select();
    select.push("webhooks");
    select
}

impl WebhookColumns {
    fn of(row: &Row) -> Result<Self, StoreError> {
        WEBHOOKS.verify(row)?;
        Ok(row.read()?)
    }

    fn read(self, keys: &SecretKeys) -> Result<WebhookRow, StoreError> {
        let of = &self.id;
        Ok(WebhookRow {
            url: keys.decrypt(&place_of_url(of), &self.url)?,
            secret: keys.decrypt(&place_of_secret(of), &self.secret)?,
            project: project(of, &self.project)?,
            events: from_json("events", of, &self.events)?,
            created_at: time(of, &self.created_at)?,
            id: of.parse().map_err(|why| corrupt("identifier", of, why))?,
        })
    }
}

/// The place of a webhook's secret, for the key.
fn place_of_secret(id: &str) -> String {
    format!("the secret of the webhook {id}")
}

/// The place of a webhook's address, for the key: what its query holds may be a secret of the receiver.
fn place_of_url(id: &str) -> String {
    format!("the address of the webhook {id}")
}

/// Places that events are delivered to.
#[derive(Clone)]
pub struct Webhooks {
    pub(super) database: Arc<Database>,
}

impl Webhooks {
    /// Stores a place that events are delivered to. Says whether the place was stored: not where its project has
    /// [`MAX_WEBHOOKS`] already.
    pub async fn insert(&self, new: WebhookRow) -> Result<bool, StoreError> {
        let (id, keys) = (new.id.to_string(), &self.database.keys);
        let url = keys.encrypt(&place_of_url(&id), &new.url)?;
        let secret = keys.encrypt(&place_of_secret(&id), &new.secret)?;
        in_transaction!(self.database, |tx| async move {
            let webhooks: i64 =
                database::query_scalar("select count(*) from webhooks where project = $1")
                    .bind(new.project.as_str())
                    .fetch_one(&mut **tx)
                    .await?;
            if webhooks >= MAX_WEBHOOKS {
                return Ok(false);
            }
            database::query(
                "insert into webhooks (id, project, url, events, secret, created_at) \
                         values ($1, $2, $3, $4, $5, $6)",
            )
            .bind(id)
            .bind(new.project.as_str())
            .bind(url)
            .bind(columns::json(&new.events))
            .bind(secret)
            .bind(new.created_at.to_string())
            .execute(&mut **tx)
            .await?;
            Ok(true)
        })
        .await
    }

    /// The places of a project, the oldest first.
    pub async fn list(&self, project: &Project) -> Result<Vec<WebhookRow>, StoreError> {
        let mut query = select();
        query.push(" where project = ").push_bind(project.as_str());
        query.push(" order by id");
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let keys = &self.database.keys;
        let rows = rows.iter();
        rows.map(|row| WebhookColumns::of(row)?.read(keys))
            .collect()
    }

    /// A place, if there is one.
    pub async fn find(&self, id: WebhookId) -> Result<Option<WebhookRow>, StoreError> {
        let mut query = select();
        query.push(" where id = ").push_bind(id.to_string());
        let row = query.build().fetch_optional(&self.database.readers).await?;
        let keys = &self.database.keys;
        row.map(|row| WebhookColumns::of(&row)?.read(keys))
            .transpose()
    }

    /// Encrypts what is stored as it is or under an older key, where the server has keys.
    ///
    /// # Errors
    /// Something is encrypted under a key that the server does not have.
    pub(super) async fn encrypt_anew(&self) -> Result<(), StoreError> {
        let rows = select().build().fetch_all(&self.database.readers).await?;
        let keys = &self.database.keys;
        for row in rows {
            let row = match WebhookColumns::of(&row) {
                Err(error) if error.corrupt_row().is_some() => {
                    tracing::error!(%error, "a webhook stays as it is stored");
                    continue;
                }
                row => row?,
            };
            let is_current = keys.is_current(&row.url) && keys.is_current(&row.secret);
            let (old_url, old_secret) = (row.url.clone(), row.secret.clone());
            let WebhookRow {
                id, url, secret, ..
            } = row.read(keys)?;
            if is_current {
                continue;
            }
            let id = id.to_string();
            let url = keys.encrypt(&place_of_url(&id), &url)?;
            let secret = keys.encrypt(&place_of_secret(&id), &secret)?;
            in_transaction!(self.database, |tx| async move {
                // Another node may have done the same meanwhile.
                database::query(
                    "update webhooks set url = $1, secret = $2 \
                             where id = $3 and url = $4 and secret = $5",
                )
                .bind(url)
                .bind(secret)
                .bind(id)
                .bind(old_url)
                .bind(old_secret)
                .execute(&mut **tx)
                .await?;
                Ok(())
            })
            .await?;
        }
        Ok(())
    }

    /// Forgets a place and what is on its way there. Says whether there was one.
    pub async fn delete(&self, id: WebhookId) -> Result<bool, StoreError> {
        in_transaction!(self.database, |tx| async move {
            let removed = database::query("delete from webhooks where id = $1")
                .bind(id.to_string())
                .execute(&mut **tx)
                .await?;
            Ok(removed == 1)
        })
        .await
    }
}
