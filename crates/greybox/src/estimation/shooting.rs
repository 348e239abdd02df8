//! Multiple shooting: a descent over a record that is cut into segments, each with a start of its own.
//!
//! Over a long record the free run of a candidate that is a little wrong gets out of step with what
//! was measured, so that its cost has many minima that mean nothing. Over a short segment it cannot.
//! Here the states at the starts of the segments are unknowns beside those of the problem (H. G. Bock,
//! "Recent advances in parameter identification techniques for O.D.E.", 1983), and that each segment
//! ends where the next one starts is asked for with a weight that is small at first and grows (H. U.
//! Voss, J. Timmer, J. Kurths, "Nonlinear dynamical system identification from uncertain and indirect
//! measurements", 2004). The starts are eliminated from each linearised problem, so that a step costs
//! little more than one of the free run. No state has to be measured: those that are begin where they
//! were measured, the others where the simulation of the segments before has brought them. Where the
//! segments have joined, the free run is as good as they are, and its own descent goes on from there.

mod linearised;
mod segment;

use super::feasible;
use super::problem::Problem;
use linearised::Linearised;
use segment::{Joins, Simulated, Starts, Trial};
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;

/// Iterations at the most, and of them with one weight.
const MOST_ITERATIONS: u32 = 60;
const ITERATIONS_OF_WEIGHT: u32 = 8;
/// The shares of a step that are tried.
const SHARES: [f64; 4] = [1.0, 0.5, 0.2, 0.05];
/// The dampings that are tried, relative to the last good one.
const DAMPING_FACTORS: [f64; 2] = [0.1, 10.0];
const FIRST_DAMPING: f64 = 1e-3;
const SMALLEST_DAMPING: f64 = 1e-9;
/// Where no step helps, damping rises by this, up to the largest.
const DAMPING_RISE: f64 = 1e3;
const LARGEST_DAMPING: f64 = 1e4;
/// What the square of a jump, in what its state moves, counts at first beside the square of a residual
/// in noise; residuals in what their output moves are taken for noise of a hundredth.
const FIRST_WEIGHT: f64 = 1.0;
const FIRST_WEIGHT_WITHOUT_NOISE: f64 = 1e-4;
/// How much the weight grows once it brings no more.
const WEIGHT_RISE: f64 = 10.0;
/// The segments have joined where their jumps are this share of what the states move, on average.
const JOINED: f64 = 1e-3;
/// A gain by less than this share of what is left is none.
const LEAST_GAIN: f64 = 0.01;

/// A descent over segments from one candidate.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Shooting {
    /// The search that the descent started from, counted from 0.
    pub search: Option<u32>,
    /// Where the descent is.
    pub positions: Vec<f64>,
    /// Where the segments start; nothing before the first iteration.
    starts: Option<Starts>,
    /// How much the square of a jump counts beside the square of a residual; nothing before the first
    /// iteration.
    weight: Option<f64>,
    damping: f64,
    iterations: u32,
    /// Iterations with the present weight.
    with_weight: u32,
    /// Candidates simulated, each once over the whole record.
    pub evaluations: u64,
    /// Whether the descent has ended.
    pub has_ended: bool,
}

impl Shooting {
    /// Whether the record of a problem can be cut into segments.
    #[must_use]
    pub fn is_possible(problem: &Problem) -> bool {
        let cuts = problem.experiments.iter().map(segment::cuts);
        cuts.map(|cuts| cuts.len())
            .max()
            .is_some_and(|most| most > 2)
    }

    /// Begins a descent at a candidate.
    #[must_use]
    pub fn from(search: Option<u32>, positions: Vec<f64>) -> Shooting {
        Shooting {
            search,
            positions,
            starts: None,
            weight: None,
            damping: FIRST_DAMPING,
            iterations: 0,
            with_weight: 0,
            evaluations: 0,
            has_ended: false,
        }
    }

    /// One iteration. Answers false, with nothing changed, when `stop` was raised.
    pub fn iterate(&mut self, problem: &Problem, stop: &AtomicBool) -> bool {
        let starts = match self.starts.take() {
            Some(starts) => starts,
            None => match segment::first_starts(problem, &self.positions, stop) {
                Some(Some(starts)) => starts,
                Some(None) => {
                    self.has_ended = true;
                    return true;
                }
                None => return false,
            },
        };
        let weight = self.weight.unwrap_or(match problem.declares_noise() {
            true => FIRST_WEIGHT,
            false => FIRST_WEIGHT_WITHOUT_NOISE,
        });
        let next = self.next(
            problem,
            Joins {
                starts: &starts,
                weight,
            },
            stop,
        );
        self.starts = Some(starts);
        let Some(next) = next else {
            return false;
        };
        self.weight = Some(weight);
        self.iterations += 1;
        self.with_weight += 1;
        self.evaluations += next.simulated;
        match next.reached {
            Some(reached) => {
                self.positions = reached.trial.positions;
                self.starts = Some(reached.trial.starts);
                self.damping = reached.damping;
                if reached.has_settled || self.with_weight == ITERATIONS_OF_WEIGHT {
                    self.has_ended = reached.has_joined;
                    self.tighten(weight);
                }
            }
            None if self.damping < LARGEST_DAMPING => self.damping *= DAMPING_RISE,
            None => {
                self.has_ended = next.has_joined;
                self.tighten(weight);
            }
        }
        self.has_ended |= next.has_failed || self.iterations >= MOST_ITERATIONS;
        true
    }

    /// Lets jumps count more.
    fn tighten(&mut self, weight: f64) {
        self.weight = Some(weight * WEIGHT_RISE);
        self.with_weight = 0;
        self.damping = FIRST_DAMPING;
    }

    /// What the next iteration leads to. Nothing when `stop` was raised.
    fn next(&self, problem: &Problem, joins: Joins<'_>, stop: &AtomicBool) -> Option<Next> {
        let Joins { starts, weight } = joins;
        let simulated = Simulated::around(problem, &self.positions, starts, stop)?;
        let mut next = Next {
            simulated: simulated.n_candidates(),
            reached: None,
            has_joined: false,
            has_failed: true,
        };
        let here = Linearised::of(problem, &self.positions, joins, &simulated);
        let Some(here) = here else {
            return Some(next);
        };
        let has_joined = |jumps: f64| (jumps / here.n_jumps.max(1) as f64).sqrt() < JOINED;
        next.has_failed = false;
        next.has_joined = has_joined(here.jumps);
        let trials = self.trials(problem, starts, &here);
        let judged = {
            let trials: Vec<&Trial> = trials.iter().map(|(trial, _)| trial).collect();
            segment::judge(problem, &trials, stop)?
        };
        next.simulated += trials.len() as u64;
        let merit = |[residuals, jumps]: [f64; 2]| residuals + weight * jumps;
        let before = merit([here.residuals, here.jumps]);
        let best = trials.into_iter().zip(judged);
        let best = best.min_by(|(_, a), (_, b)| merit(*a).total_cmp(&merit(*b)));
        if let Some(((trial, damping), sums)) = best.filter(|(_, sums)| merit(*sums) < before) {
            next.reached = Some(Reached {
                trial,
                damping,
                has_settled: before - merit(sums) < LEAST_GAIN * before,
                has_joined: has_joined(sums[1]),
            });
        }
        Some(next)
    }

    /// The damped steps, and shares of them, each with its damping.
    fn trials(&self, problem: &Problem, starts: &Starts, here: &Linearised) -> Vec<(Trial, f64)> {
        let free = feasible::movable(here.chains.triangle(), &self.positions);
        let dampings = DAMPING_FACTORS.map(|factor| (self.damping * factor).max(SMALLEST_DAMPING));
        let mut trials = Vec::new();
        for damping in dampings {
            let Some(step) = here.chains.triangle().damped_step(damping, &free) else {
                continue;
            };
            let shares = SHARES.iter().filter_map(|share| {
                let pairs = self.positions.iter().zip(step.iter());
                let moved = pairs.map(|(z, d)| (z + share * d).clamp(0.0, 1.0));
                let trial = Trial {
                    positions: feasible::nearest(problem, moved.collect())?,
                    starts: here.moved(starts, step.as_slice(), *share)?,
                };
                Some((trial, damping))
            });
            trials.extend(shares);
        }
        trials
    }
}

/// What an iteration came to.
struct Next {
    simulated: u64,
    reached: Option<Reached>,
    /// Whether the segments had joined before it.
    has_joined: bool,
    has_failed: bool,
}

/// Where an iteration leads.
struct Reached {
    trial: Trial,
    damping: f64,
    /// Whether next to nothing was gained.
    has_settled: bool,
    /// Whether the segments have joined.
    has_joined: bool,
}

#[cfg(test)]
mod tests;
