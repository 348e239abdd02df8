//! How much noise the measured samples have: all of an output the same, or each its own.

use super::Finding;
use super::experiment::{Cut, signal_pointer};
use crate::estimation::problem::MeasuredOutput;
use crate::identification::spec::{JobSpec, OutputSpec};
use greybox_numerics::parsing::fault::{Fault, pointer_to};
use greybox_numerics::statistics;

/// Settles what the residuals of each output count in: its declared noise, else the spread of the
/// measured signal.
///
/// # Errors
/// Where what is declared leaves samples without noise.
pub(super) fn settle(
    outputs: &mut [MeasuredOutput],
    spec: &JobSpec,
    cuts: &mut [Cut],
) -> Result<(), Vec<Fault>> {
    let mut faults = Vec::new();
    for (place, output) in outputs.iter_mut().enumerate() {
        let output_spec = spec.outputs.get(&output.name);
        let output_spec = output_spec.filter(|output_spec| output_spec.declares_noise());
        output.noise_std = match output_spec {
            None => None,
            Some(OutputSpec {
                noise_std,
                noise_share: None,
                noise_signal: None,
                ..
            }) => *noise_std,
            Some(output_spec) => match of_each_sample(output_spec, (place, &output.name), cuts) {
                Ok(noise) => Some(noise),
                Err(fault) => {
                    faults.push(fault);
                    None
                }
            },
        };
        let measured = cuts.iter().map(|cut| &cut.experiment.measured[place]);
        let spreads = measured.filter_map(|values| statistics::standard_deviation(values));
        let spread = spreads.fold(0.0, f64::max);
        let scale = if spread > 0.0 { spread } else { 1.0 };
        output.residual_scale = output.noise_std.unwrap_or(scale);
    }
    if faults.is_empty() {
        Ok(())
    } else {
        Err(faults)
    }
}

/// Weighs the samples of an output by their noise, and answers its root mean square. Samples
/// whose noise is not known are left out.
fn of_each_sample(
    spec: &OutputSpec,
    (place, name): (usize, &str),
    cuts: &mut [Cut],
) -> Result<f64, Fault> {
    let mut noises: Vec<Vec<f64>> = Vec::with_capacity(cuts.len());
    for (index, cut) in cuts.iter_mut().enumerate() {
        let measured = &mut cut.experiment.measured[place];
        let mut unknown = 0;
        let mut of_sample = |sample: usize, value: &mut f64| {
            let recorded = match &cut.noise[place] {
                Some(noise) if noise[sample] > 0.0 => noise[sample],
                Some(_) if !value.is_nan() => {
                    unknown += 1;
                    *value = f64::NAN;
                    f64::NAN
                }
                _ => 0.0,
            };
            let everywhere = spec.noise_std.unwrap_or(0.0);
            let share = spec.noise_share.unwrap_or(0.0) * *value;
            (everywhere * everywhere + share * share + recorded * recorded).sqrt()
        };
        let samples = measured.iter_mut().enumerate();
        let noise: Vec<f64> = samples.map(|(k, value)| of_sample(k, value)).collect();
        if unknown > 0 {
            let pointer = signal_pointer(&format!("/experiments/{index}"), name);
            let detail = format!(
                "{unknown} samples of `{name}` are left out: their noise is missing or not above 0"
            );
            cut.findings
                .push(Finding::new("noise_unknown", &pointer, &detail));
        }
        noises.push(noise);
    }
    let without = noises.iter().flatten().filter(|noise| **noise == 0.0);
    let without = without.count();
    if without > 0 {
        let detail = format!(
            "{without} samples of `{name}` are 0, and a share of 0 is no noise: give `noise_std` \
             beside `noise_share`"
        );
        let pointer = pointer_to("/outputs", name);
        return Err(Fault::new(pointer, "no_noise", detail));
    }
    let present = noises.iter().flatten().filter(|noise| !noise.is_nan());
    let squares = present.map(|noise| noise * noise);
    let noise = statistics::mean(squares).map_or(1.0, f64::sqrt);
    for (cut, stds) in cuts.iter_mut().zip(noises) {
        let weights = stds.into_iter().map(|std| noise / std);
        cut.experiment.weights[place] = Some(weights.collect());
    }
    Ok(noise)
}
