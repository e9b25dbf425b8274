//! A phantom's case: known moduli go in and must come out.

use super::error::{CaseError, WorkflowError};
use super::facts::MeshFacts;
use super::outcome::{finish, keep_settings, with_estimate};
use super::patient::is_present;
use super::plan;
use super::stage_name::StageName;
use super::stages::{self, EstimateInput, SampleMode, Sweep};
use super::warning::Warning;
use super::work::{Made, Work};
use crate::artefact::Manifest;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome, SampleOutcome};
use crate::experiment::phantom::nearest_sample;
use crate::experiment::sample::{Sample, Tissue};
use crate::experiment::sweep::{Reference, best_sample};
use crate::fem::Scenario;
use crate::layout::REST_MESH;
use crate::mesh::TetMesh;
use crate::mesh::format::vtu;
use crate::segment::atlas;

const PREPARED: [StageName; 3] = [StageName::Labels, StageName::Mesh, StageName::Reference];

/// A phantom up to its known state.
pub(crate) struct Phantom<'w, 'a> {
    work: &'w Work<'a>,
    made: Made,
    figures: MeshFacts,
    mesh: TetMesh,
    mesh_bytes: Vec<u8>,
    scenario: Scenario,
    tissues: Vec<Tissue>,
    reference: Reference,
}

impl<'w, 'a> Phantom<'w, 'a> {
    /// Runs (or skips) the stages up to the known state.
    pub fn make(work: &'w Work<'a>) -> Result<Self, WorkflowError> {
        keep_settings(work)?;
        let mut made = Made::default();
        stages::labels(work, &mut made)?;
        let figures = stages::mesh(work, &mut made, &atlas::template().labels, None, None)?;
        stages::phantom_reference(work, &mut made, &work.case.mesh()?)?;
        Self::new(work, made, figures)
    }

    /// What an earlier job left in the folder, refused where it is not what these settings make.
    pub fn read(work: &'w Work<'a>) -> Result<Self, WorkflowError> {
        let own = work.case.settings()?;
        let made_with = own.get("phantom").and_then(|table| table.get("tissues")).and_then(toml::Value::as_integer);
        let (asked, made_with) = (work.settings.phantom.tissues, made_with.map(|tissues| tissues as usize));
        if let Some(made) = made_with.filter(|made| *made != asked) {
            return Err(CaseError::OtherTissues { made, asked }.into());
        }
        let mut made = Made::default();
        let (labelled, ()) = work.case.stage(&StageName::Labels)?;
        made.add(StageName::Labels, labelled);
        let (meshed, figures) = work.case.stage(&StageName::Mesh)?;
        is_present(work, &stages::mesh_stage(work, &made).0)?;
        made.add(StageName::Mesh, meshed);
        let (referenced, _): (_, SampleOutcome) = work.case.stage(&StageName::Reference)?;
        is_present(work, &stages::phantom_reference_stage(work, &made))?;
        made.add(StageName::Reference, referenced);
        Self::new(work, made, figures)
    }

    fn new(work: &'w Work<'a>, made: Made, figures: MeshFacts) -> Result<Self, WorkflowError> {
        let settings = &work.settings.phantom;
        let mesh_bytes = work.case.read(REST_MESH)?;
        let mesh = vtu::decode(&mesh_bytes, REST_MESH)?.mesh;
        let reference = Reference::Nodes(stages::known_state(&work.case, &mesh)?);
        let (scenario, tissues) = (settings.scenario(), settings.tissue_list());
        Ok(Self { work, made, figures, mesh, mesh_bytes, scenario, tissues, reference })
    }

    fn posed(&self) -> Sweep<'_> {
        let Self { mesh, scenario, tissues, reference, .. } = self;
        Sweep { mesh, template: scenario, tissues, reference }
    }

    /// Simulates the samples.
    pub fn samples(&self) -> Result<(), WorkflowError> {
        let list = plan::samples(self.work.settings, self.work.subject, &[])?;
        self.work.case.drop_samples_but(&list.iter().map(|sample| sample.id.as_str()).collect());
        stages::samples(self.work, &self.made, &self.posed(), &list, SampleMode::Run).map(|_| ())
    }

    /// Estimates the moduli against the known state.
    pub fn estimate(&self) -> Result<(), WorkflowError> {
        stages::estimate(self.work, &mut self.made.clone(), &self.asked()).map(|_| ())
    }

    fn asked(&self) -> EstimateInput<'_> {
        EstimateInput {
            mesh: (&self.mesh, &self.mesh_bytes),
            scenario: &self.scenario,
            tissues: &self.tissues,
            poisson_ratio: self.work.settings.phantom.poisson_ratio,
            reference: &self.reference,
            coarser: None,
            held: None,
            every_fluid: None,
            ventricles_cc: None,
            stuck: None,
            shift: None,
            noise_mm: self.work.settings.estimate.phantom_noise_mm,
            rigid_error_mm: 0.0,
        }
    }

    /// Outcome and page of what is there for the settings of this job.
    pub fn gather(&self) -> Result<(), WorkflowError> {
        let Self { work, made, .. } = self;
        let list = plan::samples(work.settings, work.subject, &[])?;
        let solved = stages::present_samples(work, made, &self.posed(), &list)?.unwrap_or_default();
        let (samples, of_samples): (Vec<_>, Vec<_>) = solved.into_iter().unzip();
        let mut outcome = self.outcome(samples, &of_samples, &list);
        let mut made = made.clone();
        if let Some(facts) = stages::present_estimate(work, &mut made, &self.asked())? {
            with_estimate(&mut outcome, &facts);
        }
        let own = made.get(&StageName::Estimate);
        outcome.warnings.extend(own.iter().flat_map(|m| m.warnings.iter().cloned()));
        let prepared = PREPARED.iter().filter_map(|stage| made.get(stage));
        let all: Vec<&Manifest> = prepared.chain(&of_samples).chain(own).collect();
        finish(work, &outcome, &all)
    }

    fn outcome(&self, samples: Vec<SampleOutcome>, manifests: &[Manifest], list: &[Sample]) -> ExperimentOutcome {
        let settings = &self.work.settings.phantom;
        let truth = settings.reference_sample();
        let of_prior: Vec<SampleOutcome> = samples.iter().filter(|s| s.id != truth.id).cloned().collect();
        let best = best_sample(&of_prior, "all").map(|s| s.id.clone());
        let [fx, fy, fz] = settings.force_n();
        let mut warnings: Vec<String> = manifests.iter().flat_map(|m| m.warnings.clone()).collect();
        let of_prior: Vec<Sample> = list.iter().filter(|s| s.id != truth.id).cloned().collect();
        if !samples.is_empty() && best != nearest_sample(&of_prior, &truth).map(|s| s.id.clone()) {
            warnings.push(Warning::OtherSampleIsBest.to_string());
        }
        let rest = self.reference.errors(&self.mesh, &vec![[0.0; 3]; self.mesh.nodes_mm().len()]);
        ExperimentOutcome {
            kind: ExperimentKind::Phantom,
            reference: "a simulation of the template with known moduli".to_owned(),
            reference_shear_modulus_pa: truth.tissues.iter().map(|(n, t)| (n.clone(), t.shear_modulus_pa)).collect(),
            tissues: self.tissues.iter().map(|t| t.name.clone()).collect(),
            samples,
            best_sample: best,
            rest_rmse_mm: rest.rmse_mm,
            sets: self.figures.sets.clone(),
            mesh: Some(self.figures.mesh.clone()),
            loads: vec![format!(
                "a total force of ({fx}, {fy}, {fz}) N shared by area over the set `{}`, with {} held",
                settings.loaded_set,
                settings.fixed.join(" and ")
            )],
            warnings,
            ..ExperimentOutcome::default()
        }
    }
}
