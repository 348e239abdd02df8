//! Parameters as a string of bits: each a reflected Gray code between its bounds.
//!
//! Neighbouring values differ in one bit, so one mutation can take the smallest step (F. Gray,
//! US patent 2 632 058, 1953). Positions run from 0 (lower bound) to 1 (upper bound); whether
//! that means equal steps or equal ratios is the parameter's scale, not this file's concern.

use serde::{Deserialize, Serialize};

/// One candidate's string: a gene for each free parameter, most significant bit first.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Chromosome(pub Vec<u32>);

/// How long the genes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoding {
    /// Bits of each gene, 1 to 32.
    pub bits: u32,
    /// Genes in a string.
    pub genes: usize,
}

impl Encoding {
    /// The largest level a gene can take.
    fn top(self) -> u32 {
        u32::MAX >> (32 - self.bits)
    }

    /// Bits in a string.
    #[must_use]
    pub fn string_bits(self) -> usize {
        self.bits as usize * self.genes
    }

    /// The positions that a string stands for.
    #[must_use]
    pub fn decode(self, chromosome: &Chromosome) -> Vec<f64> {
        let top = f64::from(self.top());
        chromosome
            .0
            .iter()
            .map(|&gene| f64::from(from_gray(gene)) / top)
            .collect()
    }

    /// The string whose positions are nearest.
    #[must_use]
    pub fn encode(self, positions: &[f64]) -> Chromosome {
        let top = f64::from(self.top());
        let gene = |position: &f64| to_gray((position.clamp(0.0, 1.0) * top).round() as u32);
        Chromosome(positions.iter().map(gene).collect())
    }

    /// Reverses the bit at a place of the string.
    pub fn flip(self, chromosome: &mut Chromosome, place: usize) {
        let bits = self.bits as usize;
        chromosome.0[place / bits] ^= 1 << (bits - 1 - place % bits);
    }

    /// Copies the bits of `source` from one place of the string to before another.
    pub fn copy(
        self,
        source: &Chromosome,
        target: &mut Chromosome,
        places: std::ops::Range<usize>,
    ) {
        let bits = self.bits as usize;
        for place in places {
            let bit = 1 << (bits - 1 - place % bits);
            let gene = &mut target.0[place / bits];
            *gene = (*gene & !bit) | (source.0[place / bits] & bit);
        }
    }
}

fn to_gray(level: u32) -> u32 {
    level ^ (level >> 1)
}

fn from_gray(gray: u32) -> u32 {
    let mut level = gray;
    for shift in [1, 2, 4, 8, 16] {
        level ^= level >> shift;
    }
    level
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_position_survives_to_half_a_step(position in 0.0..=1.0f64, bits in 4u32..=32) {
            let encoding = Encoding { bits, genes: 1 };
            let back = encoding.decode(&encoding.encode(&[position]))[0];
            let step = 1.0 / (2f64.powi(bits as i32) - 1.0);
            prop_assert!((back - position).abs() <= 0.5 * step + 1e-15);
        }

        #[test]
        fn neighbouring_levels_differ_in_one_bit(level in 0u32..u32::MAX) {
            prop_assert_eq!((to_gray(level) ^ to_gray(level + 1)).count_ones(), 1);
            prop_assert_eq!(from_gray(to_gray(level)), level);
        }

        #[test]
        fn flipping_a_bit_twice_gives_the_string_back(
            genes in prop::collection::vec(0u32..1 << 16, 3),
            place in 0usize..48,
        ) {
            let encoding = Encoding { bits: 16, genes: 3 };
            let original = Chromosome(genes);
            let mut flipped = original.clone();
            encoding.flip(&mut flipped, place);
            prop_assert_ne!(&flipped, &original);
            encoding.flip(&mut flipped, place);
            prop_assert_eq!(flipped, original);
        }
    }

    #[test]
    fn the_bounds_are_met_exactly() {
        let encoding = Encoding { bits: 16, genes: 2 };
        assert_eq!(encoding.decode(&encoding.encode(&[0.0, 1.0])), [0.0, 1.0]);
    }
}
