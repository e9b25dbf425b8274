//! The names of a header's two affines.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One of the two affines a NIfTI header can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Orientation {
    /// The rows `srow_x`, `srow_y`, `srow_z`.
    Sform,
    /// The quaternion, the offset and `pixdim`.
    Qform,
}

impl std::fmt::Display for Orientation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Sform => "sform",
            Self::Qform => "qform",
        })
    }
}
