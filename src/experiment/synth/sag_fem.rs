//! The sag as mechanics: finite elements under gravity with known materials.
//!
//! The mesh has its own size (`cells`), so that an estimate made with another mesh does not meet its own discretisation errors in
//! the truth; body, falx and element follow the same rules as a patient's, so that what is told is how well images give them.

use super::field::Field;
use super::frame::Patient;
use super::resection::Resection;
use super::sag::{gravity, grid};
use super::settings::{SynthError, SynthSettings};
use crate::experiment::nodal_field::on_grid;
use crate::experiment::prior::{PriorSettings, held_material};
use crate::experiment::resection::ResectionSettings;
use crate::experiment::supports::{SkullSettings, with_sliding_sets};
use crate::fem::{ElementKind, Loads, Scenario, SolverSettings, Support, simulate};
use crate::geometry::{Mni, Position};
use crate::image::LabelMap;
use crate::material::law::Material;
use crate::mesh::engine::{EnginePrograms, MeshSettings, MeshSize, mesh_labels};
use crate::segment::{SULCUS_MM, label, with_closed_sulci};
use crate::tag::{BASE, FALX, Midline, TagSettings, falx_sheet, tag_boundary_sets_with, with_closed_fissure};
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Standard gravity.
const GRAVITY_M_PER_S2: f64 = 9.80665;

/// The displacement of the brain after the resection, held at the falx and as the settings say at the skull.
pub fn by_finite_elements(
    labels: &LabelMap<Patient>,
    template: impl Fn(Point3<f64>) -> Position<Mni> + Sync,
    resection: &Resection,
    settings: &SynthSettings,
) -> Result<Field, SynthError> {
    let failed = |what: String| SynthError::Sag(what);
    // Ventricle and resected tissue keep labels of their own, so that their walls are meshed smoothly, and are then left out.
    let mut map = with_closed_sulci(labels, SULCUS_MM);
    resection.label(&mut map, label::RESECTED);
    let mesh_settings =
        MeshSettings { size: MeshSize::Cells(settings.cells), split: Some(falx_sheet()), ..MeshSettings::default() };
    let template = |p: [f64; 3]| <[f64; 3]>::from(template(Point3::from(p)).mm);
    let midline = Midline::of(template);
    let straight = with_closed_fissure(&midline.straightened(&map), |p| template(midline.bent(p)));
    let (mut mesh, _) =
        mesh_labels(&straight, &mesh_settings, &EnginePrograms::default()).map_err(|e| failed(e.to_string()))?;
    let tags = tag_boundary_sets_with(&mut mesh, &TagSettings::default(), |p| template(midline.bent(p)))
        .map_err(|e| failed(e.to_string()))?;
    // What holds the truth is to be believed as what holds a patient is.
    if let Some(warning) = tags.warnings.first() {
        return Err(failed(warning.to_string()));
    }
    let mesh = mesh.moved(|p| midline.bent(p)).map_err(|e| failed(e.to_string()))?;
    let (tissue, _) = mesh
        .restricted(label::is_tissue)
        .and_then(|(tissue, _)| tissue.largest_face_connected_part())
        .ok_or_else(|| failed("no tissue is left".to_owned()))?;
    let skull = SkullSettings { gap_mm: settings.room_mm, ..SkullSettings::default() };
    let mut scenario = Scenario {
        fixed: vec![BASE.to_owned(), FALX.to_owned()],
        materials: materials(tissue.labels(), settings)?,
        loads: Loads {
            gravity_m_per_s2: (gravity(settings.seed) * GRAVITY_M_PER_S2).into(),
            density_kg_per_m3: settings.effective_density_kg_per_m3,
            ..Loads::default()
        },
        solver: SolverSettings { element: ElementKind::TET4_NODAL, ..SolverSettings::default() },
        ..Scenario::default()
    };
    let mut body = tissue;
    if settings.supports == Support::Sliding {
        let inside = skull.distance(labels).ok_or_else(|| failed("the labels show no inside of a skull".to_owned()))?;
        body = with_sliding_sets(&body, &skull);
        scenario = ResectionSettings { skull, ..ResectionSettings::default() }.sliding(&scenario, &Arc::new(inside));
    }
    let outcome = simulate(&body, &scenario, &|_| ()).map_err(|e| failed(e.to_string()))?;
    let volume = on_grid(body.tets(), body.nodes_mm(), &outcome.displacement_mm, &grid());
    Ok(Field::of(volume))
}

/// What the tissues of these labels are made of. A lesion is held at the mean of its prior, as a patient's is: the settings say
/// nothing of it.
fn materials(labels: &[u8], settings: &SynthSettings) -> Result<BTreeMap<String, Material>, SynthError> {
    let known = [("grey_matter", settings.grey_pa), ("white_matter", settings.white_pa)];
    let mut materials: BTreeMap<String, Material> =
        known.map(|(name, pa)| (name.to_owned(), Material::neo_hookean(pa, settings.poisson_ratio))).into();
    let lesions = [label::TUMOUR, label::OEDEMA].into_iter().filter(|lesion| labels.contains(lesion));
    for name in lesions.filter_map(label::name) {
        let held = held_material(name, settings.poisson_ratio, &PriorSettings::default());
        materials.insert(name.to_owned(), held.map_err(|e| SynthError::Sag(e.to_string()))?.material);
    }
    Ok(materials)
}

#[cfg(test)]
mod tests {
    use super::materials;
    use crate::anatomy::label;
    use crate::experiment::synth::{SagKind, SynthSettings, synthesize};
    use crate::fem::Support;
    use crate::geometry::Position;
    use crate::image::distance::signed_distance_mm;
    use nalgebra::Vector3;

    #[test]
    fn every_tissue_of_a_head_with_a_lesion_has_a_material() {
        let settings = SynthSettings::default();
        let labels: Vec<u8> = (0..=u8::MAX).filter(|l| label::is_tissue(*l)).collect();
        let found = materials(&labels, &settings).unwrap();
        assert!(labels.iter().all(|l| found.contains_key(label::name(*l).unwrap())), "{found:?}");
        assert_eq!(materials(&[label::GREY_MATTER], &settings).unwrap().len(), 2, "no lesion, no material of one");
    }

    #[test]
    fn slow_a_brain_that_slides_moves_where_one_that_is_held_does_not_and_stays_in_its_skull() {
        let of = |supports| {
            let settings = SynthSettings {
                sag: SagKind::Fem,
                spacing_mm: 3.0,
                post_slice_mm: 3.0,
                supports,
                ..Default::default()
            };
            synthesize(&settings).unwrap()
        };
        let (held, sliding) = (of(Support::Fixed), of(Support::Sliding));
        assert_eq!(held.brain_pre.data, sliding.brain_pre.data, "the same head");
        let (brain, grid) = (&held.brain_pre, held.brain_pre.grid);
        let outside_mm = signed_distance_mm(brain);
        let place = |n: usize| grid.centre(grid.voxel(n));
        let moved = |u: [f32; 3]| f64::from(u[0].hypot(u[1]).hypot(u[2]));
        // The cortex that is far from where anything was taken out.
        let taken = signed_distance_mm(&held.resected_pre);
        let far: Vec<usize> =
            (0..grid.len()).filter(|&n| brain.data[n] && outside_mm.data[n] > -5.0 && taken.data[n] > 30.0).collect();
        let still = |patient: &super::super::SyntheticPatient| {
            let few = far.iter().filter(|&&n| moved(patient.displacement_pre.data[n]) < 0.1).count();
            few as f64 / far.len() as f64
        };
        assert!(still(&held) > 2.0 * still(&sliding), "{} {}", still(&held), still(&sliding));
        let beyond = |n: usize| {
            let u = Vector3::from(sliding.displacement_pre.data[n].map(f64::from));
            outside_mm.trilinear(Position::from_point(place(n).mm + u)).map_or(0.0, f64::from)
        };
        let deepest = (0..grid.len()).filter(|&n| brain.data[n]).map(beyond).fold(0.0, f64::max);
        // The room of a millimetre, and half a voxel's diagonal of what the masks know.
        assert!(deepest < 1.0 + 2.6, "{deepest} mm");
    }
}
