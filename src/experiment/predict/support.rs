//! A way of supporting the brain with its weight among draws.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A way of supporting the brain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SupportWeight {
    /// `fixed` or `sliding`.
    pub supports: String,
    /// How probable it was taken to be.
    pub weight: f64,
}

impl SupportWeight {
    /// The brain is not held, but slides.
    pub(super) fn slides(&self) -> bool {
        self.supports == "sliding"
    }

    /// What the skull does, and how much that counts.
    pub(super) fn in_words(&self) -> String {
        let what = if self.slides() { "slides on the skull" } else { "is held at its base and at the falx" };
        format!("it {what} (weight {:.0} %)", 100.0 * self.weight)
    }
}
