//! The stamps of a batch: there have to be some, and none may lie too far ahead of the clock.

use jiff::Timestamp;

use crate::api::Limits;
use crate::api::error::{Answer, Kind, Problem};
use crate::monitor::state::instant;
use greybox::intake;
use greybox::parsing::Fault;
use greybox::recording::{Batch, Recording};

/// The latest stamp that a sample may have.
pub(in crate::api) fn latest(limits: &Limits) -> Timestamp {
    let ahead = jiff::SignedDuration::try_from(limits.stamps_ahead).unwrap_or_default();
    let latest = Timestamp::now().checked_add(ahead);
    latest.unwrap_or(Timestamp::MAX)
}

/// The batch of a recording; what is wrong with its stamps is a fault.
pub(super) fn batch(recording: Recording, latest: Timestamp) -> Answer<Batch> {
    let batch = Batch::of(recording).ok_or_else(|| {
        let detail = "the samples do not say when they were taken; a stream needs timestamps, or \
                      `start` in JSON";
        invalid("no_start", detail.to_owned())
    })?;
    let ahead = batch.after(nanoseconds(latest));
    if ahead.is_empty() {
        return Ok(batch);
    }
    let faults = ahead.iter().take(intake::MAX_FAULTS).map(|ahead| {
        let detail = format!(
            "`{}` has {} samples after {latest}, the first at {}: further ahead of this server's \
             clock than stamps may be. Nothing of the batch is stored; send it without them, or mend \
             the clock that made them",
            ahead.signal,
            ahead.samples,
            instant(ahead.first_ns),
        );
        Fault::of_whole("stamp_in_future", detail)
    });
    Err(Problem::of_faults(Kind::Invalid, faults))
}

/// An instant in nanoseconds since 1970; the nearest that 64 bits hold.
pub(in crate::api) fn nanoseconds(instant: Timestamp) -> i64 {
    let nearest = match instant < Timestamp::UNIX_EPOCH {
        true => i64::MIN,
        false => i64::MAX,
    };
    i64::try_from(instant.as_nanosecond()).unwrap_or(nearest)
}

/// The samples are not what they have to be.
pub(super) fn invalid(code: &'static str, detail: String) -> Problem {
    Problem::of_faults(Kind::Invalid, [Fault::of_whole(code, detail)])
}
