//! The blocks of a stream: rows of samples that lie together in time.

use std::ops::ControlFlow;

use super::stream::{StreamRow, put, stamp};
use crate::store::database::{self, Connection, Row};
use crate::store::sealed::STREAM_BLOCKS;
use crate::store::writer::Tx;
use crate::store::{StoreError, corrupt};
use greybox::recording::{Class, Merged, RowColumn, Rows};

/// Values in a block at the most, all signals together: with their classes and instants, half a MiB.
const BLOCK_VALUES: usize = 1 << 15;
/// Bytes of an instant, of a value.
const WORD: usize = 8;

/// A block without its samples.
pub(super) struct Block {
    /// The first instant of the block, nanoseconds since 1970.
    pub(super) first: i64,
    /// The last instant of the block, nanoseconds since 1970.
    pub(super) last: i64,
    /// How many instants the block has.
    pub(super) rows: u64,
    /// Bytes that the samples of the block take.
    pub(super) bytes: u64,
}

/// The instants from one up to, and without, another, nanoseconds since 1970.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) from: i64,
    pub(super) to: i64,
}

/// Which block of a span is looked at first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    OldestFirst,
    NewestFirst,
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
        let block = database::query(match order {
            Order::OldestFirst => {
                "select stream, first_ns, last_ns, rows, samples, seal from stream_blocks \
                 where stream = $1 and first_ns < $2 and last_ns >= $3 order by first_ns limit 1"
            }
            Order::NewestFirst => {
                "select stream, first_ns, last_ns, rows, samples, seal from stream_blocks \
                 where stream = $1 and first_ns < $2 and last_ns >= $3 order by first_ns desc limit 1"
            }
        })
        .bind(&identity)
        .bind(rest.to)
        .bind(rest.from)
        .fetch_optional(&mut *connection)
        .await?;
        let Some(block) = block else {
            break;
        };
        let rows = decode(&block, stream.signals.len())?;
        if let ControlFlow::Break(answer) = take(rows.within(span.from, span.to)) {
            return Ok(Some(answer));
        }
        match order {
            Order::OldestFirst => rest.from = block.try_get::<i64>("last_ns")?.saturating_add(1),
            Order::NewestFirst => rest.to = block.try_get("first_ns")?,
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
    let block = database::query(
        "select stream, first_ns, last_ns, rows, samples, seal from stream_blocks \
         where stream = $1 and last_ns >= $2 order by first_ns limit 1",
    )
    .bind(stream)
    .bind(from)
    .fetch_optional(connection)
    .await?;
    let Some(block) = block else {
        return Ok(None);
    };
    Ok(instants(&block)?
        .into_iter()
        .find(|instant| *instant >= from))
}

/// The last instant of a stream up to and with one.
pub(super) async fn last_until(
    connection: &mut Connection,
    stream: &str,
    until: i64,
) -> Result<Option<i64>, StoreError> {
    let block = database::query(
        "select stream, first_ns, last_ns, rows, samples, seal from stream_blocks \
         where stream = $1 and first_ns <= $2 order by first_ns desc limit 1",
    )
    .bind(stream)
    .bind(until)
    .fetch_optional(connection)
    .await?;
    let Some(block) = block else {
        return Ok(None);
    };
    let instants = instants(&block)?;
    Ok(instants.into_iter().rfind(|instant| *instant <= until))
}

/// Removes the rows of a span from their blocks. Says how many went.
pub(super) async fn remove(tx: &mut Tx, stream: &StreamRow, span: Span) -> Result<u64, StoreError> {
    let identity = stream.identity();
    let columns = stream.signals.len();
    let most = rows_of_a_block(columns);
    let mut removed = 0;
    for block in all(tx, &identity).await? {
        if block.last < span.from || block.first >= span.to {
            continue;
        }
        let rows = take(tx, &identity, &block, columns).await?;
        let mut kept = rows.within(i64::MIN, span.from);
        kept.append(rows.within(span.to, i64::MAX));
        removed += (rows.rows() - kept.rows()) as u64;
        insert(tx, &identity, &kept, most).await?;
    }
    Ok(removed)
}

/// The blocks of a stream, the oldest first.
pub(super) async fn all(tx: &mut Tx, stream: &str) -> Result<Vec<Block>, StoreError> {
    let rows = database::query(
        "select first_ns, last_ns, rows, cast(length(samples) as bigint) as bytes from stream_blocks \
         where stream = $1 order by first_ns",
    )
    .bind(stream)
    .fetch_all(&mut **tx)
    .await?;
    let read = |row: &Row| {
        Ok(Block {
            first: row.try_get("first_ns")?,
            last: row.try_get("last_ns")?,
            rows: row.try_get::<i64>("rows")?.unsigned_abs(),
            bytes: row.try_get::<i64>("bytes")?.unsigned_abs(),
        })
    };
    rows.iter().map(read).collect()
}

/// Merges rows into the blocks that they fall into. Rows between two blocks belong to the earlier
/// one; those before all blocks to the first.
pub(super) async fn merge(
    tx: &mut Tx,
    stream: &StreamRow,
    rows: &Rows,
) -> Result<Merged, StoreError> {
    let identity = stream.identity();
    let blocks = all(tx, &identity).await?;
    let columns = stream.signals.len();
    let most = rows_of_a_block(columns);
    let mut merged = Merged::default();
    let mut begin = 0;
    while begin < rows.rows() {
        let instant = rows.instants[begin];
        let after = blocks.partition_point(|block| block.first <= instant);
        let place = after.saturating_sub(1);
        // Rows before all blocks belong to the first, which ends where the second begins.
        let next = blocks.get(if after == 0 { 1 } else { after });
        let end = next.map_or(rows.rows(), |next| {
            rows.instants
                .partition_point(|instant| *instant < next.first)
        });
        let part = rows.slice(begin..end);
        let (all, told) = match blocks.get(place) {
            Some(block) if !is_full_and_earlier(block, most, instant) => {
                let own = take(tx, &identity, block, columns).await?;
                own.merge(&part)
            }
            _ => Rows::of_columns(columns).merge(&part),
        };
        merged += told;
        insert(tx, &identity, &all, most).await?;
        begin = end;
    }
    Ok(merged)
}

/// The rows that a block of so many signals holds at the most.
fn rows_of_a_block(columns: usize) -> usize {
    (BLOCK_VALUES / columns.max(1)).max(1)
}

/// Whether rows from an instant on had better begin a block of their own.
fn is_full_and_earlier(block: &Block, most: usize, instant: i64) -> bool {
    block.last < instant && block.rows >= most as u64
}

/// Takes a block out.
async fn take(
    tx: &mut Tx,
    stream: &str,
    block: &Block,
    columns: usize,
) -> Result<Rows, StoreError> {
    let row = database::query(
        "delete from stream_blocks where stream = $1 and first_ns = $2 \
         returning stream, first_ns, last_ns, rows, samples, seal",
    )
    .bind(stream)
    .bind(block.first)
    .fetch_one(&mut **tx)
    .await?;
    decode(&row, columns)
}

/// Puts rows in, cut into blocks.
async fn insert(tx: &mut Tx, stream: &str, rows: &Rows, most: usize) -> Result<(), StoreError> {
    let mut begin = 0;
    while begin < rows.rows() {
        let block = rows.slice(begin..(begin + most).min(rows.rows()));
        begin += block.rows();
        let (Some(first), Some(last)) = (block.instants.first(), block.instants.last()) else {
            continue;
        };
        let rows = i64::try_from(block.rows()).expect("a block is small");
        let samples = encode(&block);
        let parts = [
            stream.into(),
            (*first).into(),
            (*last).into(),
            rows.into(),
            (&samples).into(),
        ];
        let seal = STREAM_BLOCKS.seal(&parts);
        database::query(
            "insert into stream_blocks (stream, first_ns, last_ns, rows, samples, seal) \
             values ($1, $2, $3, $4, $5, $6)",
        )
        .bind(stream)
        .bind(*first)
        .bind(*last)
        .bind(rows)
        .bind(samples)
        .bind(seal)
        .execute(&mut **tx)
        .await?;
    }
    Ok(())
}

/// The bytes that rows take by themselves.
pub(super) fn bytes_of(rows: &Rows) -> u64 {
    let of_a_row = WORD + rows.columns.len() * (WORD + 1);
    (rows.rows() * of_a_row) as u64
}

fn encode(rows: &Rows) -> Vec<u8> {
    let n = rows.rows();
    let mut bytes = Vec::with_capacity(n * (WORD + rows.columns.len() * (WORD + 1)));
    bytes.extend(rows.instants.iter().flat_map(|ns| ns.to_le_bytes()));
    for column in &rows.columns {
        bytes.extend(column.values.iter().flat_map(|value| value.to_le_bytes()));
    }
    for column in &rows.columns {
        bytes.extend(column.classes.iter().map(|class| *class as u8));
    }
    bytes
}

/// The instants of a block, of its row.
pub(super) fn instants(row: &Row) -> Result<Vec<i64>, StoreError> {
    STREAM_BLOCKS.verify(row)?;
    let (stream, bytes): (&str, &[u8]) = (row.try_get("stream")?, row.try_get("samples")?);
    let rows = usize::try_from(row.try_get::<i64>("rows")?).unwrap_or_default();
    let part = bytes.get(..rows.saturating_mul(WORD));
    let part = part.ok_or_else(|| corrupt("stream", stream, "a block is too short"))?;
    let (words, _) = part.as_chunks();
    Ok(words.iter().map(|word| i64::from_le_bytes(*word)).collect())
}

/// The rows of a block, of its row. Signals that came after it was written have no samples in it.
pub(super) fn decode(row: &Row, columns: usize) -> Result<Rows, StoreError> {
    let instants = instants(row)?;
    let (stream, bytes): (&str, &[u8]) = (row.try_get("stream")?, row.try_get("samples")?);
    let rows = instants.len();
    let rest = &bytes[rows * WORD..];
    let own = rest.len() / (rows * (WORD + 1)).max(1);
    if rest.len() != own * rows * (WORD + 1) || own > columns {
        return Err(corrupt("stream", stream, "a block has another length"));
    }
    let (values, classes) = rest.split_at(own * rows * WORD);
    let column = |place: usize| {
        let (words, _) = values[place * rows * WORD..(place + 1) * rows * WORD].as_chunks();
        let classes = classes[place * rows..(place + 1) * rows].iter();
        Ok(RowColumn {
            values: words.iter().map(|word| f64::from_le_bytes(*word)).collect(),
            classes: classes
                .map(|code| class(stream, *code))
                .collect::<Result<_, _>>()?,
        })
    };
    let read = Rows {
        instants,
        columns: (0..own).map(column).collect::<Result<_, StoreError>>()?,
    };
    let places: Vec<usize> = (0..own).collect();
    Ok(read.spread(&places, columns))
}

fn class(stream: &str, code: u8) -> Result<Class, StoreError> {
    let classes = [
        Class::Good,
        Class::Uncertain,
        Class::Substituted,
        Class::Bad,
    ];
    let known = classes.into_iter().find(|class| *class as u8 == code);
    known.ok_or_else(|| corrupt("stream", stream, "a sample has no class"))
}

/// Writes what a stream is that has these blocks.
pub(super) async fn note(
    tx: &mut Tx,
    row: &mut StreamRow,
    blocks: &[Block],
) -> Result<(), StoreError> {
    let stamp = |ns| stamp(&row.name, ns);
    row.first = blocks.first().map(|block| stamp(block.first)).transpose()?;
    row.last = blocks.last().map(|block| stamp(block.last)).transpose()?;
    row.samples = blocks.iter().map(|block| block.rows).sum();
    row.bytes = blocks.iter().map(|block| block.bytes).sum();
    put(tx, row).await
}
