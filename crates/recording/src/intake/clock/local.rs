//! Instants of local times.

use super::{Clock, ClockFault, not_a_time, unix_nanoseconds};
use crate::DoubleHour;
use crate::intake::cell::Cell;
use jiff::Timestamp;
use jiff::civil::DateTime;

impl Clock {
    /// The instant of a local time of the zone that the options name, nanoseconds since 1970.
    pub(super) fn local(
        &mut self,
        local: DateTime,
        cell: &Cell<'_>,
        before: Option<i64>,
    ) -> Result<i64, ClockFault> {
        let Some((name, zone)) = &self.options.zone else {
            let detail = format!(
                "timestamp `{}` has no time zone offset; write it as 2026-03-02T08:15:00Z or say \
                 the zone with `tz`, such as Europe/Berlin",
                cell
            );
            return Err(("no_offset", detail));
        };
        let ambiguous = zone.to_ambiguous_timestamp(local);
        let resolve = |resolved: Result<Timestamp, jiff::Error>| {
            let instant = resolved.ok();
            instant
                .and_then(unix_nanoseconds)
                .ok_or_else(|| not_a_time(cell))
        };
        match ambiguous.offset() {
            jiff::tz::AmbiguousOffset::Gap { .. } => {
                let detail = format!("there was no {local} in {name}: clocks were set forward");
                Err(("no_such_local_time", detail))
            }
            jiff::tz::AmbiguousOffset::Fold { .. } => {
                self.folds += 1;
                let first_pass = resolve(ambiguous.earlier())?;
                let second_pass = resolve(ambiguous.later())?;
                if before.is_some_and(|before| first_pass <= before) {
                    self.is_told_by_order = true;
                    return Ok(second_pass);
                }
                let hour = || DoubleHour::in_zone(zone, first_pass, second_pass);
                self.double_hour = self.double_hour.or_else(hour);
                Ok(first_pass)
            }
            jiff::tz::AmbiguousOffset::Unambiguous { .. } => resolve(ambiguous.compatible()),
        }
    }

    /// The instant of a local time with letters for its zone that several zones share.
    pub(super) fn lettered(&self, local: DateTime, letters: &str) -> Result<i64, ClockFault> {
        let Some((name, zone)) = &self.options.zone else {
            let detail =
                format!("`{letters}` is no one zone; say which with `tz`, such as Europe/London");
            return Err(("ambiguous_zone", detail));
        };
        let passes = zone.to_ambiguous_timestamp(local);
        let passes = [passes.earlier(), passes.later()];
        let is_it = |instant: &Timestamp| {
            zone.to_offset_info(*instant).abbreviation() == letters
                && zone.to_datetime(*instant) == local
        };
        let instant = passes.into_iter().flatten().find(is_it);
        instant.and_then(unix_nanoseconds).ok_or_else(|| {
            let detail =
                format!("there was no {local} {letters} in {name}; `tz` says another zone");
            ("no_such_local_time", detail)
        })
    }
}
