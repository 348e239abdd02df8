//! Random streams by name.
//!
//! Every random number of a run comes from a stream named by the seed, the generation and the
//! purpose. A stream does not depend on what was drawn from the others, so a run that is resumed
//! at a generation draws what the unbroken run would have drawn.

use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;

/// A source of random numbers.
pub use rand::Rng;

/// What a stream is drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// The first population.
    Population = 1,
    /// The order in which blocks of data are judged.
    BlockOrder = 2,
    /// Choosing parents.
    Selection = 3,
    /// Crossing parents.
    Crossover = 4,
    /// Reversing bits.
    Mutation = 5,
    /// Pseudo-random inputs of a demonstration recording.
    Excitation = 6,
    /// Measurement noise of a demonstration recording.
    Noise = 7,
    /// Residuals for the refits of a bootstrap.
    Bootstrap = 8,
    /// Points at which the design of an experiment is looked at.
    Design = 9,
    /// What is taken as known, for the fits of a Monte Carlo analysis.
    Assumptions = 10,
    /// Points where the constraints of a problem may hold.
    Constraints = 11,
    /// Draws from a posterior distribution.
    Posterior = 12,
}

/// The stream of a seed, a generation and a purpose.
#[must_use]
pub fn stream(seed: u64, generation: u64, purpose: Purpose) -> impl Rng {
    stream_of_search(seed, 0, generation, purpose)
}

/// The stream of one of several searches, counted from 0: what one search draws does not depend
/// on the others.
#[must_use]
pub fn stream_of_search(seed: u64, search: u32, generation: u64, purpose: Purpose) -> impl Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&generation.to_le_bytes());
    key[16..24].copy_from_slice(&(purpose as u64).to_le_bytes());
    key[24..28].copy_from_slice(&search.to_le_bytes());
    ChaCha12Rng::from_seed(key)
}

/// A number from [0, 1), all 53 bits of it drawn.
pub fn unit(rng: &mut impl Rng) -> f64 {
    rng.random::<f64>()
}

/// A whole number from 0 to `end` − 1.
pub fn below(rng: &mut impl Rng, end: usize) -> usize {
    rng.random_range(0..end)
}

/// A standard normal number (Marsaglia's polar method, with platform-independent mathematics).
pub fn normal(rng: &mut impl Rng) -> f64 {
    loop {
        let (a, b) = (2.0 * unit(rng) - 1.0, 2.0 * unit(rng) - 1.0);
        let squared = a * a + b * b;
        if squared > 0.0 && squared < 1.0 {
            return a * (-2.0 * libm::log(squared) / squared).sqrt();
        }
    }
}

/// Puts the items into a random order.
pub fn shuffle<T>(rng: &mut impl Rng, items: &mut [T]) {
    for last in (1..items.len()).rev() {
        items.swap(last, below(rng, last + 1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_repeats_and_differs_in_each_part_of_its_name() {
        let draw = |seed, generation, purpose| unit(&mut stream(seed, generation, purpose));
        let first = draw(1, 2, Purpose::Mutation);
        assert_eq!(first, draw(1, 2, Purpose::Mutation));
        assert_ne!(first, draw(2, 2, Purpose::Mutation));
        assert_ne!(first, draw(1, 3, Purpose::Mutation));
        assert_ne!(first, draw(1, 2, Purpose::Selection));
    }

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut rng = stream(7, 0, Purpose::Noise);
        let numbers: Vec<f64> = (0..100_000).map(|_| normal(&mut rng)).collect();
        let mean = numbers.iter().sum::<f64>() / 1e5;
        let variance = numbers.iter().map(|x| x * x).sum::<f64>() / 1e5;
        // Five standard errors of each.
        assert!(mean.abs() < 5.0 / 1e5f64.sqrt());
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / 1e5f64).sqrt());
    }
}
