//! Whether an unknown changes within the record.
//!
//! If unknown k were larger by δ in the second half of each experiment than in the first, the
//! residuals would have moved by about its own derivative times −δ/2 in the first half and δ/2 in
//! the second: as far as the plant forgets within half a record what drove it. The same goes for
//! the middle third against the others. Each is tested like an assumption ([`super::joint`]): by
//! what of that column stands beside the unknowns themselves.

use super::joint::{Joint, LARGEST_SCORE};
use super::weighing::{Seen, Weighing};
use crate::estimation::problem::Problem;
use crate::estimation::sensitivity::{Neighbourhood, Row};
use greybox_simulation::SimulationFailure;

/// The parts of an experiment between which an unknown may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// From the first half to the second.
    Halves,
    /// Between the middle third and the others.
    MiddleThird,
}

const CHANGES: [Change; 2] = [Change::Halves, Change::MiddleThird];

impl Change {
    /// How far an unknown is off its mean at a sample, where it changes by one.
    fn at(self, sample: usize, samples: usize) -> f64 {
        match self {
            Change::Halves if 2 * sample < samples => -0.5,
            Change::Halves => 0.5,
            Change::MiddleThird if (samples..2 * samples).contains(&(3 * sample)) => 2.0 / 3.0,
            Change::MiddleThird => -1.0 / 3.0,
        }
    }
}

/// A change of an unknown within the record that the residuals ask for.
#[derive(Clone, Debug)]
pub struct Drift {
    /// The unknown, by its place.
    pub coordinate: usize,
    /// Between which parts.
    pub change: Change,
    /// How many standard deviations of noise the residuals pull at it.
    pub score: f64,
    /// By how much, with its standard error, positions.
    pub size: (f64, f64),
    /// How far it moves each unknown off its mean over the record, positions; none where the data
    /// do not fix it.
    pub moves: Vec<Option<f64>>,
}

impl Drift {
    /// How far a coordinate moves by the change, as a position: the coordinate that changes moves by half of
    /// the change at the least.
    #[must_use]
    pub fn move_of(&self, coordinate: usize) -> f64 {
        let half = match self.coordinate == coordinate {
            true => 0.5 * self.size.0,
            false => 0.0,
        };
        let moved = self.moves[coordinate].unwrap_or_default();
        moved.abs().max(half.abs())
    }
}

/// The changes that the residuals ask for beyond chance, for each unknown the one that they ask for
/// most, the likeliest first.
///
/// # Errors
/// How the estimate or a neighbour along an unknown failed.
pub fn of(
    problem: &Problem,
    neighbourhood: &Neighbourhood<'_>,
    seen: Seen<'_>,
) -> Result<Vec<Drift>, SimulationFailure> {
    let unknowns = problem.coordinates.len();
    let coordinates = problem.coordinates.iter().enumerate();
    let tested: Vec<(usize, Change)> = coordinates
        .filter(|(_, coordinate)| !coordinate.is_start())
        .flat_map(|(index, _)| CHANGES.map(|change| (index, change)))
        .collect();
    let columns = |row: &Row<'_>| -> Vec<f64> {
        let samples = problem.experiments[row.experiment].estimation_samples;
        let derivatives = &row.derivatives[..unknowns];
        let changed = tested
            .iter()
            .map(|(index, change)| derivatives[*index] * change.at(row.sample, samples));
        derivatives.iter().copied().chain(changed).collect()
    };
    let n = unknowns + tested.len();
    let weighing = Weighing::of(problem, seen);
    let (plain, white) = weighing.triangles(neighbourhood, unknowns, n, columns)?;
    let Some(joint) = Joint::new(&plain, &white, &vec![0.0; tested.len()]) else {
        return Ok(Vec::new());
    };
    let drift = |(place, (coordinate, change)): (usize, &(usize, Change))| {
        let score = joint.score(place)?;
        let size = score.suggested;
        let moved = |unknown: usize| Some(joint.move_by(unknown, place)? * size.0);
        let drift = Drift {
            coordinate: *coordinate,
            change: *change,
            score: score.t,
            size,
            moves: (0..unknowns).map(moved).collect(),
        };
        (score.t.abs() > LARGEST_SCORE).then_some(drift)
    };
    let mut drifts: Vec<Drift> = tested.iter().enumerate().filter_map(drift).collect();
    drifts.sort_by(|a, b| b.score.abs().total_cmp(&a.score.abs()));
    let mut named = vec![false; unknowns];
    drifts.retain(|drift| !std::mem::replace(&mut named[drift.coordinate], true));
    Ok(drifts)
}
