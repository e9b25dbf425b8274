//! Options of every command on the generative model.

use crate::cli::{Failure, Session};
use crate::material::generative::GenerativeModel;
use crate::material::gp::Hyperparameters;
use crate::material::literature::Curves;
use crate::material::study_level::StudyLevelFile;
use crate::workflow::{GenerativeFiles, Studies, hyperparameters, study_level_file};
use anyhow::anyhow;
use serde_json::json;
use std::path::PathBuf;

/// Which studies.
#[derive(Clone, Debug, clap::Args)]
pub struct StudyOptions {
    /// A table of your own studies (CSV, columns as `hgm gp studies` prints them): added, or in place of those of their id
    #[arg(long, value_name = "FILE")]
    pub studies: Option<PathBuf>,
    /// The published program's choices: its curves of the two studies it mis-coded, its searches
    #[arg(long)]
    pub published: bool,
}

/// The generative model that is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct ModelOption {
    /// The paper's Gaussian process, or the model of how studies and people differ
    #[arg(long, value_name = "published|study-level", default_value = "published")]
    pub model: GenerativeModel,
}

/// Refuses an option that the chosen model has no use for.
pub fn only_with(given: bool, option: &str, model: &str) -> Result<(), Failure> {
    let refused = || anyhow!("{option} belongs to --model {model}: leave it out, or choose that model");
    if given { Err(Failure::Rejected(refused())) } else { Ok(()) }
}

/// Which hyperparameters.
#[derive(Clone, Debug, clap::Args)]
pub struct HyperparameterOptions {
    /// Hyperparameters made by `hgm gp fit` for the same model [default: the published ones; study-level: fitted at once]
    #[arg(long, value_name = "FILE")]
    pub hyperparameters: Option<PathBuf>,
}

impl StudyOptions {
    /// The embedded table with the user's rows.
    pub fn read(&self) -> Result<Studies, Failure> {
        let curves = if self.published { Curves::Published } else { Curves::Corrected };
        Ok(Studies::read(self.studies.as_deref(), curves)?)
    }
}

impl HyperparameterOptions {
    /// The same of the study-level model; none: it is fitted.
    pub fn study_level(&self) -> Result<Option<StudyLevelFile>, Failure> {
        Ok(self.hyperparameters.as_deref().map(study_level_file).transpose()?)
    }

    /// The user's hyperparameters, else the published ones.
    pub fn read(&self) -> Result<Hyperparameters, Failure> {
        Ok(hyperparameters(self.hyperparameters.as_deref())?)
    }
}

/// Tells what several files hold: the table for a terminal, where there is one, then their names.
pub fn emit(mut made: GenerativeFiles, session: &Session) -> Result<(), Failure> {
    let (text, files) = (made.take_text(), made.names());
    let lines: Vec<String> = Some(text).filter(|text| !text.is_empty()).into_iter().chain(files.clone()).collect();
    session.emit(&json!({ "files": files, "settings": made.settings, "result": made.facts }), &lines.join("\n"))
}
