//! A patient's case: from two scans to the mesh, and from there to samples or an estimate.

use super::earlier_prediction::earlier_prediction;
use super::error::{CaseError, WorkflowError};
use super::facts::MeshFacts;
use super::inputs::{Inputs, OwnMasks, ScanSums, Scans, with_own_masks_of};
use super::loads_in_words::loads_in_words;
use super::outcome::{finish, keep_settings, with_estimate};
use super::plan::{self, Goal};
use super::refusal;
use super::stage_name::StageName;
use super::stages::{
    self, AnatFacts, Anatomy, Earlier, EstimateInput, FieldsInput, HeldBody, RegistrationFacts, SampleMode, SeenShift,
    Sweep,
};
use super::work::{Made, Work};
use crate::artefact::{Manifest, Stage};
use crate::experiment::compare::Comparison;
use crate::experiment::estimate::FluidLevels;
use crate::experiment::observed::ObservedSurfaces;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome, NoiseFloor};
use crate::experiment::resection::{ResectionSettings, Supports};
use crate::experiment::sample::{Tissue, shard};
use crate::experiment::supports::{SupportsError, levels_when_drained};
use crate::experiment::sweep::{Reference, best_sample};
use crate::fem::Scenario;
use crate::layout::REST_MESH;
use crate::mesh::TetMesh;
use crate::mesh::format::vtu;
use std::collections::BTreeMap;
use std::str::FromStr;
use std::sync::Arc;

/// A part of a sweep's samples (see [`shard`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 1.
    pub number: usize,
    /// Of how many.
    pub of: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not K/N with 1 <= K <= N, such as 2/4");
        let (number, of) = text.split_once('/').ok_or_else(wrong)?;
        let (number, of): (usize, usize) = (number.parse().map_err(|_| wrong())?, of.parse().map_err(|_| wrong())?);
        if (1..=of).contains(&number) { Ok(Self { number, of }) } else { Err(wrong()) }
    }
}

/// The stages of images, with their figures.
pub(crate) struct Images {
    pub made: Made,
    earlier: Option<Earlier>,
    registration: RegistrationFacts,
    anat: AnatFacts,
}

impl Images {
    /// Runs (or skips) them.
    pub fn make(work: &Work<'_>, inputs: &Inputs) -> Result<Self, WorkflowError> {
        let scans = Scans::read(inputs, &work.settings.image)?;
        let own = OwnMasks::read(inputs, &scans, work)?;
        let earlier = inputs.prediction.as_deref().map(|folder| earlier_prediction(folder, &scans, &own, work));
        let earlier = earlier.transpose()?;
        if earlier.is_some() {
            work.tell(|p| p.noted("pose and tissue of the pre-operative scan are the prediction's"));
        }
        work.hold(true)?;
        check_scans(work, &scans.sums)?;
        keep_settings(work)?;
        let mut made = Made::default();
        let registration = match stages::registration(work, &mut made, &scans, &own, earlier.as_ref()) {
            Ok(registration) => registration,
            Err(error) => {
                refusal::keep(work, &scans, "registration", &[], &error)?;
                return Err(error);
            }
        };
        match stages::anat(work, &mut made, &scans, &own, earlier.as_ref()) {
            Ok(anat) => Ok(Self { made, earlier, registration, anat }),
            Err(error) => {
                refusal::keep(work, &scans, "anat", &in_order(&made, &[StageName::Registration]), &error)?;
                Err(error)
            }
        }
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

/// Other scans are another patient's, unless they are meant.
fn check_scans(work: &Work<'_>, sums: &ScanSums) -> Result<(), WorkflowError> {
    let Some(recorded) = Manifest::of_stage(work.case.folder(), &StageName::Registration.to_string()) else {
        return Ok(());
    };
    for (role, which, sum) in [("pre", "pre-operative", &sums.pre), ("post", "post-operative", &sums.post)] {
        if !work.place.force && recorded.inputs.get(role) != Some(sum) {
            return Err(CaseError::OtherScan { folder: work.case.folder().to_path_buf(), which }.into());
        }
    }
    Ok(())
}

fn in_order<'m>(made: &'m Made, stages: &[StageName]) -> Vec<&'m Manifest> {
    stages.iter().filter_map(|stage| made.get(stage)).collect()
}

fn outcome_of_images(registration: &RegistrationFacts, anat: &AnatFacts, manifests: &[&Manifest]) -> ExperimentOutcome {
    ExperimentOutcome {
        kind: ExperimentKind::Resection,
        volumes: Some(anat.volumes),
        scans: Some(anat.scans.clone()),
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
        let Images { mut made, earlier, registration, anat } = Images::make(work, inputs)?;
        let anatomy = Anatomy::read(&work.case)?;
        let landmarks = Some(&anatomy.template_from_patient);
        let mesh = stages::mesh(work, &mut made, &anatomy.labels, landmarks, earlier.as_ref())?;
        stages::reference(work, &mut made, &anatomy)?;
        Ok(Self { made, registration, anat, mesh })
    }

    /// What an earlier job left in the folder, refused where it is not what these settings and the stages before it make.
    pub fn read(work: &Work<'_>) -> Result<Self, WorkflowError> {
        let case = &work.case;
        let mut made = Made::default();
        let (registered, registration): (Manifest, RegistrationFacts) = case.stage(&StageName::Registration)?;
        let sum = |role: &str| registered.inputs.get(role).cloned().unwrap_or_default();
        let sums = ScanSums { pre: sum("pre"), post: sum("post") };
        is_present(work, &with_own_masks_of(stages::registration_stage(work, &sums), &registered))?;
        made.add(StageName::Registration, registered);
        let (segmented, anat): (Manifest, AnatFacts) = case.stage(&StageName::Anat)?;
        is_present(work, &with_own_masks_of(stages::anat_stage(work, &made, &sums), &segmented))?;
        made.add(StageName::Anat, segmented);
        let (meshed, mesh) = case.stage(&StageName::Mesh)?;
        is_present(work, &stages::mesh_stage(work, &made).0)?;
        made.add(StageName::Mesh, meshed);
        let (observed, ()) = case.stage(&StageName::Reference)?;
        is_present(work, &stages::reference_stage(work, &made))?;
        made.add(StageName::Reference, observed);
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

/// Refuses a stage that would be made again.
pub(crate) fn is_present(work: &Work<'_>, stage: &Stage) -> Result<(), WorkflowError> {
    let reasons = stage.why();
    if reasons.is_empty() {
        return Ok(());
    }
    let (folder, what) = (work.case.folder().to_path_buf(), format!("stage {}", stage.name()));
    Err(CaseError::Stale { folder, what, reasons }.into())
}

/// Mesh, target and loads of a prepared case.
pub(crate) struct Patient<'w, 'a> {
    work: &'w Work<'a>,
    prepared: Prepared,
    /// Loads and supports; the materials are the samples'.
    scenario: Scenario,
    /// Shear moduli of tissues that are not varied, Pa.
    held: BTreeMap<String, f64>,
    mesh: TetMesh,
    mesh_bytes: Vec<u8>,
    reference: Reference,
    /// What mesh and scans are off without any movement, mm.
    at_rest_mm: Option<f64>,
}

/// Samples and estimate that are there.
struct Found {
    outcome: ExperimentOutcome,
    /// Of the samples.
    samples: Vec<Manifest>,
    /// The stages before the fields.
    made: Made,
}

/// The fields are made of the estimate, or of the best sample that has a state.
fn fields_of<'s>(outcome: &ExperimentOutcome, samples: &'s [Manifest]) -> FieldsInput<'s> {
    let there = |best: &&String| outcome.samples.iter().any(|s| s.id == **best && s.file.is_some());
    let best = outcome.best_sample.as_ref().filter(there);
    let model = if outcome.estimate.is_some() { Some("estimate".to_owned()) } else { best.cloned() };
    FieldsInput { model, samples }
}

impl<'w, 'a> Patient<'w, 'a> {
    /// Reads mesh and masks.
    pub fn new(work: &'w Work<'a>, prepared: Prepared) -> Result<Self, WorkflowError> {
        let settings = &work.settings.resection;
        let mesh_bytes = work.case.read(REST_MESH)?;
        let mesh = vtu::decode(&mesh_bytes, REST_MESH)?.mesh;
        let anatomy = Anatomy::read(&work.case)?;
        let scenario = settings.scenario(&stages::mni_from_gravity_frame(&work.case, settings.gravity_frame)?);
        let scenario = settings.supported(&scenario, &anatomy.before)?;
        let (scenario, held) = stages::with_held_tissues(work, &prepared.mesh.mesh, scenario)?;
        let mesh = settings.supported_mesh(mesh, &scenario)?;
        let surfaces = stages::observed_surfaces(&anatomy);
        let reference = Reference::Surfaces(ObservedSurfaces::new(&mesh, surfaces)?);
        let at_rest_mm = stages::error_at_rest(&work.case, &anatomy, &mesh)?;
        Ok(Self { work, prepared, scenario, held, mesh, mesh_bytes, reference, at_rest_mm })
    }

    /// What the pair shows at rest, with what is expected of its parts beside it.
    fn floor(&self) -> NoiseFloor {
        let expected = self.work.settings.resection.noise_floor(self.prepared.anat.coarsest_voxel_mm);
        NoiseFloor { at_rest_mm: self.at_rest_mm, ..expected }
    }

    /// Simulates the samples of one part, or all of them, and nothing else.
    pub fn samples(&self, part: Option<Shard>, mode: SampleMode) -> Result<(), WorkflowError> {
        let mut list = plan::samples(self.work.settings, self.work.subject, &self.lesions())?;
        if let Some(Shard { number, of }) = part {
            list = shard(&list, number, of);
        } else {
            self.work.case.drop_samples_but(&list.iter().map(|sample| sample.id.as_str()).collect());
        }
        let tissues = plan::tissues(self.work.settings, self.work.subject);
        stages::samples(self.work, &self.prepared.made, &self.posed(&tissues), &list, mode).map(|_| ())
    }

    /// Tissues that are not varied, by name.
    fn lesions(&self) -> Vec<String> {
        self.held.keys().cloned().collect()
    }

    fn posed<'s>(&'s self, tissues: &'s [Tissue]) -> Sweep<'s> {
        Sweep { mesh: &self.mesh, template: &self.scenario, tissues, reference: &self.reference }
    }

    /// Estimates the moduli against what the post-operative scan shows.
    pub fn estimate(&self) -> Result<(), WorkflowError> {
        self.with_images(|made, input| stages::estimate(self.work, made, input)).map(|_| ())
    }

    /// Models of this patient beside each other.
    pub fn compare(&self) -> Result<Comparison, WorkflowError> {
        self.with_images(|made, input| stages::compare(self.work, made, input))
    }

    /// What an estimate needs with what the images show, handed on.
    fn with_images<T>(
        &self,
        then: impl FnOnce(&mut Made, &EstimateInput<'_>) -> Result<T, WorkflowError>,
    ) -> Result<T, WorkflowError> {
        let Self { work, prepared, .. } = self;
        let coarser = || stages::coarser_mesh(work, &prepared.made, &Anatomy::read(&work.case)?);
        let held = || {
            let fluid = work.settings.estimate.fluid;
            let given = fluid.may_be_given().then_some(false);
            self.family(&given.into_iter().chain(fluid.may_be_unknown().then_some(true)).collect::<Vec<_>>())
        };
        let every_fluid = || self.family(&[false, true]);
        let shift = SeenShift::read(&work.case, Anatomy::read(&work.case)?, work.settings)?;
        let tissues = plan::tissues(work.settings, work.subject);
        let given = work.settings.estimate.fluid.may_be_given();
        let stuck = || -> Result<HeldBody, WorkflowError> { Ok(self.held(Supports::Fixed, !given)?.stuck()) };
        let (shift, coarser, held, stuck) = (Some(&shift), Some(&coarser as _), Some(&held as _), Some(&stuck as _));
        let every_fluid = Some(&every_fluid as _);
        let input = EstimateInput { coarser, held, every_fluid, stuck, shift, ..self.asked(&tissues) };
        then(&mut prepared.made.clone(), &input)
    }

    /// The bodies that are tried: each way of supporting the brain with what carries it as given, with fluid of unknown level, or
    /// both. Where both are asked for and the labels show no fluid there is only the first.
    fn family(&self, unknown_fluid: &[bool]) -> Result<Vec<HeldBody>, WorkflowError> {
        let mut family = Vec::new();
        for supports in self.work.settings.resection.supports.family() {
            for &unknown in unknown_fluid {
                match self.held(supports, unknown) {
                    Err(WorkflowError::Supports(SupportsError::NoFluid)) if unknown_fluid.len() > 1 && unknown => {}
                    body => family.push(body?),
                }
            }
        }
        Ok(family)
    }

    /// The body as these supports hold it, in fluid of unknown level or with what `[resection]` says of that.
    fn held(&self, supports: Supports, unknown_fluid: bool) -> Result<HeldBody, WorkflowError> {
        let work = self.work;
        let settings = ResectionSettings { supports, ..work.settings.resection.clone() };
        let settings = if unknown_fluid { settings.in_fluid() } else { settings };
        let anatomy = Anatomy::read(&work.case)?;
        let template = settings.scenario(&stages::mni_from_gravity_frame(&work.case, settings.gravity_frame)?);
        let scenario = settings.supported(&template, &anatomy.before)?;
        let (scenario, _) = stages::with_held_tissues(work, &self.prepared.mesh.mesh, scenario)?;
        let rest = vtu::decode(&self.mesh_bytes, REST_MESH)?.mesh;
        let mesh = settings.supported_mesh(rest, &scenario)?;
        let reference = Reference::Surfaces(ObservedSurfaces::new(&mesh, stages::observed_surfaces(&anatomy))?);
        let gravity = scenario.loads.gravity_m_per_s2;
        let levels = || levels_when_drained(&anatomy.before, gravity).and_then(FluidLevels::new).map(Arc::new);
        let levels = unknown_fluid.then(levels).flatten();
        Ok(HeldBody { settings: Some(settings), scenario, mesh, reference, levels })
    }

    /// The ventricles' volume on the scans, before and after, where both were segmented.
    fn ventricles_cc(&self) -> Option<[f64; 2]> {
        let volumes = &self.prepared.anat.volumes;
        Some([volumes.ventricle_before_cc?, volumes.ventricle_after_cc?])
    }

    fn asked<'s>(&'s self, tissues: &'s [Tissue]) -> EstimateInput<'s> {
        let settings = self.work.settings;
        EstimateInput {
            mesh: (&self.mesh, &self.mesh_bytes),
            scenario: &self.scenario,
            tissues,
            poisson_ratio: settings.resection.poisson_ratio,
            reference: &self.reference,
            coarser: None,
            held: None,
            every_fluid: None,
            ventricles_cc: self.ventricles_cc(),
            stuck: None,
            shift: None,
            noise_mm: self.floor().combined_mm().unwrap_or(settings.estimate.descent.noise_mm),
            rigid_error_mm: settings.resection.registration_error_mm,
        }
    }

    /// What is there for the settings of this job: samples, an estimate, or both.
    fn found(&self) -> Result<Found, WorkflowError> {
        let Self { work, prepared, .. } = self;
        let tissues = plan::tissues(work.settings, work.subject);
        let solved = match plan::samples(work.settings, work.subject, &self.lesions()) {
            // Two tissues have been estimated where one was swept.
            Err(WorkflowError::EveryTaskOfTwo) => None,
            list => stages::present_samples(work, &prepared.made, &self.posed(&tissues), &list?)?,
        };
        let mut outcome = self.posed_outcome();
        let mut samples: Vec<Manifest> = Vec::new();
        if let Some(solved) = solved {
            let (outcomes, manifests): (Vec<_>, Vec<_>) = solved.into_iter().unzip();
            samples = manifests;
            outcome.warnings.extend(samples.iter().flat_map(|m| m.warnings.iter().cloned()));
            outcome.tissues = tissues.iter().map(|t| t.name.clone()).collect();
            outcome.best_sample = best_sample(&outcomes, "margin").map(|s| s.id.clone());
            outcome.samples = outcomes;
        }
        let mut made = prepared.made.clone();
        if let Some(facts) = stages::present_estimate(work, &mut made, &self.asked(&tissues))? {
            with_estimate(&mut outcome, &facts);
        }
        Ok(Found { outcome, samples, made })
    }

    /// Outcome and page of what is there.
    pub fn gather(&self) -> Result<(), WorkflowError> {
        let Self { work, prepared, .. } = self;
        let Found { mut outcome, samples, mut made } = self.found()?;
        stages::fields(work, &mut made, &fields_of(&outcome, &samples))?;
        let own = in_order(&made, &[StageName::Estimate, StageName::Fields]);
        outcome.warnings.extend(own.iter().flat_map(|m| m.warnings.iter().cloned()));
        let all: Vec<&Manifest> = prepared.manifests().into_iter().chain(&samples).chain(own).collect();
        finish(work, &outcome, &all)
    }

    /// The stages after mesh, target and samples as this job would pose them: the estimate where it is the goal, and, where that
    /// would not run again, the fields of what is there.
    pub fn later_stages(&self, goal: Goal) -> Result<Vec<Stage>, WorkflowError> {
        let tissues = plan::tissues(self.work.settings, self.work.subject);
        let mut later = Vec::new();
        if goal == Goal::Estimate {
            later.push(stages::estimate_stage(self.work, &self.prepared.made, &self.asked(&tissues))?);
        }
        if later.iter().all(|stage| stage.why().is_empty()) {
            let Found { outcome, samples, made } = self.found()?;
            later.push(stages::fields_stage(self.work, &made, &fields_of(&outcome, &samples)));
        }
        Ok(later)
    }

    /// What is known before any material is tried.
    fn posed_outcome(&self) -> ExperimentOutcome {
        let settings = &self.work.settings.resection;
        let rest = self.reference.errors(&self.mesh, &vec![[0.0; 3]; self.mesh.nodes_mm().len()]);
        // Of samples; an estimate brings its own.
        let loads = loads_in_words(settings, &self.scenario, (&[], ""));
        ExperimentOutcome {
            reference: "ventricle wall and cavity surface of the post-operative scan (closest points)".to_owned(),
            rest_rmse_mm: rest.rmse_mm,
            rest_surface_distance_mm: rest.surface_distance_mm,
            noise_floor: Some(self.floor()),
            loads: vec![loads],
            held_shear_modulus_pa: self.held.clone(),
            ..self.prepared.outcome()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shard_is_a_part_of_a_whole() {
        assert_eq!("2/4".parse(), Ok(Shard { number: 2, of: 4 }));
        for wrong in ["0/4", "5/4", "1", "a/b", "1/", "-1/2"] {
            assert!(wrong.parse::<Shard>().unwrap_err().contains(wrong));
        }
    }
}
