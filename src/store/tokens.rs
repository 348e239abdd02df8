//! Tokens: made, listed and revoked on the database itself, whether a server works with it or not.

use std::sync::Arc;

use jiff::Timestamp;
use sqlx::FromRow;

use super::columns::{from_json, json, project, time};
use super::database::postgres::Use;
use super::database::{self, Losses, Pool, sqlite};
use super::opening::{Opened, PATIENCE_OF_A_COMMAND};
use super::shared_database::Database;
use super::writer::in_transaction;
use super::{
    AuditEntry, DatabasePlace, DatabaseSettings, StoreError, audit, corrupt, schema_version,
};
use crate::access::{BELIEVED, Digest, Project, Scope, StreamNames};

/// A token to be made.
#[derive(Clone, Debug)]
pub struct NewToken {
    /// The name; no other token that is not revoked has the name.
    pub name: String,
    /// The digest of the secret.
    pub digest: Digest,
    /// How much the token allows.
    pub scope: Scope,
    /// The streams that a token with the scope `append` appends to; none of another.
    pub streams: Option<StreamNames>,
    /// The project that the token gives access to.
    pub project: Project,
    /// When the token expires.
    pub expires_at: Option<Timestamp>,
}

/// A token as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TokenRow {
    /// The number of the token.
    pub id: i64,
    /// The name of the token.
    pub name: String,
    /// How much the token allows.
    pub scope: Scope,
    /// The streams that a token with the scope `append` appends to; none of another.
    pub streams: Option<StreamNames>,
    /// The project that the token gives access to.
    pub project: Project,
    /// When the token was made.
    pub created_at: Timestamp,
    /// When the token expires.
    pub expires_at: Option<Timestamp>,
    /// When the token was revoked.
    pub revoked_at: Option<Timestamp>,
    /// When the token was used last, to the minute.
    pub last_used_at: Option<Timestamp>,
}

impl TokenRow {
    /// Whether the token is neither revoked nor expired.
    #[must_use]
    pub fn is_valid_at(&self, now: Timestamp) -> bool {
        self.revoked_at.is_none() && self.expires_at.is_none_or(|end| now < end)
    }
}

#[derive(FromRow)]
pub(super) struct TokenColumns {
    id: i64,
    name: String,
    scope: String,
    streams: Option<String>,
    project: String,
    created_at: String,
    expires_at: Option<String>,
    revoked_at: Option<String>,
    last_used_at: Option<String>,
}

impl TokenColumns {
    pub(super) fn read(self) -> Result<TokenRow, StoreError> {
        let of = &self.name;
        let optional = |at: Option<String>| at.map(|at| time(of, &at)).transpose();
        let scope: Scope = self
            .scope
            .parse()
            .map_err(|why| corrupt("scope", of, why))?;
        let streams = self.streams.as_deref();
        let streams = streams.map(|names| from_json("streams", of, names));
        let streams: Option<StreamNames> = streams.transpose()?;
        if streams.is_some() != (scope == Scope::Append) {
            let why = format!("the scope is `{scope}`");
            return Err(corrupt("streams", of, why));
        }
        Ok(TokenRow {
            id: self.id,
            scope,
            streams,
            project: project(of, &self.project)?,
            created_at: time(of, &self.created_at)?,
            expires_at: optional(self.expires_at)?,
            revoked_at: optional(self.revoked_at)?,
            last_used_at: optional(self.last_used_at)?,
            name: self.name,
        })
    }
}

/// Tokens as a server asks for them.
#[derive(Clone)]
pub struct Tokens {
    pub(super) database: Arc<Database>,
}

impl Tokens {
    /// Whether a token was ever made: from then on everybody is asked for one, also when none is
    /// valid any more.
    pub async fn exist(&self) -> Result<bool, StoreError> {
        Ok(
            database::query_scalar("select exists (select 1 from tokens)")
                .fetch_one(&self.database.readers)
                .await?,
        )
    }

    /// The token of a secret, valid or not.
    pub async fn find(&self, digest: &Digest) -> Result<Option<TokenRow>, StoreError> {
        let row: Option<TokenColumns> = database::query_as(
            "select id, name, scope, streams, project, created_at, expires_at, revoked_at, \
             last_used_at from tokens where digest = $1",
        )
        .bind(digest.as_str())
        .fetch_optional(&self.database.readers)
        .await?;
        row.map(TokenColumns::read).transpose()
    }

    /// Notes that a token was used now.
    pub async fn note_use(&self, token: i64) -> Result<(), StoreError> {
        in_transaction!(self.database, |tx| async move {
            database::query("update tokens set last_used_at = $1 where id = $2")
                .bind(Timestamp::now().to_string())
                .bind(token)
                .execute(&mut **tx)
                .await?;
            Ok(())
        })
        .await
    }
}

/// Makes a token, and enters that into the audit log. Says whether the token was made: not where its name is taken.
///
/// # Errors
/// The database cannot be opened or written.
pub async fn create(database: &DatabasePlace, new: NewToken) -> Result<bool, StoreError> {
    let connection = open(database).await?;
    let mut tx = connection.begin_write_in_turn().await?;
    let made = database::query(
        "insert into tokens (name, digest, scope, streams, project, created_at, expires_at) \
         values ($1, $2, $3, $4, $5, $6, $7) on conflict do nothing",
    )
    .bind(&new.name)
    .bind(new.digest.as_str())
    .bind(new.scope.as_str())
    .bind(new.streams.as_ref().map(json))
    .bind(new.project.as_str())
    .bind(Timestamp::now().to_string())
    .bind(new.expires_at.map(|at| at.to_string()))
    .execute(&mut tx)
    .await?;
    if made == 1 {
        let NewToken {
            name,
            scope,
            streams,
            project,
            ..
        } = new;
        let streams = streams.map_or_else(String::new, |names| format!(" --streams {names}"));
        let command =
            format!("token create --name {name} --scope {scope}{streams} --project {project}");
        audit::add(&mut tx, AuditEntry::of_command(command, Some(project))).await?;
    }
    tx.commit().await?;
    connection.close().await;
    Ok(made == 1)
}

/// All tokens, the newest last.
///
/// # Errors
/// The database cannot be opened or read.
pub async fn list(database: &DatabasePlace) -> Result<Vec<TokenRow>, StoreError> {
    let connection = open(database).await?;
    let rows: Vec<TokenColumns> = database::query_as(
        "select id, name, scope, streams, project, created_at, expires_at, revoked_at, \
         last_used_at from tokens order by id",
    )
    .fetch_all(&connection)
    .await?;
    connection.close().await;
    rows.into_iter().map(TokenColumns::read).collect()
}

/// Ends the token of a name, and enters that into the audit log. Says whether there was one. Returns when no server believes any more what it
/// read of the token before: no request that begins later passes with it.
///
/// # Errors
/// The database cannot be opened or written.
pub async fn revoke(database: &DatabasePlace, name: &str) -> Result<bool, StoreError> {
    let connection = open(database).await?;
    let mut tx = connection.begin_write_in_turn().await?;
    let revoked: Option<String> = database::query_scalar(
        "update tokens set revoked_at = $1 where name = $2 and revoked_at is null returning project",
    )
    .bind(Timestamp::now().to_string())
    .bind(name)
    .fetch_optional(&mut tx)
    .await?;
    if let Some(owner) = &revoked {
        let command = format!("token revoke {name}");
        let entry = AuditEntry::of_command(command, Some(project(name, owner)?));
        audit::add(&mut tx, entry).await?;
    }
    tx.commit().await?;
    connection.close().await;
    if revoked.is_some() {
        tokio::time::sleep(BELIEVED).await;
    }
    Ok(revoked.is_some())
}

/// A connection to a database that is there and up to date. One that no server works with is made
/// or brought up to date first; one that a server works with has that server's schema.
async fn open(place: &DatabasePlace) -> Result<Pool, StoreError> {
    let settings = DatabaseSettings::of_a_command(place);
    match Opened::open(&settings).await {
        Ok(opened) => opened.close().await,
        Err(StoreError::Locked { .. }) => {}
        Err(error) => return Err(error),
    }
    let connection = match place {
        DatabasePlace::File(path) => {
            Pool::Sqlite(sqlite::writer(path, PATIENCE_OF_A_COMMAND).await?)
        }
        DatabasePlace::Postgres(options) => {
            Pool::of_postgres(options, 1, Use::Writes, &Losses::default()).await?
        }
    };
    let newest: i64 = database::query_scalar("select max(version) from _sqlx_migrations")
        .fetch_one(&connection)
        .await?;
    if newest == schema_version() {
        return Ok(connection);
    }
    let why = format!(
        "the server has schema {newest}, this program {}",
        schema_version()
    );
    Err(corrupt("schema", place, why))
}
