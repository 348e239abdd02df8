//! The chain of the audit log: each entry carries a digest of itself and of the entry before it.
//!
//! The digest is SHA-256 over a JSON object of one line with the fields of [`ChainedEntry`] in their order, after
//! `previous`, the digest of the entry before: 64 hexadecimal digits, or an empty text before the first entry.
//! Whoever changes, inserts or removes an entry has to write all later digests anew, and the last of them, the head,
//! is no longer the head that was seen before. The chain has no secret, so the head is to be kept elsewhere, as it
//! is where `/metrics` is collected.
//!
//! The oldest entries of a log go. The digest of the newest entry that went is kept, and the chain goes on from it.
//! Entries from before there was a chain have no digest.

use serde::Serialize;
use sha2::{Digest, Sha256};
use sqlx::FromRow;

use crate::store::StoreError;
use crate::store::database::{self, Connection};

/// Entries that are read at once.
const ROWS_TOGETHER: i64 = 1000;
/// Entries that a check names at the most.
const MOST_NAMED: usize = 100;

/// The content of an entry, all of which its digest covers.
#[derive(Clone, Debug, FromRow, Serialize)]
pub(super) struct ChainedEntry {
    pub(super) at: String,
    pub(super) who: String,
    pub(super) project: Option<String>,
    pub(super) address: String,
    pub(super) method: String,
    pub(super) path: String,
    pub(super) status: i64,
    pub(super) request_id: String,
    pub(super) left_out: i64,
    pub(super) lost_from: Option<String>,
    pub(super) lost_to: Option<String>,
    pub(super) lost_up_to: Option<i64>,
}

/// The last entry of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditHead {
    /// The number of the entry.
    pub entry: i64,
    /// The digest of the entry, in hexadecimal digits.
    pub chain: String,
}

/// An entry as it is stored.
#[derive(FromRow)]
struct StoredEntry {
    id: i64,
    chain: Option<String>,
    #[sqlx(flatten)]
    content: ChainedEntry,
}

/// The findings of a check of the chain.
#[derive(Debug, Default)]
pub(in crate::store) struct CheckedChain {
    /// Each break of the chain, in a sentence.
    pub(in crate::store) findings: Vec<String>,
    /// The last entry; nothing where no entry has a digest.
    pub(in crate::store) head: Option<AuditHead>,
    /// Entries from before there was a chain.
    pub(in crate::store) unchained: u64,
}

impl ChainedEntry {
    /// The digest of the entry after an entry with the digest `previous`.
    fn digest_after(&self, previous: &str) -> String {
        #[derive(Serialize)]
        struct Link<'a> {
            previous: &'a str,
            #[serde(flatten)]
            content: &'a ChainedEntry,
        }
        let link = Link {
            previous,
            content: self,
        };
        let text = serde_json::to_string(&link).expect("an entry has only text keys");
        hex::encode(Sha256::digest(text))
    }

    /// Appends the entry to the log, in the transaction of `tx`.
    pub(super) async fn append(self, tx: &mut Connection) -> Result<(), StoreError> {
        let previous = match last(tx).await? {
            Some((_, chain)) => chain,
            None => anchor(tx).await?,
        };
        let chain = self.digest_after(previous.as_deref().unwrap_or_default());
        database::query(
            "insert into audit (at, who, project, address, method, path, status, request_id, left_out, \
             lost_from, lost_to, lost_up_to, chain) \
             values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)",
        )
        .bind(self.at)
        .bind(self.who)
        .bind(self.project)
        .bind(self.address)
        .bind(self.method)
        .bind(self.path)
        .bind(self.status)
        .bind(self.request_id)
        .bind(self.left_out)
        .bind(self.lost_from)
        .bind(self.lost_to)
        .bind(self.lost_up_to)
        .bind(chain)
        .execute(tx)
        .await?;
        Ok(())
    }
}

/// The number and the digest of the last entry; nothing of an empty log.
async fn last(connection: &mut Connection) -> Result<Option<(i64, Option<String>)>, sqlx::Error> {
    database::query_as("select id, chain from audit order by id desc limit 1")
        .fetch_optional(connection)
        .await
}

/// The digest of the newest entry that went.
async fn anchor(connection: &mut Connection) -> Result<Option<String>, sqlx::Error> {
    let chain: Option<Option<String>> = database::query_scalar("select chain from audit_anchor")
        .fetch_optional(connection)
        .await?;
    Ok(chain.flatten())
}

/// The head of the log; nothing where no entry has a digest.
pub(in crate::store) async fn head(
    connection: &mut Connection,
) -> Result<Option<AuditHead>, sqlx::Error> {
    let last = last(connection).await?;
    Ok(last.and_then(|(entry, chain)| chain.map(|chain| AuditHead { entry, chain })))
}

/// Lets the entries up to a number go, and keeps the digest of the last of them. Says how many went.
pub(in crate::store) async fn forget(tx: &mut Connection, up_to: i64) -> Result<u64, StoreError> {
    database::query("delete from audit_anchor where exists (select 1 from audit where id <= $1)")
        .bind(up_to)
        .execute(&mut *tx)
        .await?;
    database::query(
        "insert into audit_anchor (id, entry, chain) \
         select 1, id, chain from audit where id <= $1 order by id desc limit 1",
    )
    .bind(up_to)
    .execute(&mut *tx)
    .await?;
    let removed = database::query("delete from audit where id <= $1")
        .bind(up_to)
        .execute(tx)
        .await?;
    Ok(removed)
}

/// Looks at the whole chain, in a transaction that reads one state of the database.
pub(in crate::store) async fn check(tx: &mut Connection) -> Result<CheckedChain, StoreError> {
    let mut checked = CheckedChain::default();
    let mut previous = anchor(tx).await?;
    let mut after = i64::MIN;
    loop {
        let entries: Vec<StoredEntry> = database::query_as(
            "select id, chain, at, who, project, address, method, path, status, request_id, left_out, \
             lost_from, lost_to, lost_up_to from audit where id > $1 order by id limit $2",
        )
        .bind(after)
        .bind(ROWS_TOGETHER)
        .fetch_all(&mut *tx)
        .await?;
        let Some(newest) = entries.last() else {
            break;
        };
        after = newest.id;
        for entry in entries {
            checked.look_at(&entry, previous.as_deref());
            previous = entry.chain;
        }
    }
    checked.head = previous.map(|chain| AuditHead {
        entry: after,
        chain,
    });
    Ok(checked)
}

impl CheckedChain {
    fn look_at(&mut self, entry: &StoredEntry, previous: Option<&str>) {
        let finding = match (&entry.chain, previous) {
            (None, None) => {
                self.unchained += 1;
                return;
            }
            (None, Some(_)) => "has no digest, and the entry before it has one",
            (Some(chain), previous) => {
                if *chain == entry.content.digest_after(previous.unwrap_or_default()) {
                    return;
                }
                "is not what was written, or is not after the entry that was before it"
            }
        };
        if self.findings.len() < MOST_NAMED {
            let finding = format!("entry {} of the audit log {finding}", entry.id);
            self.findings.push(finding);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The digest is that of `sha256sum` over the documented text, so that others can compute it.
    #[test]
    fn a_digest_is_that_of_one_line_of_json() {
        let entry = ChainedEntry {
            at: "2026-03-02T08:15:00Z".to_owned(),
            who: "token mes".to_owned(),
            project: Some("hall-2".to_owned()),
            address: "10.0.0.1".to_owned(),
            method: "POST".to_owned(),
            path: "/v1/jobs".to_owned(),
            status: 202,
            request_id: "r-1".to_owned(),
            left_out: 0,
            lost_from: None,
            lost_to: None,
            lost_up_to: None,
        };
        let text = r#"{"previous":"","at":"2026-03-02T08:15:00Z","who":"token mes","project":"hall-2","address":"10.0.0.1","method":"POST","path":"/v1/jobs","status":202,"request_id":"r-1","left_out":0,"lost_from":null,"lost_to":null,"lost_up_to":null}"#;
        let expected = hex::encode(Sha256::digest(text));
        assert_eq!(entry.digest_after(""), expected);
        assert_ne!(entry.digest_after(&expected), expected);
    }
}
