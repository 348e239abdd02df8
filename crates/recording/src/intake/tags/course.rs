//! Whether a tag is held from one sample to the next, or moves there, where nobody says so.
//!
//! A command, a set point or a state is recorded when it changes: few different values, far apart or at uneven
//! instants. A line between two of them would be a ramp that nobody commanded.

use super::tag::Tag;
use crate::{Interpolation, Warning};

/// A tag of more different values is no command by its values alone.
const FEW_VALUES: usize = 8;

/// The median interval of a tag that is recorded on change is so many times that of the fastest tag.
const FAR_APART: f64 = 10.0;

/// The longest interval of a tag at uneven instants is so many times the shortest.
const UNEVEN: f64 = 3.0;

impl Tag {
    /// Settles how the tag goes on from one sample to the next, where nobody says so, beside a fastest tag of this
    /// median interval `[s]`; what was assumed is told.
    pub(super) fn settle_course(&mut self, fastest: f64) -> Option<Warning> {
        if self.column.interpolation.is_some() || self.instants.len() < 2 {
            return None;
        }
        let mut intervals: Vec<f64> = self
            .instants
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect();
        intervals.sort_unstable_by(f64::total_cmp);
        let median = intervals[intervals.len() / 2];
        let is_uneven = intervals[intervals.len() - 1] > UNEVEN * intervals[0];
        if !is_uneven && median < FAR_APART * fastest {
            return None;
        }
        let mut values: Vec<f64> = self
            .values
            .iter()
            .copied()
            .filter(|value| !value.is_nan())
            .collect();
        values.sort_unstable_by(f64::total_cmp);
        values.dedup();
        if values.len() <= FEW_VALUES {
            self.column.interpolation = Some(Interpolation::Hold);
            let detail = format!(
                "its {} different values are taken for a command or a state: each was held until the next; \\
                 `interpolation` says otherwise",
                values.len()
            );
            return Some(Warning::of_signal("held", &self.column.name, detail));
        }
        is_uneven.then(|| {
            let detail = "it was recorded at uneven instants and interpolated linearly; `interpolation` says \\
                          `hold` for a command that is recorded when it changes";
            Warning::of_signal("may_be_held", &self.column.name, detail.to_owned())
        })
    }
}
