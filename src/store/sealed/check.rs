//! Looks at all sealed rows of a database, and seals those from before there were seals.

use futures_util::TryStreamExt;
use sqlx::postgres::PgConnectOptions;

use super::kinds::sealed_tables;
use crate::store::database::postgres::Use;
use crate::store::database::{Losses, Pool, query_scalar};
use crate::store::{AuditHead, StoreError, audit, derived, schema_version};

/// Damaged rows that are named; the others are counted.
const MOST_NAMED: usize = 100;

/// The outcome of a check of a database.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// All that is wrong, in sentences; nothing where the database is sound.
    pub findings: Vec<String>,
    /// Rows from before there were seals: nothing says whether they are what was written.
    pub unsealed: u64,
    /// The last entry of the audit log; nothing where no entry has a digest.
    pub audit_head: Option<AuditHead>,
    /// Entries of the audit log from before its entries were a chain.
    pub unchained: u64,
}

/// Looks at all sealed rows of a PostgreSQL, with which servers may work. The rest of such a database is
/// checked by its own tools.
///
/// # Errors
/// The database does not answer or has another schema.
pub async fn check_postgres(options: &PgConnectOptions) -> Result<Checked, StoreError> {
    let pool = Pool::of_postgres(options, 1, Use::Copies, &Losses::default()).await?;
    let checked = check_schema_and_rows(&pool).await;
    pool.close().await;
    checked
}

async fn check_schema_and_rows(pool: &Pool) -> Result<Checked, StoreError> {
    let mut checked = Checked::default();
    let newest: Option<i64> = query_scalar("select max(version) from _sqlx_migrations")
        .fetch_one(pool)
        .await?;
    if newest == Some(schema_version()) {
        look(pool, &mut checked).await?;
    } else {
        let newest = newest.unwrap_or(0);
        let expected = schema_version();
        let finding =
            format!("its schema is {newest}, and this program looks at that of {expected}");
        checked.findings.push(finding);
    }
    Ok(checked)
}

/// Seals all rows of a PostgreSQL that have no seal, while servers may work with it; answers how many.
///
/// # Errors
/// The database does not answer, or a row cannot be read.
pub async fn seal_postgres(options: &PgConnectOptions) -> Result<u64, StoreError> {
    let pool = Pool::of_postgres(options, 1, Use::Copies, &Losses::default()).await?;
    let sealed = seal_all(&pool).await;
    pool.close().await;
    sealed
}

/// Looks at all sealed rows, and at the chain of the audit log.
pub(in crate::store) async fn look(pool: &Pool, checked: &mut Checked) -> Result<(), StoreError> {
    let mut more = 0_u64;
    for table in sealed_tables() {
        let mut select = table.select();
        select.push(table.table);
        let mut rows = select.build().fetch(pool);
        while let Some(row) = rows.try_next().await? {
            match table.verify(&row) {
                Ok(true) => {}
                Ok(false) => checked.unsealed += 1,
                Err(damage) if checked.findings.len() < MOST_NAMED => {
                    checked.findings.push(damage.to_string());
                }
                Err(_) => more += 1,
            }
        }
    }
    if more > 0 {
        let finding = format!("{more} more rows are damaged");
        checked.findings.push(finding);
    }
    let mut tx = pool.begin_read().await?;
    let chain = audit::chain::check(&mut tx).await?;
    tx.commit().await?;
    checked.findings.extend(chain.findings);
    let mut tx = pool.begin_read().await?;
    if let Err(error) = derived::look(&mut tx, &mut checked.findings).await {
        let finding = format!("what follows from other rows cannot be looked at: {error}");
        checked.findings.push(finding);
    }
    checked.audit_head = chain.head;
    checked.unchained = chain.unchained;
    Ok(())
}

/// Seals all rows that have no seal; answers how many.
pub(in crate::store) async fn seal_all(pool: &Pool) -> Result<u64, StoreError> {
    let mut sealed = 0;
    for table in sealed_tables() {
        let mut after = Vec::new();
        loop {
            let mut tx = pool.begin_write_in_turn().await?;
            let rows = table.unsealed(&mut tx, &after).await?;
            sealed += table.seal_rows(&mut tx, &rows).await?;
            tx.commit().await?;
            match rows.last() {
                Some(last) => after = table.key_of(last)?,
                None => break,
            }
        }
    }
    Ok(sealed)
}
