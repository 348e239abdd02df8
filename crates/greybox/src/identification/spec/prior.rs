//! What is known of a free number before the recording is looked at.

use crate::estimation::prior::Prior;
use greybox_numerics::parsing::reader::Field;
use greybox_simulation::model::Scale;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What is known of a free number before the recording is looked at: a normal distribution, of
/// its logarithm on a log scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged, deny_unknown_fields)]
#[schema(as = Prior, example = json!({"mean": 58.0, "std": 2.0}))]
pub enum PriorSpec {
    /// By its mean and standard deviation, SI.
    #[schema(title = "NormalPrior")]
    Normal {
        /// The mean.
        mean: f64,
        /// The standard deviation.
        #[schema(exclusive_minimum = 0)]
        std: f64,
        /// What is normal: the value, or its logarithm.
        #[serde(default)]
        #[schema(required = false)]
        scale: Scale,
    },
    /// By the range that holds it with a probability of 95 %, SI.
    #[schema(title = "RangePrior")]
    Range {
        /// The ends of the range.
        range_95: [f64; 2],
        /// What is normal: the value, or its logarithm.
        #[serde(default)]
        #[schema(required = false)]
        scale: Scale,
    },
}

/// Half the width of a 95 % range in standard deviations.
const NORMAL_95: f64 = 1.959_964;

impl PriorSpec {
    /// The normal distribution of the value, or of its logarithm.
    #[must_use]
    pub fn distribution(&self) -> Prior {
        let (middle, deviation) = match (*self, self.scale()) {
            (PriorSpec::Normal { mean, std, .. }, Scale::Linear) => (mean, std),
            (PriorSpec::Normal { mean, std, .. }, Scale::Log) => {
                let variance = libm::log1p((std / mean).powi(2));
                (libm::log(mean) - 0.5 * variance, variance.sqrt())
            }
            (PriorSpec::Range { range_95, .. }, scale) => {
                let [low, high] = range_95.map(|end| match scale {
                    Scale::Linear => end,
                    Scale::Log => libm::log(end),
                });
                (0.5 * (low + high), (high - low) / (2.0 * NORMAL_95))
            }
        };
        Prior {
            middle,
            deviation,
            scale: self.scale(),
        }
    }

    fn scale(&self) -> Scale {
        match self {
            PriorSpec::Normal { scale, .. } | PriorSpec::Range { scale, .. } => *scale,
        }
    }
}

/// Reads `{"mean", "std"}` or `{"range_95": [low, high]}`.
pub(super) fn read(field: &Field<'_>) -> Option<PriorSpec> {
    let mut object = field.object()?;
    let mean = object.optional("mean");
    let std = object.optional("std");
    let range = object.optional("range_95");
    let scale = object.optional("scale");
    let scale = scale.map(|field| field.choice(&[("linear", Scale::Linear), ("log", Scale::Log)]));
    let scale = scale.unwrap_or(Some(Scale::Linear));
    let read = match (mean, std, range) {
        (Some(mean), Some(std), None) => {
            let (mean_field, mean, std) = (mean.clone(), mean.number(), std.positive());
            let prior = || {
                Some(PriorSpec::Normal {
                    mean: mean?,
                    std: std?,
                    scale: scale?,
                })
            };
            check_positive(&mean_field, mean, scale)
                .then(prior)
                .flatten()
        }
        (None, None, Some(range)) => read_range(&range).and_then(|range_95| {
            let scale = scale?;
            let is_sound = check_positive(&range, Some(range_95[0]), Some(scale));
            is_sound.then_some(PriorSpec::Range { range_95, scale })
        }),
        _ => {
            let detail = "either `mean` and `std` are needed, or `range_95`";
            object.fault("missing_field", detail);
            None
        }
    };
    object.finish();
    read
}

fn read_range(field: &Field<'_>) -> Option<[f64; 2]> {
    let ends: Vec<f64> = field
        .array()?
        .take(3)
        .filter_map(|end| end.number())
        .collect();
    match ends[..] {
        [low, high] if low < high => Some([low, high]),
        _ => {
            let detail = "two numbers are needed, the lower one first";
            field.fault("bounds_reversed", detail);
            None
        }
    }
}

fn check_positive(field: &Field<'_>, number: Option<f64>, scale: Option<Scale>) -> bool {
    let is_sound = scale != Some(Scale::Log) || number.is_none_or(|number| number > 0.0);
    if !is_sound {
        field.fault(
            "log_scale_not_positive",
            "a log scale needs numbers above 0",
        );
    }
    is_sound
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_and_a_mean_with_its_deviation_say_the_same() {
        let range = PriorSpec::Range {
            range_95: [58.0 - 1.959_964 * 2.0, 58.0 + 1.959_964 * 2.0],
            scale: Scale::Linear,
        };
        let prior = range.distribution();
        assert!((prior.middle - 58.0).abs() < 1e-12 && (prior.deviation - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_log_normal_has_the_mean_and_the_deviation_that_were_given() {
        let prior = PriorSpec::Normal {
            mean: 10.0,
            std: 4.0,
            scale: Scale::Log,
        };
        let Prior {
            middle, deviation, ..
        } = prior.distribution();
        // The moments of the log-normal distribution.
        let mean = (middle + 0.5 * deviation * deviation).exp();
        let std = mean * ((deviation * deviation).exp() - 1.0).sqrt();
        assert!((mean - 10.0).abs() < 1e-12 && (std - 4.0).abs() < 1e-12);
    }
}
