//! What the document said, and whether it makes a recording.

use super::super::error::{ReadingFaults, at_pointer};
use super::super::units::{self, RecordedUnit};
use super::super::{ReadError, ReadingPurpose};
use super::scalar::JsonScalar;
use crate::{MAX_NAME_CHARACTERS, MAX_SIGNALS, Recording, Signal, TimeAxis, Warning, name_fault};
use greybox_numerics::parsing::Fault;
use jiff::Timestamp;
use std::collections::HashSet;

/// The document as far as it was read.
#[derive(Debug, Default)]
pub(super) struct Document {
    name: Option<String>,
    sample_time: Option<f64>,
    start: Option<Timestamp>,
    pub(super) time: Option<JsonColumn>,
    pub(super) has_signals: bool,
    pub(super) signals: Vec<(String, JsonColumn)>,
    pub(super) faults: ReadingFaults,
    notes: Vec<Warning>,
    fields: HashSet<String>,
    signal_names: HashSet<String>,
}

/// A signal or the time.
#[derive(Debug, Default)]
pub(super) struct JsonColumn {
    pub(super) unit: Option<String>,
    pub(super) values: Option<Vec<f64>>,
}

/// The longest sample time `[s]`: 30 years, so that no duration overflows.
const LONGEST_SAMPLE_TIME: f64 = 1e9;

const FIELDS: [&str; 5] = ["name", "sample_time_s", "start", "time", "signals"];

/// A fault at a pointer.
pub(super) fn fault(code: &'static str, pointer: String, detail: &str) -> Fault {
    at_pointer(pointer, code, detail)
}

/// A key as a part of a JSON pointer (RFC 6901), as far as a name may be long.
pub(super) fn escape(key: &str) -> String {
    let shown: String = key.chars().take(MAX_NAME_CHARACTERS).collect();
    shown.replace('~', "~0").replace('/', "~1")
}

impl Document {
    /// Whether a field of that name is known and was not read before; a fault otherwise.
    pub(super) fn is_new_field(&mut self, key: &str) -> bool {
        let pointer = || format!("/{}", escape(key));
        if !FIELDS.contains(&key) {
            let detail = format!("unknown field; known: {}", FIELDS.join(", "));
            self.faults
                .invalid(fault("unknown_field", pointer(), &detail));
            return false;
        }
        let new = self.fields.insert(key.to_owned());
        if !new {
            let detail = "the field stands here twice";
            self.faults
                .invalid(fault("duplicate_field", pointer(), detail));
        }
        new
    }

    /// Whether a signal may have that name; a fault otherwise.
    pub(super) fn is_new_signal(&mut self, name: &str, pointer: &str) -> bool {
        let problem = if self.signals.len() >= MAX_SIGNALS {
            Some((
                "too_many_signals",
                format!("at most {MAX_SIGNALS} signals are read"),
            ))
        } else if self.signal_names.insert(name.to_owned()) {
            name_fault(name)
        } else {
            Some(("duplicate_name", "the signal stands here twice".to_owned()))
        };
        let Some((code, detail)) = problem else {
            return true;
        };
        self.faults
            .invalid(fault(code, pointer.to_owned(), &detail));
        false
    }

    /// Takes the value of `name`, `start` or `sample_time_s`.
    pub(super) fn take_scalar(&mut self, key: &str, scalar: JsonScalar) {
        let problem = match (key, scalar) {
            ("name" | "start", JsonScalar::Null) => None,
            ("name", JsonScalar::Text(name)) => {
                let problem = name_fault(&name);
                self.name = Some(name);
                problem
            }
            ("start", JsonScalar::Text(start)) => match start.parse() {
                Ok(start) => {
                    self.start = Some(start);
                    None
                }
                Err(_) => Some((
                    "not_a_time",
                    "expected an RFC 3339 timestamp with an offset, such as 2026-03-02T08:15:00Z"
                        .to_owned(),
                )),
            },
            ("sample_time_s", JsonScalar::Number(sample_time))
                if sample_time > 0.0 && sample_time <= LONGEST_SAMPLE_TIME =>
            {
                self.sample_time = Some(sample_time);
                None
            }
            ("sample_time_s", JsonScalar::Number(sample_time)) => Some((
                "out_of_range",
                format!(
                    "the sample time {sample_time} s is not above 0 s and at most {LONGEST_SAMPLE_TIME} s"
                ),
            )),
            ("sample_time_s", scalar) => Some((
                "wrong_type",
                format!("expected a number, found {}", scalar.kind()),
            )),
            (_, scalar) => Some((
                "wrong_type",
                format!("expected a string, found {}", scalar.kind()),
            )),
        };
        if let Some((code, detail)) = problem {
            self.faults.invalid(fault(code, format!("/{key}"), &detail));
        }
    }

    /// The recording, or all faults.
    pub(super) fn into_recording(
        mut self,
        purpose: ReadingPurpose,
    ) -> Result<Recording, ReadError> {
        let time = self.check_time();
        let samples = time.as_ref().map(Vec::len).or_else(|| {
            self.signals
                .iter()
                .find_map(|(_, column)| column.values.as_ref().map(Vec::len))
        });
        if self.signals.is_empty() && self.faults.is_empty() {
            let detail = if self.has_signals {
                "there are no signals"
            } else {
                "the field is missing"
            };
            self.faults
                .invalid(fault("no_signals", "/signals".to_owned(), detail));
        }
        let signals = self.check_signals(samples);
        let least = purpose.least_instants();
        let few = samples.filter(|samples| *samples < least);
        if let Some(samples) = few.filter(|_| self.faults.is_empty()) {
            let detail = format!("{samples} samples; at least {least} are needed");
            self.faults
                .invalid(fault("too_few_samples", "/signals".to_owned(), &detail));
        }
        self.faults.result()?;
        let mut recording = match (time, self.sample_time) {
            (Some(instants), _) => over_instants(instants, signals, purpose),
            (None, sample_time) => {
                let sample_time = sample_time.expect("its absence is a fault");
                let samples = samples.expect("a document without signals is a fault");
                Recording::new(
                    TimeAxis::Uniform {
                        sample_time,
                        samples,
                    },
                    signals,
                )
            }
        };
        recording.notes.extend(self.notes);
        recording.name = self.name;
        recording.start = self.start;
        Ok(recording)
    }

    /// The times as they were written, in seconds, where the document has them.
    fn check_time(&mut self) -> Option<Vec<f64>> {
        let named = |field| self.fields.contains(field);
        let (uniform, listed) = (named("sample_time_s"), named("time"));
        if uniform == listed {
            let detail = "exactly one of `sample_time_s` and `time` is needed";
            self.faults
                .invalid(fault("sample_time_or_time", String::new(), detail));
        }
        let column = self.time.take()?;
        let text = column.unit.unwrap_or_default();
        let unit = units::parse_time(&text).unwrap_or_else(|| {
            let known_units = units::known_times();
            let detail = format!("unit `{text}` is not a time; known: {known_units}");
            self.faults
                .invalid(fault("unknown_unit", "/time/unit".to_owned(), &detail));
            RecordedUnit::NONE
        });
        let Some(mut instants) = column.values else {
            self.faults.invalid(fault(
                "missing",
                "/time/values".to_owned(),
                "the field is missing",
            ));
            return None;
        };
        for instant in &mut instants {
            *instant = unit.to_si(*instant);
        }
        self.check_order(&instants);
        Some(instants)
    }

    fn check_order(&mut self, instants: &[f64]) {
        let first = instants.first().copied().unwrap_or_default();
        if let Some(k) = instants
            .iter()
            .position(|instant| !(instant - first).is_finite())
        {
            let detail = "a time is missing or not finite";
            self.faults
                .invalid(fault("missing_time", format!("/time/values/{k}"), detail));
        } else if let Some(k) = instants.windows(2).position(|pair| pair[1] < pair[0]) {
            let detail = format!(
                "time runs backwards: {} s after {} s",
                instants[k + 1],
                instants[k]
            );
            let place = format!("/time/values/{}", k + 1);
            self.faults.invalid(fault("time_backwards", place, &detail));
        }
    }

    /// The signals in SI. Signals with faults are left out, which does not show: the faults do.
    fn check_signals(&mut self, samples: Option<usize>) -> Vec<Signal> {
        let mut signals = Vec::with_capacity(self.signals.len());
        for (name, column) in std::mem::take(&mut self.signals) {
            let pointer = format!("/signals/{}", escape(&name));
            let recorded_unit = column.unit.unwrap_or_default();
            let unit = units::parse(&recorded_unit);
            if unit.is_none() {
                let detail = units::unknown(&recorded_unit, units::UNITS_OPTION);
                self.faults
                    .invalid(fault("unknown_unit", format!("{pointer}/unit"), &detail));
            }
            let unit = unit.unwrap_or(RecordedUnit::NONE);
            let place = format!("{pointer}/values");
            let Some(mut values) = column.values else {
                self.faults
                    .invalid(fault("missing", place, "the field is missing"));
                continue;
            };
            if samples.is_some_and(|samples| samples != values.len()) {
                let wanted = samples.unwrap_or_default();
                let detail = format!("{} samples where there should be {wanted}", values.len());
                self.faults
                    .invalid(fault("wrong_length", place.clone(), &detail));
            }
            for value in &mut values {
                *value = unit.to_si(*value);
            }
            if let Some(k) = values.iter().position(|value| value.is_infinite()) {
                let detail = format!("the value in {} is not finite", unit.si);
                self.faults
                    .invalid(fault("not_finite", format!("{place}/{k}"), &detail));
            }
            values.shrink_to_fit();
            if !unit.remark.is_empty() {
                let remark = Warning::of_signal("unit_remark", &name, unit.remark.to_owned());
                self.notes.push(remark);
            }
            signals.push(Signal {
                recorded_unit,
                ..Signal::new(name, unit.si, values)
            });
        }
        signals
    }
}

/// The recording over listed times. Of samples at one time the first stays in a recording, and the
/// last one that is not missing in a batch of a stream.
fn over_instants(times: Vec<f64>, mut signals: Vec<Signal>, purpose: ReadingPurpose) -> Recording {
    let scale = times
        .iter()
        .fold(0.0_f64, |largest, time| largest.max(time.abs()));
    let first = times[0];
    let is_kept = |k: usize| match purpose {
        ReadingPurpose::Recording => k == 0 || times[k] > times[k - 1],
        ReadingPurpose::Stream => k + 1 == times.len() || times[k + 1] > times[k],
    };
    let keep: Vec<bool> = (0..times.len()).map(is_kept).collect();
    if purpose.is_later_right() {
        let is_repeat = |k: &usize| times[*k] == times[k - 1];
        for k in (1..times.len()).filter(is_repeat) {
            signals
                .iter_mut()
                .for_each(|signal| carry(&mut signal.values, k));
        }
    }
    let duplicates = keep.iter().filter(|keep| !**keep).count();
    let mut instants: Vec<f64> = times.into_iter().map(|time| time - first).collect();
    if duplicates > 0 {
        retain(&mut instants, &keep);
        for signal in &mut signals {
            retain(&mut signal.values, &keep);
        }
    }
    let mut recording = Recording::new(purpose.axis(instants, scale), signals);
    if duplicates > 0 {
        recording.notes.push(purpose.duplicate_time(duplicates));
    }
    recording
}

/// Has a missing value say what the one before says.
fn carry(values: &mut [f64], k: usize) {
    if values[k].is_nan() {
        values[k] = values[k - 1];
    }
}

fn retain(values: &mut Vec<f64>, keep: &[bool]) {
    let mut keep = keep.iter();
    values.retain(|_| *keep.next().expect("as long as the values"));
}
