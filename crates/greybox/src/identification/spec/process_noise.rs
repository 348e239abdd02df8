//! The `process_noise` section: what moves the plant and was not recorded.

use super::parameter::check_range;
use super::{PriorSpec, entries, prior};
use crate::estimation::Settings;
use crate::estimation::prior::Prior;
use crate::estimation::process_noise::{NoiseNumber, ProcessNoise};
use crate::estimation::sought_noise::{SoughtDisturbance, SoughtNumber};
use crate::uncertainty::{self, SoughtNoise};
use greybox_numerics::parsing::reader::{Field, Object, did_you_mean};
use greybox_simulation::model::{ModelDescription, Scale};
use greybox_simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The disturbances of one document at the most.
pub const MAX_DISTURBANCES: usize = 8;

/// What may move the plant beside its inputs: a word, or a list of disturbances.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
#[schema(as = ProcessNoiseOfJob)]
pub enum JobNoiseSpec {
    /// Who decides.
    Choice(NoiseChoice),
    /// These disturbances.
    Listed(Vec<ProcessNoiseSpec>),
}

/// Who decides what may move the plant beside its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseChoice {
    /// Nothing moves it: the free run is compared with the data.
    None,
    /// The data: where the residuals of the free run are not white, noise models are compared.
    Auto,
}

impl JobNoiseSpec {
    /// What holds where a job says nothing: the data decide, unless the job asks for an answer that only a free
    /// run can give.
    pub(super) fn unsaid(method: &Settings, uncertainty: &uncertainty::Settings) -> JobNoiseSpec {
        let needs_free_run =
            method.huber_threshold.is_some() || uncertainty.has_independent_refits();
        JobNoiseSpec::Choice(match needs_free_run {
            true => NoiseChoice::None,
            false => NoiseChoice::Auto,
        })
    }

    /// The disturbances that are looked for in a model.
    #[must_use]
    pub fn sought(&self, model: &ModelDescription) -> SoughtNoise {
        match self {
            JobNoiseSpec::Choice(NoiseChoice::None) => SoughtNoise::None,
            JobNoiseSpec::Choice(NoiseChoice::Auto) => SoughtNoise::Auto,
            JobNoiseSpec::Listed(listed) => {
                let sought = listed
                    .iter()
                    .filter_map(|disturbance| disturbance.sought(model));
                SoughtNoise::Listed(sought.collect())
            }
        }
    }
}

/// A quantity that wanders and was not recorded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProcessNoise, example = json!({
    "acts_on": {"state": "velocity"}, "kind": "memory", "std": 0.2, "time_constant_s": 0.5
}))]
pub struct ProcessNoiseSpec {
    /// What the quantity acts on.
    pub acts_on: ActsOnSpec,
    /// How the quantity moves.
    pub kind: NoiseKind,
    /// The standard deviation of a quantity with memory, in the unit of what it acts on; a state's
    /// is that of its rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub std: Option<NoiseNumberSpec>,
    /// How long a quantity with memory remembers `[s]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub time_constant_s: Option<NoiseNumberSpec>,
    /// The strength of white noise, in the unit of what it acts on times √s, or that of a walk, in
    /// the unit of what it acts on per √s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub strength: Option<NoiseNumberSpec>,
}

/// A number of a disturbance: given, or, in jobs, estimated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged, deny_unknown_fields)]
#[schema(as = NoiseNumber)]
pub enum NoiseNumberSpec {
    /// The number, SI.
    Given(f64),
    /// The number is an unknown.
    #[schema(title = "EstimatedNoiseNumber")]
    Estimated {
        /// Where the number is looked for; `{}`: where the residuals of the free run and the length of the
        /// record put it.
        estimate: NoiseRange,
        /// The prior knowledge of the number.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(nullable = false)]
        prior: Option<PriorSpec>,
    },
}

/// The search range of a number of a disturbance, SI: both ends, or none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"lower": 0.05, "upper": 5.0}))]
pub struct NoiseRange {
    /// The lower bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, nullable = false)]
    pub lower: Option<f64>,
    /// The upper bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, nullable = false)]
    pub upper: Option<f64>,
}

impl NoiseNumberSpec {
    /// The number that is looked for, times a factor.
    fn sought(self, factor: f64) -> SoughtNumber {
        match self {
            NoiseNumberSpec::Given(value) => {
                SoughtNumber::Stated(NoiseNumber::Given(value * factor))
            }
            NoiseNumberSpec::Estimated { estimate, prior } => {
                match (estimate.lower, estimate.upper) {
                    (Some(lower), Some(upper)) => SoughtNumber::Stated(NoiseNumber::Unknown {
                        lower: lower * factor,
                        upper: upper * factor,
                        prior: prior.map(|prior| scaled(prior.distribution(), factor)),
                    }),
                    _ => SoughtNumber::Open,
                }
            }
        }
    }

    fn given(self) -> Option<f64> {
        match self {
            NoiseNumberSpec::Given(value) => Some(value),
            NoiseNumberSpec::Estimated { .. } => None,
        }
    }
}

/// The prior of a number, as the prior of its product with a factor.
fn scaled(prior: Prior, factor: f64) -> Prior {
    match prior.scale {
        Scale::Linear => Prior {
            middle: prior.middle * factor,
            deviation: prior.deviation * factor,
            ..prior
        },
        Scale::Log => Prior {
            middle: prior.middle + libm::log(factor),
            ..prior
        },
    }
}

/// The strength of a disturbance with memory over its standard deviation.
fn strength_per_std(time_constant: f64) -> f64 {
    (2.0 * time_constant).sqrt()
}

impl ProcessNoiseSpec {
    /// The disturbance that is looked for in a model; none where the model has no such quantity.
    fn sought(&self, model: &ModelDescription) -> Option<SoughtDisturbance> {
        let open = SoughtDisturbance::open(self.acts_on.place(model)?, self.kind.of_process());
        let memory = self.time_constant_s.map(|number| number.sought(1.0));
        let given = self.time_constant_s.and_then(NoiseNumberSpec::given);
        let strength = match (self.strength, self.std, given) {
            (Some(strength), _, _) => strength.sought(1.0),
            (None, Some(std), Some(memory)) => std.sought(strength_per_std(memory)),
            _ => SoughtNumber::Open,
        };
        Some(SoughtDisturbance {
            strength,
            time_constant: memory.unwrap_or(SoughtNumber::Open),
            ..open
        })
    }

    /// The disturbance of a simulation; none where a number is not given.
    pub(crate) fn known(&self, model: &ModelDescription) -> Option<ProcessNoise> {
        let time_constant = match self.time_constant_s {
            Some(number) => Some(number.given()?),
            None => None,
        };
        let strength = match (self.strength, self.std, time_constant) {
            (Some(strength), _, _) => strength.given()?,
            (None, Some(std), Some(memory)) => std.given()? * strength_per_std(memory),
            _ => return None,
        };
        Some(ProcessNoise {
            name: self.acts_on.name().to_owned(),
            disturbance: Disturbance {
                acts_on: self.acts_on.place(model)?,
                kind: self.kind.of_process(),
            },
            strength: NoiseNumber::Given(strength),
            time_constant: time_constant.map(NoiseNumber::Given),
        })
    }
}

/// What a disturbance acts on: one of the four.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schema(as = ActsOn)]
pub enum ActsOnSpec {
    /// A parameter, which wanders about its value.
    Parameter(String),
    /// A state, whose rate is disturbed.
    State(String),
    /// What a controller within the model computes once a sample: the plant receives something else.
    Sampled(String),
    /// An output, whose sensor drifts.
    Output(String),
}

/// How a disturbance moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseKind {
    /// The quantity forgets its value at once.
    White,
    /// The quantity forgets its value within its time constant (an Ornstein–Uhlenbeck process).
    Memory,
    /// The quantity keeps its value but for what is added.
    Walk,
}

impl ActsOnSpec {
    /// The name of the quantity.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            ActsOnSpec::Parameter(name)
            | ActsOnSpec::State(name)
            | ActsOnSpec::Sampled(name)
            | ActsOnSpec::Output(name) => name,
        }
    }

    /// The quantity of a model; none where the model has none of the name.
    fn place(&self, model: &ModelDescription) -> Option<ActsOn> {
        match self {
            ActsOnSpec::Parameter(name) => model.parameter_index(name).map(ActsOn::Parameter),
            ActsOnSpec::State(name) => model.state_index(name).map(ActsOn::Rate),
            ActsOnSpec::Sampled(name) => model.sampled_index(name).map(ActsOn::Sampled),
            ActsOnSpec::Output(name) => model.output_index(name).map(ActsOn::Output),
        }
    }

    /// The quantity of a model.
    #[must_use]
    pub fn of(acts_on: ActsOn, model: &ModelDescription) -> ActsOnSpec {
        match acts_on {
            ActsOn::Parameter(index) => {
                ActsOnSpec::Parameter(model.parameters[index].name.to_string())
            }
            ActsOn::Rate(index) => ActsOnSpec::State(model.states[index].name.to_string()),
            ActsOn::Sampled(index) => ActsOnSpec::Sampled(model.sampled[index].name.to_string()),
            ActsOn::Output(index) => ActsOnSpec::Output(model.outputs[index].name.to_string()),
        }
    }
}

impl NoiseKind {
    /// The word in documents.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            NoiseKind::White => "white",
            NoiseKind::Memory => "memory",
            NoiseKind::Walk => "walk",
        }
    }

    fn of_process(self) -> DisturbanceKind {
        match self {
            NoiseKind::White => DisturbanceKind::White,
            NoiseKind::Memory => DisturbanceKind::Memory,
            NoiseKind::Walk => DisturbanceKind::Walk,
        }
    }
}

impl From<DisturbanceKind> for NoiseKind {
    fn from(kind: DisturbanceKind) -> NoiseKind {
        match kind {
            DisturbanceKind::White => NoiseKind::White,
            DisturbanceKind::Memory => NoiseKind::Memory,
            DisturbanceKind::Walk => NoiseKind::Walk,
        }
    }
}

/// What a job says of its disturbances; what is wrong is told.
pub(super) fn read_of_job(field: &Field<'_>, model: Option<&ModelDescription>) -> JobNoiseSpec {
    if field.value.is_string() {
        let choice = field.choice(&[("none", NoiseChoice::None), ("auto", NoiseChoice::Auto)]);
        return JobNoiseSpec::Choice(choice.unwrap_or(NoiseChoice::None));
    }
    let listed = model.map(|model| read_all(field, model));
    JobNoiseSpec::Listed(listed.unwrap_or_default())
}

/// The disturbances of a simulation, all of whose numbers are given; what is wrong is told.
pub(super) fn read_known(field: &Field<'_>, model: &ModelDescription) -> Vec<ProcessNoise> {
    let listed = read_all(field, model);
    let disturbances = listed.iter().filter_map(|listed| {
        let disturbance = listed.known(model);
        if disturbance.is_none() {
            let detail = "a simulation estimates nothing: every number of a disturbance is given";
            field.fault("estimate_in_simulation", detail);
        }
        disturbance
    });
    disturbances.collect()
}

fn read_all(field: &Field<'_>, model: &ModelDescription) -> Vec<ProcessNoiseSpec> {
    let entries = entries::first(field, MAX_DISTURBANCES, "disturbances");
    entries
        .filter_map(|entry| read_disturbance(&entry, model))
        .collect()
}

fn read_disturbance(field: &Field<'_>, model: &ModelDescription) -> Option<ProcessNoiseSpec> {
    let mut object = field.object()?;
    let acts_on = object.required("acts_on");
    let acts_on = acts_on.and_then(|field| read_target(&field, model));
    let kind = object.required("kind").and_then(|field| {
        field.choice(&[
            ("white", NoiseKind::White),
            ("memory", NoiseKind::Memory),
            ("walk", NoiseKind::Walk),
        ])
    });
    let (mut std, mut time_constant_s, mut strength) = (None, None, None);
    match kind {
        Some(NoiseKind::Memory) => {
            std = object
                .required("std")
                .and_then(|field| read_number(&field, true));
            let memory = object.required("time_constant_s");
            time_constant_s = memory.and_then(|field| read_number(&field, false));
            refuse_half_known(&object, std, time_constant_s);
        }
        Some(NoiseKind::White | NoiseKind::Walk) => {
            let number = object.required("strength");
            strength = number.and_then(|field| read_number(&field, true));
        }
        None => {}
    }
    object.finish();
    let (acts_on, kind) = (acts_on?, kind?);
    if kind == NoiseKind::White && matches!(acts_on, ActsOnSpec::Output(_)) {
        let detail = "white noise of a sensor is its `noise_std`";
        field.fault("kind_not_possible", detail);
    }
    let is_complete = strength.is_some() || (std.is_some() && time_constant_s.is_some());
    is_complete.then_some(ProcessNoiseSpec {
        acts_on,
        kind,
        std,
        time_constant_s,
        strength,
    })
}

/// The filter knows a disturbance with memory by its strength, std·√(2·time constant): nothing is known of
/// it where one of the two is unknown and the other is not free.
fn refuse_half_known(
    object: &Object<'_>,
    std: Option<NoiseNumberSpec>,
    time_constant: Option<NoiseNumberSpec>,
) {
    let is_free = |number: NoiseNumberSpec| number.sought(1.0) == SoughtNumber::Open;
    if let (Some(std), Some(time_constant)) = (std, time_constant)
        && time_constant.given().is_none()
        && !is_free(std)
    {
        let detail = "with an estimated `time_constant_s` nothing can be said of `std` before: let \
                      it be {\"estimate\": {}}, or give the time constant";
        object.fault("std_not_free", detail);
    }
}

/// A number, or `{"estimate": {…}, "prior": …}`.
fn read_number(field: &Field<'_>, may_be_zero: bool) -> Option<NoiseNumberSpec> {
    if !field.value.is_object() {
        let number = match may_be_zero {
            true => field.number_within(0.0, f64::MAX),
            false => field.positive(),
        };
        return number.map(NoiseNumberSpec::Given);
    }
    let mut object = field.object()?;
    let estimate = object
        .required("estimate")
        .and_then(|field| read_range(&field));
    let prior_field = object.optional("prior");
    let prior = prior_field.as_ref().and_then(prior::read);
    object.finish();
    let estimate = estimate?;
    if let (Some(field), None) = (&prior_field, estimate.lower) {
        let detail = "a prior stands beside a search range: give `lower` and `upper`";
        field.fault("range_needed", detail);
    }
    Some(NoiseNumberSpec::Estimated { estimate, prior })
}

fn read_range(field: &Field<'_>) -> Option<NoiseRange> {
    let mut object = field.object()?;
    let [lower, upper] = ["lower", "upper"].map(|name| object.optional(name));
    let is_half = lower.is_some() != upper.is_some();
    let [lower, upper] = [lower, upper].map(|field| field.and_then(|field| field.positive()));
    object.finish();
    if is_half {
        field.fault(
            "missing_field",
            "both `lower` and `upper` are needed, or none",
        );
    }
    if let (Some(lower), Some(upper)) = (lower, upper) {
        check_range(field, lower, upper)?;
    }
    Some(NoiseRange { lower, upper })
}

fn read_target(field: &Field<'_>, model: &ModelDescription) -> Option<ActsOnSpec> {
    let mut object = field.object()?;
    let [parameter, state, sampled, output] =
        ["parameter", "state", "sampled", "output"].map(|name| object.optional(name));
    let parameters = model.parameters.iter().map(|parameter| &*parameter.name);
    let states = model.states.iter().map(|state| &*state.name);
    let outputs = model.outputs.iter().map(|output| &*output.name);
    let computed = model.sampled.iter().map(|quantity| &*quantity.name);
    let target = match (&parameter, &state, &sampled, &output) {
        (Some(field), None, None, None) => named(field, parameters).map(ActsOnSpec::Parameter),
        (None, Some(field), None, None) => named(field, states).map(ActsOnSpec::State),
        (None, None, Some(field), None) => named(field, computed).map(ActsOnSpec::Sampled),
        (None, None, None, Some(field)) => named(field, outputs).map(ActsOnSpec::Output),
        _ => {
            let detail =
                "a disturbance acts on one of `parameter`, `state`, `sampled` and `output`";
            field.fault("acts_on_unclear", detail);
            None
        }
    };
    object.finish();
    target
}

/// One of the names of a model.
fn named<'a>(
    field: &Field<'_>,
    mut names: impl Iterator<Item = &'a str> + Clone,
) -> Option<String> {
    let name = field.text()?;
    if !names.clone().any(|candidate| candidate == name) {
        let hint = did_you_mean(name, names.by_ref());
        field.fault("unknown_name", format!("the model has no `{name}`{hint}"));
        return None;
    }
    Some(name.to_owned())
}
