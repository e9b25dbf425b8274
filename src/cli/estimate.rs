//! `hgm estimate`: the moduli that explain what was observed, with error bars.

use super::case::{
    self, Anatomy, Case, ESTIMATE, EstimateFacts, EstimateInput, EstimateOptions, OUTCOME, REFERENCE_STATE, REST_MESH,
};
use super::{Failure, Reject, Session};
use crate::artefact::Manifest;
use crate::experiment::estimate::EstimateOutcome;
use crate::experiment::observed::ObservedSurfaces;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome, NoiseFloor};
use crate::experiment::phantom::PhantomSettings;
use crate::experiment::resection::{ResectionSettings, improvement};
use crate::experiment::sweep::Reference;
use crate::mesh::format::{Field, vtu};
use anyhow::{Context, anyhow};
use serde::de::DeserializeOwned;
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
    let facts = if case.path(REFERENCE_STATE).exists() {
        of_phantom(&case, args.tissues, &options, session)?
    } else {
        of_patient(&case, args.tissues, &options, session)?
    };
    let page = add_to_outcome(&case, &facts)?;
    session.emit(&facts.estimate, &(table(&facts) + &page))
}

/// The settings the case was made with, unless the settings file of this call has the table.
fn settings_of<T: DeserializeOwned + Default>(case: &Case, room: &str, session: &Session) -> Result<T, Failure> {
    if session.has_table(room) || !case.path("settings.toml").exists() {
        return session.settings(room);
    }
    let text = case.read_text("settings.toml")?;
    let table: toml::Table = text.parse().context("settings.toml: not a TOML file").reject()?;
    match table.get(room) {
        None => session.settings(room),
        Some(table) => table.clone().try_into().with_context(|| format!("settings.toml: table [{room}]")).reject(),
    }
}

fn of_phantom(
    case: &Case,
    tissues: Option<u8>,
    options: &EstimateOptions,
    session: &Session,
) -> Result<EstimateFacts, Failure> {
    let mut settings: PhantomSettings = settings_of(case, "phantom", session)?;
    if tissues.is_some_and(|t| usize::from(t) != settings.tissues) {
        return Err(Failure::Rejected(anyhow!(
            "--tissues: the phantom in this folder has {}; make another with `hgm phantom --tissues {}`",
            settings.tissues,
            tissues.unwrap_or_default()
        )));
    }
    settings.tissues = tissues.map_or(settings.tissues, usize::from);
    let (mesh_bytes, reference_bytes) = (case.read(REST_MESH)?, case.read(REFERENCE_STATE)?);
    let mesh = vtu::decode(&mesh_bytes, REST_MESH).reject()?.mesh;
    let reference = vtu::decode(&reference_bytes, REFERENCE_STATE).reject()?;
    let displacement = reference.point_field("displacement").and_then(Field::vectors);
    let displacement =
        displacement.ok_or_else(|| anyhow!("{REFERENCE_STATE}: no array `displacement`; run with --force"))?;
    let input = EstimateInput {
        mesh: (&mesh, &mesh_bytes),
        scenario: &settings.scenario(),
        tissues: &settings.tissue_list(),
        poisson_ratio: settings.poisson_ratio,
        reference: &Reference::Nodes(displacement),
        reference_bytes: &reference_bytes,
        noise_mm: options.phantom_noise_mm,
    };
    Ok(case::estimate(case, &input, options, session)?.1)
}

fn of_patient(
    case: &Case,
    tissues: Option<u8>,
    options: &EstimateOptions,
    session: &Session,
) -> Result<EstimateFacts, Failure> {
    let mut settings: ResectionSettings = settings_of(case, "resection", session)?;
    settings.tissues = tissues.map_or(settings.tissues, usize::from);
    let coarsest_voxel_mm = case.anat_facts()?.coarsest_voxel_mm;
    Ok(patient_estimate(case, &settings, settings.noise_floor(coarsest_voxel_mm), options, session)?.1)
}

/// The estimate of a prepared patient's case.
///
/// # Errors
/// A case without mesh or masks, or settings that the solver refuses.
pub fn patient_estimate(
    case: &Case,
    settings: &ResectionSettings,
    floor: NoiseFloor,
    options: &EstimateOptions,
    session: &Session,
) -> Result<(Manifest, EstimateFacts), Failure> {
    let anatomy = Anatomy::read(case)?;
    let mesh_bytes = case.read(REST_MESH)?;
    let mesh = vtu::decode(&mesh_bytes, REST_MESH).reject()?.mesh;
    let mut reference_bytes = anatomy.cavity.data.iter().map(|&b| u8::from(b)).collect::<Vec<u8>>();
    reference_bytes.extend(anatomy.post_ventricle.data.iter().map(|&b| u8::from(b)));
    let surfaces = ObservedSurfaces::new(&mesh, case::observed_surfaces(&anatomy)).reject()?;
    let input = EstimateInput {
        mesh: (&mesh, &mesh_bytes),
        scenario: &settings.scenario(),
        tissues: &settings.tissue_list(),
        poisson_ratio: settings.poisson_ratio,
        reference: &Reference::Surfaces(surfaces),
        reference_bytes: &reference_bytes,
        noise_mm: floor.combined_mm().unwrap_or(options.descent.noise_mm),
    };
    case::estimate(case, &input, options, session)
}

/// Puts the estimate beside the samples of `sim/outcome.json` and makes the page again.
fn add_to_outcome(case: &Case, facts: &EstimateFacts) -> Result<String, Failure> {
    let mut outcome = if case.path(OUTCOME).exists() {
        ExperimentOutcome::from_json(&case.read_text(OUTCOME)?, OUTCOME).reject()?
    } else {
        ExperimentOutcome { kind: ExperimentKind::Resection, ..ExperimentOutcome::default() }
    };
    with_estimate(&mut outcome, facts);
    case.write_outcome(&outcome)?;
    case.write_page()
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
    let EstimateOutcome { posterior, noise_mm, residual_rms_mm, tangent_solves, limits, .. } = &facts.estimate;
    let mut text = String::from("parameter                            mode   95 % interval\n");
    for (n, name) in posterior.names.iter().enumerate() {
        let [low, high] = posterior.interval_95[n];
        text += &format!("{name:<32} {:>8.1}   {low:.1} to {high:.1}\n", posterior.mode[n]);
    }
    text += &format!(
        "residual {residual_rms_mm:.4} mm, noise {noise_mm:.3} mm, {tangent_solves} tangent solves, condition {:.1}\n",
        posterior.identifiability.condition
    );
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
