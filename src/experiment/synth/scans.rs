//! Which of the two scans something is in.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which of a patient's two scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Scans {
    /// Neither.
    #[default]
    None,
    /// The pre-operative one.
    Pre,
    /// The post-operative one.
    Post,
    /// Both.
    Both,
}

impl Scans {
    /// Whether the pre-operative scan is meant.
    pub fn in_pre(self) -> bool {
        matches!(self, Self::Pre | Self::Both)
    }

    /// Whether the post-operative scan is meant.
    pub fn in_post(self) -> bool {
        matches!(self, Self::Post | Self::Both)
    }
}
