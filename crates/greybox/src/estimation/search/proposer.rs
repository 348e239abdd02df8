//! What tells the search methods apart: how a first generation is drawn, how one is judged beside
//! its costs, and what follows it.
//!
//! A proposer has no state of its own. What it remembers from one generation to the next stands in
//! the search's [`State`](super::State), which a checkpoint saves.

use super::Search;
use crate::credit::Credits;
use crate::estimation::objective::Evaluation;
use crate::estimation::settings::Settings;
use crate::genetic::Chromosome;
use std::fmt;
use std::sync::Arc;

/// A generation with everything that is known of it.
pub(super) struct Judgement<'a> {
    /// The candidates.
    pub population: &'a [Chromosome],
    /// What each of them came to.
    pub evaluations: &'a [Arc<Evaluation>],
    /// The share of the credit that each has, where the method assigns any.
    pub credits: Option<&'a Credits>,
    /// Where least-squares steps from one of them lead, as positions.
    pub climbed: &'a [Vec<f64>],
}

/// A search method.
pub(super) trait Proposer: fmt::Debug + Sync {
    /// Draws the first generation of a search.
    fn begin(&self, search: &mut Search) -> Vec<Chromosome>;

    /// The generation that follows one that was judged.
    fn next(&self, search: &mut Search, judged: &Judgement<'_>) -> Vec<Chromosome>;

    /// Bits of each gene.
    fn bits(&self, settings: &Settings) -> u32 {
        settings.bits_per_parameter
    }

    /// The candidate from which least-squares steps are taken beside the next generation, if any.
    fn climber(&self, _search: &Search) -> Option<Chromosome> {
        None
    }

    /// The credits of a generation, where the method assigns any.
    fn credits(&self, _search: &Search, _evaluations: &[Arc<Evaluation>]) -> Option<Credits> {
        None
    }
}
