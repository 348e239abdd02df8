//! Steps that change what is said of single numbers: parameters, initial states and sensors.

use super::{Change, DIGITS, Finished};
use crate::estimation::problem::{Assumed, Assumption, Coordinate, SensorNumber, Target};
use crate::identification::JobSpec;
use crate::identification::spec::{
    FixedValue, FreeParameter, FreeState, InitialStateSpec, ParameterSpec, PriorSpec, SearchRange,
    StateRange,
};
use crate::uncertainty::budget::BETTER;
use greybox_numerics::digits::{rounded, short};
use greybox_simulation::model::{ModelDescription, ParameterDescription, Scale, Tolerance};

/// A linear range is widened by so many of its widths.
const WIDTHS: f64 = 2.0;
/// A range on a log scale is widened by this factor.
const FACTOR: f64 = 10.0;

/// Which end of a range is meant.
#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    Lower,
    Upper,
}

impl Finished<'_> {
    /// The value of a parameter from a data sheet in the place of its estimate.
    pub(super) fn fix(&self, index: usize) -> Option<Change> {
        let coordinate = &self.conclusion.problem.coordinates[index];
        let parameter = self.parameter(coordinate.target)?;
        let value = possible(
            rounded(self.conclusion.report.values[index], DIGITS),
            parameter,
        );
        let fixed = ParameterSpec::Fixed(FixedValue {
            value,
            tolerance: None,
        });
        let spec = self.changed(|spec| {
            put(spec, coordinate.target, &parameter.name, fixed);
            if let Target::Parameter(_) = coordinate.target {
                leave_joint_priors(spec, &parameter.name);
                leave_model_search(spec, &parameter.name);
            }
            self.leave_idle_constraints(spec);
        });
        Some(Change {
            label: format!("Fix {}", self.words(coordinate.target)),
            why: "Put the value of the data sheet in the place of the estimate.".to_owned(),
            spec,
        })
    }

    /// A wider range for a number that stands at an end of its range.
    pub(super) fn widen(&self, index: usize) -> Option<Change> {
        let coordinate = &self.conclusion.problem.coordinates[index];
        let end = match self.conclusion.report.positions[index] > 0.5 {
            true => End::Upper,
            false => End::Lower,
        };
        let parameter = self.parameter(coordinate.target);
        let bound = widened(coordinate, parameter, end)?;
        let (lower, upper, word) = match end {
            End::Lower => (bound, coordinate.upper, "Lower"),
            End::Upper => (coordinate.lower, bound, "Upper"),
        };
        Some(Change {
            label: format!("Widen the range of {}", self.words(coordinate.target)),
            why: format!("{word} bound {}.", with_unit(bound, &coordinate.unit)),
            spec: self.with_range(coordinate, lower, upper),
        })
    }

    /// Ranges that hold one of two minima each: they end half way between the two, along the
    /// parameter in which the minima differ most.
    pub(super) fn choose_minimum(&self, twin: usize) -> Vec<Change> {
        let (problem, report) = (&self.conclusion.problem, &self.conclusion.report);
        let pairs = problem.coordinates.iter().zip(&report.twins[twin]);
        let parameters = pairs.zip(&report.positions);
        let differing = parameters
            .filter(|((coordinate, _), _)| self.parameter(coordinate.target).is_some())
            .map(|((coordinate, (_, value)), position)| {
                let Coordinate { lower, upper, .. } = *coordinate;
                (
                    coordinate,
                    *position,
                    coordinate.scale.position(*value, lower, upper),
                )
            })
            .max_by(|(_, here, there), (_, other_here, other_there)| {
                (here - there)
                    .abs()
                    .total_cmp(&(other_here - other_there).abs())
            });
        let Some((coordinate, here, there)) = differing else {
            return Vec::new();
        };
        let middle = rounded(coordinate.value(0.5 * (here + there)), DIGITS);
        if middle <= coordinate.lower || middle >= coordinate.upper {
            return Vec::new();
        }
        let (below, above) = match here < there {
            true => ("this minimum", "the other minimum"),
            false => ("the other minimum", "this minimum"),
        };
        let keep = |minimum: &str, lower: f64, upper: f64| Change {
            label: format!("Keep {minimum} of {}", self.words(coordinate.target)),
            why: format!(
                "{} … {}.",
                short(lower, DIGITS),
                with_unit(upper, &coordinate.unit)
            ),
            spec: self.with_range(coordinate, lower, upper),
        };
        let mut both = vec![
            keep(below, coordinate.lower, middle),
            keep(above, middle, coordinate.upper),
        ];
        if here > there {
            both.reverse();
        }
        both
    }

    /// A number that was taken as known is known better.
    pub(super) fn know_better(&self, line: usize) -> Option<Change> {
        let assumption = &self.conclusion.analysis.budget.lines[line].assumption;
        let tolerance = rounded(assumption.tolerance / BETTER, DIGITS);
        let spec = self.changed(|spec| self.tighten(spec, assumption, tolerance));
        Some(Change {
            label: format!("Know {} better", self.words_of(assumption)),
            why: format!(
                "Measured to ± {} instead of ± {}.",
                with_unit(tolerance, &assumption.unit),
                short(assumption.tolerance, DIGITS)
            ),
            spec,
        })
    }

    fn tighten(&self, spec: &mut JobSpec, assumption: &Assumption, tolerance: f64) {
        let fixed = FixedValue {
            value: assumption.value,
            tolerance: Some(Tolerance::Absolute(tolerance)),
        };
        if assumption.is_default {
            let tolerance = Tolerance::Absolute(tolerance);
            spec.tolerances.insert(assumption.name.clone(), tolerance);
            return;
        }
        match assumption.target {
            Assumed::Model(target) => match (self.parameter(target), target) {
                (Some(parameter), _) => {
                    put(spec, target, &parameter.name, ParameterSpec::Fixed(fixed));
                }
                (None, Target::InitialState { experiment, state }) => {
                    let state = self.description().states[state].name.to_string();
                    let starts = &mut spec.experiments[experiment].initial_state;
                    starts.insert(state, InitialStateSpec::Fixed(fixed));
                }
                _ => {}
            },
            Assumed::Sensor { output, number } => {
                let name = self.conclusion.problem.outputs[output].name.clone();
                let output = spec.outputs.entry(name).or_default();
                match number {
                    SensorNumber::Gain => {
                        output.gain_tolerance = Some(Tolerance::Absolute(tolerance));
                    }
                    SensorNumber::Offset => output.offset_tolerance = Some(tolerance),
                    SensorNumber::Lag => output.lag_tolerance_s = Some(tolerance),
                }
            }
            // Nobody declares these.
            Assumed::Probe(_) | Assumed::Input(_) => {}
            Assumed::Clock => spec.clock_tolerance = Some(Tolerance::Absolute(tolerance)),
        }
    }

    /// An estimate without what was known of the number before.
    pub(super) fn forget_prior(&self, index: usize) -> Option<Change> {
        let coordinate = &self.conclusion.problem.coordinates[index];
        let name = &coordinate.quantity;
        let spec = self.changed(|spec| {
            let experiment = coordinate.target.experiment();
            let experiment = experiment.map(|place| &mut spec.experiments[place]);
            match (coordinate.target, experiment) {
                (Target::InitialState { .. }, Some(experiment)) => {
                    forget_start(experiment.initial_state.get_mut(name));
                }
                (_, Some(experiment)) => forget(experiment.parameters.get_mut(name)),
                (_, None) => {
                    forget(spec.parameters.get_mut(name));
                    leave_joint_priors(spec, name);
                }
            }
        });
        Some(Change {
            label: format!("Forget the prior of {}", self.words(coordinate.target)),
            why: "To see what the data alone say.".to_owned(),
            spec,
        })
    }

    /// An estimate that need not keep a constraint.
    pub(super) fn without_constraint(&self, constraint: usize) -> Change {
        let text = self.conclusion.problem.constraints[constraint].text();
        Change {
            label: format!("Leave out {text}"),
            why: "To see what the data alone say.".to_owned(),
            spec: self.changed(|spec| spec.constraints.retain(|kept| kept != text)),
        }
    }

    /// Leaves out the constraints whose every parameter is fixed: they have nothing to keep.
    fn leave_idle_constraints(&self, spec: &mut JobSpec) {
        let is_free = |parameter: &usize| {
            let name = &*self.description().parameters[*parameter].name;
            let experiments = spec.experiments.iter();
            let values = experiments.filter_map(|experiment| experiment.parameters.get(name));
            let mut values = values.chain(spec.parameters.get(name));
            values.any(|value| matches!(value, ParameterSpec::Free(_)))
        };
        let conditions = &self.conclusion.problem.constraints;
        let idle = conditions.iter().filter(|condition| {
            let mut of_text = conditions
                .iter()
                .filter(|other| other.text() == condition.text());
            !of_text.any(|condition| condition.parameters().iter().any(is_free))
        });
        let idle: Vec<&str> = idle.map(|condition| condition.text()).collect();
        spec.constraints.retain(|text| !idle.contains(&&**text));
    }

    /// What the job knows of an unknown before the data are looked at.
    fn prior_of(&self, coordinate: &Coordinate) -> Option<PriorSpec> {
        let name = &coordinate.quantity;
        let experiment = coordinate.target.experiment();
        let experiment = experiment.map(|place| &self.spec.experiments[place]);
        if let (Target::InitialState { .. }, Some(experiment)) = (coordinate.target, experiment) {
            return match experiment.initial_state.get(name)? {
                InitialStateSpec::Free(free) => free.prior,
                _ => None,
            };
        }
        let parameters =
            experiment.map_or(&self.spec.parameters, |experiment| &experiment.parameters);
        match parameters.get(name)? {
            ParameterSpec::Free(free) => free.prior,
            ParameterSpec::Fixed(_) => None,
        }
    }

    /// An unknown with another search range.
    fn with_range(&self, coordinate: &Coordinate, lower: f64, upper: f64) -> JobSpec {
        let prior = self.prior_of(coordinate);
        self.changed(
            |spec| match (self.parameter(coordinate.target), coordinate.target) {
                (Some(parameter), target) => {
                    let scale = coordinate.scale;
                    let estimate = SearchRange {
                        lower,
                        upper,
                        scale,
                        start: None,
                    };
                    let free = ParameterSpec::Free(FreeParameter { estimate, prior });
                    put(spec, target, &parameter.name, free);
                }
                (None, Target::InitialState { experiment, .. }) => {
                    let estimate = StateRange { lower, upper };
                    let free = InitialStateSpec::Free(FreeState { estimate, prior });
                    let starts = &mut spec.experiments[experiment].initial_state;
                    starts.insert(coordinate.quantity.clone(), free);
                }
                _ => {}
            },
        )
    }

    pub(super) fn description(&self) -> &ModelDescription {
        self.conclusion.problem.model.description()
    }

    /// The parameter that a number is; none for an initial state.
    pub(super) fn parameter(&self, target: Target) -> Option<&ParameterDescription> {
        match target {
            Target::Parameter(parameter) | Target::ExperimentParameter { parameter, .. } => {
                Some(&self.description().parameters[parameter])
            }
            Target::InitialState { .. } => None,
        }
    }

    /// A number as people call it; experiments count from 1.
    pub(super) fn words(&self, target: Target) -> String {
        let description = self.description();
        let spaced = |name: &str| name.replace('_', " ");
        match target {
            Target::Parameter(parameter) => spaced(&description.parameters[parameter].name),
            Target::ExperimentParameter {
                experiment,
                parameter,
            } => {
                let name = spaced(&description.parameters[parameter].name);
                format!("{name} in experiment {}", experiment + 1)
            }
            Target::InitialState { experiment, state } => {
                let name = spaced(&description.states[state].name);
                format!("{name} at the start of experiment {}", experiment + 1)
            }
        }
    }

    fn words_of(&self, assumption: &Assumption) -> String {
        match assumption.target {
            Assumed::Model(target) => self.words(target),
            Assumed::Sensor { output, number } => {
                let number = match number {
                    SensorNumber::Gain => "gain",
                    SensorNumber::Offset => "offset",
                    SensorNumber::Lag => "lag",
                };
                let name = &self.conclusion.problem.outputs[output].name;
                format!("the sensor's {number} of {}", name.replace('_', " "))
            }
            Assumed::Probe(_) | Assumed::Input(_) => assumption.name.clone(),
            Assumed::Clock => "the clock".to_owned(),
        }
    }
}

/// Says something else of a parameter that experiments share, or of one experiment's own.
pub(super) fn put(spec: &mut JobSpec, target: Target, name: &str, value: ParameterSpec) {
    let parameters = match target.experiment() {
        None => &mut spec.parameters,
        Some(experiment) => &mut spec.experiments[experiment].parameters,
    };
    parameters.insert(name.to_owned(), value);
}

fn forget(parameter: Option<&mut ParameterSpec>) {
    if let Some(ParameterSpec::Free(free)) = parameter {
        free.prior = None;
    }
}

fn forget_start(start: Option<&mut InitialStateSpec>) {
    if let Some(InitialStateSpec::Free(free)) = start {
        free.prior = None;
    }
}

/// Takes a parameter out of the joint priors; a prior of one parameter that is left is dropped.
fn leave_joint_priors(spec: &mut JobSpec, name: &str) {
    for prior in &mut spec.priors {
        if let Some(place) = prior.parameters.iter().position(|member| member == name) {
            prior.parameters.remove(place);
            prior.mean.remove(place);
            prior.covariance.remove(place);
            for row in &mut prior.covariance {
                row.remove(place);
            }
        }
    }
    spec.priors.retain(|prior| prior.parameters.len() > 1);
}

/// Takes a parameter out of the effects that the data decide about.
fn leave_model_search(spec: &mut JobSpec, name: &str) {
    if let Some(search) = &mut spec.model_search {
        search.effects.retain(|effect| effect != name);
    }
    spec.model_search = spec
        .model_search
        .take()
        .filter(|search| !search.effects.is_empty());
}

/// The nearest value that the parameter can physically have.
pub(super) fn possible(value: f64, parameter: &ParameterDescription) -> f64 {
    let value = parameter.minimum.map_or(value, |least| value.max(least));
    parameter.maximum.map_or(value, |most| value.min(most))
}

/// A bound beyond an end of a range; none where no value beyond the end is possible.
fn widened(
    coordinate: &Coordinate,
    parameter: Option<&ParameterDescription>,
    end: End,
) -> Option<f64> {
    let Coordinate {
        lower,
        upper,
        scale,
        ..
    } = *coordinate;
    let width = WIDTHS * (upper - lower);
    let goal = match (end, scale) {
        (End::Upper, Scale::Log) => upper * FACTOR,
        (End::Upper, Scale::Linear) => upper + width,
        (End::Lower, Scale::Log) => lower / FACTOR,
        (End::Lower, Scale::Linear) => lower - width,
    };
    let goal = rounded(goal, DIGITS);
    let bound = parameter.map_or(goal, |parameter| possible(goal, parameter));
    let is_wider = match end {
        End::Upper => bound > upper,
        End::Lower => bound < lower,
    };
    (is_wider && (scale == Scale::Linear || bound > 0.0)).then_some(bound)
}

pub(super) fn with_unit(value: f64, unit: &str) -> String {
    let number = short(value, DIGITS);
    match unit {
        "" | "1" => number,
        unit => format!("{number} {unit}"),
    }
}
