//! From a file to a PostgreSQL and back: all that a database has, while no server works with either.
//!
//! What was copied is read back and compared. Jobs that have not ended go on with the server that works
//! with the new database: the entries of the queue are not copied, and a job without one is given one.

use futures_util::TryStreamExt;
use sha2::{Digest, Sha256};

use super::database::postgres::{self, Use};
use super::database::{self, Connection, Kind, Pool, QueryBuilder, Row, Separated, Value};
use super::opening::{Access, Opened};
use super::{DatabasePlace, DatabaseSettings, StoreError, corrupt};

/// Bytes of values that are written with one statement, about, and rows at the most.
const BYTES_TOGETHER: usize = 1 << 20;
const ROWS_TOGETHER: usize = 100;

/// What is copied; a table comes after those that its rows belong to.
pub(super) const TABLES: [&str; 39] = [
    "jobs",
    "job_labels",
    "job_datasets",
    "events",
    "generations",
    "checkpoints",
    "results",
    "datasets",
    "dataset_chunks",
    "dataset_versions",
    "unfinished_datasets",
    "candidate_records",
    "candidates",
    "comparisons",
    "comparison_jobs",
    "streams",
    "stream_blocks",
    "stream_extremes",
    "stream_marks",
    "signal_lists",
    "stream_batches",
    "monitors",
    "monitor_windows",
    "monitor_alarms",
    "monitor_events",
    "layouts",
    "mappings",
    "sources",
    "unmapped_series",
    "omf_definitions",
    "tokens",
    "idempotency",
    "models",
    "audit",
    "audit_anchor",
    "project_days",
    "webhooks",
    "deliveries",
    "sessions",
];

/// Tables whose rows triggers count. While many rows are copied into a PostgreSQL the triggers are off, because
/// each statement would leave a version of its project's count.
const COUNTED: [&str; 10] = [
    "datasets",
    "streams",
    "jobs",
    "job_bytes",
    "events",
    "generations",
    "candidates",
    "results",
    "idempotency",
    "signal_lists",
];

/// What of a job stays behind: who works it, by which entry of the queue, and the seal of that.
const LEFT_BEHIND: [(&str, &str, Value); 4] = [
    ("jobs", "queue_entry", Value::Integer(Some(0))),
    ("jobs", "at_work_in", Value::Integer(None)),
    ("jobs", "is_shared", Value::Integer(Some(0))),
    ("jobs", "state_seal", Value::Integer(None)),
];

/// A table that was copied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CopiedTable {
    /// The name of the table.
    pub name: &'static str,
    /// How many rows the table has.
    pub rows: u64,
}

/// Copies a file into an empty PostgreSQL database, or that into a new file. All is copied or nothing.
///
/// # Errors
/// Both are files or neither is, one is in use, the new one is not empty, or what was copied does not read
/// back as it was.
pub async fn copy(
    from: &DatabasePlace,
    to: &DatabasePlace,
) -> Result<Vec<CopiedTable>, StoreError> {
    let (source, target) = (Alone::open(from).await?, Alone::open(to).await?);
    let copied = copy_all(&source, &target).await;
    target.close().await;
    source.close().await;
    copied
}

async fn copy_all(source: &Alone, target: &Alone) -> Result<Vec<CopiedTable>, StoreError> {
    let tables = tables(source, target).await?;
    for table in &tables {
        if !is_empty(table, target.pool()).await? {
            return Err(StoreError::NotEmpty(target.name.clone()));
        }
    }
    let mut tx = target.pool().begin_write().await?;
    let is_counted_after = target.pool().kind() == Kind::Postgres;
    if is_counted_after {
        set_triggers(&mut tx, "disable").await?;
    }
    let mut copied = Vec::new();
    let mut digests = Vec::new();
    for table in &tables {
        let (rows, digest) = copy_table(table, source.pool(), &mut tx).await?;
        copied.push(CopiedTable {
            name: table.name,
            rows,
        });
        digests.push((rows, digest));
    }
    if is_counted_after {
        database::query("select count_all_bytes()")
            .execute(&mut tx)
            .await?;
        set_triggers(&mut tx, "enable").await?;
    }
    tx.commit().await?;
    for (table, copied) in tables.iter().zip(digests) {
        if digest_of(table, target.pool()).await? != copied {
            let why = "it is not what was copied; remove the new database and copy again";
            return Err(corrupt("table", table.name, why));
        }
    }
    Ok(copied)
}

/// Turns the triggers of the counted tables of a PostgreSQL off (`disable`) or on (`enable`).
async fn set_triggers(tx: &mut Connection, how: &'static str) -> Result<(), StoreError> {
    for table in COUNTED {
        let mut change = QueryBuilder::new("alter table ");
        change.push(table).push(" ").push(how).push(" trigger user");
        change.build().execute(&mut *tx).await?;
    }
    Ok(())
}

/// A database that no other has while it is open.
struct Alone {
    name: String,
    opened: Opened,
    /// What keeps others from a PostgreSQL.
    _held: Option<sqlx::PgConnection>,
}

impl Alone {
    async fn open(place: &DatabasePlace) -> Result<Self, StoreError> {
        let settings = DatabaseSettings::of_a_command(place);
        let opened = Opened::open_for(&settings, [Use::Copies; 2]).await?;
        let held = match &opened.access {
            Access::Alone(_) => None,
            Access::Shared(shared) => {
                let held = postgres::hold_alone(shared.options()).await?;
                Some(held.ok_or_else(|| StoreError::Locked {
                    database: place.to_string(),
                })?)
            }
        };
        Ok(Self {
            name: place.to_string(),
            opened,
            _held: held,
        })
    }

    fn pool(&self) -> &Pool {
        &self.opened.writer_pool
    }

    async fn close(self) {
        self.opened.close().await;
    }
}

/// A table as both databases have it.
struct Table {
    name: &'static str,
    columns: Vec<Column>,
    /// The columns of the primary key, in the order of the key.
    key: Vec<String>,
}

struct Column {
    name: String,
    holds: Holds,
}

#[derive(Clone, Copy)]
enum Holds {
    Integer,
    Real,
    Text,
    Bytes,
}

/// The tables, as the file of the two describes them.
async fn tables(source: &Alone, target: &Alone) -> Result<Vec<Table>, StoreError> {
    let file = match (source.pool().kind(), target.pool().kind()) {
        (Kind::Sqlite, Kind::Postgres) => source.pool(),
        (Kind::Postgres, Kind::Sqlite) => target.pool(),
        (Kind::Sqlite, Kind::Sqlite) | (Kind::Postgres, Kind::Postgres) => {
            return Err(StoreError::SameKind);
        }
    };
    let mut tables = Vec::new();
    for name in TABLES {
        tables.push(table(name, file).await?);
    }
    Ok(tables)
}

async fn table(name: &'static str, file: &Pool) -> Result<Table, StoreError> {
    let described: Vec<(String, String, i64)> =
        database::query_as("select name, upper(type), pk from pragma_table_info($1) order by cid")
            .bind(name)
            .fetch_all(file)
            .await?;
    let mut key: Vec<(i64, String)> = Vec::new();
    let mut columns = Vec::new();
    for (column, holds, place) in described {
        if place > 0 {
            key.push((place, column.clone()));
        }
        let holds = match &*holds {
            "INTEGER" => Holds::Integer,
            "REAL" => Holds::Real,
            "TEXT" => Holds::Text,
            "BLOB" => Holds::Bytes,
            other => return Err(corrupt("column", format_args!("{name}.{column}"), other)),
        };
        columns.push(Column {
            name: column,
            holds,
        });
    }
    key.sort();
    Ok(Table {
        name,
        columns,
        key: key.into_iter().map(|(_, column)| column).collect(),
    })
}

impl Table {
    /// All rows, in the order of the key.
    fn select(&self) -> QueryBuilder {
        let mut query = QueryBuilder::new("select ");
        list(
            query.separated(", "),
            self.columns.iter().map(|column| &column.name),
        );
        query.push(format_args!(" from {} order by ", self.name));
        list(query.separated(", "), &self.key);
        query
    }

    /// The values of a row as they are copied.
    fn values(&self, row: &Row) -> Result<Vec<Value>, sqlx::Error> {
        let columns = self.columns.iter();
        let values = columns.map(|Column { name, holds }| {
            let left = LEFT_BEHIND
                .iter()
                .find(|(table, column, _)| *table == self.name && column == name);
            if let Some((_, _, instead)) = left {
                return Ok(instead.clone());
            }
            Ok(match holds {
                Holds::Integer => Value::Integer(row.try_get(name)?),
                Holds::Real => Value::Real(row.try_get(name)?),
                Holds::Text => Value::Text(row.try_get(name)?),
                Holds::Bytes => Value::Bytes(row.try_get(name)?),
            })
        });
        values.collect()
    }

    async fn insert(
        &self,
        rows: &mut Vec<Vec<Value>>,
        tx: &mut Connection,
    ) -> Result<(), StoreError> {
        if rows.is_empty() {
            return Ok(());
        }
        let mut query = QueryBuilder::new("insert into ");
        query.push(self.name).push(" (");
        list(
            query.separated(", "),
            self.columns.iter().map(|column| &column.name),
        );
        query.push(tx.kind().either(") ", ") overriding system value "));
        query.push_values(rows.drain(..), |mut row, values| {
            for value in values {
                row.push_bind(value);
            }
        });
        query.build().execute(&mut *tx).await?;
        Ok(())
    }
}

fn list<'n>(mut parts: Separated<'_>, names: impl IntoIterator<Item = &'n String>) {
    for name in names {
        parts.push(format_args!("\"{name}\""));
    }
}

async fn is_empty(table: &Table, pool: &Pool) -> Result<bool, StoreError> {
    let mut query = QueryBuilder::new("select not exists (select 1 from ");
    query.push(table.name).push(")");
    Ok(query.build_query_scalar().fetch_one(pool).await?)
}

/// Copies the rows of a table; answers how many and their digest.
async fn copy_table(
    table: &Table,
    source: &Pool,
    tx: &mut Connection,
) -> Result<(u64, [u8; 32]), StoreError> {
    let mut digest = RowsDigest::default();
    let (mut together, mut bytes) = (Vec::new(), 0);
    let mut rows = table.select().build().fetch(source);
    while let Some(row) = rows.try_next().await? {
        let values = table.values(&row)?;
        bytes += digest.take(&values);
        together.push(values);
        if together.len() == ROWS_TOGETHER || bytes >= BYTES_TOGETHER {
            table.insert(&mut together, tx).await?;
            bytes = 0;
        }
    }
    table.insert(&mut together, tx).await?;
    if tx.kind() == Kind::Postgres && table.columns.iter().any(|column| column.name == "id") {
        count_on(table, tx).await?;
    }
    Ok(digest.end())
}

/// Has a table that numbers its rows go on after the last one.
async fn count_on(table: &Table, tx: &mut Connection) -> Result<(), StoreError> {
    let sequence: Option<String> =
        database::query_scalar("select pg_get_serial_sequence($1, 'id')")
            .bind(table.name)
            .fetch_one(&mut *tx)
            .await?;
    let Some(sequence) = sequence else {
        return Ok(());
    };
    let mut query = QueryBuilder::new("select setval(");
    query
        .push_bind(sequence)
        .push("::text::regclass, coalesce(max(id), 0) + 1, false) from ");
    query.push(table.name);
    query.build().fetch_all(&mut *tx).await?;
    Ok(())
}

/// How many rows a table has, and their digest.
async fn digest_of(table: &Table, pool: &Pool) -> Result<(u64, [u8; 32]), StoreError> {
    let mut digest = RowsDigest::default();
    let mut rows = table.select().build().fetch(pool);
    while let Some(row) = rows.try_next().await? {
        digest.take(&table.values(&row)?);
    }
    Ok(digest.end())
}

#[derive(Default)]
struct RowsDigest {
    rows: u64,
    digest: Sha256,
}

impl RowsDigest {
    /// Takes a row; answers how many bytes it has.
    fn take(&mut self, values: &[Value]) -> usize {
        self.rows += 1;
        values.iter().map(|value| self.take_value(value)).sum()
    }

    fn take_value(&mut self, value: &Value) -> usize {
        let number;
        let bytes: Option<&[u8]> = match value {
            Value::Boolean(value) => {
                number = value.map(|value| u64::from(value).to_le_bytes());
                number.as_ref().map(|bytes| &bytes[..])
            }
            Value::Integer(value) => {
                number = value.map(i64::to_le_bytes);
                number.as_ref().map(|bytes| &bytes[..])
            }
            Value::Real(value) => {
                number = value.map(|value| value.to_bits().to_le_bytes());
                number.as_ref().map(|bytes| &bytes[..])
            }
            Value::Text(value) => value.as_ref().map(String::as_bytes),
            Value::Bytes(value) => value.as_deref(),
        };
        let Some(bytes) = bytes else {
            self.digest.update([0]);
            return 1;
        };
        self.digest.update([1]);
        self.digest.update((bytes.len() as u64).to_le_bytes());
        self.digest.update(bytes);
        bytes.len()
    }

    fn end(self) -> (u64, [u8; 32]) {
        (self.rows, self.digest.finalize().into())
    }
}
