//! What was read lately, kept in memory until it changes.
//!
//! A row is forgotten after the commit that changes it and before anybody is told of the commit:
//! who has seen a change never sees what was there before it. A reader says that it begins to
//! read; what changes meanwhile is not kept.

use std::collections::{HashMap, VecDeque};
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Rows that are kept at the most.
pub(super) const LIMIT: usize = 512;

/// Rows by their identifier. Cheap to clone.
pub(super) struct RowCache<Id, Row>(Arc<Mutex<Kept<Id, Row>>>);

struct Kept<Id, Row> {
    rows: HashMap<Id, Entry<Row>>,
    /// The oldest first; an identifier that was forgotten may still be here.
    order: VecDeque<Id>,
    /// The readings so far.
    readings: u64,
    limit: usize,
}

enum Entry<Row> {
    Reading(u64),
    Read(Arc<Row>),
}

/// The right to keep what was read, unless it changed meanwhile.
pub(super) struct Reading(u64);

impl<Id: Copy + Eq + Hash, Row> RowCache<Id, Row> {
    /// Keeps so many rows at the most.
    pub(super) fn new(limit: usize) -> Self {
        Self(Arc::new(Mutex::new(Kept {
            rows: HashMap::new(),
            order: VecDeque::new(),
            readings: 0,
            limit,
        })))
    }

    /// The row, if it is kept; else the reader goes and reads it.
    pub(super) fn get(&self, id: Id) -> Result<Arc<Row>, Reading> {
        let mut kept = self.kept();
        if let Some(Entry::Read(row)) = kept.rows.get(&id) {
            return Ok(row.clone());
        }
        kept.readings += 1;
        let reading = kept.readings;
        if kept.rows.insert(id, Entry::Reading(reading)).is_none() {
            kept.order.push_back(id);
        }
        if kept.order.len() > kept.limit
            && let Some(oldest) = kept.order.pop_front()
        {
            kept.rows.remove(&oldest);
        }
        Err(Reading(reading))
    }

    /// Keeps a row that was read.
    pub(super) fn keep(&self, id: Id, Reading(reading): Reading, row: &Arc<Row>) {
        let mut kept = self.kept();
        if let Some(entry) = kept.rows.get_mut(&id)
            && matches!(entry, Entry::Reading(begun) if *begun == reading)
        {
            *entry = Entry::Read(row.clone());
        }
    }

    /// Forgets a row that has changed.
    pub(super) fn forget(&self, id: Id) {
        self.kept().rows.remove(&id);
    }

    fn kept(&self) -> MutexGuard<'_, Kept<Id, Row>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<Id, Row> Clone for RowCache<Id, Row> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(cache: &RowCache<usize, usize>, id: usize) {
        let reading = cache.get(id).expect_err("it is not kept");
        cache.keep(id, reading, &Arc::new(id));
    }

    #[test]
    fn a_row_is_kept_until_it_changes() {
        let cache = RowCache::<usize, usize>::new(LIMIT);
        read(&cache, 1);
        assert_eq!(cache.get(1).ok().as_deref(), Some(&1));
        cache.forget(1);
        assert!(cache.get(1).is_err());
    }

    #[test]
    fn what_changes_while_it_is_read_is_not_kept() {
        let cache = RowCache::<usize, usize>::new(LIMIT);
        let before = cache.get(1).expect_err("it is not kept");
        cache.forget(1);
        let after = cache.get(1).expect_err("it is not kept");
        cache.keep(1, before, &Arc::new(10));
        assert!(cache.get(1).is_err());
        cache.keep(1, after, &Arc::new(11));
        assert!(cache.get(1).is_err(), "another reading has begun since");
    }

    #[test]
    fn where_nothing_may_be_kept_everything_is_read() {
        let cache = RowCache::<usize, usize>::new(0);
        read(&cache, 1);
        assert!(cache.get(1).is_err());
        assert!(cache.kept().rows.is_empty());
    }

    #[test]
    fn the_rows_that_are_kept_are_bounded() {
        let cache = RowCache::<usize, usize>::new(LIMIT);
        for id in (0..3).flat_map(|_| 0..2 * LIMIT) {
            cache.forget(id);
            read(&cache, id);
        }
        let kept = cache.kept();
        assert!(kept.rows.len() <= LIMIT && kept.order.len() <= LIMIT);
        assert!(matches!(
            kept.rows.get(&(2 * LIMIT - 1)),
            Some(Entry::Read(_))
        ));
    }
}
