//! How the inputs of a design may be driven: their limits, the time grid, and what is proposed.

use super::excitation::{self, Proposal};
use crate::identification::spec::entries;
use crate::identification::spec::parameter::check_range;
use crate::uncertainty::design::search::Family;
use crate::uncertainty::design::{Excitation, Grid, Limits};
use greybox_numerics::parsing::reader::{Field, Object, did_you_mean, listed};
use greybox_simulation::model::ModelDescription;

/// Samples of an experiment at the most.
const MAX_SAMPLES: f64 = 100_000.0;
/// Proposals at the most.
const MAX_PROPOSALS: usize = 32;

/// How an experiment may be driven.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitable {
    /// Which of the model's input sets is driven.
    pub input_set: usize,
    /// The time grid with the limits of each input of the set.
    pub grid: Grid,
    /// The families that are searched.
    pub families: Vec<Family>,
    /// What is compared with them.
    pub proposals: Vec<Proposal>,
}

/// Reads `inputs`, `sample_time_s`, `duration_s`, `families` and `proposals`.
pub(super) fn read(
    root: &Object<'_>,
    [inputs, sample_time, duration, families, proposals]: [Option<Field<'_>>; 5],
    model: &ModelDescription,
) -> Option<Excitable> {
    let driven = read_inputs(root, inputs.as_ref(), model);
    let needed = |name: &str, field: &Option<Field<'_>>| match field {
        Some(field) => field.positive(),
        None => {
            root.fault("missing_field", format!("`{name}` is missing"));
            None
        }
    };
    let sample_time = needed("sample_time_s", &sample_time);
    let seconds = needed("duration_s", &duration);
    let families = families.map(|field| read_families(&field));
    let (input_set, limits) = driven?;
    let (sample_time, seconds) = (sample_time?, seconds?);
    let samples = (seconds / sample_time).round();
    if !(2.0..=MAX_SAMPLES).contains(&samples) {
        let detail = format!("{samples} samples: there must be 2 to {MAX_SAMPLES}");
        duration.as_ref()?.fault("out_of_range", detail);
        return None;
    }
    let grid = Grid {
        sample_time,
        samples: samples as usize,
        inputs: limits,
    };
    let names: Vec<&str> = model.input_sets[input_set].iter().map(|n| &**n).collect();
    let mut proposed = match &proposals {
        Some(field) => read_proposals(field, &grid, &names)?,
        None => Vec::new(),
    };
    let mut families = match families {
        Some(families) => families?,
        None if proposed.is_empty() => Family::ALL.to_vec(),
        None => Vec::new(),
    };
    if names.is_empty() {
        families.clear();
        proposed = vec![Proposal {
            name: "undriven".to_owned(),
            excitation: Excitation::Samples,
            samples: Some(Vec::new()),
        }];
    }
    if families.is_empty() && proposed.is_empty() {
        let detail = "neither a family is named nor anything proposed";
        root.fault("nothing_proposed", detail);
    }
    Some(Excitable {
        input_set,
        grid,
        families,
        proposals: proposed,
    })
}

/// The input set that is exactly what is named, with the limits of each of its inputs.
fn read_inputs(
    root: &Object<'_>,
    inputs: Option<&Field<'_>>,
    model: &ModelDescription,
) -> Option<(usize, Vec<Limits>)> {
    let mut named: Vec<(&str, Limits)> = Vec::new();
    let object = match inputs {
        Some(field) => Some(field.object()?),
        None => None,
    };
    for (name, field) in object.map(|object| object.entries()).into_iter().flatten() {
        if !model.inputs.iter().any(|input| input.name == name) {
            let hint = did_you_mean(name, model.inputs.iter().map(|input| &*input.name));
            let detail = format!("`{}` has no input of this name{hint}", model.name);
            field.fault("unknown_input", detail);
            return None;
        }
        named.push((name, read_limits(&field)?));
    }
    let limits_of = |name: &str| named.iter().find(|(input, _)| *input == name);
    for (index, set) in model.input_sets.iter().enumerate() {
        let limits = set
            .iter()
            .map(|name| limits_of(name).map(|(_, limits)| *limits));
        let limits: Option<Vec<Limits>> = limits.collect();
        if let Some(limits) = limits.filter(|limits| limits.len() == named.len()) {
            return Some((index, limits));
        }
    }
    let sets: Vec<String> = model.input_sets.iter().map(|set| set.join(" + ")).collect();
    let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
    let detail = format!(
        "`{}` is driven by {}: `inputs` must give the limits of just these",
        model.name,
        listed(&sets)
    );
    match inputs {
        Some(field) => field.fault("inputs_missing", detail),
        None => root.fault("inputs_missing", detail),
    }
    None
}

fn read_limits(field: &Field<'_>) -> Option<Limits> {
    let mut object = field.object()?;
    let lower = object.required("lower").and_then(|field| field.number());
    let upper = object.required("upper").and_then(|field| field.number());
    let rate = object.optional("rate_per_s");
    let rate = rate.map(|field| field.positive());
    object.finish();
    let (lower, upper) = (lower?, upper?);
    check_range(field, lower, upper)?;
    let rate = match rate {
        Some(rate) => Some(rate?),
        None => None,
    };
    Some(Limits { lower, upper, rate })
}

fn read_families(field: &Field<'_>) -> Option<Vec<Family>> {
    let choices = Family::ALL.map(|family| (family.name(), family));
    let mut families = Vec::new();
    for entry in field.array()? {
        let family = entry.choice(&choices)?;
        if families.contains(&family) {
            let detail = format!("`{}` is named twice", family.name());
            entry.fault("duplicate", detail);
        }
        families.push(family);
    }
    Some(families)
}

fn read_proposals(field: &Field<'_>, grid: &Grid, inputs: &[&str]) -> Option<Vec<Proposal>> {
    let entries = entries::at_most(field, MAX_PROPOSALS, "proposals")?;
    let read = entries.enumerate();
    let read: Vec<_> = read
        .map(|(index, entry)| excitation::read(&entry, index, grid, inputs))
        .collect();
    read.into_iter().collect()
}
