//! Differential evolution, to compare the hybrid search with: each parent is challenged by a trial
//! that mixes it with the best parent, moved along the difference of two others (R. Storn, K.
//! Price, "Differential evolution", Journal of Global Optimization 11, 1997; the variant
//! best/1/bin with a weight drawn anew each generation).

use greybox_numerics::rng::{self, Rng};

/// The weight of the difference is drawn from this range.
const WEIGHTS: (f64, f64) = (0.5, 1.0);
/// How likely a coordinate comes from the mixture.
const RECOMBINATION: f64 = 0.7;

/// A trial for each parent, as positions; `best` is the place of the best parent. A coordinate
/// that would leave the box is drawn anew.
#[must_use]
pub fn trials(parents: &[Vec<f64>], best: usize, rng: &mut impl Rng) -> Vec<Vec<f64>> {
    let weight = WEIGHTS.0 + (WEIGHTS.1 - WEIGHTS.0) * rng::unit(rng);
    (0..parents.len())
        .map(|parent| trial(parents, Mixed { parent, best }, weight, rng))
        .collect()
}

/// The parents that a trial is mixed from, by their places.
struct Mixed {
    parent: usize,
    best: usize,
}

fn trial(
    parents: &[Vec<f64>],
    Mixed { parent, best }: Mixed,
    weight: f64,
    rng: &mut impl Rng,
) -> Vec<f64> {
    let (first, second) = two_others(parents.len(), parent, rng);
    let always = rng::below(rng, parents[parent].len());
    (0..parents[parent].len())
        .map(|index| {
            let mixes = index == always || rng::unit(rng) < RECOMBINATION;
            if !mixes {
                return parents[parent][index];
            }
            let difference = parents[first][index] - parents[second][index];
            let mixture = parents[best][index] + weight * difference;
            if (0.0..=1.0).contains(&mixture) {
                mixture
            } else {
                rng::unit(rng)
            }
        })
        .collect()
}

/// Two different parents beside the one at a place, as far as there are so many.
fn two_others(count: usize, parent: usize, rng: &mut impl Rng) -> (usize, usize) {
    let mut others: Vec<usize> = (0..count).filter(|place| *place != parent).collect();
    rng::shuffle(rng, &mut others);
    (others[0], others.get(1).copied().unwrap_or(parent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::rng::{Purpose, stream};

    #[test]
    fn parents_that_agree_in_a_coordinate_pass_it_on_and_no_trial_leaves_the_box() {
        let mut rng = stream(3, 0, Purpose::Mutation);
        let parents: Vec<Vec<f64>> = (0..12)
            .map(|_| vec![0.25, rng::unit(&mut rng), rng::unit(&mut rng)])
            .collect();
        for _ in 0..50 {
            let trials = trials(&parents, 4, &mut rng);
            for trial in &trials {
                assert_eq!(trial[0], 0.25);
                assert!(trial.iter().all(|part| (0.0..=1.0).contains(part)));
            }
            // The best parent may come out as it is, the others hardly ever.
            let pairs = trials.iter().zip(&parents);
            let moved = pairs.filter(|(trial, parent)| trial != parent).count();
            assert!(moved >= 9, "{moved} of 12");
        }
    }
}
