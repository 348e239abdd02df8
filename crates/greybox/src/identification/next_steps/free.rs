//! Steps that make an unknown of a number that was taken as known.

use super::parameters::{possible, put, with_unit};
use super::{Change, DIGITS, Finished};
use crate::estimation::problem::{Assumed, Target};
use crate::identification::JobSpec;
use crate::identification::spec::{
    ExperimentRole, FreeParameter, FreeState, InitialStateSpec, ParameterSpec, SearchRange,
    StateRange,
};
use crate::uncertainty::budget::Line;
use greybox_numerics::digits::rounded;
use greybox_simulation::model::{ParameterDescription, Scale};

/// The range of a start that is freed goes so many standard deviations beyond what is known.
const DEVIATIONS: f64 = 5.0;
/// Significant digits of the estimate at which a descent begins.
const START_DIGITS: usize = 6;

impl Finished<'_> {
    /// A number that was taken as known becomes an unknown.
    pub(super) fn free_assumption(&self, line: usize) -> Option<Change> {
        let line = &self.conclusion.analysis.budget.lines[line];
        let Assumed::Model(target) = line.assumption.target else {
            return None;
        };
        let estimates = |experiment: usize| {
            self.spec.experiments[experiment].role == ExperimentRole::Estimation
        };
        if !target.experiment().is_none_or(estimates) {
            return None;
        }
        Some(Change {
            label: format!("Free {}", self.words(target)),
            why: match line.suggested {
                Some((value, _)) => {
                    let value = with_unit(value, &line.assumption.unit);
                    format!("{value} would explain what is left.")
                }
                None => "The residuals contradict its value.".to_owned(),
            },
            spec: self.changed(|spec| self.free(spec, target, line)),
        })
    }

    /// Puts a range in the place of a number that was taken as known. A descent begins at the number and at the
    /// estimate, so that the search with one unknown more cannot end above what was reached without.
    pub(super) fn free(&self, spec: &mut JobSpec, target: Target, line: &Line) {
        self.begin_at_estimate(spec);
        if let Some(parameter) = self.parameter(target) {
            let estimate = range_around(parameter, line);
            let free = ParameterSpec::Free(FreeParameter {
                estimate,
                prior: None,
            });
            put(spec, target, &parameter.name, free);
        } else if let Target::InitialState { experiment, state } = target {
            let (value, tolerance) = (line.assumption.value, line.assumption.tolerance);
            let (suggested, error) = line.suggested.unwrap_or((value, tolerance));
            let reach = |value: f64, deviation: f64| {
                let reach = DEVIATIONS * deviation;
                [value - reach, value + reach]
            };
            let [low, high] = reach(value, tolerance);
            let [suggested_low, suggested_high] = reach(suggested, error);
            let estimate = StateRange {
                lower: rounded(low.min(suggested_low), DIGITS),
                upper: rounded(high.max(suggested_high), DIGITS),
            };
            let free = InitialStateSpec::Free(FreeState {
                estimate,
                prior: None,
            });
            let states = &self.description().states;
            let starts = &mut spec.experiments[experiment].initial_state;
            starts.insert(states[state].name.to_string(), free);
        }
    }

    /// Has a descent begin at the estimate.
    fn begin_at_estimate(&self, spec: &mut JobSpec) {
        let values = &self.conclusion.report.values;
        for (coordinate, value) in self.conclusion.problem.coordinates.iter().zip(values) {
            let parameters = match coordinate.target.experiment() {
                None => &mut spec.parameters,
                Some(experiment) => &mut spec.experiments[experiment].parameters,
            };
            if let Some(ParameterSpec::Free(free)) = parameters.get_mut(&coordinate.quantity) {
                let SearchRange { lower, upper, .. } = free.estimate;
                let start = rounded(*value, START_DIGITS);
                free.estimate.start = Some(start.clamp(lower, upper));
            }
        }
    }
}

/// The range of the model, with the value that was taken and the one that is suggested inside.
fn range_around(parameter: &ParameterDescription, line: &Line) -> SearchRange {
    let taken = line.assumption.value;
    let suggested = line.suggested.map_or(taken, |(value, _)| value);
    let inside = [taken, possible(rounded(suggested, DIGITS), parameter)];
    let lower = inside.into_iter().fold(parameter.lower, f64::min);
    let upper = inside.into_iter().fold(parameter.upper, f64::max);
    let scale = match lower > 0.0 {
        true => parameter.scale,
        false => Scale::Linear,
    };
    SearchRange {
        lower,
        upper,
        scale,
        start: Some(taken),
    }
}
