//! An estimate that was simulated and linearised: what follows from its derivatives, which refits
//! improve on that, and the analysis when these have finished.

use super::bootstrap::{self, DrawnFit, Resampling};
use super::budget::{Around, Budget, Extended};
use super::constrained::Constrained;
use super::covariance::{self, Covariance, Linear, NoiseLevels};
use super::drawn_assumptions::DrawnAssumptions;
use super::drift::{self, Drift};
use super::fit;
use super::fit::Criteria;
use super::identifiability::{self, FlatDirection};
use super::monte_carlo;
use super::posterior::{Posterior, PosteriorChains};
use super::probes;
use super::profile::{self, Ends, Walk};
use super::refits::RefitSequence;
use super::residuals;
use super::simulated_estimate::SimulatedEstimate;
use super::verdict::Judgement;
use super::weighing::Seen;
use super::windows::{self, WindowAgreement};
use super::{Analysis, CoordinateUncertainty, Intervals, Request, analysis};
use crate::estimation::loss::Loss;
use crate::estimation::observer::PosteriorRow;
use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use crate::estimation::sensitivity::SensitivityError;
use crate::estimation::trajectory;
use greybox_simulation::Accuracy;
use greybox_simulation::single::Outputs;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// An estimate that is looked at as far as goes without refits.
#[derive(Debug)]
pub(super) struct LinearisedEstimate {
    estimate: Arc<SimulatedEstimate>,
    /// What follows from the derivatives at the estimate.
    first_order: Result<Box<FirstOrder>, NoDerivatives>,
}

/// Why there are no derivatives at an estimate.
#[derive(Debug)]
enum NoDerivatives {
    /// The estimate cannot be simulated.
    NotSimulated,
    /// Something near the estimate cannot be simulated.
    Failed(SensitivityError),
}

/// What follows from the derivatives at an estimate, and the refits that improve on it.
#[derive(Debug)]
pub(super) struct FirstOrder {
    linear: Linear,
    budget: Budget,
    drifts: Vec<Drift>,
    windows: Option<WindowAgreement>,
    flat: Vec<FlatDirection>,
    intervals: IntervalRefits,
    /// The refits of a Monte Carlo analysis, where one was asked for.
    monte_carlo: Vec<DrawnFit>,
}

/// The derivatives at an estimate.
#[derive(Clone, Copy)]
struct Linearised<'a> {
    /// The unknowns and all that is assumed.
    extended: &'a Extended,
    /// The simulations beside the estimate.
    around: &'a Around<'a>,
    /// The problem with the tolerances that nobody declared.
    probed: &'a Problem,
}

/// The refits from which intervals are made.
#[derive(Debug)]
enum IntervalRefits {
    /// The curvature needs none.
    Fisher,
    Profile(Vec<Walk>),
    Bootstrap(Vec<DrawnFit>),
    Posterior(Box<PosteriorChains>),
}

/// The intervals of all coordinates, made in one way.
struct IntervalEnds {
    method: &'static str,
    ends: Vec<Ends>,
}

impl LinearisedEstimate {
    /// Simulates and linearises an estimate. Answers nothing when `stop` was raised.
    pub fn of(
        problem: &Problem,
        report: &Report,
        request: &Request,
        stop: &AtomicBool,
    ) -> Option<LinearisedEstimate> {
        let positions = &report.positions;
        let probed = match request.thorough {
            true => probes::probed(problem, positions, stop)?,
            false => problem.clone(),
        };
        let extended = Extended::new(&probed, positions, request.thorough);
        let (trajectories, around) = rayon::join(
            || trajectory::simulate(problem, positions, stop),
            || extended.around(Accuracy::Full, stop),
        );
        let (trajectories, around) = (trajectories?, around?);
        let estimate = |trajectories: Vec<Outputs>, residuals| {
            Arc::new(SimulatedEstimate {
                problem: problem.clone(),
                report: report.clone(),
                trajectories,
                residuals,
            })
        };
        let Ok(trajectories) = trajectories else {
            return Some(LinearisedEstimate {
                estimate: estimate(Vec::new(), Vec::new()),
                first_order: Err(NoDerivatives::NotSimulated),
            });
        };
        let residuals = residuals::report(problem, &trajectories);
        let estimate = estimate(trajectories, residuals);
        let linearised = Linearised {
            extended: &extended,
            around: &around,
            probed: &probed,
        };
        let first_order = match FirstOrder::of(&estimate, linearised, request, stop) {
            Ok(first_order) => Ok(Box::new(first_order)),
            Err(SensitivityError::Interrupted) => return None,
            Err(failure) => Err(NoDerivatives::Failed(failure)),
        };
        Some(LinearisedEstimate {
            estimate,
            first_order,
        })
    }

    /// The refits that are asked for.
    pub fn sequences(&mut self) -> Vec<&mut dyn RefitSequence> {
        match &mut self.first_order {
            Ok(first_order) => first_order.sequences(),
            Err(_) => Vec::new(),
        }
    }

    /// Returns how far the chains of a posterior came, a row for each look at them; empty where none was asked for.
    pub fn posterior_looks(&self) -> &[PosteriorRow] {
        match &self.first_order {
            Ok(first_order) => match &first_order.intervals {
                IntervalRefits::Posterior(chains) => chains.looks(),
                _ => &[],
            },
            Err(_) => &[],
        }
    }

    /// The estimate.
    pub fn estimate(&self) -> &SimulatedEstimate {
        &self.estimate
    }

    /// What is said of the estimate; nothing before all refits have finished.
    pub fn analysis(&self) -> Option<Analysis> {
        let SimulatedEstimate {
            problem, report, ..
        } = &*self.estimate;
        let mut analysis = self.unjudged()?;
        if !matches!(self.first_order, Err(NoDerivatives::NotSimulated)) {
            analysis.judge(super::rules::judge(problem, report, &analysis));
        }
        Some(analysis)
    }

    /// The analysis of the estimate, before the rules of the verdict speak.
    pub fn unjudged(&self) -> Option<Analysis> {
        let SimulatedEstimate {
            problem,
            report,
            trajectories,
            residuals,
        } = &*self.estimate;
        let analysis = match &self.first_order {
            Ok(first_order) => first_order.analysis(&self.estimate)?,
            Err(NoDerivatives::NotSimulated) => {
                return Some(analysis::without_simulation(problem, report));
            }
            Err(NoDerivatives::Failed(failure)) => {
                analysis::undetermined(problem, report, failure.to_string())
            }
        };
        let estimation_fit = fit::of(problem, trajectories, fit::Part::Estimation);
        let validation_fit = fit::of(problem, trajectories, fit::Part::Validation);
        // Criteria compare likelihoods of normal noise.
        let criteria = match problem.loss {
            Loss::Squared => fit::criteria(&estimation_fit, problem.coordinates.len()),
            Loss::Huber(_) => Criteria::missing(),
        };
        Some(Analysis {
            estimation_fit,
            validation_fit,
            residuals: residuals.clone(),
            criteria,
            ..analysis
        })
    }
}

impl IntervalRefits {
    /// The refits that a request asks for.
    fn of(
        estimate: &Arc<SimulatedEstimate>,
        linear: &Linear,
        request: &Request,
        stop: &AtomicBool,
    ) -> Result<IntervalRefits, SensitivityError> {
        let settings = &request.settings;
        Ok(match settings.intervals {
            Intervals::Fisher => IntervalRefits::Fisher,
            Intervals::Profile => IntervalRefits::Profile(profile::walks(estimate, linear, stop)?),
            Intervals::Bootstrap => {
                let resampling = resampling(estimate, request, None);
                IntervalRefits::Bootstrap(resampling.fits(settings.bootstrap_samples))
            }
            Intervals::Posterior => {
                let generations = settings.posterior_generations;
                let chains = PosteriorChains::begin(estimate, request.seed, generations, stop);
                let chains = chains.ok_or(SensitivityError::Interrupted)?;
                IntervalRefits::Posterior(Box::new(chains))
            }
        })
    }
}

/// Fits to data that are drawn anew, with `assumptions` drawn too where there are any.
fn resampling(
    estimate: &Arc<SimulatedEstimate>,
    request: &Request,
    assumptions: Option<DrawnAssumptions>,
) -> Resampling {
    Resampling {
        estimate: Arc::clone(estimate),
        seed: request.seed,
        assumptions,
    }
}

impl FirstOrder {
    fn of(
        estimate: &Arc<SimulatedEstimate>,
        linearised: Linearised<'_>,
        request: &Request,
        stop: &AtomicBool,
    ) -> Result<FirstOrder, SensitivityError> {
        let Linearised {
            extended,
            around,
            probed,
        } = linearised;
        let SimulatedEstimate {
            problem,
            report,
            trajectories,
            residuals,
        } = &**estimate;
        let mut linear = covariance::linearise(problem, &around.neighbourhood, residuals)
            .map_err(SensitivityError::Failed)?;
        let seen = Seen {
            trajectories,
            residuals,
            linear: &linear,
        };
        let moved = report.moved_from_declared();
        let budget = Budget::of(extended, around, seen, moved).map_err(SensitivityError::Failed)?;
        let drifts = drift::of(problem, &around.neighbourhood, seen);
        let drifts = drifts.map_err(SensitivityError::Failed)?;
        // Innovations alone are as independent as the comparison of windows takes them for.
        let windows = match problem.innovations {
            Some(_) => windows::of(problem, &around.neighbourhood),
            None => Ok(None),
        };
        let windows = windows.map_err(SensitivityError::Failed)?;
        if let Some(by_assumptions) = &budget.noise_by_assumptions {
            linear.widen(by_assumptions);
        }
        let (positions, weights) = (
            &report.positions,
            NoiseLevels::of(problem, residuals).weights(),
        );
        let flat = identifiability::flat_at(problem, positions, &linear.factor, &weights, stop)?;
        let intervals = IntervalRefits::of(estimate, &linear, request, stop)?;
        let monte_carlo = match request.settings.monte_carlo_samples {
            0 => Vec::new(),
            samples => {
                let estimate = Arc::new(SimulatedEstimate {
                    problem: probed.clone(),
                    ..SimulatedEstimate::clone(estimate)
                });
                let assumptions = DrawnAssumptions::of(&estimate, &budget, stop);
                let assumptions = assumptions.ok_or(SensitivityError::Interrupted)?;
                resampling(&estimate, request, Some(assumptions)).fits(samples)
            }
        };
        Ok(FirstOrder {
            linear,
            budget,
            drifts,
            windows,
            flat,
            intervals,
            monte_carlo,
        })
    }

    fn sequences(&mut self) -> Vec<&mut dyn RefitSequence> {
        let mut sequences: Vec<&mut dyn RefitSequence> = Vec::new();
        let drawn = match &mut self.intervals {
            IntervalRefits::Fisher => &mut [][..],
            IntervalRefits::Profile(walks) => {
                sequences.extend(walks.iter_mut().map(|walk| walk as &mut dyn RefitSequence));
                &mut []
            }
            IntervalRefits::Bootstrap(drawn) => &mut drawn[..],
            IntervalRefits::Posterior(chains) => {
                sequences.push(&mut **chains);
                &mut []
            }
        };
        let drawn = drawn.iter_mut().chain(&mut self.monte_carlo);
        sequences.extend(drawn.map(|fit| fit as &mut dyn RefitSequence));
        sequences
    }

    /// Whether all refits have finished.
    fn has_ended(&self) -> bool {
        let intervals = match &self.intervals {
            IntervalRefits::Fisher => true,
            IntervalRefits::Profile(walks) => walks.iter().all(|walk| walk.next().is_none()),
            IntervalRefits::Bootstrap(drawn) => drawn.iter().all(|fit| fit.next().is_none()),
            IntervalRefits::Posterior(chains) => chains.next().is_none(),
        };
        intervals && self.monte_carlo.iter().all(|fit| fit.next().is_none())
    }

    /// What is said of the estimate beside what the simulation alone tells; nothing before all
    /// refits have finished.
    fn analysis(&self, estimate: &SimulatedEstimate) -> Option<Analysis> {
        if !self.has_ended() {
            return None;
        }
        let SimulatedEstimate {
            problem, report, ..
        } = estimate;
        let linear = &self.linear;
        let mut coordinates = analysis::coordinates(problem, report, Some(linear));
        let posterior = match &self.intervals {
            IntervalRefits::Posterior(chains) => Some(Box::new(chains.posterior()?)),
            _ => None,
        };
        self.improve_intervals(&mut coordinates, estimate, posterior.as_deref());
        let deviations: Vec<Option<f64>> = (0..report.positions.len())
            .map(|index| linear.deviation(index))
            .collect();
        for (index, described) in coordinates.iter_mut().enumerate() {
            let total = self.budget.totals[index].zip(deviations[index]);
            described.widen(&problem.coordinates[index], report.positions[index], total);
        }
        let constrained = Constrained::of(linear);
        if let Some(constrained) = &constrained {
            let totals = self.budget.totals.iter().zip(&deviations);
            let factors: Option<Vec<f64>> = totals
                .map(|(total, noise)| Some((*total)? / (*noise)?))
                .collect();
            let ends = factors.and_then(|factors| constrained.ends(&report.positions, &factors));
            for (index, ends) in ends.into_iter().flatten().enumerate() {
                let coordinate = &problem.coordinates[index];
                let value = |end: Option<f64>| analysis::value_near(coordinate, end?);
                coordinates[index].total_interval = Some((value(ends.0), value(ends.1)));
            }
        }
        if !self.monte_carlo.is_empty() {
            let drawn = monte_carlo::of_coordinates(estimate, &self.monte_carlo);
            for (described, drawn) in coordinates.iter_mut().zip(drawn.into_iter().flatten()) {
                described.monte_carlo = Some(drawn);
            }
        }
        let unfixed = || "the data do not fix all of the unknowns".to_owned();
        Some(Analysis {
            coordinates,
            correlation: linear.covariance.as_ref().map(Covariance::correlation),
            condition: Some(linear.condition),
            flat: self.flat.clone(),
            missing: linear.covariance.is_none().then(unfixed),
            estimation_fit: Vec::new(),
            validation_fit: Vec::new(),
            residuals: Vec::new(),
            criteria: Criteria::missing(),
            deviations,
            budget: self.budget.clone(),
            drifts: self.drifts.clone(),
            windows: self.windows.clone(),
            bindings: constrained.map_or_else(Vec::new, |constrained| constrained.bindings()),
            noise: None,
            posterior,
            judgement: Judgement::default(),
        })
    }

    /// Puts the intervals that were asked for in the place of those from the curvature.
    fn improve_intervals(
        &self,
        coordinates: &mut [CoordinateUncertainty],
        estimate: &SimulatedEstimate,
        posterior: Option<&Posterior>,
    ) {
        let (problem, positions) = (&estimate.problem, &estimate.report.positions);
        let closed = |(low, high)| (Some(low), Some(high));
        let improved = match &self.intervals {
            IntervalRefits::Fisher => {
                let constrained = Constrained::of(&self.linear);
                let factors = vec![1.0; positions.len()];
                constrained.and_then(|constrained| {
                    Some(IntervalEnds {
                        method: "constrained",
                        ends: constrained.ends(positions, &factors)?,
                    })
                })
            }
            IntervalRefits::Profile(walks) => {
                let profiles = profile::profiles(walks);
                for (index, profile) in profiles.iter().enumerate() {
                    let coordinate = &problem.coordinates[index];
                    coordinates[index].profile = profile.values(coordinate, positions[index]);
                }
                Some(IntervalEnds {
                    method: "profile",
                    ends: profiles.into_iter().map(|profile| profile.ends).collect(),
                })
            }
            IntervalRefits::Bootstrap(drawn) => {
                let intervals = bootstrap::intervals(drawn, positions.len());
                intervals.map(|intervals| IntervalEnds {
                    method: "bootstrap",
                    ends: intervals.into_iter().map(closed).collect(),
                })
            }
            IntervalRefits::Posterior(_) => {
                let drawn = posterior.filter(|posterior| posterior.draws > 0);
                drawn.map(|posterior| IntervalEnds {
                    method: "posterior",
                    ends: posterior.ends().map(closed).collect(),
                })
            }
        };
        let Some(IntervalEnds { method, ends }) = improved else {
            return;
        };
        let with_ends = problem.coordinates.iter().zip(ends);
        for (described, (coordinate, (lower, upper))) in coordinates.iter_mut().zip(with_ends) {
            let value = |position: f64| coordinate.value(position);
            described.interval = Some((lower.map(value), upper.map(value)));
            described.ends = Some((lower, upper));
            described.method = method;
        }
    }
}
