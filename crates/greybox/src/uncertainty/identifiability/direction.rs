//! Directions in which unknowns move together, and their names.

use crate::estimation::problem::{Coordinate, Problem};
use greybox_simulation::model::Scale;

/// Unknowns with a smaller part in a direction than this share of the largest are left out of it.
const SMALLEST_PART: f64 = 0.05;

/// Powers with which unknowns are multiplied in the equations of plants.
const USUAL_RATIOS: [f64; 5] = [1.0, 2.0, 0.5, 3.0, 1.0 / 3.0];

/// A ratio of powers is a usual one within this share.
const USUAL: f64 = 0.02;

/// A direction that the data do not see.
#[derive(Clone, Debug)]
pub struct FlatDirection {
    /// The coordinates that take part, by their places, with their exponents or (on a linear scale,
    /// where the direction is straight) their shares of the range; the largest is 1.
    pub parts: Vec<(usize, f64)>,
    /// In words, e.g. what a ratio keeps fixed.
    pub words: String,
}

impl FlatDirection {
    /// Whether several unknowns take part.
    #[must_use]
    pub fn is_combination(&self) -> bool {
        self.parts.len() > 1
    }
}

/// A direction in which unknowns move together.
#[derive(Clone, Debug)]
pub(super) struct Direction {
    form: Form,
    /// For each coordinate its part, of positions or as an exponent.
    parts: Vec<f64>,
}

/// What stays the same along a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// The way through the box: sums on linear scales, products of powers on log ones.
    Straight,
    /// The relative change of each value: products of powers on any scale.
    Powers,
}

impl Direction {
    /// The forms of a direction that is known at one point, the likelier first.
    pub(super) fn forms(problem: &Problem, at: &[f64], vector: &[f64]) -> Vec<Direction> {
        let straight = Direction {
            form: Form::Straight,
            parts: vector.to_vec(),
        };
        let powers = Direction::powers(problem, at, vector);
        let usual = powers.as_ref().and_then(|powers| powers.usual(problem));
        usual.into_iter().chain(powers).chain([straight]).collect()
    }

    /// The direction of the usual powers that are next to its own, where all are so near that the
    /// difference may be rounding.
    fn usual(&self, problem: &Problem) -> Option<Direction> {
        let mut parts = vec![0.0; self.parts.len()];
        for (index, part) in self.largest_parts(problem) {
            parts[index] = usual(part.abs())?.copysign(part);
        }
        Some(Direction {
            form: Form::Powers,
            parts,
        })
    }

    /// The likely form of a direction that is looked at in one point only: products of usual powers
    /// are no accident.
    pub(super) fn likely(problem: &Problem, at: &[f64], vector: &[f64]) -> Direction {
        let powers = Direction::powers(problem, at, vector);
        let is_usual = |powers: &Direction| powers.usual(problem).is_some();
        powers.filter(is_usual).unwrap_or_else(|| Direction {
            form: Form::Straight,
            parts: vector.to_vec(),
        })
    }

    /// A direction of powers of several unknowns, none of which may be zero. On log scales it is the
    /// straight one.
    fn powers(problem: &Problem, at: &[f64], vector: &[f64]) -> Option<Direction> {
        let exponent = |((coordinate, position), part): ((&Coordinate, &f64), &f64)| {
            let (value, slope) = (coordinate.value(*position), coordinate.slope(*position));
            match coordinate.lower * coordinate.upper > 0.0 {
                true => Some(part * slope / value),
                false => (part.abs() < SMALLEST_PART).then_some(0.0),
            }
        };
        let pairs = problem.coordinates.iter().zip(at).zip(vector);
        let direction = Direction {
            form: Form::Powers,
            parts: pairs.map(exponent).collect::<Option<_>>()?,
        };
        (direction.largest_parts(problem).len() > 1).then_some(direction)
    }

    /// The direction at a point, in positions and of length 1.
    pub(super) fn at(&self, problem: &Problem, positions: &[f64]) -> Vec<f64> {
        let pairs = problem.coordinates.iter().zip(positions).zip(&self.parts);
        let mut vector: Vec<f64> = match self.form {
            Form::Straight => self.parts.clone(),
            Form::Powers => pairs
                .map(|((coordinate, at), part)| {
                    part * coordinate.value(*at) / coordinate.slope(*at)
                })
                .collect(),
        };
        let length = vector.iter().map(|part| part * part).sum::<f64>().sqrt();
        vector.iter_mut().for_each(|part| *part /= length);
        vector
    }

    /// The parts that count, by their places, with their exponents or (on a linear scale, where the
    /// direction is straight) their shares of the range; the largest is 1.
    fn largest_parts(&self, problem: &Problem) -> Vec<(usize, f64)> {
        let step = |(coordinate, part): (&Coordinate, &f64)| match (self.form, coordinate.scale) {
            (Form::Straight, Scale::Log) => part * libm::log(coordinate.upper / coordinate.lower),
            (Form::Straight, Scale::Linear) | (Form::Powers, _) => *part,
        };
        let pairs = problem.coordinates.iter().zip(&self.parts);
        let steps: Vec<f64> = pairs.map(step).collect();
        let largest = steps
            .iter()
            .copied()
            .max_by(|a, b| a.abs().total_cmp(&b.abs()))
            .unwrap_or(1.0);
        let parts = steps.iter().map(|step| step / largest).enumerate();
        parts
            .filter(|(_, part)| part.abs() >= SMALLEST_PART)
            .collect()
    }

    /// The direction in the parameters' own terms: what moves, and what stays fixed meanwhile.
    pub(super) fn named(&self, problem: &Problem) -> FlatDirection {
        let parts = self.largest_parts(problem);
        let words = self.words(problem, &parts);
        FlatDirection { parts, words }
    }

    fn words(&self, problem: &Problem, parts: &[(usize, f64)]) -> String {
        let name = |index: usize| format!("`{}`", problem.coordinates[index].name);
        let is_power = |index: usize| {
            self.form == Form::Powers || problem.coordinates[index].scale == Scale::Log
        };
        if let &[(only, _)] = parts {
            return format!("the data hardly depend on {}: give its value", name(only));
        }
        let all_powers = parts.iter().all(|(index, _)| is_power(*index));
        if let (true, &[(first, a), (second, b)]) = (all_powers, parts) {
            let kept = match b / a {
                ratio if (ratio - 1.0).abs() < 0.1 => format!("{}/{}", name(first), name(second)),
                ratio if (ratio + 1.0).abs() < 0.1 => format!("{}*{}", name(first), name(second)),
                ratio => format!("{}^{:.2}/{}", name(first), ratio, name(second)),
            };
            return format!("the data fix {kept}, not both: give one of them");
        }
        let moves: Vec<String> = parts
            .iter()
            .map(|&(index, part)| {
                if is_power(index) {
                    format!("{}^{part:.2}", name(index))
                } else {
                    format!("{part:+.2} of the range of {}", name(index))
                }
            })
            .collect();
        format!(
            "{} can change together ({}) and the outputs stay as they are: give one of them, or \
             measure one more output",
            parts
                .iter()
                .map(|(index, _)| name(*index))
                .collect::<Vec<_>>()
                .join(", "),
            moves.join(", ")
        )
    }
}

/// The usual ratio of powers that a ratio is near.
fn usual(ratio: f64) -> Option<f64> {
    let is_near = |usual: &f64| (ratio / usual - 1.0).abs() < USUAL;
    USUAL_RATIOS.into_iter().find(is_near)
}
