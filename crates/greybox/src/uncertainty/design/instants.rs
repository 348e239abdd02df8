//! Which instants to measure at: the best so many of the candidates.
//!
//! The derivatives at all candidates come from one simulation at each point. The first choice takes
//! the best candidate again and again; then each chosen one is exchanged for the best in its place
//! until no exchange helps (V. V. Fedorov, *Theory of Optimal Experiments*, 1972).

use super::assessment::Assessment;
use super::information::visit;
use super::present::Present;
use crate::estimation::problem::{Experiment, Problem};
use crate::estimation::sensitivity::SensitivityError;
use greybox_numerics::least_squares::Triangle;
use nalgebra::DMatrix;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Rounds of exchanges at the most.
const MOST_ROUNDS: usize = 10;
/// A score that is larger by less is no gain.
const LEAST_GAIN: f64 = 1e-9;

/// The candidates, as they are seen at each point.
#[derive(Clone, Debug)]
pub struct Candidates {
    /// For each point the rows of each sample; none where the experiment cannot be simulated.
    points: Vec<Option<Vec<DMatrix<f64>>>>,
}

/// How instants may be chosen.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The samples to choose from.
    pub among: Vec<usize>,
    /// How many.
    pub count: usize,
    /// Whether one may be chosen again.
    pub may_repeat: bool,
}

/// The instants that were chosen.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The samples, in order.
    pub samples: Vec<usize>,
    /// The information that the instants would bring.
    pub assessment: Assessment,
    /// Whether no exchange would help, as far as was looked.
    pub is_finished: bool,
}

impl Candidates {
    /// Simulates an experiment that measures at all of them. Answers nothing when `stop` was
    /// raised.
    #[must_use]
    pub fn new(
        present: &Present,
        next: &Problem,
        experiment: Experiment,
        stop: &AtomicBool,
    ) -> Option<Candidates> {
        let mut problem = next.clone();
        let samples = experiment.samples;
        problem.experiments = Arc::new(vec![experiment]);
        let mut points = Vec::with_capacity(present.points.len());
        for positions in &present.points {
            let mut rows: Vec<Vec<f64>> = vec![Vec::new(); samples];
            let seen = visit(&problem, positions, stop, |sample, _, columns| {
                rows[sample].extend_from_slice(columns);
                rows[sample].push(0.0);
            });
            let width = present.order.len() + 1;
            let block = |rows: Vec<f64>| DMatrix::from_row_slice(rows.len() / width, width, &rows);
            points.push(match seen {
                Ok(()) => Some(rows.into_iter().map(block).collect()),
                Err(SensitivityError::Interrupted) => return None,
                Err(SensitivityError::Failed(_)) => None,
            });
        }
        Some(Candidates { points })
    }

    /// What measuring at these samples would bring.
    #[must_use]
    pub fn assess(&self, present: &Present, samples: &[usize]) -> Assessment {
        present.assessment(&self.sums(present, samples))
    }

    /// The best of the candidates. Answers nothing when `stop` was raised before a first choice
    /// stood.
    #[must_use]
    pub fn choose(&self, present: &Present, choice: &Choice, stop: &AtomicBool) -> Option<Chosen> {
        let mut samples: Vec<usize> = Vec::with_capacity(choice.count);
        for _ in 0..choice.count {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            samples.push(self.best_beside(present, choice, &samples)?.0);
        }
        let is_finished = self.exchange(present, choice, &mut samples, stop);
        samples.sort_unstable();
        Some(Chosen {
            assessment: self.assess(present, &samples),
            samples,
            is_finished,
        })
    }

    /// Exchanges chosen samples for better ones; whether it came to where none is better.
    fn exchange(
        &self,
        present: &Present,
        choice: &Choice,
        samples: &mut Vec<usize>,
        stop: &AtomicBool,
    ) -> bool {
        let mut score = self.assess(present, samples).score;
        // Chosen samples, the last ones, that none was better than.
        let mut standing = 0;
        for place in (0..samples.len()).cycle().take(MOST_ROUNDS * samples.len()) {
            if standing == samples.len() || stop.load(Ordering::Relaxed) {
                break;
            }
            let removed = samples.remove(place);
            let best = self.best_beside(present, choice, samples);
            let better = best.filter(|(_, reached)| *reached > score + LEAST_GAIN);
            standing = if better.is_some() { 0 } else { standing + 1 };
            score = better.map_or(score, |(_, reached)| reached);
            samples.insert(place, better.map_or(removed, |(sample, _)| sample));
        }
        standing == samples.len()
    }

    /// The candidate that brings most beside some samples, with the score that it reaches.
    fn best_beside(
        &self,
        present: &Present,
        choice: &Choice,
        samples: &[usize],
    ) -> Option<(usize, f64)> {
        let sums = self.sums(present, samples);
        let may = |sample: &&usize| choice.may_repeat || !samples.contains(sample);
        let mut best: Option<(usize, f64)> = None;
        for &sample in choice.among.iter().filter(may) {
            let score = self.score_with(present, &sums, sample);
            if best.is_none_or(|(_, before)| score > before + LEAST_GAIN) {
                best = Some((sample, score));
            }
        }
        best
    }

    fn score_with(&self, present: &Present, sums: &[Option<Triangle>], sample: usize) -> f64 {
        let with = |(sum, rows): (&Option<Triangle>, &Option<Vec<DMatrix<f64>>>)| {
            let (Some(sum), Some(rows)) = (sum, rows) else {
                return present.score(&present.known);
            };
            let mut sum = sum.clone();
            sum.push(&rows[sample]);
            present.score(&sum)
        };
        let scores = sums.iter().zip(&self.points).map(with);
        scores.sum::<f64>() / sums.len() as f64
    }

    /// What is known at each point with measurements at these samples.
    fn sums(&self, present: &Present, samples: &[usize]) -> Vec<Option<Triangle>> {
        let of_point = |rows: &Option<Vec<DMatrix<f64>>>| {
            let rows = rows.as_ref()?;
            let mut sum = present.known.clone();
            for sample in samples {
                sum.push(&rows[*sample]);
            }
            Some(sum).filter(Triangle::is_usable)
        };
        self.points.iter().map(of_point).collect()
    }
}
