//! A phantom's case: known moduli go in and must come out.

use super::case::CaseError;
use super::error::WorkflowError;
use super::outcome::{finish, with_estimate};
use super::plan::{self, StageName};
use super::stages::{self, EstimateFacts, EstimateInput, MeshFacts, SampleMode, Sweep};
use super::work::{Made, Work};
use crate::artefact::Manifest;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome, SampleOutcome};
use crate::experiment::phantom::nearest_sample;
use crate::experiment::sweep::{Reference, best_sample};
use crate::layout::REST_MESH;
use crate::mesh::format::vtu;
use crate::segment::atlas;

const PREPARED: [StageName; 3] = [StageName::Labels, StageName::Mesh, StageName::Reference];

/// Runs (or skips) every stage, then outcome and page.
pub(crate) fn make(work: &Work<'_>) -> Result<(), WorkflowError> {
    let settings = &work.settings.phantom;
    let list = plan::samples(work.settings, work.subject)?;
    let mut made = Made::default();
    stages::labels(work, &mut made)?;
    let MeshFacts { mesh: figures, sets, .. } = stages::mesh(work, &mut made, &atlas::template().labels, None)?;
    let mesh = work.case.mesh()?;
    stages::phantom_reference(work, &mut made, &mesh)?;
    let displacement = stages::known_state(&work.case, &mesh)?;

    let (scenario, tissues, truth) = (settings.scenario(), settings.tissue_list(), settings.reference_sample());
    let reference = Reference::Nodes(displacement);
    let sweep = Sweep { mesh: &mesh, template: &scenario, tissues: &tissues, reference: &reference };
    let solved = stages::samples(work, &made, &sweep, &list, SampleMode::Run)?;
    let (samples, manifests): (Vec<_>, Vec<_>) = solved.into_iter().unzip();

    let of_prior: Vec<SampleOutcome> = samples.iter().filter(|s| s.id != truth.id).cloned().collect();
    let best = best_sample(&of_prior, "all").map(|s| s.id.clone());
    let [fx, fy, fz] = settings.force_n();
    let mut warnings: Vec<String> = manifests.iter().flat_map(|m| m.warnings.clone()).collect();
    if best != nearest(work)? {
        warnings.push("the best sample is not the one nearest to the reference's moduli".to_owned());
    }
    let rest = reference.errors(&mesh, &vec![[0.0; 3]; mesh.nodes_mm().len()]);
    let outcome = ExperimentOutcome {
        kind: ExperimentKind::Phantom,
        reference: "a simulation of the template with known moduli".to_owned(),
        reference_shear_modulus_pa: truth.tissues.iter().map(|(n, t)| (n.clone(), t.shear_modulus_pa)).collect(),
        tissues: tissues.iter().map(|t| t.name.clone()).collect(),
        samples,
        best_sample: best,
        rest_rmse_mm: rest.rmse_mm,
        sets,
        mesh: Some(figures),
        loads: vec![format!(
            "a total force of ({fx}, {fy}, {fz}) N shared by area over the set `{}`, with {} held",
            settings.loaded_set,
            settings.fixed.join(" and ")
        )],
        warnings,
        ..ExperimentOutcome::default()
    };
    let all: Vec<&Manifest> = PREPARED.iter().filter_map(|stage| made.get(stage)).chain(&manifests).collect();
    finish(work, &outcome, &all)
}

/// The sample of the prior whose moduli are nearest to the reference's.
pub(crate) fn nearest(work: &Work<'_>) -> Result<Option<String>, WorkflowError> {
    let truth = work.settings.phantom.reference_sample();
    let mut list = plan::samples(work.settings, work.subject)?;
    list.retain(|sample| sample.id != truth.id);
    Ok(nearest_sample(&list, &truth).map(|s| s.id.clone()))
}

/// Estimates the moduli of a finished phantom.
pub(crate) fn estimate(work: &Work<'_>) -> Result<EstimateFacts, WorkflowError> {
    let settings = &work.settings.phantom;
    let mut made = Made::default();
    for stage in PREPARED {
        let (manifest, _): (_, serde_json::Value) = work.case.stage(&stage)?;
        made.add(stage, manifest);
    }
    let own = work.case.settings()?;
    let made_with = own.get("phantom").and_then(|table| table.get("tissues")).and_then(toml::Value::as_integer);
    let made_with = made_with.map_or(settings.tissues, |tissues| tissues as usize);
    if made_with != settings.tissues {
        return Err(CaseError::OtherTissues { made: made_with, asked: settings.tissues }.into());
    }
    let mesh_bytes = work.case.read(REST_MESH)?;
    let mesh = vtu::decode(&mesh_bytes, REST_MESH)?.mesh;
    let displacement = stages::known_state(&work.case, &mesh)?;
    let input = EstimateInput {
        mesh: (&mesh, &mesh_bytes),
        scenario: &settings.scenario(),
        tissues: &settings.tissue_list(),
        poisson_ratio: settings.poisson_ratio,
        reference: &Reference::Nodes(displacement),
        coarser: None,
        shift: None,
        noise_mm: work.settings.estimate.phantom_noise_mm,
        rigid_error_mm: 0.0,
    };
    let facts = stages::estimate(work, &mut made, &input)?;
    let mut outcome = work.case.outcome()?;
    with_estimate(&mut outcome, &facts);
    let all: Vec<&Manifest> = PREPARED.iter().chain([&StageName::Estimate]).filter_map(|s| made.get(s)).collect();
    finish(work, &outcome, &all)?;
    Ok(facts)
}
