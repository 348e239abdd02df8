//! Rows that were read lately, kept in memory until they change.
//!
//! A row is forgotten after the commit that changes it and before anybody is told of the commit:
//! who has seen a change never sees what was there before it. The first that reads a row says so; a row
//! that changes meanwhile is not kept.

use std::hash::Hash;
use std::sync::Arc;
use std::time::Duration;

use quick_cache::sync::{Cache, DefaultLifecycle, GuardResult, PlaceholderGuard};
use quick_cache::{DefaultHashBuilder, UnitWeighter};

/// Rows that are kept at the most.
const LIMIT: usize = 512;

/// Rows by their identifier; nothing where no row may be kept. Cheap to clone.
#[derive(Clone)]
pub(super) struct RowCache<Id, Row>(Option<Arc<Cache<Id, Arc<Row>>>>);

type RowGuard<'a, Id, Row> = PlaceholderGuard<
    'a,
    Id,
    Arc<Row>,
    UnitWeighter,
    DefaultHashBuilder,
    DefaultLifecycle<Id, Arc<Row>>,
>;

/// The right to keep a row that is read, unless the row changes meanwhile; nothing where another
/// reader has the right.
pub(super) struct RowReading<'a, Id, Row>(Option<RowGuard<'a, Id, Row>>);

impl<Id: Copy + Eq + Hash, Row> RowCache<Id, Row> {
    /// A cache that keeps rows, or none.
    pub(super) fn new(keeps: bool) -> Self {
        Self(keeps.then(|| Arc::new(Cache::new(LIMIT))))
    }

    /// The row, if it is kept; else the reader goes and reads it.
    pub(super) fn get(&self, id: Id) -> Result<Arc<Row>, RowReading<'_, Id, Row>> {
        let Some(cache) = &self.0 else {
            return Err(RowReading(None));
        };
        match cache.get_value_or_guard(&id, Some(Duration::ZERO)) {
            GuardResult::Value(row) => Ok(row),
            GuardResult::Guard(guard) => Err(RowReading(Some(guard))),
            GuardResult::Timeout => Err(RowReading(None)),
        }
    }

    /// Forgets a row that has changed.
    pub(super) fn forget(&self, id: Id) {
        if let Some(cache) = &self.0 {
            cache.remove(&id);
        }
    }
}

impl<Id: Eq + Hash, Row> RowReading<'_, Id, Row> {
    /// Keeps the row that was read.
    pub(super) fn keep(self, row: &Arc<Row>) {
        if let Some(guard) = self.0 {
            // A row that has changed meanwhile is refused.
            let _refused = guard.insert(row.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(cache: &RowCache<usize, usize>, id: usize) {
        let reading = cache.get(id).expect_err("it is not kept");
        reading.keep(&Arc::new(id));
    }

    #[test]
    fn a_row_is_kept_until_it_changes() {
        let cache = RowCache::<usize, usize>::new(true);
        read(&cache, 1);
        assert_eq!(cache.get(1).ok().as_deref(), Some(&1));
        cache.forget(1);
        assert!(cache.get(1).is_err());
    }

    #[test]
    fn what_changes_while_it_is_read_is_not_kept() {
        let cache = RowCache::<usize, usize>::new(true);
        let before = cache.get(1).expect_err("it is not kept");
        cache.forget(1);
        let after = cache.get(1).expect_err("it is not kept");
        before.keep(&Arc::new(10));
        assert!(cache.get(1).is_err());
        after.keep(&Arc::new(11));
        assert_eq!(cache.get(1).ok().as_deref(), Some(&11));
    }

    #[test]
    fn a_second_reader_does_not_wait_for_the_first() {
        let cache = RowCache::<usize, usize>::new(true);
        let first = cache.get(1).expect_err("it is not kept");
        let second = cache.get(1).expect_err("it is not kept");
        second.keep(&Arc::new(2));
        first.keep(&Arc::new(1));
        assert_eq!(cache.get(1).ok().as_deref(), Some(&1));
    }

    #[test]
    fn where_nothing_may_be_kept_everything_is_read() {
        let cache = RowCache::<usize, usize>::new(false);
        read(&cache, 1);
        assert!(cache.get(1).is_err());
    }

    #[test]
    fn the_rows_that_are_kept_are_bounded() {
        let cache = RowCache::<usize, usize>::new(true);
        for id in 0..8 * LIMIT {
            read(&cache, id);
        }
        let kept = (0..8 * LIMIT).filter(|id| cache.get(*id).is_ok()).count();
        assert!((1..=LIMIT).contains(&kept), "{kept}");
    }
}
