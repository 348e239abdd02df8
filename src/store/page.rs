//! Lists in pages.

/// A page of a list that is ordered newest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Page<T, Id> {
    /// The rows.
    pub rows: Vec<T>,
    /// The last row's identifier, when more rows follow.
    pub next: Option<Id>,
}

impl<T, Id> Page<T, Id> {
    /// A page from one row more than its limit, if there are so many.
    pub(super) fn cut(mut rows: Vec<T>, limit: u32, id: impl Fn(&T) -> Id) -> Self {
        let more = rows.len() > limit as usize;
        rows.truncate(limit as usize);
        let next = rows.last().filter(|_| more).map(id);
        Self { rows, next }
    }
}
