//! The sag as mechanics: finite elements under gravity with known materials.
//!
//! The mesh has its own size and the element averages the volume change over nodes, so that an estimate made with another
//! mesh and the plain element does not meet its own discretisation errors in the truth.

use super::field::{Field, in_template};
use super::frame::Patient;
use super::resection::Resection;
use super::sag::{gravity, grid};
use super::settings::{SynthError, SynthSettings};
use crate::experiment::nodal_field::on_grid;
use crate::fem::{ElementKind, Loads, Scenario, SolverSettings, simulate};
use crate::image::LabelMap;
use crate::material::law::Material;
use crate::mesh::engine::{EnginePrograms, MeshSettings, MeshSize, mesh_labels};
use crate::segment::label;
use crate::tag::{BASE, FALX, TagSettings, tag_boundary_sets_with};
use nalgebra::Point3;

/// Standard gravity.
const GRAVITY_M_PER_S2: f64 = 9.80665;
/// Tetrahedra of the truth's mesh: neither the default of `hgm mesh` nor a multiple of it.
const CELLS: usize = 85_000;

/// The displacement of the brain after the resection, held at the skull base and the falx.
pub fn by_finite_elements(
    labels: &LabelMap<Patient>,
    anatomy: &Field,
    resection: &Resection,
    settings: &SynthSettings,
) -> Result<Field, SynthError> {
    let failed = |what: String| SynthError::Sag(what);
    // Fluid between gyri moves with them: as grey matter it makes the brain one body. Ventricle and resected tissue
    // keep labels of their own, so that their walls are meshed smoothly, and are then left out.
    let mut map = labels.clone();
    for (label, &wall_mm) in map.data.iter_mut().zip(&resection.wall_mm.data) {
        *label = match *label {
            label::BACKGROUND => label::BACKGROUND,
            label::VENTRICLE => label::VENTRICLE,
            _ if wall_mm < 0.0 => label::RESECTED,
            label::CSF => label::GREY_MATTER,
            tissue => tissue,
        };
    }
    let mesh_settings = MeshSettings { size: MeshSize::Cells(CELLS), ..MeshSettings::default() };
    let (mut mesh, _) =
        mesh_labels(&map, &mesh_settings, &EnginePrograms::default()).map_err(|e| failed(e.to_string()))?;
    let template = |p: [f64; 3]| <[f64; 3]>::from(in_template(anatomy, Point3::from(p)).mm);
    tag_boundary_sets_with(&mut mesh, &TagSettings::default(), template).map_err(|e| failed(e.to_string()))?;
    let (tissue, _) = mesh
        .restricted(|l| l == label::GREY_MATTER || l == label::WHITE_MATTER)
        .ok_or_else(|| failed("no tissue is left".to_owned()))?;
    let material = |pa| Material::neo_hookean(pa, settings.poisson_ratio);
    let scenario = Scenario {
        fixed: vec![BASE.to_owned(), FALX.to_owned()],
        materials: [("grey_matter", settings.grey_pa), ("white_matter", settings.white_pa)]
            .map(|(name, pa)| (name.to_owned(), material(pa)))
            .into(),
        loads: Loads {
            gravity_m_per_s2: (gravity(settings.seed) * GRAVITY_M_PER_S2).into(),
            density_kg_per_m3: settings.effective_density_kg_per_m3,
            ..Loads::default()
        },
        solver: SolverSettings { element: ElementKind::TET4_NODAL, ..SolverSettings::default() },
        ..Scenario::default()
    };
    let outcome = simulate(&tissue, &scenario, &|_| ()).map_err(|e| failed(e.to_string()))?;
    let volume = on_grid(tissue.tets(), tissue.nodes_mm(), &outcome.displacement_mm, &grid());
    Ok(Field::of(volume))
}
