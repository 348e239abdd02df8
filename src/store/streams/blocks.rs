//! The blocks of a stream: rows of samples that lie together in time, and beside each the rows of its extremes.

use std::ops::{ControlFlow, Range};

use super::coding;
use super::stream::{StreamRow, put, stamp};
use crate::store::database::{self, Connection, Query, QueryBuilder, Row};
use crate::store::sealed::{STREAM_BLOCKS, STREAM_EXTREMES, Sealed};
use crate::store::writer::Tx;
use crate::store::{StoreError, corrupt};
use greybox::recording::{Merged, Rows};

/// Values in a block at the most, all signals together.
const BLOCK_VALUES: usize = 1 << 17;
/// Samples that come after all others begin a block of their own where the last block has this share of the rows of
/// a full one, so that a sample costs no more than a small block. Small blocks become a full one together.
const SMALL_BLOCK: usize = 16;
/// Rows that the extremes of a block have at the most, where the block has not more signals than that.
pub(super) const EXTREMES_ROWS: usize = 64;

/// A block without its samples.
struct Block {
    /// The first instant of the block, nanoseconds since 1970.
    first: i64,
    /// The last instant of the block, nanoseconds since 1970.
    last: i64,
    /// How many instants the block has.
    rows: u64,
    /// Bytes that the samples of the block take, and its extremes.
    bytes: u64,
}

/// The instants from one up to, and without, another, nanoseconds since 1970.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) from: i64,
    pub(super) to: i64,
}

impl From<Range<i64>> for Span {
    fn from(Range { start, end }: Range<i64>) -> Self {
        Self {
            from: start,
            to: end,
        }
    }
}

/// Which block of a span is looked at first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    OldestFirst,
    NewestFirst,
}

/// Which block of a stream is looked for.
enum Which {
    /// The block that an instant falls into, or else the next one.
    From(i64),
    /// The block that begins last up to and with an instant.
    Until(i64),
    /// The block that begins first after an instant.
    After(i64),
}

/// A statement that reads these columns of a block.
fn select(columns: &str, stream: &str, which: Which) -> Query {
    let mut query = QueryBuilder::new("select ");
    query
        .push(columns)
        .push(" from stream_blocks where stream = ");
    query.push_bind(stream);
    match which {
        // Blocks do not overlap, so that of all blocks before an instant only the last can reach it.
        Which::From(instant) => {
            query.push(" and last_ns >= ").push_bind(instant);
            query.push(" and first_ns >= coalesce((select max(first_ns) from stream_blocks");
            query.push(" where stream = ").push_bind(stream);
            query.push(" and first_ns <= ").push_bind(instant);
            query
                .push("), ")
                .push_bind(instant)
                .push(") order by first_ns")
        }
        Which::Until(instant) => {
            query.push(" and first_ns <= ").push_bind(instant);
            query.push(" order by first_ns desc")
        }
        Which::After(instant) => {
            query.push(" and first_ns > ").push_bind(instant);
            query.push(" order by first_ns")
        }
    };
    query.push(" limit 1");
    query.build()
}

/// A block with its samples, as its row.
async fn fetch_block(
    connection: &mut Connection,
    stream: &str,
    which: Which,
) -> Result<Option<Row>, StoreError> {
    let query = select(
        "stream, first_ns, last_ns, rows, samples, seal",
        stream,
        which,
    );
    Ok(query.fetch_optional(connection).await?)
}

/// Hands over the rows of a stream in a span, block by block, until `take` breaks with an answer.
pub(super) async fn visit<T>(
    connection: &mut Connection,
    stream: &StreamRow,
    (span, order): (Span, Order),
    mut take: impl FnMut(Rows) -> ControlFlow<T>,
) -> Result<Option<T>, StoreError> {
    let identity = stream.identity();
    // Blocks do not overlap: the next one lies beyond the one before.
    let mut rest = span;
    while rest.from < rest.to {
        let block = match order {
            Order::OldestFirst => Which::From(rest.from),
            Order::NewestFirst => Which::Until(rest.to - 1),
        };
        let Some(block) = fetch_block(connection, &identity, block).await? else {
            break;
        };
        let (first, last): (i64, i64) = (block.try_get("first_ns")?, block.try_get("last_ns")?);
        if first >= span.to || last < span.from {
            break;
        }
        let rows = decode(&STREAM_BLOCKS, &block, stream.signals.len())?;
        if let ControlFlow::Break(answer) = take(rows.within(span.from, span.to)) {
            return Ok(Some(answer));
        }
        match order {
            Order::OldestFirst => rest.from = last.saturating_add(1),
            Order::NewestFirst => rest.to = first,
        }
    }
    Ok(None)
}

/// The rows of a stream in a span, `most` at the most; nothing where there are more.
pub(super) async fn between(
    connection: &mut Connection,
    stream: &StreamRow,
    span: Span,
    most: usize,
) -> Result<Option<Rows>, StoreError> {
    let mut rows = Rows::of_columns(stream.signals.len());
    let too_many = visit(connection, stream, (span, Order::OldestFirst), |part| {
        if rows.rows() + part.rows() > most {
            return ControlFlow::Break(());
        }
        rows.append(part);
        ControlFlow::Continue(())
    });
    let is_too_many = too_many.await?.is_some();
    Ok((!is_too_many).then_some(rows))
}

/// The first instant of a stream at or after one.
pub(super) async fn first_from(
    connection: &mut Connection,
    stream: &str,
    from: i64,
) -> Result<Option<i64>, StoreError> {
    let Some(block) = fetch_block(connection, stream, Which::From(from)).await? else {
        return Ok(None);
    };
    let mut instants = instants(&block)?.into_iter();
    Ok(instants.find(|instant| *instant >= from))
}

/// The last instant of a stream up to and with one.
pub(super) async fn last_until(
    connection: &mut Connection,
    stream: &str,
    until: i64,
) -> Result<Option<i64>, StoreError> {
    let Some(block) = fetch_block(connection, stream, Which::Until(until)).await? else {
        return Ok(None);
    };
    let instants = instants(&block)?;
    Ok(instants.into_iter().rfind(|instant| *instant <= until))
}

/// Removes the rows of a span from their blocks. Says how many went.
pub(super) async fn remove(
    tx: &mut Tx,
    stream: &mut StreamRow,
    span: Span,
) -> Result<u64, StoreError> {
    let before = stream.samples;
    let mut rest = span;
    while rest.from < rest.to
        && let Some(block) = find(tx, stream, Which::From(rest.from)).await?
        && block.first < span.to
    {
        let rows = take(tx, stream, &block).await?;
        let place = |bound| rows.instants.partition_point(|instant| *instant < bound);
        insert(tx, stream, &rows, 0..place(span.from)).await?;
        insert(tx, stream, &rows, place(span.to)..rows.rows()).await?;
        rest.from = block.last.saturating_add(1);
    }
    note(tx, stream).await?;
    Ok(before - stream.samples)
}

/// The limits of what a stream keeps.
pub(super) struct Kept {
    /// Blocks that end before this instant go, nanoseconds since 1970.
    pub(super) from: i64,
    /// The oldest blocks go until no more bytes are left.
    pub(super) bytes: u64,
}

/// Removes the oldest blocks that are not to be kept, and of the block that is kept in part what is older, where that
/// is more than a small part of it; of the newest block room takes nothing. Says how many rows went.
pub(super) async fn keep(
    tx: &mut Tx,
    stream: &mut StreamRow,
    kept: Kept,
) -> Result<u64, StoreError> {
    let before = stream.samples;
    while let Some(oldest) = find(tx, stream, Which::From(i64::MIN)).await? {
        let is_kept = oldest.last >= kept.from && stream.bytes <= kept.bytes;
        if is_kept
            || find(tx, stream, Which::After(oldest.first))
                .await?
                .is_none()
        {
            break;
        }
        database::query("delete from stream_blocks where stream = $1 and first_ns = $2")
            .bind(stream.identity())
            .bind(oldest.first)
            .execute(&mut **tx)
            .await?;
        forget(stream, &oldest);
    }
    if let Some(oldest) = find(tx, stream, Which::From(i64::MIN)).await?
        && is_mostly_kept(&oldest, kept.from)
    {
        note(tx, stream).await?;
    } else {
        let older = Span::from(i64::MIN..kept.from);
        remove(tx, stream, older).await?;
    }
    Ok(before - stream.samples)
}

/// Whether what is older than an instant is a small part of the time of a block: it goes with more.
fn is_mostly_kept(block: &Block, from: i64) -> bool {
    let length = i128::from(block.last) - i128::from(block.first);
    let older = i128::from(from) - i128::from(block.first);
    older * SMALL_BLOCK as i128 <= length
}

/// Columns of a block without its samples.
const COLUMNS: &str = "first_ns, last_ns, rows, cast(length(samples) + coalesce((select length(samples) \
     from stream_extremes where stream_extremes.stream = stream_blocks.stream \
     and stream_extremes.first_ns = stream_blocks.first_ns), 0) as bigint) as bytes";

/// A block of a stream without its samples.
async fn find(tx: &mut Tx, stream: &StreamRow, which: Which) -> Result<Option<Block>, StoreError> {
    let query = select(COLUMNS, &stream.identity(), which);
    let row = query.fetch_optional(&mut **tx).await?;
    let Some(row) = row else {
        return Ok(None);
    };
    Ok(Some(Block {
        first: row.try_get("first_ns")?,
        last: row.try_get("last_ns")?,
        rows: row.try_get::<i64>("rows")?.unsigned_abs(),
        bytes: row.try_get::<i64>("bytes")?.unsigned_abs(),
    }))
}

/// Merges rows into the blocks that they fall into. Rows between two blocks belong to the earlier
/// one; those before all blocks to the first.
pub(super) async fn merge(
    tx: &mut Tx,
    stream: &mut StreamRow,
    rows: &Rows,
) -> Result<Merged, StoreError> {
    let mut merged = Merged::default();
    let mut begin = 0;
    while begin < rows.rows() {
        let instant = rows.instants[begin];
        let block = match find(tx, stream, Which::Until(instant)).await? {
            None => find(tx, stream, Which::After(instant)).await?,
            block => block,
        };
        // Rows before all blocks belong to the first, which ends where the second begins.
        let next = match &block {
            Some(block) => find(tx, stream, Which::After(block.first)).await?,
            None => None,
        };
        let end = next.map_or(rows.rows(), |next| {
            rows.instants
                .partition_point(|instant| *instant < next.first)
        });
        match block.filter(|block| !begins_another(block, stream, instant)) {
            Some(block) => {
                let part = rows.slice(begin..end);
                let (all, told) = take(tx, stream, &block).await?.merge(&part);
                merged += told;
                insert(tx, stream, &all, 0..all.rows()).await?;
            }
            None => {
                merged.added += (end - begin) as u64;
                insert(tx, stream, rows, begin..end).await?;
            }
        }
        begin = end;
    }
    join_small_blocks(tx, stream).await?;
    Ok(merged)
}

/// Makes a full block of the last ones, where they are small and have enough rows together.
async fn join_small_blocks(tx: &mut Tx, stream: &mut StreamRow) -> Result<(), StoreError> {
    let newest = database::query(
        "select first_ns, rows from stream_blocks where stream = $1 order by first_ns desc limit $2",
    )
    .bind(stream.identity())
    .bind(2 * SMALL_BLOCK as i64)
    .fetch_all(&mut **tx)
    .await?;
    let full = rows_of_a_block(stream) as u64;
    let (mut small_from, mut rows) = (None, 0);
    for block in &newest {
        let rows_of_block = block.try_get::<i64>("rows")?.unsigned_abs();
        if rows_of_block >= full {
            break;
        }
        rows += rows_of_block;
        small_from = Some(block.try_get("first_ns")?);
    }
    let Some(from) = small_from.filter(|_| rows >= full) else {
        return Ok(());
    };
    let mut joined = Rows::of_columns(stream.signals.len());
    while let Some(block) = find(tx, stream, Which::From(from)).await? {
        joined.append(take(tx, stream, &block).await?);
    }
    insert(tx, stream, &joined, 0..joined.rows()).await
}

/// The rows that a block of a stream holds at the most.
fn rows_of_a_block(stream: &StreamRow) -> usize {
    (BLOCK_VALUES / stream.signals.len().max(1)).max(1)
}

/// Whether rows from an instant on had better begin a block of their own.
fn begins_another(block: &Block, stream: &StreamRow, instant: i64) -> bool {
    let small = (rows_of_a_block(stream) / SMALL_BLOCK).max(1) as u64;
    block.last < instant && block.rows >= small
}

/// Takes a block out.
async fn take(tx: &mut Tx, stream: &mut StreamRow, block: &Block) -> Result<Rows, StoreError> {
    let row = database::query(
        "delete from stream_blocks where stream = $1 and first_ns = $2 \
         returning stream, first_ns, last_ns, rows, samples, seal",
    )
    .bind(stream.identity())
    .bind(block.first)
    .fetch_one(&mut **tx)
    .await?;
    forget(stream, block);
    decode(&STREAM_BLOCKS, &row, stream.signals.len())
}

/// Counts a block no longer.
fn forget(stream: &mut StreamRow, block: &Block) {
    stream.samples = stream.samples.saturating_sub(block.rows);
    stream.bytes = stream.bytes.saturating_sub(block.bytes);
}

/// Puts some of the rows in, cut into blocks.
async fn insert(
    tx: &mut Tx,
    stream: &mut StreamRow,
    rows: &Rows,
    range: Range<usize>,
) -> Result<(), StoreError> {
    let identity = stream.identity();
    let most = rows_of_a_block(stream);
    for begin in range.clone().step_by(most) {
        let block = rows.slice(begin..(begin + most).min(range.end));
        stream.samples += block.rows() as u64;
        stream.bytes += insert_block(tx, &identity, &block).await?;
        // A plot of a block that is hardly longer than its extremes reads the block.
        if block.rows() > 4 * EXTREMES_ROWS.max(2 * block.columns.len()) {
            let extremes = block.thinned(EXTREMES_ROWS);
            stream.bytes += insert_extremes(tx, &identity, (&block, &extremes)).await?;
        }
    }
    Ok(())
}

/// Stores a block. Says how many bytes it takes.
async fn insert_block(tx: &mut Tx, stream: &str, block: &Rows) -> Result<u64, StoreError> {
    let (first, last) = (block.instants[0], block.instants[block.rows() - 1]);
    let rows = i64::try_from(block.rows()).expect("a block is small");
    let samples = coding::encode(block);
    let bytes = samples.len() as u64;
    let parts = [
        stream.into(),
        first.into(),
        last.into(),
        rows.into(),
        (&samples).into(),
    ];
    let seal = STREAM_BLOCKS.seal(&parts);
    database::query(
        "insert into stream_blocks (stream, first_ns, last_ns, rows, samples, seal) \
         values ($1, $2, $3, $4, $5, $6)",
    )
    .bind(stream)
    .bind(first)
    .bind(last)
    .bind(rows)
    .bind(samples)
    .bind(seal)
    .execute(&mut **tx)
    .await?;
    Ok(bytes)
}

/// Stores the extremes of a block. Says how many bytes they take.
async fn insert_extremes(
    tx: &mut Tx,
    stream: &str,
    (block, extremes): (&Rows, &Rows),
) -> Result<u64, StoreError> {
    let first = block.instants[0];
    let rows = i64::try_from(extremes.rows()).expect("a block is small");
    let samples = coding::encode(extremes);
    let bytes = samples.len() as u64;
    let parts = [stream.into(), first.into(), rows.into(), (&samples).into()];
    let seal = STREAM_EXTREMES.seal(&parts);
    database::query(
        "insert into stream_extremes (stream, first_ns, rows, samples, seal) \
         values ($1, $2, $3, $4, $5)",
    )
    .bind(stream)
    .bind(first)
    .bind(rows)
    .bind(samples)
    .bind(seal)
    .execute(&mut **tx)
    .await?;
    Ok(bytes)
}

/// The instants of a block, of its row.
fn instants(row: &Row) -> Result<Vec<i64>, StoreError> {
    STREAM_BLOCKS.verify(row)?;
    let instants = coding::instants(row.try_get("samples")?, rows_of(row)?);
    instants.map_err(|why| corrupt("stream", row.try_get("stream").unwrap_or("?"), why))
}

fn rows_of(row: &Row) -> Result<usize, StoreError> {
    Ok(usize::try_from(row.try_get::<i64>("rows")?).unwrap_or_default())
}

/// The rows of a block or of its extremes. Signals that came after it was written have no samples in it.
pub(super) fn decode(table: &Sealed, row: &Row, columns: usize) -> Result<Rows, StoreError> {
    table.verify(row)?;
    let read = coding::decode(row.try_get("samples")?, rows_of(row)?);
    let read = read.and_then(|rows| match rows.columns.len() {
        present if present <= columns => Ok(rows),
        _ => Err("a block has more signals than its stream"),
    });
    let stream = || row.try_get("stream").unwrap_or("?");
    let read = read.map_err(|why| corrupt("stream", stream(), why))?;
    let places: Vec<usize> = (0..read.columns.len()).collect();
    Ok(read.spread(&places, columns))
}

/// Writes what a stream then is.
async fn note(tx: &mut Tx, stream: &mut StreamRow) -> Result<(), StoreError> {
    let oldest = find(tx, stream, Which::From(i64::MIN)).await?;
    let newest = find(tx, stream, Which::Until(i64::MAX)).await?;
    let stamp = |ns| stamp(&stream.name, ns);
    stream.first = oldest.map(|block| stamp(block.first)).transpose()?;
    stream.last = newest.map(|block| stamp(block.last)).transpose()?;
    put(tx, stream).await
}
