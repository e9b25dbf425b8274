//! A way of supporting the brain with its weight among draws.

use crate::tag::BASE;
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

    /// What the skull does, and how much that counts; `held` are the sets that do not move where it holds the brain.
    pub(super) fn in_words(&self, held: &[String]) -> String {
        let what =
            if self.slides() { "slides on the skull".to_owned() } else { format!("is held at {}", places(held)) };
        format!("it {what} (weight {:.0} %)", 100.0 * self.weight)
    }
}

/// "its base and at the falx".
fn places(sets: &[String]) -> String {
    let place = |set: &String| if set == BASE { "its base".to_owned() } else { format!("the {set}") };
    sets.iter().map(place).collect::<Vec<_>>().join(" and at ")
}
