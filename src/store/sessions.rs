//! Sessions of people at the page: begun with a token, whose end is theirs too.

use std::sync::Arc;

use jiff::Timestamp;

use super::columns::time;
use super::shared_database::Database;
use super::tokens::{TokenColumns, TokenRow};
use super::writer::in_transaction;
use super::{StoreError, database};
use crate::access::Digest;

/// Sessions of one token that are kept; one more takes the place of the oldest.
const MOST_OF_A_TOKEN: i64 = 100;

/// Sessions of people at the page.
#[derive(Clone)]
pub struct Sessions {
    pub(super) database: Arc<Database>,
}

impl Sessions {
    /// Begins a session of a token; those that are over go.
    pub async fn begin(
        &self,
        token: i64,
        digest: Digest,
        expires_at: Timestamp,
    ) -> Result<(), StoreError> {
        let now = Timestamp::now().to_string();
        in_transaction!(self.database, |tx| async move {
            database::query(
                "delete from sessions where expires_at < $1 or digest in \
                         (select digest from sessions where token = $2 \
                          order by created_at desc limit 9223372036854775807 offset $3)",
            )
            .bind(&now)
            .bind(token)
            .bind(MOST_OF_A_TOKEN - 1)
            .execute(&mut **tx)
            .await?;
            database::query(
                "insert into sessions (digest, token, created_at, expires_at) \
                         values ($1, $2, $3, $4)",
            )
            .bind(digest.as_str())
            .bind(token)
            .bind(&now)
            .bind(expires_at.to_string())
            .execute(&mut **tx)
            .await?;
            Ok(())
        })
        .await
    }

    /// The token of a session, valid or not. It ends when the session does.
    pub async fn find(&self, digest: &Digest) -> Result<Option<TokenRow>, StoreError> {
        let session: Option<(i64, String)> =
            database::query_as("select token, expires_at from sessions where digest = $1")
                .bind(digest.as_str())
                .fetch_optional(&self.database.readers)
                .await?;
        let Some((token, ends)) = session else {
            return Ok(None);
        };
        let row: Option<TokenColumns> = database::query_as(
            "select id, name, scope, streams, project, created_at, expires_at, revoked_at, \
             last_used_at from tokens where id = $1",
        )
        .bind(token)
        .fetch_optional(&self.database.readers)
        .await?;
        let Some(row) = row.map(TokenColumns::read).transpose()? else {
            return Ok(None);
        };
        let ends = time(&row.name, &ends)?;
        let expires_at = Some(row.expires_at.map_or(ends, |end| end.min(ends)));
        Ok(Some(TokenRow { expires_at, ..row }))
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
