//! How far an estimate can be trusted, and why.
//!
//! [`analyse`] linearises the residuals at the estimate and derives standard errors and
//! intervals ([`covariance`]), looks at what the model leaves unexplained ([`residuals`],
//! [`fit`]), and says in words what follows ([`verdict`]). A fit per cent alone certifies
//! nothing: a wrong structure can fit 99 % with parameters wrong by factors. What the data could
//! fix at all is foreseen by [`identifiability`].

pub mod covariance;
pub mod fit;
pub mod identifiability;
pub mod residuals;
pub mod verdict;

use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use crate::estimation::sensitivity::SensitivityError;
use crate::estimation::trajectory;
use covariance::Covariance;
use fit::{Criteria, OutputFit};
use residuals::ResidualReport;
use std::sync::atomic::AtomicBool;
use verdict::Verdict;

/// What is known of one coordinate beside its value.
#[derive(Clone, Debug)]
pub struct CoordinateUncertainty {
    /// The standard error, SI; none where the data do not fix the coordinate.
    pub standard_error: Option<f64>,
    /// The 95 % interval, SI; asymmetric for a coordinate on a log scale.
    pub interval: Option<(f64, f64)>,
    /// How the interval was made.
    pub method: &'static str,
    /// Whether the estimate stands at an end of its search range.
    pub at_bound: bool,
    /// Whether the data fix it more closely than the search range does.
    pub identifiable: bool,
}

/// All that is said of an estimate.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// One for each coordinate.
    pub coordinates: Vec<CoordinateUncertainty>,
    /// Correlations of the coordinates; none where there is no covariance.
    pub correlation: Option<Vec<Vec<f64>>>,
    /// Why there are no standard errors, where there are none.
    pub missing: Option<String>,
    /// For each output how well the data that were estimated from are explained.
    pub estimation_fit: Vec<OutputFit>,
    /// For each output how well the data that were held back are explained.
    pub validation_fit: Vec<OutputFit>,
    /// For each output what is left unexplained.
    pub residuals: Vec<ResidualReport>,
    /// Criteria for the comparison of models.
    pub criteria: Option<Criteria>,
    /// Whether the numbers can be trusted.
    pub verdict: Verdict,
}

/// Half the width of a 95 % interval in standard errors.
const NORMAL_95: f64 = 1.959_964;

/// How near to an end of its range an estimate counts as standing there.
const BOUND_DISTANCE: f64 = 1e-6;

/// Analyses an estimate. Answers nothing when `stop` was raised.
#[must_use]
pub fn analyse(problem: &Problem, report: &Report, stop: &AtomicBool) -> Option<Analysis> {
    let trajectories = trajectory::simulate(problem, &report.positions, stop)?;
    let Ok(trajectories) = trajectories else {
        return Some(without_simulation(problem, report));
    };
    let residuals = residuals::report(problem, &trajectories);
    let (covariance, missing) =
        match covariance::estimate(problem, &report.positions, &residuals, stop) {
            Ok(covariance) => (covariance, None),
            Err(SensitivityError::Interrupted) => return None,
            Err(failure) => (None, Some(failure.to_string())),
        };
    let unfixed = || "the data do not fix all of the unknowns".to_owned();
    let missing = missing.or_else(|| covariance.is_none().then(unfixed));
    let coordinates = coordinates(problem, report, covariance.as_ref());
    let estimation_fit = fit::of(problem, &trajectories, fit::Part::Estimation);
    let validation_fit = fit::of(problem, &trajectories, fit::Part::Validation);
    let criteria = fit::criteria(&estimation_fit, problem.coordinates.len());
    let mut analysis = Analysis {
        coordinates,
        correlation: covariance.as_ref().map(Covariance::correlation),
        missing,
        estimation_fit,
        validation_fit,
        residuals,
        criteria,
        verdict: Verdict::default(),
    };
    analysis.verdict = verdict::of(problem, report, &analysis);
    Some(analysis)
}

fn without_simulation(problem: &Problem, report: &Report) -> Analysis {
    let reason = "the simulation at the estimate fails".to_owned();
    Analysis {
        coordinates: coordinates(problem, report, None),
        correlation: None,
        missing: Some(reason.clone()),
        estimation_fit: Vec::new(),
        validation_fit: Vec::new(),
        residuals: Vec::new(),
        criteria: None,
        verdict: Verdict::low("simulation_fails", reason),
    }
}

fn coordinates(
    problem: &Problem,
    report: &Report,
    covariance: Option<&Covariance>,
) -> Vec<CoordinateUncertainty> {
    let pairs = problem
        .coordinates
        .iter()
        .zip(&report.positions)
        .enumerate();
    pairs
        .map(|(index, (coordinate, &position))| {
            let deviation = covariance.and_then(|covariance| covariance.deviation(index));
            let value = |position: f64| {
                coordinate
                    .scale
                    .value_beyond(position, coordinate.lower, coordinate.upper)
            };
            CoordinateUncertainty {
                standard_error: deviation
                    .map(|deviation| deviation * coordinate.slope(position).abs()),
                interval: deviation.map(|deviation| {
                    let half = NORMAL_95 * deviation;
                    (value(position - half), value(position + half))
                }),
                method: covariance.map_or("fisher", |covariance| covariance.method()),
                at_bound: !(BOUND_DISTANCE..=1.0 - BOUND_DISTANCE).contains(&position),
                identifiable: deviation.is_some_and(|deviation| 2.0 * NORMAL_95 * deviation < 1.0),
            }
        })
        .collect()
}
