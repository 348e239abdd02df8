//! Candidates that have been simulated before are not simulated again.
//!
//! Evaluations are deterministic, so remembering them changes no result; about half the
//! candidates of a converging search are repeats. The memory is bounded and forgets the oldest.

use super::objective::Evaluation;
use crate::genetic::Chromosome;
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

/// What is remembered takes so much at the most [bytes].
const ROOM: usize = 128 << 20;
/// What an evaluation takes beside its genes and its block errors [bytes]: its places in a table that is
/// half full and in the order, and four allocations with what the allocator adds to each.
const OVERHEAD: usize =
    5 * size_of::<usize>() + size_of::<Chromosome>() + size_of::<Evaluation>() + 4 * 32;

/// Evaluations by chromosome.
#[derive(Debug)]
pub struct EvaluationCache {
    evaluations: HashMap<Arc<Chromosome>, Arc<Evaluation>>,
    order: VecDeque<Arc<Chromosome>>,
    /// The bytes that the cache may take.
    room: usize,
    /// The bytes that the cache takes.
    taken: usize,
}

impl Default for EvaluationCache {
    fn default() -> Self {
        Self::of(ROOM)
    }
}

impl EvaluationCache {
    /// An empty cache that takes so many bytes at the most.
    fn of(room: usize) -> Self {
        Self {
            evaluations: HashMap::new(),
            order: VecDeque::new(),
            room,
            taken: 0,
        }
    }

    /// The evaluation of a candidate that has been simulated before.
    #[must_use]
    pub fn recall(&self, chromosome: &Chromosome) -> Option<Arc<Evaluation>> {
        self.evaluations.get(chromosome).cloned()
    }

    /// Remembers an evaluation.
    pub fn remember(&mut self, chromosome: Chromosome, evaluation: Arc<Evaluation>) {
        let chromosome = Arc::new(chromosome);
        self.taken += size(&chromosome, &evaluation);
        match self.evaluations.insert(chromosome.clone(), evaluation) {
            Some(earlier) => self.taken -= size(&chromosome, &earlier),
            None => self.order.push_back(chromosome),
        }
        while self.taken > self.room {
            let Some(oldest) = self.order.pop_front() else {
                break;
            };
            if let Some(forgotten) = self.evaluations.remove(&oldest) {
                self.taken -= size(&oldest, &forgotten);
            }
        }
    }
}

/// What an evaluation takes [bytes].
fn size(chromosome: &Chromosome, evaluation: &Evaluation) -> usize {
    OVERHEAD + size_of_val(&*chromosome.0) + size_of_val(&*evaluation.block_errors)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluation(cost: f64, blocks: usize) -> Arc<Evaluation> {
        Arc::new(Evaluation {
            cost,
            block_errors: vec![cost; blocks],
            failure: None,
        })
    }

    #[test]
    fn the_latest_are_remembered_and_the_room_is_kept_however_small_each_is() {
        let room = 100_000;
        let mut cache = EvaluationCache::of(room);
        for blocks in [0, 1, 500] {
            for gene in 0..2000 {
                cache.remember(
                    Chromosome(vec![gene, blocks]),
                    evaluation(f64::from(gene), blocks as usize),
                );
                let latest = cache
                    .recall(&Chromosome(vec![gene, blocks]))
                    .expect("the latest");
                assert_eq!(latest.cost, f64::from(gene));
            }
            assert!(cache.recall(&Chromosome(vec![0, blocks])).is_none());
            let count = cache.order.len();
            assert_eq!(count, cache.evaluations.len());
            assert!(
                count > 10 && count * OVERHEAD <= room,
                "{count} of {blocks} blocks"
            );
        }
    }

    #[test]
    fn what_is_remembered_again_counts_once() {
        let mut cache = EvaluationCache::of(10_000);
        cache.remember(Chromosome(vec![1]), evaluation(1.0, 3));
        let once = cache.taken;
        for _ in 0..1000 {
            cache.remember(Chromosome(vec![1]), evaluation(1.0, 3));
        }
        assert_eq!(cache.taken, once);
        assert!(cache.recall(&Chromosome(vec![1])).is_some());
    }
}
