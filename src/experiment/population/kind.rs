//! How patients were estimated: what their moduli must have in common to be of one population.

use crate::material::meta_model::MetaModel;
use std::fmt;

/// Figures nearer to each other than this share are the same.
const SAME: f64 = 1e-6;

/// What moduli go with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kind {
    /// The law.
    pub law: MetaModel,
    /// The effective density, or the tissue's own beside a fluid, kg/m3.
    pub density_kg_per_m3: f64,
    /// Poisson's ratio; none where an older file does not tell it, nor then the fluid.
    pub poisson_ratio: Option<f64>,
    /// The part of a given fluid that has drained; none without a fluid.
    pub drained: Option<f64>,
}

impl Kind {
    /// Whether both were estimated under the same density.
    pub fn weighs_as(&self, other: &Self) -> bool {
        same(self.density_kg_per_m3, other.density_kg_per_m3)
    }

    /// Whether both had the same Poisson's ratio, as far as both tell it.
    pub fn gives_as(&self, other: &Self) -> bool {
        self.poisson_ratio.zip(other.poisson_ratio).is_none_or(|(a, b)| same(a, b))
    }

    /// Whether both were in the same fluid, as far as both tell it.
    pub fn floats_as(&self, other: &Self) -> bool {
        match (self.drained, other.drained) {
            (Some(a), Some(b)) => same(a, b),
            (None, None) => true,
            _ => !(self.tells_fluid() && other.tells_fluid()),
        }
    }

    /// Whether moduli of both are alike.
    pub fn is_as(&self, other: &Self) -> bool {
        self.law == other.law && self.weighs_as(other) && self.gives_as(other) && self.floats_as(other)
    }

    /// Whether the fluid, or that there was none, is known. Whoever writes the one writes the other.
    pub fn tells_fluid(&self) -> bool {
        self.poisson_ratio.is_some() || self.drained.is_some()
    }

    /// The fluid in words.
    pub fn fluid(&self) -> String {
        self.drained.map_or_else(|| "no fluid".to_owned(), |part| format!("a part of {part} of the fluid drained"))
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "with the law {} under {} kg/m3", self.law, self.density_kg_per_m3)?;
        if let Some(ratio) = self.poisson_ratio {
            write!(f, ", Poisson's ratio {ratio}")?;
        }
        if self.tells_fluid() {
            write!(f, ", {}", self.fluid())?;
        }
        Ok(())
    }
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * b.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(poisson_ratio: Option<f64>, drained: Option<f64>) -> Kind {
        Kind { law: MetaModel::NEO_HOOKEAN, density_kg_per_m3: 1040.0, poisson_ratio, drained }
    }

    #[test]
    fn patients_under_another_poissons_ratio_or_fluid_are_of_another_kind_unless_an_older_file_does_not_tell() {
        let known = kind(Some(0.45), Some(0.3));
        for other in [kind(Some(0.49), Some(0.3)), kind(Some(0.45), Some(0.5)), kind(Some(0.45), None)] {
            assert!(!known.is_as(&other) && !other.is_as(&known), "{other}");
        }
        let dry = kind(Some(0.45), None);
        for (a, b) in [(known, known), (dry, dry), (kind(None, None), known), (kind(None, None), dry)] {
            assert!(a.is_as(&b) && b.is_as(&a), "{a} {b}");
        }
    }
}
