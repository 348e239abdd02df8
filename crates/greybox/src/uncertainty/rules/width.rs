//! How far the width of a total interval lets a parameter be trusted.
//!
//! An interval that holds nearly everything cannot be wrong, so that a grade that only promises that
//! the interval holds says nothing: totals of the servo are 5 to 23 times as wide as those of noise.

use super::{Case, short};
use crate::uncertainty::budget::{BETTER, Line};
use crate::uncertainty::covariance::NORMAL_95;
use crate::uncertainty::verdict::{Doubt, Rule, Subject, Trust};
use crate::uncertainty::width::{LOW_SHARE, magnitude, share_of_magnitude};

/// A total standard error beyond this share of the value makes the trust moderate.
const MODERATE_SHARE: f64 = 0.1;
/// Where explanations of the record differ and the total interval covers each of them, a half of the interval
/// beyond this share of the value makes the trust low.
const LOW_HALF: f64 = 0.5;
/// A number is named as worth knowing better where the total standard error then falls below this share.
const USEFUL_SHARE: f64 = 0.95;

/// The total standard error of a coordinate.
struct IntervalWidth {
    coordinate: usize,
    /// The standard error that noise alone leaves, as a share of the search range.
    noise: f64,
    /// The total standard error as a share of the search range.
    total: f64,
    /// The total standard error as a share of what it is measured by.
    share: f64,
    /// How far the coordinate can be trusted.
    trust: Trust,
    /// Whether what is taken as known adds more to the variance than noise does.
    is_assumed: bool,
}

impl Case<'_> {
    /// Coordinates that are known too coarsely to be trusted fully.
    pub(super) fn widths(&self) -> Vec<Doubt> {
        let coordinates = 0..self.problem.coordinates.len();
        let widths = coordinates.filter_map(|index| self.width(index));
        widths
            .map(|width| match width.is_assumed {
                true => self.dominated(&width),
                false => self.left_open(&width),
            })
            .collect()
    }

    /// The width of a coordinate that is known too coarsely; none of a coordinate that is known
    /// well, or that the data do not fix.
    fn width(&self, index: usize) -> Option<IntervalWidth> {
        let coordinate = &self.problem.coordinates[index];
        let noise = self.deviation(index)?;
        let total = self.analysis.budget.totals.get(index).copied().flatten();
        let total = total.unwrap_or(noise);
        let is_assumed = total > std::f64::consts::SQRT_2 * noise;
        let slope = coordinate.slope(self.report.positions[index]).abs();
        let share = share_of_magnitude(coordinate, self.report.values[index], total * slope);
        let trust = if 2.0 * NORMAL_95 * total >= 1.0 {
            Trust::Low
        } else if coordinate.is_start() {
            // Where the record starts is not what a job is for.
            Trust::High
        } else if share > LOW_SHARE {
            Trust::Low
        } else if share > MODERATE_SHARE {
            Trust::Moderate
        } else {
            Trust::High
        };
        let is_told = !is_assumed && !self.analysis.coordinates[index].identifiable;
        (trust < Trust::High && !is_told).then_some(IntervalWidth {
            coordinate: index,
            noise,
            total,
            share,
            trust,
            is_assumed,
        })
    }

    /// How far a coordinate can be trusted whose total interval covers explanations of the record that
    /// differ: moderately where the interval is narrow enough to be of use.
    pub(super) fn trust_in_hull(&self, index: usize) -> Trust {
        let coordinate = &self.problem.coordinates[index];
        let measure = magnitude(coordinate, self.report.values[index]);
        let total = self.analysis.coordinates[index].total_error;
        match total {
            Some(total) if NORMAL_95 * total <= LOW_HALF * measure => Trust::Moderate,
            _ => Trust::Low,
        }
    }

    /// The doubt about a coordinate that noise leaves open.
    fn left_open(&self, width: &IntervalWidth) -> Doubt {
        let detail = format!(
            "noise leaves `{}` a standard error of {}: record longer, or excite it more \
             (`POST /v1/designs` looks for the experiment)",
            self.problem.coordinates[width.coordinate].name,
            self.error_in_words(width.coordinate, width.noise)
        );
        let doubt = Doubt::new(Rule::WideInterval, width.trust, detail);
        doubt
            .concerning(vec![width.coordinate])
            .at_stake(width.share)
    }

    /// The doubt about a coordinate that what is taken as known leaves open.
    fn dominated(&self, width: &IntervalWidth) -> Doubt {
        let better = |line: &Line| Some(line.contributions[width.coordinate]?.total_if_better);
        let lines = self.analysis.budget.lines.iter().enumerate();
        let lines = lines.filter_map(|(place, line)| Some((place, line, better(line)?)));
        let best = lines.min_by(|(_, _, a), (_, _, b)| a.total_cmp(b));
        let best = best.filter(|(_, _, then)| *then < USEFUL_SHARE * width.total);
        let error = format!(
            "all that is assumed leaves `{}` a standard error of {}",
            self.problem.coordinates[width.coordinate].name,
            self.error_in_words(width.coordinate, width.total)
        );
        let doubt = |detail| {
            let doubt = Doubt::new(Rule::AssumptionsDominate, width.trust, detail);
            let doubt = doubt.concerning(vec![width.coordinate]);
            doubt.at_stake(width.share)
        };
        let Some((place, line, then)) = best else {
            return doubt(format!(
                "{error}: no number of the model that is known better makes it much less"
            ));
        };
        let assumption = &line.assumption;
        let detail = format!(
            "{error}: know `{}` to {} instead of {}, and it falls to {}",
            assumption.name,
            with_unit(assumption.tolerance / BETTER, &assumption.unit),
            short(assumption.tolerance),
            self.error_in_words(width.coordinate, then)
        );
        doubt(detail).about(Subject::Assumptions(vec![place]))
    }

    /// A standard error, given as a share of the search range: in the unit of the coordinate, and
    /// as a share of the value where the value is larger.
    fn error_in_words(&self, index: usize, deviation: f64) -> String {
        let coordinate = &self.problem.coordinates[index];
        let value = self.report.values[index].abs();
        let error = deviation * coordinate.slope(self.report.positions[index]).abs();
        let size = with_unit(error, &coordinate.unit);
        match error < value {
            true => format!("{size} ({} %)", short(100.0 * error / value)),
            false => size,
        }
    }
}

/// A number in its unit, if it has one.
fn with_unit(value: f64, unit: &str) -> String {
    match unit {
        "" | "1" => short(value),
        unit => format!("{} {unit}", short(value)),
    }
}
