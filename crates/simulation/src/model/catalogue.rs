//! The models that come with the program: two in Rust, the others as documents that a user could
//! have written, each in a file of its name in the folder `catalogue`.

use super::{Model, document, positioning_drive, single_rod_servo};
use std::sync::{Arc, LazyLock};

/// The documents, in the order of the catalogue.
const DOCUMENTS: [&str; 7] = [
    include_str!("catalogue/dc_motor.json"),
    include_str!("catalogue/cascaded_tanks.json"),
    include_str!("catalogue/mass_spring_damper.json"),
    include_str!("catalogue/first_order_dead_time.json"),
    include_str!("catalogue/double_rod_cylinder.json"),
    include_str!("catalogue/heat_exchanger.json"),
    include_str!("catalogue/bouc_wen.json"),
];

/// The models that can be named in a job.
#[derive(Clone, Debug)]
pub struct Catalogue {
    models: Vec<Arc<Model>>,
}

impl Catalogue {
    /// The models that are part of this program.
    #[must_use]
    pub fn built_in() -> Catalogue {
        static BUILT_IN: LazyLock<Catalogue> = LazyLock::new(|| {
            let native = [single_rod_servo::model(), positioning_drive::model()];
            let written = DOCUMENTS.iter().map(|text| of_document(text));
            Catalogue {
                models: native.into_iter().chain(written).map(Arc::new).collect(),
            }
        });
        BUILT_IN.clone()
    }

    /// Adds a model.
    pub fn add(&mut self, model: Arc<Model>) {
        self.models.push(model);
    }

    /// A model by its name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Arc<Model>> {
        self.models
            .iter()
            .find(|model| model.description().name == name)
    }

    /// All models.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<Model>> {
        self.models.iter()
    }
}

fn of_document(text: &str) -> Model {
    let document = serde_json::from_str(text).expect("the program's own document is JSON");
    let read = document::read(&document).expect("the program's own document is right");
    read.model.with_document(document)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_document_is_right_uses_its_parameters_and_names_its_source() {
        for text in DOCUMENTS {
            let document = serde_json::from_str(text).unwrap();
            let read = document::read(&document);
            let read = read.unwrap_or_else(|faults| panic!("{faults:#?}"));
            assert!(read.warnings.is_empty(), "{:?}", read.warnings);
            let description = read.model.description();
            assert!(description.source.len() > 20, "{}", description.name);
            assert!(description.parameters.iter().any(|p| p.unknown_by_default));
        }
    }
}
