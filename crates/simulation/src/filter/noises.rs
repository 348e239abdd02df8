//! The disturbances of a block of candidates, each with its numbers.

use super::layout::FilterLayout;
use crate::program::DisturbanceKind;
use greybox_numerics::lanes::{Lanes, Real};

/// A disturbance of each candidate.
pub struct Noise {
    /// The state of the disturbance.
    pub state: usize,
    pub kind: DisturbanceKind,
    /// What the disturbance gains in a second: its unit squared per second.
    pub diffusion: Lanes,
    /// The variance at the first sample.
    pub start: Lanes,
}

/// The disturbances of candidates with these parameters.
pub fn noises(
    layout: &FilterLayout,
    n_model_parameters: usize,
    parameter: impl Fn(usize) -> Lanes,
) -> Vec<Noise> {
    let two = Lanes::splat(2.0);
    let parameters = layout.noise_parameters(n_model_parameters);
    let disturbances = layout.disturbances.iter().zip(parameters);
    let noises = disturbances.zip(layout.starts.len()..);
    noises
        .map(|((disturbance, parameters), state)| {
            let strength = parameter(parameters.strength);
            let squared = strength * strength;
            let time_constant = parameters.time_constant.map(&parameter);
            Noise {
                state,
                kind: disturbance.kind,
                diffusion: time_constant.map_or(squared, |time| squared / (time * time)),
                start: time_constant.map_or(Lanes::splat(0.0), |time| squared / (two * time)),
            }
        })
        .collect()
}

/// The states of white noises, each with its variance as a mean over an interval of this length `[s]`; none
/// where no time passes.
pub fn white_variances(noises: &[Noise], interval: f64) -> Vec<(usize, Lanes)> {
    if interval <= 0.0 {
        return Vec::new();
    }
    let whites = noises
        .iter()
        .filter(|noise| noise.kind == DisturbanceKind::White);
    let length = Lanes::splat(interval);
    whites
        .map(|noise| (noise.state, noise.diffusion / length))
        .collect()
}
