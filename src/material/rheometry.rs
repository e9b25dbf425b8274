//! A laboratory's own uniaxial test: a table of stretch against nominal stress, true stress or strain energy density.
//!
//! The header names the quantity and its unit, as `stretch,nominal stress (kPa)` or `stretch,energy_pa`. Stretch has no
//! unit; `strain (%)` and `strain (-)` (engineering strain, l - 1) are taken as well, and a strain without a unit is
//! refused: per cent of a stiff sample's small strains look like parts of its length. The sample is taken as
//! incompressible: true stress is the nominal one times the stretch.

use super::csv::{self, CsvError, Row};
use super::meta_model::{Fit, FitError, MetaModel, MetaModelSettings, fit, fit_stress};
use serde::Serialize;
use thiserror::Error;

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measured {
    /// Force over undeformed area (first Piola-Kirchhoff), Pa.
    NominalStress,
    /// Strain energy density, Pa.
    Energy,
}

/// A test, in stretches and Pa.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rheometry {
    /// What was measured.
    pub measured: Measured,
    /// Stretches.
    pub stretches: Vec<f64>,
    /// Measured values, Pa.
    pub values_pa: Vec<f64>,
}

impl Rheometry {
    /// Whether the stress of either side of rest, tension and compression, has its sign but for noise.
    fn signs_hold(&self) -> bool {
        /// The part of all the work that may have the wrong sign on one side.
        const NOISE: f64 = 0.1;
        let work = |side: &dyn Fn(f64) -> bool| -> f64 {
            let points = self.stretches.iter().zip(&self.values_pa).filter(|(l, _)| side(**l));
            points.map(|(l, value)| (l - 1.0) * value).sum()
        };
        let (pressed, pulled) = (work(&|l| l < 1.0), work(&|l| l > 1.0));
        let all = pressed.abs() + pulled.abs();
        pressed + pulled >= 0.0 && pressed.min(pulled) >= -NOISE * all
    }
}

/// A table that is no test.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RheometryError {
    /// Not a table.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// Compression measured as positive.
    #[error(
        "the stress is negative where the tissue is stretched and positive where it is compressed: give tension as positive, compression \
         as negative"
    )]
    Sign,
    /// Nothing below the header.
    #[error("the table has no rows: give a header such as `stretch,nominal stress (kPa)` and one row a point")]
    Empty,
    /// Not one stretch and one measured column.
    #[error(
        "line {line}: the header `{header}` does not name one stretch and one measured column with its unit; \
         write for example `stretch,nominal stress (kPa)`, `stretch,true stress (Pa)` or `stretch,energy (Pa)`"
    )]
    Header {
        /// Line of the header.
        line: usize,
        /// Its text.
        header: String,
    },
    /// A measured column without a known unit.
    #[error("line {line}: the column `{column}` names no unit that is known; write (Pa), (kPa) or (MPa)")]
    Unit {
        /// Line of the header.
        line: usize,
        /// The column.
        column: String,
    },
    /// A row of another width.
    #[error(
        "line {line}: {found} cells where the header has {expected}; give one cell for each column (decimals with a \
         point, not a comma)"
    )]
    Cells {
        /// Line.
        line: usize,
        /// Cells found.
        found: usize,
        /// Cells in the header.
        expected: usize,
    },
    /// Not a number.
    #[error("line {line}: {column} is `{value}`, which is not a finite number; write decimals with a point")]
    NotANumber {
        /// Line.
        line: usize,
        /// Column.
        column: String,
        /// Cell.
        value: String,
    },
    /// A stretch that cannot be.
    #[error("line {line}: the stretch is {stretch}; it must be above 0 and at most 10 (1 is at rest; is it a strain?)")]
    Stretch {
        /// Line.
        line: usize,
        /// It.
        stretch: f64,
    },
    /// A strain whose header has no unit.
    #[error(
        "line {line}: the column `{column}` names no unit that is known: write `strain (%)` for per cent, `strain (-)` where 1 is twice the length"
    )]
    StrainUnit {
        /// Line of the header.
        line: usize,
        /// The column.
        column: String,
    },
    /// An energy below zero.
    #[error(
        "line {line}: the energy is {energy_pa} Pa; a strain energy is zero at rest and positive elsewhere; correct \
         the value, or name the column by what it is (`nominal stress (Pa)`)"
    )]
    NegativeEnergy {
        /// Line.
        line: usize,
        /// It, Pa.
        energy_pa: f64,
    },
}

#[derive(Clone, Copy, PartialEq)]
enum Quantity {
    Stretch,
    Strain,
    NominalStress,
    TrueStress,
    Energy,
}

/// A column's quantity and the factor to its unit here.
fn column(name: &str) -> Option<(Quantity, Option<f64>)> {
    let lower = name.to_lowercase().replace('_', " ");
    let bracket = lower.find(['(', '[']);
    let (words, unit) = match bracket {
        Some(at) => (&lower[..at], lower[at + 1..].trim_end().trim_end_matches([')', ']']).trim()),
        // A unit as the last word, as in `stress_kpa`.
        None => lower.rsplit_once(' ').filter(|(_, last)| factor(last).is_some()).unwrap_or((&lower, "")),
    };
    let quantity = match words.trim() {
        "stretch" | "lambda" => Quantity::Stretch,
        "strain" | "engineering strain" => Quantity::Strain,
        "stress" | "nominal stress" | "engineering stress" | "first piola-kirchhoff stress" => Quantity::NominalStress,
        "true stress" | "cauchy stress" => Quantity::TrueStress,
        "energy" | "strain energy" | "strain energy density" | "energy density" => Quantity::Energy,
        _ => return None,
    };
    let factor = match (quantity, unit) {
        (Quantity::Stretch, "" | "-" | "1") | (Quantity::Strain, "-" | "1") => Some(1.0),
        (Quantity::Strain, "%") => Some(0.01),
        (Quantity::Stretch | Quantity::Strain, _) => None,
        _ => factor(unit),
    };
    Some((quantity, factor))
}

/// Pa in a unit of stress or energy density.
fn factor(unit: &str) -> Option<f64> {
    match unit {
        "pa" | "j/m3" | "j/m^3" | "n/m2" | "n/m^2" => Some(1.0),
        "kpa" | "kj/m3" | "kj/m^3" => Some(1e3),
        "mpa" | "n/mm2" | "n/mm^2" => Some(1e6),
        _ => None,
    }
}

/// Reads a test.
///
/// # Errors
/// [`RheometryError`] with the line.
pub fn read_rheometry(bytes: &[u8]) -> Result<Rheometry, RheometryError> {
    let rows = csv::rows(bytes)?;
    let (header, rows) = rows.split_first().ok_or(RheometryError::Empty)?;
    let line = header.line;
    let no_header = || RheometryError::Header { line, header: header.cells.join(",") };
    let mut deformation = None;
    let mut measured = None;
    // Other columns (time, temperature) may stand beside.
    for (index, name) in header.cells.iter().enumerate() {
        let Some((quantity, factor)) = column(name) else { continue };
        let factor = factor.ok_or_else(|| match quantity {
            Quantity::Strain => RheometryError::StrainUnit { line, column: name.clone() },
            _ => RheometryError::Unit { line, column: name.clone() },
        })?;
        let slot = match quantity {
            Quantity::Stretch | Quantity::Strain => &mut deformation,
            _ => &mut measured,
        };
        if slot.replace((index, quantity, factor)).is_some() {
            return Err(no_header());
        }
    }
    let (Some(deformation), Some(value)) = (deformation, measured) else { return Err(no_header()) };
    if rows.is_empty() {
        return Err(RheometryError::Empty);
    }
    let measured = if value.1 == Quantity::Energy { Measured::Energy } else { Measured::NominalStress };
    let mut test = Rheometry { measured, stretches: Vec::new(), values_pa: Vec::new() };
    for row in rows {
        let line = row.line;
        if row.cells.len() != header.cells.len() {
            return Err(RheometryError::Cells { line, found: row.cells.len(), expected: header.cells.len() });
        }
        let extension = number(row, header, deformation.0)? * deformation.2;
        let stretch = if deformation.1 == Quantity::Stretch { extension } else { 1.0 + extension };
        if !(stretch > 0.0 && stretch <= 10.0) {
            return Err(RheometryError::Stretch { line, stretch });
        }
        let mut value_pa = number(row, header, value.0)? * value.2;
        match value.1 {
            Quantity::TrueStress => value_pa /= stretch,
            Quantity::Energy if value_pa < 0.0 => {
                return Err(RheometryError::NegativeEnergy { line, energy_pa: value_pa });
            }
            _ => {}
        }
        test.stretches.push(stretch);
        test.values_pa.push(value_pa);
    }
    if test.measured == Measured::NominalStress && !test.signs_hold() {
        return Err(RheometryError::Sign);
    }
    Ok(test)
}

fn number(row: &Row, header: &Row, index: usize) -> Result<f64, RheometryError> {
    match row.cells[index].parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(RheometryError::NotANumber {
            line: row.line,
            column: header.cells[index].clone(),
            value: row.cells[index].clone(),
        }),
    }
}

/// Fits a law to a test: in stress to stresses, in ln(W + offset) to energies.
///
/// # Errors
/// [`FitError`] when the points cannot determine the law.
pub fn fit_rheometry(model: MetaModel, test: &Rheometry, settings: &MetaModelSettings) -> Result<Fit, FitError> {
    match test.measured {
        Measured::NominalStress => fit_stress(model, &test.stretches, &test.values_pa, settings),
        Measured::Energy => {
            let targets: Vec<f64> = test.values_pa.iter().map(|w| (w + settings.log_offset_pa).ln()).collect();
            fit(model, &test.stretches, &targets, settings)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::task::stretches;

    const LAW: (MetaModel, [f64; 2]) = (MetaModel::MOONEY_RIVLIN, [140.0, 166.5]);

    fn table(header: &str, row: impl Fn(f64) -> (f64, f64)) -> String {
        let line = |l: f64| {
            let (x, y) = row(l);
            format!("{x},{y}\n")
        };
        format!("{header}\n") + &stretches(0.8, 1.2, 21).into_iter().map(line).collect::<String>()
    }

    #[test]
    fn the_same_law_comes_out_whatever_was_measured_and_in_which_unit() {
        let (model, parameters) = LAW;
        let stress = |l: f64| model.stress_pa(&parameters, l);
        let energy = |l: f64| model.energy_pa(&parameters, l);
        let tables = [
            table("stretch,nominal stress (Pa)", |l| (l, stress(l))),
            table("stretch,stress_kpa", |l| (l, stress(l) / 1e3)),
            table("Strain [%],Engineering stress [kPa]", |l| ((l - 1.0) * 100.0, stress(l) / 1e3)),
            table("strain (-),true stress (kPa)", |l| (l - 1.0, stress(l) * l / 1e3)),
            table("lambda [-],energy (Pa)", |l| (l, energy(l))),
            table("stretch,strain_energy_density_kPa", |l| (l, energy(l) / 1e3)),
        ];
        for text in tables {
            let fit = fit_rheometry(model, &read_rheometry(text.as_bytes()).unwrap(), &MetaModelSettings::default());
            for (found, expected) in fit.unwrap().parameters.iter().zip(parameters) {
                assert!((found / expected - 1.0).abs() < 1e-5, "{}: {found}", text.lines().next().unwrap());
            }
        }
    }

    #[test]
    fn other_columns_may_stand_beside() {
        let test = read_rheometry(b"time (s),stretch,stress (kPa)\n0,1.0,0\n1,1.1,0.2\n").unwrap();
        assert_eq!((test.stretches, test.values_pa), (vec![1.0, 1.1], vec![0.0, 200.0]));
    }

    #[test]
    fn malformed_tables_are_refused_with_line_and_remedy() {
        let cases: [(&[u8], &str); 16] = [
            (b"stretch,stress (Pa)\n1.0,0\n0.9,100\n0.8,300\n", "tension as positive"),
            (b"stretch,stress (Pa)\n0.9,90\n0.95,40\n1.1,120\n1.2,300\n", "tension as positive"),
            (
                b"strain,stress (Pa)\n0,0\n8,70\n",
                "line 1: the column `strain` names no unit that is known: write `strain (%)`",
            ),
            (
                b"strain,stress (Pa)\n0,0\n0.8,70\n",
                "line 1: the column `strain` names no unit that is known: write `strain (%)`",
            ),
            (b"", "no rows"),
            (b"stretch,stress (kPa)\n", "no rows"),
            (b"stretch,stress\n1,2\n", "line 1: the column `stress` names no unit"),
            (b"stretch,stress (psi)\n1,2\n", "line 1: the column `stress (psi)` names no unit"),
            (b"stretch (mm),stress (Pa)\n1,2\n", "line 1: the column `stretch (mm)`"),
            (b"x,y\n1,2\n", "line 1: the header `x,y`"),
            (b"stretch,stress (Pa),energy (Pa)\n1,2,3\n", "line 1: the header"),
            (b"stretch,stress (Pa)\n1,2\n1.1,2,3\n", "line 3: 3 cells"),
            (b"stretch,stress (Pa)\n1,zwei\n", "line 2: stress (Pa) is `zwei`"),
            (b"stretch,stress (Pa)\n-0.1,3\n", "line 2: the stretch is -0.1"),
            (b"stretch,energy (Pa)\n# remark\n1.1,-3\n", "line 3: the energy is -3 Pa"),
            (b"stretch,stress (Pa)\n\xff,1\n", "line 2: the text is not UTF-8"),
        ];
        for (bytes, reason) in cases {
            let message = read_rheometry(bytes).unwrap_err().to_string();
            assert!(message.contains(reason), "{message}");
        }
    }
}
