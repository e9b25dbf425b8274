//! The sag as mechanics: finite elements under gravity with known materials.
//!
//! The mesh has its own size and the element averages the volume change over nodes, so that an estimate made with another
//! mesh and the plain element does not meet its own discretisation errors in the truth.

use super::field::Field;
use super::resection::Resection;
use super::sag::{gravity, grid};
use super::settings::{SynthError, SynthSettings};
use super::{Patient, in_template};
use crate::fem::{ElementKind, Loads, Scenario, SolverSettings, simulate};
use crate::image::gaussian::gaussian;
use crate::image::{LabelMap, Volume};
use crate::material::law::Material;
use crate::mesh::TetMesh;
use crate::mesh::engine::{EnginePrograms, MeshSettings, MeshSize, mesh_labels};
use crate::segment::label;
use crate::tag::{BASE, FALX, TagSettings, tag_boundary_sets_with};
use nalgebra::{Matrix3, Point3, Vector3};

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
        solver: SolverSettings { element: ElementKind::Tet4Nodal, ..SolverSettings::default() },
        ..Scenario::default()
    };
    let outcome = simulate(&tissue, &scenario, &|_| ()).map_err(|e| failed(e.to_string()))?;
    Ok(spread(&tissue, &outcome.displacement_mm))
}

/// The nodes' displacement on the grid of sags: interpolated inside the tetrahedra, continued smoothly around them.
fn spread(mesh: &TetMesh, displacement_mm: &[[f64; 3]]) -> Field {
    let grid = grid();
    let mut inside = vec![None; grid.len()];
    for tet in mesh.tets() {
        let x = tet.map(|n| Vector3::from(mesh.nodes_mm()[n as usize]));
        let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
        // Valid meshes hold no flat tetrahedron.
        let Some(barycentric) = edges.try_inverse() else { continue };
        let v = x.map(|x| grid.voxel_from_mm().transform_point(&Point3::from(x)));
        let range = [0, 1, 2].map(|a| {
            let low = v.iter().map(|p| p[a]).fold(f64::INFINITY, f64::min).ceil().max(0.0);
            let high = v.iter().map(|p| p[a]).fold(f64::NEG_INFINITY, f64::max).floor();
            low as usize..((high + 1.0).max(0.0) as usize).min(grid.dims[a])
        });
        for k in range[2].clone() {
            for j in range[1].clone() {
                for i in range[0].clone() {
                    let p = grid.position(Point3::new(i as f64, j as f64, k as f64)).mm;
                    let b = barycentric * (p.coords - x[0]);
                    let weight = [1.0 - b.sum(), b.x, b.y, b.z];
                    if weight.iter().all(|&w| w >= -1e-9) {
                        let parts = tet.iter().zip(weight);
                        let sum = parts.map(|(&n, w)| w * Vector3::from(displacement_mm[n as usize]));
                        inside[grid.index(i, j, k)] = Some(sum.fold(Vector3::zeros(), |a, b| a + b));
                    }
                }
            }
        }
    }
    // Around the tissue: means weighted by Gaussians of growing width, the narrowest that reaches tissue counting most.
    let weight = Volume::from_data(grid, inside.iter().map(|d| f32::from(d.is_some())).collect());
    let part = |a: usize| {
        Volume::from_data(grid, inside.iter().map(|d: &Option<Vector3<f64>>| d.map_or(0.0, |d| d[a] as f32)).collect())
    };
    let parts = [part(0), part(1), part(2)];
    let mut sums = vec![([0f64; 3], 0f64); grid.len()];
    for (sigma_mm, trust) in [(3.0, 1.0), (6.0, 1e-3), (12.0, 1e-6), (24.0, 1e-9)] {
        let smooth = parts.each_ref().map(|part| gaussian(part, sigma_mm));
        let total = gaussian(&weight, sigma_mm);
        for (n, (sum, weights)) in sums.iter_mut().enumerate() {
            for a in 0..3 {
                sum[a] += trust * f64::from(smooth[a].data[n]);
            }
            *weights += trust * f64::from(total.data[n]);
        }
    }
    let value = |p: Point3<f64>| {
        let v = grid.voxel_at(crate::geometry::Position::from_point(p)).map(|x| x.round() as usize);
        let n = grid.index(v.x, v.y, v.z);
        let (sum, weights) = sums[n];
        inside[n].unwrap_or_else(|| Vector3::from(sum) / weights.max(1e-30))
    };
    Field::sampled(grid, value)
}
