//! Covariance matrix adaptation, to compare the hybrid search with: candidates are drawn from a
//! normal distribution that learns from the better of them where to go, how far, and along which
//! valleys (N. Hansen, "The CMA Evolution Strategy: A Tutorial", 2016, arXiv:1604.00772, the
//! algorithm of its appendix A with the default parameters of its table 1, negative weights
//! included).
//!
//! Where this departs from the tutorial:
//! - the box: the distribution knows no bounds; what falls outside is judged as its mirror image
//!   inside, so that to the distribution a minimum on a bound looks like one within;
//! - a candidate that failed counts as one that was not drawn;
//! - no axis grows longer than the box or shorter than a few steps of the Gray code of 32 bits.

mod rates;

use super::Search;
use super::proposer::{Judgement, Proposer};
use crate::estimation::objective::Evaluation;
use crate::estimation::settings::Settings;
use crate::genetic::{Chromosome, Encoding};
use greybox_numerics::rng::{self, Purpose, Rng};
use greybox_numerics::symmetric::{self, PrincipalAxis};
use rates::Rates;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Bits for each parameter: at 16 the steps of a narrow valley would be felt.
const BITS: u32 = 32;

/// The standard deviation of the first candidates, as a share of the range.
const FIRST_STEP: f64 = 0.3;
/// Standard deviations stay between these.
const SHORTEST: f64 = 1e-9;
const LONGEST: f64 = 1.0;

/// Covariance matrix adaptation.
#[derive(Debug)]
pub(super) struct CmaEs;

impl Proposer for CmaEs {
    /// About a mean drawn from the box.
    fn begin(&self, search: &mut Search) -> Vec<Chromosome> {
        let mut rng = search.stream(Purpose::Population);
        let mean = (0..search.encoding.genes).map(|_| rng::unit(&mut rng));
        let mut strategy = Strategy::about(mean.collect());
        let drawn = strategy.draw(search.settings.population as usize, &mut rng);
        search.state.strategy = Some(strategy);
        encoded(&drawn, search.encoding)
    }

    fn next(&self, search: &mut Search, judged: &Judgement<'_>) -> Vec<Chromosome> {
        let mut rng = search.stream(Purpose::Mutation);
        let strategy = search.state.strategy.as_mut();
        let strategy = strategy.expect("the first generation was drawn from one");
        strategy.learn(&best_first(judged.evaluations));
        let drawn = strategy.draw(judged.evaluations.len(), &mut rng);
        encoded(&drawn, search.encoding)
    }

    fn bits(&self, _settings: &Settings) -> u32 {
        BITS
    }
}

/// The places of the candidates that did not fail, the lowest cost first.
fn best_first(evaluations: &[Arc<Evaluation>]) -> Vec<usize> {
    let sound = |place: &usize| evaluations[*place].failure.is_none();
    let mut places: Vec<usize> = (0..evaluations.len()).filter(sound).collect();
    places.sort_by(|&a, &b| evaluations[a].cost.total_cmp(&evaluations[b].cost));
    places
}

fn encoded(candidates: &[Vec<f64>], encoding: Encoding) -> Vec<Chromosome> {
    let strings = candidates
        .iter()
        .map(|positions| encoding.encode(positions));
    strings.collect()
}

/// The distribution that candidates are drawn from, and how it came to move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strategy {
    /// The mean of the distribution.
    mean: Vec<f64>,
    /// The step size σ that the covariance is to be scaled with.
    step: f64,
    /// The covariance C of the distribution, row by row.
    covariance: Vec<Vec<f64>>,
    /// Where the mean has been going lately (p_c), in steps.
    path: Vec<f64>,
    /// Where the mean has been going lately (p_σ), in coordinates in which the distribution is
    /// round.
    round_path: Vec<f64>,
    /// How often the distribution has learned.
    updates: u32,
    /// The candidates drawn last, before they were mirrored into the box.
    drawn: Vec<Vec<f64>>,
}

impl Strategy {
    /// A round distribution about a mean.
    #[must_use]
    pub fn about(mean: Vec<f64>) -> Strategy {
        let n = mean.len();
        let unit = |row: usize| (0..n).map(move |column| f64::from(row == column));
        Strategy {
            step: FIRST_STEP,
            covariance: (0..n).map(|row| unit(row).collect()).collect(),
            path: vec![0.0; n],
            round_path: vec![0.0; n],
            updates: 0,
            drawn: Vec::new(),
            mean,
        }
    }

    /// Draws candidates. Answers their positions in the box.
    pub fn draw(&mut self, candidates: usize, rng: &mut impl Rng) -> Vec<Vec<f64>> {
        let axes = self.axes();
        let drawn = (0..candidates).map(|_| self.draw_one(&axes, rng));
        self.drawn = drawn.collect();
        let inside = |drawn: &Vec<f64>| drawn.iter().copied().map(mirrored).collect();
        self.drawn.iter().map(inside).collect()
    }

    fn draw_one(&self, axes: &[PrincipalAxis], rng: &mut impl Rng) -> Vec<f64> {
        let mut drawn = self.mean.clone();
        for axis in axes {
            let length = self.step * axis.value * rng::normal(rng);
            add(&mut drawn, length, &axis.direction);
        }
        drawn
    }

    /// The axes of the distribution, each with its standard deviation in steps.
    fn axes(&self) -> Vec<PrincipalAxis> {
        let mut axes = symmetric::axes(&self.covariance);
        for axis in &mut axes {
            let deviation = axis.value.max(0.0).sqrt();
            axis.value = deviation.clamp(SHORTEST / self.step, LONGEST / self.step);
        }
        axes
    }

    /// Learns from the candidates drawn last: the places of those that did not fail, the best
    /// first. One alone tells nothing.
    pub fn learn(&mut self, best_first: &[usize]) {
        if best_first.len() < 2 {
            return;
        }
        let rates = Rates::of(self.mean.len(), best_first.len());
        let axes = self.axes();
        let moves = best_first.iter().map(|&place| self.steps_to(place));
        let moves: Vec<Vec<f64>> = moves.collect();
        let mut gone = vec![0.0; self.mean.len()];
        for (weight, way) in rates.weights.iter().zip(&moves).filter(|(w, _)| **w > 0.0) {
            add(&mut gone, *weight, way);
        }
        add(&mut self.mean, self.step, &gone);
        let is_steady = self.follow(&gone, &axes, &rates);
        self.stretch(&moves, is_steady, &axes, &rates);
        let excess = norm(&self.round_path) / rates.usual_length - 1.0;
        let factor = libm::exp(rates.step_path / rates.step_damping * excess);
        self.step = (self.step * factor).clamp(SHORTEST, LONGEST);
        self.updates = self.updates.saturating_add(1);
    }

    fn steps_to(&self, place: usize) -> Vec<f64> {
        let pairs = self.drawn[place].iter().zip(&self.mean);
        pairs.map(|(to, from)| (to - from) / self.step).collect()
    }

    /// Adds the move of the mean to the paths. Answers whether the path is no longer than chance
    /// makes it (h_σ): a longer one would stretch the covariance before the step size has grown.
    fn follow(&mut self, gone: &[f64], axes: &[PrincipalAxis], rates: &Rates) -> bool {
        let keep = 1.0 - rates.step_path;
        scale(&mut self.round_path, keep);
        let share = (rates.step_path * (2.0 - rates.step_path) * rates.effective).sqrt();
        add(&mut self.round_path, share, &rounded(gone, axes));
        let settling = 1.0 - libm::pow(keep, 2.0 * (f64::from(self.updates) + 1.0));
        let limit = 1.4 + 2.0 / (gone.len() as f64 + 1.0);
        let length = norm(&self.round_path) / settling.sqrt();
        let is_steady = length < limit * rates.usual_length;
        scale(&mut self.path, 1.0 - rates.path);
        if is_steady {
            let share = (rates.path * (2.0 - rates.path) * rates.effective).sqrt();
            add(&mut self.path, share, gone);
        }
        is_steady
    }

    /// Moves the covariance towards the path and towards the moves of the better candidates, and
    /// away from those of the worse.
    fn stretch(
        &mut self,
        moves: &[Vec<f64>],
        is_steady: bool,
        axes: &[PrincipalAxis],
        rates: &Rates,
    ) {
        let missed = match is_steady {
            true => 0.0,
            false => rates.path * (2.0 - rates.path),
        };
        let all: f64 = rates.weights.iter().sum();
        let keep = 1.0 - rates.rank_one * (1.0 - missed) - rates.rank_many * all;
        self.covariance.iter_mut().for_each(|row| scale(row, keep));
        self.add_square(rates.rank_one, &self.path.clone());
        for (weight, way) in rates.weights.iter().zip(moves) {
            let mut weight = rates.rank_many * weight;
            if weight < 0.0 {
                // However far a bad candidate lies, what is left has a variance in each direction.
                let length = norm(&rounded(way, axes));
                weight *= way.len() as f64 / (length * length).max(f64::MIN_POSITIVE);
            }
            self.add_square(weight, way);
        }
    }

    fn add_square(&mut self, weight: f64, way: &[f64]) {
        for (row, part) in self.covariance.iter_mut().zip(way) {
            add(row, weight * part, way);
        }
    }
}

/// The box and its mirror images fill the space.
fn mirrored(part: f64) -> f64 {
    let within_two = part.rem_euclid(2.0);
    within_two.min(2.0 - within_two)
}

/// A move in coordinates in which the distribution is round: C^(−1/2) times it.
fn rounded(way: &[f64], axes: &[PrincipalAxis]) -> Vec<f64> {
    let mut round = vec![0.0; way.len()];
    for axis in axes {
        let along: f64 = axis.direction.iter().zip(way).map(|(a, b)| a * b).sum();
        // The deviation of the axis in steps.
        add(&mut round, along / axis.value, &axis.direction);
    }
    round
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}

fn scale(vector: &mut [f64], factor: f64) {
    vector.iter_mut().for_each(|part| *part *= factor);
}

fn add(vector: &mut [f64], factor: f64, other: &[f64]) {
    for (part, other) in vector.iter_mut().zip(other) {
        *part += factor * other;
    }
}

#[cfg(test)]
mod tests;
