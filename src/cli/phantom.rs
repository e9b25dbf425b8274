//! `hgm phantom`: known moduli go in and must come out.

use super::case::{self, Case, MeshOptions, PriorOptions, SampleMode, Sweep};
use super::estimate::reference_state;
use super::{Failure, Reject, Session};
use crate::artefact::{Produced, Stage};
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome, SampleOutcome};
use crate::experiment::phantom::{PhantomSettings, nearest_sample};
use crate::experiment::prior::{samples_of_every_task, samples_of_prior};
use crate::experiment::sweep::{Reference, best_sample, solve_sample};
use crate::mesh::format::{Field, vtu};
use crate::segment::atlas;
use anyhow::{Context, anyhow};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Raised when the reference's code changes its result.
const VERSION: u32 = 2;
use super::case::REFERENCE_STATE as REFERENCE;

/// The synthetic validation on the template: a reference of known moduli, found again among the samples
///
/// Example: hgm phantom --tissues 2 -o phantom
#[derive(Debug, clap::Args)]
pub struct Args {
    /// 1: the whole brain one material; 2: grey and white matter apart (81 samples)
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
    /// Nine samples of every task of the generative model (elastography, linear, hyperelastic; grey, white, healthy brain)
    /// instead of one task's; one tissue only
    #[arg(long, conflicts_with = "study")]
    every_task: bool,
    #[command(flatten)]
    prior: PriorOptions,
    /// Also try the reference's own moduli
    #[arg(long)]
    include_reference: bool,
    /// Where to write
    #[arg(short, long, value_name = "DIR", default_value = "phantom")]
    output: PathBuf,
    #[command(flatten)]
    mesh: MeshOptions,
}

impl Args {
    /// What the demo runs.
    pub fn demo(output: PathBuf, mesh: MeshOptions) -> Self {
        Self {
            tissues: Some(1),
            every_task: false,
            prior: PriorOptions::default(),
            include_reference: false,
            output,
            mesh,
        }
    }
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let (outcome, text) = analyse(args, session)?;
    session.emit(&outcome, &text)
}

/// Runs (or skips) every stage; the numbers, and those that matter for a terminal.
///
/// # Errors
/// The first stage that is rejected or fails.
pub fn analyse(args: &Args, session: &Session) -> Result<(ExperimentOutcome, String), Failure> {
    let mut settings: PhantomSettings = session.settings("phantom")?;
    if let Some(tissues) = args.tissues {
        settings.tissues = usize::from(tissues);
    }
    settings.include_reference |= args.include_reference;
    if args.every_task && settings.tissues != 1 {
        return Err(Failure::Rejected(anyhow!(
            "--every-task compares materials of the whole brain: it does not go with two tissues; drop it, or use \
             --tissues 1"
        )));
    }
    let prior = args.prior.over(&session.settings("prior")?);
    let case = Case::open(&args.output, session);

    let template = atlas::template();
    let labels_stage = Stage::new("labels", VERSION, &case.folder, &()).input("atlas", &template.labels.data);
    let (labelled, ()) = case.run(&labels_stage, "labels", || Ok(Produced::default()))?;
    let (meshed, mesh_facts) = case::mesh(&case, &template.labels, None, &args.mesh, &labelled, session)?;
    let mesh = case::rest_mesh(&case)?;

    let scenario = settings.scenario();
    let tissues = settings.tissue_list();
    let truth = settings.reference_sample();
    let stage = Stage::new("reference", VERSION, &case.folder, &(&scenario, &truth)).after(&meshed);
    let (referenced, _): (_, SampleOutcome) = case.run(&stage, "reference", || {
        let rest = Reference::Nodes(vec![[0.0; 3]; mesh.nodes_mm().len()]);
        let solved = solve_sample(&mesh, &scenario, &tissues, &truth, &rest, &|_| {})
            .context("the table [phantom] of the settings asks for a simulation that cannot be done")
            .reject()?;
        let reason = solved.reason.unwrap_or_default();
        let (outcome, _) = solved.state.ok_or_else(|| {
            anyhow!(
                "the phantom's reference state has no equilibrium ({reason}); lower `one_tissue_force_n` or \
                 `two_tissue_force_n`, or raise the shear modulus, in the table [phantom] of the settings file"
            )
        })?;
        let points = [Field::vector("displacement", &outcome.displacement_mm)];
        let files = vec![(REFERENCE.to_owned(), vtu::encode(&mesh, &points, &[])?)];
        Ok(Produced { files, facts: case::facts(&solved.record)?, ..Produced::default() })
    })?;
    let displacement = reference_state(&case, &mesh)?;

    let (levels, poisson_ratio) = (&settings.sd_levels, settings.poisson_ratio);
    let mut list = if args.every_task {
        samples_of_every_task(levels, poisson_ratio, &prior).reject()?
    } else {
        samples_of_prior(&tissues, levels, poisson_ratio, &prior).reject()?
    };
    let nearest = nearest_sample(&list, &truth).map(|s| s.id.clone());
    if settings.include_reference {
        list.push(truth.clone());
    }
    let reference = Reference::Nodes(displacement);
    let sweep =
        Sweep { mesh: &mesh, template: &scenario, tissues: &tissues, reference: &reference, after: &[&referenced] };
    let solved = case::samples(&case, &sweep, &list, SampleMode::Run, session)?;
    let (samples, mut manifests): (Vec<_>, Vec<_>) = solved.into_iter().unzip();

    let prior_only: Vec<SampleOutcome> = samples.iter().filter(|s| s.id != truth.id).cloned().collect();
    let best = best_sample(&prior_only, "all").map(|s| s.id.clone());
    let [fx, fy, fz] = settings.force_n();
    let mut warnings: Vec<String> = manifests.iter().flat_map(|m| m.warnings.clone()).collect();
    if best != nearest {
        warnings.push("the best sample is not the one nearest to the reference's moduli".to_owned());
    }
    let rest = reference.errors(&mesh, &vec![[0.0; 3]; mesh.nodes_mm().len()]);
    let outcome = ExperimentOutcome {
        kind: ExperimentKind::Phantom,
        reference: "a simulation of the template with known moduli".to_owned(),
        reference_shear_modulus_pa: truth.tissues.iter().map(|(n, t)| (n.clone(), t.shear_modulus_pa)).collect(),
        tissues: tissues.iter().map(|t| t.name.clone()).collect(),
        samples,
        best_sample: best.clone(),
        rest_rmse_mm: rest.rmse_mm,
        sets: mesh_facts.sets,
        mesh: Some(mesh_facts.mesh),
        loads: vec![format!(
            "a total force of ({fx}, {fy}, {fz}) N shared by area over the set `{}`, with {} held",
            settings.loaded_set,
            settings.fixed.join(" and ")
        )],
        warnings,
        ..ExperimentOutcome::default()
    };
    manifests.splice(0..0, [labelled, meshed, referenced]);
    let used =
        BTreeMap::from([("phantom", serde_json::to_value(&settings)?), ("prior", serde_json::to_value(&prior)?)]);
    let page = case.finish(&outcome, &used, &manifests)?;
    let text = summary(&outcome, nearest.as_deref(), &page);
    Ok((outcome, text))
}

fn summary(outcome: &ExperimentOutcome, nearest: Option<&str>, page: &str) -> String {
    let mut text = String::from("sample                  shear modulus (Pa)          RMSE (mm)\n");
    for sample in &outcome.samples {
        let moduli: Vec<String> = sample.shear_modulus_pa.values().map(|m| format!("{m:.1}")).collect();
        let rmse = sample.rmse_mm.get("all").map_or("no equilibrium".to_owned(), |r| format!("{r:.6}"));
        let mark = if outcome.best_sample.as_deref() == Some(&sample.id) { "  best" } else { "" };
        let near = if nearest == Some(sample.id.as_str()) { "  nearest to the reference" } else { "" };
        text += &format!("{:<23} {:<27} {rmse}{mark}{near}\n", sample.id, moduli.join(" / "));
    }
    text + page
}
