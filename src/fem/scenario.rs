//! What is to be simulated: the contents of SCENARIO.toml.

use super::contact::{Contact, Support, Tether};
use super::element::ElementKind;
use crate::material::law::Material;
use crate::material::toml_text::line_of;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use thiserror::Error;

/// Materials by label name.
pub type Materials = BTreeMap<String, Material>;

/// A simulation without its mesh. Lengths in mm, forces in N, moduli in Pa.
///
/// ```
/// let scenario = hgm::fem::Scenario::from_toml(r#"
/// fixed = ["base", "falx"]
/// [materials.grey_matter]
/// law = "neo-hookean"
/// shear_modulus_pa = 1370.0
/// poisson_ratio = 0.45
/// [loads]
/// gravity_m_per_s2 = [0.0, 0.0, -9.81]
/// [[loads.patch]]
/// set = "superior"
/// force_n = [0.0, 0.0, -2.0]
/// "#).unwrap();
/// assert_eq!(scenario.loads.patch[0].set, "superior");
/// assert!(hgm::fem::Scenario::from_toml("fixd = []").is_err());
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// Node sets held at zero displacement.
    pub fixed: Vec<String>,
    /// Sets that are held or slide: `falx = "sliding"`, `base = "fixed"` (as in `fixed`).
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub supports: BTreeMap<String, Support>,
    /// Walls that surfaces stand before, `[[contact]]`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contact: Vec<Contact>,
    /// Springs between surfaces and their places at rest, `[[tethers]]`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tethers: Vec<Tether>,
    /// Node sets moved by a given displacement.
    pub prescribed: Vec<Prescribed>,
    /// One law per label name.
    pub materials: BTreeMap<String, Material>,
    /// What pulls and pushes.
    pub loads: Loads,
    /// How it is solved.
    pub solver: SolverSettings,
    /// Steps in time, for `method = "backward-euler"`.
    pub dynamics: DynamicsSettings,
    /// Label numbers of the mesh where they are not those of DSEG files: `grey_matter = 1`.
    pub labels: BTreeMap<String, u8>,
}

/// A node set moved as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prescribed {
    /// Node set.
    pub set: String,
    /// Where it goes, mm.
    pub displacement_mm: [f64; 3],
    /// Which of x, y, z are prescribed; the others stay free.
    #[serde(default = "all_components")]
    pub components: [bool; 3],
}

fn all_components() -> [bool; 3] {
    [true; 3]
}

/// Loads; all of them act on the undeformed shape and keep their direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Loads {
    /// Acceleration, any direction.
    pub gravity_m_per_s2: [f64; 3],
    /// Density of all tissue.
    pub density_kg_per_m3: f64,
    /// Total forces over sets, shared by area.
    pub patch: Vec<PatchLoad>,
    /// Pressures on sets, along the inward normal.
    pub pressure: Vec<PressureLoad>,
    /// Fluid that carries part of the weight.
    pub csf: Option<CsfLevel>,
}

impl Default for Loads {
    fn default() -> Self {
        let (patch, pressure) = (Vec::new(), Vec::new());
        Self { gravity_m_per_s2: [0.0; 3], density_kg_per_m3: 1000.0, patch, pressure, csf: None }
    }
}

/// A force shared by the facets of a set by area, a third to each corner. A facet set is taken as it is; of a node set
/// the boundary facets with all three nodes in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchLoad {
    /// Facet set or node set.
    pub set: String,
    /// Total force, N.
    pub force_n: [f64; 3],
}

/// A pressure on the facets of a set (found as for [`PatchLoad`]), positive pushing into the tissue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureLoad {
    /// Facet set or node set.
    pub set: String,
    /// Pressure, Pa (1 mmHg = 133.322 Pa).
    pub pressure_pa: f64,
}

/// Cerebrospinal fluid up to a level: tissue below it weighs (rho_tissue - rho_fluid) g, above it its full weight, an
/// element at the level by its parts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CsfLevel {
    /// Density of the fluid (1007 for cerebrospinal fluid).
    pub density_kg_per_m3: f64,
    /// Height of the surface above the origin, against gravity, mm: with gravity along -z the z of the surface.
    pub level_mm: f64,
}

/// Static equilibrium or motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Equilibrium under the full loads.
    #[default]
    Static,
    /// Implicit backward Euler from rest.
    BackwardEuler,
}

/// Linear solvers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LinearMethod {
    /// Chosen by size and Poisson's ratio.
    #[default]
    Auto,
    /// Conjugate gradients, diagonal preconditioner.
    PcgJacobi,
    /// Conjugate gradients, 3 x 3 block-diagonal preconditioner.
    PcgBlockJacobi,
    /// Factor LL^T on a nested-dissection ordering, kept as a preconditioner while the tangent changes little.
    Direct,
}

/// How equilibrium is found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolverSettings {
    /// Static or dynamic.
    pub method: Method,
    /// Out-of-balance force over applied force at which a state counts as equilibrium.
    pub relative_residual: f64,
    /// Element.
    #[schemars(with = "String")]
    pub element: ElementKind,
    /// Linear solver.
    pub linear: LinearMethod,
    /// Newton iterations per load step before the step is cut.
    pub newton_iterations: usize,
    /// A load step below this part of the whole load is given up.
    pub smallest_load_step: f64,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            method: Method::Static,
            relative_residual: 1e-8,
            element: ElementKind::TET4,
            linear: LinearMethod::Auto,
            newton_iterations: 50,
            smallest_load_step: 1.0 / 256.0,
        }
    }
}

/// Mass per node, or spread over elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MassKind {
    /// A quarter of each tetrahedron's mass at each corner.
    #[default]
    Lumped,
    /// The Galerkin mass matrix.
    Consistent,
}

/// Backward Euler with Rayleigh damping C = a M + b K.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DynamicsSettings {
    /// Time step, s.
    pub time_step_s: f64,
    /// Most steps.
    pub steps: usize,
    /// a, 1/s.
    pub mass_damping_per_s: f64,
    /// b, s.
    pub stiffness_damping_s: f64,
    /// Mass matrix.
    pub mass: MassKind,
    /// Newton iterations per step; 0: until the residual asked for.
    pub newton_iterations: usize,
    /// The body rests, and the run ends, when no node is faster than this.
    pub rest_speed_mm_per_s: f64,
    /// Every how many steps a state is kept for the series; 0: none.
    pub keep_every: usize,
}

impl Default for DynamicsSettings {
    fn default() -> Self {
        Self {
            time_step_s: 0.05,
            steps: 400,
            mass_damping_per_s: 0.1,
            stiffness_damping_s: 0.1,
            mass: MassKind::Lumped,
            newton_iterations: 1,
            rest_speed_mm_per_s: 1e-4,
            keep_every: 0,
        }
    }
}

/// Why a text is not a scenario.
#[derive(Debug, Error)]
#[error("line {line}: {message}; correct the scenario")]
pub struct ScenarioError {
    line: usize,
    message: String,
}

impl Scenario {
    /// Reads SCENARIO.toml.
    ///
    /// # Errors
    /// [`ScenarioError`] with line, key and what was expected.
    pub fn from_toml(text: &str) -> Result<Self, ScenarioError> {
        toml::from_str(text).map_err(|e: toml::de::Error| {
            let message = e.message().trim().replace('\n', " ");
            ScenarioError { line: line_of(&e, text), message }
        })
    }

    /// Node sets held at zero displacement, by `fixed` or by `supports`.
    pub fn held(&self) -> impl Iterator<Item = &String> {
        let supports = self.supports.iter().filter(|(_, support)| **support == Support::Fixed);
        self.fixed.iter().chain(supports.map(|(set, _)| set))
    }

    /// The number of a label name: from `labels`, else as in DSEG files.
    pub fn label_number(&self, name: &str) -> Option<u8> {
        let usual = || LABEL_NAMES.iter().find(|(_, n)| *n == name).map(|(number, _)| *number);
        self.labels.get(name).copied().or_else(usual)
    }

    /// The name of a label number, for messages and for finding its material.
    pub fn label_name(&self, number: u8) -> Option<&str> {
        let own = self.labels.iter().find(|(_, n)| **n == number).map(|(name, _)| name.as_str());
        own.or_else(|| {
            let usual = LABEL_NAMES.iter().find(|(n, _)| *n == number).map(|(_, name)| *name);
            usual.filter(|name| !self.labels.contains_key(*name))
        })
    }
}

/// Labels of DSEG files.
const LABEL_NAMES: [(u8, &str); 7] = [
    (1, "csf"),
    (2, "grey_matter"),
    (3, "white_matter"),
    (4, "ventricle"),
    (5, "resected"),
    (6, "tumour"),
    (7, "oedema"),
];
