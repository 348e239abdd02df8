//! Draws from the posterior distribution of the unknowns.
//!
//! The density is that of [`log_posterior`]: the likelihood of the free run,
//! or of the innovations where disturbances move the plant, with the priors. 32 chains (`chains`) begin
//! at draws about the estimate and its twins (`minima`) and move until R̂ is below 1.01 and the
//! effective sample sizes of the middle and of the tails are above 400 for every unknown
//! ([`greybox_numerics::convergence`]), or until the generations that were asked for are over. The first half
//! of the generations is taken for the way to the distribution and not counted.
//!
//! A stretch of generations is a refit of the analysis, so that it is saved and resumed as the other
//! refits are. At its end the chains join the archive that later moves are made from.

mod chains;
mod minima;
mod summary;

pub use chains::CHAINS;
pub use summary::{CoordinatePosterior, LARGEST_R_HAT, LEAST_ESS, Posterior, QUANTILES};

use super::refits::{Refit, RefitName, RefitSequence};
use super::residuals::ResidualReport;
use super::simulated_estimate::SimulatedEstimate;
use crate::estimation::log_posterior::{self, LogPosterior, NoiseLevel, OutputNoise};
use crate::estimation::loss::Loss;
use crate::estimation::observer::PosteriorRow;
use chains::{ChainProposer, ChainStates};
use greybox_numerics::rng::{self, Purpose};
use greybox_numerics::statistics;
use minima::Minima;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use summary::WorstConvergence;

/// Generations of a stretch at the least.
const STRETCH: u32 = 10;
/// Stretches at the most: longer chains have longer stretches.
const MOST_STRETCHES: u32 = 1000;
/// After so many stretches it is looked whether the chains have converged.
const LOOK: u32 = 25;
/// No chains end before so many stretches.
const FEWEST_STRETCHES: u32 = 50;
/// Draws of the first archive for each unknown, and at the least.
const ARCHIVE: [usize; 2] = [10, 100];
/// How many refits of a unit a stretch counts for: it simulates several hundred candidates.
const EFFORT: u32 = 16;

/// The chains of a posterior, a stretch at a time.
#[derive(Debug)]
pub(super) struct PosteriorChains {
    estimate: Arc<SimulatedEstimate>,
    noise: Vec<OutputNoise>,
    minima: Minima,
    /// The standard deviation of each position about the first minimum.
    deviations: Vec<f64>,
    seed: u64,
    /// Generations of a stretch.
    stretch: u32,
    /// Stretches at the most.
    stretches: u32,
    /// Draws about the minima, then the chains at the end of each stretch.
    archive: Vec<Vec<f64>>,
    /// How many draws the archive began with.
    n_first: usize,
    states: ChainStates,
    finished: u32,
    has_ended: bool,
    looks: Vec<PosteriorRow>,
}

impl PosteriorChains {
    /// Prepares chains of so many generations at the most. Answers nothing when `stop` was raised.
    pub fn begin(
        estimate: &Arc<SimulatedEstimate>,
        seed: u64,
        generations: u32,
        stop: &AtomicBool,
    ) -> Option<PosteriorChains> {
        let (problem, report) = (&estimate.problem, &estimate.report);
        let noise = noise(estimate);
        let share = LogPosterior::new(problem, &noise).least_independent_share();
        let minima = Minima::of(problem, report, share, stop)?;
        let mut archive = Vec::new();
        let mut deviations = Vec::new();
        if !minima.is_empty() {
            let [for_each, least] = ARCHIVE;
            let rng = &mut rng::stream_of_search(seed, CHAINS as u32, 0, Purpose::Posterior);
            let draws = 0..least.max(for_each * problem.coordinates.len());
            archive.extend(draws.map(|number| minima.draw_within(number, rng)));
            deviations = minima.deviations();
        }
        let stretch = STRETCH.max(generations.div_ceil(MOST_STRETCHES));
        Some(PosteriorChains {
            estimate: Arc::clone(estimate),
            noise,
            has_ended: minima.is_empty(),
            minima,
            deviations,
            seed,
            stretch,
            stretches: generations.div_ceil(stretch),
            n_first: archive.len(),
            archive,
            states: ChainStates::default(),
            finished: 0,
            looks: Vec::new(),
        })
    }

    /// Returns how far the chains came, a row for each look at them.
    pub fn looks(&self) -> &[PosteriorRow] {
        &self.looks
    }

    /// What the draws say; nothing before the chains have ended.
    pub fn posterior(&self) -> Option<Posterior> {
        let generations = self.finished * self.stretch;
        let rows = self.counted();
        self.has_ended.then(|| match rows.is_empty() {
            true => Posterior::default(),
            false => Posterior::of(&self.estimate.problem, generations, rows),
        })
    }

    /// The draws of the second half of the stretches: one of each chain, and then again from the first
    /// chain.
    fn counted(&self) -> &[Vec<f64>] {
        let from = self.finished - self.finished / 2;
        &self.archive[self.n_first + from as usize * CHAINS..]
    }

    /// Where the chains begin: at draws about the minima, or at the minimum itself where such a draw has
    /// no density. No chains where a minimum has none either. Answers nothing when `stop` was raised.
    fn first_states(&self, density: &LogPosterior<'_>, stop: &AtomicBool) -> Option<ChainStates> {
        let minima = (0..CHAINS).map(|chain| self.minima.middle(chain));
        let drawn = self.archive[..CHAINS].iter().cloned();
        let candidates: Vec<Vec<f64>> = drawn.chain(minima).collect();
        let densities = density.evaluate(&candidates, stop)?;
        let chosen = (0..CHAINS).map(|chain| match densities[chain].is_finite() {
            true => chain,
            false => CHAINS + chain,
        });
        let chosen: Vec<usize> = chosen.collect();
        if chosen.iter().any(|place| !densities[*place].is_finite()) {
            return Some(ChainStates::default());
        }
        Some(ChainStates {
            positions: chosen
                .iter()
                .map(|place| candidates[*place].clone())
                .collect(),
            log_densities: chosen.iter().map(|place| densities[*place]).collect(),
        })
    }

    /// Looks whether the chains have converged, where it is time.
    fn look(&mut self) {
        let is_last = self.finished == self.stretches;
        if !is_last && !self.finished.is_multiple_of(LOOK) {
            return;
        }
        let worst = WorstConvergence::of(self.counted());
        self.looks.push(PosteriorRow {
            stretch: self.finished,
            generation: self.finished * self.stretch,
            generations: self.stretches * self.stretch,
            convergence: worst.convergence,
        });
        let has_converged = worst.has_converged && self.finished >= FEWEST_STRETCHES;
        self.has_ended = is_last || has_converged;
    }
}

impl RefitSequence for PosteriorChains {
    fn next(&self) -> Option<RefitName> {
        let stretch = self.finished;
        (!self.has_ended).then_some(RefitName::Posterior { stretch })
    }

    fn effort(&self) -> u32 {
        EFFORT
    }

    fn run(&self, stop: &AtomicBool) -> Option<Refit> {
        let density = LogPosterior::new(&self.estimate.problem, &self.noise);
        let mut states = match self.finished {
            0 => self.first_states(&density, stop)?,
            _ => self.states.clone(),
        };
        let proposer = ChainProposer {
            minima: &self.minima,
            deviations: &self.deviations,
            archive: &self.archive,
            seed: self.seed,
        };
        let first = u64::from(self.finished * self.stretch);
        for generation in 1..=u64::from(self.stretch) {
            states.advance(proposer, first + generation, &density, stop)?;
        }
        Some(Refit {
            positions: states.positions.concat(),
            cost: None,
            log_densities: states.log_densities,
        })
    }

    fn follow(&mut self, refit: &Refit, _stop: &AtomicBool) -> Option<()> {
        let n = self.deviations.len();
        if refit.log_densities.len() != CHAINS || refit.positions.len() != CHAINS * n {
            self.has_ended = true;
            return Some(());
        }
        self.states = ChainStates {
            positions: refit.positions.chunks(n).map(<[f64]>::to_vec).collect(),
            log_densities: refit.log_densities.clone(),
        };
        self.archive.extend(self.states.positions.iter().cloned());
        self.finished += 1;
        self.look();
        Some(())
    }
}

/// How the residuals of each compared output count: a noise that the job does not declare is integrated
/// out.
fn noise(estimate: &SimulatedEstimate) -> Vec<OutputNoise> {
    let problem = &estimate.problem;
    let is_open = |declared: Option<f64>| declared.is_none() && problem.loss == Loss::Squared;
    let pairs = problem.outputs.iter().zip(&estimate.residuals);
    let pairs = pairs.zip(log_posterior::counts(problem));
    let of_output = pairs.map(|((output, report), count)| {
        let has_memory = report.white == Some(false);
        OutputNoise {
            level: match is_open(output.noise_std) {
                true => NoiseLevel::Integrated,
                false => NoiseLevel::Given(level(report, output.noise_std, count)),
            },
            effective_samples: report.effective_samples.filter(|_| has_memory),
        }
    });
    of_output.collect()
}

/// The noise level of an output: the declared one, unless more is left than chance explains, or the
/// residuals contradict it otherwise.
fn level(report: &ResidualReport, declared: Option<f64>, count: f64) -> f64 {
    let is_chance = |square: f64| statistics::is_unit_mean_square(square, count as usize);
    let declared = declared.filter(|_| report.chi_square_per_sample.is_some_and(is_chance));
    declared.unwrap_or(report.noise_std)
}
