//! What holds a patient's brain where nothing sticks: the cut brainstem, the falx, and the skull around it.

pub use super::skull::{SkullFrom, SkullSettings, level_when_drained, levels_when_drained, smooth_distance};

use super::resection::{ResectionSettings, Supports};
use crate::fem::{Contact, FemError, Scenario, Support, Wall};
use crate::geometry::{Frame, SmoothField};
use crate::image::LabelMap;
use crate::mesh::{ClosestPoint, TetMesh, TriMesh};
use crate::tag::{BASE, FALX, MARGIN, VENTRICLE, without_voids};
use std::sync::Arc;
use thiserror::Error;

/// Facet set of the cortex that stands before the skull.
pub const PIAL: &str = "pial";
/// Node set of the cut through the brainstem.
pub const BRAINSTEM: &str = "brainstem";

/// The rest mesh with the sets that slide or hold: [`PIAL`], the cortex before the skull, without ventricle wall, margin,
/// the cut through the brainstem, what lies within the opening and the walls of holes, which stand before no skull; and
/// [`BRAINSTEM`], that cut.
#[must_use]
pub fn with_sliding_sets(mesh: &TetMesh, skull: &SkullSettings) -> TetMesh {
    let mut mesh = mesh.clone();
    let lowest = mesh.nodes_mm().iter().map(|x| x[2]).fold(f64::INFINITY, f64::min);
    let cut = lowest + skull.brainstem_cut_mm;
    let held: Vec<u32> = (0..mesh.nodes_mm().len() as u32).filter(|&n| mesh.nodes_mm()[n as usize][2] <= cut).collect();
    let margin = mesh.facet_sets.get(MARGIN).map_or(&[][..], Vec::as_slice);
    let (margin, _) = TriMesh::from_facets(mesh.nodes_mm(), margin);
    let cavity = ClosestPoint::new(&margin).filter(|_| skull.opening_mm > 0.0);
    let open =
        |n: u32| cavity.as_ref().is_some_and(|c| c.find(mesh.nodes_mm()[n as usize]).distance_mm < skull.opening_mm);
    let mut pial = without_voids(&mesh, &mesh.outside_without(&[VENTRICLE, MARGIN, FALX]));
    pial.retain(|facet| {
        let held = facet.iter().all(|n| held.binary_search(n).is_ok());
        !held && !facet.iter().any(|&n| open(n))
    });
    mesh.facet_sets.insert(PIAL.to_owned(), pial);
    mesh.node_sets.insert(BRAINSTEM.to_owned(), held);
    mesh
}

/// Why a patient's supports cannot be posed.
#[derive(Debug, Error)]
pub enum SupportsError {
    /// No distance to the skull.
    #[error(
        "the labels show no inside of a skull on a grid along the axes: look at the segmentation, or take \
         `supports = \"sliding\"` away"
    )]
    NoSkull,
    /// No fluid to drain.
    #[error(
        "the labels show no cerebrospinal fluid whose level could fall: take the table [resection.csf] away, and \
         `fluid` of [estimate]"
    )]
    NoFluid,
    /// A set that cannot be cut along.
    #[error(transparent)]
    Fem(#[from] FemError),
}

impl ResectionSettings {
    /// Whether [`Self::supported`] looks at the labels.
    pub fn needs_labels(&self) -> bool {
        self.supports == Supports::Sliding || self.csf.is_some()
    }

    /// What else holds the brain, to follow a list of what is held.
    pub fn supports_in_words(&self) -> String {
        if self.supports != Supports::Sliding {
            return String::new();
        }
        let from = match self.skull.from {
            SkullFrom::Cortex => "from the cortex",
            SkullFrom::Scan => "outside the fluid that the scan shows",
        };
        let along = if self.falx == Support::Sliding { " and along the falx" } else { "" };
        format!(", sliding on a skull {} mm {from}{along}", self.skull.gap_mm)
    }

    /// The scenario with supports and fluid as these settings have them, by the labels of the pre-operative scan in the
    /// frame of the mesh.
    ///
    /// # Errors
    /// [`SupportsError`] when the labels show no skull or no fluid.
    pub fn supported<F: Frame>(&self, scenario: &Scenario, labels: &LabelMap<F>) -> Result<Scenario, SupportsError> {
        let mut scenario = scenario.clone();
        if let Some(csf) = &self.csf {
            let level = csf.level(labels, scenario.loads.gravity_m_per_s2);
            scenario.loads.csf = Some(level.ok_or(SupportsError::NoFluid)?);
        }
        if self.supports != Supports::Sliding {
            return Ok(scenario);
        }
        let skull = self.skull.distance(labels).ok_or(SupportsError::NoSkull)?;
        Ok(self.sliding(&scenario, &Arc::new(skull)))
    }

    /// The rest mesh as that scenario needs it: with the sets that slide, cut open along a falx that slides.
    ///
    /// # Errors
    /// [`SupportsError::Fem`] when the falx of this mesh is no sheet.
    pub fn supported_mesh(&self, mesh: TetMesh, scenario: &Scenario) -> Result<TetMesh, SupportsError> {
        if self.supports != Supports::Sliding {
            return Ok(mesh);
        }
        Ok(scenario.body(&with_sliding_sets(&mesh, &self.skull))?.into_owned())
    }

    /// The scenario of a brain that slides on the skull instead of being held at the base: for the mesh of
    /// [`with_sliding_sets`].
    #[must_use]
    pub fn sliding(&self, scenario: &Scenario, skull: &Arc<SmoothField>) -> Scenario {
        let mut sliding = scenario.clone();
        sliding.fixed.retain(|set| set != BASE && (set != FALX || self.falx == Support::Fixed));
        sliding.fixed.push(BRAINSTEM.to_owned());
        if self.falx == Support::Sliding {
            sliding.supports.insert(FALX.to_owned(), Support::Sliding);
        }
        let even = self.skull.from == SkullFrom::Cortex;
        let wall = Wall::Field { name: "skull".to_owned(), even, distance_mm: Some(Arc::clone(skull)) };
        sliding.contact.push(Contact::new(PIAL, wall, self.skull.gap_mm));
        sliding
    }
}
