//! Which windows of what was recorded fix the wanted unknowns best.
//!
//! A window is an experiment that was played already: it adds `JᵀJ` to what is known like one that is designed. What
//! belongs to a window alone, such as where its states start, is eliminated before windows are added, with its range
//! or its tolerance as all that is known of it; tolerances that all windows share are eliminated after they are added,
//! so that an error that is in every window does not average out.
//!
//! The first choice takes the window that adds most for its samples, again and again; then each chosen one is exchanged
//! for the best in its place until no exchange helps (V. V. Fedorov, *Theory of Optimal Experiments*, 1972).

use super::information::{Known, triangle, with_zero_right};
use super::present::Present;
use crate::estimation::problem::Problem;
use crate::estimation::sensitivity::SensitivityError;
use greybox_numerics::least_squares::Triangle;
use greybox_numerics::rng::{self, Purpose};
use greybox_simulation::SimulationFailure;
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};

/// Rounds of exchanges at the most.
const MOST_ROUNDS: usize = 10;
/// Windows that a chosen one may be exchanged for: those that would add most to the first choice.
const EXCHANGED_FOR: usize = 400;
/// A score that is larger by less is no gain.
const LEAST_GAIN: f64 = 1e-9;
/// Random choices of which the middle one is shown beside the choice.
const RANDOM_CHOICES: usize = 25;

/// The information of a window about what all windows share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowInformation {
    /// The instants at which the window is measured.
    pub samples: u64,
    /// The upper triangle row by row: columns of the shared unknowns, then those of the shared assumptions.
    triangle: Vec<f32>,
}

impl WindowInformation {
    /// The information of a problem whose one experiment is the window.
    ///
    /// # Errors
    /// When the stop flag was raised, or the window cannot be simulated.
    pub fn of(
        problem: &Problem,
        positions: &[f64],
        stop: &AtomicBool,
    ) -> Result<WindowInformation, SensitivityError> {
        let weights = vec![1.0; problem.outputs.len()];
        let mut rows = triangle(problem, positions, &weights, stop)?;
        let is_usable = rows.is_usable();
        let (alone, shared) = columns(problem);
        let n = alone.len() + shared.len();
        rows.push(&DMatrix::from_fn(alone.len(), n + 1, |row, column| {
            f64::from(u8::from(alone[row] == column))
        }));
        let order: Vec<usize> = alone.iter().chain(&shared).copied().collect();
        let factor = rows.of_columns(&order).factor();
        let triangle = (alone.len()..n).flat_map(|row| (row..n).map(move |column| (row, column)));
        let triangle: Vec<f32> = triangle.map(|place| factor[place] as f32).collect();
        if !is_usable || triangle.iter().any(|entry| !entry.is_finite()) {
            return Err(SensitivityError::Failed(SimulationFailure::Diverged));
        }
        Ok(WindowInformation {
            samples: problem.experiments[0].samples as u64,
            triangle,
        })
    }

    /// The rows that the window adds, with nothing on their right-hand sides; nothing where the window was looked at
    /// with another number of columns.
    fn rows(&self, columns: usize) -> Option<DMatrix<f64>> {
        if self.triangle.len() != columns * (columns + 1) / 2 {
            return None;
        }
        let mut factor = DMatrix::zeros(columns, columns);
        let mut entries = self.triangle.iter();
        for row in 0..columns {
            for (column, entry) in (row..columns).zip(&mut entries) {
                factor[(row, column)] = f64::from(*entry);
            }
        }
        Some(with_zero_right(&factor))
    }
}

/// The columns of the unknowns and assumptions that belong to the experiment alone, and of those that all experiments
/// share.
fn columns(problem: &Problem) -> (Vec<usize>, Vec<usize>) {
    let unknowns = problem.coordinates.iter();
    let unknowns = unknowns.map(|coordinate| coordinate.target.experiment().is_some());
    let assumptions = problem.assumptions.iter();
    let assumptions = assumptions.map(|assumption| assumption.belongs_to_an_experiment());
    let belongs: Vec<bool> = unknowns.chain(assumptions).collect();
    (0..belongs.len()).partition(|column| belongs[*column])
}

/// How closely the wanted unknowns are to be known, and with how much at the most.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowGoal {
    /// For each wanted unknown the largest total standard error that is asked for, SI; none where nothing is.
    pub targets: Vec<Option<f64>>,
    /// Samples of all chosen windows together at the most.
    pub most_samples: u64,
    /// Chosen windows at the most.
    pub most_windows: usize,
}

/// The windows that were chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenWindows {
    /// The places of the chosen windows, in the order of time.
    pub windows: Vec<usize>,
    /// Whether no exchange would help, as far as was looked.
    pub is_finished: bool,
}

/// The windows of a history, with what was known before any of them.
pub struct History<'a> {
    present: &'a Present,
    rows: Vec<DMatrix<f64>>,
    samples: Vec<u64>,
}

impl<'a> History<'a> {
    /// The windows that were looked at; nothing where one of them is of another problem.
    #[must_use]
    pub fn new(present: &'a Present, windows: &[&WindowInformation]) -> Option<History<'a>> {
        let columns = present.order.len();
        let rows = windows.iter().map(|window| window.rows(columns));
        Some(History {
            present,
            rows: rows.collect::<Option<_>>()?,
            samples: windows.iter().map(|window| window.samples).collect(),
        })
    }

    /// The windows that fulfil a goal with few samples, or come near to it; when `stop` is raised, those of the first
    /// choice and the exchanges before.
    #[must_use]
    pub fn choose(&self, goal: &WindowGoal, stop: &AtomicBool) -> ChosenWindows {
        let mut windows = self.first_choice(goal);
        let is_finished = self.exchange(&mut windows, goal, stop);
        if goal.targets.iter().any(Option::is_some) {
            self.leave_out(&mut windows, goal);
        }
        windows.sort_unstable();
        ChosenWindows {
            windows,
            is_finished,
        }
    }

    /// The errors of each unknown with some of the windows.
    #[must_use]
    pub fn known_with(&self, windows: impl IntoIterator<Item = usize>) -> Option<Vec<Known>> {
        self.present.known_by(&self.sum(windows))
    }

    /// The errors of each unknown with each of the windows alone.
    #[must_use]
    pub fn known_alone(&self) -> Vec<Option<Vec<Known>>> {
        let windows = (0..self.rows.len()).into_par_iter();
        windows.map(|window| self.known_with([window])).collect()
    }

    /// The errors of each unknown with so many windows that are drawn among these and `silent` others, which say
    /// nothing: the middle of 25 draws.
    #[must_use]
    pub fn known_at_random(&self, count: usize, silent: usize, seed: u64) -> Option<Vec<Known>> {
        let draw = |number: usize| {
            let mut rng = rng::stream(seed, number as u64, Purpose::Design);
            let mut windows: Vec<usize> = (0..self.rows.len() + silent).collect();
            for place in 0..count.min(windows.len()) {
                let left = windows.len() - place;
                windows.swap(place, place + rng::below(&mut rng, left));
            }
            windows.truncate(count);
            windows.retain(|window| *window < self.rows.len());
            self.known_with(windows)
        };
        let draws: Vec<Vec<Known>> = (0..RANDOM_CHOICES).map(draw).collect::<Option<_>>()?;
        let unknowns = draws.first()?.len();
        let middle = |unknown: usize, of: fn(&Known) -> Option<f64>| {
            let values = draws.iter().map(|draw| of(&draw[unknown]));
            let mut values: Vec<f64> = values.map(|value| value.unwrap_or(f64::INFINITY)).collect();
            values.sort_by(f64::total_cmp);
            Some(values[RANDOM_CHOICES / 2]).filter(|value| value.is_finite())
        };
        let errors = (0..unknowns).map(|unknown| Known {
            noise: middle(unknown, |draw| draw.noise),
            total: middle(unknown, |draw| draw.total),
        });
        Some(errors.collect())
    }

    /// Whether what is known with some of the windows is as close as a goal asks; never where the goal asks nothing.
    #[must_use]
    pub fn fulfils(&self, known: Option<&[Known]>, goal: &WindowGoal) -> bool {
        let Some(known) = known else {
            return false;
        };
        let mut wanted = self.present.wanted.iter().zip(&goal.targets);
        let is_near = |(unknown, target): (&usize, &Option<f64>)| {
            target.is_none_or(|target| known[*unknown].total.is_some_and(|total| total <= target))
        };
        goal.targets.iter().any(Option::is_some) && wanted.all(is_near)
    }

    fn sum(&self, windows: impl IntoIterator<Item = usize>) -> Triangle {
        let mut sum = self.present.known.clone();
        for window in windows {
            sum.push(&self.rows[window]);
        }
        sum
    }

    /// The score with each of the windows more.
    fn scores(&self, sum: &Triangle, windows: &[usize]) -> Vec<f64> {
        let windows = windows.par_iter();
        let scores = windows.map(|window| {
            let mut with = sum.clone();
            with.push(&self.rows[*window]);
            self.present.score(&with)
        });
        scores.collect()
    }

    /// The windows that are not chosen and fit beside so many samples.
    fn left(&self, chosen: &[usize], goal: &WindowGoal, samples: u64) -> Vec<usize> {
        let windows = 0..self.rows.len();
        let fits =
            |window: &usize| samples.saturating_add(self.samples[*window]) <= goal.most_samples;
        windows
            .filter(|window| !chosen.contains(window) && fits(window))
            .collect()
    }

    fn samples_of(&self, windows: &[usize]) -> u64 {
        windows.iter().map(|window| self.samples[*window]).sum()
    }

    fn first_choice(&self, goal: &WindowGoal) -> Vec<usize> {
        let mut chosen = Vec::new();
        let mut sum = self.present.known.clone();
        let mut score = self.present.score(&sum);
        while chosen.len() < goal.most_windows {
            let errors = self.present.known_by(&sum);
            if self.fulfils(errors.as_deref(), goal) {
                break;
            }
            let left = self.left(&chosen, goal, self.samples_of(&chosen));
            let gains = self.scores(&sum, &left);
            let gains = left.iter().zip(gains).map(|(window, with)| {
                let gain = with - score;
                (*window, with, gain / self.samples[*window].max(1) as f64)
            });
            let best = gains
                .filter(|(_, with, _)| *with > score + LEAST_GAIN)
                .max_by(|a, b| a.2.total_cmp(&b.2).then(b.0.cmp(&a.0)));
            let Some((window, with, _)) = best else {
                break;
            };
            sum.push(&self.rows[window]);
            score = with;
            chosen.push(window);
        }
        chosen
    }

    /// Exchanges chosen windows as long as that makes the score larger; whether no exchange is left that would.
    fn exchange(&self, chosen: &mut [usize], goal: &WindowGoal, stop: &AtomicBool) -> bool {
        let sum = self.sum(chosen.iter().copied());
        let mut others = self.left(chosen, goal, 0);
        let mut scores: Vec<(f64, usize)> = self
            .scores(&sum, &others)
            .into_iter()
            .zip(others.iter().copied())
            .collect();
        scores.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        scores.truncate(EXCHANGED_FOR);
        others = scores.into_iter().map(|(_, window)| window).collect();
        // Chosen windows one after the other that no other window would be better than.
        let mut unchanged = 0;
        for step in 0..MOST_ROUNDS * chosen.len().max(1) {
            if unchanged == chosen.len() {
                return true;
            }
            if stop.load(Ordering::Relaxed) {
                return false;
            }
            let place = step % chosen.len();
            unchanged = match self.exchange_one(chosen, place, &mut others, goal) {
                true => 0,
                false => unchanged + 1,
            };
        }
        unchanged == chosen.len()
    }

    /// Exchanges a chosen window for the best of the others, where that is better.
    fn exchange_one(
        &self,
        chosen: &mut [usize],
        place: usize,
        others: &mut [usize],
        goal: &WindowGoal,
    ) -> bool {
        let before = chosen[place];
        let kept: Vec<usize> = chosen
            .iter()
            .copied()
            .filter(|kept| *kept != before)
            .collect();
        let room = goal.most_samples.saturating_sub(self.samples_of(&kept));
        let sum = self.sum(kept);
        let least = self.scores(&sum, &[before])[0] + LEAST_GAIN;
        let scores = self.scores(&sum, others);
        let better = scores.into_iter().enumerate();
        let best = better
            .filter(|(other, score)| *score > least && self.samples[others[*other]] <= room)
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        let Some((other, _)) = best else {
            return false;
        };
        chosen[place] = others[other];
        others[other] = before;
        true
    }

    /// Leaves out windows without which the goal is fulfilled as well, the one that is missed least first.
    fn leave_out(&self, chosen: &mut Vec<usize>, goal: &WindowGoal) {
        let without = |chosen: &[usize], window: usize| {
            self.sum(chosen.iter().copied().filter(|kept| *kept != window))
        };
        loop {
            let spare = chosen.iter().filter_map(|window| {
                let sum = without(chosen, *window);
                let errors = self.present.known_by(&sum);
                let is_spare = self.fulfils(errors.as_deref(), goal);
                is_spare.then(|| (self.present.score(&sum), *window))
            });
            let Some((_, window)) = spare.max_by(|a, b| a.0.total_cmp(&b.0)) else {
                return;
            };
            chosen.retain(|kept| *kept != window);
        }
    }
}

#[cfg(test)]
mod tests;
