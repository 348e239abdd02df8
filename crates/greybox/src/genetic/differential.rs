//! Differential evolution that learns how to mix: each parent is challenged by a trial that moves it
//! towards one of the best and along the difference of two others, by a weight and a recombination drawn
//! near those that have succeeded (R. Tanabe, A. Fukunaga, "Success-history based parameter adaptation for
//! differential evolution", IEEE Congress on Evolutionary Computation, 2013, with the constants of the same
//! authors' L-SHADE, 2014; differential evolution itself: R. Storn, K. Price, Journal of Global
//! Optimization 11, 1997).

use greybox_numerics::rng::{self, Rng};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Mixtures that a history holds.
const PLACES: usize = 6;
/// How far mixtures are drawn from one of the history.
const SPREAD: f64 = 0.1;
/// The share of the parents that are the best.
const BEST_SHARE: f64 = 0.11;
/// Fewer parents are not the best.
const FEWEST_BEST: usize = 2;

/// How a trial is mixed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mixture {
    /// The weight of the differences, above 0, at most 1.
    pub weight: f64,
    /// How likely a coordinate comes from the mixture.
    pub recombination: f64,
}

/// A mixture whose trial cost less than the parent.
#[derive(Clone, Copy, Debug)]
pub struct Success {
    /// How much less.
    pub gain: f64,
    /// The mixture.
    pub mixture: Mixture,
}

/// The mixtures that have succeeded of late.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SuccessHistory {
    mixtures: Vec<Mixture>,
    /// The place that is written next.
    next: usize,
}

impl Default for SuccessHistory {
    fn default() -> SuccessHistory {
        let middle = Mixture {
            weight: 0.5,
            recombination: 0.5,
        };
        SuccessHistory {
            mixtures: vec![middle; PLACES],
            next: 0,
        }
    }
}

impl SuccessHistory {
    /// A mixture near one that has succeeded.
    fn draw(&self, rng: &mut impl Rng) -> Mixture {
        let near = self.mixtures[rng::below(rng, self.mixtures.len())];
        let weight = loop {
            let weight = near.weight + SPREAD * libm::tan(PI * (rng::unit(rng) - 0.5));
            if weight > 0.0 {
                break weight.min(1.0);
            }
        };
        let recombination = near.recombination + SPREAD * rng::normal(rng);
        Mixture {
            weight,
            recombination: recombination.clamp(0.0, 1.0),
        }
    }

    /// Takes note of the successes of a generation: the means of their weights and recombinations, in which
    /// large ones and those that gained much count for more.
    pub fn learn(&mut self, successes: &[Success]) {
        let mean = |part: fn(&Mixture) -> f64| {
            let moment = |power: i32| -> f64 {
                let terms = successes
                    .iter()
                    .map(|success| success.gain * part(&success.mixture).powi(power));
                terms.sum()
            };
            let first = moment(1);
            (first > 0.0).then(|| moment(2) / first)
        };
        let Some(weight) = mean(|mixture| mixture.weight) else {
            return;
        };
        self.mixtures[self.next] = Mixture {
            weight,
            recombination: mean(|mixture| mixture.recombination).unwrap_or(0.0),
        };
        self.next = (self.next + 1) % PLACES;
    }
}

/// What trials are mixed from, as positions.
pub struct Breeding<'a> {
    /// The parents, the best first.
    pub parents: &'a [Vec<f64>],
    /// Parents of before that a challenger has replaced.
    pub replaced: &'a [Vec<f64>],
    /// What has succeeded of late.
    pub history: &'a SuccessHistory,
}

/// What challenges a parent.
pub struct Trial {
    /// Where the trial is.
    pub positions: Vec<f64>,
    /// How the trial was mixed.
    pub mixture: Mixture,
}

impl Breeding<'_> {
    /// A trial for each parent.
    #[must_use]
    pub fn trials(&self, rng: &mut impl Rng) -> Vec<Trial> {
        (0..self.parents.len())
            .map(|parent| self.trial(parent, rng))
            .collect()
    }

    /// A trial. A coordinate that would leave the box goes half the way to its end.
    fn trial(&self, place: usize, rng: &mut impl Rng) -> Trial {
        let parent = &self.parents[place];
        let mixture = self.history.draw(rng);
        let n = self.parents.len();
        let best = ((BEST_SHARE * n as f64) as usize).max(FEWEST_BEST).min(n);
        let best = &self.parents[rng::below(rng, best)];
        let first = another(n, &[place], rng);
        let second = another(n + self.replaced.len(), &[place, first], rng);
        let second = match second.checked_sub(n) {
            Some(replaced) => &self.replaced[replaced],
            None => &self.parents[second],
        };
        let first = &self.parents[first];
        let always = rng::below(rng, parent.len());
        let coordinate = |(index, &here): (usize, &f64)| {
            let mixes = index == always || rng::unit(rng) < mixture.recombination;
            if !mixes {
                return here;
            }
            let towards = best[index] - here;
            let along = first[index] - second[index];
            let mixed = here + mixture.weight * (towards + along);
            if mixed < 0.0 {
                0.5 * here
            } else if mixed > 1.0 {
                0.5 * (1.0 + here)
            } else {
                mixed
            }
        };
        Trial {
            positions: parent.iter().enumerate().map(coordinate).collect(),
            mixture,
        }
    }
}

/// A place below a number that is not among some places, as far as there is one.
fn another(below: usize, taken: &[usize], rng: &mut impl Rng) -> usize {
    let free: Vec<usize> = (0..below).filter(|place| !taken.contains(place)).collect();
    match free.len() {
        0 => taken[0],
        count => free[rng::below(rng, count)],
    }
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
        let history = SuccessHistory::default();
        let breeding = Breeding {
            parents: &parents,
            replaced: &[],
            history: &history,
        };
        for _ in 0..50 {
            let trials = breeding.trials(&mut rng);
            for trial in &trials {
                assert_eq!(trial.positions[0], 0.25);
                let mut parts = trial.positions.iter();
                assert!(parts.all(|part| (0.0..=1.0).contains(part)));
            }
            let pairs = trials.iter().zip(&parents);
            let moved = pairs.filter(|(trial, parent)| trial.positions != **parent);
            let moved = moved.count();
            assert!(moved >= 6, "{moved} of 12");
        }
    }

    #[test]
    fn a_single_parent_is_challenged_by_itself() {
        let history = SuccessHistory::default();
        let breeding = Breeding {
            parents: &[vec![0.5, 0.75]],
            replaced: &[],
            history: &history,
        };
        let mut rng = stream(3, 1, Purpose::Mutation);
        assert_eq!(breeding.trials(&mut rng)[0].positions, [0.5, 0.75]);
    }

    #[test]
    fn mixtures_come_to_those_that_succeed() {
        let mut history = SuccessHistory::default();
        let mut rng = stream(3, 2, Purpose::Mutation);
        // Weights near 0.9 and recombinations near 0.2 gain, others do not.
        for _ in 0..200 {
            let drawn: Vec<Mixture> = (0..20).map(|_| history.draw(&mut rng)).collect();
            let gain = |mixture: &Mixture| {
                let off = (mixture.weight - 0.9).abs() + (mixture.recombination - 0.2).abs();
                (0.5 - off).max(0.0)
            };
            let successes = drawn.iter().map(|&mixture| Success {
                gain: gain(&mixture),
                mixture,
            });
            let successes: Vec<Success> = successes.filter(|success| success.gain > 0.0).collect();
            history.learn(&successes);
        }
        for mixture in &history.mixtures {
            assert!(mixture.weight > 0.8, "{mixture:?}");
            assert!(mixture.recombination < 0.35, "{mixture:?}");
        }
    }
}
