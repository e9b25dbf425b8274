//! Options that several commands share, and how they become a layer of settings over the settings file.

use super::Failure;
use crate::experiment::population::PopulationPrior;
use crate::material::StudyKind;
use crate::material::generative::GenerativeModel;
use crate::material::meta_model::MetaModel;
use crate::mesh::engine::{Engine, LabelEdge, MeshSize, WallEdge};
use crate::segment::label;
use crate::workflow::cohort::population_prior;
use crate::workflow::{Goal, Inputs};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::PathBuf;

/// Headings of options in help and man pages.
const MASKS: &str = "Masks";
const MESH: &str = "Mesh";
const MATERIAL: &str = "Material";

/// The settings that were given as options: the last layer.
#[derive(Clone, Debug, Default)]
pub struct Flags(pub toml::Table);

impl Flags {
    /// Sets what was given: `path` is the table and the setting, with dots between.
    pub fn set(&mut self, path: &str, value: Option<impl Serialize>) {
        let Some(value) = value.and_then(|value| toml::Value::try_from(value).ok()) else { return };
        let mut names: Vec<&str> = path.split('.').collect();
        let last = names.pop().unwrap_or_default();
        let mut table = &mut self.0;
        for name in names {
            let below = table.entry(name).or_insert_with(|| toml::Value::Table(toml::Table::new()));
            let toml::Value::Table(below) = below else { return };
            table = below;
        }
        table.insert(last.to_owned(), value);
    }

    /// The same for an option that is there or not.
    pub fn switch(&mut self, path: &str, on: bool) {
        self.set(path, on.then_some(true));
    }

    /// The same for an option that may be given again and again.
    pub fn list(&mut self, path: &str, values: &[impl Serialize]) {
        self.set(path, (!values.is_empty()).then_some(values));
    }
}

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
    #[arg(long, help_heading = MESH, value_name = "LABEL=FACTOR", value_parser = label_edge)]
    pub edge_in: Vec<LabelEdge>,
    /// Edges at the wall of a label, times the target, and the distance to which that counts: ventricle=0.5@8
    #[arg(long, help_heading = MESH, value_name = "LABEL=FACTOR@MM", value_parser = wall_edge)]
    pub edge_near: Vec<WallEdge>,
}

impl MeshOptions {
    /// What they set.
    pub fn over(&self, flags: &mut Flags) {
        flags.set("mesh.engine", self.mesher);
        flags.set("mesh.size", self.cells.map(MeshSize::Cells).or(self.edge_mm.map(MeshSize::EdgeMm)));
        flags.list("mesh.sizing.labels", &self.edge_in);
        flags.list("mesh.sizing.walls", &self.edge_near);
    }
}

fn label_edge(text: &str) -> Result<LabelEdge, String> {
    let read = || {
        let (label, factor) = text.split_once('=')?;
        Some(LabelEdge { label: label::number(label)?, factor: factor.parse().ok()? })
    };
    read().ok_or_else(|| format!("`{text}` is not LABEL=FACTOR, such as white_matter=1.5 or 3=1.5"))
}

fn wall_edge(text: &str) -> Result<WallEdge, String> {
    let read = || {
        let (label, rest) = text.split_once('=')?;
        let (factor, reach) = rest.split_once('@')?;
        Some(WallEdge { label: label::number(label)?, factor: factor.parse().ok()?, reach_mm: reach.parse().ok()? })
    };
    read().ok_or_else(|| format!("`{text}` is not LABEL=FACTOR@MM, such as ventricle=0.5@8 or 4=0.5@8"))
}

/// A help text with the names of the laws that can be fitted in place of `{}`.
pub fn laws(help: &str) -> String {
    let names = MetaModel::names();
    let (last, others) = names.split_last().map_or(("", &[][..]), |(last, others)| (*last, others));
    help.replace("{}", &format!("{} or {last}", others.join(", ")))
}

fn engine(name: &str) -> Result<Engine, String> {
    Engine::named(name)
        .ok_or_else(|| format!("no engine `{name}`: say {} (`hgm doctor` tells which are installed)", Engine::names()))
}

/// The generative model behind a prior.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct PriorModelOption {
    /// What the prior is made of: the paper's Gaussian process, or what the spread between studies and people leaves to expect of a
    /// person (study-level) [default: published]
    #[arg(long, help_heading = MATERIAL, value_name = "published|study-level")]
    model: Option<GenerativeModel>,
}

impl PriorModelOption {
    /// What it sets.
    pub fn over(&self, flags: &mut Flags) {
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
    pub fn over(&self, flags: &mut Flags) {
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
    population: Option<PathBuf>,
}

impl PopulationOption {
    /// Whether it was given.
    pub fn given(&self) -> bool {
        self.population.is_some()
    }

    /// What it sets; a cohort that is one study's worth changes nothing, and that is said.
    ///
    /// # Errors
    /// A file that cannot be read or is no population.
    pub fn over(&self, flags: &mut Flags) -> Result<(), Failure> {
        let Some(path) = &self.population else { return Ok(()) };
        if path.as_os_str() == "none" {
            flags.set("prior.population", Some(PopulationPrior::none()));
            return Ok(());
        }
        let prior = population_prior(path)?;
        if prior.parameters.is_empty() {
            tracing::warn!("{}: one study's worth: the literature's priors stand", path.display());
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
    pub fn over(&self, prior: &PriorOptions, tissues: Option<u8>, flags: &mut Flags) {
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
    pub fn over(&self, flags: &mut Flags) {
        flags.set("resection.tissues", self.tissues);
        self.tasks.over(&self.prior, self.tissues, flags);
        self.prior.over(flags);
    }

    /// How far the job goes.
    pub fn goal(&self) -> Goal {
        if self.estimate { Goal::Estimate } else { Goal::Sweep }
    }
}

/// Masks that win over the computed ones. Each may be in the grid of either scan.
#[derive(Clone, Debug, Default, clap::Args)]
#[allow(clippy::struct_field_names, reason = "the options' names")]
pub struct OwnMasks {
    /// A label map of the pre-operative scan made by another tool (.nii.gz, .mgz): wins over the computed labels, and the
    /// scans may then have another contrast than T1
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    dseg: Option<PathBuf>,
    /// Whose numbers the label map holds [default: found out from the numbers]
    #[arg(long, help_heading = MASKS, value_name = "freesurfer|synthseg|charm|gif|muse|hgm|FILE.tsv", requires = "dseg")]
    labels: Option<String>,
    /// The pose of the pre-operative scan by hand: a rigid transform to the MNI frame (4x4 text in RAS, or .tfm)
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    pose: Option<PathBuf>,
    /// A brain mask of your own, in the pre-operative scan's grid (wins over the computed one)
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    brain_mask: Option<PathBuf>,
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
    masks: OwnMasks,
    #[command(flatten)]
    pub mesh: MeshOptions,
}

impl PairOptions {
    /// The files.
    pub fn inputs(&self) -> Inputs {
        let OwnMasks { dseg, labels, pose, brain_mask, ventricle_mask, cavity_mask, resected_mask } =
            self.masks.clone();
        let (pre, post) = (self.pre.clone(), self.post.clone());
        let prediction = None;
        Inputs { pre, post, dseg, labels, pose, brain_mask, ventricle_mask, cavity_mask, resected_mask, prediction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::Settings;

    #[test]
    fn sizes_are_read_by_name_or_number_of_the_label() {
        let wall = WallEdge { label: label::VENTRICLE, factor: 0.5, reach_mm: 8.0 };
        assert_eq!([wall_edge("ventricle=0.5@8"), wall_edge("4=0.5@8")], [Ok(wall), Ok(wall)]);
        assert_eq!(label_edge("white_matter=1.5"), Ok(LabelEdge { label: label::WHITE_MATTER, factor: 1.5 }));
        for text in ["ventricle", "ventricle=0.5", "falx=0.5@8", "4=half@8", "300=0.5@8"] {
            assert!(wall_edge(text).unwrap_err().contains("ventricle=0.5@8"), "{text}");
        }
        assert!(label_edge("3=").unwrap_err().contains("white_matter=1.5"));
    }

    #[test]
    fn options_win_over_the_file_and_leave_the_rest_of_it() {
        let file =
            "[mesh]\nengine = \"gmsh\"\n[mesh.size]\nedge_mm = 3.0\n[prior]\npublished = true\n".parse().unwrap();
        let mut flags = Flags::default();
        MeshOptions { cells: Some(8000), ..MeshOptions::default() }.over(&mut flags);
        PriorOptions { law: Some(MetaModel::OGDEN), ..PriorOptions::default() }.over(&mut flags);
        let settings = Settings::resolve([&file, &flags.0]).unwrap();
        assert_eq!((settings.mesh.engine, settings.mesh.size), (Engine::GMSH, MeshSize::Cells(8000)));
        assert!(settings.prior.published && settings.prior.law == MetaModel::OGDEN);
    }
}
