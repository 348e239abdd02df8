//! The part of the search box in which all constraints of a problem hold.
//!
//! Everything here is a function of the problem and the positions alone. Where a problem has no
//! constraints nothing changes a bit.

use super::problem::{Problem, Target};
use greybox_numerics::inequalities::{Inequality, shortest};
use greybox_numerics::least_squares::Triangle;
use greybox_numerics::rng::{self, Purpose, stream};
use greybox_simulation::model::document::Condition;

/// A constraint holds that is broken by less than this share of a search range.
const TOLERANCE: f64 = 1e-10;
/// How far a difference goes to a side, as a share of the search range.
const SHIFT: f64 = 1e-6;
/// Steps towards the nearest point where all constraints hold, and halvings of a line to one.
const MOST_STEPS: usize = 60;
/// Points among which one is looked for where all constraints hold.
const POINTS: u32 = 20_000;
/// Points where all constraints hold that are compared.
const ENOUGH: usize = 200;

/// A constraint linearised: how much is left, and its derivatives by the positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// The larger side less the smaller one.
    pub slack: f64,
    /// The derivative of the slack by each position.
    pub slopes: Vec<f64>,
    /// The place of the constraint among those of the problem.
    pub constraint: usize,
}

impl Limit {
    /// How far the border is, as a share of the search ranges; below 0 beyond it.
    #[must_use]
    pub fn distance(&self) -> f64 {
        let steepness = self.slopes.iter().map(|slope| slope * slope).sum::<f64>();
        self.slack / steepness.sqrt()
    }

    /// The inequality of a step from here that does not break the constraint.
    #[must_use]
    pub fn inequality(&self) -> Inequality {
        Inequality {
            row: self.slopes.clone(),
            least: -self.slack,
        }
    }
}

/// The constraints linearised at a candidate, those without an unknown left out; an experiment
/// with parameters of its own has its own.
#[must_use]
pub fn limits(problem: &Problem, positions: &[f64]) -> Vec<Limit> {
    let of = |(constraint, experiment): (usize, usize)| {
        let condition = &problem.constraints[constraint];
        let slack = |positions: &[f64]| slack(problem, condition, experiment, positions);
        let slope = |index: usize| {
            let mut moved = positions.to_vec();
            let ends = [-SHIFT, SHIFT].map(|shift| (positions[index] + shift).clamp(0.0, 1.0));
            let [low, high] = ends.map(|end| {
                moved[index] = end;
                slack(&moved)
            });
            (high - low) / (ends[1] - ends[0])
        };
        let limit = Limit {
            slack: slack(positions),
            slopes: (0..positions.len()).map(slope).collect(),
            constraint,
        };
        let is_steep = limit.slopes.iter().any(|slope| *slope != 0.0);
        is_steep.then_some(limit)
    };
    places(problem).filter_map(of).collect()
}

/// Whether all constraints hold.
#[must_use]
pub fn holds(problem: &Problem, positions: &[f64]) -> bool {
    let is_met = |(constraint, experiment): (usize, usize)| {
        slack(
            problem,
            &problem.constraints[constraint],
            experiment,
            positions,
        ) >= 0.0
    };
    let limits = || limits(problem, positions);
    places(problem).all(is_met) || limits().iter().all(|limit| limit.distance() >= -TOLERANCE)
}

/// Which constraints are asked in which experiments.
fn places(problem: &Problem) -> impl Iterator<Item = (usize, usize)> {
    let is_of_experiments = |parameter: &usize| {
        let coordinates = problem.coordinates.iter();
        let mut targets = coordinates.map(|coordinate| coordinate.target);
        let is_estimated = |target: Target| matches!(target, Target::ExperimentParameter { parameter: estimated, .. } if estimated == *parameter);
        let experiments = problem.experiments.iter();
        let mut given = experiments.flat_map(|experiment| &experiment.parameters);
        targets.any(is_estimated) || given.any(|(index, _)| index == parameter)
    };
    let constraints = problem.constraints.iter().enumerate();
    constraints.flat_map(move |(constraint, condition)| {
        let experiments = match condition.parameters().iter().any(is_of_experiments) {
            true => problem.experiments.len(),
            false => 1,
        };
        (0..experiments).map(move |experiment| (constraint, experiment))
    })
}

fn slack(problem: &Problem, condition: &Condition, experiment: usize, positions: &[f64]) -> f64 {
    let slack = condition.slack(&problem.fill(experiment, positions).parameters);
    if slack.is_nan() {
        f64::NEG_INFINITY
    } else {
        slack
    }
}

/// [`inside`], where there are constraints.
#[must_use]
pub fn inside_of_constraints(problem: &Problem) -> Option<Vec<f64>> {
    let has_some = !problem.constraints.is_empty();
    has_some.then(|| inside(problem)).flatten()
}

/// A point where all constraints hold, as far from their borders as any of many; none where none
/// was found.
#[must_use]
pub fn inside(problem: &Problem) -> Option<Vec<f64>> {
    let n = problem.coordinates.len();
    let mut rng = stream(0, 0, Purpose::Constraints);
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut feasible = 0;
    for point in 0..POINTS {
        let positions = match point {
            0 => vec![0.5; n],
            _ => (0..n).map(|_| rng::unit(&mut rng)).collect(),
        };
        let positions = match holds(problem, &positions) {
            true => positions,
            // Where the part is thin no point falls into it by chance.
            false if best.is_none() && point % 100 == 0 => match approached(problem, &positions) {
                Some(positions) => positions,
                None => continue,
            },
            false => continue,
        };
        let limits = limits(problem, &positions);
        let distances = limits.iter().map(Limit::distance);
        let distance = distances.fold(f64::INFINITY, f64::min);
        if best.as_ref().is_none_or(|(most, _)| distance > *most) {
            best = Some((distance, positions));
        }
        feasible += 1;
        if feasible >= ENOUGH {
            break;
        }
    }
    best.map(|(_, positions)| positions)
}

/// A candidate where all constraints hold: itself, or else its mirror image on the line to a point
/// `inside`, as far behind the border as it is in front of it.
#[must_use]
pub fn mirrored(problem: &Problem, inside: Option<&[f64]>, positions: Vec<f64>) -> Vec<f64> {
    let Some(inside) = inside.filter(|_| !problem.constraints.is_empty()) else {
        return positions;
    };
    if holds(problem, &positions) {
        return positions;
    }
    let border = border(problem, inside, &positions);
    let image = on_line(&positions, inside, border + (1.0 - border) * border);
    match holds(problem, &image) {
        true => image,
        false => on_line(&positions, inside, border),
    }
}

/// How far to go from a candidate towards a point inside, as a share of the way, until all hold.
fn border(problem: &Problem, inside: &[f64], positions: &[f64]) -> f64 {
    let (mut outer, mut inner) = (0.0, 1.0);
    for _ in 0..MOST_STEPS {
        let middle = 0.5 * (outer + inner);
        match holds(problem, &on_line(positions, inside, middle)) {
            true => inner = middle,
            false => outer = middle,
        }
    }
    inner
}

fn on_line(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    let pairs = from.iter().zip(to);
    pairs.map(|(a, b)| a + share * (b - a)).collect()
}

/// The nearest point where all constraints hold: the candidate itself, if they do; none where
/// there is none.
#[must_use]
pub fn nearest(problem: &Problem, positions: Vec<f64>) -> Option<Vec<f64>> {
    if problem.constraints.is_empty() || holds(problem, &positions) {
        return Some(positions);
    }
    if let Some(near) = approached(problem, &positions) {
        return Some(near);
    }
    let inside = inside(problem)?;
    let border = border(problem, &inside, &positions);
    Some(on_line(&positions, &inside, border))
}

/// The coordinates that a step may move: not those at a bound that are drawn beyond it.
#[must_use]
pub fn movable(triangle: &Triangle, positions: &[f64]) -> Vec<bool> {
    let gradient = triangle.gradient();
    let pairs = positions.iter().zip(gradient.iter());
    let is_held =
        |(z, slope): (&f64, &f64)| (*z <= 0.0 && *slope > 0.0) || (*z >= 1.0 && *slope < 0.0);
    pairs.map(|pair| !is_held(pair)).collect()
}

/// By the shortest steps to where the linearised constraints hold.
fn approached(problem: &Problem, positions: &[f64]) -> Option<Vec<f64>> {
    let mut at = positions.to_vec();
    for _ in 0..MOST_STEPS {
        let limits = limits(problem, &at);
        let inequalities = inequalities(&limits, &at);
        let step = shortest(at.len(), &inequalities)?;
        for (position, step) in at.iter_mut().zip(step.iter()) {
            *position = (*position + step).clamp(0.0, 1.0);
        }
        if holds(problem, &at) {
            return Some(at);
        }
    }
    None
}

/// That a step from here breaks no limit and does not leave the box.
#[must_use]
pub fn inequalities(limits: &[Limit], positions: &[f64]) -> Vec<Inequality> {
    let n = positions.len();
    let axis = |index: usize, side: f64| {
        let mut row = vec![0.0; n];
        row[index] = side;
        row
    };
    let sides = positions.iter().enumerate().flat_map(|(index, position)| {
        let ahead = (axis(index, -1.0), position - 1.0);
        let back = (axis(index, 1.0), -position);
        [ahead, back].map(|(row, least)| Inequality { row, least })
    });
    limits.iter().map(Limit::inequality).chain(sides).collect()
}
