//! Whether the lowest minimum that was found is the floor of the cost.
//!
//! A search cannot know it. It can be found again from elsewhere: where the data leave a doubt,
//! another search begins by itself, until two have come to the same cost ([`is_doubtful`]). A
//! minimum that explains no more than a constant is a plateau and never a floor. Minima of equal
//! cost are compared by their parameters: where the linear model at one of them says that the
//! other could not cost the same, they are twins, and the data do not say which of them is true.
//! The twins of models in which two parameters can change their places (absorption and
//! elimination, two time constants in a row) are looked for where they would be ([`exchanged`]).

use super::feasible;
use super::problem::{Experiment, Problem, Target};
use super::refine::{self, Descent, DescentEnd, Linearisation};
use super::settings::Settings;
use greybox_numerics::statistics;
use greybox_simulation::Accuracy;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::AtomicBool;
use utoipa::ToSchema;

/// Two costs are the same where χ² differs by less than the 95 % quantile for one unknown.
const SAME_CHI_SQUARE: f64 = 3.84;
/// What a standard error of one unknown costs.
const LIKELIER_CHI_SQUARE: f64 = 1.0;
/// Costs that differ by less than this share are the same too: they are coarsely simulated.
const SAME_COST: f64 = 1e-3;
/// Minima so many standard errors apart, by the linear model at one of them, are two: within one
/// minimum that distance squared would be the difference of their χ².
const TWIN_DISTANCE: f64 = 5.0;
/// A minimum above this share of what a constant leaves is a plateau.
const PLATEAU_SHARE: f64 = 0.98;
/// Recordings are no more exact than this share of a signal's variance.
const EXACT: f64 = 1e-8;
/// χ²/n up to which the residuals are as small as the declared noise.
const NOISE: f64 = 1.05;
/// Where no noise is declared, the share of a signal's variance that may be left without doubt.
const SMALL_SHARE: f64 = 0.01;
/// Residuals of a record that costs next to nothing to search again.
const FEW: usize = 1000;
/// Residuals of a record in which chi-square hardly tells a wrong minimum from noise, and in which every
/// search may come to the same wrong minimum.
const VERY_FEW: usize = 100;
/// Exchanges that are followed at the most.
const MOST_EXCHANGES: usize = 3;
/// Parameters closer than this, as a share of their range, are not exchanged.
const APART: f64 = 0.02;

/// What a constant for each output of each experiment leaves of the data, as a cost.
#[must_use]
pub fn plateau(problem: &Problem) -> f64 {
    let loss = |residual: f64| problem.loss.bent(residual).powi(2);
    let mut sum = 0.0;
    for experiment in problem.experiments.iter() {
        for (place, (values, output)) in used(experiment).zip(&problem.outputs).enumerate() {
            let present = || {
                let samples = values.iter().copied().enumerate();
                samples.filter(|(_, value)| !value.is_nan())
            };
            let squared = |sample: usize| experiment.weight(place, sample).powi(2);
            let total: f64 = present().map(|(sample, _)| squared(sample)).sum();
            let mean: f64 = present()
                .map(|(sample, value)| squared(sample) * value)
                .sum();
            let mean = mean / total;
            sum += present()
                .map(|(sample, value)| {
                    let weight = experiment.weight(place, sample);
                    loss((value - mean) * weight / output.residual_scale)
                })
                .sum::<f64>();
        }
    }
    sum / problem.n_residuals().max(1) as f64
}

fn used(experiment: &Experiment) -> impl Iterator<Item = &[f64]> {
    let end = experiment.estimation_samples;
    experiment.measured.iter().map(move |values| &values[..end])
}

/// What is known of a problem's cost before anything is simulated.
#[derive(Clone, Copy, Debug)]
pub struct Landmarks {
    /// What a constant leaves of the data, as a cost.
    plateau: f64,
    residuals: usize,
    unknowns: u32,
    declares_noise: bool,
}

impl Landmarks {
    /// Returns the landmarks of a problem.
    #[must_use]
    pub fn of(problem: &Problem) -> Landmarks {
        Landmarks {
            plateau: plateau(problem),
            residuals: problem.n_residuals(),
            unknowns: problem.coordinates.len() as u32,
            declares_noise: problem.declares_noise(),
        }
    }

    /// How many searches there may be, the first included, while the floor is in doubt: of a record with very
    /// few residuals so many times as many further ones as there are unknowns.
    #[must_use]
    pub fn most_searches(&self, settings: &Settings) -> u32 {
        let times = if self.residuals <= VERY_FEW {
            self.unknowns.max(1)
        } else {
            1
        };
        settings.restarts + settings.further_searches.saturating_mul(times)
    }

    /// Whether a constant explains as much as what has this cost.
    #[must_use]
    pub fn is_plateau(&self, cost: f64) -> bool {
        cost > PLATEAU_SHARE * self.plateau
    }

    /// Whether two costs, the lower one first and both coarsely simulated, are the same: as large
    /// as the residuals' noise is by declaration, or else by what is left.
    pub(super) fn is_same(&self, lowest: f64, cost: f64) -> bool {
        self.is_same_fine(lowest, cost) || self.excess(lowest, cost) <= SAME_COST
    }

    /// Whether a minimum is likelier than another, both coarsely simulated: by more than the simulation errs,
    /// and by more than one standard error of one unknown costs in declared noise. Without that, what is left
    /// of two minima may only tell how near each descent came.
    pub(super) fn is_likelier(&self, cost: f64, other: f64) -> bool {
        let excess = self.excess(cost, other);
        let least = match self.declares_noise {
            true => LIKELIER_CHI_SQUARE,
            false => SAME_CHI_SQUARE,
        };
        excess > SAME_COST && excess * self.residuals as f64 > least
    }

    fn excess(&self, lowest: f64, cost: f64) -> f64 {
        let noise = lowest.max(if self.declares_noise { 1.0 } else { EXACT });
        (cost - lowest) / noise
    }

    /// Whether two minima, finely simulated, cost the same, the lower one first.
    pub(super) fn is_same_fine(&self, lowest: f64, cost: f64) -> bool {
        self.excess(lowest, cost) * self.residuals as f64 <= SAME_CHI_SQUARE
    }

    /// Whether what is left is no more than noise.
    fn is_explained(&self, cost: f64) -> bool {
        if self.declares_noise {
            cost < NOISE || statistics::is_unit_mean_square(cost, self.residuals)
        } else {
            cost < SMALL_SHARE
        }
    }
}

/// How often the lowest cost was found. The starts that look for a twin do not count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FloorReport {
    /// Starts of the refinement that came to a cost.
    pub starts: u64,
    /// Starts of the refinement that came to the lowest cost.
    pub starts_at_floor: u64,
    /// Searches whose starts came to the lowest cost.
    pub searches_at_floor: u64,
    /// Whether a constant explains the data as well.
    pub plateau: bool,
    /// Minima of other parameters that cost as little: each unknown with its value, SI.
    pub twins: Vec<BTreeMap<String, f64>>,
}

impl FloorReport {
    /// Counts descents; descents that follow an exchange are not independent and do not count.
    /// Nothing where no descent came to a cost. Twins are not looked for here.
    #[must_use]
    pub fn of(landmarks: &Landmarks, descents: &[Descent]) -> Option<FloorReport> {
        let lowest = lowest(descents)?;
        let counts = descents.iter().filter(|descent| descent.search.is_some());
        let costs = counts.filter_map(|descent| Some((cost(descent)?, descent.search)));
        let costs: Vec<(f64, Option<u32>)> = costs.collect();
        let at_floor = costs
            .iter()
            .filter(|(cost, _)| landmarks.is_same(lowest, *cost));
        let searches: BTreeSet<Option<u32>> = at_floor.clone().map(|(_, search)| *search).collect();
        Some(FloorReport {
            starts: costs.len() as u64,
            starts_at_floor: at_floor.count() as u64,
            searches_at_floor: searches.len() as u64,
            plateau: landmarks.is_plateau(lowest),
            twins: Vec::new(),
        })
    }
}

/// Whether the lowest minimum of descents that have ended may not be the floor, so that another
/// search is worth while.
#[must_use]
pub fn is_doubtful(landmarks: &Landmarks, descents: &[Descent]) -> bool {
    let (Some(lowest), Some(floor)) = (lowest(descents), FloorReport::of(landmarks, descents))
    else {
        return true;
    };
    let found_once = floor.starts_at_floor <= 1 && floor.starts > 1;
    let is_explained = landmarks.is_explained(lowest);
    match landmarks.declares_noise {
        // What few residuals leave says little, and costs little to find again.
        true if is_explained => {
            let n = landmarks.residuals;
            let is_unsure =
                (found_once && n <= FEW) || (floor.searches_at_floor < 2 && n <= VERY_FEW);
            floor.starts_at_floor == 0 || is_unsure
        }
        _ => {
            // With few residuals and unknown noise a wrong minimum is as likely to be found twice.
            let enough = if landmarks.residuals <= VERY_FEW {
                3
            } else {
                2
            };
            // Declared noise says of very few residuals that a minimum is wrong, however often it is found.
            let is_wrong = landmarks.declares_noise && landmarks.residuals <= VERY_FEW;
            let is_unsure = floor.searches_at_floor < enough && (found_once || !is_explained);
            floor.plateau || is_wrong || is_unsure
        }
    }
}

/// Whether the lowest minimum leaves more than noise.
#[must_use]
pub fn is_poor(landmarks: &Landmarks, descents: &[Descent]) -> bool {
    lowest(descents).is_none_or(|lowest| !landmarks.is_explained(lowest))
}

fn cost(descent: &Descent) -> Option<f64> {
    descent.coarse_cost.or(descent.cost)
}

fn lowest(descents: &[Descent]) -> Option<f64> {
    let costs = descents.iter().filter_map(cost);
    costs.min_by(f64::total_cmp)
}

/// Two parameters with each other's values.
#[derive(Clone, Debug)]
pub struct Exchange {
    /// The places of the two.
    pair: [usize; 2],
    /// The candidate.
    pub positions: Vec<f64>,
}

/// The exchanges of two parameters of one unit that the search ranges and the constraints allow.
#[must_use]
pub fn exchanged(problem: &Problem, positions: &[f64]) -> Vec<Exchange> {
    let coordinates = &problem.coordinates;
    let is_shared = |index: usize| matches!(coordinates[index].target, Target::Parameter(_));
    let moved = |from: usize, to: usize| {
        let value = coordinates[from].value(positions[from]);
        let (lower, upper) = (coordinates[to].lower, coordinates[to].upper);
        let position = coordinates[to].scale.position(value, lower, upper);
        let is_another = (position - positions[to]).abs() > APART;
        ((lower..=upper).contains(&value) && is_another).then_some(position)
    };
    let mut exchanges = Vec::new();
    for a in 0..positions.len() {
        for b in a + 1..positions.len() {
            let alike = coordinates[a].unit == coordinates[b].unit;
            let both = moved(a, b).zip(moved(b, a));
            if let Some((at_b, at_a)) = both.filter(|_| alike && is_shared(a) && is_shared(b)) {
                let mut candidate = positions.to_vec();
                (candidate[a], candidate[b]) = (at_a, at_b);
                exchanges.push(Exchange {
                    pair: [a, b],
                    positions: candidate,
                });
            }
        }
    }
    exchanges.retain(|exchange| feasible::holds(problem, &exchange.positions));
    exchanges
}

/// The exchanges that are worth following: of those with a cost the lowest.
#[must_use]
pub fn promising(exchanges: Vec<Exchange>, costs: &[f64]) -> Vec<Exchange> {
    let mut order: Vec<(f64, Exchange)> = costs
        .iter()
        .copied()
        .zip(exchanges)
        .filter(|(cost, _)| cost.is_finite())
        .collect();
    order.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let best = order.into_iter().take(MOST_EXCHANGES);
    best.map(|(_, exchange)| exchange).collect()
}

impl Exchange {
    /// Where to descend from: the other unknowns make the best of the exchange first, else the
    /// two would go back to where they were. Nothing when `stop` was raised.
    #[must_use]
    pub fn adapted(self, problem: &Problem, stop: &AtomicBool) -> Option<Vec<f64>> {
        let mut rest = problem.clone();
        for index in self.pair {
            let coordinate = &problem.coordinates[index];
            if let Target::Parameter(place) = coordinate.target {
                rest.parameters[place] = coordinate.value(self.positions[index]);
            }
        }
        let others: Vec<usize> = (0..self.positions.len())
            .filter(|index| !self.pair.contains(index))
            .collect();
        if others.is_empty() {
            return Some(self.positions);
        }
        let coordinates = others
            .iter()
            .map(|&index| problem.coordinates[index].clone());
        rest.coordinates = coordinates.collect();
        let start = others.iter().map(|&index| self.positions[index]).collect();
        let descent = refine::descend(&rest, start, Accuracy::Screening, stop)?;
        let mut adapted = self.positions;
        for (&index, position) in others.iter().zip(&descent.positions) {
            adapted[index] = *position;
        }
        Some(adapted)
    }
}

/// Descents of the same cost as the best one; it alone where nothing is left to compare.
#[must_use]
pub fn rivals<'a>(
    landmarks: &Landmarks,
    best: &Descent,
    descents: &'a [Descent],
) -> Vec<&'a Descent> {
    let Some(lowest) = cost(best) else {
        return Vec::new();
    };
    let rivals = descents.iter().filter(|descent| {
        let as_good = cost(descent).is_some_and(|cost| landmarks.is_same(lowest, cost));
        let ended = matches!(
            descent.end,
            Some(DescentEnd::Converged | DescentEnd::IterationLimit)
        );
        as_good && ended && differs(&descent.positions, &best.positions)
    });
    rivals.collect()
}

fn differs(first: &[f64], second: &[f64]) -> bool {
    first.iter().zip(second).any(|(a, b)| (a - b).abs() > APART)
}

/// The positions of those among the rivals that are another minimum than the best, each once.
#[must_use]
pub fn twins<'a>(
    best: &[f64],
    here: &Linearisation,
    rivals: impl Iterator<Item = &'a [f64]>,
) -> Vec<Vec<f64>> {
    let is_apart = |from: &[f64], to: &[f64]| here.distance(from, to) > TWIN_DISTANCE;
    let mut twins: Vec<Vec<f64>> = Vec::new();
    for rival in rivals {
        let minima = twins.iter().map(Vec::as_slice).chain([best]);
        if minima.into_iter().all(|minimum| is_apart(rival, minimum)) {
            twins.push(rival.to_vec());
        }
    }
    twins
}

#[cfg(test)]
mod tests;
