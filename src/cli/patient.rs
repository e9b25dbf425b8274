//! A prepared patient's case: what `run`, `sweep`, `reduce` and `estimate` share.

use super::case::{
    self, Anatomy, Case, EstimateFacts, EstimateInput, EstimateOptions, Kind, PriorOptions, REST_MESH, Sag, SampleMode,
    Sweep,
};
use super::estimate::with_estimate;
use super::prep::Prepared;
use super::{Failure, Reject, Session};
use crate::artefact::Manifest;
use crate::experiment::observed::ObservedSurfaces;
use crate::experiment::outcome::{ExperimentOutcome, NoiseFloor, SampleOutcome};
use crate::experiment::prior::samples_of_prior;
use crate::experiment::resection::ResectionSettings;
use crate::experiment::sample::shard;
use crate::experiment::sweep::{Reference, best_sample};
use crate::fem::Scenario;
use crate::mesh::TetMesh;
use crate::mesh::format::vtu;
use anyhow::anyhow;
use std::collections::BTreeMap;

/// Settings by room, as `settings.toml` keeps them.
type UsedSettings = BTreeMap<&'static str, serde_json::Value>;

/// A part of a sweep's samples (see [`shard`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 1.
    pub number: usize,
    /// Of how many.
    pub of: usize,
}

/// Mesh, reference and settings of a prepared case.
#[derive(Debug)]
pub struct Patient {
    case: Case,
    prepared: Prepared,
    settings: ResectionSettings,
    /// Loads and supports; the materials are the samples'.
    scenario: Scenario,
    mesh: TetMesh,
    mesh_bytes: Vec<u8>,
    reference: Reference,
}

impl Patient {
    /// Reads mesh and masks.
    ///
    /// # Errors
    /// Files that are missing or damaged; sets or surfaces that are empty.
    pub fn new(case: &Case, prepared: Prepared, settings: ResectionSettings) -> Result<Self, Failure> {
        let mesh_bytes = case.read(REST_MESH)?;
        let mesh = vtu::decode(&mesh_bytes, REST_MESH).reject()?.mesh;
        let anatomy = Anatomy::read(case)?;
        let surfaces = case::observed_surfaces(&anatomy);
        let reference = Reference::Surfaces(ObservedSurfaces::new(&mesh, surfaces).reject()?);
        let scenario = settings.scenario(&case::mni_from_gravity_frame(case, settings.gravity_frame)?);
        Ok(Self { case: case.clone(), prepared, settings, scenario, mesh, mesh_bytes, reference })
    }

    /// A case that `hgm prep` or `hgm run` has made, with the settings it was made with.
    ///
    /// # Errors
    /// As [`Patient::new`]; also a folder that has not been prepared.
    pub fn open(case: &Case, tissues: Option<u8>, session: &Session) -> Result<Self, Failure> {
        if case.kind() == Kind::Phantom {
            return Err(Failure::Rejected(anyhow!(
                "{}: this is a phantom: `hgm estimate`, `hgm report` and `hgm why` take one; give a folder that `hgm prep` or \
                 `hgm run` has made",
                case.folder.display()
            )));
        }
        let mut settings: ResectionSettings = case.settings_of("resection", session)?;
        settings.tissues = tissues.map_or(settings.tissues, usize::from);
        Self::new(case, Prepared::read(case)?, settings)
    }

    fn floor(&self) -> NoiseFloor {
        self.settings.noise_floor(self.prepared.anat.coarsest_voxel_mm)
    }

    /// Simulates the samples of one shard and nothing else.
    ///
    /// # Errors
    /// A scenario that the solver refuses.
    pub fn sweep_shard(&self, part: Shard, options: &PriorOptions, session: &Session) -> Result<(), Failure> {
        let (_, used) = self.simulate(Some(part), SampleMode::Run, options, session)?;
        self.case.write_settings(&used)
    }

    /// All samples, then outcome and page, and returns both.
    ///
    /// # Errors
    /// A scenario that the solver refuses; samples that are missing when they are gathered.
    pub fn sweep(
        &self,
        mode: SampleMode,
        options: &PriorOptions,
        session: &Session,
    ) -> Result<(ExperimentOutcome, String), Failure> {
        let (solved, used) = self.simulate(None, mode, options, session)?;
        let (samples, made): (Vec<_>, Vec<_>) = solved.into_iter().unzip();
        let mut outcome = self.posed_outcome();
        outcome.warnings.extend(made.iter().flat_map(|m| m.warnings.iter().cloned()));
        outcome.tissues = self.settings.tissue_list().iter().map(|t| t.name.clone()).collect();
        outcome.best_sample = best_sample(&samples, "margin").map(|s| s.id.clone());
        outcome.samples = samples;
        let manifests: Vec<Manifest> = self.prepared.manifests.iter().cloned().chain(made).collect();
        let page = self.case.finish(&outcome, &used, &manifests)?;
        Ok((outcome, page))
    }

    /// The samples and the settings they were made with.
    fn simulate(
        &self,
        part: Option<Shard>,
        mode: SampleMode,
        options: &PriorOptions,
        session: &Session,
    ) -> Result<(Vec<(SampleOutcome, Manifest)>, UsedSettings), Failure> {
        let prior = options.over(&self.case.settings_of("prior", session)?);
        let tissues = self.settings.tissue_list();
        let mut list =
            samples_of_prior(&tissues, &self.settings.sd_levels, self.settings.poisson_ratio, &prior).reject()?;
        if let Some(Shard { number, of }) = part {
            list = shard(&list, number, of);
        }
        let after = [&self.prepared.manifests[2], &self.prepared.manifests[3]];
        let shared = Sweep {
            mesh: &self.mesh,
            template: &self.scenario,
            tissues: &tissues,
            reference: &self.reference,
            after: &after,
        };
        let used = BTreeMap::from([
            ("resection", serde_json::to_value(&self.settings)?),
            ("prior", serde_json::to_value(&prior)?),
        ]);
        Ok((case::samples(&self.case, &shared, &list, mode, session)?, used))
    }

    /// Estimates the moduli against the post-operative surfaces. The samples of an `earlier` outcome stay beside it.
    ///
    /// # Errors
    /// A scenario that the solver refuses, or a prior that does not exist.
    pub fn estimate(
        &self,
        options: &EstimateOptions,
        earlier: Option<ExperimentOutcome>,
        session: &Session,
    ) -> Result<(ExperimentOutcome, EstimateFacts, String), Failure> {
        let sag = Sag::read(&self.case, Anatomy::read(&self.case)?, session)?;
        let input = EstimateInput {
            mesh: (&self.mesh, &self.mesh_bytes),
            scenario: &self.scenario,
            tissues: &self.settings.tissue_list(),
            poisson_ratio: self.settings.poisson_ratio,
            reference: &self.reference,
            after: &self.prepared.manifests[3],
            sag: Some(&sag),
            noise_mm: self.floor().combined_mm().unwrap_or(options.descent.noise_mm),
        };
        let (manifest, facts) = case::estimate(&self.case, &input, options, session)?;
        let mut outcome = earlier.filter(|o| !o.samples.is_empty()).unwrap_or_else(|| self.posed_outcome());
        with_estimate(&mut outcome, &facts);
        let used = BTreeMap::from([
            ("resection", serde_json::to_value(&self.settings)?),
            ("estimate", serde_json::to_value(options)?),
        ]);
        let manifests: Vec<Manifest> = self.prepared.manifests.iter().cloned().chain([manifest]).collect();
        let page = self.case.finish(&outcome, &used, &manifests)?;
        Ok((outcome, facts, page))
    }

    /// What is known before any material is tried.
    fn posed_outcome(&self) -> ExperimentOutcome {
        let rest = self.reference.errors(&self.mesh, &vec![[0.0; 3]; self.mesh.nodes_mm().len()]);
        let [gx, gy, gz] = self.scenario.loads.gravity_m_per_s2;
        let loads = format!(
            "gravity ({gx:.2}, {gy:.2}, {gz:.2}) m/s2 on tissue of {} kg/m3, with {} held",
            self.settings.density_kg_per_m3,
            self.settings.fixed.join(" and ")
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

    /// Exit code 4 when a boundary set is not to be believed.
    ///
    /// # Errors
    /// [`Failure::QualityGate`].
    pub fn quality_gate(&self) -> Result<(), Failure> {
        self.prepared.quality_gate()
    }
}
