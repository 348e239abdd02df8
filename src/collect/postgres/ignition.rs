//! The history of an Ignition gateway: a table of tags, a table of partitions, and a table of samples each partition.
//! Ignition gives a tag a new number whenever the tag is made anew, and begins a partition by the calendar.

use sqlx::Row as _;
use sqlx::postgres::PgConnection;

use super::rows::{RowsPlace, failure};
use super::time_column::TimeColumn;

use crate::collect::error::CollectError;
use crate::collect::page::ReadStretch;
use crate::collect::query::name;
use crate::collect::series::{SourceColumn, SourceSeries};

/// The columns of the partitions that are read.
const COLUMNS: &str =
    "tagid, t_stamp, COALESCE(floatvalue, intvalue::double precision) AS value, dataintegrity";

/// The rows of a tag; nothing where no partition has the stretch.
pub(super) async fn rows(
    connection: &mut PgConnection,
    series: &SourceSeries,
    stretch: &ReadStretch,
) -> Result<Option<RowsPlace>, CollectError> {
    let tag = &series.table;
    let numbers = sqlx::query(
        "SELECT id::bigint AS id FROM sqlth_te WHERE lower(tagpath) = lower($1) ORDER BY id",
    )
    .bind(tag)
    .fetch_all(&mut *connection)
    .await
    .map_err(failure)?;
    let numbers = numbers.iter().map(|row| row.try_get::<i64, _>("id"));
    let numbers = numbers.collect::<Result<Vec<i64>, _>>().map_err(failure)?;
    if numbers.is_empty() {
        let detail = format!("the history has no tag `{tag}` (table sqlth_te, column tagpath)");
        return Err(CollectError::SourceRefuses(detail));
    }
    // A partition that was pruned stays in the list of partitions.
    let partitions = sqlx::query(
        "SELECT pname FROM sqlth_partitions WHERE end_time > $1 AND start_time <= $2 \
         AND to_regclass(quote_ident(pname)) IS NOT NULL ORDER BY start_time",
    )
    .bind(stretch.between.start.as_millisecond())
    .bind(stretch.between.end.as_millisecond())
    .fetch_all(&mut *connection)
    .await
    .map_err(failure)?;
    let selections = partitions.iter().map(|row| {
        let partition: String = row.try_get("pname").map_err(failure)?;
        Ok(format!("SELECT {COLUMNS} FROM {}", name(&partition)))
    });
    let selections = selections.collect::<Result<Vec<String>, CollectError>>()?;
    if selections.is_empty() {
        return Ok(None);
    }
    let numbers: Vec<String> = numbers.iter().map(i64::to_string).collect();
    let columns = series.columns.iter().map(|column| SourceColumn {
        field: "value".to_owned(),
        ..column.clone()
    });
    Ok(Some(RowsPlace {
        from: format!("({}) AS history", selections.join(" UNION ALL ")),
        time: "t_stamp".to_owned(),
        kind: TimeColumn::count("bigint", "ms")?,
        columns: columns.collect(),
        conditions: format!("tagid IN ({}) AND ", numbers.join(", ")),
    }))
}
