//! What moves a plant beside its inputs, as unknowns of a likelihood.
//!
//! [`filtered`] makes of a problem and its disturbances another problem, whose outputs are
//! expectations and whose unknowns are those of the plant, then those of the disturbances and of the
//! sensors. The descents minimise −log L over it as they minimise squares over the free run: each
//! innovation ε with variance S gives two rows, ε/√S and (1 − ε²/S)/√2, whose derivatives make the
//! gradient and the expected information.

use super::loss::Loss;
use super::prior::Prior;
use super::problem::{Coordinate, Experiment, Innovations, Problem, Target};
use greybox_simulation::filter::{FilterLayout, LayoutFault, StartVariance};
use greybox_simulation::model::{ModelDescription, Scale};
use greybox_simulation::program::{
    ActsOn, ControllerFault, ControllerLayout, Disturbance, DisturbanceKind, RecordedQuantity,
};
use std::sync::Arc;

/// A number of a disturbance or of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoiseNumber {
    /// The number is given, SI.
    Given(f64),
    /// The number is an unknown, on a logarithmic scale.
    Unknown {
        /// The least value, above zero, SI.
        lower: f64,
        /// The largest value, SI.
        upper: f64,
        /// The prior knowledge of the number, where there is any.
        prior: Option<Prior>,
    },
}

impl NoiseNumber {
    /// The least value that the number can have.
    #[must_use]
    pub fn least(self) -> f64 {
        match self {
            NoiseNumber::Given(value) => value,
            NoiseNumber::Unknown { lower, .. } => lower,
        }
    }

    /// Whether the number is an unknown.
    #[must_use]
    pub fn is_unknown(self) -> bool {
        matches!(self, NoiseNumber::Unknown { .. })
    }

    /// The given value, or the middle of the range.
    #[must_use]
    pub fn typical(self) -> f64 {
        match self {
            NoiseNumber::Given(value) => value,
            NoiseNumber::Unknown { lower, upper, .. } => (lower * upper).sqrt(),
        }
    }
}

/// A disturbance with its numbers; one with memory has a time constant, others have none.
#[derive(Clone, Debug, PartialEq)]
pub struct ProcessNoise {
    /// The name of the quantity that the disturbance acts on.
    pub name: String,
    /// The quantity that the disturbance acts on, and how it moves.
    pub disturbance: Disturbance,
    /// How strong it is `[unit of what it acts on · √s]`; with memory the strength is
    /// std·√(2·time constant).
    pub strength: NoiseNumber,
    /// How long it remembers `[s]`, where it has a memory.
    pub time_constant: Option<NoiseNumber>,
}

impl ProcessNoise {
    /// The numbers in the order in which the filter takes them.
    pub fn numbers(&self) -> impl Iterator<Item = NoiseNumber> + use<> {
        std::iter::once(self.strength).chain(self.time_constant)
    }

    /// How the quantity moves, and what it acts on.
    #[must_use]
    pub fn in_words(&self, model: &ModelDescription) -> String {
        let kind = match self.disturbance.kind {
            DisturbanceKind::White => "white",
            DisturbanceKind::Memory => "memory",
            DisturbanceKind::Walk => "walk",
        };
        let acts_on = match self.disturbance.acts_on {
            ActsOn::Parameter(index) => format!("`{}`", model.parameters[index].name),
            ActsOn::Rate(index) => format!("the rate of `{}`", model.states[index].name),
            ActsOn::Output(index) => format!("the sensor of `{}`", model.outputs[index].name),
            ActsOn::Sampled(index) => format!("what computes `{}`", model.sampled[index].name),
        };
        format!("{kind} on {acts_on}")
    }

    /// The SI unit of the quantity that the disturbance acts on.
    #[must_use]
    pub fn unit(&self, model: &ModelDescription) -> String {
        match self.disturbance.acts_on {
            ActsOn::Parameter(index) => model.parameters[index].unit.to_string(),
            ActsOn::Rate(index) => format!("{}/s", model.states[index].unit),
            ActsOn::Output(index) => model.outputs[index].unit.to_string(),
            ActsOn::Sampled(index) => model.sampled[index].unit.to_string(),
        }
    }

    /// The size that the disturbance has by its numbers, above zero: errors are measured against it.
    #[must_use]
    pub fn typical_size(&self) -> f64 {
        let strength = self.strength.typical();
        let size = match self.time_constant {
            Some(time_constant) => strength / (2.0 * time_constant.typical()).sqrt(),
            None => strength,
        };
        if size > 0.0 { size } else { 1.0 }
    }
}

/// What the filter needs of a record beside its disturbances.
#[derive(Clone, Debug)]
pub struct FilteredRecord {
    /// How well each state is known at the first sample.
    pub starts: Vec<StartVariance>,
    /// The controller that the model computes from its states once a sample.
    pub controller: Option<ControllerLayout>,
    /// What the controller computes and a measured output shows.
    pub recorded: Vec<RecordedQuantity>,
    /// How many inputs the model reads.
    pub n_inputs: usize,
    /// The longest step of the covariance `[s]`.
    pub longest_step: f64,
}

/// What the filter of a record is asked.
#[must_use]
pub fn layout(disturbances: &[ProcessNoise], record: FilteredRecord) -> FilterLayout {
    FilterLayout {
        disturbances: disturbances.iter().map(|noise| noise.disturbance).collect(),
        sizes: disturbances
            .iter()
            .map(ProcessNoise::typical_size)
            .collect(),
        starts: record.starts,
        controller: record.controller,
        recorded: record.recorded,
        n_inputs: record.n_inputs,
        longest_step: record.longest_step,
        is_traced: false,
    }
}

/// All disturbances of a problem, and its sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseModel {
    /// The disturbances.
    pub disturbances: Vec<ProcessNoise>,
    /// The standard deviation of each compared output's sensor, SI.
    pub sensors: Vec<NoiseNumber>,
    /// Steps of the covariance between two samples.
    pub steps: u32,
}

impl NoiseModel {
    /// The numbers that say how large noises are: strengths, then sensors.
    pub fn sizes(&self) -> impl Iterator<Item = NoiseNumber> + use<'_> {
        let strengths = self.disturbances.iter().map(|noise| noise.strength);
        strengths.chain(self.sensors.iter().copied())
    }

    /// The noise model with a value for each of its unknowns, in their order.
    #[must_use]
    pub fn with_values(&self, values: &[f64]) -> NoiseModel {
        let mut values = values.iter().copied();
        let mut given = |number: NoiseNumber| match number {
            NoiseNumber::Given(_) => number,
            NoiseNumber::Unknown { .. } => NoiseNumber::Given(values.next().unwrap_or_default()),
        };
        let mut disturbances = Vec::new();
        for noise in &self.disturbances {
            let strength = given(noise.strength);
            let time_constant = noise.time_constant.map(&mut given);
            disturbances.push(ProcessNoise {
                strength,
                time_constant,
                ..noise.clone()
            });
        }
        NoiseModel {
            disturbances,
            sensors: self.sensors.iter().copied().map(given).collect(),
            steps: self.steps,
        }
    }

    /// How many of its numbers are unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        let disturbances = self.disturbances.iter();
        let numbers = disturbances.flat_map(ProcessNoise::numbers);
        let numbers = numbers.chain(self.sensors.iter().copied());
        numbers.filter(|number| number.is_unknown()).count()
    }
}

/// Why a problem cannot be filtered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoiseFault {
    /// The model does not allow it.
    #[error("{0}")]
    Model(LayoutFault),
    /// The noise of a sensor differs from sample to sample.
    #[error("the noise of an output differs from sample to sample")]
    SamplesDiffer,
    /// The job asks for a loss other than the square.
    #[error("a filter compares squares, not Huber's loss")]
    Robust,
}

/// The problem whose outputs are expected from sample to sample. The positions of the problem's
/// unknowns stand first among its positions.
///
/// # Errors
/// Where the model or the problem does not allow it.
pub fn filtered(problem: &Problem, noise: &NoiseModel) -> Result<Problem, NoiseFault> {
    let layout = layout_of(problem, noise)?;
    filtered_by(problem, noise, &layout)
}

/// The layout of the filter of a problem.
///
/// # Errors
/// Where the problem does not allow a filter.
pub(super) fn layout_of(problem: &Problem, noise: &NoiseModel) -> Result<FilterLayout, NoiseFault> {
    if problem.loss != Loss::Squared {
        return Err(NoiseFault::Robust);
    }
    let mut experiments = problem.experiments.iter();
    if experiments.any(|data| data.weights.iter().any(Option::is_some)) {
        return Err(NoiseFault::SamplesDiffer);
    }
    let record = FilteredRecord {
        starts: starts(problem),
        controller: controller(problem, &noise.disturbances).map_err(NoiseFault::Model)?,
        recorded: recorded_quantities(problem, &noise.disturbances),
        n_inputs: problem.model.description().inputs.len(),
        longest_step: longest_step(problem, noise.steps),
    };
    Ok(layout(&noise.disturbances, record))
}

/// The problem whose outputs the filter with this layout expects.
///
/// # Errors
/// Where the model does not allow a filter.
pub(super) fn filtered_by(
    problem: &Problem,
    noise: &NoiseModel,
    layout: &FilterLayout,
) -> Result<Problem, NoiseFault> {
    let description = problem.model.description();
    let experiments = problem.experiments.iter();
    let model = problem.model.filtered(layout).map_err(NoiseFault::Model)?;
    let mut next = Problem {
        model: Arc::new(model),
        experiments: Arc::new(
            experiments
                .map(|data| with_measurements(problem, data, &layout.recorded))
                .collect(),
        ),
        innovations: Some(Arc::new(Innovations {
            n_outputs: description.outputs.len(),
            recorded: layout.recorded.iter().map(|shown| shown.output).collect(),
            least_variances: noise
                .sensors
                .iter()
                .map(|sensor| sensor.least().powi(2))
                .collect(),
            sizes: sizes(problem.coordinates.len(), noise),
        })),
        ..problem.clone()
    };
    for noise in &noise.disturbances {
        for (number, noun) in noise.numbers().zip(["strength", "memory"]) {
            add(&mut next, &format!("{noun} of {}", noise.name), number);
        }
    }
    for (index, output) in description.outputs.iter().enumerate() {
        let compared = problem
            .outputs
            .iter()
            .position(|compared| compared.index == index);
        // What no recording has corrects nothing.
        let sensor = compared.map_or(NoiseNumber::Given(1.0), |place| noise.sensors[place]);
        add(&mut next, &format!("noise of {}", output.name), sensor);
    }
    Ok(next)
}

/// The places of the coordinates that say how large noises are, behind so many of the plant.
fn sizes(n_plant: usize, noise: &NoiseModel) -> Vec<usize> {
    // A disturbance has a strength, which is a size, and where it remembers a time constant, which is none.
    let of_disturbances = noise.disturbances.iter();
    let of_disturbances = of_disturbances.flat_map(|noise| noise.numbers().zip([true, false]));
    let of_sensors = noise.sensors.iter().map(|sensor| (*sensor, true));
    let unknown = of_disturbances
        .chain(of_sensors)
        .filter(|(number, _)| number.is_unknown());
    let places = unknown.zip(n_plant..);
    let places = places.filter_map(|((_, is_size), place)| is_size.then_some(place));
    places.collect()
}

/// Adds a number to the parameters, and to the unknowns where it is one.
fn add(problem: &mut Problem, name: &str, number: NoiseNumber) {
    let target = Target::Parameter(problem.parameters.len());
    problem.parameters.push(number.typical());
    if let NoiseNumber::Unknown {
        lower,
        upper,
        prior,
    } = number
    {
        problem.coordinates.push(Coordinate {
            name: name.to_owned(),
            quantity: name.to_owned(),
            symbol: String::new(),
            unit: String::new(),
            target,
            lower,
            upper,
            scale: Scale::Log,
            start: None,
            prior,
        });
    }
}

/// The variance of a state's start that is the first sample of the output which shows the state: that of the
/// sensor's noise, or of the whole signal where no noise is declared.
fn variance_of_first_sample(problem: &Problem, state: usize) -> Option<f64> {
    let shown = problem.model.shown_states();
    let place = problem
        .outputs
        .iter()
        .position(|output| shown.get(output.index) == Some(&Some(state)))?;
    let begins_there = |data: &Experiment| {
        let mut measured = data.measured[place].iter();
        data.initial_state[state].is_some()
            && measured.find(|value| !value.is_nan()).copied() == data.initial_state[state]
    };
    let mut experiments = problem.experiments.iter();
    let scale = problem.outputs[place].residual_scale;
    experiments.all(begins_there).then_some(scale * scale)
}

/// A state whose start is an unknown begins with what disturbances make in one interval, and one that starts at
/// a measured sample is known as well as the sample; every other start is known.
fn starts(problem: &Problem) -> Vec<StartVariance> {
    let is_unknown = |index: usize| {
        let of_state = |coordinate: &Coordinate| matches!(coordinate.target, Target::InitialState { state, .. } if state == index);
        problem.coordinates.iter().any(of_state)
    };
    let states = 0..problem.model.description().states.len();
    states
        .map(|state| match is_unknown(state) {
            true => StartVariance::OneInterval,
            false => {
                let variance = variance_of_first_sample(problem, state);
                StartVariance::Known(variance.unwrap_or(0.0))
            }
        })
        .collect()
}

/// What the controller computes and a compared output shows: what was recorded has acted, and the output tells
/// nothing more. A quantity is not among them where an unknown decides what is computed, or where a disturbance
/// is looked for in it.
pub fn recorded_quantities(
    problem: &Problem,
    disturbances: &[ProcessNoise],
) -> Vec<RecordedQuantity> {
    let parameter = |coordinate: &Coordinate| match coordinate.target {
        Target::Parameter(parameter) => Some(parameter),
        _ => None,
    };
    let unknown: Vec<usize> = problem.coordinates.iter().filter_map(parameter).collect();
    let mut shown = problem.model.recorded_quantities(&unknown);
    shown.retain(|shown| {
        let acts_on = ActsOn::Sampled(shown.quantity);
        let mut compared = problem.outputs.iter();
        compared.any(|output| output.index == shown.output)
            && disturbances
                .iter()
                .all(|noise| noise.disturbance.acts_on != acts_on)
    });
    shown
}

/// The controller within the model; the samples of all experiments must suit it.
fn controller(
    problem: &Problem,
    disturbances: &[ProcessNoise],
) -> Result<Option<ControllerLayout>, LayoutFault> {
    let disturbances: Vec<Disturbance> =
        disturbances.iter().map(|noise| noise.disturbance).collect();
    let mut controllers = Vec::new();
    for data in problem.experiments.iter() {
        let sample_time = data.instants.is_none().then_some(data.sample_time);
        controllers.push(problem.model.controller(sample_time, &disturbances)?);
    }
    match controllers.as_slice() {
        [] => Ok(None),
        [first, others @ ..] if others.iter().all(|controller| controller == first) => Ok(*first),
        _ => Err(LayoutFault::Controller(ControllerFault::UnevenSamples)),
    }
}

fn longest_step(problem: &Problem, steps: u32) -> f64 {
    let intervals = problem.experiments.iter().map(|data| data.sample_time);
    let interval = intervals.fold(f64::INFINITY, f64::min);
    // A little longer, so that rounding does not make one step more.
    interval * (1.0 + 1e-9) / f64::from(steps.max(1))
}

/// The experiment with its measured outputs behind the inputs, in the order of the model's. Samples that are
/// held back correct nothing: what is expected of them is the free run's, with the deviation that the
/// disturbances give it.
fn with_measurements(
    problem: &Problem,
    data: &Experiment,
    recorded: &[RecordedQuantity],
) -> Experiment {
    let description = problem.model.description();
    let mut next = data.clone();
    // A model that has several input sets reads those of the set in use first.
    let missing = vec![f64::NAN; data.samples];
    next.inputs
        .resize(description.inputs.len(), vec![0.0; data.samples]);
    next.inputs
        .extend((0..description.outputs.len()).map(|index| {
            let compared = problem
                .outputs
                .iter()
                .position(|output| output.index == index);
            compared.map_or_else(
                || missing.clone(),
                |place| {
                    let mut measured = data.measured[place].clone();
                    measured[data.estimation_samples..].fill(f64::NAN);
                    measured
                },
            )
        }));
    // What acted is no measurement to be explained.
    for shown in recorded {
        let place = problem
            .outputs
            .iter()
            .position(|output| output.index == shown.output);
        if let Some(place) = place {
            next.measured[place].fill(f64::NAN);
        }
    }
    next
}
