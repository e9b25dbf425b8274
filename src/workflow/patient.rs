//! A patient's case: from two scans to the mesh, and from there to samples or an estimate.

use super::case::{Case, CaseError};
use super::error::WorkflowError;
use super::inputs::{Inputs, OwnMasks, Scans};
use super::outcome::{finish, with_estimate};
use super::plan::{self, StageName, Subject};
use super::stages::{
    self, AnatFacts, Anatomy, EstimateFacts, EstimateInput, MeshFacts, RegistrationFacts, SampleMode, SeenShift, Sweep,
};
use super::work::{Made, Work};
use crate::artefact::Manifest;
use crate::experiment::compare::Comparison;
use crate::experiment::observed::ObservedSurfaces;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome, NoiseFloor, SampleOutcome};
use crate::experiment::sample::shard;
use crate::experiment::sweep::{Reference, best_sample};
use crate::fem::Scenario;
use crate::layout::REST_MESH;
use crate::mesh::TetMesh;
use crate::mesh::format::vtu;

/// A part of a sweep's samples (see [`shard`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 1.
    pub number: usize,
    /// Of how many.
    pub of: usize,
}

/// The stages of images, with their figures.
pub(crate) struct Images {
    pub made: Made,
    registration: RegistrationFacts,
    anat: AnatFacts,
}

impl Images {
    /// Runs (or skips) them.
    pub fn make(work: &Work<'_>, inputs: &Inputs) -> Result<Self, WorkflowError> {
        let scans = Scans::read(inputs, &work.settings.image)?;
        let own = OwnMasks::read(inputs, &scans, work)?;
        let mut made = Made::default();
        let registration = stages::registration(work, &mut made, &scans)?;
        let anat = stages::anat(work, &mut made, &scans, &own)?;
        Ok(Self { made, registration, anat })
    }

    /// Their manifests.
    pub fn manifests(&self) -> Vec<&Manifest> {
        in_order(&self.made, &[StageName::Registration, StageName::Anat])
    }

    /// The part of an outcome that images alone give.
    pub fn outcome(&self) -> ExperimentOutcome {
        outcome_of_images(&self.registration, &self.anat, &self.manifests())
    }
}

fn in_order<'m>(made: &'m Made, stages: &[StageName]) -> Vec<&'m Manifest> {
    stages.iter().filter_map(|stage| made.get(stage)).collect()
}

fn outcome_of_images(registration: &RegistrationFacts, anat: &AnatFacts, manifests: &[&Manifest]) -> ExperimentOutcome {
    ExperimentOutcome {
        kind: ExperimentKind::Resection,
        volumes: Some(anat.volumes),
        registrations: registration.fits.clone(),
        warnings: manifests.iter().flat_map(|m| m.warnings.iter().cloned()).collect(),
        ..ExperimentOutcome::default()
    }
}

/// Everything up to mesh and target, with its figures.
pub(crate) struct Prepared {
    pub made: Made,
    registration: RegistrationFacts,
    anat: AnatFacts,
    mesh: MeshFacts,
}

impl Prepared {
    /// Runs (or skips) the stages up to mesh and target.
    pub fn make(work: &Work<'_>, inputs: &Inputs) -> Result<Self, WorkflowError> {
        let Images { mut made, registration, anat } = Images::make(work, inputs)?;
        let anatomy = Anatomy::read(&work.case)?;
        let landmarks = Some(&anatomy.template_from_patient);
        let mesh = stages::mesh(work, &mut made, &anatomy.labels, landmarks)?;
        stages::reference(work, &mut made, &anatomy)?;
        Ok(Self { made, registration, anat, mesh })
    }

    /// What an earlier job left in the folder.
    pub fn read(case: &Case) -> Result<Self, WorkflowError> {
        if matches!(case.subject(), Some(Subject::Phantom { .. })) {
            return Err(CaseError::Phantom { folder: case.folder().to_path_buf() }.into());
        }
        let mut made = Made::default();
        let (manifest, registration) = case.stage(&StageName::Registration)?;
        made.add(StageName::Registration, manifest);
        let (manifest, anat) = case.stage(&StageName::Anat)?;
        made.add(StageName::Anat, manifest);
        let (manifest, mesh) = case.stage(&StageName::Mesh)?;
        made.add(StageName::Mesh, manifest);
        let (manifest, ()) = case.stage(&StageName::Reference)?;
        made.add(StageName::Reference, manifest);
        Ok(Self { made, registration, anat, mesh })
    }

    /// The stages' manifests.
    pub fn manifests(&self) -> Vec<&Manifest> {
        use StageName::{Anat, Mesh, Reference, Registration};
        in_order(&self.made, &[Registration, Anat, Mesh, Reference])
    }

    /// The part of an outcome that is known before any simulation.
    pub fn outcome(&self) -> ExperimentOutcome {
        ExperimentOutcome {
            sets: self.mesh.sets.clone(),
            mesh: Some(self.mesh.mesh.clone()),
            ..outcome_of_images(&self.registration, &self.anat, &self.manifests())
        }
    }
}

/// Mesh, target and loads of a prepared case.
pub(crate) struct Patient<'w, 'a> {
    work: &'w Work<'a>,
    prepared: Prepared,
    /// Loads and supports; the materials are the samples'.
    scenario: Scenario,
    mesh: TetMesh,
    mesh_bytes: Vec<u8>,
    reference: Reference,
    /// What mesh and scans are off without any movement, mm.
    at_rest_mm: Option<f64>,
}

impl<'w, 'a> Patient<'w, 'a> {
    /// Reads mesh and masks.
    pub fn new(work: &'w Work<'a>, prepared: Prepared) -> Result<Self, WorkflowError> {
        let settings = &work.settings.resection;
        let mesh_bytes = work.case.read(REST_MESH)?;
        let mesh = vtu::decode(&mesh_bytes, REST_MESH)?.mesh;
        let anatomy = Anatomy::read(&work.case)?;
        let surfaces = stages::observed_surfaces(&anatomy);
        let reference = Reference::Surfaces(ObservedSurfaces::new(&mesh, surfaces)?);
        let at_rest_mm = stages::error_at_rest(&work.case, &anatomy, &mesh)?;
        let scenario = settings.scenario(&stages::mni_from_gravity_frame(&work.case, settings.gravity_frame)?);
        Ok(Self { work, prepared, scenario, mesh, mesh_bytes, reference, at_rest_mm })
    }

    /// What the pair shows at rest, with what is expected of its parts beside it.
    fn floor(&self) -> NoiseFloor {
        let expected = self.work.settings.resection.noise_floor(self.prepared.anat.coarsest_voxel_mm);
        NoiseFloor { at_rest_mm: self.at_rest_mm, ..expected }
    }

    /// Simulates the samples of one part, or all of them, and nothing else.
    pub fn samples(
        &self,
        part: Option<Shard>,
        mode: SampleMode,
    ) -> Result<Vec<(SampleOutcome, Manifest)>, WorkflowError> {
        let mut list = plan::samples(self.work.settings, self.work.subject)?;
        if let Some(Shard { number, of }) = part {
            list = shard(&list, number, of);
        }
        let tissues = plan::tissues(self.work.settings, self.work.subject);
        let sweep = Sweep { mesh: &self.mesh, template: &self.scenario, tissues: &tissues, reference: &self.reference };
        stages::samples(self.work, &self.prepared.made, &sweep, &list, mode)
    }

    /// All samples, then outcome and page.
    pub fn sweep(&self, mode: SampleMode) -> Result<(), WorkflowError> {
        let (samples, made): (Vec<_>, Vec<_>) = self.samples(None, mode)?.into_iter().unzip();
        let mut outcome = self.posed_outcome();
        outcome.warnings.extend(made.iter().flat_map(|m| m.warnings.iter().cloned()));
        let tissues = plan::tissues(self.work.settings, self.work.subject);
        outcome.tissues = tissues.into_iter().map(|t| t.name).collect();
        outcome.best_sample = best_sample(&samples, "margin").map(|s| s.id.clone());
        outcome.samples = samples;
        let manifests: Vec<&Manifest> = self.prepared.manifests().into_iter().chain(&made).collect();
        finish(self.work, &outcome, &manifests)
    }

    /// Models of this patient beside each other.
    pub fn compare(&self) -> Result<Comparison, WorkflowError> {
        self.with_input(|made, input| stages::compare(self.work, made, input))
    }

    /// What an estimate needs, handed on.
    fn with_input<T>(
        &self,
        then: impl FnOnce(&mut Made, &EstimateInput<'_>) -> Result<T, WorkflowError>,
    ) -> Result<T, WorkflowError> {
        let Self { work, mesh, prepared, .. } = self;
        let coarser = || stages::coarser_mesh(work, &prepared.made, &Anatomy::read(&work.case)?);
        let shift = SeenShift::read(&work.case, Anatomy::read(&work.case)?, &work.settings.anat.sag)?;
        let input = EstimateInput {
            mesh: (mesh, &self.mesh_bytes),
            scenario: &self.scenario,
            tissues: &plan::tissues(work.settings, work.subject),
            poisson_ratio: work.settings.resection.poisson_ratio,
            reference: &self.reference,
            coarser: Some(&coarser),
            shift: Some(&shift),
            noise_mm: self.floor().combined_mm().unwrap_or(work.settings.estimate.descent.noise_mm),
            rigid_error_mm: work.settings.resection.registration_error_mm,
        };
        let mut made = prepared.made.clone();
        then(&mut made, &input)
    }

    /// Estimates the moduli from what the scans show. The samples of an `earlier` outcome stay beside it.
    pub fn estimate(&self, earlier: Option<ExperimentOutcome>) -> Result<EstimateFacts, WorkflowError> {
        let Self { work, prepared, .. } = self;
        let mut made = Made::default();
        let facts = self.with_input(|all, input| {
            let facts = stages::estimate(work, all, input)?;
            made = all.clone();
            Ok(facts)
        })?;
        let mut outcome = earlier.filter(|o| !o.samples.is_empty()).unwrap_or_else(|| self.posed_outcome());
        with_estimate(&mut outcome, &facts);
        let own = made.get(&StageName::Estimate);
        let manifests: Vec<&Manifest> = prepared.manifests().into_iter().chain(own).collect();
        finish(work, &outcome, &manifests)?;
        Ok(facts)
    }

    /// What is known before any material is tried.
    fn posed_outcome(&self) -> ExperimentOutcome {
        let settings = &self.work.settings.resection;
        let rest = self.reference.errors(&self.mesh, &vec![[0.0; 3]; self.mesh.nodes_mm().len()]);
        let [gx, gy, gz] = self.scenario.loads.gravity_m_per_s2;
        let loads = format!(
            "gravity ({gx:.2}, {gy:.2}, {gz:.2}) m/s2 on tissue of {} kg/m3, with {} held",
            settings.density_kg_per_m3,
            settings.fixed.join(" and ")
        );
        ExperimentOutcome {
            reference: "ventricle wall and cavity surface of the post-operative scan (closest points)".to_owned(),
            rest_rmse_mm: rest.rmse_mm,
            rest_surface_distance_mm: rest.surface_distance_mm,
            noise_floor: Some(self.floor()),
            loads: vec![loads],
            ..self.prepared.outcome()
        }
    }
}
