//! The `model` field: a name of the catalogue, a reference to a stored document, or the document.

use serde_json::Value;
use utoipa::ToSchema;

use super::labels::MAX_NAME_CHARS;
use greybox_numerics::parsing::reader::{Field, did_you_mean, listed};
use greybox_simulation::model::ModelDescription;

/// A model by its name, or the model document itself.
#[derive(ToSchema)]
#[serde(untagged)]
pub enum ModelOfJob {
    /// A name of the catalogue, or `name@digest`.
    Name(String),
    /// The document, as `POST /v1/models` takes it.
    #[schema(value_type = Object)]
    Document(Value),
}

/// The description of the model that the field names; documents stand under their references.
pub(super) fn read_model<'m>(
    field: &Field<'_>,
    models: &[&'m ModelDescription],
) -> Option<&'m ModelDescription> {
    let name = field.text()?;
    let model = models.iter().copied().find(|model| model.name == name);
    if model.is_none() {
        let names: Vec<&str> = models.iter().map(|model| &*model.name).collect();
        let hint = did_you_mean(name, names.iter().copied());
        let name: String = name.chars().take(MAX_NAME_CHARS).collect();
        let detail = format!("there is no model `{name}`, only {}{hint}", listed(&names));
        field.fault("unknown_model", detail);
    }
    model
}
