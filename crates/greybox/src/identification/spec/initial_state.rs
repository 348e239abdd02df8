//! Where the states of an experiment start.

use super::parameter::check_range;
use super::{FixedValue, PriorSpec, prior};
use greybox_numerics::parsing::reader::{Field, did_you_mean, listed};
use greybox_simulation::model::{ModelDescription, Tolerance};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Where a state starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum InitialStateSpec {
    /// At a known value, SI.
    Fixed(FixedValue),
    /// At a bare number, SI. The completed specification says `{"value": …}`.
    Number(f64),
    /// At the first measured sample; for states that are measured outputs.
    Measured(FirstSample),
    /// Unknown: estimated between two bounds.
    Free(FreeState),
}

/// The word `first_sample`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FirstSample {
    /// The first measured sample.
    FirstSample,
}

/// An unknown initial state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FreeState {
    /// The bounds of the search.
    pub estimate: StateRange,
    /// The prior knowledge of the value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub prior: Option<PriorSpec>,
}

/// The search range of an initial state, SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"lower": -0.1, "upper": 0.1}))]
pub struct StateRange {
    /// The lower bound.
    pub lower: f64,
    /// The upper bound.
    pub upper: f64,
}

/// The `initial_state` section: where each state starts.
pub(super) fn read_initial_state(
    field: &Field<'_>,
    model: &ModelDescription,
    signals: Option<&BTreeMap<String, String>>,
) -> BTreeMap<String, InitialStateSpec> {
    let mut states = BTreeMap::new();
    for (name, field) in field.object().map(|o| o.entries()).into_iter().flatten() {
        if !model.states.iter().any(|state| state.name == name) {
            let names: Vec<&str> = model.states.iter().map(|state| &*state.name).collect();
            let hint = did_you_mean(name, names.iter().copied());
            let detail = format!(
                "the states of `{}` are {}{hint}",
                model.name,
                listed(&names)
            );
            field.fault("unknown_state", detail);
        }
        let measured = signals.is_none_or(|signals| signals.contains_key(name))
            && model.outputs.iter().any(|output| output.name == name);
        if let Some(state) = read_state(&field, name, measured) {
            states.insert(name.to_owned(), state);
        }
    }
    states
}

fn read_state(field: &Field<'_>, name: &str, measured: bool) -> Option<InitialStateSpec> {
    if field.value.is_number() {
        let value = field.number()?;
        return Some(InitialStateSpec::Fixed(FixedValue {
            value,
            tolerance: None,
        }));
    }
    if field.value.is_string() {
        let first = field.choice(&[("first_sample", FirstSample::FirstSample)])?;
        if !measured {
            let detail = format!("`{name}` is not a measured output, so it has no first sample");
            field.fault("state_not_measured", detail);
        }
        return Some(InitialStateSpec::Measured(first));
    }
    let mut object = field.object()?;
    let value = object.optional("value");
    let estimate = object.optional("estimate");
    let read = match (value, estimate) {
        (Some(value), None) => {
            let tolerance = object.optional("tolerance");
            let tolerance = tolerance.and_then(|field| Tolerance::read(&field));
            let value = value.number();
            value.map(|value| InitialStateSpec::Fixed(FixedValue { value, tolerance }))
        }
        (None, Some(estimate)) => {
            let prior = object.optional("prior");
            let prior = prior.and_then(|field| prior::read(&field));
            let range = read_range(&estimate);
            range.map(|estimate| InitialStateSpec::Free(FreeState { estimate, prior }))
        }
        _ => {
            let detail = "a number, \"first_sample\", {\"value\": …} or {\"estimate\": \
                          {\"lower\": …, \"upper\": …}} is needed";
            object.fault("missing_field", detail);
            None
        }
    };
    object.finish();
    read
}

fn read_range(field: &Field<'_>) -> Option<StateRange> {
    let mut object = field.object()?;
    let lower = object.required("lower").and_then(|field| field.number());
    let upper = object.required("upper").and_then(|field| field.number());
    object.finish();
    let (lower, upper) = (lower?, upper?);
    check_range(field, lower, upper)?;
    Some(StateRange { lower, upper })
}
