//! Whether Markov chains have converged, and how many independent draws their draws are worth.
//!
//! All figures are those of A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Bürkner,
//! "Rank-normalization, folding, and localization: An improved R̂ for assessing convergence of
//! MCMC", *Bayesian Analysis* 16, 2021. Draws are replaced by the normal scores of their ranks, so
//! that the figures hold for distributions without a mean too; each chain is cut into two halves, so
//! that a chain that still moves is told. With m half chains of n draws, W the mean of their
//! variances and B/n the variance of their means, `R̂ = √((n − 1)/n + B/(n·W))`; the larger R̂ of the
//! scores and of the scores of the distances from the median counts. The effective sample size is
//! `m·n/(1 + 2·Σρ_t)`, with the autocorrelations ρ_t summed in pairs for as long as the sum of a pair
//! is positive, and no pair taken larger than the pair before (C. J. Geyer, *Statistical Science* 7,
//! 1992).

use super::statistics::{normal_quantile, quantile};

/// The share of the draws in each of the two tails that an effective sample size is told for.
const TAIL: f64 = 0.05;
/// The fewest draws of a chain that can be judged: two halves of two.
const FEWEST_DRAWS: usize = 4;

/// How well the chains of one number have converged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// R̂, rank-normalised, of split chains: 1 where all chains draw from one distribution.
    pub r_hat: f64,
    /// How many independent draws would say as much about the middle of the distribution.
    pub ess_bulk: f64,
    /// How many independent draws would say as much about the 5 % and 95 % quantiles; the smaller
    /// of the two.
    pub ess_tail: f64,
}

impl Convergence {
    /// Judges chains of equal length. None where a chain has fewer than four draws, draws are not
    /// finite, or all are the same number.
    #[must_use]
    pub fn of(chains: &[Vec<f64>]) -> Option<Convergence> {
        let length = chains.first()?.len();
        let is_usable =
            |chain: &Vec<f64>| chain.len() == length && chain.iter().all(|draw| draw.is_finite());
        if length < FEWEST_DRAWS || !chains.iter().all(is_usable) {
            return None;
        }
        let draws: Vec<f64> = chains.iter().flatten().copied().collect();
        if draws.iter().all(|draw| *draw == draws[0]) {
            return None;
        }
        let split = halves(chains);
        let scores = normal_scores(&split);
        let tail = |share: f64| {
            let end = quantile(&draws, share)?;
            let below = |draw: &f64| f64::from(u8::from(*draw <= end));
            let mut indicators = split.clone();
            indicators
                .iter_mut()
                .flatten()
                .for_each(|draw| *draw = below(draw));
            Some(effective_sample_size(&indicators))
        };
        Some(Convergence {
            r_hat: r_hat(&scores).max(r_hat(&normal_scores(&folded(&split)?))),
            ess_bulk: effective_sample_size(&scores),
            ess_tail: tail(TAIL)?.min(tail(1.0 - TAIL)?),
        })
    }
}

/// Both halves of each chain; of an odd number of draws the one in the middle is left out.
fn halves(chains: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let both = chains.iter().flat_map(|chain| {
        let half = chain.len() / 2;
        [&chain[..half], &chain[chain.len() - half..]]
    });
    both.map(<[f64]>::to_vec).collect()
}

/// The distances of the draws from their median.
fn folded(chains: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let draws: Vec<f64> = chains.iter().flatten().copied().collect();
    let median = quantile(&draws, 0.5)?;
    let mut distances = chains.to_vec();
    distances
        .iter_mut()
        .flatten()
        .for_each(|draw| *draw = (*draw - median).abs());
    Some(distances)
}

/// The normal scores of the ranks of the draws among those of all chains; equal draws share the mean
/// of their ranks (G. Blom, *Statistical Estimates and Transformed Beta-Variables*, 1958).
fn normal_scores(chains: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let length = chains[0].len();
    let draw = |place: usize| chains[place / length][place % length];
    let count = chains.len() * length;
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| draw(*a).total_cmp(&draw(*b)));
    let mut scores = vec![vec![0.0; length]; chains.len()];
    let mut first = 0;
    while first < count {
        let is_equal = |place: &usize| draw(*place) == draw(order[first]);
        let ties = order[first..].iter().take_while(|place| is_equal(place));
        let ties = ties.count();
        let rank = first as f64 + 0.5 * (ties as f64 + 1.0);
        let score = normal_quantile((rank - 0.375) / (count as f64 + 0.25));
        for &place in &order[first..first + ties] {
            scores[place / length][place % length] = score;
        }
        first += ties;
    }
    scores
}

/// The mean and the variance of numbers about it, divided by one less than their count.
struct Moments {
    mean: f64,
    variance: f64,
}

impl Moments {
    fn of(values: &[f64]) -> Moments {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean) * (value - mean));
        Moments {
            mean,
            variance: squares.sum::<f64>() / (count - 1.0),
        }
    }
}

/// The mean of the variances of several chains, and the variance of their means.
struct ChainVariances {
    within: f64,
    between: f64,
}

impl ChainVariances {
    fn of(chains: &[Vec<f64>]) -> ChainVariances {
        let moments: Vec<Moments> = chains.iter().map(|chain| Moments::of(chain)).collect();
        let variances = moments.iter().map(|of_chain| of_chain.variance);
        let means: Vec<f64> = moments.iter().map(|of_chain| of_chain.mean).collect();
        ChainVariances {
            within: variances.sum::<f64>() / moments.len() as f64,
            between: Moments::of(&means).variance,
        }
    }
}

fn r_hat(chains: &[Vec<f64>]) -> f64 {
    let n = chains[0].len() as f64;
    let ChainVariances { within, between } = ChainVariances::of(chains);
    ((n - 1.0) / n + between / within).sqrt()
}

fn effective_sample_size(chains: &[Vec<f64>]) -> f64 {
    let length = chains[0].len();
    let total = (chains.len() * length) as f64;
    let n = length as f64;
    let ChainVariances { within, between } = ChainVariances::of(chains);
    let variance = within * (n - 1.0) / n + between;
    let autocovariance = Autocovariance::of(chains);
    let correlation = |lag: usize| 1.0 - (within - autocovariance.at(lag)) / variance;
    let mut pair = 1.0 + correlation(1);
    let (mut sum, mut rest) = (pair, 0.0);
    let mut lag = 2;
    while lag + 2 < length {
        let even = correlation(lag);
        let next = even + correlation(lag + 1);
        rest = even.max(0.0);
        // The last lags have too few products for a pair.
        if next <= 0.0 || lag + 4 >= length {
            break;
        }
        pair = pair.min(next);
        sum += pair;
        lag += 2;
    }
    let time = (2.0 * sum - 1.0 + rest).max(1.0 / libm::log10(total));
    total / time
}

/// The mean over all chains of the autocovariance.
struct Autocovariance {
    deviations: Vec<Vec<f64>>,
}

impl Autocovariance {
    fn of(chains: &[Vec<f64>]) -> Autocovariance {
        let deviations = chains.iter().map(|chain| {
            let mean = Moments::of(chain).mean;
            chain.iter().map(|draw| draw - mean).collect()
        });
        Autocovariance {
            deviations: deviations.collect(),
        }
    }

    fn at(&self, lag: usize) -> f64 {
        let of_chain = |chain: &Vec<f64>| {
            let pairs = chain.iter().zip(&chain[lag..]);
            let products = pairs.map(|(now, later)| now * later);
            products.sum::<f64>() / chain.len() as f64
        };
        self.deviations.iter().map(of_chain).sum::<f64>() / self.deviations.len() as f64
    }
}

#[cfg(test)]
mod tests;
