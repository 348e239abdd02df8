//! What was looked at, so that a design goes on where it was left.

use crate::uncertainty::design::Assessment;
use serde::{Deserialize, Serialize};
use std::cell::{Cell, RefCell};

/// What experiments would bring, in the order in which they were looked at. Nothing is drawn in the
/// search: begun anew it asks for the same experiments in the same order, and those that are here
/// are not simulated again.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Looked(Vec<Assessment>);

impl Looked {
    /// How many experiments were looked at.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether none was.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// One pass of the search from its beginning.
pub(super) struct Pass<'a> {
    looked: RefCell<&'a mut Looked>,
    /// The place of the next that is asked for.
    next: Cell<usize>,
    /// How many more may be simulated.
    room: Cell<usize>,
}

impl<'a> Pass<'a> {
    /// A pass that may add so many.
    pub(super) fn new(looked: &'a mut Looked, room: usize) -> Self {
        Self {
            looked: RefCell::new(looked),
            next: Cell::new(0),
            room: Cell::new(room),
        }
    }

    /// The next assessment: a known one, or what `look` finds. Answers nothing from where `look` does
    /// or the room is used up.
    pub(super) fn next(&self, look: impl FnOnce() -> Option<Assessment>) -> Option<Assessment> {
        let place = self.next.get();
        let known = self.looked.borrow().0.get(place).cloned();
        let assessment = match known {
            Some(known) => known,
            None if self.room.get() == 0 => return None,
            None => {
                let Some(found) = look() else {
                    self.room.set(0);
                    return None;
                };
                self.room.set(self.room.get() - 1);
                self.looked.borrow_mut().0.push(found.clone());
                found
            }
        };
        self.next.set(place + 1);
        Some(assessment)
    }
}
