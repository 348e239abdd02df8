//! The `instants` of a design: when a plant that nothing drives may be measured.

use crate::identification::spec::entries;
use greybox_numerics::parsing::reader::{Field, listed};
use greybox_simulation::model::ModelDescription;

/// Instants to choose from at the most.
const MAX_CANDIDATES: usize = 500;
/// Instants to choose at the most.
const MAX_CHOSEN: u64 = 50;

/// Which instants may be chosen, in seconds from the start of the experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct InstantsPlan {
    /// The instants to choose from, each once.
    pub candidates: Vec<f64>,
    /// How many measurements.
    pub count: usize,
    /// Whether an instant may be measured more than once.
    pub may_repeat: bool,
    /// Instants that are measured in any case.
    pub measured: Vec<f64>,
}

pub(super) fn read(field: &Field<'_>, model: Option<&ModelDescription>) -> Option<InstantsPlan> {
    let mut object = field.object()?;
    let candidates = object.required("candidates_s");
    let candidates = candidates.and_then(|field| read_all(&field));
    let count = object.required("count");
    let count = count.and_then(|field| field.integer(1, MAX_CHOSEN));
    let may_repeat = object.optional("may_repeat");
    let may_repeat = may_repeat.map_or(Some(true), |field| field.boolean());
    let measured = object.optional("measured_s");
    let measured = measured.map_or(Some(Vec::new()), |field| read_all(&field));
    let inputs = model.and_then(|model| model.input_sets.first());
    if let Some(inputs) = inputs.filter(|inputs| !inputs.is_empty()) {
        let names: Vec<&str> = inputs.iter().map(|name| &**name).collect();
        let detail = format!(
            "the model is driven by {}: give `inputs`, `sample_time_s` and `duration_s`",
            listed(&names)
        );
        object.fault("inputs_missing", detail);
    }
    let (mut candidates, count, may_repeat) = (candidates?, count?, may_repeat?);
    candidates.sort_by(f64::total_cmp);
    candidates.dedup();
    let count = usize::try_from(count).expect("a small number");
    if candidates.is_empty() || (!may_repeat && count > candidates.len()) {
        let detail = format!(
            "{count} measurements cannot be chosen from {} instants",
            candidates.len()
        );
        object.fault("too_few_instants", detail);
    }
    object.finish();
    Some(InstantsPlan {
        candidates,
        count,
        may_repeat,
        measured: measured?,
    })
}

fn read_all(field: &Field<'_>) -> Option<Vec<f64>> {
    let entries = entries::at_most(field, MAX_CANDIDATES, "instants")?;
    let instants = entries.map(|entry| entry.number_within(0.0, f64::INFINITY));
    instants.collect()
}
