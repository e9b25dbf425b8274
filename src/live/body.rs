//! What a session is opened on.

use crate::fem::Scenario;
use crate::mesh::TetMesh;
use crate::workflow::Sights;
use serde::Serialize;

/// A shear modulus as a Gaussian over its logarithm knows it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Mean of ln(modulus in Pa).
    pub log_mean: f64,
    /// Standard deviation of the same.
    pub log_sd: f64,
}

/// A tissue with what is known of its shear modulus.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveTissue {
    /// Its name in the scenario.
    pub name: String,
    /// What the Gaussian process over the literature says; none for a tissue without a task of its own.
    pub prior: Option<Spread>,
    /// What the case's estimate says.
    pub posterior: Option<Spread>,
}

/// Mesh, scenario and what is known of the tissues.
#[derive(Clone, Debug)]
pub struct LiveBody {
    /// What it is called on the page.
    pub name: String,
    /// The undeformed mesh.
    pub mesh: TetMesh,
    /// Materials, loads, supports.
    pub scenario: Scenario,
    /// The scenario's materials by name.
    pub tissues: Vec<LiveTissue>,
    /// What is seen beside it.
    pub sights: Sights,
    /// What the page should say beside it.
    pub notes: Vec<String>,
    /// SHA-256 of the mesh's nodes, tetrahedra and labels: a recording belongs to one mesh.
    pub mesh_sha256: String,
}
