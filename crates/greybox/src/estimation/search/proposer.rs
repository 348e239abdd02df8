//! What tells the search methods apart: how a first generation is drawn, how one is judged beside
//! its costs, and what follows it.
//!
//! A proposer has no state of its own. What it remembers from one generation to the next stands in
//! the search's [`State`], which a checkpoint saves.

use super::state::State;
use crate::credit::Credits;
use crate::estimation::objective::{Evaluation, Objective};
use crate::estimation::settings::Settings;
use crate::genetic::{Chromosome, Encoding};
use greybox_numerics::rng::{self, Purpose, stream_of_search};
use std::fmt;
use std::sync::Arc;

/// What a proposer sees of a search.
pub(super) struct ProposerContext<'a> {
    /// The settings of the method.
    pub settings: &'a Settings,
    /// How candidates are written as strings.
    pub encoding: Encoding,
    /// What candidates are judged by.
    pub objective: &'a Objective,
    /// The seed of the run's random numbers.
    pub seed: u64,
    /// Which of the run's searches it is, from 0.
    pub number: u32,
    /// What the search remembers from one generation to the next.
    pub state: &'a mut State,
}

impl ProposerContext<'_> {
    /// The random numbers of this generation for a purpose.
    pub fn stream(&self, purpose: Purpose) -> impl rng::Rng + use<> {
        let generation = u64::from(self.state.generation);
        stream_of_search(self.seed, self.number, generation, purpose)
    }
}

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
    fn begin(&self, search: &mut ProposerContext<'_>) -> Vec<Chromosome>;

    /// The generation that follows one that was judged.
    fn next(&self, search: &mut ProposerContext<'_>, judged: &Judgement<'_>) -> Vec<Chromosome>;

    /// Bits of each gene.
    fn bits(&self, settings: &Settings) -> u32 {
        settings.bits_per_parameter
    }

    /// The candidate from which least-squares steps are taken beside the next generation, if any.
    fn climber(&self, _search: &ProposerContext<'_>) -> Option<Chromosome> {
        None
    }

    /// The credits of a generation, where the method assigns any.
    fn credits(
        &self,
        _search: &ProposerContext<'_>,
        _evaluations: &[Arc<Evaluation>],
    ) -> Option<Credits> {
        None
    }
}
