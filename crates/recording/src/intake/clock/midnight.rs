//! Times of day without a date that go on past midnight, and numbers whose beginning the head of a source tells.

use super::spelling::Spelling;
use super::{Clock, ClockFault};
use crate::intake::cell::Cell;
use crate::intake::options::TimeUnit;
use crate::nanoseconds;

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// How far a time of day falls at midnight at the least `[s]`. What falls less may be another recording. A sample from
/// before a midnight may also come late, and rise as far.
const FALL: f64 = 20.0 * 3600.0;

impl Clock {
    /// A time of day without a date, on the day of the sample `before` it or on a day beside that. Both are seconds:
    /// the time since midnight, as the `first` one, and the sample since that.
    pub(super) fn on_its_day(&mut self, time: f64, first: f64, before: Option<f64>) -> f64 {
        let is_of_day = |time: f64| (0.0..DAY).contains(&time);
        let Some(before) =
            before.filter(|_| self.lacks_date && is_of_day(time) && is_of_day(first))
        else {
            return time;
        };
        let day = ((first + before) / DAY).floor();
        let since_before = time + day * DAY - first - before;
        let days = if since_before < -FALL {
            day + 1.0
        } else if since_before > FALL && day > 0.0 {
            day - 1.0
        } else {
            day
        };
        self.midnights = self.midnights.max(days as usize);
        time + days * DAY
    }

    /// The instant of the first number of a time, which is so many seconds behind the beginning in the head of the
    /// source, in nanoseconds since 1970; none where no head has one.
    pub(super) fn begin_of_numbers(&mut self, seconds: f64) -> Result<Option<i64>, ClockFault> {
        let Some(begin) = self.options.begin.clone() else {
            return Ok(None);
        };
        let day_first = match self.options.unit {
            Some(TimeUnit::Dates { day_first }) => Some(day_first),
            _ => None,
        };
        let begin = self.instant(&Cell::Text(&begin), Spelling::Stamp { day_first }, None)?;
        Ok(begin.checked_add(nanoseconds(seconds)))
    }
}
