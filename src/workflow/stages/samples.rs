//! Stage `sim-SAMPLE`: one simulation each, so that a sweep can stop anywhere, resume, and be split over machines.

use super::held_by::sample_held_by;
use crate::anatomy::label;
use crate::artefact::{Manifest, Produced, Stage};
use crate::experiment::outcome::{MeshOutcome, SampleOutcome};
use crate::experiment::prior::held_material;
use crate::experiment::sample::{Sample, Tissue};
use crate::experiment::sweep::{Reference, SolvedSample, solve_sample};
use crate::fem::Scenario;
use crate::geometry::{Frame, Mni};
use crate::layout::SAMPLE_STATE;
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use crate::workflow::error::WorkflowError;
use crate::workflow::stage_name::{StageName, Subject};
use crate::workflow::warning::Warning;
use crate::workflow::work::{Made, Work, facts};
use std::collections::BTreeMap;

/// Raised when the stage's code changes its result.
const VERSION: u32 = 9;

/// What every sample of a sweep shares.
#[derive(Debug)]
pub(crate) struct Sweep<'a> {
    /// The undeformed mesh.
    pub mesh: &'a TetMesh,
    /// Loads, supports and solver; the materials are the sample's.
    pub template: &'a Scenario,
    /// The tissues whose material is varied.
    pub tissues: &'a [Tissue],
    /// What the samples are compared with.
    pub reference: &'a Reference,
}

/// Whether samples that are not there are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SampleMode {
    /// Make them.
    Run,
    /// Refuse and say which.
    Gather,
}

/// The scenario with the materials of what the mesh holds beside the varied tissues: tumour and oedema at the mean of their
/// prior; with their shear moduli, Pa.
pub(crate) fn with_held_tissues(
    work: &Work<'_>,
    mesh: &MeshOutcome,
    mut scenario: Scenario,
) -> Result<(Scenario, BTreeMap<String, f64>), WorkflowError> {
    let mut moduli = BTreeMap::new();
    for name in lesions(mesh) {
        let held = held_material(&name, work.settings.resection.poisson_ratio, &work.settings.prior)?;
        moduli.insert(name.clone(), held.shear_modulus_pa);
        scenario.materials.insert(name, held.material);
    }
    Ok((scenario, moduli))
}

/// The lesions in a mesh, by the names of their labels.
pub(crate) fn lesions(mesh: &MeshOutcome) -> Vec<String> {
    let names = [label::OEDEMA, label::TUMOUR].into_iter().filter_map(label::name);
    names.filter(|name| mesh.volume_cc.contains_key(*name)).map(str::to_owned).collect()
}

/// The stage of one sample.
pub(crate) fn sample_stage(
    work: &Work<'_>,
    made: &Made,
    template: &Scenario,
    tissues: &[Tissue],
    sample: &Sample,
) -> Stage {
    let held = sample_held_by(work);
    let posed = serde_json::json!({ "scenario": template, "tissues": tissues, "sample": sample, "held": held });
    work.stage(made, &StageName::Sample(sample.id.clone()), VERSION, &posed).frame(Mni::NAME)
}

/// Runs (or skips) every sample; the records come back in order with what made them. A sample without equilibrium is only
/// recorded.
pub(crate) fn samples(
    work: &Work<'_>,
    made: &Made,
    sweep: &Sweep<'_>,
    list: &[Sample],
    mode: SampleMode,
) -> Result<Vec<(SampleOutcome, Manifest)>, WorkflowError> {
    work.tell(|p| p.begin("simulation", list.len()));
    let table = if work.subject == Subject::Patient { "resection" } else { "phantom" };
    let mut records = Vec::with_capacity(list.len());
    for sample in list {
        let stage = sample_stage(work, made, sweep.template, sweep.tissues, sample);
        if mode == SampleMode::Gather
            && let Some(reason) = stage.why().first()
        {
            // The values are this program's data; the user's own are in the settings file.
            return Err(WorkflowError::SampleMissing { sample: sample.id.clone(), reason: reason.in_short() });
        }
        let name = StageName::Sample(sample.id.clone());
        let mut own = made.clone();
        let record = work.run(&mut own, &name, &stage, || {
            let show = |p: &crate::fem::Progress| {
                work.tell(|shown| shown.doing(&format!("{} residual {:.1e}", sample.id, p.relative_residual)));
            };
            let solved = solve_sample(sweep.mesh, sweep.template, sweep.tissues, sample, sweep.reference, &show)
                .map_err(|source| WorkflowError::Sample { table, source })?;
            produced(work, sweep.mesh, solved)
        })?;
        records.extend(own.get(&name).map(|manifest| (record, manifest.clone())));
        work.tell(|p| p.step());
    }
    work.tell(|p| p.end());
    Ok(records)
}

/// The samples of this case and these settings, where all of them are there.
pub(crate) fn present_samples(
    work: &Work<'_>,
    made: &Made,
    sweep: &Sweep<'_>,
    list: &[Sample],
) -> Result<Option<Vec<(SampleOutcome, Manifest)>>, WorkflowError> {
    let there = |sample: &Sample| sample_stage(work, made, sweep.template, sweep.tissues, sample).why().is_empty();
    if !list.iter().all(there) {
        return Ok(None);
    }
    let read = |sample: &Sample| {
        let (manifest, record) = work.case.stage(&StageName::Sample(sample.id.clone()))?;
        Ok((record, manifest))
    };
    list.iter().map(read).collect::<Result<_, WorkflowError>>().map(Some)
}

fn produced(work: &Work<'_>, mesh: &TetMesh, solved: SolvedSample) -> Result<Produced, WorkflowError> {
    let mut produced = Produced::default();
    let mut record = solved.record;
    match solved.state {
        Err(error) => {
            work.tell(|p| p.detail(&record.id, &error.to_string()));
            produced.warn([Warning::SampleLeftOut { sample: record.id.clone() }]);
        }
        Ok((outcome, errors)) => {
            let file = SAMPLE_STATE.of(&record.id);
            let observed = errors.node_observed.iter().map(|&seen| f64::from(u8::from(seen))).collect();
            let points = [
                Field::vector("displacement", &outcome.displacement_mm),
                Field::vector("reaction_n", &outcome.reaction_n),
                Field::scalar("rmse_mm", errors.node_error_mm),
                Field::scalar("rmse_observed", observed),
            ];
            let cells = [
                Field::scalar("jacobian", outcome.jacobian),
                Field::scalar("strain_energy_density_pa", outcome.strain_energy_density_pa),
            ];
            produced.files.push((file.clone(), vtu::encode(mesh, &points, &cells)?));
            produced.warn(&outcome.warnings);
            record.file = Some(file);
        }
    }
    produced.facts = facts(&record);
    Ok(produced)
}
