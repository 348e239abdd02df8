//! A signal between its samples.

use super::resample::{LONGEST_BRIDGE, ResampleRule, resample};
use super::{Interpolation, Signal, TimeAxis};

impl Signal {
    /// The signal at strictly increasing instants `[s]`, where `time` has those of its samples: held where it is
    /// said to keep its value, else on the straight line between samples, and missing where they are more than
    /// [`LONGEST_BRIDGE`] sample times apart.
    #[must_use]
    pub fn at(&self, time: &TimeAxis, instants: impl Iterator<Item = f64>) -> Vec<f64> {
        let sampled_at: Vec<f64> = (0..time.samples()).map(|k| time.instant(k)).collect();
        let rule = ResampleRule {
            interpolation: self.interpolation.unwrap_or(Interpolation::Linear),
            longest_bridge: LONGEST_BRIDGE,
        };
        resample(
            &sampled_at,
            &self.values,
            instants,
            time.sample_time(),
            rule,
        )
    }
}
