//! Stage `mesh`: label map to undeformed mesh with its boundary sets.

use super::anat::Anatomy;
use super::earlier::Earlier;
use crate::artefact::{Produced, Stage};
use crate::experiment::outcome::{MeshOutcome, SetOutcome};
use crate::geometry::{Frame, Mni, Position};
use crate::image::LabelMap;
use crate::layout::{PRE_LABELS, REST_GMSH, REST_MESH, REST_SURFACE};
use crate::mesh::engine::{EngineError, MeshSettings, MeshSize, MeshingRecord, mesh_labels};
use crate::mesh::format::gifti::{self, Space};
use crate::mesh::format::{WriteError, msh, vtu};
use crate::mesh::quality::{fidelity, shape_quality, surface_distance};
use crate::mesh::{TetMesh, TriMesh};
use crate::register::deformable::DisplacementField;
use crate::segment::{SULCUS_MM, closed_sulci, label, with_closed_sulci};
use crate::tag::{Midline, TagReport, falx_sheet, tag_boundary_sets_with, with_closed_fissure};
use crate::workflow::case::Case;
use crate::workflow::error::WorkflowError;
use crate::workflow::facts::MeshFacts;
use crate::workflow::lost_label::{LostLabel, lost_labels};
use crate::workflow::settings::Settings;
use crate::workflow::stage_name::{StageName, Subject};
use crate::workflow::warning::Warning;
use crate::workflow::work::{Made, Work, facts};
use std::collections::BTreeMap;

/// Raised when the stage's code changes its result.
const VERSION: u32 = 12;
const NAME: StageName = StageName::Mesh;
/// A part that lay apart is worth a warning from half a cubic centimetre on, and so is a label that is lost; smaller ones are specks
/// of noise.
pub(crate) const LARGE_ISLAND_MM3: f64 = 500.0;
/// Tissue that is cut off and is more than this is a part of the brain that a simulation must not do without, mm3.
const LARGEST_CUT_OFF_MM3: f64 = 10_000.0;
/// Fewer tetrahedra than these are the mesh's own roughness, not a part of the brain.
const FEWEST_CUT_OFF: f64 = 4.0;

/// The stage, and the settings of the mesh: fluid is left out, the tets conform to the falx.
pub(crate) fn mesh_stage(work: &Work<'_>, made: &Made) -> (Stage, MeshSettings) {
    mesh_stage_of((&work.case, work.subject), work.settings, made)
}

/// The same of any case.
pub(crate) fn mesh_stage_of(of: (&Case, Subject), all: &Settings, made: &Made) -> (Stage, MeshSettings) {
    let tag = &all.tag;
    let mut settings = MeshSettings { without: vec![label::CSF], ..all.mesh.clone() };
    if tag.falx && settings.split.is_none() {
        settings.split = Some(falx_sheet());
    }
    let both = serde_json::json!({ "mesh": settings, "tag": tag });
    (made.stage(of, &NAME, VERSION, &both).frame(Mni::NAME), settings)
}

/// Meshes a label map (grey, white, ventricle, resected), tags the sets, leaves only the tissue, writes the undeformed mesh.
/// `template_from_labels` carries the landmarks of the template onto a patient; without it they are taken where they are. The
/// mesh of an earlier prediction is taken where it was made of the same labels.
pub(crate) fn mesh(
    work: &Work<'_>,
    made: &mut Made,
    labels: &LabelMap<Mni>,
    template_from_labels: Option<&DisplacementField<Mni>>,
    earlier: Option<&Earlier>,
) -> Result<MeshFacts, WorkflowError> {
    let (stage, settings) = mesh_stage(work, made);
    work.run(made, &NAME, &stage, || {
        if let Some(mesh) = earlier.map(|earlier| earlier.mesh(labels)).transpose()?.flatten() {
            work.tell(|p| p.noted("the mesh is the prediction's: what was taken is what was planned, voxel for voxel"));
            return Ok(mesh);
        }
        let (body, holes_mm3) = closed_sulci(labels, SULCUS_MM);
        let Tagged { rest, whole, record, tags, lost, mut cut_off_mm3 } =
            tagged(work, &body, &settings, template_from_labels)?;
        // Of a part that was cut off a set has nothing.
        let tags = tags.of_part(&rest, &work.settings.tag);
        let mut produced = Produced::default();
        produced.files.extend(meshes(&rest)?);
        for (set, facets) in &rest.facet_sets {
            let (surface, _) = TriMesh::from_facets(rest.nodes_mm(), facets);
            produced.files.push((REST_SURFACE.of(set), gifti::encode_surface(&surface, Space::Mni152, set)));
        }
        // Tissue that lay apart in the labels is as much cut off as what the mesh has and holds by no face, and is told with it.
        let apart = || record.islands.iter().filter(|island| island.became == label::BACKGROUND);
        for island in apart().filter(|island| label::is_tissue(island.label)) {
            *cut_off_mm3.entry(island.label).or_insert(0.0) += island.volume_mm3;
        }
        let large = apart().filter(|i| !label::is_tissue(i.label) && i.volume_mm3 > LARGE_ISLAND_MM3);
        produced.warn(large.map(|island| {
            let tissue = label::name(island.label).unwrap_or("unknown");
            Warning::Island { tissue, volume_mm3: island.volume_mm3 }
        }));
        let mean_mm3 = volumes_mm3(&rest).values().sum::<f64>() / rest.tets().len() as f64;
        let cut_off = cut_off(&cut_off_mm3, mean_mm3);
        if holes_mm3 > 0.0 {
            produced.warn([Warning::EnclosedFluid { cc: holes_mm3 / 1000.0 }]);
        }
        produced.warn(cut_off.as_ref().map(|(warning, _)| warning));
        produced.warn(&lost);
        produced.warn(&tags.warnings);
        let gated = |lost: &&LostLabel| lost.label == label::VENTRICLE;
        let implausible = tags.warnings.iter().map(ToString::to_string);
        let implausible = implausible.chain(lost.iter().filter(gated).map(ToString::to_string));
        let much = cut_off.iter().filter(|(_, much)| *much).map(|(warning, _)| warning.to_string());
        let sets = tags.sets.iter().map(|set| SetOutcome {
            name: set.name.clone(),
            nodes: set.nodes,
            area_mm2: Some(set.area_mm2),
            centroid_mm: Some(set.centroid_mm),
        });
        let facts_of_mesh = MeshFacts {
            mesh: mesh_outcome(&rest, &whole, &body, &settings),
            sets: sets.collect(),
            implausible: implausible.chain(much).collect(),
        };
        produced.facts = facts(&facts_of_mesh);
        Ok(produced)
    })
}

/// The mesh in every format that can hold it: MSH has no place for what lies within the cells, and the same scenario would have another
/// answer there.
fn meshes(rest: &TetMesh) -> Result<Vec<(String, Vec<u8>)>, WriteError> {
    let mut files = vec![(REST_MESH.to_owned(), vtu::encode(rest, &[], &[])?)];
    if rest.fractions().is_empty() {
        files.push((REST_GMSH.to_owned(), msh::encode(rest)?));
    }
    Ok(files)
}

/// A mesh with its sets, whole and without what is no tissue.
struct Tagged {
    rest: TetMesh,
    whole: TetMesh,
    record: MeshingRecord,
    tags: TagReport,
    /// Labels of which `whole` has nothing.
    lost: Vec<LostLabel>,
    /// Tissue of `whole` that hangs on the rest by no face and is not in it, by label.
    cut_off_mm3: BTreeMap<u8, f64>,
}

/// What is cut off in a sentence, from half a cubic centimetre and a few tetrahedra of `mean_mm3` on, and whether it is too much to do
/// without.
fn cut_off(mm3: &BTreeMap<u8, f64>, mean_mm3: f64) -> Option<(Warning, bool)> {
    let all_mm3: f64 = mm3.values().sum();
    let part = |(l, mm3): (&u8, &f64)| format!("{:.1} of {}", mm3 / 1000.0, label::name(*l).unwrap_or("unknown"));
    let parts: Vec<String> = mm3.iter().map(part).collect();
    let warning = Warning::CutOff { cc: all_mm3 / 1000.0, parts: parts.join(", ") };
    (all_mm3 >= LARGE_ISLAND_MM3.max(FEWEST_CUT_OFF * mean_mm3)).then_some((warning, all_mm3 > LARGEST_CUT_OFF_MM3))
}

/// Volume of every label, mm3.
fn volumes_mm3(mesh: &TetMesh) -> BTreeMap<u8, f64> {
    let mut volumes = BTreeMap::new();
    for (t, &l) in mesh.labels().iter().enumerate() {
        *volumes.entry(l).or_insert(0.0) += mesh.volume_mm3(t);
    }
    volumes
}

/// What a part of a mesh has less than the whole, by label; less than this is rounding, mm3.
fn missing_mm3(whole: &TetMesh, part: &TetMesh) -> BTreeMap<u8, f64> {
    const ROUNDING_MM3: f64 = 1e-3;
    let (mut missing, kept) = (volumes_mm3(whole), volumes_mm3(part));
    for (l, mm3) in &mut missing {
        *mm3 -= kept.get(l).unwrap_or(&0.0);
    }
    missing.retain(|_, mm3| *mm3 > ROUNDING_MM3);
    missing
}

/// Meshes labels whose sulci are closed, and tags the sets.
fn tagged(
    work: &Work<'_>,
    body: &LabelMap<Mni>,
    settings: &MeshSettings,
    template_from_labels: Option<&DisplacementField<Mni>>,
) -> Result<Tagged, WorkflowError> {
    let labels = template_from_labels.map_or("the template's labels", |_| PRE_LABELS);
    let in_template = |p: [f64; 3]| match template_from_labels {
        Some(field) => field.apply(Position::new(p[0], p[1], p[2])).mm.into(),
        None => p,
    };
    // The falx is a sheet in the plane x = 0 of a brain whose midline has been made straight.
    let midline = template_from_labels.filter(|_| settings.split.is_some()).map(|_| Midline::of(in_template));
    let bent = |p: [f64; 3]| midline.as_ref().map_or(p, |midline| midline.bent(p));
    let straight =
        midline.as_ref().map(|midline| with_closed_fissure(&midline.straightened(body), |p| in_template(bent(p))));
    let failed = |source| WorkflowError::Engine { labels: labels.to_owned(), source };
    let meshed = mesh_labels(straight.as_ref().unwrap_or(body), settings, &work.place.programs.engines());
    let (mut whole, record) = meshed.map_err(failed)?;
    let lost = lost_labels(body, &whole, &settings.without, record.edge_mm);
    if let Some(lost) = lost.iter().find(|lost| lost.label == label::RESECTED) {
        // Nothing would be taken out, and a whole brain pass for the operated one.
        return Err(WorkflowError::Lost { labels, lost: lost.clone() });
    }
    let tags = tag_boundary_sets_with(&mut whole, &work.settings.tag, |p| in_template(bent(p)))?;
    let engine = record.engine.name();
    let whole = whole.moved(bent).map_err(|source| failed(EngineError::Invalid { engine, source }))?;
    let none = || WorkflowError::NoTissue { labels };
    let (tissue, _) = whole.restricted(label::is_tissue).ok_or_else(none)?;
    let (rest, _) = tissue.largest_face_connected_part().ok_or_else(none)?;
    let cut_off_mm3 = missing_mm3(&tissue, &rest);
    Ok(Tagged { rest, whole, record, tags, lost, cut_off_mm3 })
}

/// The same body in a quarter of the tetrahedra: what a mesh does to an estimate shows in the difference. `None` where what was
/// resected is too small for those cells: the difference would be that of a brain that nothing was taken from.
pub(crate) fn coarser_mesh(work: &Work<'_>, made: &Made, anatomy: &Anatomy) -> Result<Option<TetMesh>, WorkflowError> {
    const PART: usize = 4;
    let (_, mut settings) = mesh_stage(work, made);
    settings.size = match settings.size {
        MeshSize::Cells(cells) => MeshSize::Cells((cells / PART).max(1000)),
        MeshSize::EdgeMm(edge_mm) => MeshSize::EdgeMm(edge_mm * (PART as f64).cbrt()),
    };
    let body = with_closed_sulci(&anatomy.labels, SULCUS_MM);
    match tagged(work, &body, &settings, Some(&anatomy.template_from_patient)) {
        Err(WorkflowError::Lost { .. }) => Ok(None),
        made => Ok(Some(made?.rest)),
    }
}

/// The same body with the resected tissue still in it, under a label of its own: what an operation can be undone on.
pub(crate) fn mesh_before_resection(work: &Work<'_>, anatomy: &Anatomy) -> Result<TetMesh, WorkflowError> {
    let (_, settings) = mesh_stage(work, &Made::default());
    let body = with_closed_sulci(&anatomy.labels, SULCUS_MM);
    let Tagged { whole, .. } = tagged(work, &body, &settings, Some(&anatomy.template_from_patient))?;
    let before = whole.restricted(|l| label::is_tissue(l) || l == label::RESECTED);
    let connected = before.and_then(|(mesh, _)| mesh.largest_face_connected_part());
    Ok(connected.ok_or(WorkflowError::NoTissue { labels: PRE_LABELS })?.0)
}

/// Size and shape of what is simulated, and how well the `whole` mesh it was cut from fills its label map.
pub fn mesh_outcome<F: Frame>(
    mesh: &TetMesh,
    whole: &TetMesh,
    map: &LabelMap<F>,
    settings: &MeshSettings,
) -> MeshOutcome {
    let named = |l: u8| label::name(l).map_or_else(|| l.to_string(), str::to_owned);
    let mut volume_cc = BTreeMap::new();
    for (t, &l) in mesh.labels().iter().enumerate() {
        *volume_cc.entry(named(l)).or_insert(0.0) += mesh.volume_mm3(t) / 1000.0;
    }
    let shape = shape_quality(mesh);
    let fit = fidelity(whole, map, &settings.without);
    let border = surface_distance(whole, map, &settings.without);
    MeshOutcome {
        engine: settings.engine.name().to_owned(),
        nodes: mesh.nodes_mm().len(),
        tets: mesh.tets().len(),
        volume_cc,
        dihedral_min_deg: Some(shape.dihedral_min_deg),
        dihedral_percentile_1_deg: Some(shape.dihedral_percentile_1_deg),
        dihedral_below_10_percent: Some(shape.dihedral_below_10_percent),
        dihedral_counts: shape.dihedral_counts,
        radius_ratio_min: Some(shape.radius_ratio_min),
        radius_ratio_mean: Some(shape.radius_ratio_mean),
        scaled_jacobian_min: Some(shape.scaled_jacobian_min),
        volume_error_percent: fit.labels.iter().map(|l| (named(l.label), l.volume_error_percent)).collect(),
        dice: fit.labels.iter().map(|l| (named(l.label), l.dice)).collect(),
        surface_distance_mean_mm: border.map(|d| d.mean_mm),
        surface_distance_95_mm: border.map(|d| d.percentile_95_mm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Fractions;

    #[test]
    fn a_mesh_whose_cells_hold_several_tissues_is_written_only_where_the_format_keeps_them() {
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![label::GREY_MATTER]).unwrap();
        let names = |mesh: &TetMesh| meshes(mesh).unwrap().into_iter().map(|file| file.0).collect::<Vec<_>>();
        assert_eq!(names(&mesh), [REST_MESH, REST_GMSH]);
        let halves = [(label::GREY_MATTER, vec![0.5]), (label::WHITE_MATTER, vec![0.5])];
        mesh.set_fractions(Fractions::from(halves)).unwrap();
        assert_eq!(names(&mesh), [REST_MESH]);
    }

    #[test]
    fn tissue_that_hangs_on_nothing_is_told_from_half_a_cc_and_refused_from_ten() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
        let missing = |size: f64| {
            let far = corners[..4].iter().map(|p| [100.0 + size * p[0], size * p[1], size * p[2]]);
            let nodes = corners.iter().copied().chain(far).collect();
            let labels = vec![label::GREY_MATTER, label::WHITE_MATTER, label::WHITE_MATTER];
            let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4], [5, 6, 7, 8]], labels).unwrap();
            missing_mm3(&mesh, &mesh.largest_face_connected_part().unwrap().0)
        };
        let apart = |size: f64| cut_off(&missing(size), 10.0);
        // A corner of a cube holds a sixth of it.
        let size_of = |cc: f64| (6000.0 * cc).cbrt();
        assert_eq!(apart(size_of(0.4)), None);
        let (warning, much) = apart(size_of(0.6)).unwrap();
        assert!(!much && warning.to_string().contains("0.6 cc of tissue (0.6 of white_matter)"), "{warning}");
        assert!(apart(size_of(11.0)).unwrap().1);
        // Of tetrahedra of half a cubic centimetre it is one.
        assert_eq!(cut_off(&missing(size_of(0.6)), 500.0), None);
    }
}
