//! What is asked of an identification.

use super::experiment::{Experiment, ExperimentSection, GivenParameter};
use super::{IdentificationError, Run};
use crate::estimation::{Observer, Problem, Settings};
use crate::identification::assemble::{self, Assembly};
use crate::identification::spec::{
    Context, ModelSearch, OutputSpec, ParameterSpec, ValidationSpec,
};
use crate::identification::{DatasetId, JobSpec, Outcome};
use crate::uncertainty;
use greybox_numerics::parsing::Fault;
use greybox_recording::Recording;
use greybox_simulation::model::{Catalogue, Model, document};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, HashMap};
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Which parameters of a model shall be estimated, from which recordings and how.
///
/// Everything has a default but the model and one experiment. What the model calls unknown is
/// estimated in the model's own range unless it is fixed here; all other parameters have the
/// model's values unless they are fixed or freed here.
///
/// A mass on wheels is pushed to and fro, and the mass and its friction are found again from
/// where it went:
///
/// ```
/// use greybox::{Identification, Model, Recording};
///
/// // 2 kg and 3 N·s/m, in steps of a millisecond.
/// let force: Vec<f64> = (0..200).map(|k| if k / 17 % 2 == 0 { 20.0 } else { -20.0 }).collect();
/// let (mut position, mut velocity) = (0.0, 0.0);
/// let positions = force.iter().map(|force| {
///     let now = position;
///     for _ in 0..20 {
///         velocity += 1e-3 * (force - 3.0 * velocity) / 2.0;
///         position += 1e-3 * velocity;
///     }
///     now
/// });
/// let positions = positions.collect();
/// let recording =
///     Recording::from_samples(0.02, [("force", "N", force), ("position", "m", positions)]);
///
/// let drive = Model::named("positioning_drive").expect("it is in the catalogue");
/// let found = Identification::new(&drive, recording)
///     .free("mass", 0.5..=10.0)
///     .free("viscous_friction", 0.1..=20.0)
///     .fix("coulomb_friction", 0.0)
///     .fix("offset", 0.0)
///     .noise("position", 1e-3)
///     .seed(1)
///     .run()?;
/// let mass = found.parameter("mass").expect("it is free");
/// assert!((mass.estimate.estimate - 2.0).abs() < 0.05);
/// # Ok::<(), greybox::IdentificationError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Identification {
    /// The document that the identification begins from, where a client submitted one.
    submitted: Option<Value>,
    /// What stands in the place of the model of the document.
    model: Option<Arc<Model>>,
    /// What the program says beside the document.
    sections: Sections,
    /// One recording for each experiment of the document and of the program.
    recordings: Vec<Recording>,
}

/// The sections of a job as a program states them.
#[derive(Clone, Debug, Default, Serialize)]
struct Sections {
    experiments: Vec<ExperimentSection>,
    parameters: BTreeMap<String, GivenParameter>,
    outputs: BTreeMap<String, OutputSpec>,
    constraints: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    model_search: Option<ModelSearch>,
    #[serde(skip_serializing_if = "Option::is_none")]
    validation: Option<ValidationSpec>,
    #[serde(skip_serializing_if = "Option::is_none")]
    method: Option<Settings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty: Option<uncertainty::Settings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
}

impl Identification {
    /// What the model calls unknown, from one experiment.
    #[must_use]
    pub fn new(model: &Arc<Model>, experiment: impl Into<Experiment>) -> Identification {
        let identification = Identification {
            submitted: None,
            model: None,
            sections: Sections::default(),
            recordings: Vec::new(),
        };
        identification.model(model).experiment(experiment)
    }

    /// A job's document as it is submitted to a server, every experiment of which is cut from one
    /// recording; datasets that it names are not looked at.
    #[must_use]
    pub fn of_job(mut job: Value, recording: Recording) -> Identification {
        if let Some(job) = job.as_object_mut() {
            job.entry("experiments").or_insert_with(|| json!([{}]));
        }
        let experiments = job.get("experiments").and_then(Value::as_array);
        let count = experiments.map_or(0, Vec::len);
        Identification {
            submitted: Some(job),
            model: None,
            sections: Sections::default(),
            recordings: vec![recording; count],
        }
    }

    /// Another model.
    #[must_use]
    pub fn model(mut self, model: &Arc<Model>) -> Identification {
        self.model = Some(Arc::clone(model));
        self
    }

    /// One experiment more; all of them share the parameters that they do not fix or free for
    /// themselves.
    #[must_use]
    pub fn experiment(mut self, experiment: impl Into<Experiment>) -> Identification {
        let Experiment { recording, section } = experiment.into();
        self.recordings.push(recording);
        self.sections.experiments.push(section);
        self
    }

    /// An unknown parameter and where it is looked for, SI, along the scale that the model says.
    #[must_use]
    pub fn free(self, parameter: &str, range: RangeInclusive<f64>) -> Identification {
        self.with_parameter(parameter, GivenParameter::free(&range))
    }

    /// A known parameter, SI.
    #[must_use]
    pub fn fix(self, parameter: &str, value: f64) -> Identification {
        self.with_parameter(parameter, GivenParameter::fixed(value))
    }

    /// All that can be said of a parameter.
    #[must_use]
    pub fn parameter(self, parameter: &str, spec: ParameterSpec) -> Identification {
        self.with_parameter(parameter, GivenParameter::Whole(spec))
    }

    fn with_parameter(mut self, name: &str, given: GivenParameter) -> Identification {
        self.sections.parameters.insert(name.to_owned(), given);
        self
    }

    /// The standard deviation of an output's measurement noise, SI. With it the verdict can tell
    /// noise from what the model misses.
    #[must_use]
    pub fn noise(mut self, output: &str, standard_deviation: f64) -> Identification {
        let spec = OutputSpec {
            noise_std: Some(standard_deviation),
            ..OutputSpec::default()
        };
        self.sections.outputs.insert(output.to_owned(), spec);
        self
    }

    /// A condition that the parameters keep, such as `tau1 < tau2`, in SI units.
    #[must_use]
    pub fn constraint(mut self, condition: &str) -> Identification {
        self.sections.constraints.push(condition.to_owned());
        self
    }

    /// Parameters that stand for effects about which the data shall decide.
    #[must_use]
    pub fn effects(mut self, parameters: &[&str]) -> Identification {
        let effects = parameters.iter().map(|name| (*name).to_owned()).collect();
        self.sections.model_search = Some(ModelSearch { effects });
        self
    }

    /// The share of each experiment, at its end, that is held back to check the estimate; a
    /// quarter where nothing is said.
    #[must_use]
    pub fn hold_back(mut self, fraction: f64) -> Identification {
        self.sections.validation = Some(ValidationSpec { fraction });
        self
    }

    /// How the parameters are looked for.
    #[must_use]
    pub fn method(mut self, settings: &Settings) -> Identification {
        self.sections.method = Some(settings.clone());
        self
    }

    /// How closely the estimate's uncertainty is looked at.
    #[must_use]
    pub fn uncertainty(mut self, settings: &uncertainty::Settings) -> Identification {
        self.sections.uncertainty = Some(settings.clone());
        self
    }

    /// Where every random number comes from: the same seed, the same bits. Drawn where none is
    /// given; the outcome says which it was.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Identification {
        self.sections.seed = Some(seed);
        self
    }

    /// The completed specification and its model.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn specification(&self) -> Result<(JobSpec, Arc<Model>), IdentificationError> {
        self.read().map_err(IdentificationError::Invalid)
    }

    fn read(&self) -> Result<(JobSpec, Arc<Model>), Vec<Fault>> {
        let mut job = self.document();
        let models = self.models(&mut job)?;
        let datasets = self.recordings.iter().enumerate();
        let datasets: HashMap<DatasetId, _> = datasets
            .map(|(place, recording)| (dataset(place), recording.summary()))
            .collect();
        let experiments = job.get_mut("experiments").and_then(Value::as_array_mut);
        for (place, experiment) in experiments.into_iter().flatten().enumerate() {
            if let Some(experiment) = experiment.as_object_mut() {
                experiment.insert("dataset".to_owned(), json!(dataset(place)));
            }
        }
        let context = Context {
            models: models.iter().map(|model| model.description()).collect(),
            datasets: &datasets,
            versions: None,
            max_duration_s: f64::INFINITY,
        };
        let spec = JobSpec::read(&job, &context)?;
        let named = |model: &&Arc<Model>| model.description().name == *spec.model;
        let model = models.iter().find(named);
        let model = model.expect("a specification names a model that there is");
        Ok((spec, Arc::clone(model)))
    }

    /// What the program says, as a client would submit it: lists and named entries beside those of the
    /// document, everything else in their place.
    fn document(&self) -> Value {
        let mut document = self.submitted.clone().unwrap_or_else(|| json!({}));
        let stated = serde_json::to_value(&self.sections).expect("sections have only text keys");
        let (Value::Object(job), Value::Object(stated)) = (&mut document, stated) else {
            return document;
        };
        for (name, section) in stated {
            let missing = match &section {
                Value::Array(_) => json!([]),
                Value::Object(_) if name == "parameters" || name == "outputs" => json!({}),
                _ => {
                    job.insert(name, section);
                    continue;
                }
            };
            match (job.entry(name).or_insert(missing), section) {
                (Value::Array(entries), Value::Array(more)) => entries.extend(more),
                (Value::Object(entries), Value::Object(more)) => entries.extend(more),
                // The reader reports a section of another type as a fault.
                _ => {}
            }
        }
        document
    }

    /// The models that the job may name; one that it brings along is replaced by its name.
    fn models(&self, job: &mut Value) -> Result<Vec<Arc<Model>>, Vec<Fault>> {
        let own = match (&self.model, job.get("model")) {
            (Some(model), _) => Arc::clone(model),
            (None, Some(document)) if document.is_object() => {
                let read = document::referenced(document);
                let below = |fault: Fault| fault.below("/model");
                read.map_err(|faults| faults.into_iter().map(below).collect::<Vec<_>>())?
                    .model
            }
            _ => return Ok(Catalogue::built_in().iter().cloned().collect()),
        };
        if let Some(job) = job.as_object_mut() {
            job.insert("model".to_owned(), json!(own.description().name));
        }
        Ok(vec![own])
    }

    /// The assembled problem with what was noticed on the way, and the specification that it
    /// comes from: for programs that look at it themselves.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn assembly(&self) -> Result<(Assembly, JobSpec), IdentificationError> {
        let (spec, model) = self.specification()?;
        let assembly = assemble::problem(&spec, &model, &self.recordings);
        let assembly = assembly.map_err(IdentificationError::Invalid)?;
        Ok((assembly, spec))
    }

    /// The assembled problem alone.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn problem(&self) -> Result<Problem, IdentificationError> {
        Ok(self.assembly()?.0.problem)
    }

    /// Begins a run, to be worked unit by unit.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn begin(&self) -> Result<Run, IdentificationError> {
        let (spec, model) = self.specification()?;
        Run::begin(&spec, &model, &self.recordings)
    }

    /// Runs to the end.
    ///
    /// # Errors
    /// When what is asked cannot be done, when the data do not fix the unknowns, and when no
    /// candidate could be simulated.
    pub fn run(&self) -> Result<Outcome, IdentificationError> {
        self.run_observed(&AtomicBool::new(false), &mut ())
    }

    /// Runs to the end while `observer` looks on, or until `stop` is raised; then the outcome is
    /// the best so far and says so.
    ///
    /// # Errors
    /// Those of [`Identification::run`].
    pub fn run_observed(
        &self,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, IdentificationError> {
        self.begin()?.finish(stop, observer)
    }
}

/// The name under which a specification knows the recording of an experiment.
fn dataset(place: usize) -> DatasetId {
    let name = format!("{}{place:032x}", DatasetId::PREFIX);
    name.parse().expect("32 hexadecimal digits")
}
