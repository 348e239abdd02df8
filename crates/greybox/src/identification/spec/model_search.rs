//! The `model_search` section: which parameters stand for effects that may be left out.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{FreeParameter, ParameterSpec, SearchRange};
use greybox_numerics::parsing::reader::{Field, did_you_mean};
use greybox_simulation::model::{ModelDescription, ParameterDescription};

/// The effects that the data decide about at the most.
const MOST_EFFECTS: usize = 10;

/// Effects that the data decide about. All of them are estimated first; then those are left out
/// that the data do not support, and the result is the estimate without them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"effects": ["coulomb_friction", "dead_band"]}))]
pub struct ModelSearch {
    /// Parameters of the model, 1 to 10; left out, they have the model's default.
    #[schema(min_items = 1, max_items = 10)]
    pub effects: Vec<String>,
}

/// The section; none where it is wrong.
pub(super) fn read(
    field: &Field<'_>,
    model: &ModelDescription,
    parameters: Option<&BTreeMap<String, ParameterSpec>>,
) -> Option<ModelSearch> {
    let mut object = field.object()?;
    let section = object.required("effects");
    let mut effects = Vec::new();
    if let Some(section) = &section
        && let Some(entries) = section.array()
    {
        if !(1..=MOST_EFFECTS).contains(&entries.len()) {
            let detail = format!("{} effects: 1 to {MOST_EFFECTS} are tried", entries.len());
            section.fault("out_of_range", detail);
        }
        for entry in entries.take(MOST_EFFECTS) {
            let name = entry.text();
            if let Some(name) = name
                && let Some(described) = described(name, &entry, model)
                && is_new(name, &entry, &effects)
            {
                check_value(&entry, described, parameters);
                effects.push(name.to_owned());
            }
        }
    }
    object.finish();
    Some(ModelSearch { effects })
}

/// The parameter of the model that has a name; a fault where the model has none.
fn described<'m>(
    name: &str,
    entry: &Field<'_>,
    model: &'m ModelDescription,
) -> Option<&'m ParameterDescription> {
    let described = model.parameters.iter().find(|p| p.name == name);
    if described.is_none() {
        let hint = did_you_mean(name, model.parameters.iter().map(|p| &*p.name));
        let detail = format!("`{}` has no parameter of this name{hint}", model.name);
        entry.fault("unknown_parameter", detail);
    }
    described
}

/// Whether an effect is not among those named before; else that is a fault.
fn is_new(name: &str, entry: &Field<'_>, before: &[String]) -> bool {
    let is_new = !before.iter().any(|effect| effect == name);
    if !is_new {
        entry.fault("duplicate", format!("`{name}` is named twice"));
    }
    is_new
}

/// An effect that is left out has the model's default, so another value makes no sense.
fn check_value(
    entry: &Field<'_>,
    described: &ParameterDescription,
    parameters: Option<&BTreeMap<String, ParameterSpec>>,
) {
    let name = &*described.name;
    let spec = parameters.and_then(|parameters| parameters.get(name));
    if let Some(ParameterSpec::Fixed(fixed)) = spec
        && fixed.value != described.default
    {
        let detail = format!(
            "`{name}` is fixed at {}, but an effect that is left out has the model's default, {}",
            fixed.value, described.default
        );
        entry.fault("contradiction", detail);
    }
}

/// The parameters, with a search range for every effect: the one that the job gives, else the
/// model's.
pub(super) fn freed(
    mut parameters: BTreeMap<String, ParameterSpec>,
    model: &ModelDescription,
    search: &ModelSearch,
) -> BTreeMap<String, ParameterSpec> {
    for effect in &search.effects {
        let described = model.parameters.iter().find(|p| p.name == **effect);
        if let (Some(described), Some(ParameterSpec::Fixed(_))) =
            (described, parameters.get(effect))
        {
            let free = ParameterSpec::Free(FreeParameter {
                estimate: SearchRange::of(described),
                prior: None,
            });
            parameters.insert(effect.clone(), free);
        }
    }
    parameters
}
