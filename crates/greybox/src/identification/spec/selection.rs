//! What a selection is asked for: the windows of a stream that fix the parameters of a finished job.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::design::PastJob;
use super::initial_state::read_initial_state;
use super::{InitialStateSpec, MAX_EXPERIMENTS, MAX_SEED, ParameterSpec};
use crate::identification::JobId;
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::{Field, Object, did_you_mean, listed, read_document};
use greybox_simulation::model::{ModelDescription, Tolerance};

/// Windows that a selection looks at, at the most.
pub const MAX_WINDOWS: u64 = 20_000;
/// Spans of time that a selection leaves out, at the most.
const MAX_EXCLUDED: usize = 256;

/// A selection that can be made.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectionSpec {
    /// The finished job whose parameters the windows are to fix.
    pub job: JobId,
    /// The stream.
    pub stream: String,
    /// The part of the stream that is looked at; left open, the stream begins or ends it.
    pub span: (Option<Timestamp>, Option<Timestamp>),
    /// How long a window is `[s]`.
    pub window: f64,
    /// Where states start in every window, where the job says otherwise or nothing.
    pub initial_state: BTreeMap<String, InitialStateSpec>,
    /// The parameters that matter.
    pub wanted: Vec<String>,
    /// The total standard error that is asked for of each of them.
    pub targets: BTreeMap<String, Tolerance>,
    /// Samples of all chosen windows together at the most.
    pub most_samples: Option<u64>,
    /// Chosen windows at the most.
    pub most_windows: usize,
    /// Spans of time whose windows are left out.
    pub excluded: Vec<(Timestamp, Timestamp)>,
    /// Where every random number comes from.
    pub seed: u64,
}

/// The document by which a client asks for a selection, as the document came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SelectionRequest(Value);

impl SelectionRequest {
    /// A submitted document.
    #[must_use]
    pub fn new(document: Value) -> SelectionRequest {
        SelectionRequest(document)
    }

    /// The job that the document names, whether or not the rest of the document makes sense.
    #[must_use]
    pub fn job(&self) -> Option<JobId> {
        self.0.get("job")?.as_str()?.parse().ok()
    }

    /// The stream that the document names, whether or not the rest of the document makes sense.
    #[must_use]
    pub fn stream(&self) -> Option<&str> {
        self.0.get("stream")?.as_str()
    }

    /// Reads the document against the finished job that the document names, and the job's model.
    ///
    /// # Errors
    /// Everything that is wrong with the document.
    pub fn read(
        &self,
        model: Option<&ModelDescription>,
        past: Option<&PastJob<'_>>,
    ) -> Result<SelectionSpec, Vec<Fault>> {
        read_document(&self.0, |field| read(field, model, past))
    }
}

fn read(
    document: &Field<'_>,
    model: Option<&ModelDescription>,
    past: Option<&PastJob<'_>>,
) -> Option<SelectionSpec> {
    let mut root = document.object()?;
    let job = root.required("job");
    let job = job.and_then(|field| read_job(&field, past.is_some()));
    let stream = root.required("stream").and_then(|field| field.text());
    let mut instant = |name| root.optional(name).and_then(|field| field.instant());
    let (from, to) = (instant("from"), instant("to"));
    if let (Some(from), Some(to)) = (from, to)
        && from >= to
    {
        let detail = format!("from {from} is not before to {to}");
        root.fault("bounds_reversed", detail);
    }
    let window = root.required("window_s").and_then(|field| field.positive());
    let initial_state = root.optional("initial_state");
    let initial_state = match (initial_state, model) {
        (Some(field), Some(model)) => {
            let experiment = past.and_then(|past| past.spec.experiments.first());
            let signals = experiment.map(|experiment| &experiment.signals);
            read_initial_state(&field, model, signals)
        }
        _ => BTreeMap::new(),
    };
    let free: Vec<&str> = past.map_or_else(Vec::new, shared_and_free);
    let wanted = root.optional("wanted");
    let mut wanted: Vec<String> = match wanted.filter(|_| past.is_some()) {
        Some(field) => read_wanted(&field, &free)?,
        None => Vec::new(),
    };
    let targets = read_targets(&mut root, &free, past.is_some());
    if wanted.is_empty() {
        let is_asked_for = |name: &&&str| targets.is_empty() || targets.contains_key(**name);
        wanted = free
            .iter()
            .filter(is_asked_for)
            .map(|name| (*name).to_owned())
            .collect();
    }
    let most_samples = root.optional("budget_samples");
    let most_samples = most_samples.and_then(|field| field.integer(1, MAX_SEED));
    if targets.is_empty() && most_samples.is_none() {
        let detail = "either `target` is needed, as close as parameters are to be known, or `budget_samples`, \
                      how many samples there may be";
        root.fault("missing_field", detail);
    }
    let most_windows = root.optional("max_windows");
    let most_windows = most_windows.map_or(Some(MAX_EXPERIMENTS as u64), |field| {
        field.integer(1, MAX_EXPERIMENTS as u64)
    });
    let excluded = root.optional("exclude");
    let excluded = excluded.map_or_else(|| Some(Vec::new()), |field| read_excluded(&field));
    let seed = root.optional("seed");
    let seed = seed.map_or(Some(1), |field| field.integer(0, MAX_SEED));
    root.finish();
    Some(SelectionSpec {
        job: job?,
        stream: stream?.to_owned(),
        span: (from, to),
        window: window?,
        initial_state,
        wanted,
        targets,
        most_samples,
        most_windows: usize::try_from(most_windows?).expect("a small number"),
        excluded: excluded?,
        seed: seed?,
    })
}

/// The finished job, which is known or not.
fn read_job(field: &Field<'_>, is_known: bool) -> Option<JobId> {
    let id = field.text()?.parse::<JobId>();
    match &id {
        Ok(id) if !is_known => field.fault("unknown_job", format!("there is no job {id}")),
        Ok(_) => {}
        Err(error) => field.fault("unknown_job", error.to_string()),
    }
    id.ok()
}

/// The parameters that a job estimates for all its experiments together.
fn shared_and_free<'a>(past: &PastJob<'a>) -> Vec<&'a str> {
    let parameters = past.spec.parameters.iter();
    let free = parameters.filter(|(name, parameter)| {
        matches!(parameter, ParameterSpec::Free(_)) && past.spec.shares(name)
    });
    free.map(|(name, _)| name.as_str()).collect()
}

fn is_free(name: &str, field: &Field<'_>, free: &[&str]) -> bool {
    if free.contains(&name) {
        return true;
    }
    let hint = did_you_mean(name, free.iter().copied());
    let detail = format!("what the job estimates is {}{hint}", listed(free));
    field.fault("not_estimated", detail);
    false
}

fn read_wanted(field: &Field<'_>, free: &[&str]) -> Option<Vec<String>> {
    let mut wanted: Vec<String> = Vec::new();
    for entry in field.array()? {
        let name = entry.text()?;
        if wanted.iter().any(|before| before == name) {
            entry.fault("duplicate", format!("`{name}` is named twice"));
        } else if is_free(name, &entry, free) {
            wanted.push(name.to_owned());
        }
    }
    Some(wanted)
}

fn read_targets(
    root: &mut Object<'_>,
    free: &[&str],
    is_job_known: bool,
) -> BTreeMap<String, Tolerance> {
    let Some(field) = root.optional("target") else {
        return BTreeMap::new();
    };
    let Some(object) = field.object() else {
        return BTreeMap::new();
    };
    let entries = object.entries();
    let read = entries.filter_map(|(name, field)| {
        let target = Tolerance::read(&field)?;
        if target.of(1.0) <= 0.0 {
            field.fault("not_positive", "nothing is known exactly".to_owned());
        }
        let is_known = !is_job_known || is_free(name, &field, free);
        is_known.then(|| (name.to_owned(), target))
    });
    read.collect()
}

fn read_excluded(field: &Field<'_>) -> Option<Vec<(Timestamp, Timestamp)>> {
    let entries = field.array()?;
    if entries.len() > MAX_EXCLUDED {
        let detail = format!("{} spans: {MAX_EXCLUDED} at the most", entries.len());
        field.fault("out_of_range", detail);
        return None;
    }
    let spans = entries.map(|entry| {
        let mut object = entry.object()?;
        let mut instant = |name| object.required(name)?.instant();
        let (from, to) = (instant("from"), instant("to"));
        object.finish();
        let (from, to) = (from?, to?);
        if from >= to {
            entry.fault(
                "bounds_reversed",
                format!("from {from} is not before to {to}"),
            );
        }
        Some((from, to))
    });
    let spans: Vec<_> = spans.collect();
    spans.into_iter().collect()
}
