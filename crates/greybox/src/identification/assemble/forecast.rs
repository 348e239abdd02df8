//! What a job's data could fix, said before the job runs.

use super::{Assembly, Finding, Preflight};
use crate::estimation::problem::{Coordinate, Problem, Target};
use crate::estimation::trajectory;
use crate::identification::budget::BudgetLine;
use crate::uncertainty::identifiability::{self, CoordinateForecast, FlatDirection};
use greybox_numerics::parsing::fault::pointer_to;
use greybox_simulation::Accuracy;
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;
use utoipa::ToSchema;

/// Derivatives that may be spent on looking ahead: some seconds.
pub(super) const BUDGET: f64 = 1e9;
/// Derivatives that may be spent on whether a window says something: less than a second.
const WINDOW_BUDGET: f64 = 1e8;
/// Linearisations that this takes.
const LINEARISATIONS: usize = 2;

/// What the data could fix, by the sensitivities of the outputs at several points of the box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Identifiability {
    /// Points of the search box that were simulated; 0 where none could be, or where the
    /// recording is too long to look ahead.
    #[schema(example = 5)]
    pub points: u64,
    /// What an ideal estimator would reach.
    pub predictions: Vec<Prediction>,
    /// What the data do not see, in words.
    pub flat_directions: Vec<String>,
    /// What is taken as known and what it will do, in the middle of the search box; shown beside.
    #[serde(skip)]
    #[schema(ignore)]
    pub budget: Vec<BudgetLine>,
}

/// How well one unknown could be known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Prediction {
    /// The parameter, or the state whose start is estimated.
    #[schema(example = "mass")]
    pub name: String,
    /// The experiment, where it is an initial state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub experiment: Option<usize>,
    /// The SI unit of the unknown.
    #[schema(example = "kg")]
    pub unit: String,
    /// The predicted standard error at the middle of the search box; `null` where the data do
    /// not fix it there.
    #[schema(example = 0.08)]
    pub standard_error: Option<f64>,
    /// The smallest and the largest prediction over the points, as a share of the search range.
    pub share_of_range: Option<[f64; 2]>,
}

/// Looks ahead, where that takes no longer than a client waits; what it finds joins the findings of
/// the preflight, and that it could not look when `stop` was raised before it had.
#[must_use]
pub fn forecast(
    assembly: &Assembly,
    preflight: &mut Preflight,
    stop: &AtomicBool,
) -> Identifiability {
    let problem = &assembly.problem;
    let columns = 1 + 2 * problem.coordinates.len();
    let each = preflight.derivatives_per_evaluation as f64;
    let findings = &mut preflight.findings;
    let cost = each * (columns * identifiability::POINTS) as f64;
    if cost > BUDGET {
        let detail = format!(
            "the recording is too long to look ahead ({cost:.1e} derivatives): what the data fix \
             is seen in the result"
        );
        return unchecked(findings, &detail);
    }
    let Some(forecast) = identifiability::forecast(problem, Accuracy::Full, stop) else {
        let detail = "to look ahead took longer than a client waits: what the data fix is seen in \
                      the result";
        return unchecked(findings, detail);
    };
    findings.extend(unusable(forecast.points));
    findings.extend(forecast.flat.iter().map(|flat| unseen(problem, flat)));
    let assumed = (columns + 2 * problem.assumptions.len()) as f64;
    let budget = if each * assumed > BUDGET {
        Vec::new()
    } else {
        let budget = identifiability::budget(problem, &forecast, stop);
        let middle = vec![0.5; problem.coordinates.len()];
        budget.map_or_else(Vec::new, |budget| {
            super::budget::lines(problem, &middle, &budget)
        })
    };
    let pairs = problem.coordinates.iter().zip(&forecast.coordinates);
    Identifiability {
        budget,
        points: forecast.points as u64,
        predictions: pairs
            .map(|(coordinate, forecast)| prediction(coordinate, forecast))
            .collect(),
        flat_directions: forecast.flat.into_iter().map(|flat| flat.words).collect(),
    }
}

/// Whether the data of a problem could fix one of its parameters at the least so well that it is not too wide to be
/// used, in the middle of the ranges. Nothing where that cannot be simulated or takes longer than a second, or `stop`
/// was raised.
#[must_use]
pub fn informs(problem: &Problem, stop: &AtomicBool) -> Option<bool> {
    let middle = vec![0.5; problem.coordinates.len()];
    let columns = 1 + 2 * problem.coordinates.len();
    let each = trajectory::derivatives(problem, &middle, stop)? as f64;
    if each * (columns * LINEARISATIONS) as f64 > WINDOW_BUDGET {
        return None;
    }
    identifiability::fixes_some(problem, &middle, stop).ok()
}

/// Nobody looked ahead, and why.
fn unchecked(findings: &mut Vec<Finding>, detail: &str) -> Identifiability {
    findings.push(Finding::new(
        "identifiability_not_checked",
        "/experiments",
        detail,
    ));
    Identifiability {
        points: 0,
        predictions: Vec::new(),
        flat_directions: Vec::new(),
        budget: Vec::new(),
    }
}

/// What is said of points of the search box that failed.
fn unusable(points: usize) -> Option<Finding> {
    let failed = identifiability::POINTS - points;
    (failed > 0).then(|| {
        let detail = format!(
            "{failed} of {} points of the search box cannot be simulated, or with values too \
             large to be of use: what is foretold rests on the others; narrow the ranges to where \
             the plant is stable",
            identifiability::POINTS
        );
        Finding::new("points_failed", "/parameters", &detail)
    })
}

/// What the data of a job that begins do not see, at the price of about one generation. Answers
/// nothing when `stop` was raised.
#[must_use]
pub fn flat_directions(problem: &Problem, stop: &AtomicBool) -> Option<Vec<FlatDirection>> {
    let forecast = identifiability::forecast(problem, Accuracy::Screening, stop)?;
    Some(forecast.flat)
}

/// What a direction that the data do not see is told as.
#[must_use]
pub fn unseen(problem: &Problem, flat: &FlatDirection) -> Finding {
    let place = flat.parts.first();
    let place = place.map(|(index, _)| &problem.coordinates[*index]);
    let pointer = place.map_or_else(String::new, pointer_of);
    Finding::new("not_identifiable", &pointer, &flat.words)
}

fn prediction(coordinate: &Coordinate, forecast: &CoordinateForecast) -> Prediction {
    Prediction {
        name: coordinate.name.clone(),
        experiment: coordinate.target.experiment(),
        unit: coordinate.unit.clone(),
        standard_error: forecast.standard_error,
        share_of_range: forecast.share_of_range.map(|(low, high)| [low, high]),
    }
}

fn pointer_of(coordinate: &Coordinate) -> String {
    match coordinate.target {
        Target::Parameter(_) => format!("/parameters/{}", coordinate.name),
        Target::ExperimentParameter { experiment, .. } => pointer_to(
            &format!("/experiments/{experiment}/parameters"),
            &coordinate.quantity,
        ),
        Target::InitialState { experiment, .. } => {
            format!("/experiments/{experiment}/initial_state")
        }
    }
}
