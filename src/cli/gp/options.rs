//! What the commands of the generative model share: studies, hyperparameters, the figures of a stage.

use crate::artefact::{Stage, StageError, StageOutcome};
use crate::cli::{Failure, Reject};
use crate::material::gp::Hyperparameters;
use crate::material::literature::{Curves, LiteratureModel, merge, read_studies, table};
use crate::workflow::{read_input, read_text};
use anyhow::Context;
use std::path::PathBuf;

/// Raised when this code changes its files.
pub const VERSION: u32 = 1;

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

/// Which hyperparameters.
#[derive(Clone, Debug, clap::Args)]
pub struct HyperparameterOptions {
    /// Hyperparameters made by `hgm gp fit` [default: the published ones]
    #[arg(long, value_name = "FILE")]
    pub hyperparameters: Option<PathBuf>,
}

/// Studies and the bytes they came from.
pub struct Studies {
    pub models: Vec<LiteratureModel>,
    pub curves: Curves,
    bytes: Option<Vec<u8>>,
}

impl StudyOptions {
    /// The embedded table with the user's rows.
    pub fn read(&self) -> Result<Studies, Failure> {
        let curves = if self.published { Curves::Published } else { Curves::Corrected };
        let Some(path) = &self.studies else { return Ok(Studies { models: table(), curves, bytes: None }) };
        let bytes = read_input(path)?;
        let own = read_studies(&bytes).with_context(|| path.display().to_string()).reject()?;
        Ok(Studies { models: merge(table(), own), curves, bytes: Some(bytes) })
    }
}

impl Studies {
    /// The stage with the user's table among its inputs.
    pub fn input(&self, stage: Stage) -> Stage {
        match &self.bytes {
            Some(bytes) => stage.input("studies", bytes),
            None => stage,
        }
    }
}

impl HyperparameterOptions {
    /// The user's hyperparameters, else the published ones.
    pub fn read(&self) -> Result<Hyperparameters, Failure> {
        let Some(path) = &self.hyperparameters else { return Ok(Hyperparameters::published()) };
        let name = path.display().to_string();
        Hyperparameters::from_toml(&read_text(path)?).with_context(|| name).reject()
    }
}

/// The figures of a stage: what it cannot compute is the input's fault, what it cannot write is not.
pub fn facts<E: std::error::Error + Send + Sync + 'static>(
    outcome: Result<StageOutcome, StageError<E>>,
) -> Result<serde_json::Value, Failure> {
    match outcome {
        Ok(outcome) => Ok(outcome.manifest.facts),
        Err(StageError::Compute(error)) => Err(Failure::Rejected(error.into())),
        Err(error) => Err(Failure::Failed(error.into())),
    }
}
