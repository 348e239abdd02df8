//! The candidates of a search as they are kept: each that was simulated, once.
//!
//! A search remembers what it has simulated, but not for ever and not over an interruption. What
//! is kept of it is counted here instead: [`Selection`] lets every candidate through once, the one
//! that came first, and no more of them than a limit.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use greybox::estimation::problem::{Problem, Target};
use greybox::estimation::{GenerationRow, Simulated};
pub use greybox::simulation::SimulationFailure;

/// What one of a candidate's values stands for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct CandidateColumn {
    /// The name of the value, as in the history of the search.
    #[schema(example = "mass")]
    pub name: String,
    /// The SI unit of the value.
    #[schema(example = "kg")]
    pub unit: String,
    /// The experiment of an initial state or of a parameter of one experiment, counted from 0;
    /// `null` for a parameter that experiments share.
    pub experiment: Option<usize>,
    /// The model's state of an initial state; `null` for a parameter.
    pub state: Option<String>,
}

/// One candidate that was simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The generation in which it was judged first, from 1.
    pub generation: u32,
    /// The place of the candidate in the population of that generation, from 0.
    pub place: u32,
    /// The cost of the candidate; none where the simulation failed.
    pub cost: Option<f64>,
    /// How the simulation of the candidate failed; none where it did not.
    pub failure: Option<SimulationFailure>,
    /// A value for each column, SI.
    pub values: Vec<f64>,
}

impl CandidateColumn {
    /// A column for each unknown of a problem.
    #[must_use]
    pub fn of(problem: &Problem) -> Vec<Self> {
        let columns = problem.coordinates.iter().map(|coordinate| {
            let is_state = matches!(coordinate.target, Target::InitialState { .. });
            Self {
                name: coordinate.name.clone(),
                unit: coordinate.unit.clone(),
                experiment: coordinate.target.experiment(),
                state: is_state.then(|| coordinate.quantity.clone()),
            }
        });
        columns.collect()
    }
}

impl Candidate {
    /// The candidates that were simulated for a generation.
    #[must_use]
    pub fn of(row: &GenerationRow) -> Vec<Self> {
        let candidate = |simulated: &Simulated| Self {
            generation: row.generation,
            place: u32::try_from(simulated.place).expect("a population is small"),
            cost: Some(simulated.cost).filter(|cost| cost.is_finite()),
            failure: simulated.failure,
            values: simulated.values.clone(),
        };
        row.simulated.iter().map(candidate).collect()
    }

    /// 128 bits that no other candidate has, but for one chance in 10^26 among a million.
    fn fingerprint(&self) -> u128 {
        let half = |salt: u8| {
            let mut hasher = DefaultHasher::new();
            salt.hash(&mut hasher);
            for value in &self.values {
                value.to_bits().hash(&mut hasher);
            }
            u128::from(hasher.finish())
        };
        half(0) << 64 | half(1)
    }
}

/// Candidates as a table in CSV: generation, place, cost (empty where it failed), failure, and the
/// value of each column.
#[must_use]
pub fn csv(columns: &[CandidateColumn], candidates: &[Candidate]) -> String {
    let mut text = String::from("generation,place,cost,failure");
    for column in columns {
        text.push(',');
        text.push_str(&column.name);
    }
    text.push('\n');
    for candidate in candidates {
        let cost = candidate.cost.map(|cost| cost.to_string());
        let failure = candidate.failure.map_or("", SimulationFailure::name);
        let (generation, place) = (candidate.generation, candidate.place);
        let cost = cost.unwrap_or_default();
        text += &format!("{generation},{place},{cost},{failure}");
        for value in &candidate.values {
            text += &format!(",{value}");
        }
        text.push('\n');
    }
    text
}

/// Lets each candidate of a job through once, and no more than a limit.
///
/// Takes about 36 bytes for each that came through.
#[derive(Clone, Debug)]
pub struct Selection {
    seen: HashSet<u128>,
    limit: u64,
    cut_in_generation: Option<u32>,
}

impl Selection {
    /// Lets `limit` candidates through.
    #[must_use]
    pub fn new(limit: u64) -> Self {
        Self {
            seen: HashSet::new(),
            limit,
            cut_in_generation: None,
        }
    }

    /// Goes on after what came through before.
    pub fn recall(&mut self, candidates: &[Candidate], cut_in_generation: Option<u32>) {
        let fingerprints = candidates.iter().map(Candidate::fingerprint);
        self.seen.extend(fingerprints);
        self.cut_in_generation = self.cut_in_generation.or(cut_in_generation);
    }

    /// Returns the candidates that are new, up to the limit.
    pub fn admit(&mut self, mut candidates: Vec<Candidate>) -> Vec<Candidate> {
        candidates.retain(|candidate| self.admits(candidate));
        candidates
    }

    fn admits(&mut self, candidate: &Candidate) -> bool {
        if self.cut_in_generation.is_some() {
            return false;
        }
        let fingerprint = candidate.fingerprint();
        if self.count() < self.limit {
            return self.seen.insert(fingerprint);
        }
        if !self.seen.contains(&fingerprint) {
            self.cut_in_generation = Some(candidate.generation);
        }
        false
    }

    /// How many came through.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.seen.len() as u64
    }

    /// The generation in which the first one was turned away because the limit was reached; from
    /// there on none comes through.
    #[must_use]
    pub fn cut_in_generation(&self) -> Option<u32> {
        self.cut_in_generation
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(generation: u32, value: f64) -> Candidate {
        Candidate {
            generation,
            place: 0,
            cost: Some(1.0),
            failure: None,
            values: vec![value, 2.0],
        }
    }

    fn generations(candidates: &[Candidate]) -> Vec<u32> {
        candidates.iter().map(|one| one.generation).collect()
    }

    #[test]
    fn a_candidate_comes_through_once_also_after_an_interruption() {
        let mut selection = Selection::new(10);
        let first = selection.admit(vec![candidate(1, 0.1), candidate(1, 0.2)]);
        assert_eq!(generations(&first), [1, 1]);
        assert_eq!(selection.admit(vec![candidate(2, 0.2)]), []);
        let mut later = Selection::new(10);
        later.recall(&first, None);
        let next = later.admit(vec![
            candidate(3, 0.1),
            candidate(3, 0.3),
            candidate(4, 0.3),
        ]);
        assert_eq!(next, [candidate(3, 0.3)]);
        assert_eq!((later.count(), later.cut_in_generation()), (3, None));
    }

    #[test]
    fn the_limit_is_said_by_the_first_that_it_turned_away_and_stays() {
        let mut selection = Selection::new(2);
        let both = selection.admit(vec![candidate(1, 0.1), candidate(2, 0.2)]);
        assert_eq!(both.len(), 2);
        assert_eq!(selection.admit(vec![candidate(3, 0.1)]), []);
        assert_eq!(
            selection.cut_in_generation(),
            None,
            "a repeat loses nothing"
        );
        assert_eq!(selection.admit(vec![candidate(4, 0.3)]), []);
        assert_eq!(selection.cut_in_generation(), Some(4));
        let mut larger = Selection::new(100);
        larger.recall(&both, Some(4));
        assert_eq!(
            larger.admit(vec![candidate(9, 0.9)]),
            [],
            "no gap is left behind"
        );
        assert_eq!((larger.count(), larger.cut_in_generation()), (2, Some(4)));
    }

    #[test]
    fn candidates_that_differ_in_one_bit_or_in_order_are_two() {
        let mut selection = Selection::new(10);
        let swapped = Candidate {
            values: vec![2.0, 0.1],
            ..candidate(1, 0.1)
        };
        let next = f64::from_bits(0.1f64.to_bits() + 1);
        let three = vec![candidate(1, 0.1), candidate(1, next), swapped];
        assert_eq!(selection.admit(three).len(), 3);
    }
}
