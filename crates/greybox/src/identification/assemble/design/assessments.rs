//! The experiments that were assessed, so that a design goes on where the design was left.

use crate::uncertainty::design::Assessment;
use serde::{Deserialize, Serialize};
use std::cell::{Cell, RefCell};

/// What experiments would bring, in the order in which they were assessed. Nothing is drawn in the
/// search: begun anew the search asks for the same experiments in the same order, and those that are
/// here are not simulated again.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Assessments(Vec<Assessment>);

impl Assessments {
    /// How many experiments were assessed.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether no experiment was assessed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// One pass of the search from its beginning.
pub(super) struct Pass<'a> {
    assessments: RefCell<&'a mut Assessments>,
    /// The index of the assessment that is asked for next.
    next: Cell<usize>,
    /// How many more experiments may be simulated.
    room: Cell<usize>,
}

impl<'a> Pass<'a> {
    /// A pass that may add so many assessments.
    pub(super) fn new(assessments: &'a mut Assessments, room: usize) -> Self {
        Self {
            assessments: RefCell::new(assessments),
            next: Cell::new(0),
            room: Cell::new(room),
        }
    }

    /// The next assessment: a kept one, or what `assess` finds. Answers nothing from where `assess`
    /// does or the room is used up.
    pub(super) fn next(&self, assess: impl FnOnce() -> Option<Assessment>) -> Option<Assessment> {
        let index = self.next.get();
        let kept = self.assessments.borrow().0.get(index).cloned();
        let assessment = match kept {
            Some(assessment) => assessment,
            None if self.room.get() == 0 => return None,
            None => {
                let Some(assessment) = assess() else {
                    self.room.set(0);
                    return None;
                };
                self.room.set(self.room.get() - 1);
                self.assessments.borrow_mut().0.push(assessment.clone());
                assessment
            }
        };
        self.next.set(index + 1);
        Some(assessment)
    }
}
