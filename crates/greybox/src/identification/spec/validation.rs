//! The `validation` section: what is held back to check the result.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::MAX_VALIDATION_FRACTION;
use greybox_numerics::parsing::reader::Field;

/// Which data are held back to check the result.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ValidationSpec {
    /// The share of each experiment, at its end, that the estimation does not see.
    #[schema(minimum = 0, maximum = 0.9)]
    pub fraction: f64,
}

impl Default for ValidationSpec {
    fn default() -> Self {
        Self { fraction: 0.25 }
    }
}

pub(super) fn read(field: &Field<'_>) -> ValidationSpec {
    let mut validation = ValidationSpec::default();
    if let Some(mut object) = field.object() {
        let fraction = object
            .optional("fraction")
            .and_then(|field| field.number_within(0.0, MAX_VALIDATION_FRACTION));
        validation.fraction = fraction.unwrap_or(validation.fraction);
        object.finish();
    }
    validation
}
