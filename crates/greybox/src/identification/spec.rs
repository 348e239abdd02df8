//! What a job is asked to do. A [`JobSpec`] that exists can run.
//!
//! [`JobSpec::read`] turns a submitted document into one: it collects all faults at once and
//! completes every default, so that the stored specification says everything that made a result
//! and reads back to itself.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use utoipa::ToSchema;
use uuid::Uuid;

use super::id::DatasetId;
use crate::estimation::Settings;
pub use crate::estimation::settings::MethodName;
use crate::uncertainty::{self, Intervals, SoughtNoise};
use greybox_numerics::parsing::Fault;
use greybox_simulation::model::{ModelDescription, Tolerance, ToleranceText};

mod constraints;
mod context;
pub mod design;
mod entries;
mod exclude;
mod experiment;
mod initial_state;
mod joint_prior;
mod labels;
mod limits;
mod method;
mod model;
mod model_search;
mod outputs;
mod own_parameters;
mod parameter;
mod prior;
mod process_noise;
pub mod selection;
mod tolerances;
mod validation;
mod version;
mod window;

pub mod simulation;
#[cfg(test)]
mod tests;

pub use context::Context;
pub use experiment::{ExperimentRole, ExperimentSpec, MAX_EXPERIMENTS};
pub use initial_state::{FirstSample, FreeState, InitialStateSpec, StateRange};
pub use joint_prior::JointPriorSpec;
pub use labels::{MAX_LABELS, MAX_NAME_CHARS, MAX_NOTE_CHARS, label, name, note};
pub use limits::LimitsSpec;
pub use model::ModelOfJob;
use model::read_model;
pub use model_search::ModelSearch;
pub use outputs::OutputSpec;
pub use parameter::{FixedValue, FreeParameter, ParameterSpec, SearchRange};
pub use prior::PriorSpec;
pub use process_noise::{
    ActsOnSpec, JobNoiseSpec, MAX_DISTURBANCES, NoiseChoice, NoiseKind, NoiseNumberSpec,
    NoiseRange, ProcessNoiseSpec,
};
pub use validation::ValidationSpec;
pub use version::{
    MAX_MARKS, MAX_VERSION, NewVersion, RecordingVersions, read_new_version, read_reason,
};
pub use window::WindowSpec;

use greybox_numerics::parsing::reader::{Field, Object, read_document};
use greybox_numerics::parsing::settings::Section as _;
use labels::WordsOfSpec;
use own_parameters::JobParameters;

/// The largest seed: every JSON client keeps it exactly.
pub const MAX_SEED: u64 = (1 << 53) - 1;

/// An estimation job: what is measured, what is unknown, how it is looked for.
///
/// Only `model` and `experiments` are needed; everything else has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "name": "rig 4 commissioning",
    "labels": {"site": "hall 2"},
    "model": "single_rod_servo",
    "experiments": [{
        "dataset": "ds_0192d3a4b5c67d8e9f00112233445566",
        "signals": {"reference": "reference", "position": "position"},
        "window": {"from_s": 0, "to_s": 60}
    }],
    "parameters": {
        "mass": {"estimate": {"lower": 20, "upper": 120}},
        "supply_pressure": {"value": 7e6}
    },
    "outputs": {"position": {"noise_std": 1e-5}},
    "method": {"name": "icra_genetic", "population": 30, "generations": 200},
    "validation": {"fraction": 0.25},
    "limits": {"max_duration_s": 600},
    "seed": 1
}))]
pub struct JobSpec {
    /// A name for people.
    #[schema(max_length = 200)]
    pub name: Option<String>,
    /// Up to 16 words to find the job by, e.g. `{"site": "hall 2"}`.
    #[serde(default)]
    #[schema(example = json!({"site": "hall 2"}))]
    pub labels: BTreeMap<String, String>,
    /// What people should know of the job, in lines of text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 4000, nullable = false)]
    pub note: Option<String>,
    /// The model whose parameters are estimated: a name that `/v1/models` lists, or a model
    /// document. The completed specification names it.
    #[schema(value_type = ModelOfJob, example = "single_rod_servo")]
    pub model: String,
    /// The recordings to explain, all with the same parameters.
    #[schema(min_items = 1, max_items = 32)]
    pub experiments: Vec<ExperimentSpec>,
    /// By the model's name, what is known about each parameter. A parameter that is not named is
    /// estimated when the model calls it unknown by default, else it has the model's default.
    #[serde(default)]
    pub parameters: BTreeMap<String, ParameterSpec>,
    /// By the model's name, what is known about each measured output.
    #[serde(default)]
    pub outputs: BTreeMap<String, OutputSpec>,
    /// How well the clock is known that all recordings are sampled by: one standard deviation as a
    /// share, e.g. `"0.01 %"`; left out, it is taken as exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<ToleranceText>, nullable = false, example = "0.01 %")]
    pub clock_tolerance: Option<Tolerance>,
    /// How well numbers are known that a model document takes as exact, by their names in the budget: one
    /// standard deviation, SI, or of a gain a share such as `"1 %"`; 0 takes the number as exact, and `"*": 0`
    /// all that are not named. What is not named has a small default.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(value_type = BTreeMap<String, ToleranceText>, required = false, example = json!({
        "pump.input_gain": "1 %", "level.quadratic_loss": 0
    }))]
    pub tolerances: BTreeMap<String, Tolerance>,
    /// Conditions that the parameters keep, up to 16: comparisons of expressions in the language of
    /// model documents, numbers in SI units.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false, max_items = 16, example = json!(["tau1 < tau2", "k1 + k2 <= 1"]))]
    pub constraints: Vec<String>,
    /// What is known of several parameters together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false, max_items = 16)]
    pub priors: Vec<JointPriorSpec>,
    /// How the parameters are looked for.
    #[serde(default)]
    #[schema(required = false)]
    pub method: Settings,
    /// Which effects of the model the data shall decide about.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub model_search: Option<ModelSearch>,
    /// What may move the plant beside its inputs and was not recorded: `"none"`, `"auto"` or a list. Left out,
    /// it is `"auto"`; with Huber's loss, and with intervals or samples from refits, it is `"none"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub process_noise: Option<JobNoiseSpec>,
    /// How closely the estimate's uncertainty is looked at.
    #[serde(default)]
    #[schema(required = false)]
    pub uncertainty: uncertainty::Settings,
    /// Which data are held back to check the result.
    #[serde(default)]
    #[schema(required = false)]
    pub validation: ValidationSpec,
    /// When to stop at the latest.
    #[serde(default)]
    #[schema(required = false)]
    pub limits: LimitsSpec,
    /// Where every random number comes from; drawn when absent.
    #[schema(required = false, maximum = 9007199254740991_i64)]
    pub seed: u64,
}

impl JobSpec {
    /// Reads a submitted document, or says everything that is wrong with it.
    pub fn read(document: &Value, context: &Context<'_>) -> Result<JobSpec, Vec<Fault>> {
        read_document(document, |field| read_spec(field, context))
    }

    /// The specification once more, after every check that a submitted document passes.
    ///
    /// # Errors
    /// Everything that is wrong with the specification.
    pub fn checked(&self, context: &Context<'_>) -> Result<JobSpec, Vec<Fault>> {
        let document = serde_json::to_value(self).expect("a specification has only text keys");
        JobSpec::read(&document, context)
    }

    /// `sha256:…` of the completed specification.
    #[must_use]
    pub fn digest(&self) -> String {
        let text = serde_json::to_vec(self).expect("a specification has only text keys");
        let digest = Sha256::digest(text);
        let digits: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("sha256:{digits}")
    }

    /// Whether an experiment that is estimated from takes the job's value of a parameter, and not
    /// one of its own.
    #[must_use]
    pub fn shares(&self, parameter: &str) -> bool {
        own_parameters::shares(&self.experiments, parameter)
    }

    /// What Huber's loss asks of the rest of the job: a noise level to measure residuals by, and
    /// nothing that compares likelihoods.
    fn check_loss(&self, job: &Object<'_>, model: &ModelDescription) {
        if self.method.huber_threshold.is_none() {
            return;
        }
        let is_measured = |name: &str| {
            let mut experiments = self.experiments.iter();
            experiments.any(|experiment| experiment.signals.contains_key(name))
        };
        let has_noise = |name: &str| {
            let output = self.outputs.get(name);
            output.is_some_and(OutputSpec::declares_noise)
        };
        let outputs = model.outputs.iter().map(|output| &*output.name);
        for output in outputs.filter(|name| is_measured(name) && !has_noise(name)) {
            let detail = format!(
                "`method.huber_threshold` counts in units of the noise: \
                 `outputs.{output}.noise_std` is needed"
            );
            job.fault("missing_field", detail);
        }
        if self.model_search.is_some() {
            let detail = "`model_search` compares models by the likelihood of normal noise, which \
                          `method.huber_threshold` gives up: leave one of them out";
            job.fault("contradiction", detail);
        }
        if matches!(
            self.uncertainty.intervals,
            Intervals::Profile | Intervals::Posterior
        ) {
            let detail = "profile intervals and draws from the posterior follow the likelihood of \
                          normal noise, which `method.huber_threshold` gives up: ask for `bootstrap`";
            job.fault("contradiction", detail);
        }
    }

    /// What listed disturbances ask of the rest of the job: intervals from the curvature of the likelihood, or
    /// from draws.
    fn check_noise(&self, job: &Object<'_>) {
        if !matches!(self.process_noise, Some(JobNoiseSpec::Listed(_))) {
            return;
        }
        if self.uncertainty.has_independent_refits() {
            let detail = "with `process_noise` the intervals follow from the curvature of the \
                          likelihood, or from draws: leave `uncertainty.intervals` out or ask for \
                          `posterior`, and leave `uncertainty.monte_carlo_samples` out";
            job.fault("contradiction", detail);
        }
        if self.method.huber_threshold.is_some() {
            let detail = "`process_noise` compares normal likelihoods, which \
                          `method.huber_threshold` gives up: leave one of them out";
            job.fault("contradiction", detail);
        }
    }

    /// Whether a parameter or an initial state of the job's model is left to estimate.
    pub(super) fn estimates_anything(&self, model: &ModelDescription) -> bool {
        let parameters = JobParameters {
            model,
            shared: &self.parameters,
            experiments: &self.experiments,
        };
        parameters.has_unknowns()
    }

    /// The disturbances that are looked for in the job's model. A specification that was completed before there
    /// were any says nothing of them, and has none.
    #[must_use]
    pub fn sought_noise(&self, model: &ModelDescription) -> SoughtNoise {
        let noise = self.process_noise.as_ref();
        noise.map_or(SoughtNoise::None, |noise| noise.sought(model))
    }

    /// Whether disturbances are looked for, where the data show any.
    #[must_use]
    pub fn looks_for_disturbances(&self) -> bool {
        let none = JobNoiseSpec::Choice(NoiseChoice::None);
        self.process_noise
            .as_ref()
            .is_some_and(|noise| *noise != none)
    }

    /// What is asked about the estimate, once it stands.
    #[must_use]
    pub fn request(&self, model: &ModelDescription) -> uncertainty::Request {
        uncertainty::Request {
            noise: self.sought_noise(model),
            settings: self.uncertainty.clone(),
            seed: self.seed,
            effects: self
                .model_search
                .as_ref()
                .map_or_else(Vec::new, |search| search.effects.clone()),
            thorough: true,
        }
    }

    /// The recordings that a document names, whether or not the rest of it makes sense.
    pub fn datasets_named(document: &Value) -> Vec<DatasetId> {
        let experiments = document.get("experiments").and_then(Value::as_array);
        let mut ids: Vec<DatasetId> = experiments
            .into_iter()
            .flatten()
            .take(MAX_EXPERIMENTS)
            .filter_map(|experiment| experiment.get("dataset")?.as_str()?.parse().ok())
            .collect();
        ids.sort();
        ids.dedup();
        ids
    }

    /// The numbers of the versions of a recording that a document names.
    #[must_use]
    pub fn versions_named(document: &Value, recording: DatasetId) -> BTreeSet<u32> {
        let experiments = document.get("experiments").and_then(Value::as_array);
        let experiments = experiments.into_iter().flatten().take(MAX_EXPERIMENTS);
        let of_recording = experiments.filter(|experiment| {
            let dataset = experiment.get("dataset").and_then(Value::as_str);
            dataset.is_some_and(|dataset| dataset.parse() == Ok(recording))
        });
        of_recording.filter_map(version::named).collect()
    }
}

const NOTHING_TO_ESTIMATE: &str = "every parameter and every initial state is fixed: there is nothing \
                                   to estimate; free one with {\"estimate\": {}}";

/// Every section is read even when an earlier one is wrong; only a section that cannot be
/// understood without another (signals without the model) is left out.
fn read_spec(document: &Field<'_>, context: &Context<'_>) -> Option<JobSpec> {
    let mut root = document.object()?;
    let words = WordsOfSpec::read(&mut root);
    let model = root
        .required("model")
        .and_then(|field| read_model(&field, &context.models));
    let experiments = root
        .required("experiments")
        .and_then(|field| experiment::read_all(&field, model, context));
    let parameters = root.optional("parameters");
    let parameters = model.map(|model| parameter::read_all(parameters.as_ref(), model));
    let model_search = root.optional("model_search");
    let model_search = match (model, model_search) {
        (Some(model), Some(field)) => model_search::read(&field, model, parameters.as_ref()),
        _ => None,
    };
    let parameters = parameters.map(|parameters| match (model, &model_search) {
        (Some(model), Some(search)) => model_search::freed(parameters, model, search),
        _ => parameters,
    });
    let measurement = Measurement::read(&mut root, model, experiments.as_deref(), context);
    let job_parameters = model.zip(parameters.as_ref().zip(experiments.as_deref()));
    let job_parameters = job_parameters.map(|(model, (shared, experiments))| JobParameters {
        model,
        shared,
        experiments,
    });
    let (constraints, priors) = read_together(&mut root, job_parameters);
    let method = said_or_default(root.optional("method"), method::read);
    let uncertainty = said_or_default(root.optional("uncertainty"), uncertainty::Settings::read);
    let process_noise = match root.optional("process_noise") {
        Some(field) => process_noise::read_of_job(&field, model),
        None => JobNoiseSpec::unsaid(&method, &uncertainty),
    };
    let validation = said_or_default(root.optional("validation"), ValidationSpec::read);
    let limits = root.optional("limits");
    let limits = limits.map(|field| limits::read(&field, context.max_duration_s));
    let seed = seed(root.optional("seed"));
    if let Some(parameters) = job_parameters {
        check_parameters(&root, parameters, model_search.as_ref());
    }
    let complete = || {
        Some(JobSpec {
            name: words.name,
            labels: words.labels,
            note: words.note,
            model: model?.name.to_string(),
            experiments: experiments?,
            parameters: parameters?,
            outputs: measurement.outputs,
            clock_tolerance: measurement.clock_tolerance,
            tolerances: measurement.tolerances,
            constraints,
            priors,
            method,
            model_search,
            process_noise: Some(process_noise),
            uncertainty,
            validation,
            limits: limits.unwrap_or_else(|| LimitsSpec::within(context.max_duration_s)),
            seed: seed?,
        })
    };
    let spec = complete();
    if let (Some(spec), Some(model)) = (&spec, model) {
        spec.check_loss(&root, model);
        spec.check_noise(&root);
    }
    root.finish();
    spec
}

/// A section of a document, or the default where there is none.
fn said_or_default<T: Default>(field: Option<Field<'_>>, read: impl FnOnce(&Field<'_>) -> T) -> T {
    field.map_or_else(T::default, |field| read(&field))
}

/// How well outputs, inputs and the clock are known.
struct Measurement {
    outputs: BTreeMap<String, OutputSpec>,
    clock_tolerance: Option<Tolerance>,
    tolerances: BTreeMap<String, Tolerance>,
}

impl Measurement {
    fn read(
        root: &mut Object<'_>,
        model: Option<&ModelDescription>,
        experiments: Option<&[ExperimentSpec]>,
        context: &Context<'_>,
    ) -> Measurement {
        let outputs = root.optional("outputs");
        let outputs =
            outputs.map(|field| outputs::read(&field, model, experiments, context.datasets));
        let clock_tolerance = outputs::tolerance(root.optional("clock_tolerance"));
        let tolerances = root.optional("tolerances");
        let tolerances = tolerances.map(|field| tolerances::read(&field));
        Measurement {
            outputs: outputs.unwrap_or_default(),
            clock_tolerance,
            tolerances: tolerances.unwrap_or_default(),
        }
    }
}

fn check_parameters(job: &Object<'_>, parameters: JobParameters<'_>, search: Option<&ModelSearch>) {
    parameters.check(job, search);
    if !parameters.has_unknowns() {
        job.fault("nothing_to_estimate", NOTHING_TO_ESTIMATE);
    }
}

/// The seed of every random number; drawn where a document gives none.
fn seed(field: Option<Field<'_>>) -> Option<u64> {
    field.map_or_else(|| Some(drawn_seed()), |field| field.integer(0, MAX_SEED))
}

/// What is said of several parameters together: constraints and priors. Without a model, or
/// parameters that are understood, nothing can be said of them.
fn read_together(
    root: &mut Object<'_>,
    parameters: Option<JobParameters<'_>>,
) -> (Vec<String>, Vec<JointPriorSpec>) {
    let (constraints, priors) = (root.optional("constraints"), root.optional("priors"));
    let Some(parameters) = parameters else {
        return (Vec::new(), Vec::new());
    };
    let constraints = constraints.map(|field| constraints::read(&field, parameters));
    let priors = priors.map(|field| joint_prior::read(&field, parameters));
    (constraints.unwrap_or_default(), priors.unwrap_or_default())
}

/// A seed for a job that brings none, from the random bits of a fresh identifier.
fn drawn_seed() -> u64 {
    Uuid::now_v7().as_u64_pair().1 & MAX_SEED
}
