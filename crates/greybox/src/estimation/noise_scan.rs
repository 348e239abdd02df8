//! Where the descent of a noise model begins: the best point of a grid of noises at an estimate.

use super::problem::{Coordinate, Problem};
use super::process_noise::{NoiseModel, NoiseNumber};
use super::sensitivity::{Directions, Neighbourhood, SHIFT, Sides};
use greybox_simulation::Accuracy;
use greybox_simulation::model::Scale;
use std::sync::atomic::AtomicBool;

/// Strengths that are scanned, as shares of what makes the residuals of the free run.
const SCANNED_STRENGTHS: [f64; 7] = [1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0, 3.0];

/// The largest share of a point of which the likelihood says how large all noises are together.
const LARGEST_SHARE: f64 = 1.0;

/// Noises of the sensors that are scanned, as shares of the residuals of the free run. Where strengths and sensors
/// are all unknown, one of the shares of a point is 1: the likelihood itself says how large all are together.
const SCANNED_SENSORS: [f64; 6] = [1.0, 0.3, 0.1, 1e-2, 1e-3, 1e-5];

/// Memories that are scanned: the place between the time from sample to sample and the length of the
/// record, on a logarithmic scale.
const SCANNED_MEMORIES: [f64; 3] = [0.25, 0.5, 0.75];

/// Points of a scan that are simulated, and held, at once.
const SCANNED_TOGETHER: usize = 32;

/// The noises that a fitted model has, beside which another disturbance is scanned.
pub(super) struct ScannedBasis {
    /// The noises with the values of the fit.
    pub noise: NoiseModel,
    /// The places of the compared outputs whose sensors are scanned too.
    pub coloured: Vec<usize>,
}

impl ScannedBasis {
    /// The numbers of a disturbance of the fitted model, by its place.
    fn disturbance(&self, place: usize) -> Option<Vec<f64>> {
        let numbers = self.noise.disturbances.get(place)?.numbers();
        Some(numbers.map(NoiseNumber::typical).collect())
    }

    /// The noise of a sensor where it stays as it was fitted, by the place of its output.
    fn sensor(&self, place: usize) -> Option<f64> {
        let stays = !self.coloured.contains(&place);
        stays.then(|| self.noise.sensors[place].typical())
    }
}

/// A grid of noises.
pub(super) struct NoiseScan<'a> {
    /// The positions of the plant's unknowns.
    pub estimate: &'a [f64],
    /// The root mean square of each output's residuals in the free run.
    pub deviations: &'a [f64],
    pub noise: &'a NoiseModel,
    /// The strength of each disturbance that makes the residuals of the free run.
    pub strengths: &'a [f64],
    /// The basis that was fitted before; none where nothing was.
    pub beside: Option<ScannedBasis>,
}

impl NoiseScan<'_> {
    /// The point of the grid at which the data are likeliest. Answers nothing when `stop` was raised.
    pub fn best(&self, problem: &Problem, stop: &AtomicBool) -> Option<Vec<f64>> {
        let is_concentrated = self.is_concentrated();
        let points = self.points();
        let mut simulated = Vec::with_capacity(points.len());
        for part in points.chunks(SCANNED_TOGETHER) {
            let around = compared(problem, part, stop)?;
            for (place, point) in part.iter().enumerate() {
                let (cost, by) = match is_concentrated {
                    true => around.concentrated_cost(place),
                    false => (around.cost(place), 1.0),
                };
                simulated.push(SimulatedPoint { point, cost, by });
            }
        }
        let likeliest = simulated.iter().min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        Some(self.enlarged(problem, likeliest))
    }

    /// Whether all strengths and sensors are unknown and none was fitted, so that the likelihood says how large
    /// they are together.
    fn is_concentrated(&self) -> bool {
        self.beside.is_none() && self.noise.sizes().all(NoiseNumber::is_unknown)
    }

    /// Points of the estimate with noises.
    fn points(&self) -> Vec<Vec<f64>> {
        let is_concentrated = self.is_concentrated();
        let mut grid = vec![GridPoint {
            positions: self.estimate.to_vec(),
            largest_share: 0.0,
        }];
        let disturbances = self.noise.disturbances.iter().zip(self.strengths);
        for (place, (disturbance, scale)) in disturbances.enumerate() {
            let basis = self.beside.as_ref();
            if let Some(fitted) = basis.and_then(|basis| basis.disturbance(place)) {
                let numbers = disturbance.numbers().zip(fitted);
                let positions = numbers.filter_map(|(number, value)| position(number, value));
                grid = extended(&grid, &[Scanned::at(positions.collect())]);
                continue;
            }
            let shares = SCANNED_STRENGTHS.iter();
            let shares = shares.filter(|share| !is_concentrated || **share <= LARGEST_SHARE);
            let shares: Vec<f64> = shares.copied().collect();
            grid = extended(&grid, &scanned(disturbance.strength, &shares, &[*scale]));
            if let Some(NoiseNumber::Unknown { .. }) = disturbance.time_constant {
                let memories = SCANNED_MEMORIES.map(|position| Scanned::at(vec![position]));
                grid = extended(&grid, &memories);
            }
        }
        grid = extended(&grid, &self.scanned_sensors());
        let points = grid.into_iter();
        let points =
            points.filter(|point| !is_concentrated || point.largest_share == LARGEST_SHARE);
        points.map(|point| point.positions).collect()
    }

    /// The sensors that are unknown, scanned together but for those that stay as they were fitted.
    fn scanned_sensors(&self) -> Vec<Scanned> {
        let sensors = self.noise.sensors.iter().zip(self.deviations).enumerate();
        let unknown: Vec<_> = sensors
            .filter(|(_, (sensor, _))| sensor.is_unknown())
            .collect();
        let Some((_, (first, _))) = unknown.first() else {
            return Vec::new();
        };
        let scales: Vec<f64> = unknown
            .iter()
            .map(|(_, (_, deviation))| **deviation)
            .collect();
        let mut points = scanned(**first, &SCANNED_SENSORS, &scales);
        let Some(basis) = &self.beside else {
            return points;
        };
        for (index, (place, (sensor, _))) in unknown.iter().enumerate() {
            let Some(stays) = basis
                .sensor(*place)
                .and_then(|value| position(**sensor, value))
            else {
                continue;
            };
            points
                .iter_mut()
                .for_each(|point| point.positions[index] = stays);
        }
        if basis.coloured.is_empty() {
            points.truncate(1);
        }
        points
    }

    /// A point with all strengths and sensors larger by its factor, as far as their ranges go.
    fn enlarged(&self, problem: &Problem, simulated: &SimulatedPoint<'_>) -> Vec<f64> {
        let SimulatedPoint { point, by, .. } = *simulated;
        let mut enlarged = point.to_vec();
        let innovations = problem.innovations.iter();
        let places = innovations.flat_map(|innovations| &innovations.sizes);
        for &place in places.filter(|_| by.is_finite()) {
            let coordinate = &problem.coordinates[place];
            let value = by * coordinate.value(point[place]);
            let Coordinate { lower, upper, .. } = *coordinate;
            enlarged[place] = Scale::Log.position(value.clamp(lower, upper), lower, upper);
        }
        enlarged
    }
}

/// A point of a grid that was simulated.
struct SimulatedPoint<'a> {
    point: &'a [f64],
    /// The cost with all noises larger by the factor.
    cost: f64,
    /// The factor that makes the cost lowest; 1 where noises are given.
    by: f64,
}

/// Positions of one or more numbers of a grid.
struct Scanned {
    /// The share of the free run's residuals; 0 for what is no size.
    share: f64,
    positions: Vec<f64>,
}

impl Scanned {
    /// Positions that are no share of anything.
    fn at(positions: Vec<f64>) -> Scanned {
        Scanned {
            share: 0.0,
            positions,
        }
    }
}

/// The position of a value within the range of an unknown; a given number has none.
fn position(number: NoiseNumber, value: f64) -> Option<f64> {
    let NoiseNumber::Unknown { lower, upper, .. } = number else {
        return None;
    };
    Some(Scale::Log.position(value.clamp(lower, upper), lower, upper))
}

/// A point of a grid.
#[derive(Clone)]
struct GridPoint {
    positions: Vec<f64>,
    /// The largest share of the free run's residuals among its noises.
    largest_share: f64,
}

/// The positions of shares of scales within the range of an unknown, its middle where all lie outside; a given
/// number has none.
fn scanned(number: NoiseNumber, shares: &[f64], scales: &[f64]) -> Vec<Scanned> {
    let NoiseNumber::Unknown { lower, upper, .. } = number else {
        return Vec::new();
    };
    let first = scales[0];
    let at = |share: f64| Scanned {
        share,
        // Ranges of sensors are proportional to their scales.
        positions: vec![Scale::Log.position(share * first, lower, upper); scales.len()],
    };
    let inside = |scanned: &Scanned| (0.0..=1.0).contains(&scanned.positions[0]);
    let within: Vec<Scanned> = shares
        .iter()
        .map(|share| at(*share))
        .filter(inside)
        .collect();
    if within.is_empty() {
        let middle = Scanned {
            share: LARGEST_SHARE,
            positions: vec![0.5; scales.len()],
        };
        return vec![middle];
    }
    within
}

/// The points of a grid, each with more numbers; the grid as it is where there are none.
fn extended(grid: &[GridPoint], numbers: &[Scanned]) -> Vec<GridPoint> {
    let points = grid.iter().flat_map(|point| {
        let with = |scanned: &Scanned| GridPoint {
            positions: [&point.positions[..], &scanned.positions].concat(),
            largest_share: point.largest_share.max(scanned.share),
        };
        numbers.iter().map(with).collect::<Vec<_>>()
    });
    match numbers.is_empty() {
        true => grid.iter().map(GridPoint::clone).collect(),
        false => points.collect(),
    }
}

/// Candidates of a problem, simulated finely. Answers nothing when `stop` was raised.
pub(super) fn compared<'a>(
    problem: &'a Problem,
    candidates: &[Vec<f64>],
    stop: &AtomicBool,
) -> Option<Neighbourhood<'a>> {
    let nowhere = Directions {
        from: &candidates[0],
        vectors: &[],
        shift: SHIFT,
        sides: Sides::One,
    };
    Neighbourhood::simulate(problem, nowhere, candidates, (Accuracy::Full, stop))
}
