//! The embedded table.

use super::model::LiteratureModel;
use super::studies::read_studies;
use crate::material::csv;
use serde_json::{Value, json};

/// The embedded table itself, a pattern for a user's own.
pub const STUDIES_CSV: &str = include_str!("studies.csv");

/// The 73 models, in order of their number.
///
/// # Panics
/// Never: the embedded table is read by a test.
pub fn table() -> Vec<LiteratureModel> {
    read_studies(STUDIES_CSV.as_bytes()).expect("the embedded table is well formed")
}

/// The full citation of a model: from the embedded list, else the model's own words.
pub fn citation(model: &LiteratureModel) -> String {
    let rows = csv::rows(include_bytes!("citations.csv")).unwrap_or_default();
    let found = rows.into_iter().find(|row| row.cells[0] == model.citation);
    found.and_then(|row| row.cells.into_iter().nth(1)).unwrap_or_else(|| model.citation.clone())
}

/// A model as programs read it: what it speaks of, where it was published, the window it is trusted in.
pub fn listed(model: &LiteratureModel) -> Value {
    json!({
        "id": model.id, "study": model.study, "task": model.task.to_string(), "citation": citation(model),
        "stretch_window": model.stretch_window, "confidence": model.confidence, "note": model.note,
    })
}
