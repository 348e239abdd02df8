//! Tokens: made, listed and revoked on the database itself, whether a server works with it or not.

use std::sync::Arc;

use jiff::Timestamp;

use super::columns::{from_json, json, project, time};
use super::database::postgres::Use;
use super::database::{self, Losses, Pool, QueryBuilder, Row, sqlite};
use super::opening::{Opened, PATIENCE_OF_A_COMMAND};
use super::sealed::changes::seal_changed;
use super::sealed::{TOKEN_STATES, TOKENS};
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

/// A statement up to its condition that reads tokens.
pub(super) const SELECT: &str = "select id, name, digest, scope, streams, project, created_at, expires_at, \
                                 revoked_at, last_used_at, seal, state_seal from tokens";

/// A token of its row.
pub(super) fn read(row: &Row) -> Result<TokenRow, StoreError> {
    TOKENS.verify(row)?;
    TOKEN_STATES.verify(row)?;
    let of: &str = row.try_get("name")?;
    let optional = |column: &str| {
        let at: Option<&str> = row.try_get(column)?;
        at.map(|at| time(of, at)).transpose()
    };
    let scope: &str = row.try_get("scope")?;
    let scope: Scope = scope.parse().map_err(|why| corrupt("scope", of, why))?;
    let streams: Option<&str> = row.try_get("streams")?;
    let streams = streams.map(|names| from_json("streams", of, names));
    let streams: Option<StreamNames> = streams.transpose()?;
    if streams.is_some() != (scope == Scope::Append) {
        let why = format!("the scope is `{scope}`");
        return Err(corrupt("streams", of, why));
    }
    Ok(TokenRow {
        id: row.try_get("id")?,
        scope,
        streams,
        project: project(of, row.try_get("project")?)?,
        created_at: time(of, row.try_get("created_at")?)?,
        expires_at: optional("expires_at")?,
        revoked_at: optional("revoked_at")?,
        last_used_at: optional("last_used_at")?,
        name: of.to_owned(),
    })
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
        let mut query = QueryBuilder::new(SELECT);
        query.push(" where digest = ").push_bind(digest.as_str());
        let row = query.build().fetch_optional(&self.database.readers).await?;
        row.as_ref().map(read).transpose()
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
    let streams = new.streams.as_ref().map(json);
    let created_at = Timestamp::now().to_string();
    let expires_at = new.expires_at.map(|at| at.to_string());
    let seal = TOKENS.seal(&[
        new.digest.as_str().into(),
        (&new.name).into(),
        new.scope.as_str().into(),
        (&streams).into(),
        new.project.as_str().into(),
        (&created_at).into(),
        (&expires_at).into(),
    ]);
    let made = database::query(
        "insert into tokens (name, digest, scope, streams, project, created_at, expires_at, seal) \
         values ($1, $2, $3, $4, $5, $6, $7, $8) on conflict do nothing",
    )
    .bind(&new.name)
    .bind(new.digest.as_str())
    .bind(new.scope.as_str())
    .bind(&streams)
    .bind(new.project.as_str())
    .bind(&created_at)
    .bind(&expires_at)
    .bind(seal)
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
    seal_changed(&mut tx).await?;
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
    let mut query = QueryBuilder::new(SELECT);
    query.push(" order by id");
    let rows = query.build().fetch_all(&connection).await;
    connection.close().await;
    rows?.iter().map(read).collect()
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
    seal_changed(&mut tx).await?;
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
