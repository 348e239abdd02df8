//! Covariance matrix adaptation, to compare the hybrid search with: candidates are drawn from a
//! normal distribution that learns from the better of them where to go, how far, and along which
//! valleys (N. Hansen, "The CMA Evolution Strategy: A Tutorial", 2016, arXiv:1604.00772, the
//! algorithm of its appendix A with the default parameters of its table 1, negative weights
//! included).
//!
//! Where this departs from the tutorial:
//! - the box: the distribution knows no bounds; what falls outside is judged as its mirror image
//!   inside, so that to the distribution a minimum on a bound looks like one within;
//! - a candidate that failed counts as one that was not drawn;
//! - no axis grows longer than the box or shorter than a few steps of the Gray code of 32 bits.

mod rates;
mod strategy;

pub use strategy::Strategy;

use super::proposer::{Judgement, Proposer, ProposerContext};
use crate::estimation::objective::Evaluation;
use crate::estimation::settings::Settings;
use crate::genetic::{Chromosome, Encoding};
use greybox_numerics::rng::{self, Purpose};
use std::sync::Arc;

/// Bits for each parameter: at 16 the steps of a narrow valley would be felt.
const BITS: u32 = 32;

/// Covariance matrix adaptation.
#[derive(Debug)]
pub(super) struct CmaEs;

impl Proposer for CmaEs {
    /// About a mean drawn from the box.
    fn begin(&self, search: &mut ProposerContext<'_>) -> Vec<Chromosome> {
        let mut rng = search.stream(Purpose::Population);
        let mean = (0..search.encoding.genes).map(|_| rng::unit(&mut rng));
        let mut strategy = Strategy::about(mean.collect());
        let drawn = strategy.draw(search.settings.population as usize, &mut rng);
        search.state.strategy = Some(strategy);
        encoded(&drawn, search.encoding)
    }

    fn next(&self, search: &mut ProposerContext<'_>, judged: &Judgement<'_>) -> Vec<Chromosome> {
        let mut rng = search.stream(Purpose::Mutation);
        let strategy = search.state.strategy.as_mut();
        let strategy = strategy.expect("the first generation was drawn from one");
        strategy.learn(&best_first(judged.evaluations));
        let drawn = strategy.draw(judged.evaluations.len(), &mut rng);
        encoded(&drawn, search.encoding)
    }

    fn bits(&self, _settings: &Settings) -> u32 {
        BITS
    }
}

/// The places of the candidates that did not fail, the lowest cost first.
pub(super) fn best_first(evaluations: &[Arc<Evaluation>]) -> Vec<usize> {
    let sound = |place: &usize| evaluations[*place].failure.is_none();
    let mut places: Vec<usize> = (0..evaluations.len()).filter(sound).collect();
    places.sort_by(|&a, &b| evaluations[a].cost.total_cmp(&evaluations[b].cost));
    places
}

fn encoded(candidates: &[Vec<f64>], encoding: Encoding) -> Vec<Chromosome> {
    let strings = candidates
        .iter()
        .map(|positions| encoding.encode(positions));
    strings.collect()
}
