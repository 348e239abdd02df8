//! The best excitation of a family: a grid over its most telling number, then steps along each
//! number in turn, halved when none of them helps (R. Hooke, T. A. Jeeves, 1961, without the pattern
//! moves). Nothing is drawn: the same problem gives the same excitation.

use super::assessment::Assessment;
use super::excitation::{BITS, Excitation, Grid};

/// Points of the first grid along the most telling number.
const FIRST_POINTS: usize = 12;
/// A step along a number, as a share of its range, that is too short to matter.
const SHORTEST_STEP: f64 = 1.0 / 1024.0;
/// Excitations of a family that are looked at, at the most.
const MOST_ASSESSMENTS: usize = 150;
/// The smallest amplitude that is looked at.
const SMALLEST_AMPLITUDE: f64 = 0.1;
/// The sines of a multisine.
const LINES: u32 = 8;
/// The highest frequency that is looked at, as a share of the sampling frequency.
const HIGHEST_SHARE: f64 = 0.25;
/// A score that is larger by less is no gain.
const LEAST_GAIN: f64 = 1e-9;

/// A family of excitations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Pseudo-random binary sequences: clock, bits and amplitude.
    Prbs,
    /// Sums of sines: lowest and highest frequency, amplitude.
    Multisine,
    /// Four levels, again and again: how long each is held, and the levels.
    Steps,
    /// Single sines: frequency and amplitude.
    Sine,
}

impl Family {
    /// All families.
    pub const ALL: [Family; 4] = [Family::Prbs, Family::Multisine, Family::Steps, Family::Sine];

    /// The name of the family in requests and answers.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Family::Prbs => "prbs",
            Family::Multisine => "multisine",
            Family::Steps => "steps",
            Family::Sine => "sine",
        }
    }

    /// The excitation at a point of the unit cube.
    fn at(self, point: &[f64], grid: &Grid) -> Excitation {
        let (slowest, fastest) = (1.0 / grid.duration(), HIGHEST_SHARE / grid.sample_time);
        let frequency = |share: f64| slowest * libm::pow(fastest / slowest, share);
        let amplitude = |share: f64| SMALLEST_AMPLITUDE + (1.0 - SMALLEST_AMPLITUDE) * share;
        // From one sample to half of the experiment.
        let held = |share: f64| {
            let longest = (grid.samples as f64 / 2.0).max(1.0);
            libm::pow(longest, share).round() * grid.sample_time
        };
        match self {
            Family::Prbs => Excitation::Prbs {
                clock_s: held(point[0]),
                bits: BITS[0] + (point[1] * f64::from(BITS[1] - BITS[0])).round() as u32,
                amplitude: amplitude(point[2]),
            },
            Family::Multisine => Excitation::Multisine {
                lowest_hz: frequency(point[0]),
                highest_hz: frequency(point[0] + (1.0 - point[0]) * point[1]),
                lines: LINES,
                amplitude: amplitude(point[2]),
            },
            Family::Steps => Excitation::Steps {
                hold_s: held(point[0]),
                levels: point[1..].iter().map(|share| 2.0 * share - 1.0).collect(),
            },
            Family::Sine => Excitation::Sine {
                frequency_hz: frequency(point[0]),
                amplitude: amplitude(point[1]),
            },
        }
    }

    /// What stands beside the most telling number in the first grid.
    fn beside(self) -> &'static [&'static [f64]] {
        match self {
            Family::Prbs => &[&[0.45, 1.0]],
            Family::Multisine => &[&[0.3, 1.0], &[0.7, 1.0]],
            Family::Steps => &[&[1.0, 0.0, 0.75, 0.25]],
            Family::Sine => &[&[1.0]],
        }
    }

    /// How many excitations of the family are looked at before any is improved.
    #[must_use]
    pub fn first_assessments(self) -> usize {
        FIRST_POINTS * self.beside().len()
    }

    /// How many are looked at at the most.
    #[must_use]
    pub fn most_assessments(self) -> usize {
        // The last round of steps is finished: two to each side of each number.
        let numbers = 1 + self.beside()[0].len();
        MOST_ASSESSMENTS + 2 * numbers
    }
}

/// An excitation that was looked at.
#[derive(Clone, Debug)]
pub struct Assessed {
    /// The excitation.
    pub excitation: Excitation,
    /// The information that the experiment would bring.
    pub assessment: Assessment,
}

/// The search in one family.
#[derive(Clone, Debug)]
pub struct Search {
    family: Family,
    /// The designs that were looked at, each with its point of the unit cube.
    seen: Vec<(Vec<f64>, Assessed)>,
    /// The place of the best among them.
    best: usize,
}

impl Search {
    /// No excitation yet.
    #[must_use]
    pub fn new(family: Family) -> Search {
        Search {
            family,
            seen: Vec::new(),
            best: 0,
        }
    }

    /// The family.
    #[must_use]
    pub fn family(&self) -> Family {
        self.family
    }

    /// The best so far.
    #[must_use]
    pub fn best(&self) -> Option<&Assessed> {
        Some(&self.seen.get(self.best)?.1)
    }

    /// How many excitations were looked at.
    #[must_use]
    pub fn assessed(&self) -> usize {
        self.seen.len()
    }

    /// Looks at the first grid. Answers nothing when `assess` does: it was told to stop.
    pub fn begin(
        &mut self,
        grid: &Grid,
        mut assess: impl FnMut(&Excitation) -> Option<Assessment>,
    ) -> Option<()> {
        for beside in self.family.beside() {
            for place in 0..FIRST_POINTS {
                let mut point = vec![place as f64 / (FIRST_POINTS - 1) as f64];
                point.extend_from_slice(beside);
                self.look(point, grid, &mut assess)?;
            }
        }
        Some(())
    }

    /// Improves the best of the first grid. Answers nothing when `assess` does.
    pub fn improve(
        &mut self,
        grid: &Grid,
        mut assess: impl FnMut(&Excitation) -> Option<Assessment>,
    ) -> Option<()> {
        let mut step = 1.0 / (FIRST_POINTS - 1) as f64;
        while step > SHORTEST_STEP && self.seen.len() < MOST_ASSESSMENTS {
            if !self.step(step, grid, &mut assess)? {
                step *= 0.5;
            }
        }
        Some(())
    }

    /// Goes a step along each number in turn, to the side that helps more; whether one did.
    fn step(
        &mut self,
        step: f64,
        grid: &Grid,
        assess: &mut impl FnMut(&Excitation) -> Option<Assessment>,
    ) -> Option<bool> {
        let mut has_moved = false;
        for number in 0..self.seen[self.best].0.len() {
            let before = self.best;
            for side in [-step, step] {
                let mut point = self.seen[before].0.clone();
                point[number] = (point[number] + side).clamp(0.0, 1.0);
                self.look(point, grid, assess)?;
            }
            has_moved |= self.best != before;
        }
        Some(has_moved)
    }

    /// Looks at a point, which is the best where it is better than all before.
    fn look(
        &mut self,
        point: Vec<f64>,
        grid: &Grid,
        assess: &mut impl FnMut(&Excitation) -> Option<Assessment>,
    ) -> Option<()> {
        let excitation = self.family.at(&point, grid);
        let is_known = |seen: &(Vec<f64>, Assessed)| seen.1.excitation == excitation;
        if self.seen.iter().any(is_known) {
            return Some(());
        }
        let assessment = assess(&excitation)?;
        let best = self.best().map(|best| best.assessment.score);
        if best.is_none_or(|best| assessment.score > best + LEAST_GAIN) {
            self.best = self.seen.len();
        }
        let assessed = Assessed {
            excitation,
            assessment,
        };
        self.seen.push((point, assessed));
        Some(())
    }
}
