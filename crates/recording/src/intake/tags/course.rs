//! Whether a tag is held from one sample to the next, or moves there, where nobody says so.
//!
//! A command, a set point or a state is recorded when it changes: few different values, far apart or at uneven
//! instants. A line between two of them would be a ramp that nobody commanded.

use super::tag::Tag;
use crate::{Interpolation, Warning, shown};

/// A tag of more different values is no command by its values alone.
const FEW_VALUES: usize = 8;

/// The median interval of a tag that is recorded on change is so many times that of the fastest tag.
const FAR_APART: f64 = 10.0;

/// A long interval of a tag at uneven instants is so many times a short one.
const UNEVEN: f64 = 3.0;

impl Tag {
    /// Settles how the tag goes on from one sample to the next, where nobody says so, beside a fastest tag of this
    /// median interval `[s]`; what was assumed is told.
    pub(super) fn settle_course(&mut self, fastest: f64) -> Option<Warning> {
        let mut intervals: Vec<f64> = self
            .instants
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect();
        intervals.sort_unstable_by(f64::total_cmp);
        let median = *intervals.get(intervals.len() / 2)?;
        match self.column.interpolation {
            Some(Interpolation::Hold) => return None,
            Some(Interpolation::Linear) => return self.bridged(&intervals, median),
            None => {}
        }
        // A tenth at either end may be gaps and jitter.
        let [short, long] = [1, 9].map(|tenths| intervals[intervals.len() * tenths / 10]);
        let is_uneven = long > UNEVEN * short;
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

    /// Tells of gaps that are filled because the source says that the tag goes straight on.
    fn bridged(&self, intervals: &[f64], median: f64) -> Option<Warning> {
        let gaps = intervals
            .iter()
            .filter(|interval| **interval > FAR_APART * median);
        let (count, longest) = (gaps.count(), intervals.last().copied()?);
        let detail = format!(
            "{count} gaps, the longest of {} s, were filled on a straight line, because the source says that it goes \
             straight on; leave them out of a job with `exclude`, or say another `interpolation`",
            shown(longest)
        );
        (count > 0).then(|| Warning::of_signal("bridged_gap", &self.column.name, detail))
    }
}
