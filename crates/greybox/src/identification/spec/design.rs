//! What a design is asked for: the next experiment of a job that is to come.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

mod excitation;
mod inputs;
mod instants;

pub use excitation::Proposal;
pub use inputs::Excitable;
pub use instants::InstantsPlan;

use super::initial_state::read_initial_state;
use super::outputs::check_output;
use super::{
    ExperimentRole, ExperimentSpec, InitialStateSpec, JobSpec, LimitsSpec, MAX_SEED, OutputSpec,
    ParameterSpec, parameter, read_model,
};
use crate::estimation::Settings;
use crate::identification::{DatasetId, JobId, Outcome};
use crate::uncertainty;
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::{Field, Object, did_you_mean, listed, read_document};
use greybox_simulation::model::ModelDescription;

/// Points of what is known at present that experiments are looked at, at the most.
pub const MAX_POINTS: u64 = 16;
/// Points that experiments are looked at when a design does not say.
pub const DEFAULT_POINTS: u64 = 5;

/// A design that can be made.
#[derive(Clone, Debug, PartialEq)]
pub struct DesignSpec {
    /// The job that will estimate from the next experiment, the last of its experiments, and from
    /// those of an earlier job, where the design begins from one.
    pub job: JobSpec,
    /// Outputs of which one may be measured beside those of the job, with their noise, SI.
    pub sensors: BTreeMap<String, f64>,
    /// The inputs or the instants that the design chooses.
    pub plan: Plan,
    /// The unknowns that matter.
    pub wanted: Vec<String>,
    /// Points of what is known at present that experiments are looked at.
    pub points: usize,
    /// Where every random number comes from.
    pub seed: u64,
}

/// The part of an experiment that a design chooses.
#[derive(Clone, Debug, PartialEq)]
pub enum Plan {
    /// How the inputs are driven.
    Excite(Excitable),
    /// When a plant that nothing drives is measured.
    Sample(InstantsPlan),
}

/// A finished job that a design begins from.
#[derive(Clone, Debug)]
pub struct PastJob<'a> {
    /// The specification of the job.
    pub spec: &'a JobSpec,
    /// The noise of each output that the job measured, SI.
    pub noise: BTreeMap<String, f64>,
}

impl<'a> PastJob<'a> {
    /// A job and what came of it.
    #[must_use]
    pub fn new(spec: &'a JobSpec, outcome: &Outcome) -> PastJob<'a> {
        let noise = outcome.residuals.iter();
        PastJob {
            spec,
            noise: noise
                .map(|(output, residuals)| (output.clone(), residuals.noise_std))
                .collect(),
        }
    }
}

/// The document by which a client asks for a design, as the document came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct DesignRequest(Value);

impl DesignRequest {
    /// A submitted document.
    #[must_use]
    pub fn new(document: Value) -> DesignRequest {
        DesignRequest(document)
    }

    /// The job that a document begins from, whether or not the rest of the document makes sense.
    #[must_use]
    pub fn past_job(document: &Value) -> Option<JobId> {
        document.get("job")?.as_str()?.parse().ok()
    }

    /// The job that the design begins from.
    #[must_use]
    pub fn job(&self) -> Option<JobId> {
        DesignRequest::past_job(&self.0)
    }

    /// Reads the document against the finished job that the document names.
    ///
    /// # Errors
    /// Everything that is wrong with the document.
    pub fn read(
        &self,
        models: &[&ModelDescription],
        past: Option<&PastJob<'_>>,
    ) -> Result<DesignSpec, Vec<Fault>> {
        read_document(&self.0, |field| read(field, models, past))
    }
}

/// What the later experiment belongs to.
struct Subject<'m> {
    model: &'m ModelDescription,
    parameters: BTreeMap<String, ParameterSpec>,
}

fn read(
    document: &Field<'_>,
    models: &[&ModelDescription],
    past: Option<&PastJob<'_>>,
) -> Option<DesignSpec> {
    let mut root = document.object()?;
    let subject = read_subject(&mut root, models, past);
    let model = subject.as_ref().map(|subject| subject.model);
    let initial_state = root.optional("initial_state");
    let initial_state = match (&initial_state, model) {
        (Some(field), Some(model)) => read_start(field, model),
        _ => BTreeMap::new(),
    };
    let outputs = root.optional("outputs");
    let noise = match (&outputs, past) {
        (None, Some(past)) => past.noise.clone(),
        (None, None) if subject.is_none() => BTreeMap::new(),
        (None, None) => {
            let detail = "`outputs` is missing: what is measured, with which `noise_std`";
            root.fault("missing_field", detail);
            BTreeMap::new()
        }
        (Some(field), _) => read_outputs(field, model),
    };
    let sensors = root.optional("sensors");
    let sensors = sensors.map_or_else(BTreeMap::new, |field| {
        let sensors = read_outputs(&field, model);
        if let Some(twice) = sensors.keys().find(|name| noise.contains_key(*name)) {
            field.fault("duplicate", format!("`{twice}` is measured in any case"));
        }
        sensors
    });
    let plan = read_plan(&mut root, model, !sensors.is_empty());
    let wanted = root.optional("wanted");
    let free = subject.as_ref().map(free_names).unwrap_or_default();
    if subject.is_some() && free.is_empty() {
        let detail = "every parameter is fixed: there is nothing to estimate; free one with \
                      {\"estimate\": {}}";
        root.fault("nothing_to_estimate", detail);
    }
    let wanted = match wanted.filter(|_| subject.is_some()) {
        Some(field) => read_wanted(&field, &free),
        None => Some(free),
    };
    let points = root.optional("points");
    let points = points.map_or(Some(DEFAULT_POINTS), |field| field.integer(1, MAX_POINTS));
    let seed = root.optional("seed");
    let seed = seed.map_or(Some(1), |field| field.integer(0, MAX_SEED));
    root.finish();
    let (subject, seed) = (subject?, seed?);
    Some(DesignSpec {
        job: job_to_come(&subject, noise, initial_state, past, seed),
        sensors,
        plan: plan?,
        wanted: wanted?,
        points: usize::try_from(points?).expect("a small number"),
        seed,
    })
}

/// The model and what is known of its parameters: as they are given, or those of a finished job.
fn read_subject<'m>(
    root: &mut Object<'_>,
    models: &[&'m ModelDescription],
    past: Option<&PastJob<'_>>,
) -> Option<Subject<'m>> {
    let job = root.optional("job");
    let model = root.optional("model");
    let parameters = root.optional("parameters");
    let Some(job) = job else {
        if model.is_none() {
            let detail = "either `model` is needed, or the `job` to go on from";
            root.fault("missing_field", detail);
        }
        let model = read_model(&model?, models)?;
        return Some(Subject {
            model,
            parameters: parameter::read_all(parameters.as_ref(), model),
        });
    };
    for given in [&model, &parameters].into_iter().flatten() {
        let detail = "a design that goes on from a job takes this from the job";
        given.fault("contradiction", detail);
    }
    match job.text()?.parse::<JobId>() {
        Ok(id) if past.is_none() => job.fault("unknown_job", format!("there is no job {id}")),
        Ok(_) => {}
        Err(error) => job.fault("unknown_job", error.to_string()),
    }
    let past = past?;
    let model = models.iter().find(|model| model.name == past.spec.model);
    Some(Subject {
        model: model?,
        parameters: past.spec.parameters.clone(),
    })
}

fn read_start(field: &Field<'_>, model: &ModelDescription) -> BTreeMap<String, InitialStateSpec> {
    let states = read_initial_state(field, model, None);
    let measured = |state: &InitialStateSpec| matches!(state, InitialStateSpec::Measured(_));
    for (name, _) in states.iter().filter(|(_, state)| measured(state)) {
        let detail = format!("nothing is measured yet: `{name}` needs a value or a range");
        field.fault("no_recording", detail);
    }
    states
}

/// The noise of outputs, each with `noise_std`.
fn read_outputs(field: &Field<'_>, model: Option<&ModelDescription>) -> BTreeMap<String, f64> {
    let mut outputs = BTreeMap::new();
    let entries = field.object();
    if entries
        .as_ref()
        .is_some_and(|object| object.n_entries() == 0)
    {
        field.fault("no_measured_output", "no output is named");
    }
    for (name, field) in entries.map(|object| object.entries()).into_iter().flatten() {
        check_output(name, &field, model, None);
        let Some(mut object) = field.object() else {
            continue;
        };
        let noise = object.required("noise_std").and_then(|f| f.positive());
        object.finish();
        outputs.extend(noise.map(|noise| (name.to_owned(), noise)));
    }
    outputs
}

fn read_plan(
    root: &mut Object<'_>,
    model: Option<&ModelDescription>,
    has_sensors: bool,
) -> Option<Plan> {
    let instants = root.optional("instants");
    let names = [
        "inputs",
        "sample_time_s",
        "duration_s",
        "families",
        "proposals",
    ];
    let fields = names.map(|name| root.optional(name));
    let Some(instants) = instants else {
        return inputs::read(root, fields, model?).map(Plan::Excite);
    };
    for given in fields.iter().flatten() {
        let detail = "an experiment whose `instants` are chosen has no inputs and no sample time";
        given.fault("contradiction", detail);
    }
    if has_sensors {
        let detail = "`sensors` are compared in an experiment with a sample time";
        instants.fault("contradiction", detail);
    }
    instants::read(&instants, model).map(Plan::Sample)
}

/// The parameters that will be estimated.
fn free_names(subject: &Subject<'_>) -> Vec<String> {
    let order = subject.model.parameters.iter();
    let names = order.map(|parameter| parameter.name.to_string());
    let is_free =
        |name: &String| matches!(subject.parameters.get(name), Some(ParameterSpec::Free(_)));
    names.filter(is_free).collect()
}

fn read_wanted(field: &Field<'_>, free: &[String]) -> Option<Vec<String>> {
    let entries = field.array()?;
    if entries.len() == 0 {
        field.fault("out_of_range", "no parameter is named");
        return None;
    }
    let mut wanted: Vec<String> = Vec::new();
    for entry in entries {
        let name = entry.text()?;
        if !free.iter().any(|free| free == name) {
            let names: Vec<&str> = free.iter().map(String::as_str).collect();
            let hint = did_you_mean(name, names.iter().copied());
            let detail = format!("what is estimated is {}{hint}", listed(&names));
            entry.fault("not_estimated", detail);
        } else if wanted.iter().any(|before| before == name) {
            entry.fault("duplicate", format!("`{name}` is named twice"));
        } else {
            wanted.push(name.to_owned());
        }
    }
    Some(wanted)
}

/// The job that will estimate from the experiment that is designed.
fn job_to_come(
    subject: &Subject<'_>,
    noise: BTreeMap<String, f64>,
    initial_state: BTreeMap<String, InitialStateSpec>,
    past: Option<&PastJob<'_>>,
    seed: u64,
) -> JobSpec {
    let next = ExperimentSpec {
        // Nothing is recorded yet.
        dataset: DatasetId::new(),
        version: None,
        signals: BTreeMap::new(),
        window: None,
        exclude: None,
        instants: None,
        initial_state,
        parameters: BTreeMap::new(),
        role: ExperimentRole::Estimation,
        start_fit_s: None,
    };
    let earlier = past.map_or(&[][..], |past| &past.spec.experiments);
    let outputs = noise.into_iter().map(|(name, noise)| {
        let spec = OutputSpec {
            noise_std: Some(noise),
            ..OutputSpec::default()
        };
        (name, spec)
    });
    JobSpec {
        name: None,
        labels: BTreeMap::new(),
        note: None,
        model: subject.model.name.to_string(),
        experiments: earlier.iter().cloned().chain([next]).collect(),
        parameters: subject.parameters.clone(),
        outputs: outputs.collect(),
        clock_tolerance: None,
        tolerances: past.map_or_else(BTreeMap::new, |past| past.spec.tolerances.clone()),
        constraints: past.map_or_else(Vec::new, |past| past.spec.constraints.clone()),
        priors: past.map_or_else(Vec::new, |past| past.spec.priors.clone()),
        method: Settings::default(),
        model_search: None,
        process_noise: None,
        uncertainty: uncertainty::Settings::default(),
        validation: super::ValidationSpec::default(),
        limits: LimitsSpec::default(),
        seed,
    }
}
