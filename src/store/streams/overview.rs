//! What a plot shows of a part of a stream, however long it is: the extremes of its stretches.

use std::ops::ControlFlow;

use super::blocks::{self, EXTREMES_ROWS, Order, Span, decode};
use super::stream::StreamRow;
use crate::store::StoreError;
use crate::store::database::{self, Connection, Row};
use crate::store::sealed::STREAM_EXTREMES;
use greybox::recording::Rows;

/// Rows that are read for each point of a plot at the most.
const ROWS_A_POINT: u64 = 8;
/// Values in memory at the most, all signals together.
const MOST_VALUES: u64 = 1 << 24;
/// Blocks whose extremes are read at once.
const BLOCKS_AT_ONCE: i64 = 256;

/// Rows of a span with the least and the greatest value of each signal in each of its stretches, some for each
/// of so many points: all rows where there are few, the extremes of blocks where there are many blocks.
pub(super) async fn overview(
    connection: &mut Connection,
    stream: &StreamRow,
    span: Span,
    points: usize,
) -> Result<Rows, StoreError> {
    let within = Within::read(connection, stream, span).await?;
    let before = rows(connection, stream, (span.from, within.blocks.from)).await?;
    let after = rows(connection, stream, (within.blocks.to, span.to)).await?;
    let columns = stream.signals.len().max(1);
    let points = points as u64;
    let most = (ROWS_A_POINT * points).min(MOST_VALUES / columns as u64);
    let all = (before.rows() + after.rows()) as u64 + within.rows;
    let reads_extremes = all > most && within.rows_of_extremes >= 2 * points;
    let mut overview = Overview {
        rows: Rows::of_columns(stream.signals.len()),
        most,
        of: all,
    };
    if reads_extremes {
        overview.of = within.rows_of_extremes + 2 * EXTREMES_ROWS as u64;
        overview.add(before.thinned(EXTREMES_ROWS));
        of_extremes(connection, stream, within.blocks, &mut overview).await?;
        overview.add(after.thinned(EXTREMES_ROWS));
    } else {
        overview.add(before);
        let in_order = (within.blocks, Order::OldestFirst);
        let add = |rows| {
            overview.add(rows);
            ControlFlow::<()>::Continue(())
        };
        blocks::visit(connection, stream, in_order, add).await?;
        overview.add(after);
    }
    Ok(overview.rows)
}

/// All rows of a stream between two instants, nanoseconds since 1970.
async fn rows(
    connection: &mut Connection,
    stream: &StreamRow,
    (from, to): (i64, i64),
) -> Result<Rows, StoreError> {
    let rows = blocks::between(connection, stream, Span { from, to }, usize::MAX).await?;
    Ok(rows.unwrap_or_else(|| Rows::of_columns(stream.signals.len())))
}

/// Rows of stretches, as many of each as its length says.
struct Overview {
    rows: Rows,
    /// How many rows there are to be at the most.
    most: u64,
    /// How many rows the stretches have together.
    of: u64,
}

impl Overview {
    fn add(&mut self, stretch: Rows) {
        if self.of <= self.most {
            return self.rows.append(stretch);
        }
        let share = (stretch.rows() as u64 * self.most).div_ceil(self.of);
        let share = usize::try_from(share).expect("no more than there are");
        self.rows.append(stretch.thinned(share));
    }
}

/// The blocks that lie in a span as a whole.
struct Within {
    /// From the first instant of the first block up to the end of the last; where there are no blocks, nothing at
    /// the end of the span.
    blocks: Span,
    rows: u64,
    rows_of_extremes: u64,
}

impl Within {
    async fn read(
        connection: &mut Connection,
        stream: &StreamRow,
        span: Span,
    ) -> Result<Self, StoreError> {
        let row = database::query(
            "select min(stream_blocks.first_ns) as begins, max(stream_blocks.last_ns) as ends, \
             cast(coalesce(sum(stream_blocks.rows), 0) as bigint) as rows, \
             cast(coalesce(sum(stream_extremes.rows), 0) as bigint) as rows_of_extremes \
             from stream_blocks left join stream_extremes \
             on stream_extremes.stream = stream_blocks.stream \
             and stream_extremes.first_ns = stream_blocks.first_ns \
             where stream_blocks.stream = $1 and stream_blocks.first_ns >= $2 \
             and stream_blocks.first_ns < $3 and last_ns < $3",
        )
        .bind(stream.identity())
        .bind(span.from)
        .bind(span.to)
        .fetch_one(connection)
        .await?;
        let ends: Option<i64> = row.try_get("ends")?;
        Ok(Self {
            blocks: Span {
                from: row.try_get::<Option<i64>>("begins")?.unwrap_or(span.to),
                to: ends.map_or(span.to, |last| last.saturating_add(1)),
            },
            rows: row.try_get::<i64>("rows")?.unsigned_abs(),
            rows_of_extremes: row.try_get::<i64>("rows_of_extremes")?.unsigned_abs(),
        })
    }
}

/// Adds the extremes of the blocks of a span that has no part of a block.
async fn of_extremes(
    connection: &mut Connection,
    stream: &StreamRow,
    span: Span,
    overview: &mut Overview,
) -> Result<(), StoreError> {
    let identity = stream.identity();
    let mut rest = span;
    while rest.from < rest.to {
        let blocks = database::query(
            "select stream_blocks.first_ns as begins, stream_blocks.last_ns as ends, \
             stream_extremes.stream, stream_extremes.first_ns, stream_extremes.rows, \
             stream_extremes.samples, stream_extremes.seal from stream_blocks \
             left join stream_extremes on stream_extremes.stream = stream_blocks.stream \
             and stream_extremes.first_ns = stream_blocks.first_ns \
             where stream_blocks.stream = $1 and stream_blocks.first_ns >= $2 \
             and stream_blocks.first_ns < $3 order by stream_blocks.first_ns limit $4",
        )
        .bind(&identity)
        .bind(rest.from)
        .bind(rest.to)
        .bind(BLOCKS_AT_ONCE)
        .fetch_all(&mut *connection)
        .await?;
        let Some(last) = blocks.last() else {
            break;
        };
        rest.from = last.try_get::<i64>("ends")?.saturating_add(1);
        for block in &blocks {
            let rows = extremes(connection, stream, block).await?;
            overview.add(rows);
        }
    }
    Ok(())
}

/// The extremes of a block, which are stored beside it where the block is long and was stored since there are
/// extremes.
async fn extremes(
    connection: &mut Connection,
    stream: &StreamRow,
    block: &Row,
) -> Result<Rows, StoreError> {
    if block.try_get::<Option<i64>>("rows")?.is_some() {
        return decode(&STREAM_EXTREMES, block, stream.signals.len());
    }
    let (begins, ends): (i64, i64) = (block.try_get("begins")?, block.try_get("ends")?);
    let rows = rows(connection, stream, (begins, ends.saturating_add(1))).await?;
    Ok(rows.thinned(EXTREMES_ROWS))
}
