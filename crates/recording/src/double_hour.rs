//! The local hour that comes twice in a year.

use std::ops::Range;

use jiff::Timestamp;
use jiff::tz::TimeZone;

/// A local hour that came twice because clocks were set back. A source that writes local times
/// without an offset writes each of them twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DoubleHour {
    /// When clocks were set back: the end of the first pass, nanoseconds since 1970.
    pub end_ns: i64,
    /// How far clocks were set back: the length of each pass `[ns]`.
    pub length_ns: i64,
}

impl DoubleHour {
    /// The hour that came twice in a zone, by the two instants that one of its local times stands
    /// for; nothing where the zone's clocks were not set back after the first.
    pub(crate) fn in_zone(zone: &TimeZone, first_ns: i64, second_ns: i64) -> Option<Self> {
        let first = Timestamp::from_nanosecond(first_ns.into()).ok()?;
        let set_back = zone.following(first).next()?.timestamp();
        Some(Self {
            end_ns: i64::try_from(set_back.as_nanosecond()).ok()?,
            length_ns: second_ns - first_ns,
        })
    }

    /// The instants of the first pass, nanoseconds since 1970.
    #[must_use]
    pub fn first_pass(&self) -> Range<i64> {
        self.end_ns - self.length_ns..self.end_ns
    }
}
