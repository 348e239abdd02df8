//! Looks at all sealed rows of a database, and seals those from before there were seals.

use futures_util::TryStreamExt;
use sqlx::postgres::PgConnectOptions;

use super::{Sealed, TABLES};
use crate::store::database::postgres::Use;
use crate::store::database::{Connection, Losses, Pool, QueryBuilder, Row, Value, query_scalar};
use crate::store::{AuditHead, StoreError, audit, schema_version};

/// Damaged rows that are named; the others are counted.
const MOST_NAMED: usize = 100;
/// Rows that are sealed in one transaction.
const ROWS_TOGETHER: i64 = 500;

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
    for table in TABLES {
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
    checked.audit_head = chain.head;
    checked.unchained = chain.unchained;
    Ok(())
}

/// Seals all rows that have no seal; answers how many.
pub(in crate::store) async fn seal_all(pool: &Pool) -> Result<u64, StoreError> {
    let mut sealed = 0;
    for table in TABLES {
        let mut after = Vec::new();
        loop {
            let mut tx = pool.begin_write_in_turn().await?;
            let rows = table.unsealed(&mut tx, &after).await?;
            for row in &rows {
                table.seal_row(&mut tx, row).await?;
            }
            tx.commit().await?;
            sealed += rows.len() as u64;
            match rows.last() {
                Some(last) => after = table.key_of(last)?,
                None => break,
            }
        }
    }
    Ok(sealed)
}

impl Sealed {
    /// A statement up to the name of its table that reads what a seal covers.
    fn select(&self) -> QueryBuilder {
        let mut select = QueryBuilder::new("select ");
        for column in self.columns() {
            select.push(format_args!("\"{}\", ", column.name()));
        }
        select.push("seal from ");
        select
    }

    /// Some of the rows that have no seal, in the order of the key, after the row with one.
    async fn unsealed(&self, tx: &mut Connection, after: &[Value]) -> Result<Vec<Row>, StoreError> {
        let key: Vec<&str> = self.key.iter().map(|column| column.name()).collect();
        let key = key.join(", ");
        let mut select = self.select();
        select.push(self.table).push(" where seal is null");
        if !after.is_empty() {
            select.push(format_args!(" and ({key}) > ("));
            let mut values = select.separated(", ");
            for value in after {
                values.push_bind(value.clone());
            }
            select.push(")");
        }
        select.push(format_args!(" order by {key} limit "));
        select.push_bind(ROWS_TOGETHER);
        Ok(select.build().fetch_all(tx).await?)
    }

    fn key_of(&self, row: &Row) -> Result<Vec<Value>, sqlx::Error> {
        self.key.iter().map(|column| column.value(row)).collect()
    }

    async fn seal_row(&self, tx: &mut Connection, row: &Row) -> Result<(), StoreError> {
        let mut update = QueryBuilder::new("update ");
        update.push(self.table).push(" set seal = ");
        update.push_bind(self.seal_of(row)?);
        for (place, (column, value)) in self.key.iter().zip(self.key_of(row)?).enumerate() {
            let between = if place == 0 { "where" } else { "and" };
            update.push(format_args!(" {between} {} = ", column.name()));
            update.push_bind(value);
        }
        update.build().execute(tx).await?;
        Ok(())
    }
}
