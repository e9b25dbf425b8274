//! Everything that decides a mesh.

use super::choice::Engine;
use super::error::EngineError;
use super::process::Limits;
use super::sizing::Sizing;
use crate::mesh::optimise::OptimiseSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How fine the mesh shall be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MeshSize {
    /// About this many tets (within 15 %).
    Cells(usize),
    /// Target edge length in mm.
    EdgeMm(f64),
}

/// The facet set of a mesh with a [`MidplaneSplit`]: the facets of the sheet (and a few mm below it), seen from the right.
pub const MIDSAGITTAL: &str = "midsagittal";

/// Labels that are cut in two by the plane x = 0 of the map's frame, so that tets conform to it: the falx.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MidplaneSplit {
    /// The labels.
    pub labels: Vec<u8>,
    /// The lower edge of the sheet as (y, z) from front to back, mm; empty for the whole plane.
    pub above_yz_mm: Vec<[f64; 2]>,
}

/// Everything that decides a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MeshSettings {
    /// The engine, by its name. The default is part of the program: an answer does not depend on what is installed (`hgm doctor`
    /// tells which others can run).
    #[schemars(with = "String")]
    pub engine: Engine,
    /// How fine.
    pub size: MeshSize,
    /// Where finer and where coarser.
    pub sizing: Sizing,
    /// Labels that are not meshed (they count as outside).
    pub without: Vec<u8>,
    /// A sheet in the plane x = 0 to which the tets conform.
    pub split: Option<MidplaneSplit>,
    /// Whether every cell knows the part of it that each tissue fills by the voxels of the label map (arrays `fraction:` of the VTU).
    /// A simulation then takes the energy of a cell for the sum of its tissues' energies by their parts (Voigt's mean), not for that of one.
    pub partial_volume: bool,
    /// Smoothing of the label indicators, in voxels.
    pub smoothing_voxels: f64,
    /// Parts of the labelled region smaller than this share of the largest are removed; parts of a label smaller than
    /// one target tet take the label around them.
    pub smallest_part: f64,
    /// The quality pass.
    pub optimise: OptimiseSettings,
    /// Time and memory of an engine that is a program.
    pub limits: Limits,
}

impl MeshSettings {
    /// Refuses sizes and limits that no mesh can be made with, before there is anything to mesh.
    ///
    /// # Errors
    /// [`EngineError::Setting`].
    pub fn check(&self) -> Result<(), EngineError> {
        let size = match self.size {
            MeshSize::Cells(cells) => ("size.cells", cells as f64, cells >= 1, "a number of cells, 1 or more"),
            MeshSize::EdgeMm(edge) => ("size.edge_mm", edge, edge > 0.0 && edge.is_finite(), "a target edge above 0"),
        };
        let rules = [
            size,
            ("smoothing_voxels", self.smoothing_voxels, (0.0..=5.0).contains(&self.smoothing_voxels), "0 to 5"),
            ("smallest_part", self.smallest_part, (0.0..1.0).contains(&self.smallest_part), "at least 0 and below 1"),
            (
                "limits.time_s",
                self.limits.time_s,
                self.limits.time_s > 0.0 && self.limits.time_s <= 1e9,
                "seconds above 0",
            ),
            ("limits.memory_mb", self.limits.memory_mb as f64, self.limits.memory_mb >= 1, "1 or more"),
        ];
        match rules.into_iter().find(|(_, _, holds, _)| !holds) {
            None => Ok(()),
            Some((name, value, _, rule)) => Err(EngineError::Setting { name, value, rule }),
        }
    }
}

impl Default for MeshSettings {
    fn default() -> Self {
        Self {
            engine: Engine::LATTICE,
            size: MeshSize::Cells(60_000),
            sizing: Sizing::default(),
            without: Vec::new(),
            split: None,
            partial_volume: false,
            smoothing_voxels: 0.7,
            smallest_part: 0.05,
            optimise: OptimiseSettings::default(),
            limits: Limits::default(),
        }
    }
}
