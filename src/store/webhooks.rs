//! Webhooks: the places that events are delivered to.

use std::sync::Arc;

use jiff::Timestamp;
use sqlx::FromRow;

use super::columns::{self, from_json, project, time};
use super::database::{self, QueryBuilder};
use super::shared_database::Database;
use super::writer::in_transaction;
use super::{StoreError, corrupt};
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

impl WebhookColumns {
    fn read(self) -> Result<WebhookRow, StoreError> {
        let of = &self.id;
        Ok(WebhookRow {
            project: project(of, &self.project)?,
            events: from_json("events", of, &self.events)?,
            created_at: time(of, &self.created_at)?,
            id: of.parse().map_err(|why| corrupt("identifier", of, why))?,
            url: self.url,
            secret: self.secret,
        })
    }
}

const WEBHOOK: &str = "select id, project, url, events, secret, created_at from webhooks";

/// Places that events are delivered to.
#[derive(Clone)]
pub struct Webhooks {
    pub(super) database: Arc<Database>,
}

impl Webhooks {
    /// Stores a place that events are delivered to. Says whether the place was stored: not where its project has
    /// [`MAX_WEBHOOKS`] already.
    pub async fn insert(&self, new: WebhookRow) -> Result<bool, StoreError> {
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
            .bind(new.id.to_string())
            .bind(new.project.as_str())
            .bind(new.url)
            .bind(columns::json(&new.events))
            .bind(new.secret)
            .bind(new.created_at.to_string())
            .execute(&mut **tx)
            .await?;
            Ok(true)
        })
        .await
    }

    /// The places of a project, the oldest first.
    pub async fn list(&self, project: &Project) -> Result<Vec<WebhookRow>, StoreError> {
        let mut query = QueryBuilder::new(WEBHOOK);
        query.push(" where project = ").push_bind(project.as_str());
        query.push(" order by id");
        let rows: Vec<WebhookColumns> = query
            .build_query_as()
            .fetch_all(&self.database.readers)
            .await?;
        rows.into_iter().map(WebhookColumns::read).collect()
    }

    /// A place, if there is one.
    pub async fn find(&self, id: WebhookId) -> Result<Option<WebhookRow>, StoreError> {
        let mut query = QueryBuilder::new(WEBHOOK);
        query.push(" where id = ").push_bind(id.to_string());
        let row: Option<WebhookColumns> = query
            .build_query_as()
            .fetch_optional(&self.database.readers)
            .await?;
        row.map(WebhookColumns::read).transpose()
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
