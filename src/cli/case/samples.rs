//! Stage `sample-NN`: one simulation each, so that a sweep can stop anywhere, resume, and be split over machines.

use super::{Case, Failure, REST_MESH, Reject, facts};
use crate::artefact::{Manifest, Produced, Stage};
use crate::cli::Session;
use crate::experiment::outcome::SampleOutcome;
use crate::experiment::prior::PriorSettings;
use crate::experiment::sample::{Sample, Tissue};
use crate::experiment::sweep::{Reference, SolvedSample, solve_sample};
use crate::fem::Scenario;
use crate::geometry::{Frame, Mni};
use crate::material::StudyKind;
use crate::material::meta_model::MetaModel;
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use anyhow::{Context, anyhow};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 3;

/// The prior as the command line gives it.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct PriorOptions {
    /// Whose studies the samples come from: mre, linear or hyperelastic [default: hyperelastic]
    #[arg(long, value_name = "KIND")]
    study: Option<StudyKind>,
    /// The law fitted to every sample: neo-hookean, mooney-rivlin, ogden or ogden-high [default: neo-hookean]
    #[arg(long, value_name = "LAW")]
    law: Option<MetaModel>,
}

impl PriorOptions {
    /// These options over the settings file's.
    pub fn over(&self, settings: &PriorSettings) -> PriorSettings {
        PriorSettings {
            study: self.study.unwrap_or(settings.study),
            law: self.law.unwrap_or(settings.law),
            ..settings.clone()
        }
    }
}

/// What every sample of a sweep shares.
#[derive(Debug)]
pub struct Sweep<'a> {
    /// The rest mesh.
    pub mesh: &'a TetMesh,
    /// Loads, supports and solver; the materials are the sample's.
    pub template: &'a Scenario,
    /// The tissues whose material is varied.
    pub tissues: &'a [Tissue],
    /// What the samples are compared with.
    pub reference: &'a Reference,
    /// The manifests of the stages that made mesh and reference.
    pub after: &'a [&'a Manifest],
}

/// Whether samples that are not there are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleMode {
    /// Make them.
    Run,
    /// Refuse and say which.
    Gather,
}

/// The stage of one sample.
pub fn sample_stage(
    case: &Case,
    template: &Scenario,
    tissues: &[Tissue],
    sample: &Sample,
    after: &[&Manifest],
) -> Stage {
    let name = format!("sim-{}", sample.id);
    let posed = serde_json::json!({ "scenario": template, "tissues": tissues, "sample": sample });
    let stage = Stage::new(&name, VERSION, &case.folder, &posed).frame(Mni::NAME);
    after.iter().fold(stage, |stage, earlier| stage.after(earlier))
}

/// Runs (or skips) every sample; the records come back in order.
///
/// # Errors
/// A scenario or mesh that the solver refuses; a sample without equilibrium is only recorded.
pub fn samples(
    case: &Case,
    sweep: &Sweep<'_>,
    list: &[Sample],
    mode: SampleMode,
    session: &Session,
) -> Result<Vec<(SampleOutcome, Manifest)>, Failure> {
    let bar = session.progress(list.len() as u64, "simulation");
    let mut records = Vec::with_capacity(list.len());
    for sample in list {
        let stage = sample_stage(case, sweep.template, sweep.tissues, sample, sweep.after);
        if mode == SampleMode::Gather
            && let Some(reason) = stage.why().first()
        {
            // The values are this program's data; the user's own are in the settings file.
            let reason = reason.split(" changed from ").next().unwrap_or(reason);
            return Err(Failure::Rejected(anyhow!(
                "{} is not done with these settings ({reason}); run `hgm sweep CASE` on the shard it belongs to with \
                 the settings of the other shards (`hgm why CASE` tells what differs)",
                sample.id
            )));
        }
        let (manifest, record) = case.run(&stage, &sample.id, || {
            let show = |p: &crate::fem::Progress| {
                bar.set_message(format!("{} residual {:.1e}", sample.id, p.relative_residual));
            };
            let solved = solve_sample(sweep.mesh, sweep.template, sweep.tissues, sample, sweep.reference, &show)
                .context("the table [resection] (of a phantom: [phantom]) asks for a simulation that cannot be done")
                .reject()?;
            produced(sweep.mesh, solved)
        })?;
        records.push((record, manifest));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(records)
}

fn produced(mesh: &TetMesh, solved: SolvedSample) -> Result<Produced, Failure> {
    let mut produced = Produced::default();
    let mut record = solved.record;
    match solved.state {
        None => {
            tracing::debug!("{}: {}", record.id, solved.reason.unwrap_or_default());
            produced.warnings.push(format!("{} is left out: its body finds no equilibrium under this load", record.id));
        }
        Some((outcome, errors)) => {
            let file = format!("sim/{}.vtu", record.id);
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
            produced.warnings.extend(outcome.warnings);
            record.file = Some(file);
        }
    }
    produced.facts = facts(&record)?;
    Ok(produced)
}

/// The rest mesh of a case.
///
/// # Errors
/// Rejected when it is missing or damaged.
pub fn rest_mesh(case: &Case) -> Result<TetMesh, Failure> {
    Ok(vtu::decode(&case.read(REST_MESH)?, REST_MESH).reject()?.mesh)
}
