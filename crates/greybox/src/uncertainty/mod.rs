//! How far an estimate can be trusted, and why.
//!
//! [`conclude`] weighs outputs of unknown noise by what is left of each ([`reweighting`]) and leaves
//! out what the data do not support, where that is asked for ([`selection`]); [`analyse`]
//! linearises the residuals at the estimate and derives standard errors and intervals
//! ([`covariance`]; on request better ones, [`profile`] and [`bootstrap`]), says what the numbers
//! that are taken as known add to them and whether the residuals contradict one ([`budget`]) or ask
//! for an unknown that changes within the record ([`drift`]), looks at what the model leaves
//! unexplained ([`residuals`], [`fit`]), and says in words what follows ([`verdict`]). A fit per
//! cent alone certifies nothing: a wrong structure can fit 99 % with parameters wrong by factors.
//! What the data could fix at all is forecast by [`identifiability`], and which experiment would
//! fix it better by [`design`].

pub mod bootstrap;
pub mod budget;
pub mod constrained;
pub mod covariance;
pub mod design;
pub mod drift;
pub mod fit;
pub mod identifiability;
pub mod joint;
pub mod monte_carlo;
pub mod profile;
pub mod refits;
pub mod residuals;
pub mod reweighting;
mod rules;
pub mod selection;
mod sensors;
pub mod settings;
pub mod validation_start;
pub mod verdict;
pub mod weighing;
pub mod whitening;

pub use refits::Refits;
pub use selection::{Conclusion, conclude};
pub use settings::{Intervals, Settings};

use crate::estimation::loss::Loss;
use crate::estimation::problem::{Coordinate, Problem};
use crate::estimation::report::Report;
use crate::estimation::sensitivity::SensitivityError;
use crate::estimation::trajectory;
use bootstrap::Bootstrap;
use budget::{Around, Budget, Extended};
use constrained::{Binding, Constrained};
use covariance::{Covariance, Linear, NoiseLevels};
use drift::Drift;
use fit::{Criteria, OutputFit};
use greybox_simulation::Accuracy;
use greybox_simulation::single::Outputs;
use identifiability::FlatDirection;
use monte_carlo::Spread;
use profile::Ends;
use residuals::ResidualReport;
use std::sync::atomic::AtomicBool;
use verdict::{Doubt, Judgement, Rule, Trust};
use weighing::Seen;

/// What is known of one coordinate beside its value.
#[derive(Clone, Debug)]
pub struct CoordinateUncertainty {
    /// The standard error, SI; none where the data do not fix the coordinate.
    pub standard_error: Option<f64>,
    /// The 95 % interval, SI; asymmetric for a coordinate on a log scale. An end that the data
    /// leave open is none.
    pub interval: Option<(Option<f64>, Option<f64>)>,
    /// How the interval was made.
    pub method: &'static str,
    /// The ends of the 95 % interval as positions, before they are made values.
    ends: Option<Ends>,
    /// The likelihood profile where one was made: values, SI, and how far the sum of squares rises
    /// there, as a multiple of the rise at which the interval ends.
    pub profile: Vec<(f64, f64)>,
    /// The standard error with all that is taken as known, SI.
    pub total_error: Option<f64>,
    /// The 95 % interval with all that is taken as known, SI.
    pub total_interval: Option<(Option<f64>, Option<f64>)>,
    /// How the fits of a Monte Carlo analysis lie about the estimate, where one was asked for.
    pub monte_carlo: Option<Spread>,
    /// How many standard deviations of its prior the estimate is off its middle.
    pub prior_shift: Option<f64>,
    /// How far the total interval can be relied on.
    pub trust: Trust,
    /// Whether the estimate stands at an end of its search range.
    pub at_bound: bool,
    /// Whether the data fix the coordinate more closely than the search range does.
    pub identifiable: bool,
    /// For each output the root mean square of its change when the coordinate's value grows by
    /// 100 %, linearised, SI; empty where the simulation near the estimate fails.
    pub output_changes: Vec<f64>,
}

/// All that is said of an estimate.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// One for each coordinate.
    pub coordinates: Vec<CoordinateUncertainty>,
    /// Correlations of the coordinates; none where there is no covariance.
    pub correlation: Option<Vec<Vec<f64>>>,
    /// The condition number of the derivatives, each column scaled to the same length.
    pub condition: Option<f64>,
    /// What the data do not see near the estimate.
    pub flat: Vec<FlatDirection>,
    /// Why there are no standard errors, where there are none.
    pub missing: Option<String>,
    /// For each output how well the data that were estimated from are explained.
    pub estimation_fit: Vec<OutputFit>,
    /// For each output how well the data that were held back are explained.
    pub validation_fit: Vec<OutputFit>,
    /// For each output what is left unexplained.
    pub residuals: Vec<ResidualReport>,
    /// Criteria for the comparison of models.
    pub criteria: Criteria,
    /// For each coordinate the standard deviation that noise alone leaves, as a share of its
    /// search range.
    pub deviations: Vec<Option<f64>>,
    /// What is taken as known, and what it does.
    pub budget: Budget,
    /// Unknowns that the residuals say to change within the record.
    pub drifts: Vec<Drift>,
    /// Constraints that keep the estimate from where the data would have it.
    pub bindings: Vec<Binding>,
    /// Whether the numbers can be trusted.
    pub judgement: Judgement,
}

/// Half the width of a 95 % interval in standard errors.
const NORMAL_95: f64 = 1.959_964;

/// How near to an end of its range an estimate counts as standing there.
const BOUND_DISTANCE: f64 = 1e-6;

/// What is asked about an estimate.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// How much.
    pub settings: Settings,
    /// Where random numbers come from.
    pub seed: u64,
    /// Parameters that may be left out of the model ([`selection`]).
    pub effects: Vec<String>,
    /// Whether outputs of unknown noise are weighed anew and the budget of what is taken as known
    /// is drawn up, which takes many simulations.
    pub thorough: bool,
}

/// Analyses an estimate. Answers nothing when `stop` was raised, or the refits were cut.
#[must_use]
pub fn analyse(
    problem: &Problem,
    report: &Report,
    request: &Request,
    refits: &Refits,
    stop: &AtomicBool,
) -> Option<Analysis> {
    let positions = &report.positions;
    let extended = Extended::new(problem, positions, request.thorough);
    let (trajectories, around) = rayon::join(
        || trajectory::simulate(problem, positions, stop),
        || extended.around(Accuracy::Full, stop),
    );
    let (trajectories, around) = (trajectories?, around?);
    let Ok(trajectories) = trajectories else {
        return Some(without_simulation(problem, report));
    };
    let residuals = residuals::report(problem, &trajectories);
    let estimate = Estimate {
        problem,
        report,
        trajectories: &trajectories,
        residuals: &residuals,
    };
    let linearised = match estimate.linearised((&extended, &around), request, (refits, stop)) {
        Ok(linearised) => linearised,
        Err(SensitivityError::Interrupted) => return None,
        Err(failure) => Linearised::without(problem, report, failure.to_string()),
    };
    let estimation_fit = fit::of(problem, &trajectories, fit::Part::Estimation);
    let validation_fit = fit::of(problem, &trajectories, fit::Part::Validation);
    // They compare likelihoods of normal noise.
    let criteria = match problem.loss {
        Loss::Squared => fit::criteria(&estimation_fit, problem.coordinates.len()),
        Loss::Huber(_) => Criteria::missing(),
    };
    let mut analysis = Analysis {
        coordinates: linearised.coordinates,
        correlation: linearised.correlation,
        condition: linearised.condition,
        flat: linearised.flat,
        missing: linearised.missing,
        estimation_fit,
        validation_fit,
        residuals,
        criteria,
        deviations: linearised.deviations,
        budget: linearised.budget,
        drifts: linearised.drifts,
        bindings: linearised.bindings,
        judgement: Judgement::default(),
    };
    analysis.judge(rules::judge(problem, report, &analysis));
    Some(analysis)
}

impl Analysis {
    fn judge(&mut self, judgement: Judgement) {
        for (known, trust) in self.coordinates.iter_mut().zip(&judgement.coordinates) {
            known.trust = *trust;
        }
        self.judgement = judgement;
    }
}

/// An estimate of which nothing is known yet, for whoever cannot wait for its analysis.
#[must_use]
pub fn unanalysed(problem: &Problem, report: &Report) -> Conclusion {
    let reason = "the job was stopped before the estimate was analysed".to_owned();
    Conclusion {
        problem: problem.clone(),
        report: report.clone(),
        analysis: unknown(problem, report, Rule::NotAnalysed, reason),
        selection: None,
    }
}

fn without_simulation(problem: &Problem, report: &Report) -> Analysis {
    let reason = "the simulation at the estimate fails".to_owned();
    unknown(problem, report, Rule::SimulationFails, reason)
}

fn unknown(problem: &Problem, report: &Report, rule: Rule, reason: String) -> Analysis {
    let mut analysis = Analysis {
        coordinates: coordinates(problem, report, None),
        correlation: None,
        condition: None,
        flat: Vec::new(),
        missing: Some(reason.clone()),
        estimation_fit: Vec::new(),
        validation_fit: Vec::new(),
        residuals: Vec::new(),
        criteria: Criteria::missing(),
        deviations: vec![None; problem.coordinates.len()],
        budget: Budget::default(),
        drifts: Vec::new(),
        bindings: Vec::new(),
        judgement: Judgement::default(),
    };
    let doubt = Doubt::new(rule, Trust::Low, reason);
    analysis.judge(Judgement::of(problem, vec![doubt]));
    analysis
}

/// What follows from the derivatives at the estimate.
struct Linearised {
    coordinates: Vec<CoordinateUncertainty>,
    correlation: Option<Vec<Vec<f64>>>,
    condition: Option<f64>,
    flat: Vec<FlatDirection>,
    missing: Option<String>,
    deviations: Vec<Option<f64>>,
    budget: Budget,
    drifts: Vec<Drift>,
    bindings: Vec<Binding>,
}

impl Linearised {
    fn without(problem: &Problem, report: &Report, reason: String) -> Linearised {
        Linearised {
            coordinates: coordinates(problem, report, None),
            correlation: None,
            condition: None,
            flat: Vec::new(),
            missing: Some(reason),
            deviations: vec![None; problem.coordinates.len()],
            budget: Budget::default(),
            drifts: Vec::new(),
            bindings: Vec::new(),
        }
    }
}

/// An estimate that can be simulated.
struct Estimate<'a> {
    problem: &'a Problem,
    report: &'a Report,
    trajectories: &'a [Outputs],
    residuals: &'a [ResidualReport],
}

impl Estimate<'_> {
    fn linearised(
        &self,
        (extended, around): (&Extended, &Around<'_>),
        request: &Request,
        (refits, stop): (&Refits, &AtomicBool),
    ) -> Result<Linearised, SensitivityError> {
        let (problem, positions) = (self.problem, &self.report.positions[..]);
        let linear = covariance::linearise(problem, &around.neighbourhood, self.residuals)
            .map_err(SensitivityError::Failed)?;
        let seen = Seen {
            trajectories: self.trajectories,
            residuals: self.residuals,
            linear: &linear,
        };
        let budget = Budget::of(extended, around, seen).map_err(SensitivityError::Failed)?;
        let drifts = drift::of(problem, &around.neighbourhood, seen);
        let drifts = drifts.map_err(SensitivityError::Failed)?;
        let weights = NoiseLevels::of(problem, self.residuals).weights();
        let flat = identifiability::flat_at(problem, positions, &linear.factor, &weights, stop)?;
        let mut coordinates = coordinates(problem, self.report, Some(&linear));
        self.better_intervals(&mut coordinates, &linear, request, (refits, stop))?;
        let deviations: Vec<Option<f64>> = (0..positions.len())
            .map(|index| linear.deviation(index))
            .collect();
        for (index, known) in coordinates.iter_mut().enumerate() {
            let total = budget.totals[index].zip(deviations[index]);
            known.widen(&problem.coordinates[index], positions[index], total);
        }
        let constrained = Constrained::of(&linear);
        if let Some(constrained) = &constrained {
            let totals = budget.totals.iter().zip(&deviations);
            let factors: Option<Vec<f64>> = totals
                .map(|(total, noise)| Some((*total)? / (*noise)?))
                .collect();
            let ends = factors.and_then(|factors| constrained.ends(positions, &factors));
            for (index, ends) in ends.into_iter().flatten().enumerate() {
                let value = |end: Option<f64>| value_near(&problem.coordinates[index], end?);
                coordinates[index].total_interval = Some((value(ends.0), value(ends.1)));
            }
        }
        self.draw_totals(&mut coordinates, request, (refits, stop))?;
        let unfixed = || "the data do not fix all of the unknowns".to_owned();
        Ok(Linearised {
            coordinates,
            correlation: linear.covariance.as_ref().map(Covariance::correlation),
            condition: Some(linear.condition),
            flat,
            missing: linear.covariance.is_none().then(unfixed),
            deviations,
            budget,
            drifts,
            bindings: constrained.map_or_else(Vec::new, |own| own.bindings()),
        })
    }

    /// Puts the intervals that were asked for in the place of those from the curvature.
    fn better_intervals(
        &self,
        coordinates: &mut [CoordinateUncertainty],
        linear: &Linear,
        request: &Request,
        (refits, stop): (&Refits, &AtomicBool),
    ) -> Result<(), SensitivityError> {
        let positions = &self.report.positions;
        let n = positions.len();
        let (method, ends) = match request.settings.intervals {
            Intervals::Fisher => {
                let constrained = Constrained::of(linear);
                let found = constrained.and_then(|own| own.ends(positions, &vec![1.0; n]));
                match found {
                    Some(ends) => ("constrained", ends),
                    None => return Ok(()),
                }
            }
            Intervals::Profile => {
                let found = profile::intervals(self.problem, positions, linear, (refits, stop))?;
                for (index, (known, own)) in coordinates.iter_mut().zip(&found).enumerate() {
                    known.profile = own.values(&self.problem.coordinates[index], positions[index]);
                }
                ("profile", found.into_iter().map(|own| own.ends).collect())
            }
            Intervals::Bootstrap => {
                let bootstrap = self.bootstrap(request.settings.bootstrap_samples, request.seed);
                let found = bootstrap.intervals(refits, stop);
                let closed = |(low, high)| (Some(low), Some(high));
                match found.ok_or(SensitivityError::Interrupted)? {
                    Some(found) => ("bootstrap", found.into_iter().map(closed).collect()),
                    None => return Ok(()),
                }
            }
        };
        let described = self.problem.coordinates.iter().zip(ends);
        for (known, (coordinate, (lower, upper))) in coordinates.iter_mut().zip(described) {
            let value = |position: f64| coordinate.value(position);
            known.interval = Some((lower.map(value), upper.map(value)));
            known.ends = Some((lower, upper));
            known.method = method;
        }
        Ok(())
    }
}

impl<'a> Estimate<'a> {
    fn bootstrap(&self, samples: u32, seed: u64) -> Bootstrap<'a> {
        Bootstrap {
            problem: self.problem,
            positions: &self.report.positions,
            trajectories: self.trajectories,
            residuals: self.residuals,
            samples,
            seed,
        }
    }

    /// Puts what a Monte Carlo analysis says beside the totals, where one was asked for.
    fn draw_totals(
        &self,
        coordinates: &mut [CoordinateUncertainty],
        request: &Request,
        (refits, stop): (&Refits, &AtomicBool),
    ) -> Result<(), SensitivityError> {
        let samples = request.settings.monte_carlo_samples;
        if samples == 0 {
            return Ok(());
        }
        let bootstrap = self.bootstrap(samples, request.seed);
        let found = monte_carlo::spreads(&bootstrap, refits, stop);
        let spreads = found.ok_or(SensitivityError::Interrupted)?;
        for (known, spread) in coordinates.iter_mut().zip(spreads.into_iter().flatten()) {
            known.monte_carlo = Some(spread);
        }
        Ok(())
    }
}

impl CoordinateUncertainty {
    /// Adds what is assumed: the total and the noise alone, as standard deviations of the
    /// position. Each end of the interval goes out by what the total's square has more.
    fn widen(&mut self, coordinate: &Coordinate, position: f64, deviations: Option<(f64, f64)>) {
        let (Some((total, noise)), Some((lower, upper))) = (deviations, self.ends) else {
            return;
        };
        self.total_error = Some(total * coordinate.slope(position).abs());
        let more = NORMAL_95 * NORMAL_95 * (total * total - noise * noise).max(0.0);
        let end = |end: f64| {
            let half = end - position;
            let end = position + (half * half + more).sqrt().copysign(half);
            value_near(coordinate, end)
        };
        self.total_interval = Some((lower.and_then(end), upper.and_then(end)));
    }
}

/// The value at an end of an interval; none where it lies a whole search range beyond it: there
/// the data leave it open.
fn value_near(coordinate: &Coordinate, position: f64) -> Option<f64> {
    let (lower, upper) = (coordinate.lower, coordinate.upper);
    (-1.0..=2.0)
        .contains(&position)
        .then(|| coordinate.scale.value_beyond(position, lower, upper))
}

fn coordinates(
    problem: &Problem,
    report: &Report,
    linear: Option<&Linear>,
) -> Vec<CoordinateUncertainty> {
    let pairs = problem
        .coordinates
        .iter()
        .zip(&report.positions)
        .enumerate();
    pairs
        .map(|(index, (coordinate, &position))| {
            let deviation = linear.and_then(|linear| linear.deviation(index));
            let covariance = linear.and_then(|linear| linear.covariance.as_ref());
            let slope = coordinate.slope(position).abs();
            let value = |position: f64| value_near(coordinate, position);
            let ends = deviation.map(|deviation| {
                let half = NORMAL_95 * deviation;
                (Some(position - half), Some(position + half))
            });
            let prior = problem.prior_of(index);
            let relative = coordinate.value(position).abs() / slope;
            let slopes = linear.map(|linear| linear.slopes[index].iter());
            CoordinateUncertainty {
                standard_error: deviation.map(|deviation| deviation * slope),
                interval: ends.map(|(low, high)| (low.and_then(value), high.and_then(value))),
                ends,
                profile: Vec::new(),
                total_error: None,
                total_interval: None,
                monte_carlo: None,
                prior_shift: prior.map(|prior| prior.residual(coordinate.value(position))),
                trust: Trust::default(),
                method: covariance.map_or("fisher", |covariance| covariance.method()),
                at_bound: !(BOUND_DISTANCE..=1.0 - BOUND_DISTANCE).contains(&position),
                identifiable: deviation.is_some_and(|deviation| 2.0 * NORMAL_95 * deviation < 1.0),
                output_changes: slopes
                    .into_iter()
                    .flatten()
                    .map(|slope| slope * relative)
                    .collect(),
            }
        })
        .collect()
}
