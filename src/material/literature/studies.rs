//! Tables of studies: the embedded one and a user's own, in the same columns.
//!
//! Columns by name, in any order: `id` (a number; an id of the embedded table replaces that row), `region`, `kind`,
//! `form`, `parameters`, `stretch_min`, `stretch_max` are needed; `study`, `citation`, `tension_parameters`, `points`
//! (`100`, or `50+50` when tension has its own parameters), `confidence`, `note`, `published_form` and
//! `published_parameters` may be left out. Moduli are in Pa, stretches and the rest without unit.

use super::model::{Branches, Curves, LiteratureModel, Points};
use crate::material::csv::{self, CsvError, Row};
use crate::material::form::{Form, FormError};
use crate::material::task::{Task, TaskError, stretches};
use thiserror::Error;

/// A table of studies that cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StudyError {
    /// Not a table.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// No rows below the header.
    #[error("the table has no rows: give a header line and at least one study")]
    Empty,
    /// A needed column is not in the header.
    #[error(
        "line {line}: the column `{column}` is missing from the header; add it (`hgm gp studies` prints a table with \
         all columns)"
    )]
    MissingColumn {
        /// Line of the header.
        line: usize,
        /// The column.
        column: &'static str,
    },
    /// A column nobody knows, or one that stands twice.
    #[error("line {line}: the header's column `{column}` is unknown or stands twice; columns are {known}")]
    UnknownColumn {
        /// Line of the header.
        line: usize,
        /// The column.
        column: String,
        /// Known columns.
        known: String,
    },
    /// A row that cannot be used.
    #[error("line {line}: {refusal}")]
    Row {
        /// Line of the row.
        line: usize,
        /// Why.
        refusal: Refusal,
    },
}

/// Why a row is refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Refusal {
    /// Wrong number of cells.
    #[error("{found} cells where the header has {expected} columns; quote a cell that holds a comma")]
    Cells {
        /// Cells in the row.
        found: usize,
        /// Columns.
        expected: usize,
    },
    /// Not a number.
    #[error("{column} is `{value}`, which is not {meant}")]
    Value {
        /// Column.
        column: &'static str,
        /// Cell.
        value: String,
        /// What is meant.
        meant: &'static str,
    },
    /// Kind or region.
    #[error(transparent)]
    Task(#[from] TaskError),
    /// Form or parameters.
    #[error(transparent)]
    Form(#[from] FormError),
    /// The window is empty, turned around or beyond what stretches can be.
    #[error("the stretch window {low} to {high} is no window: it needs 0 < stretch_min < stretch_max <= 10")]
    Window {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Two parameter sets without stretch 1 inside.
    #[error("tension_parameters need a window around stretch 1, and {low} to {high} is not")]
    SplitWindow {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// The energy is not a number somewhere in the window.
    #[error("the energy is not finite at stretch {stretch}: the window leaves the form's domain, narrow it")]
    OutsideDomain {
        /// Where.
        stretch: f64,
    },
    /// The energy is negative somewhere in the window.
    #[error("the energy is {energy_pa} Pa at stretch {stretch}: negative; narrow the window or correct the parameters")]
    NegativeEnergy {
        /// Where.
        stretch: f64,
        /// W there, Pa.
        energy_pa: f64,
    },
    /// The energy is zero everywhere.
    #[error("the energy is zero over the whole window: the parameters describe no solid; correct them")]
    NoEnergy,
    /// An id twice in one table.
    #[error("id {0} stands twice in this table")]
    RepeatedId(u32),
}

const COLUMNS: [&str; 15] = [
    "id",
    "study",
    "citation",
    "region",
    "kind",
    "form",
    "parameters",
    "tension_parameters",
    "stretch_min",
    "stretch_max",
    "points",
    "confidence",
    "published_form",
    "published_parameters",
    "note",
];
const NEEDED: [&str; 7] = ["id", "region", "kind", "form", "parameters", "stretch_min", "stretch_max"];

/// Reads a table of studies.
///
/// # Errors
/// [`StudyError`], with the line of the first row that cannot be used and the reason.
pub fn read_studies(bytes: &[u8]) -> Result<Vec<LiteratureModel>, StudyError> {
    let rows = csv::rows(bytes)?;
    let (header, rows) = rows.split_first().ok_or(StudyError::Empty)?;
    for (position, column) in header.cells.iter().enumerate() {
        if !COLUMNS.contains(&column.as_str()) || header.cells[..position].contains(column) {
            let known = COLUMNS.join(", ");
            return Err(StudyError::UnknownColumn { line: header.line, column: column.clone(), known });
        }
    }
    if let Some(column) = NEEDED.into_iter().find(|needed| !header.cells.iter().any(|c| c == needed)) {
        return Err(StudyError::MissingColumn { line: header.line, column });
    }
    if rows.is_empty() {
        return Err(StudyError::Empty);
    }
    let mut models: Vec<LiteratureModel> = Vec::new();
    for row in rows {
        let refuse = |refusal| StudyError::Row { line: row.line, refusal };
        let model = read_row(&header.cells, row).map_err(refuse)?;
        if models.iter().any(|earlier| earlier.id == model.id) {
            return Err(refuse(Refusal::RepeatedId(model.id)));
        }
        models.push(model);
    }
    Ok(models)
}

fn read_row(header: &[String], row: &Row) -> Result<LiteratureModel, Refusal> {
    if row.cells.len() != header.len() {
        return Err(Refusal::Cells { found: row.cells.len(), expected: header.len() });
    }
    let cell = |column: &str| header.iter().position(|c| c == column).map_or("", |i| row.cells[i].as_str());
    let number = |column: &'static str| match cell(column).parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(Refusal::Value { column, value: cell(column).to_owned(), meant: "a finite number" }),
    };
    let id = cell("id").parse().map_err(|_| Refusal::Value {
        column: "id",
        value: cell("id").to_owned(),
        meant: "a whole number, 0 or more",
    })?;
    let task = Task { kind: cell("kind").parse()?, region: cell("region").parse()? };
    let [low, high] = [number("stretch_min")?, number("stretch_max")?];
    if !(low > 0.0 && low < high && high <= 10.0) {
        return Err(Refusal::Window { low, high });
    }
    let form = Form::parse(cell("form"), cell("parameters"))?;
    let split = !cell("tension_parameters").is_empty();
    if split && !(low < 1.0 && high > 1.0) {
        return Err(Refusal::SplitWindow { low, high });
    }
    let branches = if split {
        Branches::Split { compression: form, tension: Form::parse(cell("form"), cell("tension_parameters"))? }
    } else {
        Branches::One(form)
    };
    let published = match (cell("published_form"), cell("published_parameters")) {
        ("", "") => None,
        (form, parameters) => {
            let form = if form.is_empty() { cell("form") } else { form };
            let parameters = if parameters.is_empty() { cell("parameters") } else { parameters };
            Some(Branches::One(Form::parse(form, parameters)?))
        }
    };
    let model = LiteratureModel {
        id,
        study: cell("study").to_owned(),
        citation: cell("citation").to_owned(),
        task,
        branches,
        published,
        stretch_window: [low, high],
        points: read_points(cell("points"), split)?,
        confidence: cell("confidence").to_owned(),
        note: cell("note").to_owned(),
    };
    check_energy(&model)?;
    Ok(model)
}

fn read_points(cell: &str, split: bool) -> Result<Points, Refusal> {
    let refuse = || Refusal::Value {
        column: "points",
        value: cell.to_owned(),
        meant: "a count from 2 to 10000, or two with a plus between when tension has its own parameters",
    };
    let count = |word: &str| word.trim().parse().ok().filter(|n| (2..=10_000).contains(n)).ok_or_else(refuse);
    match (cell.split_once('+'), split) {
        _ if cell.is_empty() => Ok(if split { Points::Halves(50, 50) } else { Points::Whole(100) }),
        (Some((below, above)), true) => Ok(Points::Halves(count(below)?, count(above)?)),
        (None, false) => Ok(Points::Whole(count(cell)?)),
        _ => Err(refuse()),
    }
}

/// Rounding leaves tiny negative energies near rest where large coefficients cancel.
const NEGATIVE_ROUNDING: f64 = 1e-9;

fn check_energy(model: &LiteratureModel) -> Result<(), Refusal> {
    let [low, high] = model.stretch_window;
    // Besides the grid, a finer one: a pole or a negative stretch between two points is a bad model all the same.
    let fine = stretches(low, high, 401);
    for curves in [Curves::Corrected, Curves::Published] {
        let curve = model.curve(curves);
        let fine = fine.iter().map(|l| (*l, model.energy_pa(curves, *l)));
        let on_grid = curve.stretches.iter().copied().zip(curve.energies_pa.iter().copied());
        // The published program's Laksari curve dips below zero between two grid points; only its grid is used.
        let all: Vec<(f64, f64)> =
            if curves == Curves::Published { on_grid.collect() } else { on_grid.chain(fine).collect() };
        let largest = all.iter().fold(0.0, |m: f64, (_, w)| m.max(w.abs()));
        for (stretch, energy_pa) in all {
            if !energy_pa.is_finite() {
                return Err(Refusal::OutsideDomain { stretch });
            }
            if energy_pa < -NEGATIVE_ROUNDING * largest {
                return Err(Refusal::NegativeEnergy { stretch, energy_pa });
            }
        }
        if largest == 0.0 {
            return Err(Refusal::NoEnergy);
        }
    }
    Ok(())
}

/// A table with a user's studies: those with the id of an existing row replace it, the others are added.
pub fn merge(mut table: Vec<LiteratureModel>, own: Vec<LiteratureModel>) -> Vec<LiteratureModel> {
    for model in own {
        match table.iter_mut().find(|row| row.id == model.id) {
            Some(row) => *row = model,
            None => table.push(model),
        }
    }
    table.sort_by_key(|row| row.id);
    table
}
