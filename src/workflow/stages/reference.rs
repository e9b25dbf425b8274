//! Stage `reference`: what is matched. Of a patient the surfaces that the post-operative scan shows, of a phantom the state
//! that known moduli lead to.

use super::anat::Anatomy;
use crate::artefact::{Produced, Stage};
use crate::experiment::observed::{error_at_rest_mm, mask_surface};
use crate::experiment::outcome::SampleOutcome;
use crate::experiment::sweep::{Reference, solve_sample};
use crate::geometry::Mni;
use crate::image::nifti::{self, ReadOptions};
use crate::layout::{POST_BRAIN, PRE_BRAIN, REFERENCE_STATE, REFERENCE_SURFACE, REST_MESH};
use crate::mesh::format::gifti::{self, Space};
use crate::mesh::format::{Field, vtu};
use crate::mesh::{TetMesh, TriMesh};
use crate::segment::label;
use crate::tag::BASE;
use crate::workflow::case::Case;
use crate::workflow::error::{CaseError, WorkflowError};
use crate::workflow::stage_name::StageName;
use crate::workflow::work::{Made, Work, facts};
use std::collections::BTreeMap;

/// Raised when the patient's part changes its result.
const VERSION: u32 = 3;
/// Raised when the phantom's part changes its result.
const PHANTOM_VERSION: u32 = 2;
const NAME: StageName = StageName::Reference;

/// The surfaces of a patient's case by the name of the node set that should lie on them.
pub(crate) fn observed_surfaces(anatomy: &Anatomy) -> BTreeMap<String, TriMesh> {
    BTreeMap::from([
        ("margin".to_owned(), mask_surface(&anatomy.cavity)),
        ("ventricle".to_owned(), mask_surface(&anatomy.post_ventricle)),
    ])
}

/// What mesh and scans are off without any movement, mm: the mesh's sets against the pre-operative masks they follow, and the
/// brain's surface on one scan against the other where the skull's base holds it.
pub(crate) fn error_at_rest(case: &Case, anatomy: &Anatomy, mesh: &TetMesh) -> Result<Option<f64>, WorkflowError> {
    let of_label = |wanted: u8| mask_surface(&anatomy.labels.map(|l| l == wanted));
    let own = BTreeMap::from([
        ("margin".to_owned(), of_label(label::RESECTED)),
        ("ventricle".to_owned(), of_label(label::VENTRICLE)),
    ]);
    let brain = |file: &str| -> Result<TriMesh, WorkflowError> {
        let (mask, _) = nifti::decode_labels(&case.read(file)?, file, &ReadOptions::default())?;
        Ok(mask_surface(&mask.relabelled::<Mni>().map(|l| l > 0)))
    };
    let (before, after) = rayon::join(|| brain(PRE_BRAIN), || brain(POST_BRAIN));
    Ok(error_at_rest_mm(mesh, &own, BASE, [&before?, &after?]))
}

/// The stage of a patient with its input.
pub(crate) fn reference_stage(work: &Work<'_>, made: &Made) -> Stage {
    work.stage(made, &NAME, VERSION, &())
}

/// Writes a patient's surfaces as GIFTI.
pub(crate) fn reference(work: &Work<'_>, made: &mut Made, anatomy: &Anatomy) -> Result<(), WorkflowError> {
    work.run(made, &NAME, &reference_stage(work, made), || {
        let file = |(set, surface): (&String, &TriMesh)| {
            (REFERENCE_SURFACE.of(set), gifti::encode_surface(surface, Space::Mni152, set))
        };
        let surfaces = observed_surfaces(anatomy);
        Ok(Produced { files: surfaces.iter().map(file).collect(), ..Produced::default() })
    })
}

/// The stage of a phantom with its settings.
pub(crate) fn phantom_reference_stage(work: &Work<'_>, made: &Made) -> Stage {
    let settings = &work.settings.phantom;
    work.stage(made, &NAME, PHANTOM_VERSION, &(&settings.scenario(), &settings.reference_sample()))
}

/// Simulates a phantom's reference and writes its state.
pub(crate) fn phantom_reference(work: &Work<'_>, made: &mut Made, mesh: &TetMesh) -> Result<(), WorkflowError> {
    let settings = &work.settings.phantom;
    let (scenario, truth) = (settings.scenario(), settings.reference_sample());
    let stage = phantom_reference_stage(work, made);
    let _: SampleOutcome = work.run(made, &NAME, &stage, || {
        let rest = Reference::Nodes(vec![[0.0; 3]; mesh.nodes_mm().len()]);
        let solved = solve_sample(mesh, &scenario, &settings.tissue_list(), &truth, &rest, &|_| {})
            .map_err(|source| WorkflowError::Sample { table: "phantom", source })?;
        let (outcome, _) = solved.state.map_err(|reason| WorkflowError::NoReferenceState { reason })?;
        let points = [Field::vector("displacement", &outcome.displacement_mm)];
        let files = vec![(REFERENCE_STATE.to_owned(), vtu::encode(mesh, &points, &[])?)];
        Ok(Produced { files, facts: facts(&solved.record), ..Produced::default() })
    })?;
    Ok(())
}

/// The displacement of a phantom's reference, mm, node by node of its mesh.
pub(crate) fn known_state(case: &Case, mesh: &TetMesh) -> Result<Vec<[f64; 3]>, WorkflowError> {
    let state = vtu::decode(&case.read(REFERENCE_STATE)?, REFERENCE_STATE)?;
    let displacement = state.point_field("displacement").and_then(Field::vectors).unwrap_or_default();
    let (found, nodes) = (displacement.len(), mesh.nodes_mm().len());
    if found == nodes {
        return Ok(displacement);
    }
    let folder = case.folder().to_path_buf();
    Err(CaseError::OtherMesh { folder, file: REFERENCE_STATE, mesh: REST_MESH, found, nodes }.into())
}
