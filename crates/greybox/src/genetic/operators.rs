//! Selection, crossover, mutation: the paper's section 3.2, items 1 and 2.

use super::encoding::{Chromosome, Encoding};
use greybox_numerics::rng::{self, Rng};

/// A first population, every bit drawn.
pub fn random_population(
    encoding: Encoding,
    candidates: usize,
    rng: &mut impl Rng,
) -> Vec<Chromosome> {
    let gene = |rng: &mut _| Rng::next_u32(rng) >> (32 - encoding.bits);
    (0..candidates)
        .map(|_| Chromosome((0..encoding.genes).map(|_| gene(rng)).collect()))
        .collect()
}

/// Roulette: the index of a candidate, drawn with its credit as the selection probability.
pub fn roulette(credit: &[f64], rng: &mut impl Rng) -> usize {
    let drawn = rng::unit(rng);
    let mut sum = 0.0;
    for (index, share) in credit.iter().enumerate() {
        sum += share;
        if drawn < sum {
            return index;
        }
    }
    // The credits sum to 1 only up to rounding: the last candidate with any credit.
    credit.iter().rposition(|share| *share > 0.0).unwrap_or(0)
}

/// Multi-part crossover: both strings are cut at the same `parts` − 1 places, drawn anew, and
/// the children take the fragments of their parents alternately.
pub fn cross(
    encoding: Encoding,
    parents: (&Chromosome, &Chromosome),
    parts: usize,
    rng: &mut impl Rng,
) -> (Chromosome, Chromosome) {
    let length = encoding.string_bits();
    let mut cuts: Vec<usize> = (1..parts.min(length))
        .map(|_| 1 + rng::below(rng, length - 1))
        .collect();
    cuts.sort_unstable();
    cuts.push(length);
    let mut children = (parents.0.clone(), parents.1.clone());
    let mut from = 0;
    for (fragment, &to) in cuts.iter().enumerate() {
        if fragment % 2 == 1 {
            encoding.copy(parents.1, &mut children.0, from..to);
            encoding.copy(parents.0, &mut children.1, from..to);
        }
        from = to;
    }
    children
}

/// Reverses each bit with the given probability.
pub fn mutate(
    encoding: Encoding,
    chromosome: &mut Chromosome,
    probability: f64,
    rng: &mut impl Rng,
) {
    for place in 0..encoding.string_bits() {
        if rng::unit(rng) < probability {
            encoding.flip(chromosome, place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::rng::{Purpose, stream};

    const ENCODING: Encoding = Encoding { bits: 16, genes: 4 };

    #[test]
    fn roulette_draws_in_proportion_to_the_credits() {
        let mut rng = stream(3, 0, Purpose::Selection);
        let mut drawn = [0u32; 3];
        for _ in 0..30_000 {
            drawn[roulette(&[0.5, 0.0, 0.5], &mut rng)] += 1;
        }
        assert_eq!(drawn[1], 0);
        // Five standard errors of a binomial count.
        assert!((f64::from(drawn[0]) - 15_000.0).abs() < 5.0 * 7500f64.sqrt());
    }

    #[test]
    fn children_hold_between_them_exactly_the_bits_of_their_parents() {
        let mut rng = stream(4, 0, Purpose::Crossover);
        let parents = random_population(ENCODING, 2, &mut rng);
        for parts in 2..9 {
            let (a, b) = cross(ENCODING, (&parents[0], &parents[1]), parts, &mut rng);
            for gene in 0..4 {
                let (p, q) = (parents[0].0[gene], parents[1].0[gene]);
                assert_eq!(a.0[gene] & b.0[gene], p & q);
                assert_eq!(a.0[gene] | b.0[gene], p | q);
            }
        }
    }

    #[test]
    fn crossover_mixes_both_parents() {
        let mut rng = stream(5, 0, Purpose::Crossover);
        let parents = (Chromosome(vec![0; 4]), Chromosome(vec![0xffff; 4]));
        let ones: u32 = (0..200)
            .map(|_| cross(ENCODING, (&parents.0, &parents.1), 3, &mut rng).0)
            .map(|child| child.0.iter().map(|gene| gene.count_ones()).sum::<u32>())
            .sum();
        // A third of 64 bits on average: the middle one of three fragments.
        let mean = f64::from(ones) / 200.0;
        assert!((15.0..28.0).contains(&mean), "{mean}");
    }

    #[test]
    fn mutation_reverses_the_expected_share_of_bits() {
        let mut rng = stream(6, 0, Purpose::Mutation);
        let mut flipped = 0;
        for _ in 0..1000 {
            let mut chromosome = Chromosome(vec![0; 4]);
            mutate(ENCODING, &mut chromosome, 0.05, &mut rng);
            flipped += chromosome
                .0
                .iter()
                .map(|gene| gene.count_ones())
                .sum::<u32>();
        }
        // 64 000 bits at 5 %: 3200, five standard errors wide.
        assert!((f64::from(flipped) - 3200.0).abs() < 5.0 * 3040f64.sqrt());
    }
}
