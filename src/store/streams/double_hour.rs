//! Local times of an hour that came twice because clocks were set back: which of its two passes a
//! batch is of, told by what the stream holds.
//!
//! The rules, in their order:
//! 1. a second pass that would lie ahead of the server's clock has not come: the batch is of the first;
//! 2. a pass that holds exactly these samples is theirs: the batch came again;
//! 3. of two passes the batch is of the one that has fewer samples of its signals where it would lie;
//! 4. where neither has any, it is of the first if nothing follows there: samples come in their order;
//!    else of the one that leaves it the wider gap;
//! 5. else nothing tells, and the batch is refused.

use std::ops::ControlFlow;

use jiff::Timestamp;

use super::blocks::{self, Order, Span};
use super::stream::{StreamRow, now_ns};
use crate::store::StoreError;
use crate::store::writer::Tx;
use greybox::recording::{DoubleHour, Rows, Warning};

/// How far a source's clock may be ahead of the server's: five minutes [ns].
const CLOCKS_DIFFER_NS: i64 = 300 * 1_000_000_000;

/// A batch whose pass is told.
pub(super) struct Settled {
    /// The rows at the instants of that pass.
    pub(super) rows: Rows,
    /// What was told, for its report.
    pub(super) told: Warning,
}

/// How a batch would lie in a pass.
#[derive(Debug, PartialEq, Eq)]
struct Place {
    /// Whether the stream holds exactly these samples there.
    is_repeat: bool,
    /// Instants of the stream between the first and the last of the batch.
    occupied: usize,
    /// The time from the instant before the batch to the one behind it [ns]; where none follows, one
    /// is taken to follow at the distance of the one before.
    gap: i64,
    /// Whether the stream has no sample behind the batch.
    is_open: bool,
}

/// Moves rows that were read as those of the first pass to the pass that they are of; nothing where
/// that cannot be told.
pub(super) async fn settle(
    tx: &mut Tx,
    stream: &StreamRow,
    rows: Rows,
    hour: DoubleHour,
) -> Result<Option<Settled>, StoreError> {
    let first_pass = hour.first_pass();
    let in_hour = rows.within(first_pass.start, first_pass.end);
    let after = rows.within(first_pass.end, i64::MAX);
    let shifted = in_hour.shifted(hour.length_ns);
    let begins_at = shifted.instants.first().copied().unwrap_or(i64::MAX);
    let is_second = if begins_at > now_ns().saturating_add(CLOCKS_DIFFER_NS) {
        false
    } else {
        let reach = Reach {
            stream,
            far: hour.length_ns,
            next: after.instants.first().copied(),
        };
        let first = reach.place(tx, &in_hour).await?;
        let second = reach.place(tx, &shifted).await?;
        match is_second(&first, &second) {
            Some(is_second) => is_second,
            None => return Ok(None),
        }
    };
    let mut settled = if is_second { shifted } else { in_hour };
    let told = told(&settled, hour, is_second);
    settled = settled.merge(&after).0;
    Ok(Some(Settled {
        rows: settled,
        told,
    }))
}

/// Whether a batch is of the second pass; nothing where that cannot be told.
fn is_second(first: &Place, second: &Place) -> Option<bool> {
    if first.is_repeat || second.is_repeat {
        return Some(!first.is_repeat);
    }
    if first.occupied != second.occupied {
        return Some(second.occupied < first.occupied);
    }
    (first.occupied == 0).then_some(!first.is_open && second.gap > first.gap)
}

fn told(rows: &Rows, hour: DoubleHour, is_second: bool) -> Warning {
    let stamp = |ns: Option<&i64>| {
        let stamp = ns.and_then(|ns| Timestamp::from_nanosecond((*ns).into()).ok());
        stamp.map_or_else(String::new, |stamp| stamp.to_string())
    };
    let pass = if is_second { "second" } else { "first" };
    let detail = format!(
        "local times of the hour that came twice before {}: by what the stream holds they are of its \
         {pass} pass, {} to {}; times with an offset need no guess",
        stamp(Some(&(hour.end_ns + hour.length_ns))),
        stamp(rows.instants.first()),
        stamp(rows.instants.last()),
    );
    Warning::of_recording("double_hour", detail)
}

/// Where a stream is looked at around a batch.
struct Reach<'a> {
    stream: &'a StreamRow,
    /// How far beside the batch [ns].
    far: i64,
    /// The next instant of the batch behind the hour.
    next: Option<i64>,
}

impl Reach<'_> {
    /// How rows would lie.
    async fn place(&self, tx: &mut Tx, rows: &Rows) -> Result<Place, StoreError> {
        let (Some(first), Some(last)) = (rows.instants.first(), rows.instants.last()) else {
            return Ok(Place {
                is_repeat: false,
                occupied: 0,
                gap: i64::MAX,
                is_open: true,
            });
        };
        let signals = rows.signals_said();
        let within = Span {
            from: *first,
            to: last.saturating_add(1),
        };
        let (mut occupied, mut repeated) = (0, 0);
        let count = |part: Rows| {
            occupied += part.says_of(&signals).count();
            repeated += part.repeated(rows);
            ControlFlow::<()>::Continue(())
        };
        let in_order = (within, Order::OldestFirst);
        blocks::visit(tx, self.stream, in_order, count).await?;
        let before = Span {
            from: first.saturating_sub(self.far),
            to: *first,
        };
        let newest = |part: Rows| match part.says_of(&signals).next_back() {
            Some(instant) => ControlFlow::Break(instant),
            None => ControlFlow::Continue(()),
        };
        let newest = blocks::visit(tx, self.stream, (before, Order::NewestFirst), newest).await?;
        let behind = Span {
            from: within.to,
            to: self.next.unwrap_or(within.to.saturating_add(2 * self.far)),
        };
        let oldest = |part: Rows| match part.says_of(&signals).next() {
            Some(instant) => ControlFlow::Break(instant),
            None => ControlFlow::Continue(()),
        };
        let oldest = blocks::visit(tx, self.stream, (behind, Order::OldestFirst), oldest).await?;
        let since = first - newest.unwrap_or(before.from);
        let until = oldest.or(self.next).map_or(since, |next| next - last);
        Ok(Place {
            is_repeat: repeated == rows.rows(),
            occupied,
            gap: since + (last - first) + until,
            is_open: oldest.is_none(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(occupied: usize, gap: i64) -> Place {
        Place {
            is_repeat: false,
            occupied,
            gap,
            is_open: false,
        }
    }

    #[test]
    fn a_batch_goes_where_it_was_before_else_where_there_is_room() {
        let repeat = Place {
            is_repeat: true,
            ..place(9, 1)
        };
        assert_eq!(is_second(&repeat, &place(0, 9)), Some(false));
        assert_eq!(is_second(&place(9, 1), &repeat), Some(true));
        assert_eq!(is_second(&place(9, 1), &place(0, 9)), Some(true));
        assert_eq!(is_second(&place(0, 1), &place(9, 9)), Some(false));
        assert_eq!(is_second(&place(0, 2), &place(0, 3600)), Some(true));
        assert_eq!(is_second(&place(0, 7), &place(0, 7)), Some(false));
        assert_eq!(is_second(&place(3, 7), &place(3, 9)), None);
        let open = Place {
            is_open: true,
            ..place(0, 7)
        };
        assert_eq!(is_second(&open, &place(0, 9)), Some(false));
    }
}
