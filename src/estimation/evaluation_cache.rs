//! Candidates that have been simulated before are not simulated again.
//!
//! Evaluations are deterministic, so remembering them changes no result; about half the
//! candidates of a converging search are repeats. The memory is bounded and forgets the oldest.

use super::objective::Evaluation;
use crate::genetic::Chromosome;
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

/// Block errors that are remembered at the most (8 bytes each).
const LARGEST_NUMBER_COUNT: usize = 16_000_000;

/// Evaluations by chromosome.
#[derive(Debug, Default)]
pub struct EvaluationCache {
    known: HashMap<Chromosome, Arc<Evaluation>>,
    order: VecDeque<Chromosome>,
    numbers: usize,
}

impl EvaluationCache {
    /// The evaluation of a candidate that has been simulated before.
    #[must_use]
    pub fn recall(&self, chromosome: &Chromosome) -> Option<Arc<Evaluation>> {
        self.known.get(chromosome).cloned()
    }

    /// Remembers an evaluation.
    pub fn remember(&mut self, chromosome: Chromosome, evaluation: Arc<Evaluation>) {
        self.numbers += evaluation.block_errors.len();
        if self.known.insert(chromosome.clone(), evaluation).is_none() {
            self.order.push_back(chromosome);
        }
        while self.numbers > LARGEST_NUMBER_COUNT {
            let Some(oldest) = self.order.pop_front() else {
                break;
            };
            if let Some(forgotten) = self.known.remove(&oldest) {
                self.numbers -= forgotten.block_errors.len();
            }
        }
    }
}
