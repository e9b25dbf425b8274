//! `hgm estimate`: the moduli that explain what was observed, with error bars.

use super::case::{
    self, Case, ESTIMATE, EstimateFacts, EstimateInput, EstimateOptions, OUTCOME, REFERENCE_STATE, REST_MESH,
};
use super::patient::Patient;
use super::{Failure, Reject, Session};
use crate::artefact::Manifest;
use crate::experiment::estimate::EstimateOutcome;
use crate::experiment::outcome::{ExperimentOutcome, SampleOutcome};
use crate::experiment::phantom::PhantomSettings;
use crate::experiment::resection::improvement;
use crate::experiment::sweep::Reference;
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use anyhow::anyhow;
use std::path::PathBuf;

/// Shear moduli by optimisation with solver sensitivities: most probable values, 95 % intervals, what limits them
///
/// Example: hgm estimate case --tissues 2
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run`, `hgm prep` or `hgm phantom`
    case: PathBuf,
    /// 1: the whole brain one material; 2: grey and white matter apart [default: as the case was made]
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let case = Case::open(&args.case, session);
    let options: EstimateOptions = session.settings("estimate")?;
    if case.path(REFERENCE_STATE).exists() {
        let facts = of_phantom(&case, args.tissues, &options, session)?;
        let mut outcome = ExperimentOutcome::from_json(&case.read_text(OUTCOME)?, OUTCOME).reject()?;
        with_estimate(&mut outcome, &facts);
        case.write_outcome(&outcome)?;
        let page = case.write_page()?;
        return session.emit(&facts.estimate, &(table(&facts) + &page));
    }
    let patient = Patient::open(&case, args.tissues, session)?;
    let earlier = if case.path(OUTCOME).exists() {
        Some(ExperimentOutcome::from_json(&case.read_text(OUTCOME)?, OUTCOME).reject()?)
    } else {
        None
    };
    let (outcome, facts, page) = patient.estimate(&options, earlier, session)?;
    session.emit(&facts.estimate, &(table(&facts) + &comparison(&outcome, &facts) + &page))?;
    patient.quality_gate()
}

fn of_phantom(
    case: &Case,
    tissues: Option<u8>,
    options: &EstimateOptions,
    session: &Session,
) -> Result<EstimateFacts, Failure> {
    let settings: PhantomSettings = case.settings_of("phantom", session)?;
    if tissues.is_some_and(|t| usize::from(t) != settings.tissues) {
        return Err(Failure::Rejected(anyhow!(
            "--tissues {0}: the phantom in this folder was made with --tissues {1}; make another with \
             `hgm phantom --tissues {0}`",
            tissues.unwrap_or_default(),
            settings.tissues
        )));
    }
    let mesh_bytes = case.read(REST_MESH)?;
    let mesh = vtu::decode(&mesh_bytes, REST_MESH).reject()?.mesh;
    let (made, _): (Manifest, SampleOutcome) = case.stage_facts("reference")?;
    let displacement = reference_state(case, &mesh)?;
    let input = EstimateInput {
        mesh: (&mesh, &mesh_bytes),
        scenario: &settings.scenario(),
        tissues: &settings.tissue_list(),
        poisson_ratio: settings.poisson_ratio,
        reference: &Reference::Nodes(displacement),
        after: &made,
        sag: None,
        noise_mm: options.phantom_noise_mm,
    };
    Ok(case::estimate(case, &input, options, session)?.1)
}

/// The displacement of a phantom's reference, mm, node by node of its mesh.
///
/// # Errors
/// Rejected when the file is damaged or another mesh's.
pub fn reference_state(case: &Case, mesh: &TetMesh) -> Result<Vec<[f64; 3]>, Failure> {
    let state = vtu::decode(&case.read(REFERENCE_STATE)?, REFERENCE_STATE).reject()?;
    let displacement = state.point_field("displacement").and_then(Field::vectors).unwrap_or_default();
    let (found, nodes) = (displacement.len(), mesh.nodes_mm().len());
    if found == nodes {
        return Ok(displacement);
    }
    Err(Failure::Rejected(anyhow!(
        "{0}: {REFERENCE_STATE} holds displacements of {found} nodes and {REST_MESH} has {nodes}: one of the two is not this \
         phantom's; run `hgm phantom -o {0} --force` again",
        case.folder.display()
    )))
}

/// The outcome with the estimate as one more sample; it is the best one where no sweep has chosen another.
pub fn with_estimate(outcome: &mut ExperimentOutcome, facts: &EstimateFacts) {
    outcome.samples.retain(|s| s.id != ESTIMATE);
    if outcome.samples.is_empty() {
        outcome.tissues = facts.record.shear_modulus_pa.keys().cloned().collect();
    }
    outcome.samples.push(facts.record.clone());
    if outcome.best_sample.is_none() {
        outcome.best_sample = Some(ESTIMATE.to_owned());
    }
    outcome.warnings.retain(|w| !w.starts_with("estimate: "));
    outcome.warnings.extend(facts.estimate.limits.iter().map(|limit| format!("estimate: {limit}")));
    outcome.estimate = Some(facts.estimate.clone());
}

/// The estimate for a terminal.
pub fn table(facts: &EstimateFacts) -> String {
    let EstimateOutcome { posterior, noise_mm, residual_rms_mm, taken_out_rms_mm, tangent_solves, limits, .. } =
        &facts.estimate;
    let mut text = String::from("parameter                            mode   95 % interval\n");
    for (n, name) in posterior.names.iter().enumerate() {
        let [low, high] = posterior.interval_95[n];
        text += &format!("{name:<32} {:>8.1}   {low:.1} to {high:.1}\n", posterior.mode[n]);
    }
    text += &format!(
        "residual {residual_rms_mm:.4} mm, noise {noise_mm:.3} mm, {tangent_solves} tangent solves, condition {:.1}\n",
        posterior.identifiability.condition
    );
    if let Some(taken_out) = taken_out_rms_mm {
        text += &format!("registration's own error, {taken_out:.3} mm, measured on the estimate and taken out\n");
    }
    for limit in limits {
        text += &format!("limit: {limit}\n");
    }
    text
}

/// Rest against the estimate's state at every set.
pub fn comparison(outcome: &ExperimentOutcome, facts: &EstimateFacts) -> String {
    let floor = outcome.noise_floor.unwrap_or_default();
    let mut text = String::new();
    for (set, deformed) in &facts.record.rmse_mm {
        let rest = outcome.rest_rmse_mm.get(set).copied().unwrap_or(f64::NAN);
        text += &format!(
            "RMSE at {set}: rest {rest:.3} mm, estimate {deformed:.3} mm: {}\n",
            improvement(rest, *deformed, &floor)
        );
    }
    text
}
