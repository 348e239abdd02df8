//! What a run reports while it goes on.

use super::objective::Evaluation;
use super::problem::Problem;
use greybox_numerics::convergence::Convergence;
use greybox_numerics::json;
use greybox_simulation::SimulationFailure;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Watches a run. Every method has a default that does nothing, and `()` is an observer that
/// ignores everything.
pub trait Observer {
    /// Something should be known before the search begins.
    fn finding(&mut self, _finding: &Finding) {}
    /// A generation has been judged.
    fn generation(&mut self, _row: &GenerationRow) {}
    /// The refinement has finished an iteration.
    fn refinement(&mut self, _row: &RefinementRow) {}
    /// The chains of a posterior have been looked at.
    fn posterior(&mut self, _row: &PosteriorRow) {}
}

impl Observer for () {}

/// One thing that the user of a job should know before it runs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Finding {
    /// What kind of finding, for programs: stable snake_case.
    #[schema(example = "input_constant")]
    pub code: String,
    /// Where: a JSON pointer into the specification.
    #[schema(example = "/experiments/0/signals/reference")]
    pub pointer: String,
    /// The finding in words, with the numbers in it.
    pub detail: String,
}

impl Finding {
    /// A finding at a place of the specification.
    #[must_use]
    pub fn new(code: &str, pointer: &str, detail: &str) -> Finding {
        Finding {
            code: code.to_owned(),
            pointer: pointer.to_owned(),
            detail: detail.to_owned(),
        }
    }
}

/// One generation of the search.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GenerationRow {
    /// Counts from 1.
    pub generation: u32,
    /// Candidates judged so far.
    pub evaluations: u64,
    /// The lowest cost so far; infinite while every candidate has failed.
    #[serde(with = "json::or_infinity")]
    pub best_cost: f64,
    /// The lowest cost in this generation (without elitism it may rise).
    #[serde(with = "json::or_infinity")]
    pub generation_best_cost: f64,
    /// The mean cost of this generation's candidates that did not fail.
    pub mean_cost: Option<f64>,
    /// The largest credit in this generation.
    #[serde(with = "json::or_nan")]
    pub best_credit: f64,
    /// The entropy of the credits.
    #[serde(with = "json::or_nan")]
    pub entropy: f64,
    /// Blocks that were judged before the entropy criterion stopped.
    pub credit_updates: u32,
    /// The unknowns of the candidate with the lowest cost so far, SI.
    pub best: Vec<(String, f64)>,
    /// The candidates that the generation simulated; the others were remembered.
    pub simulated: Vec<Simulated>,
}

/// A candidate that the search simulated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Simulated {
    /// The candidate's place in the population, from 0.
    pub place: usize,
    /// What the candidate was judged by; infinite where it failed.
    #[serde(with = "json::or_infinity")]
    pub cost: f64,
    /// How the candidate failed, if it did.
    pub failure: Option<SimulationFailure>,
    /// The value of each coordinate of the problem, SI.
    pub values: Vec<f64>,
}

impl Counters {
    /// Adds the counts of `other`.
    pub(super) fn add(&mut self, other: &Counters) {
        self.evaluations += other.evaluations;
        self.distinct_evaluations += other.distinct_evaluations;
        for (failure, number) in &other.failed_evaluations {
            *self.failed_evaluations.entry(*failure).or_default() += number;
        }
    }
}

impl Simulated {
    /// The candidates at some places of a population, with what they came to.
    pub(super) fn of(
        problem: &Problem,
        places: &[usize],
        positions: &[Vec<f64>],
        evaluations: &[Evaluation],
    ) -> impl Iterator<Item = Simulated> {
        let judged = places.iter().zip(positions).zip(evaluations);
        judged.map(|((&place, positions), evaluation)| Simulated {
            place,
            cost: evaluation.cost,
            failure: evaluation.failure,
            values: problem.values(positions),
        })
    }
}

/// One iteration of the refinement.
#[derive(Clone, Copy, Debug)]
pub struct RefinementRow {
    /// Counts from 1, over all starts.
    pub iteration: u32,
    /// The cost that the iteration reached.
    pub cost: f64,
}

/// How far the chains of a posterior came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosteriorRow {
    /// How many stretches of the chains have finished.
    pub stretch: u32,
    /// How many generations the chains moved.
    pub generation: u32,
    /// Generations at the most.
    pub generations: u32,
    /// The worst figures of all unknowns, of the second half of the generations; none where an unknown has
    /// not moved.
    pub convergence: Option<Convergence>,
}

/// What a run has done so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Counters {
    /// Candidates judged.
    pub evaluations: u64,
    /// Candidates simulated and not remembered. After an interruption some may be simulated again.
    pub distinct_evaluations: u64,
    /// Simulations that failed, by cause.
    pub failed_evaluations: BTreeMap<SimulationFailure, u64>,
}
