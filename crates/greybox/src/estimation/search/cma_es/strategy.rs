//! The distribution of covariance matrix adaptation, and how it learns.

use super::rates::Rates;
use greybox_numerics::rng::{self, Rng};
use greybox_numerics::symmetric::{self, PrincipalAxis};
use serde::{Deserialize, Serialize};

/// The standard deviation of the first candidates, as a share of the range.
const FIRST_STEP: f64 = 0.3;
/// Standard deviations stay between these.
const SHORTEST: f64 = 1e-9;
const LONGEST: f64 = 1.0;

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
