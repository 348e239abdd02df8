//! One proposed excitation: a kind with its numbers, or samples.

use crate::uncertainty::design::excitation::{BITS, MOST_LEVELS, MOST_LINES};
use crate::uncertainty::design::{Excitation, Grid, Limits};
use greybox_numerics::parsing::reader::{Field, Object, listed};

/// Samples may pass their limits by rounding: by this share of the range.
const ROUNDING: f64 = 1e-9;

/// An excitation that is compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The name of the proposal.
    pub name: String,
    /// The excitation that is proposed.
    pub excitation: Excitation,
    /// The samples of each input, where the excitation is no kind that can be played.
    pub samples: Option<Vec<Vec<f64>>>,
}

/// Reads a proposal for inputs of these names on a grid.
pub(super) fn read(
    field: &Field<'_>,
    index: usize,
    grid: &Grid,
    inputs: &[&str],
) -> Option<Proposal> {
    let mut object = field.object()?;
    let name = object.optional("name");
    let name = name.map_or(Some(format!("proposal {index}")), |field| {
        super::super::labels::short_text(&field).map(str::to_owned)
    });
    let kind = object.required("kind");
    let kinds = ["prbs", "multisine", "steps", "sine", "samples"].map(|kind| (kind, kind));
    let kind = kind.and_then(|field| field.choice(&kinds));
    let mut samples = None;
    let excitation = match kind? {
        "prbs" => read_prbs(&mut object, grid),
        "multisine" => read_multisine(&mut object, grid),
        "steps" => read_steps(&mut object, grid),
        "sine" => read_sine(&mut object, grid),
        _ => {
            let field = object.required("samples");
            samples = field.and_then(|field| read_samples(&field, grid, inputs));
            samples.is_some().then_some(Excitation::Samples)
        }
    };
    object.finish();
    Some(Proposal {
        name: name?,
        excitation: excitation?,
        samples,
    })
}

fn read_prbs(object: &mut Object<'_>, grid: &Grid) -> Option<Excitation> {
    let clock_s = held(object, "clock_s", grid);
    let bits = object.required("bits");
    let bits = bits.and_then(|field| field.integer(BITS[0].into(), BITS[1].into()));
    let amplitude = amplitude(object);
    Some(Excitation::Prbs {
        clock_s: clock_s?,
        bits: u32::try_from(bits?).expect("a small number"),
        amplitude: amplitude?,
    })
}

fn read_multisine(object: &mut Object<'_>, grid: &Grid) -> Option<Excitation> {
    let lowest = frequency(object, "lowest_hz", grid);
    let highest = frequency(object, "highest_hz", grid);
    let lines = object.optional("lines");
    let lines = lines.map_or(Some(8), |field| field.integer(1, MOST_LINES.into()));
    let amplitude = amplitude(object);
    let (lowest_hz, highest_hz) = (lowest?, highest?);
    if lowest_hz > highest_hz {
        let detail = format!("lowest_hz {lowest_hz} is above highest_hz {highest_hz}");
        object.fault("bounds_reversed", detail);
    }
    Some(Excitation::Multisine {
        lowest_hz,
        highest_hz,
        lines: u32::try_from(lines?).expect("a small number"),
        amplitude: amplitude?,
    })
}

fn read_steps(object: &mut Object<'_>, grid: &Grid) -> Option<Excitation> {
    let hold_s = held(object, "hold_s", grid);
    let levels = object.required("levels").and_then(|field| {
        let entries = field.array()?;
        if entries.len() == 0 || entries.len() > MOST_LEVELS {
            let detail = format!("{} levels: there are 1 to {MOST_LEVELS}", entries.len());
            field.fault("out_of_range", detail);
            return None;
        }
        let levels = entries.map(|entry| entry.number_within(-1.0, 1.0));
        levels.collect()
    });
    Some(Excitation::Steps {
        hold_s: hold_s?,
        levels: levels?,
    })
}

fn read_sine(object: &mut Object<'_>, grid: &Grid) -> Option<Excitation> {
    let frequency_hz = frequency(object, "frequency_hz", grid);
    let amplitude = amplitude(object);
    Some(Excitation::Sine {
        frequency_hz: frequency_hz?,
        amplitude: amplitude?,
    })
}

/// A time for which a level is held: a sample at least, the experiment at the most.
fn held(object: &mut Object<'_>, name: &'static str, grid: &Grid) -> Option<f64> {
    let field = object.required(name)?;
    field.number_within(grid.sample_time, grid.duration())
}

/// A frequency below half the sampling rate.
fn frequency(object: &mut Object<'_>, name: &'static str, grid: &Grid) -> Option<f64> {
    let field = object.required(name)?;
    let frequency = field.positive()?;
    let highest = 0.5 / grid.sample_time;
    if frequency > highest {
        let detail = format!("{frequency} Hz is above half the sampling rate, {highest} Hz");
        field.fault("out_of_range", detail);
        return None;
    }
    Some(frequency)
}

fn amplitude(object: &mut Object<'_>) -> Option<f64> {
    let Some(field) = object.optional("amplitude") else {
        return Some(1.0);
    };
    let amplitude = field.positive()?;
    if amplitude > 1.0 {
        let detail = format!("{amplitude} is above 1, all that the limits allow");
        field.fault("out_of_range", detail);
        return None;
    }
    Some(amplitude)
}

fn read_samples(field: &Field<'_>, grid: &Grid, inputs: &[&str]) -> Option<Vec<Vec<f64>>> {
    let mut series: Vec<Option<Vec<f64>>> = vec![None; inputs.len()];
    for (name, field) in field.object()?.entries() {
        let Some(index) = inputs.iter().position(|input| *input == name) else {
            let detail = format!("the inputs are {}", listed(inputs));
            field.fault("unknown_input", detail);
            return None;
        };
        series[index] = Some(read_series(&field, grid, &grid.inputs[index])?);
    }
    let read: Option<Vec<Vec<f64>>> = series.into_iter().collect();
    if read.is_none() {
        let detail = format!("samples of all of {} are needed", listed(inputs));
        field.fault("inputs_missing", detail);
    }
    read
}

fn read_series(field: &Field<'_>, grid: &Grid, limits: &Limits) -> Option<Vec<f64>> {
    let entries = field.array()?;
    if entries.len() != grid.samples {
        let detail = format!(
            "{} samples; `duration_s` and `sample_time_s` ask for {}",
            entries.len(),
            grid.samples
        );
        field.fault("wrong_length", detail);
        return None;
    }
    let values: Vec<f64> = entries.map(|entry| entry.number()).collect::<Option<_>>()?;
    let slack = ROUNDING * (limits.upper - limits.lower);
    let allowed = limits.lower - slack..=limits.upper + slack;
    if let Some(at) = values.iter().position(|value| !allowed.contains(value)) {
        let (lower, upper) = (limits.lower, limits.upper);
        let detail = format!("sample {at}, {}, is outside {lower} to {upper}", values[at]);
        field.fault("out_of_range", detail);
        return None;
    }
    let most = limits
        .rate
        .map_or(f64::INFINITY, |rate| rate * grid.sample_time)
        + slack;
    let mut steps = values.windows(2);
    if let Some(at) = steps.position(|pair| (pair[1] - pair[0]).abs() > most) {
        let detail = format!("from sample {at} to the next it changes faster than its rate");
        field.fault("too_fast", detail);
        return None;
    }
    Some(values)
}
