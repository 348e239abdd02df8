//! What is estimated: a model, the experiments that it shall explain, and which of its numbers
//! are unknown.
//!
//! The unknowns are *coordinates*: parameters shared by all experiments, parameters of single
//! experiments, and initial states of single experiments. A candidate is a vector of *positions*,
//! one for each coordinate, from 0 (lower bound) to 1 (upper bound) along the coordinate's scale.

mod assumption;
mod experiment;
mod innovations;
mod target;

pub use assumption::{Assumed, Assumption, SensorNumber};
pub use experiment::{Experiment, UnknownStart};
pub use innovations::Innovations;
pub use target::Target;

use super::loss::Loss;
use super::prior::{JointPrior, Prior, PriorRow};
use greybox_simulation::batch::BatchRun;
use greybox_simulation::model::document::Condition;
use greybox_simulation::model::{Model, Scale};
use greybox_simulation::{Accuracy, DrivingInputs, Plant, SimulatedCandidate};
use std::collections::BTreeMap;
use std::sync::Arc;

/// An output that is measured in at least one experiment.
#[derive(Clone, Debug)]
pub struct MeasuredOutput {
    /// The output's place among the model's outputs.
    pub index: usize,
    /// The name of the output.
    pub name: String,
    /// The SI unit of the output.
    pub unit: String,
    /// The standard deviation of its measurement noise, where the job declares it; the root mean
    /// square where the samples differ ([`Experiment::weights`]).
    pub noise_std: Option<f64>,
    /// What residuals are divided by in the cost: the declared noise, else the spread of the
    /// measured signal.
    pub residual_scale: f64,
}

/// One unknown number.
#[derive(Clone, Debug)]
pub struct Coordinate {
    /// The name of the unknown, which no other coordinate has: the parameter's, or one made of
    /// the parameter's or the state's and the experiment.
    pub name: String,
    /// The name of the parameter or the state.
    pub quantity: String,
    /// The symbol of the unknown in the equations.
    pub symbol: String,
    /// The SI unit of the unknown.
    pub unit: String,
    /// What the coordinate stands for.
    pub target: Target,
    /// The search range, SI.
    pub lower: f64,
    /// The search range, SI.
    pub upper: f64,
    /// How the range is laid out.
    pub scale: Scale,
    /// Where a descent begins beside those of the search, SI, where the job says it.
    pub start: Option<f64>,
    /// The prior knowledge of the unknown, where the job gives any.
    pub prior: Option<Prior>,
}

impl Coordinate {
    /// The value at a position, SI.
    #[must_use]
    pub fn value(&self, position: f64) -> f64 {
        self.scale.value(position, self.lower, self.upper)
    }

    /// Whether the unknown is where a state starts in an experiment.
    #[must_use]
    pub fn is_start(&self) -> bool {
        matches!(self.target, Target::InitialState { .. })
    }

    /// The position at which the job has a descent begin; none where it says nothing.
    #[must_use]
    pub fn start_position(&self) -> Option<f64> {
        let start = self.start?;
        Some(self.scale.position(start, self.lower, self.upper))
    }

    /// dvalue/dposition at a position.
    #[must_use]
    pub fn slope(&self, position: f64) -> f64 {
        match self.scale {
            Scale::Linear => self.upper - self.lower,
            Scale::Log => self.value(position) * libm::log(self.upper / self.lower),
        }
    }
}

/// The whole problem.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The structure.
    pub model: Arc<Model>,
    /// A value for each parameter; those of free parameters are replaced.
    pub parameters: Vec<f64>,
    /// The unknowns.
    pub coordinates: Vec<Coordinate>,
    /// The outputs that are compared.
    pub outputs: Vec<MeasuredOutput>,
    /// The experiments, at least one; shared by the problems that differ in something else.
    pub experiments: Arc<Vec<Experiment>>,
    /// How much a residual counts.
    pub loss: Loss,
    /// What is taken as known, but not exactly.
    pub assumptions: Arc<Vec<Assumption>>,
    /// By its name in the budget, one standard deviation of what is not known of a number whose tolerance the
    /// model and the sections of the job leave open, SI; 0 takes it as exact. What is not named has its default.
    pub tolerances: Arc<BTreeMap<String, f64>>,
    /// What is known of several parameters together beside the data.
    pub joint_priors: Arc<Vec<JointPrior>>,
    /// Conditions that the parameters keep.
    pub constraints: Arc<Vec<Condition>>,
    /// The innovations that are compared where disturbances move the plant, whose outputs `model`
    /// then expects from sample to sample; none: the free run is compared.
    pub innovations: Option<Arc<Innovations>>,
}

/// A candidate spelled out for one experiment.
#[derive(Clone, Debug)]
pub struct Filled {
    /// A value for each parameter, SI.
    pub parameters: Vec<f64>,
    /// Where each state starts.
    pub initial_state: Vec<Option<f64>>,
}

impl Problem {
    /// The problem where innovations are compared, as if no output had been measured but for those that show what
    /// acted.
    #[must_use]
    pub fn without_measurements(mut self) -> Problem {
        if let Some(innovations) = &self.innovations {
            for data in Arc::make_mut(&mut self.experiments) {
                let measured = data.measured_inputs(innovations).iter_mut().enumerate();
                let explained =
                    measured.filter(|(output, _)| !innovations.recorded.contains(output));
                explained.for_each(|(_, samples)| samples.fill(f64::NAN));
            }
        }
        self
    }

    /// The problem of the first part of each experiment that is estimated from, so large a share of it.
    #[must_use]
    pub fn beginning(&self, share: f64) -> Problem {
        let experiments = self.experiments.iter();
        let estimated = experiments.filter(|data| data.estimation_samples > 0);
        let first = estimated.map(|data| {
            let samples = (share * data.estimation_samples as f64).ceil();
            data.part(0, samples as usize)
        });
        Problem {
            experiments: Arc::new(first.collect()),
            ..self.clone()
        }
    }

    /// The clock of the recordings that is taken: how long one of their seconds is `[s]`.
    #[must_use]
    pub fn clock(&self) -> f64 {
        let mut assumptions = self.assumptions.iter();
        let clock = assumptions.find(|assumption| assumption.target == Assumed::Clock);
        clock.map_or(1.0, |clock| clock.taken)
    }

    /// Whether the noise of every output is declared, so that a cost of one is what noise alone
    /// leaves.
    #[must_use]
    pub fn declares_noise(&self) -> bool {
        let declares = |output: &MeasuredOutput| output.noise_std == Some(output.residual_scale);
        self.outputs.iter().all(declares)
    }

    /// The residuals of the priors at a candidate's positions.
    pub fn prior_rows(&self, positions: &[f64]) -> Vec<PriorRow> {
        let pairs = self.coordinates.iter().zip(positions).enumerate();
        let single = pairs.filter_map(|(index, (coordinate, position))| {
            let prior = coordinate.prior?;
            let value = coordinate.value(*position);
            let slope = prior.slope(value) * coordinate.slope(*position);
            Some(PriorRow {
                residual: prior.residual(value),
                slopes: vec![(index, slope)],
            })
        });
        let mut rows: Vec<PriorRow> = single.collect();
        for joint in self.joint_priors.iter() {
            let places = |parameter: &usize| self.place_of(*parameter);
            let places: Vec<Option<usize>> = joint.parameters.iter().map(places).collect();
            let members = joint.parameters.iter().zip(&places);
            let members = members.map(|(parameter, place)| {
                let slope = |place: usize| self.coordinates[place].slope(positions[place]);
                (
                    self.shared_value(*parameter, positions),
                    place.map_or(0.0, slope),
                )
            });
            rows.extend(joint.rows(&members.collect::<Vec<_>>(), &places));
        }
        rows
    }

    /// The coordinate of a parameter that experiments share, by its place; none where it is known.
    #[must_use]
    pub fn place_of(&self, parameter: usize) -> Option<usize> {
        let mut coordinates = self.coordinates.iter();
        coordinates.position(|coordinate| coordinate.target == Target::Parameter(parameter))
    }

    /// The value of a parameter that experiments share at a candidate's positions, SI.
    #[must_use]
    pub fn shared_value(&self, parameter: usize, positions: &[f64]) -> f64 {
        match self.place_of(parameter) {
            Some(place) => self.coordinates[place].value(positions[place]),
            None => self.parameters[parameter],
        }
    }

    /// What is known of a coordinate before the data are looked at: its own prior, or its share of
    /// a joint one.
    #[must_use]
    pub fn prior_of(&self, coordinate: usize) -> Option<Prior> {
        let coordinate = &self.coordinates[coordinate];
        let Target::Parameter(parameter) = coordinate.target else {
            return coordinate.prior;
        };
        let mut joint = self.joint_priors.iter();
        coordinate
            .prior
            .or_else(|| joint.find_map(|joint| joint.marginal(parameter)))
    }

    /// The sum of squares of the priors' residuals, and how many they are.
    #[must_use]
    pub fn prior_sum(&self, positions: &[f64]) -> (f64, usize) {
        let rows = self.prior_rows(positions);
        let squares = rows.iter().map(|row| row.residual * row.residual);
        (squares.sum(), rows.len())
    }

    /// The value of each coordinate at a candidate's positions, SI.
    #[must_use]
    pub fn values(&self, positions: &[f64]) -> Vec<f64> {
        let pairs = self.coordinates.iter().zip(positions);
        pairs
            .map(|(coordinate, position)| coordinate.value(*position))
            .collect()
    }

    /// Pairs the items of all outputs, in the order of the problem, with the names of the outputs.
    pub(crate) fn by_output<T: Clone>(&self, items: &[T]) -> BTreeMap<String, T> {
        let names = self.outputs.iter().map(|output| output.name.clone());
        names.zip(items.iter().cloned()).collect()
    }

    /// The names of the coordinates with their values at a candidate's positions, SI.
    #[must_use]
    pub fn named_values(&self, positions: &[f64]) -> Vec<(String, f64)> {
        let names = self
            .coordinates
            .iter()
            .map(|coordinate| coordinate.name.clone());
        names.zip(self.values(positions)).collect()
    }

    /// The candidate spelled out for an experiment.
    #[must_use]
    pub fn fill(&self, experiment: usize, positions: &[f64]) -> Filled {
        let experiment = &self.experiments[experiment];
        let mut filled = Filled {
            parameters: self.parameters.clone(),
            initial_state: experiment.initial_state.clone(),
        };
        let pairs = self.coordinates.iter().zip(positions);
        let mut given = experiment.parameters.clone();
        for (coordinate, position) in pairs {
            let value = coordinate.value(*position);
            match coordinate.target {
                Target::Parameter(index) => filled.parameters[index] = value,
                target if target.experiment() != Some(experiment.place) => {}
                Target::ExperimentParameter { parameter, .. } => given.push((parameter, value)),
                Target::InitialState { state, .. } => {
                    filled.initial_state[state].get_or_insert(value);
                }
            }
        }
        for (parameter, value) in given {
            filled.parameters[parameter] = value;
        }
        filled
    }

    /// The model's equations for the candidates of this problem: what all of them take as known
    /// is settled.
    #[must_use]
    pub fn plant(&self) -> Arc<dyn Plant> {
        let mut fixed: Vec<Option<f64>> = self.parameters.iter().copied().map(Some).collect();
        for coordinate in &self.coordinates {
            if let Target::Parameter(parameter) | Target::ExperimentParameter { parameter, .. } =
                coordinate.target
            {
                fixed[parameter] = None;
            }
        }
        for (parameter, value) in self.experiments.iter().flat_map(|data| &data.parameters) {
            fixed[*parameter] = fixed[*parameter].filter(|common| common == value);
        }
        self.model.plant_with(&fixed)
    }

    /// The fastest rate of the candidate in any experiment, as far as its model tells [1/s].
    #[must_use]
    pub fn fastest_rate(&self, positions: &[f64]) -> f64 {
        let plant = self.plant();
        let rate = |experiment| plant.fastest_rate(&self.fill(experiment, positions).parameters);
        (0..self.experiments.len()).map(rate).fold(0.0, f64::max)
    }

    /// Residuals at hand: samples that are there, over all outputs and experiments, in the part
    /// that is estimated from.
    #[must_use]
    pub fn n_residuals(&self) -> usize {
        let count = |experiment: &Experiment| -> usize {
            let part = |values: &Vec<f64>| present(&values[..experiment.estimation_samples]);
            experiment.measured.iter().map(part).sum()
        };
        self.experiments.iter().map(count).sum()
    }

    /// Rows of the least squares that the residuals make: an innovation makes two.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        let of_each = if self.innovations.is_some() { 2 } else { 1 };
        of_each * self.n_residuals()
    }
}

fn present(values: &[f64]) -> usize {
    values.iter().filter(|value| !value.is_nan()).count()
}

/// How much of each experiment is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// What is estimated from.
    Estimation,
    /// The whole experiment.
    Whole,
}

/// Candidates spelled out for all experiments, ready for a batch.
#[derive(Debug)]
pub struct Spelled {
    filled: Vec<Vec<Filled>>,
    /// How many, from the first on, take the steps of the first.
    in_step: usize,
}

impl Spelled {
    /// Spells candidates out, each with the steps that it needs.
    #[must_use]
    pub fn new(problem: &Problem, candidates: &[Vec<f64>]) -> Self {
        let of_experiment = |experiment| {
            candidates
                .iter()
                .map(|positions| problem.fill(experiment, positions))
                .collect()
        };
        let filled = (0..problem.experiments.len()).map(of_experiment).collect();
        Spelled { filled, in_step: 0 }
    }

    /// Lets the first `members` take the same steps: those that the first of them needs.
    #[must_use]
    pub fn in_step(self, members: usize) -> Self {
        Spelled {
            in_step: members,
            ..self
        }
    }

    /// One run for each experiment.
    #[must_use]
    pub fn runs<'a>(
        &'a self,
        problem: &'a Problem,
        extent: Extent,
        accuracy: Accuracy,
    ) -> Vec<BatchRun<'a>> {
        let pairs = problem.experiments.iter().zip(&self.filled);
        pairs
            .map(|(experiment, filled)| BatchRun {
                excitation: DrivingInputs {
                    sample_time: experiment.sample_time,
                    instants: experiment.instants.as_deref(),
                    samples: match extent {
                        Extent::Estimation => experiment.estimation_samples,
                        Extent::Whole => experiment.samples,
                    },
                    input_set: experiment.input_set,
                    inputs: &experiment.inputs,
                    accuracy,
                },
                candidates: filled
                    .iter()
                    .map(|filled| SimulatedCandidate {
                        parameters: &filled.parameters,
                        initial_state: &filled.initial_state,
                    })
                    .collect(),
                in_step: self.in_step,
            })
            .collect()
    }
}
