//! Preparing a recording for a job: a recipe of named steps makes another recording of it, and leaves it as it is.
//!
//! `reading` reads a recipe, `limits` bounds what it takes, `instants`, `filter`, `trend` and `calculated` do its steps, and each step says in words
//! what it did (`words`), which the report of the prepared recording keeps.

mod calculated;
mod fault;
mod filter;
mod instants;
mod limits;
mod reading;
mod step;
mod trend;
mod words;

pub use limits::MAX_VALUES;
pub use reading::{MAX_STEPS, Recipe, read_recipe};
pub use step::{PreparationStep, Trend};

use calculated::CalculatedSignal;
use fault::PreparationFault;
use filter::{Butterworth, FilterPass};
use greybox_numerics::parsing::Fault;
use greybox_numerics::parsing::reader::did_you_mean;
use greybox_recording::{Recording, Signal, Warning};

/// Does the steps of a recipe one after the other.
///
/// # Errors
/// When a step cannot be done with what the steps before it left: its faults, which point into `/steps`.
pub fn prepare(
    mut recording: Recording,
    steps: &[PreparationStep],
) -> Result<Recording, Vec<Fault>> {
    // A note with a place points to samples that may be gone after the first step.
    recording.notes.retain(|note| note.spans.is_empty());
    let mut work = 0.0;
    for (k, step) in steps.iter().enumerate() {
        let done = limits::add_work(&mut work, step, &recording);
        let left = done.and_then(|()| apply(&mut recording, step));
        let left = left.map_err(|fault| fault.at_step(k))?;
        let detail = format!("step {}: {}", k + 1, words::sentence(step));
        recording
            .notes
            .push(Warning::of_recording("prepared", detail));
        recording.notes.extend(left);
    }
    Ok(recording)
}

/// Does a step. Answers what people should know beyond it.
fn apply(
    recording: &mut Recording,
    step: &PreparationStep,
) -> Result<Vec<Warning>, PreparationFault> {
    match step {
        PreparationStep::Cut { from_s, to_s } => instants::cut(recording, *from_s, *to_s)?,
        PreparationStep::Remove { signals } => remove(recording, signals)?,
        PreparationStep::Median { signals, samples } => {
            for place in places(recording, signals.as_deref(), "signals")? {
                filter::median(&mut recording.signals[place].values, *samples as usize);
            }
        }
        PreparationStep::LowPass { signals, cutoff_hz } => {
            return filter(recording, signals.as_deref(), FilterPass::Low, *cutoff_hz);
        }
        PreparationStep::HighPass { signals, cutoff_hz } => {
            return filter(recording, signals.as_deref(), FilterPass::High, *cutoff_hz);
        }
        PreparationStep::Detrend { signals, trend } => {
            for place in places(recording, signals.as_deref(), "signals")? {
                trend::subtract(
                    &mut recording.signals[place].values,
                    &recording.time,
                    *trend,
                );
            }
        }
        PreparationStep::Shift { signals, by_s } => {
            for place in places(recording, Some(signals), "signals")? {
                instants::shift(&mut recording.signals[place], &recording.time, *by_s);
            }
        }
        PreparationStep::Resample {
            sample_time_s,
            held,
        } => {
            let held = places(recording, Some(held), "held")?;
            instants::resample(recording, *sample_time_s, &held)?;
        }
        PreparationStep::Calculate {
            signal,
            equation,
            unit,
            names,
        } => {
            let calculated = CalculatedSignal {
                name: signal,
                equation,
                unit,
                names,
            };
            let without_value = calculated::add(recording, calculated)?;
            return Ok(no_value(signal, without_value).into_iter().collect());
        }
    }
    Ok(Vec::new())
}

/// The places of signals in a recording; of all where none is named.
fn places(
    recording: &Recording,
    names: Option<&[String]>,
    field: &'static str,
) -> Result<Vec<usize>, PreparationFault> {
    let Some(names) = names else {
        return Ok((0..recording.signals.len()).collect());
    };
    let place = |name: &String| {
        let place = recording
            .signals
            .iter()
            .position(|signal| signal.name == *name);
        place.ok_or_else(|| {
            let hint = did_you_mean(name, recording.signals.iter().map(|signal| &*signal.name));
            let detail = format!("there is no signal `{name}` at this step{hint}");
            PreparationFault::of_field(field, "unknown_signal", detail)
        })
    };
    names.iter().map(place).collect()
}

fn remove(recording: &mut Recording, names: &[String]) -> Result<(), PreparationFault> {
    let removed = places(recording, Some(names), "signals")?;
    let is_kept = |signal: &Signal| !names.contains(&signal.name);
    if !recording.signals.iter().any(is_kept) {
        let detail = "no signal would be left".to_owned();
        return Err(PreparationFault::of_field("signals", "no_signals", detail));
    }
    if removed.is_empty() {
        let detail = "no signal is named".to_owned();
        return Err(PreparationFault::of_field("signals", "no_signals", detail));
    }
    recording.signals.retain(is_kept);
    Ok(())
}

fn filter(
    recording: &mut Recording,
    names: Option<&[String]>,
    pass: FilterPass,
    cutoff_hz: f64,
) -> Result<Vec<Warning>, PreparationFault> {
    if !recording.time.is_uniform() {
        let detail = "a filter needs samples on a grid: put a step `resample` before it".to_owned();
        return Err(PreparationFault::of_step("not_uniform", detail));
    }
    let cutoff = cutoff_hz * recording.time.sample_time();
    if cutoff >= 0.5 {
        let highest = 0.5 / recording.time.sample_time();
        let detail = format!(
            "a recording of this sample time tells frequencies below {highest:.6} Hz apart"
        );
        return Err(PreparationFault::of_field(
            "cutoff_hz",
            "out_of_range",
            detail,
        ));
    }
    let butterworth = Butterworth::new(pass, cutoff);
    let filtered = places(recording, names, "signals")?;
    for place in &filtered {
        butterworth.apply(&mut recording.signals[*place].values);
    }
    let mut warnings = Vec::new();
    if pass == FilterPass::Low {
        let detail = "noise of neighbouring samples goes together after a low pass: a job takes that for a \
                      disturbance, and its intervals rest on how the noise is taken; resample to two samples a \
                      period of the cutoff, or let the job have the recording unfiltered";
        warnings.push(Warning::of_recording("filtered_noise", detail.to_owned()));
    }
    if filtered.len() < recording.signals.len() {
        let detail = "some signals are filtered and others are not: a plant's equations that hold for the signals as \
                      recorded hold for filtered ones where all are filtered alike, and the plant is linear";
        warnings.push(Warning::of_recording("filtered_in_part", detail.to_owned()));
    }
    Ok(warnings)
}

/// Says that an equation has no value at some samples.
fn no_value(signal: &str, samples: usize) -> Option<Warning> {
    let detail = format!("{samples} samples are missing where the equation has no finite value");
    (samples > 0).then(|| Warning::of_signal("no_finite_value", signal, detail))
}

#[cfg(test)]
mod tests;
