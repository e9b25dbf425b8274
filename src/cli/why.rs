//! `hgm why`: what made a stage run again, or would.

use super::case::{
    Case, MeshOptions, ScanSums, anat_stage, mesh_stage, mni_from_gravity_frame, reference_stage, registration_stage,
    sample_stage,
};
use super::run::AnalysisOptions;
use super::session::read_input;
use super::{Failure, Reject, Session};
use crate::artefact::{Manifest, Stage, sha256_hex};
use crate::experiment::prior::samples_of_prior;
use crate::experiment::resection::ResectionSettings;
use anyhow::anyhow;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Which input or setting would make a stage of a case run again, if `hgm run` were called with these options
///
/// Example: hgm why case mesh --cells 100000
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run`, `hgm prep` or `hgm phantom`
    case: PathBuf,
    /// Only this stage: registration, anat, mesh, reference, sim-sample-04 ... [default: all]
    stage: Option<String>,
    /// The pre-operative scan, to see whether it is the one the case was made from
    #[arg(long, value_name = "FILE")]
    pre: Option<PathBuf>,
    /// The post-operative scan, likewise
    #[arg(long, value_name = "FILE")]
    post: Option<PathBuf>,
    #[command(flatten)]
    mesh: MeshOptions,
    #[command(flatten)]
    analysis: AnalysisOptions,
}

/// One stage and why it would run; nothing when it would be skipped.
#[derive(Debug, PartialEq, Serialize)]
struct Explained {
    stage: String,
    would_run: bool,
    reasons: Vec<String>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let case = Case::open(&args.case, session);
    let recorded = recorded(&case.folder);
    if recorded.is_empty() {
        return Err(Failure::Rejected(anyhow!(
            "{}: no stage has finished here; name a folder made by `hgm run`, `hgm prep` or `hgm phantom`",
            args.case.display()
        )));
    }
    let posed = posed(args, &case, session)?;
    let mut explained: Vec<Explained> =
        recorded.iter().map(|manifest| explain(manifest, &posed, &case.folder)).collect();
    // Samples that these options ask for and that are not there.
    let known = |stage: &&Stage| recorded.iter().all(|manifest| manifest.stage != stage.name());
    explained.extend(posed.iter().filter(known).map(|stage| entry(stage.name(), stage.why())));
    follow(&mut explained, &recorded);
    if let Some(wanted) = &args.stage {
        let names: Vec<String> = explained.iter().map(|e| e.stage.clone()).collect();
        explained.retain(|e| e.stage == *wanted);
        if explained.is_empty() {
            return Err(Failure::Rejected(anyhow!("no stage `{wanted}` in this case; it has {}", names.join(", "))));
        }
    }
    let line = |e: &Explained| {
        let what = if e.would_run { e.reasons.join("; ") } else { "up to date".to_owned() };
        format!("{:<16} {what}\n", e.stage)
    };
    let text: String = explained.iter().map(line).collect();
    session.emit(&serde_json::json!({ "stages": explained }), &text)
}

fn entry(stage: &str, reasons: Vec<String>) -> Explained {
    Explained { stage: stage.to_owned(), would_run: !reasons.is_empty(), reasons }
}

/// The manifests of a case, each after those of the stages it was made from.
fn recorded(folder: &Path) -> Vec<Manifest> {
    let entries = std::fs::read_dir(folder.join(".stages")).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let stages = names.filter_map(|name| name.strip_suffix(".manifest.json").map(str::to_owned));
    let mut waiting: Vec<Manifest> = stages.filter_map(|stage| Manifest::of_stage(folder, &stage)).collect();
    waiting.sort_by(|a, b| a.stage.cmp(&b.stage));
    let mut ordered: Vec<Manifest> = Vec::new();
    while !waiting.is_empty() {
        let ready =
            |m: &Manifest| !waiting.iter().any(|other| m.inputs.contains_key(&format!("stage {}", other.stage)));
        let next = waiting.iter().position(ready).unwrap_or(0);
        ordered.push(waiting.remove(next));
    }
    ordered
}

/// The stages as `hgm run` with these options would have them. What is not given (scans, masks) is taken as it was.
/// Empty for a phantom, whose stages are judged by what is on disk.
fn posed(args: &Args, case: &Case, session: &Session) -> Result<Vec<Stage>, Failure> {
    let of_stage = |name: &str| Manifest::of_stage(&case.folder, name);
    let (Some(registered), Some(segmented)) = (of_stage("registration"), of_stage("anat")) else {
        return Ok(Vec::new());
    };
    let sum = |given: &Option<PathBuf>, role: &str| -> Result<String, Failure> {
        match given {
            Some(path) => Ok(sha256_hex(&read_input(path)?)),
            None => Ok(registered.inputs.get(role).cloned().unwrap_or_default()),
        }
    };
    let sums = ScanSums { pre: sum(&args.pre, "pre")?, post: sum(&args.post, "post")? };
    let (registration, _) = registration_stage(case, &sums, session)?;
    let (mut anat, _) = anat_stage(case, &sums, &registered, session)?;
    for (role, sum) in segmented.inputs.iter().filter(|(role, _)| role.ends_with(" mask")) {
        anat = anat.input_sha256(role, sum);
    }
    let (mesh, ..) = mesh_stage(case, &args.analysis.mesh(&args.mesh, session), &segmented, session)?;
    let mut stages = vec![registration, anat, mesh, reference_stage(case, &segmented)];
    if let (Some(meshed), Some(observed), false) = (of_stage("mesh"), of_stage("reference"), args.analysis.estimate) {
        let mut settings: ResectionSettings = session.settings("resection")?;
        settings.tissues = args.analysis.tissues.map_or(settings.tissues, usize::from);
        let prior = args.analysis.prior.over(&session.settings("prior")?);
        let scenario = settings.scenario(&mni_from_gravity_frame(case, settings.gravity_frame)?);
        let tissues = settings.tissue_list();
        let list = samples_of_prior(&tissues, &settings.sd_levels, settings.poisson_ratio, &prior).reject()?;
        let after = [&meshed, &observed];
        stages.extend(list.iter().map(|sample| sample_stage(case, &scenario, &tissues, sample, &after)));
    }
    Ok(stages)
}

fn explain(manifest: &Manifest, posed: &[Stage], folder: &Path) -> Explained {
    let reasons = match posed.iter().find(|stage| stage.name() == manifest.stage) {
        Some(stage) => stage.why(),
        None => [manifest.changed_stages(folder), manifest.changed_outputs(folder)].concat(),
    };
    entry(&manifest.stage, reasons)
}

/// A stage whose earlier stage would run again may run again.
fn follow(explained: &mut [Explained], recorded: &[Manifest]) {
    for n in 0..explained.len() {
        let Some(manifest) = recorded.iter().find(|m| m.stage == explained[n].stage) else { continue };
        let before = |e: &&Explained| e.would_run && manifest.inputs.contains_key(&format!("stage {}", e.stage));
        let moved: Vec<String> = explained.iter().filter(before).map(|e| e.stage.clone()).collect();
        if explained[n].would_run || moved.is_empty() {
            continue;
        }
        explained[n].would_run = true;
        explained[n].reasons = vec![format!("it follows {}, unless that makes the same again", moved.join(" and "))];
    }
}
