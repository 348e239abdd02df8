//! The `limits` section: when a job stops at the latest.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::DEFAULT_MAX_DURATION_S;
use greybox_numerics::parsing::reader::Field;

/// When to stop at the latest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LimitsSpec {
    /// Computing time `[s]`; the best estimate so far is then the result.
    #[schema(exclusive_minimum = 0)]
    pub max_duration_s: f64,
}

impl Default for LimitsSpec {
    fn default() -> Self {
        Self {
            max_duration_s: DEFAULT_MAX_DURATION_S,
        }
    }
}

pub(super) fn read(field: &Field<'_>, longest: f64) -> LimitsSpec {
    let mut max_duration_s = DEFAULT_MAX_DURATION_S.min(longest);
    if let Some(mut object) = field.object() {
        if let Some(field) = object.optional("max_duration_s")
            && let Some(asked) = field.positive()
        {
            if asked > longest {
                let detail = format!("{asked} s is more than this server allows, {longest} s");
                field.fault("out_of_range", detail);
            }
            max_duration_s = asked;
        }
        object.finish();
    }
    LimitsSpec { max_duration_s }
}
