//! What the data logger sees of the rig.

use super::rig::STROKE;
use greybox_numerics::rng::{self, Purpose};

/// The largest code of the potentiometer: 12 bits over the stroke.
const LARGEST_CODE: f64 = 4095.0;

/// One code of the potentiometer `[m]`, about 34.2 µm.
pub const POSITION_CODE: f64 = STROKE / LARGEST_CODE;

/// Standard deviation of rounding to a code, code/√12 `[m]`: all the noise that the position has.
pub const POSITION_NOISE: f64 = 9.9e-6;

/// The range of a pressure sensor [Pa]: the supply pressure.
const PRESSURE_RANGE: f64 = 7e6;

/// Standard deviation of a pressure sensor's noise `[Pa]`: 0.1 % of its range.
pub const PRESSURE_NOISE: f64 = 1e-3 * PRESSURE_RANGE;

/// Positions as the potentiometer says them: the nearest code, within its ends `[m]`.
#[must_use]
pub fn potentiometer(positions: &[f64]) -> Vec<f64> {
    positions
        .iter()
        .map(|position| (position / POSITION_CODE).round().clamp(0.0, LARGEST_CODE) * POSITION_CODE)
        .collect()
}

/// Pressures of both chambers with the sensors' noise, normal and independent `[Pa]`.
#[must_use]
pub fn pressures(seed: u64, chambers: &[Vec<f64>; 2]) -> [Vec<f64>; 2] {
    std::array::from_fn(|chamber| {
        let mut noise = rng::stream(seed, chamber as u64, Purpose::Noise);
        chambers[chamber]
            .iter()
            .map(|pressure| pressure + PRESSURE_NOISE * rng::normal(&mut noise))
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_potentiometer_rounds_to_the_nearest_code_and_ends_with_the_stroke() {
        let positions = [0.0, 0.4, 0.6, 2047.4, 4094.9, 5000.0, -3.0];
        let codes = [0.0, 0.0, 1.0, 2047.0, 4095.0, 4095.0, 0.0];
        let seen = potentiometer(&positions.map(|codes| codes * POSITION_CODE));
        assert_eq!(seen, codes.map(|codes| codes * POSITION_CODE));
        assert_eq!(LARGEST_CODE * POSITION_CODE, STROKE);
    }

    #[test]
    fn the_noise_of_the_position_is_that_of_a_uniform_rounding_error() {
        let uniform = POSITION_CODE / 12f64.sqrt();
        assert!((POSITION_NOISE / uniform - 1.0).abs() < 0.005);
    }
}
