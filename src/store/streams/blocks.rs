//! The blocks of a stream: rows of samples that lie together in time.

use super::StreamRow;
use crate::recording::{Class, Merged, RowColumn, Rows};
use crate::store::database::{self, Row};
use crate::store::sealed::STREAM_BLOCKS;
use crate::store::writer::Tx;
use crate::store::{StoreError, corrupt};

/// Values in a block at the most, all signals together: with their classes and instants, half a MiB.
const BLOCK_VALUES: usize = 1 << 15;
/// Bytes of an instant, of a value.
const WORD: usize = 8;

/// A block without its samples.
pub(super) struct Block {
    /// Its first instant.
    pub(super) first: i64,
    /// Its last instant.
    pub(super) last: i64,
    /// Its instants.
    pub(super) rows: u64,
    /// What they take.
    pub(super) bytes: u64,
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
    let most = (BLOCK_VALUES / columns.max(1)).max(1);
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
