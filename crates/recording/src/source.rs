//! What recordings are read from.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// What a recording was read from, so that the reading can be repeated.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[schema(as = Source)]
pub struct RecordingSource {
    /// The format, e.g. `wide_csv` or `pi_web_api`; empty for recordings that no reader made.
    pub format: String,
    /// The options that came with it, as they were given.
    pub options: BTreeMap<String, String>,
}
