//! Options of every command on the generative model.

use crate::cli::Failure;
use crate::material::gp::Hyperparameters;
use crate::material::literature::Curves;
use crate::workflow::{Studies, hyperparameters};
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

/// Which hyperparameters.
#[derive(Clone, Debug, clap::Args)]
pub struct HyperparameterOptions {
    /// Hyperparameters made by `hgm gp fit` [default: the published ones]
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
    /// The user's hyperparameters, else the published ones.
    pub fn read(&self) -> Result<Hyperparameters, Failure> {
        Ok(hyperparameters(self.hyperparameters.as_deref())?)
    }
}
