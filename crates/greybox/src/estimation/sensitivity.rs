//! How the residuals move with the coordinates, by central differences; by differences to one side
//! where half as many candidates tell as much.
//!
//! All columns are simulated together as one batch, with the same integration steps, so that the
//! differences are those of the equations and not of the step control. Positions, not values,
//! are shifted: what comes out is ∂residual/∂position.

mod judged;
mod recorded;

use super::feasible::{self, Limit};
use super::loss::Loss;
use super::prior::PriorRow;
use super::problem::Problem;
use greybox_simulation::{Accuracy, SimulationFailure};
use recorded::record;
pub use recorded::{Columns, record_runs};
use std::sync::atomic::AtomicBool;

/// How far a difference goes to a side, as a share of the search range. All lanes take the same
/// steps, so that only rounding, and a kink that falls between two of them, count against a short
/// one; a long one sees the curvature and where commands saturate and ports open.
pub const SHIFT: f64 = 1e-6;

/// One residual and its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// The experiment.
    pub experiment: usize,
    /// The output, by its place in the problem.
    pub output: usize,
    /// The sample.
    pub sample: usize,
    /// Whether the row is the second of an innovation, which tells whether its variance is right.
    pub is_variance: bool,
    /// (measured − simulated)/scale.
    pub residual: f64,
    /// ∂residual/∂position of each coordinate, or along each direction.
    pub derivatives: &'a [f64],
}

impl Row<'_> {
    /// Which residual the row has.
    #[must_use]
    pub fn place(&self) -> ResidualPlace {
        ResidualPlace {
            experiment: self.experiment,
            sample: self.sample,
            output: self.output,
        }
    }
}

/// A residual of a problem, by the places of its experiment, its sample and its output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResidualPlace {
    /// The experiment.
    pub experiment: usize,
    /// The sample.
    pub sample: usize,
    /// The output.
    pub output: usize,
}

/// Along what a problem is differentiated.
#[derive(Clone, Copy, Debug)]
pub struct Directions<'a> {
    /// A point of the search box.
    pub from: &'a [f64],
    /// Vectors of the search box.
    pub vectors: &'a [Vec<f64>],
    /// How much of each vector is gone to a side.
    pub shift: f64,
    /// Whether to both sides, or to the one with more room alone.
    pub sides: Sides,
}

/// Where a difference is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// To both sides, as far as the box allows.
    Both,
    /// To the side with more room: half as many candidates.
    One,
}

impl Sides {
    /// How many candidates differences along so many directions take, the one in the middle
    /// included.
    #[must_use]
    pub fn candidates(self, directions: usize) -> u64 {
        let neighbours = match self {
            Sides::Both => 2,
            Sides::One => 1,
        };
        1 + neighbours * directions as u64
    }
}

/// The unit vectors of `n` coordinates.
fn axes(n: usize) -> Vec<Vec<f64>> {
    let part = |axis, index| if index == axis { 1.0 } else { 0.0 };
    let axis = |axis| (0..n).map(|index| part(axis, index)).collect();
    (0..n).map(axis).collect()
}

/// Why there are no derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SensitivityError {
    /// The stop flag was raised.
    #[error("interrupted")]
    Interrupted,
    /// The candidate itself, or its neighbour along a coordinate, cannot be simulated.
    #[error("the simulation near the estimate fails ({0:?})")]
    Failed(SimulationFailure),
}

/// Visits every residual that the problem is estimated from, sample by sample, with its
/// derivatives by the coordinates.
///
/// # Errors
/// When the stop flag was raised, or a simulation failed.
pub fn visit_rows(
    problem: &Problem,
    positions: &[f64],
    accuracy: Accuracy,
    stop: &AtomicBool,
    visit: impl FnMut(Row<'_>),
) -> Result<(), SensitivityError> {
    around(problem, positions, accuracy, stop)
        .ok_or(SensitivityError::Interrupted)?
        .visit(visit)
        .map_err(SensitivityError::Failed)
}

/// Visits every residual that the problem is estimated from, sample by sample, with its
/// derivatives along given directions of the box.
///
/// # Errors
/// As [`visit_rows`].
pub fn visit_directions(
    problem: &Problem,
    directions: Directions<'_>,
    accuracy: Accuracy,
    stop: &AtomicBool,
    visit: impl FnMut(Row<'_>),
) -> Result<(), SensitivityError> {
    Neighbourhood::simulate(problem, directions, &[], (accuracy, stop))
        .ok_or(SensitivityError::Interrupted)?
        .visit(visit)
        .map_err(SensitivityError::Failed)
}

/// A candidate with its neighbours along every coordinate, to one side where the simulation is
/// coarse. Answers nothing when the stop flag was raised.
#[must_use]
pub fn around<'a>(
    problem: &'a Problem,
    positions: &[f64],
    accuracy: Accuracy,
    stop: &AtomicBool,
) -> Option<Neighbourhood<'a>> {
    let sides = match accuracy {
        Accuracy::Ranking | Accuracy::Screening => Sides::One,
        Accuracy::Full | Accuracy::Reference => Sides::Both,
    };
    Neighbourhood::along_axes(problem, (positions, sides), &[], (accuracy, stop))
}

/// A candidate and its neighbours, simulated together with others that shall be compared.
#[derive(Debug)]
pub struct Neighbourhood<'a> {
    problem: &'a Problem,
    differences: Vec<Difference>,
    /// The neighbours that each difference is between.
    ends: Vec<(usize, usize)>,
    first_other: usize,
    /// The candidate first, then its neighbours, then the others.
    candidates: Vec<Vec<f64>>,
    recorded: Vec<Columns>,
}

impl<'a> Neighbourhood<'a> {
    /// Simulates a candidate, its neighbours along every coordinate, and others. Answers nothing
    /// when the stop flag was raised.
    #[must_use]
    pub fn along_axes(
        problem: &'a Problem,
        (positions, sides): (&[f64], Sides),
        others: &[Vec<f64>],
        simulated: (Accuracy, &AtomicBool),
    ) -> Option<Neighbourhood<'a>> {
        let axes = axes(positions.len());
        let axes = Directions {
            from: positions,
            vectors: &axes,
            shift: SHIFT,
            sides,
        };
        Neighbourhood::simulate(problem, axes, others, simulated)
    }

    /// Simulates them, the neighbours with the steps that the candidate needs. Answers nothing
    /// when the stop flag was raised.
    #[must_use]
    pub fn simulate(
        problem: &'a Problem,
        directions: Directions<'_>,
        others: &[Vec<f64>],
        (accuracy, stop): (Accuracy, &AtomicBool),
    ) -> Option<Neighbourhood<'a>> {
        let Directions {
            from: positions,
            vectors,
            shift,
            sides,
        } = directions;
        let differences: Vec<Difference> = vectors
            .iter()
            .map(|direction| Difference::along(direction, positions, shift, sides))
            .collect();
        let (mut candidates, ends) = shifted_candidates(positions, vectors, &differences);
        let first_other = candidates.len();
        candidates.extend_from_slice(others);
        let recorded = record(problem, &candidates, first_other, accuracy, stop)?;
        let mut neighbourhood = Neighbourhood {
            problem,
            differences,
            ends,
            first_other,
            candidates,
            recorded,
        };
        neighbourhood.end_where_simulations_end();
        Some(neighbourhood)
    }

    /// Has a difference end at the candidate on the side where its neighbour cannot be simulated: at the edge
    /// of what a model can do the other side alone tells the derivative.
    fn end_where_simulations_end(&mut self) {
        for place in 0..self.ends.len() {
            let (low, high) = self.ends[place];
            let (fails_back, fails_ahead) =
                (self.failure(low).is_some(), self.failure(high).is_some());
            if fails_back && !fails_ahead && high != 0 {
                self.ends[place].0 = 0;
                self.differences[place].back = 0.0;
            } else if fails_ahead && !fails_back && low != 0 {
                self.ends[place].1 = 0;
                self.differences[place].ahead = 0.0;
            }
        }
    }

    /// How much a residual counts.
    #[must_use]
    pub fn loss(&self) -> Loss {
        self.problem.loss
    }

    /// How many derivatives each residual has.
    #[must_use]
    pub fn n_columns(&self) -> usize {
        self.differences.len()
    }

    /// The residuals of the priors at the candidate ([`Problem::prior_rows`]).
    pub fn prior_rows(&self) -> Vec<PriorRow> {
        self.problem.prior_rows(&self.candidates[0])
    }

    /// The constraints linearised at the candidate.
    #[must_use]
    pub fn limits(&self) -> Vec<Limit> {
        feasible::limits(self.problem, &self.candidates[0])
    }

    /// Whether a neighbour along a direction cannot be simulated.
    #[must_use]
    pub fn fails_along(&self, direction: usize) -> bool {
        let (low, high) = self.ends[direction];
        self.failure(low).or(self.failure(high)).is_some()
    }

    /// Visits every residual of the candidate, sample by sample, with its derivatives.
    ///
    /// # Errors
    /// How the candidate or a neighbour failed.
    pub fn visit(&self, visit: impl FnMut(Row<'_>)) -> Result<(), SimulationFailure> {
        self.visit_along(self.n_columns(), visit)
    }

    /// Visits every residual of the candidate, sample by sample, with its derivatives. Only the
    /// neighbours along the first `needed` directions have to be simulated: the derivatives along
    /// other directions that fail are no numbers.
    ///
    /// # Errors
    /// How the candidate or one of those neighbours failed.
    pub fn visit_along(
        &self,
        needed: usize,
        mut visit: impl FnMut(Row<'_>),
    ) -> Result<(), SimulationFailure> {
        let neighbours = self.ends[..needed]
            .iter()
            .flat_map(|(low, high)| [*low, *high]);
        let mut members = std::iter::once(0).chain(neighbours);
        if let Some(failure) = members.find_map(|member| self.failure(member)) {
            return Err(failure);
        }
        let mut derivatives = vec![0.0; self.differences.len()];
        for place in places(self.problem) {
            let Some(residual) = self.residual(0, place) else {
                continue;
            };
            let scale = self.scale_of(0, place);
            self.differentiate(place, place.output, scale, &mut derivatives);
            let row = Row {
                experiment: place.experiment,
                output: place.output,
                sample: place.sample,
                is_variance: false,
                residual,
                derivatives: &derivatives,
            };
            visit(row);
            if self.problem.innovations.is_some() {
                self.visit_variance(place, residual, &mut derivatives, &mut visit);
            }
        }
        Ok(())
    }

    /// Visits the second row of an innovation: with the first it makes the gradient and the expected
    /// information of −log L ([`Innovations`](super::problem::Innovations)).
    fn visit_variance(
        &self,
        place: ResidualPlace,
        innovation: f64,
        derivatives: &mut [f64],
        visit: &mut impl FnMut(Row<'_>),
    ) {
        let column = self.problem.outputs.len() + place.output;
        let variance = self.scale_of(0, place).powi(2);
        // `differentiate` gives the derivative of a residual, which falls where the column rises.
        let scale = -variance * std::f64::consts::SQRT_2;
        self.differentiate(place, column, scale, derivatives);
        visit(Row {
            experiment: place.experiment,
            output: place.output,
            sample: place.sample,
            is_variance: true,
            residual: (1.0 - innovation * innovation) * std::f64::consts::FRAC_1_SQRT_2,
            derivatives,
        });
    }

    /// The derivatives of −(recorded column)/scale along the directions.
    fn differentiate(
        &self,
        place: ResidualPlace,
        column: usize,
        scale: f64,
        derivatives: &mut [f64],
    ) {
        let recorded = &self.recorded[place.experiment];
        let at = |member| recorded.value(member, place.sample, column);
        let columns = self.differences.iter().zip(&self.ends);
        for (derivative, (difference, (low, high))) in derivatives.iter_mut().zip(columns) {
            *derivative = (at(*low) - at(*high)) / difference.length() / scale;
        }
    }

    fn residual(&self, member: usize, place: ResidualPlace) -> Option<f64> {
        let ResidualPlace {
            experiment,
            sample,
            output,
        } = place;
        let measured = self.problem.experiments[experiment].measured[output][sample];
        let simulated = self.recorded[experiment].value(member, sample, output);
        let scale = self.scale_of(member, place);
        (!measured.is_nan()).then(|| (measured - simulated) / scale)
    }

    /// What a candidate's residual is divided by: that of an innovation by its standard deviation.
    fn scale_of(&self, member: usize, place: ResidualPlace) -> f64 {
        if self.problem.innovations.is_none() {
            return self.scale_of_free_run(place);
        }
        let column = self.problem.outputs.len() + place.output;
        let variance = self.recorded[place.experiment].value(member, place.sample, column);
        variance.sqrt()
    }

    /// What the candidate's residual is divided by.
    #[must_use]
    pub fn scale(&self, place: ResidualPlace) -> f64 {
        self.scale_of(0, place)
    }

    fn scale_of_free_run(&self, place: ResidualPlace) -> f64 {
        let experiment = &self.problem.experiments[place.experiment];
        let weight = experiment.weight(place.output, place.sample);
        self.problem.outputs[place.output].residual_scale / weight
    }

    fn failure(&self, member: usize) -> Option<SimulationFailure> {
        let mut experiments = self.recorded.iter();
        experiments.find_map(|columns| columns.failures[member])
    }
}

/// Every residual that is estimated from, sample by sample.
fn places(problem: &Problem) -> impl Iterator<Item = ResidualPlace> {
    let n_outputs = problem.outputs.len();
    problem
        .experiments
        .iter()
        .enumerate()
        .flat_map(move |(experiment, data)| {
            (0..data.estimation_samples).flat_map(move |sample| {
                (0..n_outputs).map(move |output| ResidualPlace {
                    experiment,
                    sample,
                    output,
                })
            })
        })
}

/// How often a part of a direction fits between a position and the bound ahead of it.
fn room(position: f64, part: f64) -> f64 {
    if part > 0.0 {
        (1.0 - position).max(0.0) / part
    } else if part < 0.0 {
        position.max(0.0) / -part
    } else {
        f64::INFINITY
    }
}

/// How far one goes back and ahead along a direction.
#[derive(Clone, Copy, Debug)]
struct Difference {
    back: f64,
    ahead: f64,
}

impl Difference {
    fn along(direction: &[f64], positions: &[f64], shift: f64, sides: Sides) -> Self {
        let room = |side: f64| {
            let pairs = positions.iter().zip(direction);
            let each = pairs.map(|(position, part)| room(*position, side * part));
            each.fold(shift, f64::min)
        };
        let (back, ahead) = (room(-1.0), room(1.0));
        match sides {
            Sides::Both => Difference { back, ahead },
            Sides::One if ahead >= back => Difference { back: 0.0, ahead },
            Sides::One => Difference { back, ahead: 0.0 },
        }
    }

    fn length(self) -> f64 {
        self.back + self.ahead
    }
}

/// The candidate and its neighbours, and for each difference which two of them it is between.
fn shifted_candidates(
    positions: &[f64],
    directions: &[Vec<f64>],
    differences: &[Difference],
) -> (Vec<Vec<f64>>, Vec<(usize, usize)>) {
    let mut candidates = vec![positions.to_vec()];
    let mut ends = Vec::with_capacity(differences.len());
    for (direction, difference) in directions.iter().zip(differences) {
        let mut neighbour = |step: f64| {
            if step == 0.0 {
                return 0;
            }
            let pairs = positions.iter().zip(direction);
            candidates.push(pairs.map(|(z, part)| z + step * part).collect());
            candidates.len() - 1
        };
        ends.push((neighbour(-difference.back), neighbour(difference.ahead)));
    }
    (candidates, ends)
}

#[cfg(test)]
mod tests;
