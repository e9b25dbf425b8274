//! What an estimate or a prediction may change of a body, and the scale of its numbers.

use super::fluid_levels::FluidLevels;
use super::{LogPrior, Scale};
use crate::experiment::sample::Tissue;
use crate::material::law::Shape;
use nalgebra::Vector3;
use std::sync::Arc;

/// Name of the part of the fluid that has drained.
const DRAINED: &str = "part of the fluid that has drained";

/// Something the estimate may change.
#[derive(Clone, Debug, PartialEq)]
pub enum Unknown {
    /// Shear modulus of a tissue at rest, Pa.
    ShearModulus(Tissue),
    /// What else the tissue's law has, its shear modulus held; the law says what that is.
    Shape(Tissue, &'static Shape),
    /// Poisson's ratio of all tissue: ln(lambda / mu), shear moduli held.
    PoissonRatio,
    /// Effective density of all tissue, kg/m3.
    Density,
    /// Pressure on the facets of a set, Pa: `loads.pressure` of this index, in the direction given there.
    Pressure(usize),
    /// Room before the wall of this number of the scenario's `contact`, mm.
    Gap(usize),
    /// Level of the fluid of `loads.csf`, mm; the number is the level itself.
    CsfLevel,
    /// Part of the fluid of `loads.csf` that has drained, by these levels: the logarithm of its odds.
    Drained(Arc<FluidLevels>),
    /// Turn of gravity (an angle, not a logarithm) about one of the two axes across the direction given.
    GravityTurn(Turn),
}

/// One of the two axes across gravity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// The axis nearest to left-right.
    Nodding,
    /// Across gravity and the other axis.
    Rolling,
}

/// The axes of [`Turn`]: across gravity and each other, the first as near to x as can be.
pub(super) fn axes_across(gravity: Vector3<f64>) -> [Vector3<f64>; 2] {
    let down = gravity.try_normalize(0.0).unwrap_or_else(|| -Vector3::z());
    let nearest = if down.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let nodding = (nearest - down * down.dot(&nearest)).normalize();
    [nodding, down.cross(&nodding)]
}

impl Unknown {
    /// What its number stands for.
    pub fn scale(&self) -> Scale {
        match self {
            Self::GravityTurn(_) => Scale::Angle,
            Self::Shape(_, shape) => shape.scale.into(),
            Self::CsfLevel => Scale::Plain,
            Self::Drained(_) => Scale::Share,
            Self::PoissonRatio => Scale::LameRatio,
            Self::ShearModulus(_) | Self::Density | Self::Pressure(_) | Self::Gap(_) => Scale::Logarithm,
        }
    }

    /// The tissue whose stiffness it is.
    pub fn tissue(&self) -> Option<String> {
        match self {
            Self::ShearModulus(tissue) => Some(tissue.name.clone()),
            _ => None,
        }
    }

    /// What is known of it beforehand.
    pub fn prior(&self, mean: f64, sd: f64) -> LogPrior {
        LogPrior { name: self.name(), mean, sd: Some(sd), scale: self.scale(), correlation: Vec::new(), average: None }
    }

    /// How tables name it.
    pub fn name(&self) -> String {
        match self {
            Self::ShearModulus(tissue) => format!("shear_modulus_pa of {}", tissue.name),
            Self::Shape(tissue, shape) => format!("{} of {}", shape.name, tissue.name),
            Self::PoissonRatio => "Poisson's ratio".to_owned(),
            Self::Density => "effective density_kg_per_m3".to_owned(),
            Self::Pressure(n) => format!("pressure_pa number {}", n + 1),
            Self::CsfLevel => "level_mm of the fluid".to_owned(),
            Self::Drained(_) => DRAINED.to_owned(),
            Self::Gap(_) => "gap_mm between cortex and skull".to_owned(),
            Self::GravityTurn(Turn::Nodding) => "turn of gravity about left-right, degrees".to_owned(),
            Self::GravityTurn(Turn::Rolling) => "turn of gravity across that, degrees".to_owned(),
        }
    }
}
