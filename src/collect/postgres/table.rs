//! Columns of a table, whose types are looked up.

use sqlx::postgres::PgConnection;
use sqlx::{AssertSqlSafe, Row as _};

use super::rows::{RowsPlace, failure};
use super::time_column::TimeColumn;
use crate::collect::error::CollectError;
use crate::collect::query::{dotted, name, value};
use crate::collect::series::{SourceColumn, SourceSeries};

/// The rows of a table.
pub(super) async fn rows(
    connection: &mut PgConnection,
    series: &SourceSeries,
) -> Result<Option<RowsPlace>, CollectError> {
    let from = dotted(&series.table);
    let time = name(&series.time);
    let type_of = |column: &str| format!("pg_typeof((SELECT {column} FROM {from} LIMIT 1))::text");
    let fields = series.columns.iter().map(|column| name(&column.field));
    let asked: Vec<String> = std::iter::once(time.clone()).chain(fields).collect();
    let types: Vec<String> = asked.iter().map(|column| type_of(column)).collect();
    let types = sqlx::query(AssertSqlSafe(format!("SELECT {}", types.join(", "))))
        .fetch_one(connection)
        .await
        .map_err(failure)?;
    let type_of = |place: usize| types.try_get::<String, usize>(place).map_err(failure);
    let kind = TimeColumn::of(&type_of(0)?, series)?;
    let columns = series.columns.iter().zip(1..).map(|(column, place)| {
        let field = name(&column.field);
        let field = match &*type_of(place)? {
            "boolean" => format!("{field}::int"),
            // An infinite value is no sample.
            "real" | "double precision" => {
                format!("CASE WHEN {field} NOT IN ('Infinity', '-Infinity') THEN {field} END")
            }
            _ => field,
        };
        Ok(SourceColumn {
            field,
            ..column.clone()
        })
    });
    let columns = columns.collect::<Result<_, CollectError>>()?;
    let conditions = series.filter.iter();
    let conditions =
        conditions.map(|(column, text)| format!("{} = {} AND ", name(column), value(text)));
    Ok(Some(RowsPlace {
        from,
        time,
        kind,
        columns,
        conditions: conditions.collect(),
    }))
}
