//! Models by name and from text, as programs ask for them.

use super::{Catalogue, Model, document};
use greybox_numerics::parsing::{Fault, json, yaml};
use std::sync::Arc;

impl Model {
    /// A model of the catalogue; none where it has no such name.
    ///
    /// ```
    /// let servo = greybox_simulation::model::Model::named("single_rod_servo").expect("it is in the catalogue");
    /// assert!(servo.description().parameter_index("bulk_modulus").is_some());
    /// ```
    #[must_use]
    pub fn named(name: &str) -> Option<Arc<Model>> {
        Catalogue::built_in().get(name).cloned()
    }

    /// A model from the text of a document, YAML or JSON.
    ///
    /// # Errors
    /// Everything that is wrong with it, each fault with a JSON pointer.
    ///
    /// ```
    /// let lag = greybox_simulation::model::Model::from_text(
    ///     r#"{
    ///         "name": "lag",
    ///         "inputs": {"u": {"unit": "V"}},
    ///         "parameters": {"T": {"unit": "s", "default": 1, "lower": 0.1, "upper": 10}},
    ///         "states": {"y": {"unit": "V", "initial": 0, "derivative": "(u - y)/T"}},
    ///         "outputs": {"y_out": {"unit": "V", "expression": "y"}}
    ///     }"#,
    /// )?;
    /// assert_eq!(lag.description().states.len(), 1);
    /// # Ok::<(), Vec<greybox_numerics::parsing::Fault>>(())
    /// ```
    pub fn from_text(text: &str) -> Result<Arc<Model>, Vec<Fault>> {
        let unreadable = |error: String| vec![Fault::new("", "not_a_document", error)];
        let document = if text.trim_start().starts_with('{') {
            json::parse(text.as_bytes()).map_err(|error| unreadable(error.to_string()))?
        } else {
            yaml::parse(text).map_err(|error| unreadable(error.to_string()))?
        };
        document::referenced(&document).map(|read| read.model)
    }
}
