//! Options that several commands share, and how they become a layer of settings over the settings file.

use super::Failure;
use crate::experiment::population::PopulationPrior;
use crate::experiment::predict::Head;
use crate::experiment::resection::GravityFrame;
use crate::manual::help::laws;
use crate::material::StudyKind;
use crate::material::generative::GenerativeModel;
use crate::material::meta_model::MetaModel;
use crate::mesh::engine::{Engine, LabelEdge, MeshSize, WallEdge};
use crate::workflow::cohort::population_prior;
use crate::workflow::{Goal, Inputs, Layer};
use serde::de::DeserializeOwned;
use std::path::PathBuf;

/// Headings of options in help and man pages.
pub const MASKS: &str = "Masks";
const MESH: &str = "Mesh";
const MATERIAL: &str = "Material";

/// A word that stands for a value of a type, by the names that the settings file has for them.
pub fn word<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_value(text.into()).map_err(|e| e.to_string())
}

/// Engine and size of a mesh.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct MeshOptions {
    /// Mesh engine [default: lattice, which is part of hgm]
    #[arg(long, help_heading = MESH, value_name = "ENGINE", value_parser = engine)]
    pub mesher: Option<Engine>,
    /// Target number of tetrahedra (within 15 %)
    #[arg(long, help_heading = MESH, value_name = "N")]
    pub cells: Option<usize>,
    /// Target edge length in mm, instead of a number of tetrahedra
    #[arg(long, help_heading = MESH, value_name = "MM", conflicts_with = "cells")]
    pub edge_mm: Option<f64>,
    /// Edges inside a label, times the target: white_matter=1.5 (again for more labels)
    #[arg(long, help_heading = MESH, value_name = "LABEL=FACTOR")]
    pub edge_in: Vec<LabelEdge>,
    /// Edges at the wall of a label, times the target, and the distance to which that counts: ventricle=0.5@8
    #[arg(long, help_heading = MESH, value_name = "LABEL=FACTOR@MM")]
    pub edge_near: Vec<WallEdge>,
}

impl MeshOptions {
    /// What they set.
    pub fn over(&self, flags: &mut Layer) {
        flags.set("mesh.engine", self.mesher);
        flags.set("mesh.size", self.cells.map(MeshSize::Cells).or(self.edge_mm.map(MeshSize::EdgeMm)));
        flags.list("mesh.sizing.labels", &self.edge_in);
        flags.list("mesh.sizing.walls", &self.edge_near);
    }
}

fn engine(name: &str) -> Result<Engine, String> {
    Engine::named(name)
        .ok_or_else(|| format!("no engine `{name}`: say {} (`hgm doctor` tells which are installed)", Engine::names()))
}

/// The generative model behind a prior.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct PriorModelOption {
    /// What the prior is made of: the paper's Gaussian process, or what the spread between studies and people leaves to expect of a
    /// person (study-level) [default: a person for estimates, the paper for levels and predictions]
    #[arg(long, help_heading = MATERIAL, value_name = "published|study-level")]
    model: Option<GenerativeModel>,
}

impl PriorModelOption {
    /// What it sets.
    pub fn over(&self, flags: &mut Layer) {
        flags.set("prior.model", self.model);
    }
}

/// The prior.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct PriorOptions {
    #[command(flatten)]
    model: PriorModelOption,
    /// Whose studies the samples come from: mre, linear or hyperelastic [default: hyperelastic]
    #[arg(long, help_heading = MATERIAL, value_name = "KIND")]
    study: Option<StudyKind>,
    #[arg(long, help_heading = MATERIAL, value_name = "LAW", help = laws("The law fitted to every sample: {} [default: neo-hookean]"))]
    law: Option<MetaModel>,
}

impl PriorOptions {
    /// What they set.
    pub fn over(&self, flags: &mut Layer) {
        self.model.over(flags);
        flags.set("prior.study", self.study);
        flags.set("prior.law", self.law);
    }
}

/// What a cohort says of people.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct PopulationOption {
    /// The priors of the moduli from a cohort (population.toml of `hgm bids ... group`) instead of the literature; `none`: the
    /// literature's again
    #[arg(long, help_heading = MATERIAL, value_name = "FILE")]
    pub population: Option<PathBuf>,
}

impl PopulationOption {
    /// What it sets; a cohort that is one study's worth changes nothing, and that is said.
    pub fn over(&self, flags: &mut Layer) -> Result<(), Failure> {
        let Some(path) = &self.population else { return Ok(()) };
        let literature = path.as_os_str() == "none";
        let prior = if literature { PopulationPrior::none() } else { population_prior(path)? };
        if prior.parameters.is_empty() && !literature {
            tracing::warn!(
                "{}: the literature's priors stand (one study's worth, or more patients are silent than teach)",
                path.display()
            );
        }
        flags.set("prior.population", Some(prior));
        Ok(())
    }
}

/// Samples of one task or of all.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct TaskOption {
    /// Nine samples of every task of the generative model (elastography, linear, hyperelastic; grey, white, healthy brain;
    /// abnormal tissue where there is a lesion) instead of one task's; one tissue only. A case goes back to one task's with --study
    /// or --tissues 2
    #[arg(long, help_heading = MATERIAL, conflicts_with = "study")]
    every_task: bool,
}

impl TaskOption {
    /// What it sets; one task's samples are asked for by their study or by two tissues.
    pub fn over(&self, prior: &PriorOptions, tissues: Option<u8>, flags: &mut Layer) {
        let one = prior.study.is_some() || tissues == Some(2);
        flags.set("resection.every_task", (self.every_task || one).then_some(self.every_task));
    }
}

/// What is asked of a prepared patient.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct AnalysisOptions {
    /// 1: the whole brain one material; 2: grey and white matter apart (81 samples)
    #[arg(long, help_heading = MATERIAL, value_parser = clap::value_parser!(u8).range(1..=2))]
    pub tissues: Option<u8>,
    /// How the patient lay for the second scan: supine, prone, left, right, sitting, or the way down as x,y,z of that scanner (RAS+)
    /// [default: as `[resection]` has it: upright]
    #[arg(long, value_name = "WAY", allow_hyphen_values = true)]
    pub head: Option<Head>,
    #[command(flatten)]
    pub prior: PriorOptions,
    /// Estimate the moduli with their intervals instead of trying the prior's samples; on 160,000 tetrahedra unless
    /// --cells or --edge-mm says otherwise
    #[arg(long, help_heading = MATERIAL, conflicts_with = "every_task")]
    pub estimate: bool,
    #[command(flatten)]
    pub tasks: TaskOption,
    #[command(flatten)]
    pub population: PopulationOption,
}

impl AnalysisOptions {
    /// What they set.
    pub fn over(&self, flags: &mut Layer) {
        flags.set("resection.tissues", self.tissues);
        flags.set("resection.gravity_frame", self.head.map(|_| GravityFrame::Post));
        flags.set("resection.gravity_m_per_s2", self.head.map(|head| head.gravity_in_scanner_m_per_s2()));
        self.tasks.over(&self.prior, self.tissues, flags);
        self.prior.over(flags);
    }

    /// How far the job goes.
    pub fn goal(&self) -> Goal {
        if self.estimate { Goal::Estimate } else { Goal::Sweep }
    }
}

/// What is known of the pre-operative scan beside the scan: wins over what would be computed.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct OwnLabels {
    /// A label map of the pre-operative scan made by another tool (.nii.gz, .mgz): wins over the computed labels, and the
    /// scans may then have another contrast than T1
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    pub dseg: Option<PathBuf>,
    /// Whose numbers the label map holds [default: found out from the numbers]
    #[arg(long, help_heading = MASKS, value_name = "freesurfer|synthseg|charm|gif|muse|hgm|FILE.tsv", requires = "dseg")]
    pub labels: Option<String>,
    /// The pose of the pre-operative scan by hand: a rigid transform to the MNI frame (4x4 text in RAS, or .tfm)
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    pub pose: Option<PathBuf>,
    /// The same, roughly: the pose is looked for from there instead of from many starts
    #[arg(long, help_heading = MASKS, value_name = "FILE", conflicts_with_all = ["pose", "dseg"])]
    pub pose_start: Option<PathBuf>,
    /// A brain mask of your own, in the pre-operative scan's grid (wins over the computed one)
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    pub brain_mask: Option<PathBuf>,
}

/// Masks that win over the computed ones. Each may be in the grid of either scan.
#[derive(Clone, Debug, Default, clap::Args)]
#[allow(clippy::struct_field_names, reason = "the options' names")]
struct OwnMasks {
    /// A mask of the lateral and third ventricles before the operation, in the grid of either scan (wins over the computed one)
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    ventricle_mask: Option<PathBuf>,
    /// A mask of the cavity, in the grid of either scan (wins over the computed one)
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    cavity_mask: Option<PathBuf>,
    /// A mask of the resected tissue, in the grid of either scan (wins over the computed one)
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    resected_mask: Option<PathBuf>,
}

/// A pair and where its case goes.
#[derive(Clone, Debug, clap::Args)]
// Flattened into `run`, whose own group of arguments has this name.
#[group(skip)]
pub struct PairOptions {
    /// Pre-operative T1 (.nii or .nii.gz)
    pre: PathBuf,
    /// Post-operative T1 (.nii or .nii.gz)
    post: PathBuf,
    /// The case folder
    #[arg(short, long, value_name = "CASE", default_value = "case")]
    pub output: PathBuf,
    #[command(flatten)]
    own: OwnLabels,
    #[command(flatten)]
    masks: OwnMasks,
    #[command(flatten)]
    pub mesh: MeshOptions,
}

impl PairOptions {
    /// The files.
    pub fn inputs(&self) -> Inputs {
        let OwnLabels { dseg, labels, pose, pose_start, brain_mask } = self.own.clone();
        let OwnMasks { ventricle_mask, cavity_mask, resected_mask } = self.masks.clone();
        let (pre, post) = (self.pre.clone(), self.post.clone());
        let inputs = Inputs { pre, post, dseg, labels, pose, pose_start, brain_mask, ..Inputs::default() };
        Inputs { ventricle_mask, cavity_mask, resected_mask, ..inputs }
    }
}
