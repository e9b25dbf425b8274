//! A law as results record it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A law and its parameters, as a scenario writes them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LawOutcome {
    /// Its name in scenario files.
    pub law: String,
    /// Parameters by name, units in the names.
    pub parameters: BTreeMap<String, f64>,
}
