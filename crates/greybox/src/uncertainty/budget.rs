//! The uncertainty budget: what is taken as known, how well, and what that does to the estimate.
//!
//! Every assumption ([`Assumption`]) is moved like an unknown, by a tenth of its tolerance, in the
//! same batch of simulations; an effect that is off can only be moved to the side on which it is
//! possible. What follows is linear algebra ([`super::joint`]); where residuals have a memory, the
//! rows from which assumptions are judged are filtered first ([`super::weighing`]).

use super::joint::{Joint, LARGEST_SCORE, Score};
use super::sensors::Sensors;
use super::weighing::{Seen, Weighing};
use crate::estimation::problem::{Assumption, Coordinate, Problem, Target};
use crate::estimation::sensitivity::{Directions, Neighbourhood, Row, SHIFT, Sides};
use greybox_simulation::model::Scale;
use greybox_simulation::{Accuracy, SimulationFailure};
use nalgebra::DMatrix;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// An unknown is moved by this share of its range: where a kink of the plant falls between two
/// neighbours, its jump is divided by the way between them, and with a hundredth of this way one
/// derivative was off by up to 5 % in two of 240 jobs (`benches/studies/false_high.py`).
const MOVE: f64 = 1e-4;
/// Where there are fewer residuals, curvature over that step may show.
const FEW_RESIDUALS: usize = 1000;
/// An assumption is moved by this share of its tolerance.
const STEP: f64 = 0.1;
/// It is moved within this many tolerances of its value.
const ROOM: f64 = 5.0;
/// Simulated values that are held and gone through at once at the most, so that a stop is heard in
/// time; a record that takes more has no budget.
const MOST_VALUES: usize = 20_000_000;
/// What knowing an assumption so many times better would bring is told.
pub const BETTER: f64 = 5.0;

/// The budget of an estimate.
#[derive(Clone, Debug, Default)]
pub struct Budget {
    /// For each coordinate the standard deviation of its error with all that is assumed, as a
    /// share of its search range; none where there is none of noise alone.
    pub totals: Vec<Option<f64>>,
    /// One for each assumption.
    pub lines: Vec<Line>,
    /// The covariance that the data and the tolerances leave of the assumptions, in standard
    /// deviations of their tolerances; none without assumptions.
    pub covariance: Option<DMatrix<f64>>,
    /// The covariance that noise alone gives the unknowns by way of the assumptions, positions; none
    /// where all assumptions are held at their declared values.
    pub noise_by_assumptions: Option<DMatrix<f64>>,
    /// Whether there are assumptions that nothing is said of: the record is too long to hold the
    /// simulations of all, or the run was stopped.
    pub is_left_out: bool,
}

/// What one assumption does.
#[derive(Clone, Debug)]
pub struct Line {
    /// The assumption.
    pub assumption: Assumption,
    /// How many standard deviations the residuals pull at the declared value; none where they cannot see it apart
    /// from the unknowns, or there are no residuals yet.
    pub score: Option<f64>,
    /// The value that would explain what is left, with its standard error, SI.
    pub suggested: Option<(f64, f64)>,
    /// Where the data and all tolerances together put it, with its standard deviation, SI; none
    /// before anything is estimated.
    pub posterior: Option<(f64, f64)>,
    /// Whether the residuals pull at it by more than noise and tolerances allow.
    pub is_pulled: bool,
    /// What could be off without being noticed, SI; none where anything could.
    pub unnoticed: Option<f64>,
    /// For each coordinate what it contributes; none where the data do not fix the coordinates.
    pub contributions: Vec<Option<Contribution>>,
}

/// Under a noise model an effect that would explain no more of the residuals' mean square than this share is a
/// detail of the model: in a long record every detail is beyond chance.
pub(super) const SLIGHT_SHARE: f64 = 0.04;

/// What an assumption contributes to a coordinate, positions.
#[derive(Clone, Copy, Debug)]
pub struct Contribution {
    /// The standard deviation.
    pub deviation: f64,
    /// The share of the total's square: below zero where it makes up for another assumption.
    pub share: f64,
    /// How far the coordinate moves where the assumption is off by its tolerance.
    pub per_tolerance: f64,
    /// What the total would be, were the tolerance [`BETTER`] times smaller.
    pub total_if_better: f64,
}

impl Line {
    /// How far a coordinate would move, were the suggested value taken.
    #[must_use]
    pub fn suggested_move(&self, coordinate: usize) -> Option<f64> {
        let (value, _) = self.suggested?;
        let tolerances = (value - self.assumption.value) / self.assumption.tolerance;
        Some(self.contributions[coordinate]?.per_tolerance * tolerances)
    }

    /// Twice the logarithm of how much likelier the data and the tolerance together make the
    /// suggested value than the declared one.
    #[must_use]
    pub fn likelihood(&self) -> f64 {
        let tolerances = self.suggested.map_or(0.0, |(value, _)| {
            (value - self.assumption.value) / self.assumption.tolerance
        });
        self.score.map_or(0.0, |score| score * score) - tolerances * tolerances
    }

    /// The share of the residuals' mean square that the suggested value would explain, of so many residuals; 0
    /// where the residuals say nothing of it.
    #[must_use]
    pub fn explained_share(&self, n_residuals: usize) -> f64 {
        self.score
            .map_or(0.0, |score| score * score / n_residuals.max(1) as f64)
    }

    /// Whether the residuals contradict the declared value: they pull by more than noise and
    /// tolerances allow, and to where the number can be.
    #[must_use]
    pub fn is_contradicted(&self) -> bool {
        let [lower, upper] = self.assumption.limits;
        let possible = |(value, error): (f64, f64)| {
            lower.is_none_or(|lower| value + error >= lower)
                && upper.is_none_or(|upper| value - error <= upper)
        };
        self.is_pulled && self.suggested.is_some_and(possible)
    }
}

/// A problem whose assumptions are unknowns too, behind its own.
#[derive(Debug)]
pub struct Extended {
    problem: Problem,
    positions: Vec<f64>,
    unknowns: usize,
    /// Whether assumptions are left out.
    is_cut: bool,
}

impl Extended {
    /// The problem with its assumptions; without them where the record is too long to hold the
    /// simulations of all.
    #[must_use]
    pub fn new(problem: &Problem, positions: &[f64], with_assumptions: bool) -> Extended {
        let samples: usize = problem
            .experiments
            .iter()
            .map(|data| data.estimation_samples)
            .sum();
        let candidates = 1 + 2 * (problem.coordinates.len() + problem.assumptions.len());
        let values = samples * problem.outputs.len() * candidates;
        let mut extended = Extended {
            problem: problem.clone(),
            positions: positions.to_vec(),
            unknowns: positions.len(),
            is_cut: false,
        };
        if !with_assumptions || values > MOST_VALUES {
            extended.is_cut = !problem.assumptions.is_empty();
            extended.problem.assumptions = Arc::default();
            return extended;
        }
        for assumption in problem.assumptions.iter() {
            let Some(target) = assumption.target.simulated() else {
                continue;
            };
            let coordinate = coordinate(assumption, target);
            let (lower, upper) = (coordinate.lower, coordinate.upper);
            let position = coordinate.scale.position(assumption.taken, lower, upper);
            extended.positions.push(position);
            extended.problem.coordinates.push(coordinate);
            if let Target::InitialState { experiment, state } = target {
                // A start that is given stands before a coordinate.
                let experiments = Arc::make_mut(&mut extended.problem.experiments).iter_mut();
                let concerned = experiments.filter(|data| data.place == experiment);
                concerned.for_each(|data| data.initial_state[state] = None);
            }
        }
        extended
    }

    /// Simulates the candidate with all neighbours. Answers nothing when `stop` was raised.
    #[must_use]
    pub fn around(&self, accuracy: Accuracy, stop: &AtomicBool) -> Option<Around<'_>> {
        let n = self.positions.len();
        let length = |index: usize| match index.checked_sub(self.unknowns) {
            None => 1.0,
            Some(assumption) => {
                let coordinate = &self.problem.coordinates[index];
                let tolerance = self.assumptions()[assumption].tolerance;
                STEP * tolerance / (coordinate.upper - coordinate.lower) / self.step()
            }
        };
        let vectors: Vec<Vec<f64>> = (0..n)
            .map(|index| {
                let mut vector = vec![0.0; n];
                vector[index] = length(index);
                vector
            })
            .collect();
        let directions = Directions {
            from: &self.positions,
            vectors: &vectors,
            shift: self.step(),
            sides: match accuracy {
                Accuracy::Ranking | Accuracy::Screening => Sides::One,
                Accuracy::Full | Accuracy::Reference => Sides::Both,
            },
        };
        let simulated = (accuracy, stop);
        Some(Around {
            neighbourhood: Neighbourhood::simulate(&self.problem, directions, &[], simulated)?,
            sensors: Sensors::simulate(&self.problem, &self.positions, stop)?,
        })
    }

    /// The assumptions with their tolerances: nothing where the record is too long.
    pub(super) fn assumptions(&self) -> &[Assumption] {
        &self.problem.assumptions
    }

    /// How far an unknown is moved.
    fn step(&self) -> f64 {
        match self.problem.n_residuals() {
            ..=FEW_RESIDUALS => SHIFT,
            _ => MOVE,
        }
    }
}

/// A candidate with all that is assumed moved a little.
#[derive(Debug)]
pub struct Around<'a> {
    /// Moved along the unknowns and what is assumed of the model.
    pub neighbourhood: Neighbourhood<'a>,
    sensors: Sensors,
}

impl Around<'_> {
    /// The derivatives of a row: those by the unknowns, then those by standard deviations of the
    /// assumptions' tolerances.
    pub fn columns<'r>(
        &'r self,
        extended: &'r Extended,
        row: &'r Row<'_>,
    ) -> impl Iterator<Item = f64> + 'r {
        let (unknowns, per_tolerance) = (extended.unknowns, extended.step() / STEP);
        let columns = row.derivatives.iter().enumerate();
        let columns = columns.map(move |(index, derivative)| match index < unknowns {
            true => *derivative,
            // A neighbour that cannot be simulated says nothing.
            false if derivative.is_nan() => 0.0,
            false => derivative * per_tolerance,
        });
        let place = row.place();
        let scale = self.neighbourhood.scale(place);
        let simulated = extended.positions.len() - unknowns;
        let measured = extended.assumptions()[simulated..].iter();
        let measured = measured.map(move |assumption| {
            // A sensor does next to nothing to the variance of an innovation.
            if row.is_variance {
                return 0.0;
            }
            let by_value = self
                .sensors
                .derivative(&extended.problem, assumption.target, place);
            -by_value * assumption.tolerance / scale
        });
        columns.chain(measured)
    }

    /// The simulation as sensors and clock change it.
    pub(super) fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Whether nothing can be said of an assumption, by its place.
    pub(super) fn fails(&self, extended: &Extended, place: usize) -> bool {
        let simulated = extended.assumptions()[place].target.simulated();
        simulated.is_some() && self.neighbourhood.fails_along(extended.unknowns + place)
    }
}

fn coordinate(assumption: &Assumption, target: Target) -> Coordinate {
    let [least, most] = assumption.limits;
    let (value, room) = (assumption.taken, ROOM * assumption.tolerance);
    Coordinate {
        name: assumption.name.clone(),
        quantity: assumption.name.clone(),
        symbol: String::new(),
        unit: assumption.unit.clone(),
        target,
        lower: least.map_or(value - room, |least| least.max(value - room)),
        upper: most.map_or(value + room, |most| most.min(value + room)),
        scale: Scale::Linear,
        start: None,
        prior: None,
    }
}

impl Budget {
    /// The budget of an estimate; `moved` is how far each unknown lies from the estimate with all declared
    /// values, positions.
    ///
    /// # Errors
    /// How the estimate or a neighbour along an unknown failed.
    pub fn of(
        extended: &Extended,
        around: &Around<'_>,
        seen: Seen<'_>,
        moved: Option<Vec<f64>>,
    ) -> Result<Budget, SimulationFailure> {
        let unknowns = extended.unknowns;
        let noise: Vec<Option<f64>> = (0..unknowns)
            .map(|index| seen.linear.deviation(index).map(|noise| noise * noise))
            .collect();
        let weighing = Weighing::of(&extended.problem, seen);
        let joint = gather(extended, around, weighing)?.map(|joint| joint.moved(moved));
        Ok(Budget::from(extended, around, joint.as_ref(), &noise, true))
    }

    /// The budget that is to be expected at a point of the search box, before anything is
    /// estimated: residuals of noise alone.
    ///
    /// # Errors
    /// As for [`Budget::of`].
    pub fn foretold(
        extended: &Extended,
        around: &Around<'_>,
        weights: &[f64],
        deviations: &[f64],
    ) -> Result<Budget, SimulationFailure> {
        let joint = gather(extended, around, Weighing::of_noise_alone(weights))?;
        let joint = joint.map(Joint::of_noise_alone);
        let noise: Vec<Option<f64>> = deviations
            .iter()
            .map(|noise| Some(noise * noise).filter(|square| square.is_finite()))
            .collect();
        Ok(Budget::from(
            extended,
            around,
            joint.as_ref(),
            &noise,
            false,
        ))
    }

    fn from(
        extended: &Extended,
        around: &Around<'_>,
        joint: Option<&Joint>,
        noise: &[Option<f64>],
        has_residuals: bool,
    ) -> Budget {
        let total = |index: usize| {
            let noise = noise[index].filter(|_| !extended.is_cut)?;
            let total = match joint {
                Some(joint) => joint.total(index, noise)?,
                None => noise,
            };
            Some(total.sqrt())
        };
        let totals: Vec<Option<f64>> = (0..extended.unknowns).map(total).collect();
        let line = |(place, assumption): (usize, &Assumption)| {
            let joint = joint.filter(|_| !around.fails(extended, place));
            let score = joint.and_then(|joint| joint.score(place));
            let score = score.filter(|_| has_residuals);
            let size = assumption.tolerance;
            let value = |Score { suggested, .. }: Score| {
                (assumption.value + suggested.0 * size, suggested.1 * size)
            };
            Line {
                score: score.map(|score| score.t),
                suggested: score.map(value),
                posterior: joint.filter(|_| has_residuals).map(|joint| {
                    let (shift, deviation) = joint.posterior(place);
                    (assumption.value + shift * size, deviation * size)
                }),
                is_pulled: score.is_some() && joint.is_some_and(|joint| joint.contradicts(place)),
                unnoticed: joint
                    .and_then(|joint| joint.unnoticed(place, LARGEST_SCORE))
                    .map(|tolerances| tolerances * size),
                contributions: (0..extended.unknowns)
                    .map(|unknown| {
                        let (noise, total) = (noise[unknown]?, totals[unknown]?);
                        let joint = joint?;
                        let (deviation, variance) = joint.contribution(unknown, place)?;
                        let better = joint.total_with(unknown, noise, place, 1.0 / BETTER)?;
                        Some(Contribution {
                            deviation,
                            share: variance / (total * total),
                            per_tolerance: joint.move_by(unknown, place)?,
                            total_if_better: better.sqrt(),
                        })
                    })
                    .collect(),
                assumption: assumption.clone(),
            }
        };
        let lines = extended.assumptions().iter().enumerate();
        Budget {
            lines: lines.map(line).collect(),
            covariance: joint.map(|joint| joint.posterior_covariance().clone()),
            noise_by_assumptions: joint
                .filter(|_| {
                    extended
                        .assumptions()
                        .iter()
                        .any(|assumption| assumption.off() != 0.0)
                })
                .and_then(Joint::noise_by_assumptions),
            is_left_out: extended.is_cut,
            totals,
        }
    }
}

/// The unknowns and the assumptions, linearised; none without assumptions.
///
/// # Errors
/// How the candidate or a neighbour along an unknown failed.
pub(super) fn gather(
    extended: &Extended,
    around: &Around<'_>,
    weighing: Weighing,
) -> Result<Option<Joint>, SimulationFailure> {
    let unknowns = extended.unknowns;
    let n = unknowns + extended.assumptions().len();
    if n == unknowns {
        return Ok(None);
    }
    let columns = |row: &Row<'_>| around.columns(extended, row).collect();
    let (plain, white) = weighing.triangles(&around.neighbourhood, unknowns, n, columns)?;
    let off: Vec<f64> = extended.assumptions().iter().map(Assumption::off).collect();
    Ok(Joint::new(&plain, &white, &off))
}
