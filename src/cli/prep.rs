//! `hgm prep`: a T1 pair to registered images, masks and a tagged mesh.

use super::case::{
    self, AnatFacts, Anatomy, Case, MeshFacts, MeshOptions, Overrides, OwnMasks, RegistrationFacts, Scans,
};
use super::{Failure, Session};
use crate::artefact::Manifest;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome};
use crate::experiment::prior::PriorSettings;
use crate::experiment::resection::ResectionSettings;
use anyhow::anyhow;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// T1 pair -> registered images, masks, tagged mesh and a page to check them
///
/// Example: hgm prep pre.nii.gz post.nii.gz -o case
#[derive(Debug, clap::Args)]
pub struct Command {
    #[command(flatten)]
    args: Args,
    /// Stop at the registered images and masks
    #[arg(long, conflicts_with_all = ["mesher", "cells", "edge_mm"])]
    no_mesh: bool,
}

/// A pair and where its case goes.
#[derive(Clone, Debug, clap::Args)]
// Flattened into `run`, whose own group of arguments has this name.
#[group(skip)]
pub struct Args {
    /// Pre-operative T1 (.nii or .nii.gz)
    pub pre: PathBuf,
    /// Post-operative T1 (.nii or .nii.gz)
    pub post: PathBuf,
    /// The case folder
    #[arg(short, long, value_name = "CASE", default_value = "case")]
    pub output: PathBuf,
    #[command(flatten)]
    pub overrides: Overrides,
    #[command(flatten)]
    pub mesh: MeshOptions,
}

pub fn run(command: &Command, session: &Session) -> Result<(), Failure> {
    let args = &command.args;
    let case = Case::open(&args.output, session);
    if command.no_mesh {
        let images = Images::of(&case, args, session)?;
        let outcome = image_outcome(&images.registration, &images.anat, &images.manifests);
        let page = case.finish(&outcome, &BTreeMap::new(), &images.manifests)?;
        return session.emit(&outcome, &page);
    }
    let prepared = prepare(&case, args, session)?;
    let outcome = prepared.outcome();
    // Sweeps of this case, in however many shards, start from these.
    let settings = BTreeMap::from([
        ("resection", serde_json::to_value(session.settings::<ResectionSettings>("resection")?)?),
        ("prior", serde_json::to_value(session.settings::<PriorSettings>("prior")?)?),
    ]);
    let page = case.finish(&outcome, &settings, &prepared.manifests)?;
    session.emit(&outcome, &page)?;
    prepared.quality_gate()
}

/// The stages of images: registration and masks.
#[derive(Debug)]
struct Images {
    manifests: [Manifest; 2],
    registration: RegistrationFacts,
    anat: AnatFacts,
}

impl Images {
    /// Runs (or skips) them.
    fn of(case: &Case, args: &Args, session: &Session) -> Result<Self, Failure> {
        let scans = Scans::read(&args.pre, &args.post, session)?;
        let own = OwnMasks::read(&args.overrides, &scans, session)?;
        let (registered, registration) = case::registration(case, &scans, session)?;
        let (segmented, anat) = case::anat(case, &scans, &own, &registered, session)?;
        Ok(Self { manifests: [registered, segmented], registration, anat })
    }
}

/// The part of an outcome that images alone give.
fn image_outcome(registration: &RegistrationFacts, anat: &AnatFacts, manifests: &[Manifest]) -> ExperimentOutcome {
    ExperimentOutcome {
        kind: ExperimentKind::Resection,
        volumes: Some(anat.volumes),
        registrations: registration.fits.clone(),
        warnings: manifests.iter().flat_map(|m| m.warnings.iter().cloned()).collect(),
        ..ExperimentOutcome::default()
    }
}

/// What `prep` leaves for the experiments.
#[derive(Debug)]
pub struct Prepared {
    /// The stages' manifests, in order: registration, anat, mesh, reference.
    pub manifests: Vec<Manifest>,
    /// Registration figures.
    pub registration: RegistrationFacts,
    /// Mask figures.
    pub anat: AnatFacts,
    /// Mesh figures.
    pub mesh: MeshFacts,
}

/// Runs (or skips) the stages up to the tagged mesh.
///
/// # Errors
/// The first stage that is rejected or fails.
pub fn prepare(case: &Case, args: &Args, session: &Session) -> Result<Prepared, Failure> {
    // What would be refused after minutes is refused now.
    case::mesh_settings(&args.mesh, &case::programs(), session)?;
    let Images { manifests: [registered, segmented], registration, anat } = Images::of(case, args, session)?;
    let anatomy = Anatomy::read(case)?;
    let landmarks = Some(&anatomy.template_from_patient);
    let (meshed, mesh) = case::mesh(case, &anatomy.labels, landmarks, &args.mesh, &segmented, session)?;
    let observed = case::reference(case, &anatomy, &segmented)?;
    Ok(Prepared { manifests: vec![registered, segmented, meshed, observed], registration, anat, mesh })
}

impl Prepared {
    /// What an earlier `prep` or `run` left in the folder.
    ///
    /// # Errors
    /// Rejected when it has not been prepared.
    pub fn read(case: &Case) -> Result<Self, Failure> {
        let (registered, registration) = case.stage_facts("registration")?;
        let (segmented, anat) = case.stage_facts("anat")?;
        let (meshed, mesh) = case.stage_facts("mesh")?;
        let (observed, ()) = case.stage_facts("reference")?;
        Ok(Self { manifests: vec![registered, segmented, meshed, observed], registration, anat, mesh })
    }

    /// The part of an outcome that is known before any simulation.
    pub fn outcome(&self) -> ExperimentOutcome {
        ExperimentOutcome {
            sets: self.mesh.sets.clone(),
            mesh: Some(self.mesh.mesh.clone()),
            ..image_outcome(&self.registration, &self.anat, &self.manifests)
        }
    }

    /// Exit code 4 when a boundary set is not to be believed.
    ///
    /// # Errors
    /// [`Failure::QualityGate`] with the sets' warnings.
    pub fn quality_gate(&self) -> Result<(), Failure> {
        if self.mesh.implausible.is_empty() {
            return Ok(());
        }
        Err(Failure::QualityGate(anyhow!("{} (outputs kept)", self.mesh.implausible.join("; "))))
    }
}
