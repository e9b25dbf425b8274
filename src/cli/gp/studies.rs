//! `hgm gp studies`: the literature table.

use crate::cli::{Failure, Session};
use crate::material::literature::{LiteratureModel, STUDIES_CSV, citation, table};
use serde_json::{Value, json};

/// Print the literature table (CSV), whose columns a table of your own takes
///
/// Moduli are in Pa. A study whose id stands here replaces it, another id adds one. With --json each study comes with
/// its full citation.
///
/// Example: hgm gp studies > studies.csv
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    let studies = table();
    let study = |model: &LiteratureModel| -> Value {
        json!({
            "id": model.id, "study": model.study, "task": model.task.to_string(), "citation": citation(model),
            "stretch_window": model.stretch_window, "confidence": model.confidence, "note": model.note,
        })
    };
    session.emit(&studies.iter().map(study).collect::<Vec<_>>(), STUDIES_CSV)
}
