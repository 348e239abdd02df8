//! Signals that follow from others by an equation.

use std::collections::{BTreeMap, BTreeSet};

use super::fault::PreparationFault;
use super::limits;
use greybox_numerics::parsing::reader::did_you_mean;
use greybox_recording::{Class, ClassSpan, MAX_SIGNALS, Recording, Signal, intake, name_fault};
use greybox_simulation::model::document::{Calculation, Quantity};

/// Words of the language keep their meaning where a signal has such a name.
const WORDS: [&str; 5] = ["pi", "sample_time", "and", "or", "not"];

/// A signal that is to be calculated.
#[derive(Clone, Copy)]
pub(super) struct CalculatedSignal<'a> {
    pub(super) name: &'a str,
    pub(super) equation: &'a str,
    pub(super) unit: &'a str,
    /// Signals by the names that the equation has for them.
    pub(super) names: &'a BTreeMap<String, String>,
}

/// Adds a calculated signal, or replaces the signal of its name. Answers at how many samples the equation has no
/// value although all signals that it needs have one.
pub(super) fn add(
    recording: &mut Recording,
    calculated: CalculatedSignal<'_>,
) -> Result<usize, PreparationFault> {
    let CalculatedSignal { name, unit, .. } = calculated;
    if let Some((code, detail)) = name_fault(name) {
        return Err(PreparationFault::of_field("signal", code, detail));
    }
    let place = recording
        .signals
        .iter()
        .position(|signal| signal.name == name);
    if place.is_none() && recording.signals.len() >= MAX_SIGNALS {
        let detail = format!("a recording has {MAX_SIGNALS} signals at the most");
        return Err(PreparationFault::of_field("signal", "too_many", detail));
    }
    if place.is_none() {
        let samples = recording.time.samples() as f64;
        limits::check_values(samples, recording.signals.len() + 1)?;
    }
    let si = intake::si_unit(unit).ok_or_else(|| {
        let detail = format!("the unit `{unit}` is not one that recordings are read in");
        PreparationFault::of_field("unit", "unknown_unit", detail)
    })?;
    let named = named_signals(recording, calculated.names)?;
    let quantities: Vec<Quantity<'_>> = named
        .iter()
        .map(|(name, signal)| Quantity {
            name,
            unit: &signal.unit,
        })
        .collect();
    let compiled = Calculation::compile(calculated.equation, "", &quantities, &si);
    let calculation = compiled.map_err(|faults| PreparationFault {
        field: "equation",
        faults,
    })?;
    if recording.own_instants && calculation.used().len() > 1 {
        let detail =
            "the signals have instants of their own: put a step `resample` before it".to_owned();
        return Err(PreparationFault::of_field(
            "equation",
            "own_instants",
            detail,
        ));
    }
    let signals: Vec<&Signal> = named.iter().map(|(_, signal)| *signal).collect();
    let (signal, without_value) = evaluate(recording, &calculation, &signals);
    let signal = Signal {
        name: name.to_owned(),
        unit: si.into_owned(),
        recorded_unit: unit.to_owned(),
        ..signal
    };
    match place {
        Some(place) => recording.signals[place] = signal,
        None => recording.signals.push(signal),
    }
    Ok(without_value)
}

/// The signals that an equation may use, each with the name that it has for it: of a signal that has another name
/// there, that one alone.
fn named_signals<'a>(
    recording: &'a Recording,
    names: &'a BTreeMap<String, String>,
) -> Result<Vec<(&'a str, &'a Signal)>, PreparationFault> {
    let mut named: Vec<(&str, &Signal)> = Vec::new();
    for (name, signal) in names {
        let recorded = recording.signal(signal).ok_or_else(|| {
            let hint = did_you_mean(signal, recording.signals.iter().map(|signal| &*signal.name));
            let detail = format!("the recording has no signal `{signal}`{hint}");
            PreparationFault::of_field("names", "unknown_signal", detail)
        })?;
        named.push((name, recorded));
    }
    let renamed: BTreeSet<&str> = names.values().map(String::as_str).collect();
    let is_written_as_it_is = |signal: &&Signal| {
        let name = &*signal.name;
        !renamed.contains(name) && !names.contains_key(name) && !WORDS.contains(&name)
    };
    let as_they_are = recording.signals.iter().filter(is_written_as_it_is);
    named.extend(as_they_are.map(|signal| (&*signal.name, signal)));
    Ok(named)
}

/// The samples of an equation, each of the worst class of those that it needs, and the number of samples at which
/// the equation has no finite value.
fn evaluate(
    recording: &Recording,
    calculation: &Calculation,
    signals: &[&Signal],
) -> (Signal, usize) {
    let samples = recording.time.samples();
    let sample_time = recording.time.sample_time();
    let mut classes = vec![Class::Good; samples];
    for place in calculation.used() {
        let of_signal = signals[*place].class_of_each();
        for (class, of_sample) in classes.iter_mut().zip(of_signal) {
            *class = of_sample.max(*class);
        }
    }
    let (mut computed, mut without_value) = (Vec::new(), 0);
    let mut value = |k: usize| {
        let quantity = |place: usize| signals[place].values[k];
        let value = calculation.value(quantity, sample_time, &mut computed);
        let is_missing = calculation
            .used()
            .iter()
            .any(|place| quantity(*place).is_nan());
        without_value += usize::from(!value.is_finite() && !is_missing);
        if value.is_finite() { value } else { f64::NAN }
    };
    let values = (0..samples).map(&mut value).collect();
    let signal = Signal {
        classes: ClassSpan::of(classes.into_iter()),
        ..Signal::new("", "", values)
    };
    (signal, without_value)
}
