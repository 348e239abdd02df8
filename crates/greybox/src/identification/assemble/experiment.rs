//! One experiment: cut out of its recording, its inputs without holes, its start settled.

use super::Finding;
use crate::estimation::prior::Prior;
use crate::estimation::problem::{Coordinate, Experiment, MeasuredOutput, Target, UnknownStart};
use crate::identification::outcome::name_of_start;
use crate::identification::spec::{
    ExperimentRole, ExperimentSpec, InitialStateSpec, OutputSpec, ParameterSpec,
};
use greybox_numerics::parsing::fault::{Fault, pointer_to};
use greybox_numerics::statistics;
use greybox_recording::{Mapped, Recording, RecordingSelection, Split, TimeWindow};
use greybox_simulation::model::{InitialState, ModelDescription, Scale};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// An estimated initial position may differ from the first samples by this share of the range of
/// its output ...
const POSITION_SHARE: f64 = 0.05;
/// ... and an estimated initial rate from the first slope by this share of the steepest slope.
const SLOPE_SHARE: f64 = 0.5;
/// A slope is taken over this share of the record, at least one sample.
const SLOPE_SPAN_SHARE: f64 = 1e-3;

/// What is needed to cut an experiment.
pub(super) struct Cutter<'a> {
    pub description: &'a ModelDescription,
    pub outputs: &'a [MeasuredOutput],
    /// What the job says of them.
    pub output_specs: &'a BTreeMap<String, OutputSpec>,
    pub validation_fraction: f64,
    pub pointer: &'a str,
    /// The place of the experiment in the job.
    pub place: usize,
}

/// An experiment that has been cut.
pub(super) struct Cut {
    pub experiment: Experiment,
    /// For each output the noise of its samples, where it is recorded.
    pub noise: Vec<Option<Vec<f64>>>,
    pub free_states: Vec<FreeState>,
    pub findings: Vec<Finding>,
}

/// A state whose initial value is estimated.
pub(super) struct FreeState {
    pub state: usize,
    pub lower: f64,
    pub upper: f64,
    pub prior: Option<Prior>,
}

/// The name under which an experiment carries the noise of an output.
fn name_of_noise(output: &str) -> String {
    format!("noise of {output}")
}

impl FreeState {
    pub(super) fn coordinate(
        &self,
        description: &ModelDescription,
        experiment: usize,
    ) -> Coordinate {
        let state = &description.states[self.state];
        Coordinate {
            name: name_of_start(&state.name, experiment),
            quantity: state.name.to_string(),
            symbol: format!("{}(0)", state.name),
            unit: state.unit.to_string(),
            target: Target::InitialState {
                experiment,
                state: self.state,
            },
            lower: self.lower,
            upper: self.upper,
            scale: Scale::Linear,
            start: None,
            prior: self.prior,
        }
    }
}

impl Cutter<'_> {
    pub(super) fn cut(
        &self,
        spec: &ExperimentSpec,
        recording: &Recording,
    ) -> Result<Cut, Vec<Fault>> {
        let data = self.data(spec, recording)?;
        let fault = |pointer: String, code: &'static str, detail: String| {
            vec![Fault::new(pointer, code, detail)]
        };
        let split = Split::new(data.samples, self.validation_fraction).map_err(|error| {
            fault(
                "/validation/fraction".to_owned(),
                "too_few_samples",
                error.to_string(),
            )
        })?;
        let mut findings: Vec<Finding> = data
            .notes
            .iter()
            .map(|note| Finding::new(&note.code, self.pointer, &note.detail))
            .collect();
        let (input_set, names) = self.input_set(spec).ok_or_else(|| {
            fault(
                format!("{}/signals", self.pointer),
                "input_missing",
                format!("no input set of `{}` is complete", self.description.name),
            )
        })?;
        let mut faults = Vec::new();
        let inputs = self.inputs(&data, names, &mut findings, &mut faults);
        let measured = self.measured(&data);
        if measured.iter().flatten().all(|value| value.is_nan()) {
            let detail = "every sample of every measured output is missing";
            let pointer = format!("{}/signals", self.pointer);
            faults.push(Fault::new(pointer, "output_missing", detail));
        }
        if !faults.is_empty() {
            return Err(faults);
        }
        let mut experiment = Experiment {
            place: self.place,
            sample_time: data.sample_time,
            instants: data.instants.clone(),
            samples: data.samples,
            estimation_samples: match spec.role {
                ExperimentRole::Estimation => split.estimation.end,
                ExperimentRole::Validation => 0,
            },
            input_set,
            inputs,
            weights: vec![None; measured.len()],
            measured,
            scored_from: match spec.role {
                ExperimentRole::Estimation => split.estimation.end,
                ExperimentRole::Validation => 0,
            },
            initial_state: vec![None; self.description.states.len()],
            parameters: self.own_values(spec),
            unknown_starts: Vec::new(),
            start_samples: spec
                .start_fit_s
                .map(|seconds| (seconds / data.sample_time).ceil() as usize),
        };
        let free_states = self.settle_start(spec, &mut experiment);
        let free_states = match spec.role {
            ExperimentRole::Estimation => free_states,
            ExperimentRole::Validation => fitted_later(&mut experiment, &free_states),
        };
        Ok(Cut {
            noise: self.noise(&data),
            experiment,
            free_states,
            findings,
        })
    }

    /// The part of the recording that the experiment uses.
    fn data(
        &self,
        spec: &ExperimentSpec,
        recording: &Recording,
    ) -> Result<greybox_recording::ExperimentData, Vec<Fault>> {
        let window = spec.window.map(|window| TimeWindow {
            from_s: window.from_s,
            to_s: window.to_s,
        });
        let exclude = spec.left_out();
        let selection = RecordingSelection {
            window,
            exclude: exclude.as_deref(),
            instants: spec.instants,
        };
        let data = recording.experiment(&self.mapped(spec), selection);
        data.map_err(|error| {
            let detail = error.to_string();
            vec![Fault::new(self.pointer, "experiment_not_possible", detail)]
        })
    }

    /// Which recorded signal stands for which of the model's.
    fn mapped(&self, spec: &ExperimentSpec) -> Vec<Mapped> {
        let is_input = |name: &String| {
            let mut inputs = self.description.inputs.iter();
            inputs.any(|input| input.name == *name)
        };
        // An input acts on the plant, and on the model, until the next sample.
        let signals = spec.signals.iter();
        let mapped = signals.map(|(model, recorded)| match is_input(model) {
            true => Mapped::held(model, recorded),
            false => Mapped::on_line(model, recorded),
        });
        let noise = spec.signals.keys().filter_map(|output| {
            let recorded = self.output_specs.get(output)?.noise_signal.as_ref()?;
            Some(Mapped::on_line(&name_of_noise(output), recorded))
        });
        mapped.chain(noise).collect()
    }

    /// For each output the noise of its samples, where it is recorded.
    fn noise(&self, data: &greybox_recording::ExperimentData) -> Vec<Option<Vec<f64>>> {
        let of_output = |output: &MeasuredOutput| {
            let noise = data.signal(&name_of_noise(&output.name));
            noise.map(<[f64]>::to_vec)
        };
        self.outputs.iter().map(of_output).collect()
    }

    /// The parameters that have a known value of their own in this experiment.
    fn own_values(&self, spec: &ExperimentSpec) -> Vec<(usize, f64)> {
        let fixed = spec
            .parameters
            .iter()
            .filter_map(|(name, parameter)| match parameter {
                ParameterSpec::Fixed(fixed) => Some((name, fixed.value)),
                ParameterSpec::Free(_) => None,
            });
        fixed
            .filter_map(|(name, value)| Some((self.description.parameter_index(name)?, value)))
            .collect()
    }

    /// The samples of each input, their holes bridged.
    fn inputs(
        &self,
        data: &greybox_recording::ExperimentData,
        names: &[Cow<'static, str>],
        findings: &mut Vec<Finding>,
        faults: &mut Vec<Fault>,
    ) -> Vec<Vec<f64>> {
        let mut inputs = Vec::new();
        for name in names {
            let pointer = signal_pointer(self.pointer, name);
            let Some((values, holes)) = bridged(data.signal(name).unwrap_or_default().to_vec())
            else {
                let detail = format!("every sample of the input `{name}` is missing");
                faults.push(Fault::new(pointer, "input_missing", detail));
                continue;
            };
            if holes > 0 {
                let detail = format!(
                    "{holes} missing samples of the input `{name}` were bridged by the sample \
                     before; outputs there are less certain than elsewhere"
                );
                findings.push(Finding::new("input_bridged", &pointer, &detail));
            }
            inputs.push(values);
        }
        inputs
    }

    /// The first set of inputs that is fully mapped.
    fn input_set(&self, spec: &ExperimentSpec) -> Option<(usize, &[Cow<'static, str>])> {
        let sets = self.description.input_sets.iter().enumerate();
        let mut complete =
            sets.filter(|(_, set)| set.iter().all(|name| spec.signals.contains_key(&**name)));
        complete.next().map(|(index, set)| (index, set.as_slice()))
    }

    /// The samples of each measured output; missing throughout where this experiment does not
    /// measure it.
    fn measured(&self, data: &greybox_recording::ExperimentData) -> Vec<Vec<f64>> {
        let samples = |output: &MeasuredOutput| {
            data.signal(&output.name)
                .map_or_else(|| vec![f64::NAN; data.samples], <[f64]>::to_vec)
        };
        self.outputs.iter().map(samples).collect()
    }

    /// Settles where each state starts, and answers those that are estimated.
    fn settle_start(&self, spec: &ExperimentSpec, experiment: &mut Experiment) -> Vec<FreeState> {
        let mut free = Vec::new();
        for (state, description) in self.description.states.iter().enumerate() {
            let series = |output: usize| {
                let place = self
                    .outputs
                    .iter()
                    .position(|measured| measured.index == output)?;
                Some(experiment.measured[place].as_slice())
            };
            match spec.initial_state.get(&*description.name) {
                Some(InitialStateSpec::Fixed(fixed)) => {
                    experiment.initial_state[state] = Some(fixed.value);
                }
                Some(InitialStateSpec::Number(value)) => {
                    experiment.initial_state[state] = Some(*value);
                }
                Some(InitialStateSpec::Measured(_)) => {
                    let output = self.description.output_index(&description.name);
                    let first = output.and_then(series).and_then(first_present);
                    experiment.initial_state[state] = first;
                }
                Some(InitialStateSpec::Free(range)) => {
                    let (lower, upper) = (range.estimate.lower, range.estimate.upper);
                    free.push(FreeState {
                        state,
                        lower,
                        upper,
                        prior: range.prior.map(|prior| prior.distribution()),
                    });
                }
                None => {
                    experiment.initial_state[state] = first_sample(description.initial, series);
                    let range = default_range(description.initial, series, experiment);
                    free.extend(range.map(|(lower, upper)| FreeState {
                        state,
                        lower,
                        upper,
                        prior: None,
                    }));
                }
            }
        }
        free
    }
}

/// Leaves starts open that are fitted once the parameters are known: until then they are in the
/// middle of where they may be. None of them is estimated with the parameters.
fn fitted_later(experiment: &mut Experiment, free: &[FreeState]) -> Vec<FreeState> {
    for free in free {
        let (state, lower, upper) = (free.state, free.lower, free.upper);
        experiment.initial_state[state] = Some(f64::midpoint(lower, upper));
        let unknown = UnknownStart {
            state,
            lower,
            upper,
        };
        experiment.unknown_starts.push(unknown);
    }
    Vec::new()
}

/// The input with each hole bridged by the sample before (the first one by the sample after), and
/// the number of holes; none where there is no sample at all.
fn bridged(mut values: Vec<f64>) -> Option<(Vec<f64>, usize)> {
    let mut last = first_present(&values)?;
    let mut holes = 0;
    for value in &mut values {
        if value.is_nan() {
            *value = last;
            holes += 1;
        }
        last = *value;
    }
    Some((values, holes))
}

fn first_present(values: &[f64]) -> Option<f64> {
    values.iter().copied().find(|value| !value.is_nan())
}

/// The first measured sample, where the model starts there.
fn first_sample<'a>(
    initial: InitialState,
    series: impl Fn(usize) -> Option<&'a [f64]>,
) -> Option<f64> {
    match initial {
        InitialState::FirstSample { output } => first_present(series(output)?),
        _ => None,
    }
}

/// Where an initial value is looked for when the job does not say; none where the model knows it.
fn default_range<'a>(
    initial: InitialState,
    series: impl Fn(usize) -> Option<&'a [f64]>,
    experiment: &Experiment,
) -> Option<(f64, f64)> {
    match initial {
        InitialState::Model | InitialState::FirstSample { .. } => None,
        InitialState::EstimatedFromOutput { output } => range_of_start(series(output)?),
        InitialState::EstimatedFromSlope { output } => range_of_slope(series(output)?, experiment),
    }
}

/// Around the first sample, by a share of the signal's range.
fn range_of_start(values: &[f64]) -> Option<(f64, f64)> {
    let first = first_present(values)?;
    let (low, high) = statistics::range(values)?;
    around(first, POSITION_SHARE * (high - low))
}

/// Around the first slope, by a share of the steepest one.
fn range_of_slope(values: &[f64], experiment: &Experiment) -> Option<(f64, f64)> {
    let span = ((values.len() as f64 * SLOPE_SPAN_SHARE) as usize).max(1);
    let ahead = values.iter().skip(span);
    let slopes: Vec<f64> = values
        .iter()
        .zip(ahead)
        .enumerate()
        .map(|(k, (a, b))| (b - a) / (experiment.instant(k + span) - experiment.instant(k)))
        .filter(|slope| !slope.is_nan())
        .collect();
    let steepest = slopes.iter().map(|slope| slope.abs()).fold(0.0, f64::max);
    around(*slopes.first()?, SLOPE_SHARE * steepest)
}

fn around(centre: f64, half: f64) -> Option<(f64, f64)> {
    (half > 0.0).then_some((centre - half, centre + half))
}

/// The place of an experiment's signal in the specification.
pub(super) fn signal_pointer(pointer: &str, signal: &str) -> String {
    pointer_to(&format!("{pointer}/signals"), signal)
}
