//! Chains that move by differences of an archive of earlier draws: DE-MC(zs) of C. J. F. ter Braak,
//! J. A. Vrugt, "Differential Evolution Markov Chain with snooker updater and fewer chains",
//! *Statistics and Computing* 18, 2008.
//!
//! A chain moves along the difference of two draws of the archive, by `2.38/√(2d)` of it, which suits a
//! normal distribution of d numbers, in every tenth generation by all of it, so that it can reach
//! another mode; in one of ten moves along the line through a third draw (the snooker), by the
//! difference of the projections of two; and in one of ten moves to a draw about a minimum of the cost
//! ([`Minima`]), whatever its place. Random numbers come from a stream for each generation and chain.

use super::minima::Minima;
use crate::estimation::log_posterior::LogPosterior;
use greybox_numerics::rng::{self, Purpose, Rng};
use std::sync::atomic::AtomicBool;

/// Chains side by side.
pub const CHAINS: usize = 32;

/// The share of moves that are draws about a minimum.
const INDEPENDENT_SHARE: f64 = 0.1;
/// The share of moves along the line through a draw.
const SNOOKER_SHARE: f64 = 0.1;
/// In each generation whose number this divides chains move by whole differences.
const WHOLE_STEPS: u64 = 10;
/// What a chain moves by beside the difference, as a share of the standard deviations about the
/// minimum, so that every place can be reached.
const JITTER: f64 = 1e-3;
/// The range of the share of a difference that the snooker moves by.
const SNOOKER_STEPS: [f64; 2] = [1.2, 2.2];

/// Where all chains are.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ChainStates {
    /// The positions of each chain.
    pub positions: Vec<Vec<f64>>,
    /// The logarithm of the density of each chain.
    pub log_densities: Vec<f64>,
}

/// What proposals are made from.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainProposer<'a> {
    pub minima: &'a Minima,
    /// The standard deviation of each position about the first minimum.
    pub deviations: &'a [f64],
    /// Earlier draws, at least three.
    pub archive: &'a [Vec<f64>],
    /// Where random numbers come from.
    pub seed: u64,
}

/// Where a chain may move.
struct ProposedMove {
    positions: Vec<f64>,
    /// The logarithm of how much likelier the way back is proposed than the way there.
    log_way_back: f64,
}

/// A move and what decides whether the chain makes it.
struct ChainProposal {
    to: ProposedMove,
    /// The logarithm of a uniform random number, which the gain has to exceed.
    log_threshold: f64,
}

impl ChainStates {
    /// Moves every chain once, in the generation of this number. Answers nothing, with nothing changed, when `stop` was raised.
    pub fn advance(
        &mut self,
        proposer: ChainProposer<'_>,
        generation: u64,
        density: &LogPosterior<'_>,
        stop: &AtomicBool,
    ) -> Option<()> {
        let chains = self.positions.iter().enumerate();
        let proposals = chains.map(|(chain, at)| proposer.propose(generation, chain, at));
        let proposals: Vec<ChainProposal> = proposals.collect();
        let candidates: Vec<Vec<f64>> = proposals
            .iter()
            .map(|proposal| proposal.to.positions.clone())
            .collect();
        let densities = density.evaluate(&candidates, stop)?;
        for (chain, (proposal, density)) in proposals.into_iter().zip(densities).enumerate() {
            let gain = density - self.log_densities[chain] + proposal.to.log_way_back;
            if proposal.log_threshold < gain {
                self.positions[chain] = proposal.to.positions;
                self.log_densities[chain] = density;
            }
        }
        Some(())
    }
}

impl ChainProposer<'_> {
    fn propose(&self, generation: u64, chain: usize, at: &[f64]) -> ChainProposal {
        let rng =
            &mut rng::stream_of_search(self.seed, chain as u32, generation, Purpose::Posterior);
        let kind = rng::unit(rng);
        let to = if kind < INDEPENDENT_SHARE {
            self.about_a_minimum(at, rng)
        } else if kind < INDEPENDENT_SHARE + SNOOKER_SHARE {
            self.along_a_line(at, rng)
        } else {
            let whole = generation.is_multiple_of(WHOLE_STEPS);
            self.by_a_difference(at, whole, rng)
        };
        ChainProposal {
            to,
            log_threshold: libm::log(rng::unit(rng)),
        }
    }

    fn about_a_minimum(&self, at: &[f64], rng: &mut impl Rng) -> ProposedMove {
        let drawn = self.minima.draw(rng);
        ProposedMove {
            log_way_back: self.minima.log_density(at) - self.minima.log_density(&drawn),
            positions: drawn,
        }
    }

    fn by_a_difference(&self, at: &[f64], whole: bool, rng: &mut impl Rng) -> ProposedMove {
        let share = match whole {
            true => 1.0,
            false => 2.38 / (2.0 * at.len() as f64).sqrt(),
        };
        let [first, second] = self.different(rng);
        let mut moved = at.to_vec();
        for (place, position) in moved.iter_mut().enumerate() {
            let jitter = JITTER * self.deviations[place] * rng::normal(rng);
            *position += share * (first[place] - second[place]) + jitter;
        }
        ProposedMove {
            positions: moved,
            log_way_back: 0.0,
        }
    }

    /// Moves along the line through a draw of the archive. Positions are measured in the standard
    /// deviations about the minimum.
    fn along_a_line(&self, at: &[f64], rng: &mut impl Rng) -> ProposedMove {
        let [through, first, second] = self.different(rng);
        let [least, most] = SNOOKER_STEPS;
        let share = least + (most - least) * rng::unit(rng);
        let line: Vec<f64> = at.iter().zip(through).map(|(x, z)| x - z).collect();
        let (mut difference, mut length) = (0.0, 0.0);
        for (place, part) in line.iter().enumerate() {
            let weight = part / self.deviations[place].powi(2);
            difference += weight * (first[place] - second[place]);
            length += weight * part;
        }
        let step = share * difference / length;
        if !step.is_finite() {
            // The chain stands at the draw itself: there is no line.
            return ProposedMove {
                positions: at.to_vec(),
                log_way_back: f64::NEG_INFINITY,
            };
        }
        let moved = at.iter().zip(&line).map(|(x, part)| x + step * part);
        ProposedMove {
            positions: moved.collect(),
            log_way_back: (at.len() as f64 - 1.0) * libm::log((1.0 + step).abs()),
        }
    }

    /// Picks N draws of the archive, each of them once.
    fn different<const N: usize>(&self, rng: &mut impl Rng) -> [&[f64]; N] {
        let mut places = [0; N];
        for place in 0..N {
            let mut chosen = rng::below(rng, self.archive.len());
            while places[..place].contains(&chosen) {
                chosen = rng::below(rng, self.archive.len());
            }
            places[place] = chosen;
        }
        places.map(|place| &self.archive[place][..])
    }
}
