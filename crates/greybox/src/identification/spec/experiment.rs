//! The `experiments` section: which recordings, which of their signals, which part, from where.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use super::context::Context;
use super::initial_state::{InitialStateSpec, read_initial_state};
use super::version::{self, RecordingVersions, version_schema};
use super::window::WindowSpec;
use super::{ParameterSpec, exclude, parameter, window};
use crate::identification::DatasetId;
use greybox_numerics::dimension::Dimension;
use greybox_numerics::parsing::reader::{Field, Object, did_you_mean, listed};
use greybox_recording::{Exclude, ExcludedSpan, Instants, Mark, RecordingVersion, Summary};
use greybox_simulation::model::{ModelDescription, SignalDescription};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The experiments of one job at the most.
pub const MAX_EXPERIMENTS: usize = 32;

/// Values that the experiments of one job read at the most: recorded samples times signals.
const MAX_VALUES: usize = 20_000_000;

/// The versions of a recording of which nothing is marked.
static NO_VERSIONS: RecordingVersions = RecordingVersions {
    newest: 0,
    marks: BTreeMap::new(),
};

/// One recording and how the model sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExperimentSpec {
    /// The stored recording.
    pub dataset: DatasetId,
    /// The version of the recording, whose marked samples are left out: its number, and what it marks. A number alone
    /// is enough in a submission; left out, the newest version. 0 is the recording as it came.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = version_schema)]
    pub version: Option<RecordingVersion>,
    /// From the model's signals to the recording's; left out, equal names are taken.
    #[serde(default)]
    #[schema(example = json!({"reference": "reference", "position": "position"}))]
    pub signals: BTreeMap<String, String>,
    /// The part of the recording to use; left out, all of it.
    pub window: Option<WindowSpec>,
    /// What of it to leave out: kinds of samples, and spans of time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exclude: Option<Exclude>,
    /// Which instants irregular samples are compared at: their `own`, or those of a uniform `grid`
    /// on which they are interpolated; left out, a grid where the samples are those of one but for
    /// jitter and single gaps, else their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub instants: Option<Instants>,
    /// By the model's name, where each state starts; left out, as the model says.
    #[serde(default)]
    pub initial_state: BTreeMap<String, InitialStateSpec>,
    /// By the model's name, parameters that are this experiment's own: another load, an offset or
    /// a dead time of its own. A value, or a range to look in; all others are those of the job.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(example = json!({"load_force": {"value": 200.0}}))]
    pub parameters: BTreeMap<String, ParameterSpec>,
    /// The purpose of the experiment.
    #[serde(default)]
    #[schema(required = false)]
    pub role: ExperimentRole,
    /// How long a stretch, from its first sample, the start of an experiment that only validates is
    /// fitted to `[s]`; left out, until no output shows the start any more, a quarter of the
    /// experiment at the most. The stretch counts in no score.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, nullable = false)]
    pub start_fit_s: Option<f64>,
}

impl ExperimentSpec {
    /// The samples that the experiment does without: those that its `exclude` names, and those that the version marks
    /// as bad.
    #[must_use]
    pub fn left_out(&self) -> Option<Cow<'_, Exclude>> {
        let exclude = self.exclude.as_ref().map(Cow::Borrowed);
        let marks = self.version.iter().flat_map(|version| &version.marks);
        let marked: Vec<ExcludedSpan> = marks.map(Mark::span).collect();
        if marked.is_empty() {
            return exclude;
        }
        let mut left_out = exclude.unwrap_or_default();
        left_out.to_mut().spans.extend(marked);
        Some(left_out)
    }
}

/// What an experiment is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExperimentRole {
    /// To estimate from, but for its part that is held back.
    #[default]
    Estimation,
    /// To check the estimate with: all of it is held back.
    Validation,
}

/// The experiments, or `None` when any of them is wrong.
pub(super) fn read_all(
    field: &Field<'_>,
    model: Option<&ModelDescription>,
    context: &Context<'_>,
) -> Option<Vec<ExperimentSpec>> {
    let items = field.array()?;
    if items.len() == 0 || items.len() > MAX_EXPERIMENTS {
        let detail = format!(
            "{} experiments: there must be 1 to {MAX_EXPERIMENTS}",
            items.len()
        );
        field.fault("out_of_range", detail);
        return None;
    }
    let read: Vec<_> = items.map(|item| read(&item, model, context)).collect();
    let experiments: Vec<ExperimentSpec> = read.into_iter().collect::<Option<_>>()?;
    let validates = |experiment: &ExperimentSpec| experiment.role == ExperimentRole::Validation;
    if experiments.iter().all(validates) {
        let detail = "every experiment only validates: there is nothing to estimate from";
        field.fault("nothing_to_estimate_from", detail);
    }
    let n_values: usize = experiments
        .iter()
        .map(|experiment| context.datasets[&experiment.dataset].samples * experiment.signals.len())
        .sum();
    if n_values > MAX_VALUES {
        let detail = format!(
            "the experiments read {n_values} values, more than {MAX_VALUES}; use fewer of them or \
             thin the recordings out"
        );
        field.fault("too_many_values", detail);
    }
    Some(experiments)
}

fn read(
    field: &Field<'_>,
    model: Option<&ModelDescription>,
    context: &Context<'_>,
) -> Option<ExperimentSpec> {
    let mut object = field.object()?;
    let dataset = object
        .required("dataset")
        .and_then(|field| read_dataset(&field, context.datasets));
    let recording = dataset.map(|(_, recording)| recording);
    let version = object.optional("version");
    let versions = dataset.zip(context.versions);
    let versions = versions.map(|((id, _), versions)| versions.get(&id).unwrap_or(&NO_VERSIONS));
    let version = version::read(version.as_ref(), versions, recording);
    let signals = object.optional("signals");
    let signals = match (model, recording) {
        (Some(model), Some(recording)) => {
            SignalMatch { model, recording }.read(&object, signals.as_ref(), true)
        }
        _ => None,
    };
    let window = object.optional("window");
    let window = window.map(|field| window::read(&field, recording));
    let exclude = object.optional("exclude");
    let exclude = exclude.and_then(|field| exclude::read(&field, recording));
    let instants = object.optional("instants");
    let instants = instants
        .and_then(|field| field.choice(&[("own", Instants::Own), ("grid", Instants::Grid)]));
    let initial_state = object.optional("initial_state");
    let initial_state = match (&initial_state, model) {
        (Some(field), Some(model)) => read_initial_state(field, model, signals.as_ref()),
        _ => BTreeMap::new(),
    };
    let role = object.optional("role").and_then(|field| {
        field.choice(&[
            ("estimation", ExperimentRole::Estimation),
            ("validation", ExperimentRole::Validation),
        ])
    });
    let role = role.unwrap_or_default();
    let parameters = object.optional("parameters");
    let parameters = match (&parameters, model) {
        (Some(field), Some(model)) => parameter::read_named(field, model),
        _ => BTreeMap::new(),
    };
    let is_unknown = |spec: &ParameterSpec| matches!(spec, ParameterSpec::Free(_));
    if role == ExperimentRole::Validation && parameters.values().any(is_unknown) {
        let detail = "an experiment that only validates has nothing to estimate its own \
                      parameters from: give their values";
        object.fault("contradiction", detail);
    }
    let start_fit = object.optional("start_fit_s");
    if let Some(field) = start_fit
        .as_ref()
        .filter(|_| role == ExperimentRole::Estimation)
    {
        let detail = "the start of an experiment that is estimated from is estimated with all of \
                      it: only one with `\"role\": \"validation\"` has a stretch for it";
        field.fault("contradiction", detail);
    }
    let start_fit_s = start_fit.and_then(|field| field.positive());
    object.finish();
    Some(ExperimentSpec {
        dataset: dataset?.0,
        version,
        signals: signals?,
        window: window.flatten(),
        exclude,
        instants,
        initial_state,
        parameters,
        role,
        start_fit_s,
    })
}

fn read_dataset<'d>(
    field: &Field<'_>,
    datasets: &'d HashMap<DatasetId, Summary>,
) -> Option<(DatasetId, &'d Summary)> {
    let id: DatasetId = match field.text()?.parse() {
        Ok(id) => id,
        Err(error) => {
            field.fault("unknown_dataset", format!("{error}"));
            return None;
        }
    };
    let stored = datasets.get(&id).map(|summary| (id, summary));
    if stored.is_none() {
        field.fault("unknown_dataset", format!("there is no dataset {id}"));
    }
    stored
}

/// Whether two texts are one unit, e.g. `m³/s` and `m^3/s`; a model's signal without a unit takes
/// any.
fn same_unit(recorded: &str, model: &str) -> bool {
    let parsed = |text| Dimension::parse(text).ok();
    model.is_empty()
        || recorded == model
        || match (parsed(recorded), parsed(model)) {
            (Some(recorded), Some(model)) => recorded == model,
            _ => false,
        }
}

/// A model and the recording that drives it.
pub(super) struct SignalMatch<'a> {
    pub(super) model: &'a ModelDescription,
    pub(super) recording: &'a Summary,
}

impl SignalMatch<'_> {
    /// The map from model signals to recorded ones: one whole set of inputs, and the outputs that
    /// are measured, at least one of them where `explains` holds.
    pub(super) fn read(
        &self,
        owner: &Object<'_>,
        signals: Option<&Field<'_>>,
        explains: bool,
    ) -> Option<BTreeMap<String, String>> {
        let named = match signals {
            Some(field) => self.named(field)?,
            None => self.of_equal_names(),
        };
        let fault = |code: &'static str, detail: String| match signals {
            Some(field) => field.fault(code, detail),
            None => owner.fault(code, detail),
        };
        let inputs = self.inputs(&named);
        if inputs.is_none() {
            fault("inputs_missing", self.inputs_missing());
        }
        if explains && !named.keys().any(|name| self.is_output(name)) {
            fault("no_measured_output", self.no_measured_output());
            return None;
        }
        let inputs = inputs?;
        let used = |name: &str| self.is_output(name) || inputs.contains(&name);
        if let (Some(field), Some(unused)) = (signals, named.keys().find(|name| !used(name))) {
            let detail = format!(
                "`{unused}` is not used when the model is driven by {}; leave one of them out",
                listed(&inputs)
            );
            field.fault("inputs_conflict", detail);
            return None;
        }
        Some(named.into_iter().filter(|(name, _)| used(name)).collect())
    }

    fn is_output(&self, name: &str) -> bool {
        self.model.outputs.iter().any(|output| output.name == name)
    }

    fn no_measured_output(&self) -> String {
        let names: Vec<&str> = self.model.outputs.iter().map(|o| &*o.name).collect();
        format!(
            "no output is measured: {} of `{}` must be recorded",
            listed(&names),
            self.model.name
        )
    }

    /// The model's inputs and outputs that the recording has under the same name.
    fn of_equal_names(&self) -> BTreeMap<String, String> {
        self.model_signals()
            .filter(|signal| self.recorded(&signal.name) && self.unit_fits(signal, &signal.name))
            .map(|signal| (signal.name.to_string(), signal.name.to_string()))
            .collect()
    }

    fn named(&self, field: &Field<'_>) -> Option<BTreeMap<String, String>> {
        let mut named = BTreeMap::new();
        let object = field.object()?;
        for (name, field) in object.entries() {
            let signal = self.model_signals().find(|signal| signal.name == name);
            if signal.is_none() {
                let hint = did_you_mean(name, self.model_signals().map(|signal| &*signal.name));
                let detail = format!("`{}` has no signal of this name{hint}", self.model.name);
                field.fault("unknown_model_signal", detail);
            }
            let recorded = field.text();
            if let (Some(signal), Some(recorded)) = (signal, recorded)
                && self.fits(&field, signal, recorded)
            {
                named.insert(name.to_owned(), recorded.to_owned());
            }
        }
        (named.len() == object.n_entries()).then_some(named)
    }

    /// Whether the recording has the signal in a unit that the model can take.
    fn fits(&self, field: &Field<'_>, signal: &SignalDescription, recorded: &str) -> bool {
        if !self.recorded(recorded) {
            let names = self.recording.signals.iter().map(|s| s.name.as_str());
            let hint = did_you_mean(recorded, names.clone());
            let names: Vec<&str> = names.collect();
            let detail = format!("the recording has only {}{hint}", listed(&names));
            field.fault("unknown_dataset_signal", detail);
            return false;
        }
        if !self.unit_fits(signal, recorded) {
            let unit = self.unit_of(recorded).unwrap_or_default();
            let detail = format!(
                "`{recorded}` is recorded in {unit}, `{}` is in {}",
                signal.name, signal.unit
            );
            field.fault("unit_mismatch", detail);
            return false;
        }
        true
    }

    /// Faults where the recording does not have the signal that holds the noise of an output, or
    /// has it in a unit that the output has not.
    pub(super) fn check_noise(&self, field: &Field<'_>, output: &str, recorded: &str) {
        let mut outputs = self.model.outputs.iter();
        if let Some(output) = outputs.find(|described| described.name == output) {
            self.fits(field, output, recorded);
        }
    }

    fn model_signals(&self) -> impl Iterator<Item = &SignalDescription> {
        self.model.inputs.iter().chain(&self.model.outputs)
    }

    fn recorded(&self, name: &str) -> bool {
        self.unit_of(name).is_some()
    }

    fn unit_of(&self, recorded: &str) -> Option<&str> {
        let signal = self.recording.signals.iter().find(|s| s.name == recorded);
        signal.map(|signal| signal.unit.as_str())
    }

    /// A recording without a unit is taken to be in the model's.
    fn unit_fits(&self, signal: &SignalDescription, recorded: &str) -> bool {
        self.unit_of(recorded)
            .is_some_and(|unit| unit.is_empty() || unit == "1" || same_unit(unit, &signal.unit))
    }

    /// The first of the model's input sets that is fully there.
    fn inputs(&self, named: &BTreeMap<String, String>) -> Option<Vec<&str>> {
        let mut sets = self.model.input_sets.iter();
        sets.find(|set| set.iter().all(|input| named.contains_key(&**input)))
            .map(|set| set.iter().map(|input| &**input).collect())
    }

    fn inputs_missing(&self) -> String {
        let sets: Vec<String> = self
            .model
            .input_sets
            .iter()
            .map(|set| set.join(" + "))
            .collect();
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        let names: Vec<&str> = self
            .recording
            .signals
            .iter()
            .map(|signal| signal.name.as_str())
            .collect();
        format!(
            "`{}` is driven by {}, which `signals` must give or the recording have by name; \
             it has {}",
            self.model.name,
            listed(&sets),
            listed(&names)
        )
    }
}
