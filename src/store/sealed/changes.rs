//! Seals rows at the end of the transaction that wrote them.
//!
//! A row that is new, and one that changes, has no seal: triggers of the database see to that. An index, which is
//! empty between transactions, holds the rows without a seal.

use super::kinds::CHANGING;
use super::seal::Sealed;
use crate::store::StoreError;
use crate::store::database::{Connection, QueryBuilder, Row, Value};

/// Rows of one table that are sealed with one statement. Rows from before there were seals are sealed with later
/// transactions, so many with each.
const ROWS_TOGETHER: i64 = 500;

/// Seals what a transaction wrote, before it is committed.
pub(in crate::store) async fn seal_changed(tx: &mut Connection) -> Result<(), StoreError> {
    for place in changed(tx).await? {
        let table = usize::try_from(place)
            .ok()
            .and_then(|place| CHANGING.get(place));
        if let Some(table) = table {
            let rows = table.unsealed(tx, &[]).await?;
            table.seal_rows(tx, &rows).await?;
        }
    }
    Ok(())
}

/// The places among [`CHANGING`] of the tables that have rows without a seal.
async fn changed(tx: &mut Connection) -> Result<Vec<i64>, StoreError> {
    let mut select = QueryBuilder::new("");
    for (place, Sealed { table, seal, .. }) in CHANGING.iter().enumerate() {
        let between = if place == 0 { "" } else { " union all " };
        select.push(format_args!(
            "{between}select cast({place} as bigint) where exists (select 1 from {table} where {seal} is null)"
        ));
    }
    Ok(select.build_query_scalar().fetch_all(tx).await?)
}

impl Sealed {
    /// Some of the rows that have no seal, in the order of the key, after the row with one.
    pub(super) async fn unsealed(
        &self,
        tx: &mut Connection,
        after: &[Value],
    ) -> Result<Vec<Row>, StoreError> {
        let key: Vec<&str> = self.key.iter().map(|column| column.name()).collect();
        let key = key.join(", ");
        let mut select = self.select();
        select.push(format_args!("{} where {} is null", self.table, self.seal));
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

    /// Seals rows as they are stored now; answers how many. A row that cannot be read stays without a seal.
    pub(in crate::store) async fn seal_rows(
        &self,
        tx: &mut Connection,
        rows: &[Row],
    ) -> Result<u64, StoreError> {
        let mut sealed = Vec::with_capacity(rows.len());
        for row in rows {
            if let Ok(seal) = self.seal_of(row) {
                sealed.push((self.key_of(row)?, seal));
            }
        }
        if sealed.is_empty() {
            return Ok(0);
        }
        let columns = self.key.len() + 1;
        let mut update = QueryBuilder::new("update ");
        update.push(format_args!(
            "{} set {} = sealed.column{columns} from (",
            self.table, self.seal
        ));
        update.push_values(&sealed, |mut row, (key, seal)| {
            for value in key {
                row.push_bind(value.clone());
            }
            row.push_bind(*seal);
        });
        update.push(") as sealed");
        for (place, column) in self.key.iter().enumerate() {
            let (and, name) = (if place == 0 { "where" } else { "and" }, column.name());
            let number = place + 1;
            update.push(format_args!(
                " {and} {}.\"{name}\" = sealed.column{number}",
                self.table
            ));
        }
        Ok(update.build().execute(tx).await?)
    }

    /// The key of a row.
    pub(super) fn key_of(&self, row: &Row) -> Result<Vec<Value>, sqlx::Error> {
        self.key.iter().map(|column| column.value(row)).collect()
    }
}
