//! What stages have found out, as their manifests keep it.

use crate::experiment::compare::Comparison;
use crate::experiment::estimate::EstimateOutcome;
use crate::experiment::outcome::{MeshOutcome, SampleOutcome, SetOutcome};
use serde::{Deserialize, Serialize};

/// What the report says of the mesh.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeshFacts {
    /// Size and quality.
    pub mesh: MeshOutcome,
    /// The boundary sets.
    pub sets: Vec<SetOutcome>,
    /// Sets that are not to be believed, a sentence each.
    pub implausible: Vec<String>,
}

/// Of the figures of a patient's images what is not to be believed.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Implausible {
    /// A sentence each.
    #[serde(default)]
    pub implausible: Vec<String>,
}

/// The estimate's numbers, and its state as one more sample.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EstimateFacts {
    /// Modes, intervals, limits.
    pub estimate: EstimateOutcome,
    /// Moduli and errors in the layout of a sample.
    pub record: SampleOutcome,
    /// The models that were tried, where there were several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
    /// Loads and supports in words of each body that the verdict is about: several where it is an average, or a bound of all of them;
    /// none of a phantom, and in manifests of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub loads: Vec<String>,
}
