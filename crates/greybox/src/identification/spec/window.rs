//! The `window` of an experiment: which part of its recording is used.

use greybox_numerics::parsing::reader::Field;
use greybox_recording::Summary;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A part of a recording, in seconds from its first sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WindowSpec {
    /// The first instant used; left out, the first sample.
    #[schema(minimum = 0)]
    pub from_s: Option<f64>,
    /// The last instant used; left out, the last sample.
    #[schema(minimum = 0)]
    pub to_s: Option<f64>,
    /// The first instant used, as a time of day with its offset, where the recording has one; the
    /// completed specification says `from_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, format = DateTime, example = "2026-03-02T08:15:00+01:00")]
    pub from: Option<jiff::Timestamp>,
    /// The last instant used, in the same way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>, format = DateTime)]
    pub to: Option<jiff::Timestamp>,
}

/// The part between two instants, given in seconds or as times of day.
pub(super) fn read(field: &Field<'_>, recording: Option<&Summary>) -> Option<WindowSpec> {
    let mut object = field.object()?;
    let bounds = ["from_s", "to_s"].map(|name| object.optional(name));
    let times = ["from", "to"].map(|name| object.optional(name));
    object.finish();
    let mut bounds = bounds.into_iter().zip(times).map(|both| match both {
        (Some(_), Some(time)) => {
            let detail = "the bound is given twice: in seconds, and as a time of day";
            time.fault("contradiction", detail);
            None
        }
        (Some(seconds), None) => inside(&seconds, seconds.number()?, recording),
        (None, Some(time)) => inside(&time, since_start(&time, recording)?, recording),
        (None, None) => None,
    });
    let (from_s, to_s) = (bounds.next().flatten(), bounds.next().flatten());
    let start = from_s.unwrap_or(0.0);
    if let Some(end) = to_s
        && start >= end
    {
        let detail = format!("from_s {start} is not before to_s {end}");
        field.fault("bounds_reversed", detail);
    }
    Some(WindowSpec {
        from_s,
        to_s,
        from: None,
        to: None,
    })
}

/// The seconds from the first sample of the recording to a time of day.
fn since_start(field: &Field<'_>, recording: Option<&Summary>) -> Option<f64> {
    let Ok(time) = field.text()?.parse::<jiff::Timestamp>() else {
        let detail = "expected an RFC 3339 timestamp with an offset, such as \
                      2026-03-02T08:15:00+01:00";
        field.fault("not_a_time", detail);
        return None;
    };
    let Some(start) = recording?.start else {
        let detail = "the recording does not say when it began; give the window in seconds";
        field.fault("no_start", detail);
        return None;
    };
    Some(time.duration_since(start).as_secs_f64())
}

/// An instant of the recording; the end of its last sample counts as inside.
pub(super) fn inside(field: &Field<'_>, instant: f64, recording: Option<&Summary>) -> Option<f64> {
    let end = recording.map(|recording| recording.duration_s + recording.sample_time_s);
    if instant < 0.0 || end.is_some_and(|end| instant > end) {
        let duration = recording.map_or(f64::INFINITY, |recording| recording.duration_s);
        let detail = format!("{instant} s is outside the recording, 0 s to {duration} s");
        field.fault("outside_recording", detail);
        return None;
    }
    Some(instant)
}
