//! Why a step of a recipe cannot be done.

use greybox_numerics::parsing::Fault;

/// Why a step cannot be done.
#[derive(Debug)]
pub(super) struct PreparationFault {
    /// The field of the step; empty for the step as a whole.
    pub(super) field: &'static str,
    /// The faults, which point into the field.
    pub(super) faults: Vec<Fault>,
}

impl PreparationFault {
    pub(super) fn of_field(field: &'static str, code: &'static str, detail: String) -> Self {
        Self {
            field,
            faults: vec![Fault::new("", code, detail)],
        }
    }

    pub(super) fn of_step(code: &'static str, detail: String) -> Self {
        Self::of_field("", code, detail)
    }

    /// The faults of the k-th step of a recipe.
    pub(super) fn at_step(self, k: usize) -> Vec<Fault> {
        let place = match self.field {
            "" => format!("/steps/{k}"),
            field => format!("/steps/{k}/{field}"),
        };
        self.faults
            .into_iter()
            .map(|fault| fault.below(&place))
            .collect()
    }
}
