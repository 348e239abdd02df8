//! What a clock had to assume.

use super::Clock;
use crate::{TICK, Warning, is_beyond_nanoseconds};

impl Clock {
    /// Warnings about what the clock had to assume.
    pub(in crate::intake) fn notes(&self) -> Vec<Warning> {
        let mut notes = Vec::new();
        if let Some(unit) = self.guessed_unit {
            let detail = format!(
                "`{}` does not say its unit: by the size of its numbers they were read as {unit}; \
                 `time_unit` says otherwise",
                self.name
            );
            notes.push(Warning::of_recording("time_unit_from_size", detail));
        }
        if self.are_supposed_seconds && !self.name.is_empty() {
            let detail = format!(
                "`{}` does not say its unit: its numbers were read as seconds; `time_unit` says otherwise",
                self.name
            );
            notes.push(Warning::of_recording("time_unit_assumed", detail));
        }
        if self.is_fine && is_beyond_nanoseconds(self.farthest) {
            let detail = format!(
                "times {} s apart are told to {TICK} ns: finer stamps were rounded to that",
                crate::shown(self.farthest)
            );
            notes.push(Warning::of_recording("rounded_stamps", detail));
        }
        if self.lacks_date && !self.name.is_empty() {
            let detail = format!(
                "`{}` has times without a date: nothing says when the recording began",
                self.name
            );
            notes.push(Warning::of_recording("times_without_date", detail));
        }
        if self.midnights > 0 {
            let detail = format!(
                "`{}` has times of day that fall by nearly a day: from there on they were read as of the next day, \
                 {} times",
                self.name, self.midnights
            );
            notes.push(Warning::of_recording("next_day", detail));
        }
        if self.folds > 0 {
            let detail = format!(
                "{} local times came twice because clocks were set back; they were told apart by \
                 their order",
                self.folds
            );
            notes.push(Warning::of_recording("daylight_saving_fold", detail));
        }
        notes
    }
}
