//! The `constraints` section: conditions that the parameters keep.

use super::entries;
use super::own_parameters::JobParameters;
use greybox_numerics::parsing::reader::Field;
use greybox_simulation::model::document::Condition;

/// The constraints of one job at the most.
pub const MAX_CONSTRAINTS: usize = 16;

/// The section; what is wrong is told.
pub(super) fn read(field: &Field<'_>, parameters: JobParameters<'_>) -> Vec<String> {
    let model = parameters.model;
    let mut texts = Vec::new();
    for entry in entries::first(field, MAX_CONSTRAINTS, "constraints") {
        let conditions = Condition::read(&entry, model);
        let indices = conditions.iter().flat_map(Condition::parameters);
        let mut names = indices.map(|index| &*model.parameters[*index].name);
        if !conditions.is_empty() && !names.any(|name| parameters.is_unknown_anywhere(name)) {
            let detail = "every parameter in it is known: there is nothing to keep";
            entry.fault("nothing_to_constrain", detail);
        }
        texts.extend(entry.value.as_str().map(str::to_owned));
    }
    texts
}

#[cfg(test)]
mod tests {
    use super::super::own_parameters;
    use super::*;
    use serde_json::{Value, json};

    fn faults(document: &Value) -> Vec<(String, String)> {
        own_parameters::faults_of(document, read)
    }

    #[test]
    fn what_cannot_be_kept_is_refused_at_its_place() {
        let fine = json!(["mass < 90", "2*mass < 150 and damping < 1e5"]);
        assert_eq!(faults(&fine), []);
        for (document, pointer, code) in [
            (json!(["mass"]), "/0", "not_a_condition"),
            (
                json!(["mass < 90", "mass <"]),
                "/1",
                "expression_not_understood",
            ),
            (json!(["mass == 90"]), "/0", "expression_not_understood"),
            (
                json!(["supply_pressure < 8e6"]),
                "/0",
                "nothing_to_constrain",
            ),
            (json!(["mass < 90", 3]), "/1", "wrong_type"),
            (json!("mass < 90"), "", "wrong_type"),
            (json!(vec!["mass < 90"; 17]), "", "too_many"),
        ] {
            let expected = (pointer.to_owned(), code.to_owned());
            assert_eq!(faults(&document), [expected], "{document}");
        }
    }
}
