//! Excitations: inputs of a few numbers, played within the limits of each input.
//!
//! A shape has values from −1 to 1; the limits of an input are its ends. A binary sequence and
//! steps move from level to level no faster than the rate of the input allows; sines are made
//! smaller until they keep it. Several inputs get the same shape, shifted against each other.

use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use utoipa::ToSchema;

/// The fewest and the most bits of a binary sequence.
pub const BITS: [u32; 2] = [3, 12];
/// The most sines of a multisine.
pub const MOST_LINES: u32 = 64;
/// The most levels of steps.
pub const MOST_LEVELS: usize = 64;

/// An experiment that can be played.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[schema(as = DesignedExcitation, example = json!({"kind": "prbs", "clock_s": 0.2, "bits": 7, "amplitude": 1.0}))]
pub enum Excitation {
    /// A pseudo-random binary sequence of maximal length, repeated.
    #[schema(title = "PrbsExcitation")]
    Prbs {
        /// How long a bit is held `[s]`.
        clock_s: f64,
        /// The bits of the shift register: the sequence repeats after `2^bits − 1` clocks.
        bits: u32,
        /// The amplitude as a share of half the range of each input.
        amplitude: f64,
    },
    /// A sum of sines at equal ratios of frequency, with Schroeder's phases (M. R. Schroeder, 1970).
    #[schema(title = "MultisineExcitation")]
    Multisine {
        /// The lowest frequency `[Hz]`.
        lowest_hz: f64,
        /// The highest frequency `[Hz]`.
        highest_hz: f64,
        /// How many sines.
        lines: u32,
        /// The peak as a share of half the range of each input.
        amplitude: f64,
    },
    /// Levels that are held one after the other, again and again.
    #[schema(title = "StepsExcitation")]
    Steps {
        /// How long each level is held `[s]`.
        hold_s: f64,
        /// The levels, −1 the lower end of each input's range, 1 the upper.
        levels: Vec<f64>,
    },
    /// One sine.
    #[schema(title = "SineExcitation")]
    Sine {
        /// The frequency `[Hz]`.
        frequency_hz: f64,
        /// The amplitude as a share of half the range of each input.
        amplitude: f64,
    },
    /// Samples that were proposed, or none where nothing drives the model.
    #[schema(title = "SampledExcitation")]
    Samples,
    /// Nothing drives the model; these are the instants of measurement.
    #[schema(title = "ChosenInstants")]
    Instants {
        /// The instants, one that is measured several times as often `[s]`.
        instants_s: Vec<f64>,
    },
}

/// Where an input may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The least value, SI.
    pub lower: f64,
    /// The largest value, SI.
    pub upper: f64,
    /// How fast it may change, SI per second; none: as fast as it likes.
    pub rate: Option<f64>,
}

/// What an excitation is played on.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// The time from one sample to the next `[s]`.
    pub sample_time: f64,
    /// How many samples.
    pub samples: usize,
    /// The limits of each input.
    pub inputs: Vec<Limits>,
}

impl Grid {
    /// How long the experiment takes `[s]`.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.samples as f64 * self.sample_time
    }

    /// A duration as whole samples, at least one.
    #[must_use]
    pub fn whole(&self, seconds: f64) -> usize {
        ((seconds / self.sample_time).round() as usize).max(1)
    }
}

impl Excitation {
    /// The samples of each input; none for instants and for samples that were proposed, which
    /// are known otherwise.
    #[must_use]
    pub fn play(&self, grid: &Grid) -> Vec<Vec<f64>> {
        let inputs = grid.inputs.iter().enumerate();
        inputs
            .map(|(place, limits)| limits.keep(self, self.shape(grid, place), grid.sample_time))
            .collect()
    }

    /// The shape of one of the inputs, from −1 to 1.
    fn shape(&self, grid: &Grid, place: usize) -> Vec<f64> {
        let share = place as f64 / grid.inputs.len().max(1) as f64;
        let samples = 0..grid.samples;
        let time = |sample: usize| sample as f64 * grid.sample_time;
        match self {
            Excitation::Prbs {
                clock_s,
                bits,
                amplitude,
            } => {
                let sequence = maximal_sequence(*bits);
                let (held, n) = (grid.whole(*clock_s), sequence.len());
                let shift = (share * n as f64) as usize;
                let bit = |sample: usize| sequence[(sample / held + shift) % n];
                samples.map(|sample| amplitude * bit(sample)).collect()
            }
            Excitation::Multisine {
                lowest_hz,
                highest_hz,
                lines,
                amplitude,
            } => {
                let ratio = highest_hz / lowest_hz;
                let last = f64::from(lines.saturating_sub(1)).max(1.0);
                let line = |k: u32| {
                    let k = f64::from(k);
                    // Lines of another input lie between those of the first.
                    let frequency = lowest_hz * libm::pow(ratio, (k + share) / (last + 1.0));
                    let phase = -PI * k * (k - 1.0) / f64::from(*lines);
                    (TAU * frequency, phase)
                };
                let lines: Vec<(f64, f64)> = (0..*lines).map(line).collect();
                let sum = |sample: usize| -> f64 {
                    let sines = lines.iter();
                    let at = |(rate, phase): &(f64, f64)| libm::sin(rate * time(sample) + phase);
                    sines.map(at).sum()
                };
                let values: Vec<f64> = samples.map(sum).collect();
                let peak = values.iter().map(|value| value.abs()).fold(0.0, f64::max);
                let scale = if peak > 0.0 { amplitude / peak } else { 0.0 };
                values.iter().map(|value| value * scale).collect()
            }
            Excitation::Steps { hold_s, levels } => {
                let (held, n) = (grid.whole(*hold_s), levels.len().max(1));
                let shift = (share * n as f64) as usize;
                let level = |sample: usize| levels.get((sample / held + shift) % n).copied();
                samples.map(|sample| level(sample).unwrap_or(0.0)).collect()
            }
            Excitation::Sine {
                frequency_hz,
                amplitude,
            } => {
                let at = |sample| TAU * frequency_hz * time(sample) + PI * share;
                samples
                    .map(|sample| amplitude * libm::sin(at(sample)))
                    .collect()
            }
            Excitation::Samples | Excitation::Instants { .. } => Vec::new(),
        }
    }
}

impl Limits {
    /// A shape between the limits, no faster than the rate.
    fn keep(&self, excitation: &Excitation, shape: Vec<f64>, sample_time: f64) -> Vec<f64> {
        let (middle, half) = (
            f64::midpoint(self.lower, self.upper),
            0.5 * (self.upper - self.lower),
        );
        let mut values: Vec<f64> = shape.iter().map(|value| half * value).collect();
        if let Some(rate) = self.rate {
            let most = rate * sample_time;
            match excitation {
                Excitation::Multisine { .. } | Excitation::Sine { .. } => shrink(&mut values, most),
                _ => slew(&mut values, most),
            }
        }
        values.iter_mut().for_each(|value| *value += middle);
        values
    }
}

/// Makes all values smaller until none is further from the next than `most`.
fn shrink(values: &mut [f64], most: f64) {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let largest = steps.fold(0.0, f64::max);
    if largest > most {
        let share = most / largest;
        values.iter_mut().for_each(|value| *value *= share);
    }
}

/// Lets values follow by steps of `most` at the most.
fn slew(values: &mut [f64], most: f64) {
    let mut last = values.first().copied().unwrap_or(0.0);
    for value in values {
        last += (*value - last).clamp(-most, most);
        *value = last;
    }
}

/// One period of the binary sequence of a shift register with a primitive polynomial (P. Alfke,
/// *Efficient Shift Registers, LFSR Counters, and Long Pseudo-Random Sequence Generators*, 1996).
fn maximal_sequence(bits: u32) -> Vec<f64> {
    let bits = bits.clamp(BITS[0], BITS[1]);
    let taps: &[u32] = match bits {
        3 => &[3, 2],
        4 => &[4, 3],
        5 => &[5, 3],
        6 => &[6, 5],
        7 => &[7, 6],
        8 => &[8, 6, 5, 4],
        9 => &[9, 5],
        10 => &[10, 7],
        11 => &[11, 9],
        _ => &[12, 6, 4, 1],
    };
    let mut register = (1_u32 << bits) - 1;
    let period = (1_usize << bits) - 1;
    let next = || {
        let level = if register & 1 == 1 { 1.0 } else { -1.0 };
        let fed = taps.iter().map(|tap| register >> (bits - tap));
        let bit = fed.fold(0, |sum, tap| sum ^ tap) & 1;
        register = (register >> 1) | (bit << (bits - 1));
        level
    };
    std::iter::repeat_with(next).take(period).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rate: Option<f64>) -> Grid {
        Grid {
            sample_time: 0.1,
            samples: 400,
            inputs: vec![Limits {
                lower: 2.0,
                upper: 6.0,
                rate,
            }],
        }
    }

    #[test]
    fn a_binary_sequence_has_the_length_and_the_balance_of_a_maximal_one() {
        for bits in BITS[0]..=BITS[1] {
            let sequence = maximal_sequence(bits);
            let n = sequence.len();
            assert_eq!(n, (1 << bits) - 1);
            assert_eq!(sequence.iter().sum::<f64>(), 1.0, "{bits}");
            // The autocorrelation of the sequence is −1 at every shift but 0.
            for shift in [1, 2, n / 2] {
                let products = (0..n).map(|k| sequence[k] * sequence[(k + shift) % n]);
                assert_eq!(products.sum::<f64>(), -1.0, "{bits} {shift}");
            }
        }
    }

    #[test]
    fn everything_is_played_within_the_limits_and_the_rate() {
        let all = [
            Excitation::Prbs {
                clock_s: 0.5,
                bits: 5,
                amplitude: 1.0,
            },
            Excitation::Multisine {
                lowest_hz: 0.05,
                highest_hz: 2.0,
                lines: 8,
                amplitude: 1.0,
            },
            Excitation::Steps {
                hold_s: 2.0,
                levels: vec![1.0, -0.5],
            },
            Excitation::Sine {
                frequency_hz: 0.25,
                amplitude: 1.0,
            },
        ];
        for excitation in all {
            let played = &excitation.play(&grid(None))[0];
            assert_eq!(played.len(), 400);
            let top = played.iter().copied().fold(f64::MIN, f64::max);
            let low = played.iter().copied().fold(f64::MAX, f64::min);
            assert!(low >= 2.0 - 1e-12 && top <= 6.0 + 1e-12, "{excitation:?}");
            assert!(top > 5.9 || low < 2.1, "{excitation:?}");
            let slow = &excitation.play(&grid(Some(3.0)))[0];
            let steps = slow.windows(2).map(|pair| (pair[1] - pair[0]).abs());
            assert!(steps.fold(0.0, f64::max) <= 0.3 + 1e-12, "{excitation:?}");
        }
    }

    #[test]
    fn several_inputs_are_not_the_same() {
        let mut grid = grid(None);
        grid.inputs.push(grid.inputs[0]);
        let played = Excitation::Prbs {
            clock_s: 0.1,
            bits: 7,
            amplitude: 1.0,
        }
        .play(&grid);
        let pairs = played[0].iter().zip(&played[1]);
        let product: f64 = pairs.map(|(a, b)| (a - 4.0) * (b - 4.0)).sum();
        assert!((product / (4.0 * 400.0)).abs() < 0.1);
    }
}
