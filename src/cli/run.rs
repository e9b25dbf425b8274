//! `hgm run`: prep, sweep, report.

use super::case::{self, Anatomy, Case, EstimateFacts, EstimateOptions, MeshOptions, Overrides, Sweep};
use super::prep::{self, Prepared};
use super::{Failure, Reject, Session};
use crate::experiment::observed::ObservedSurfaces;
use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::prior::{PriorSettings, samples_of_prior};
use crate::experiment::resection::{ResectionSettings, improvement};
use crate::experiment::sweep::{Reference, best_sample};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// T1 pair -> everything: prep, a sweep over the prior, per-node errors, report; resumable
///
/// Example: hgm run pre.nii.gz post.nii.gz -o case
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    prep: prep::Args,
    /// 1: the whole brain one material; 2: grey and white matter apart (81 samples)
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
    /// Estimate the moduli with their intervals instead of trying the prior's samples
    #[arg(long)]
    estimate: bool,
}

impl Args {
    /// What the demo runs.
    pub fn demo(pre: PathBuf, post: PathBuf, output: PathBuf, mesh: MeshOptions) -> Self {
        Self {
            prep: prep::Args { pre, post, output, overrides: Overrides::default(), mesh },
            tissues: Some(1),
            estimate: false,
        }
    }
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let case = Case::open(&args.prep.output, session);
    let prepared = prep::prepare(&case, &args.prep, session)?;
    let mut settings: ResectionSettings = session.settings("resection")?;
    if let Some(tissues) = args.tissues {
        settings.tissues = usize::from(tissues);
    }
    if args.estimate {
        let (outcome, facts, page) = estimated(&case, &prepared, &settings, session)?;
        let text = super::estimate::table(&facts) + &super::estimate::comparison(&outcome, &facts) + &page;
        session.emit(&outcome, &text)?;
    } else {
        let (outcome, page) = sweep(&case, &prepared, &settings, session)?;
        session.emit(&outcome, &summary(&outcome, &page))?;
    }
    prepared.quality_gate()
}

/// Simulates every sample of the prior against the post-operative surfaces and writes outcome and page.
fn sweep(
    case: &Case,
    prepared: &Prepared,
    settings: &ResectionSettings,
    session: &Session,
) -> Result<(ExperimentOutcome, String), Failure> {
    let prior: PriorSettings = session.settings("prior")?;
    let mesh = case::rest_mesh(case)?;
    let mut manifests = prepared.manifests.clone();
    let surfaces = case::observed_surfaces(&Anatomy::read(case)?);
    manifests.push(case::reference(case, &surfaces, &manifests[1])?);
    let reference = Reference::Surfaces(ObservedSurfaces::new(&mesh, surfaces).reject()?);
    let (scenario, tissues) = (settings.scenario(), settings.tissue_list());
    let list = samples_of_prior(&tissues, &settings.sd_levels, settings.poisson_ratio, &prior).reject()?;
    let after = &prepared.manifests[2].clone();
    let shared = Sweep { mesh: &mesh, template: &scenario, tissues: &tissues, reference: &reference, after };
    let solved = case::samples(case, &shared, &list, session)?;
    let (samples, made): (Vec<_>, Vec<_>) = solved.into_iter().unzip();
    let rest = reference.errors(&mesh, &vec![[0.0; 3]; mesh.nodes_mm().len()]);

    let mut outcome = posed_outcome(prepared, settings, rest.rmse_mm);
    outcome.warnings.extend(made.iter().flat_map(|m| m.warnings.iter().cloned()));
    manifests.extend(made);
    outcome.tissues = tissues.iter().map(|t| t.name.clone()).collect();
    outcome.best_sample = best_sample(&samples, "margin").map(|s| s.id.clone());
    outcome.samples = samples;
    let used =
        BTreeMap::from([("resection", serde_json::to_value(settings)?), ("prior", serde_json::to_value(&prior)?)]);
    let page = case.finish(&outcome, &used, &manifests)?;
    Ok((outcome, page))
}

/// Estimates the moduli against the post-operative surfaces and writes outcome and page.
fn estimated(
    case: &Case,
    prepared: &Prepared,
    settings: &ResectionSettings,
    session: &Session,
) -> Result<(ExperimentOutcome, EstimateFacts, String), Failure> {
    let options: EstimateOptions = session.settings("estimate")?;
    let mesh = case::rest_mesh(case)?;
    let mut manifests = prepared.manifests.clone();
    let surfaces = case::observed_surfaces(&Anatomy::read(case)?);
    manifests.push(case::reference(case, &surfaces, &manifests[1])?);
    let reference = Reference::Surfaces(ObservedSurfaces::new(&mesh, surfaces).reject()?);
    let rest = reference.errors(&mesh, &vec![[0.0; 3]; mesh.nodes_mm().len()]);
    let floor = settings.noise_floor(prepared.anat.coarsest_voxel_mm);
    let (manifest, facts) = super::estimate::patient_estimate(case, settings, floor, &options, session)?;
    manifests.push(manifest);
    let mut outcome = posed_outcome(prepared, settings, rest.rmse_mm);
    super::estimate::with_estimate(&mut outcome, &facts);
    let used =
        BTreeMap::from([("resection", serde_json::to_value(settings)?), ("estimate", serde_json::to_value(&options)?)]);
    let page = case.finish(&outcome, &used, &manifests)?;
    Ok((outcome, facts, page))
}

/// What is known before any material is tried.
fn posed_outcome(
    prepared: &Prepared,
    settings: &ResectionSettings,
    rest_rmse_mm: BTreeMap<String, f64>,
) -> ExperimentOutcome {
    let [gx, gy, gz] = settings.gravity_m_per_s2;
    let loads = format!(
        "gravity ({gx}, {gy}, {gz}) m/s2 on tissue of {} kg/m3, with {} held",
        settings.density_kg_per_m3,
        settings.fixed.join(" and ")
    );
    ExperimentOutcome {
        reference: "ventricle wall and cavity surface of the post-operative scan (closest points)".to_owned(),
        rest_rmse_mm,
        noise_floor: Some(settings.noise_floor(prepared.anat.coarsest_voxel_mm)),
        loads: vec![loads],
        ..prepared.outcome()
    }
}

fn summary(outcome: &ExperimentOutcome, page: &str) -> String {
    let mut text = String::new();
    let floor = outcome.noise_floor.unwrap_or_default();
    if let Some(best) = outcome.best() {
        let moduli: Vec<String> = best.shear_modulus_pa.iter().map(|(t, m)| format!("{t} {m:.0} Pa")).collect();
        text += &format!("best sample {} ({})\n", best.id, moduli.join(", "));
        for (set, deformed) in &best.rmse_mm {
            let rest = outcome.rest_rmse_mm.get(set).copied().unwrap_or(f64::NAN);
            let verdict = improvement(rest, *deformed, &floor);
            text += &format!("RMSE at {set}: rest {rest:.3} mm, deformed {deformed:.3} mm: {verdict}\n");
        }
    }
    if let Some(floor_mm) = floor.combined_mm() {
        text += &format!("noise floor {floor_mm:.3} mm\n");
    }
    text + page
}
