//! The `parameters` section: what is known about each parameter of the model.

use std::collections::BTreeMap;

use super::prior::{self, PriorSpec};
use greybox_numerics::parsing::reader::{Field, did_you_mean};
use greybox_simulation::model::{
    ModelDescription, ParameterDescription, Scale, Tolerance, ToleranceText,
};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What is known about a parameter: its value, or a range to look in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum ParameterSpec {
    /// Known.
    Fixed(FixedValue),
    /// Unknown: estimated between two bounds.
    Free(FreeParameter),
}

/// A known value, SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixedValue {
    /// The value, SI.
    #[schema(example = 7e6)]
    pub value: f64,
    /// How well it is known: one standard deviation, a number in its unit or a share such as
    /// `"1 %"`; left out, what the model says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<ToleranceText>, nullable = false, example = "1 %")]
    pub tolerance: Option<Tolerance>,
}

/// An unknown parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FreeParameter {
    /// The range of the search; what is left out is the model's.
    pub estimate: SearchRange,
    /// The prior knowledge of the value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub prior: Option<PriorSpec>,
}

/// The search range of a parameter, SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"lower": 2e8, "upper": 2.4e9, "scale": "log"}))]
pub struct SearchRange {
    /// The lower bound.
    #[schema(required = false)]
    pub lower: f64,
    /// The upper bound.
    #[schema(required = false)]
    pub upper: f64,
    /// How the range is laid out.
    #[schema(required = false)]
    pub scale: Scale,
    /// Where a descent begins beside those of the search, within the range: what is known from a data sheet, or
    /// what an earlier job came to. Unknowns without one stand there where the best candidate of the search has
    /// them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub start: Option<f64>,
}

impl SearchRange {
    /// The range of a model's parameter.
    #[must_use]
    pub fn of(parameter: &ParameterDescription) -> SearchRange {
        SearchRange {
            lower: parameter.lower,
            upper: parameter.upper,
            scale: parameter.scale,
            start: None,
        }
    }
}

/// One entry for each parameter of the model; what the section leaves out is the model's.
pub(super) fn read_all(
    section: Option<&Field<'_>>,
    model: &ModelDescription,
) -> BTreeMap<String, ParameterSpec> {
    let mut parameters: BTreeMap<String, ParameterSpec> = model
        .parameters
        .iter()
        .map(|parameter| (parameter.name.to_string(), by_default(parameter)))
        .collect();
    if let Some(section) = section {
        parameters.extend(read_named(section, model));
    }
    parameters
}

/// The parameters that a section names.
pub(super) fn read_named(
    section: &Field<'_>,
    model: &ModelDescription,
) -> BTreeMap<String, ParameterSpec> {
    let mut named = BTreeMap::new();
    for (name, field) in section.object().map(|o| o.entries()).into_iter().flatten() {
        let Some(index) = index_of(name, &field, model) else {
            continue;
        };
        if let Some(read) = read(&field, &model.parameters[index]) {
            named.insert(name.to_owned(), read);
        }
    }
    named
}

/// A value for each parameter, in the order of the model: a number or `{"value": …}`.
pub(super) fn read_values(section: Option<&Field<'_>>, model: &ModelDescription) -> Vec<f64> {
    let mut values = model.defaults();
    let entries = section.and_then(|field| field.object());
    for (name, field) in entries.map(|o| o.entries()).into_iter().flatten() {
        let Some(index) = index_of(name, &field, model) else {
            continue;
        };
        let parameter = &model.parameters[index];
        let value = if field.value.is_number() {
            possible(&field, parameter)
        } else {
            read_value(&field, parameter)
        };
        values[index] = value.unwrap_or(values[index]);
    }
    values
}

fn read_value(field: &Field<'_>, parameter: &ParameterDescription) -> Option<f64> {
    let mut object = field.object()?;
    let value = object.required("value");
    let value = value.and_then(|value| possible(&value, parameter));
    // What a job says of a parameter may stand here too.
    if let Some(tolerance) = object.optional("tolerance") {
        let _ = Tolerance::read(&tolerance);
    }
    object.finish();
    value
}

/// The index of a parameter in the model; a fault when the model has none of that name.
fn index_of(name: &str, field: &Field<'_>, model: &ModelDescription) -> Option<usize> {
    let index = model.parameter_index(name);
    if index.is_none() {
        let hint = did_you_mean(name, model.parameters.iter().map(|p| &*p.name));
        let detail = format!("`{}` has no parameter of this name{hint}", model.name);
        field.fault("unknown_parameter", detail);
    }
    index
}

fn by_default(parameter: &ParameterDescription) -> ParameterSpec {
    if parameter.unknown_by_default {
        ParameterSpec::Free(FreeParameter {
            estimate: SearchRange::of(parameter),
            prior: None,
        })
    } else {
        ParameterSpec::Fixed(FixedValue {
            value: parameter.default,
            tolerance: parameter.tolerance,
        })
    }
}

fn read(field: &Field<'_>, parameter: &ParameterDescription) -> Option<ParameterSpec> {
    let mut object = field.object()?;
    let value = object.optional("value");
    let estimate = object.optional("estimate");
    let read = match (value, estimate) {
        (Some(value), None) => {
            let value = possible(&value, parameter);
            let tolerance = match object.optional("tolerance") {
                Some(field) => Tolerance::read(&field),
                None => parameter.tolerance,
            };
            value.map(|value| ParameterSpec::Fixed(FixedValue { value, tolerance }))
        }
        (None, Some(estimate)) => {
            let range = read_range(&estimate, parameter);
            let prior = object.optional("prior");
            let prior = prior.and_then(|field| prior::read(&field));
            range.map(|estimate| ParameterSpec::Free(FreeParameter { estimate, prior }))
        }
        (Some(_), Some(_)) => {
            let detail = "`value` and `estimate` exclude each other";
            object.fault("value_and_estimate", detail);
            None
        }
        (None, None) => {
            let detail = "either `value` or `estimate` is needed";
            object.fault("missing_field", detail);
            None
        }
    };
    object.finish();
    read
}

fn read_range(field: &Field<'_>, parameter: &ParameterDescription) -> Option<SearchRange> {
    let mut object = field.object()?;
    let lower = object.optional("lower");
    let upper = object.optional("upper");
    let scale = object
        .optional("scale")
        .map(|field| field.choice(&[("linear", Scale::Linear), ("log", Scale::Log)]));
    let at_lower = lower.clone();
    let lower = lower.map_or(Some(parameter.lower), |field| possible(&field, parameter));
    let upper = upper.map_or(Some(parameter.upper), |field| possible(&field, parameter));
    let scale = scale.unwrap_or(Some(parameter.scale));
    let start = object.optional("start");
    object.finish();
    let (lower, upper, scale) = (lower?, upper?, scale?);
    let at_lower = at_lower.as_ref().unwrap_or(field);
    check_range(at_lower, lower, upper)?;
    if scale == Scale::Log && lower <= 0.0 {
        let detail =
            format!("a log scale needs lower {lower} above 0; or say \"scale\": \"linear\"");
        at_lower.fault("log_scale_not_positive", detail);
        return None;
    }
    let start = match start {
        Some(field) => Some(within(&field, lower, upper)?),
        None => None,
    };
    Some(SearchRange {
        lower,
        upper,
        scale,
        start,
    })
}

/// Nothing, with a fault, where the lower bound of a range is not below the upper one.
pub(super) fn check_range(field: &Field<'_>, lower: f64, upper: f64) -> Option<()> {
    if lower >= upper {
        let detail = format!("lower {lower} is not below upper {upper}");
        field.fault("bounds_reversed", detail);
        return None;
    }
    Some(())
}

/// A number within a range; nothing, with a fault, where it lies outside.
fn within(field: &Field<'_>, lower: f64, upper: f64) -> Option<f64> {
    let number = field.number()?;
    if !(lower..=upper).contains(&number) {
        let detail = format!("{number} is outside the search range, {lower} to {upper}");
        field.fault("start_outside_range", detail);
        return None;
    }
    Some(number)
}

/// A number that the parameter can physically have.
fn possible(field: &Field<'_>, parameter: &ParameterDescription) -> Option<f64> {
    let number = field.number()?;
    let (name, unit) = (&parameter.name, &parameter.unit);
    if let Some(minimum) = parameter.minimum.filter(|minimum| number < *minimum) {
        let detail =
            format!("{number} {unit} is below the least possible {name}, {minimum} {unit}");
        field.fault("impossible_value", detail);
        return None;
    }
    if let Some(maximum) = parameter.maximum.filter(|maximum| number > *maximum) {
        let detail =
            format!("{number} {unit} is above the largest possible {name}, {maximum} {unit}");
        field.fault("impossible_value", detail);
        return None;
    }
    Some(number)
}
