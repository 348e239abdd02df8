//! Sessions of people at the page: begun with a token, whose end is theirs too, or at the identity provider.

use std::sync::Arc;

use jiff::Timestamp;
use sqlx::FromRow;

use super::columns::{from_json, json, time};
use super::database::QueryBuilder;
use super::sealed::SESSIONS;
use super::shared_database::Database;
use super::tokens::{self, TokenRow};
use super::writer::in_transaction;
use super::{StoreError, corrupt, database};
use crate::access::Digest;

/// Sessions of one token or one person that are kept; one more takes the place of the oldest.
const MOST_OF_A_HOLDER: i64 = 100;

/// Who begins a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NewHolder {
    /// Whoever has the token of a number.
    Token(i64),
    /// A person whom the identity provider knows.
    Person(PersonRow),
}

/// A person whom the identity provider knows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PersonRow {
    /// The name of the person.
    pub name: String,
    /// The groups that the person was in when the session began.
    pub groups: Vec<String>,
}

/// Whose session it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SessionHolder {
    /// A token, valid or not, which ends when the session does.
    Token(TokenRow),
    /// A person.
    Person {
        /// The person.
        person: PersonRow,
        /// When the session ends.
        expires_at: Timestamp,
    },
}

#[derive(FromRow)]
struct SessionColumns {
    token: Option<i64>,
    person: Option<String>,
    in_groups: Option<String>,
    expires_at: String,
}

/// Sessions of people at the page.
#[derive(Clone)]
pub struct Sessions {
    pub(super) database: Arc<Database>,
}

impl Sessions {
    /// Begins a session; those that are over go.
    pub async fn begin(
        &self,
        holder: NewHolder,
        digest: Digest,
        expires_at: Timestamp,
    ) -> Result<(), StoreError> {
        let now = Timestamp::now().to_string();
        let (token, person) = match holder {
            NewHolder::Token(token) => (Some(token), None),
            NewHolder::Person(person) => (None, Some(person)),
        };
        let groups = person.as_ref().map(|person| json(&person.groups));
        let name = person.map(|person| person.name);
        in_transaction!(self.database, |tx| async move {
            database::query(
                "delete from sessions where expires_at < $1 or digest in \
                         (select digest from sessions where token = $2 or person = $3 \
                          order by created_at desc limit 9223372036854775807 offset $4)",
            )
            .bind(&now)
            .bind(token)
            .bind(name.clone())
            .bind(MOST_OF_A_HOLDER - 1)
            .execute(&mut **tx)
            .await?;
            database::query(
                "insert into sessions (digest, token, person, in_groups, created_at, expires_at) \
                         values ($1, $2, $3, $4, $5, $6)",
            )
            .bind(digest.as_str())
            .bind(token)
            .bind(name)
            .bind(groups)
            .bind(&now)
            .bind(expires_at.to_string())
            .execute(&mut **tx)
            .await?;
            Ok(())
        })
        .await
    }

    /// Whose session it is; nothing where there is none, or where its token is gone.
    pub async fn find(&self, digest: &Digest) -> Result<Option<SessionHolder>, StoreError> {
        let mut select = SESSIONS.select();
        select
            .push("sessions where digest = ")
            .push_bind(digest.as_str());
        let row = select
            .build()
            .fetch_optional(&self.database.readers)
            .await?;
        let Some(row) = row else {
            return Ok(None);
        };
        SESSIONS.verify(&row)?;
        let session: SessionColumns = row.read()?;
        let of = digest.as_str();
        let expires_at = time(of, &session.expires_at)?;
        match session {
            SessionColumns {
                token: Some(token), ..
            } => self.of_token(token, expires_at).await,
            SessionColumns {
                person: Some(name),
                in_groups: Some(groups),
                ..
            } => {
                let groups = from_json("in_groups", of, &groups)?;
                let person = PersonRow { name, groups };
                Ok(Some(SessionHolder::Person { person, expires_at }))
            }
            _ => Err(corrupt("session", of, "it is of nobody")),
        }
    }

    async fn of_token(
        &self,
        token: i64,
        ends: Timestamp,
    ) -> Result<Option<SessionHolder>, StoreError> {
        let mut query = QueryBuilder::new(tokens::SELECT);
        query.push(" where id = ").push_bind(token);
        let row = query.build().fetch_optional(&self.database.readers).await?;
        let Some(row) = row.as_ref().map(tokens::read).transpose()? else {
            return Ok(None);
        };
        let expires_at = Some(row.expires_at.map_or(ends, |end| end.min(ends)));
        Ok(Some(SessionHolder::Token(TokenRow { expires_at, ..row })))
    }

    /// Ends a session.
    pub async fn end(&self, digest: Digest) -> Result<(), StoreError> {
        in_transaction!(self.database, |tx| async move {
            database::query("delete from sessions where digest = $1")
                .bind(digest.as_str())
                .execute(&mut **tx)
                .await?;
            Ok(())
        })
        .await
    }
}
