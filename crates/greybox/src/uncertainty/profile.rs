//! Intervals from the likelihood profile.
//!
//! A coordinate is held at a distance from its estimate and all others are fitted again; the sum
//! of squares rises by the *excess*. The end of the interval is where the excess reaches the
//! level at which a 95 % test would reject (D. J. Venzon, S. H. Moolgavkar, "A method for
//! computing profile-likelihood-based confidence intervals", Applied Statistics 37, 1988; A.
//! Raue et al., Bioinformatics 25, 2009). Where the model is linear in its unknowns this is the
//! Fisher interval; the level is chosen so that it is that too where the noise is larger than
//! declared, unknown, or coloured.

use std::borrow::Cow;
use std::sync::Arc;

use super::covariance::{Linear, NORMAL_95};
use super::refits::{Refit, RefitName, RefitSequence, RefitTask};
use super::simulated_estimate::SimulatedEstimate;
use crate::estimation::objective::Objective;
use crate::estimation::problem::{Coordinate, Problem, Target};
use crate::estimation::refine;
use crate::estimation::sensitivity::SensitivityError;
use greybox_numerics::least_squares::Triangle;
use greybox_simulation::Accuracy;
use nalgebra::DMatrix;
use std::sync::atomic::AtomicBool;

/// Fits on the way to an end at the most.
const MOST_FITS: usize = 12;
/// How near the root of the excess comes to that of the level.
const NEAR: f64 = 0.01;
/// The first distance that is tried where no standard error says one, as a share of the range.
const FIRST_DISTANCE: f64 = 0.1;

/// The ends of an interval as positions; none where the data leave it open within the range.
pub type Ends = (Option<f64>, Option<f64>);

/// A point of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where the coordinate was held.
    pub position: f64,
    /// The excess there, as a multiple of that at which the interval ends.
    pub excess: f64,
}

/// The profile of one coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct LikelihoodProfile {
    /// The ends of the coordinate's interval.
    pub ends: Ends,
    /// The fits on the way to the ends, in the order of their positions.
    pub points: Vec<Point>,
}

impl LikelihoodProfile {
    /// The points as values, with the estimate, which stands at a position of its own, among them.
    #[must_use]
    pub fn values(&self, coordinate: &Coordinate, estimate: f64) -> Vec<(f64, f64)> {
        let points = self.points.iter();
        let points = points.map(|point| (point.position, point.excess));
        let mut points: Vec<(f64, f64)> = points.chain([(estimate, 0.0)]).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let value = |(position, excess)| (coordinate.value(position), excess);
        points.into_iter().map(value).collect()
    }
}

/// Begins the walks to both ends of each coordinate's interval.
///
/// # Errors
/// When the stop flag was raised, or the estimate cannot be simulated.
pub(super) fn walks(
    estimate: &Arc<SimulatedEstimate>,
    linear: &Linear,
    stop: &AtomicBool,
) -> Result<Vec<Walk>, SensitivityError> {
    let positions = &estimate.report.positions;
    let bottom = refine::linearise(&estimate.problem, positions, Accuracy::Full, stop)?;
    let coordinates = 0..positions.len();
    let base = Arc::new(ProfileBase {
        estimate: Arc::clone(estimate),
        sum: bottom.cost * bottom.triangle.rows() as f64,
        inverse: information_inverse(&bottom.triangle),
        deviations: coordinates.clone().map(|k| linear.deviation(k)).collect(),
        noise: linear.mean_square_noise,
    });
    let sides = coordinates.flat_map(|coordinate| [(coordinate, -1.0), (coordinate, 1.0)]);
    sides
        .map(|(coordinate, side)| Walk::begin(&base, coordinate, side, stop))
        .collect::<Option<_>>()
        .ok_or(SensitivityError::Interrupted)
}

/// Returns the profile of each coordinate, of which the walks have ended.
pub(super) fn profiles(walks: &[Walk]) -> Vec<LikelihoodProfile> {
    let both = walks.chunks_exact(2).map(|sides| {
        let mut points = [&sides[0].points[..], &sides[1].points].concat();
        points.sort_by(|a, b| a.position.total_cmp(&b.position));
        LikelihoodProfile {
            ends: (sides[0].end.position(), sides[1].end.position()),
            points,
        }
    });
    both.collect()
}

/// `(JᵀJ)⁻¹`; none where J is singular.
fn information_inverse(triangle: &Triangle) -> Option<DMatrix<f64>> {
    let factor = triangle.factor();
    let n = factor.ncols();
    let inverse = factor.solve_upper_triangular(&DMatrix::identity(n, n))?;
    let inverse = &inverse * inverse.transpose();
    inverse
        .iter()
        .all(|entry| entry.is_finite())
        .then_some(inverse)
}

/// What all walks from one estimate have in common.
#[derive(Debug)]
struct ProfileBase {
    estimate: Arc<SimulatedEstimate>,
    /// The sum of squares at the estimate.
    sum: f64,
    inverse: Option<DMatrix<f64>>,
    /// For each coordinate its standard deviation, as a share of its search range.
    deviations: Vec<Option<f64>>,
    /// The mean square of the noise in the units of the residuals.
    noise: f64,
}

/// Where a walk ended.
#[derive(Clone, Copy, Debug, PartialEq)]
enum WalkEnd {
    /// The walk goes on.
    Sought,
    /// The excess reaches its level here.
    At(f64),
    /// The excess does not reach its level within the range.
    Open,
}

impl WalkEnd {
    fn position(self) -> Option<f64> {
        match self {
            WalkEnd::At(position) => Some(position),
            WalkEnd::Sought | WalkEnd::Open => None,
        }
    }
}

/// The walk from an estimate to one end of a coordinate's interval, a refit at a time.
#[derive(Debug)]
pub(super) struct Walk {
    base: Arc<ProfileBase>,
    coordinate: usize,
    /// The problem with the coordinate held at the position that is tried next.
    reduced: Problem,
    position: f64,
    others: Others,
    /// The farthest position that was tried below the level.
    inside: TriedPosition,
    /// The nearest position that was tried above the level.
    outside: Option<TriedPosition>,
    points: Vec<Point>,
    fits: usize,
    end: WalkEnd,
}

/// A position that was tried.
#[derive(Clone, Copy, Debug)]
struct TriedPosition {
    position: f64,
    /// The root of the excess there.
    root: f64,
}

/// Where the other coordinates were when the one was held.
#[derive(Debug)]
struct Others {
    at: f64,
    positions: Vec<f64>,
}

/// The lowest sum of squares with a coordinate held, and where the others then are.
struct ReducedFit {
    sum: f64,
    positions: Vec<f64>,
}

impl RefitSequence for Walk {
    fn next(&self) -> Option<RefitName> {
        let is_sought = self.end == WalkEnd::Sought;
        is_sought.then(|| RefitName::profile(self.coordinate, self.position))
    }

    fn run(&self, stop: &AtomicBool) -> Option<Refit> {
        RefitTask {
            problem: Cow::Borrowed(&self.reduced),
            start: self.guess(),
            accuracy: Accuracy::Full,
        }
        .run(stop)
    }

    fn follow(&mut self, refit: &Refit, _stop: &AtomicBool) -> Option<()> {
        let samples = self.samples();
        let fit = refit.cost.map(|cost| ReducedFit {
            sum: cost * samples,
            positions: refit.positions.clone(),
        });
        self.go_on(fit);
        Some(())
    }
}

impl Walk {
    /// Begins a walk to the lower end with side −1, to the upper end with side 1. A single coordinate leaves nothing to fit: then the walk is at its end.
    /// Answers nothing when `stop` was raised.
    fn begin(
        base: &Arc<ProfileBase>,
        coordinate: usize,
        side: f64,
        stop: &AtomicBool,
    ) -> Option<Walk> {
        let estimate = &base.estimate;
        let start = estimate.report.positions[coordinate];
        let mut positions = estimate.report.positions.clone();
        positions.remove(coordinate);
        let first =
            base.deviations[coordinate].map_or(FIRST_DISTANCE, |deviation| NORMAL_95 * deviation);
        let mut walk = Walk {
            base: Arc::clone(base),
            coordinate,
            reduced: without(&estimate.problem, coordinate),
            position: start,
            others: Others {
                at: start,
                positions,
            },
            inside: TriedPosition {
                position: start,
                root: 0.0,
            },
            outside: None,
            points: Vec::new(),
            fits: 0,
            end: WalkEnd::Sought,
        };
        walk.hold(start + side * first);
        while walk.others.positions.is_empty() && walk.end == WalkEnd::Sought {
            let fit = walk.evaluate(stop)?;
            walk.go_on(fit);
        }
        Some(walk)
    }

    /// Holds the coordinate at a position within its range.
    fn hold(&mut self, position: f64) {
        self.position = position.clamp(0.0, 1.0);
        let problem = &self.base.estimate.problem;
        hold(&mut self.reduced, problem, self.coordinate, self.position);
    }

    /// Goes on from the fit at the position; there is none where it cannot be simulated.
    fn go_on(&mut self, fit: Option<ReducedFit>) {
        let position = self.position;
        let prior = self.prior_square(position);
        let root = fit.as_ref().map_or(f64::INFINITY, |fit| {
            (((fit.sum + prior) - self.base.sum).max(0.0) / self.level()).sqrt()
        });
        if root.is_finite() {
            self.points.push(Point {
                position,
                excess: root * root,
            });
        }
        self.fits += 1;
        if (root - 1.0).abs() < NEAR {
            self.end = WalkEnd::At(position);
            return;
        }
        if root > 1.0 {
            self.outside = Some(TriedPosition { position, root });
        } else if position <= 0.0 || position >= 1.0 {
            self.end = WalkEnd::Open;
            return;
        } else {
            self.inside = TriedPosition { position, root };
            if let Some(fit) = fit {
                self.others = Others {
                    at: position,
                    positions: fit.positions,
                };
            }
        }
        if self.fits == MOST_FITS {
            self.end = WalkEnd::At(self.inside.position);
            return;
        }
        let start = self.base.estimate.report.positions[self.coordinate];
        self.hold(between(start, self.inside, self.outside));
    }

    /// The excess at the end of the interval. Near the estimate the excess of a distance d is
    /// `d²/v`, with v the diagonal of `(JᵀJ)⁻¹`.
    fn level(&self) -> f64 {
        let inverse = self.base.inverse.as_ref();
        let variance = inverse.map(|inverse| inverse[(self.coordinate, self.coordinate)]);
        let ratio = match (self.base.deviations[self.coordinate], variance) {
            (Some(deviation), Some(variance)) => deviation * deviation / variance,
            _ => self.base.noise,
        };
        NORMAL_95 * NORMAL_95 * ratio
    }

    /// What the held coordinate's own prior adds to the sum of squares.
    fn prior_square(&self, position: f64) -> f64 {
        let held = &self.base.estimate.problem.coordinates[self.coordinate];
        let prior = held.prior;
        prior.map_or(0.0, |prior| prior.residual(held.value(position)).powi(2))
    }

    /// The other coordinates, moved along with the held one as the linear model says.
    fn guess(&self) -> Vec<f64> {
        let distance = self.position - self.others.at;
        let held = self.coordinate;
        let slope = |index: usize| {
            let inverse = self.base.inverse.as_ref();
            inverse.map_or(0.0, |inverse| {
                inverse[(index, held)] / inverse[(held, held)]
            })
        };
        let others = self.others.positions.iter().enumerate();
        others
            .map(|(place, position)| {
                let index = place + usize::from(place >= held);
                (position + slope(index) * distance).clamp(0.0, 1.0)
            })
            .collect()
    }

    /// The squares that a cost of the reduced problem is the mean of.
    fn samples(&self) -> f64 {
        (self.reduced.n_residuals() + self.reduced.prior_sum(&self.guess()).1) as f64
    }

    /// What the reduced problem costs where no coordinate is left to fit. Answers nothing when
    /// `stop` was raised.
    fn evaluate(&self, stop: &AtomicBool) -> Option<Option<ReducedFit>> {
        let objective = Objective::new(&self.reduced, usize::MAX);
        let nothing = [Vec::new()];
        let judged = objective.evaluate(&self.reduced, &nothing, Accuracy::Full, stop)?;
        let cost = judged[0].cost;
        Some(cost.is_finite().then(|| ReducedFit {
            sum: cost * self.samples(),
            positions: Vec::new(),
        }))
    }
}

/// The next position to try: by the secant where both sides of the level are known, else further
/// out in proportion, four times as far at the most.
fn between(start: f64, inside: TriedPosition, outside: Option<TriedPosition>) -> f64 {
    match outside {
        Some(outside) if outside.root.is_finite() => {
            let share = (1.0 - inside.root) / (outside.root - inside.root);
            inside.position + (outside.position - inside.position) * share.clamp(0.05, 0.95)
        }
        Some(outside) => 0.5 * (inside.position + outside.position),
        None => start + (inside.position - start) * (1.02 / inside.root).min(4.0),
    }
}

/// The problem with a coordinate that is no longer unknown.
fn without(problem: &Problem, coordinate: usize) -> Problem {
    let mut reduced = problem.clone();
    reduced.coordinates.remove(coordinate);
    reduced
}

/// Holds the coordinate at a position.
fn hold(reduced: &mut Problem, problem: &Problem, coordinate: usize, position: f64) {
    let held = &problem.coordinates[coordinate];
    let value = held.value(position);
    match held.target {
        Target::Parameter(index) => reduced.parameters[index] = value,
        Target::ExperimentParameter {
            experiment,
            parameter,
        } => {
            let experiments = Arc::make_mut(&mut reduced.experiments);
            experiments[experiment].parameters.push((parameter, value));
        }
        Target::InitialState { experiment, state } => {
            let experiments = Arc::make_mut(&mut reduced.experiments);
            experiments[experiment].initial_state[state] = Some(value);
        }
    }
}
