//! Cells that say behind their number how good it is: `3.200 (Good NonSpecific)`.

use crate::Class;

/// How many numbers of a column are of which class.
#[derive(Debug, Default)]
pub(super) struct Statuses {
    count: usize,
    uncertain: usize,
    bad: usize,
}

impl Statuses {
    /// Counts a number with its class.
    pub(super) fn take(&mut self, class: Class) {
        self.count += 1;
        match class {
            Class::Bad => self.bad += 1,
            Class::Uncertain => self.uncertain += 1,
            Class::Good | Class::Substituted => {}
        }
    }

    /// A sentence on the cells that have a status.
    pub(super) fn told(&self) -> Option<String> {
        let Self {
            count,
            uncertain,
            bad,
        } = self;
        (*count > 0).then(|| {
            format!(
                "{count} cells have a status behind their number: {bad} bad ones are missing samples, {uncertain} \
                 uncertain ones were kept"
            )
        })
    }
}
