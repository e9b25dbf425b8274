//! A tissue's law and parameters as files name them.

use super::volume::lame_lambda_pa;
use super::{CompressionResistance, Hyperelastic, MooneyRivlin, NeoHookean, Ogden, OgdenTerm, StableNeoHookean};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One `[materials.NAME]` table: `law = "neo-hookean"` and its parameters.
///
/// ```
/// use hgm::material::law::Material;
/// let grey: Material = toml::from_str("law = 'neo-hookean'\nshear_modulus_pa = 1370.0\npoisson_ratio = 0.45").unwrap();
/// assert_eq!(grey, Material::neo_hookean(1370.0, 0.45));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "law", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Material {
    /// [`NeoHookean`].
    NeoHookean {
        /// mu, Pa.
        shear_modulus_pa: f64,
        /// nu.
        poisson_ratio: f64,
        /// k of [`CompressionResistance`], Pa; 0: none.
        #[serde(default)]
        compression_resistance_pa: f64,
        /// Volume ratio below which the energy is continued so that inverted elements can recover; 0: never.
        #[serde(default)]
        inversion_threshold: f64,
    },
    /// [`MooneyRivlin`].
    MooneyRivlin {
        /// C1, Pa.
        c1_pa: f64,
        /// C2, Pa.
        c2_pa: f64,
        /// nu.
        poisson_ratio: f64,
        /// k of [`CompressionResistance`], Pa; 0: none.
        #[serde(default)]
        compression_resistance_pa: f64,
        /// Volume ratio below which the energy is continued so that inverted elements can recover; 0: never.
        #[serde(default)]
        inversion_threshold: f64,
    },
    /// [`Ogden`].
    Ogden {
        /// The terms, each `{ alpha, mu_pa }`.
        terms: Vec<OgdenTerm>,
        /// nu.
        poisson_ratio: f64,
        /// k of [`CompressionResistance`], Pa; 0: none.
        #[serde(default)]
        compression_resistance_pa: f64,
        /// Volume ratio below which the energy is continued so that inverted elements can recover; 0: never.
        #[serde(default)]
        inversion_threshold: f64,
    },
    /// [`StableNeoHookean`].
    StableNeoHookean {
        /// mu, Pa.
        shear_modulus_pa: f64,
        /// nu.
        poisson_ratio: f64,
        /// k of [`CompressionResistance`], Pa; 0: none.
        #[serde(default)]
        compression_resistance_pa: f64,
    },
}

/// A material parameter that sensitivities may be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// All stress-like parameters together, nu held.
    Stiffness,
    /// nu, moduli held.
    PoissonRatio,
    /// C1 of Mooney-Rivlin, nu held.
    C1,
    /// C2 of Mooney-Rivlin, nu held.
    C2,
    /// mu of one Ogden term, nu held.
    OgdenMu(usize),
    /// alpha of one Ogden term, nu held.
    OgdenAlpha(usize),
}

/// Why parameters are not a material.
#[derive(Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum MaterialError {
    #[error("`{key}` is {value}: it must be a finite number")]
    NotFinite { key: String, value: f64 },
    #[error("the shear modulus is {value} Pa: it must be positive ({rule})")]
    Modulus { value: f64, rule: &'static str },
    #[error("`poisson_ratio` is {value}: it must be at least 0 and below 0.5 (0.49 is nearly incompressible)")]
    PoissonRatio { value: f64 },
    #[error("`terms` is empty: an Ogden law needs at least one term with alpha other than 0")]
    OgdenTerms,
    #[error("`{key}` is {value}: it must be {rule}")]
    Range { key: &'static str, value: f64, rule: &'static str },
}

impl Material {
    /// The paper's law.
    pub fn neo_hookean(shear_modulus_pa: f64, poisson_ratio: f64) -> Self {
        let (compression_resistance_pa, inversion_threshold) = (0.0, 0.0);
        Self::NeoHookean { shear_modulus_pa, poisson_ratio, compression_resistance_pa, inversion_threshold }
    }

    /// Shear modulus at rest, Pa.
    pub fn shear_modulus_pa(&self) -> f64 {
        match self {
            Self::NeoHookean { shear_modulus_pa, .. } | Self::StableNeoHookean { shear_modulus_pa, .. } => {
                *shear_modulus_pa
            }
            Self::MooneyRivlin { c1_pa, c2_pa, .. } => 2.0 * (c1_pa + c2_pa),
            Self::Ogden { terms, .. } => terms.iter().map(|t| 0.5 * t.mu_pa * t.alpha).sum(),
        }
    }

    /// nu.
    pub fn poisson_ratio(&self) -> f64 {
        match self {
            Self::NeoHookean { poisson_ratio, .. }
            | Self::StableNeoHookean { poisson_ratio, .. }
            | Self::MooneyRivlin { poisson_ratio, .. }
            | Self::Ogden { poisson_ratio, .. } => *poisson_ratio,
        }
    }

    /// lambda, Pa.
    pub fn lame_lambda_pa(&self) -> f64 {
        lame_lambda_pa(self.shear_modulus_pa(), self.poisson_ratio())
    }

    /// k of the compression resistance, Pa.
    pub fn compression_resistance_pa(&self) -> f64 {
        match self {
            Self::NeoHookean { compression_resistance_pa, .. }
            | Self::StableNeoHookean { compression_resistance_pa, .. }
            | Self::MooneyRivlin { compression_resistance_pa, .. }
            | Self::Ogden { compression_resistance_pa, .. } => *compression_resistance_pa,
        }
    }

    /// Volume ratio below which the energy is continued; 0: never.
    pub fn inversion_threshold(&self) -> f64 {
        match self {
            Self::NeoHookean { inversion_threshold, .. }
            | Self::MooneyRivlin { inversion_threshold, .. }
            | Self::Ogden { inversion_threshold, .. } => *inversion_threshold,
            Self::StableNeoHookean { .. } => 0.0,
        }
    }

    /// The law itself.
    pub fn law(&self) -> Box<dyn Hyperelastic> {
        self.law_with_lambda(self.lame_lambda_pa())
    }

    /// The law with another lambda (Pa): 0 leaves what an element with its own pressure evaluates point by point.
    pub fn law_with_lambda(&self, lame_lambda_pa: f64) -> Box<dyn Hyperelastic> {
        let inversion_threshold = self.inversion_threshold();
        let inner: Box<dyn Hyperelastic> = match self {
            Self::NeoHookean { shear_modulus_pa, .. } => {
                Box::new(NeoHookean { shear_modulus_pa: *shear_modulus_pa, lame_lambda_pa, inversion_threshold })
            }
            Self::MooneyRivlin { c1_pa, c2_pa, .. } => {
                Box::new(MooneyRivlin { c1_pa: *c1_pa, c2_pa: *c2_pa, lame_lambda_pa, inversion_threshold })
            }
            Self::Ogden { terms, .. } => Box::new(Ogden { terms: terms.clone(), lame_lambda_pa, inversion_threshold }),
            Self::StableNeoHookean { shear_modulus_pa, .. } => {
                Box::new(StableNeoHookean { shear_modulus_pa: *shear_modulus_pa, lame_lambda_pa })
            }
        };
        match self.compression_resistance_pa() {
            0.0 => inner,
            resistance_pa => Box::new(CompressionResistance { inner, resistance_pa }),
        }
    }

    /// The parameters of this law.
    pub fn parameters(&self) -> Vec<Parameter> {
        match self {
            Self::NeoHookean { .. } | Self::StableNeoHookean { .. } => {
                vec![Parameter::Stiffness, Parameter::PoissonRatio]
            }
            Self::MooneyRivlin { .. } => {
                vec![Parameter::Stiffness, Parameter::PoissonRatio, Parameter::C1, Parameter::C2]
            }
            Self::Ogden { terms, .. } => [Parameter::Stiffness, Parameter::PoissonRatio]
                .into_iter()
                .chain((0..terms.len()).flat_map(|t| [Parameter::OgdenMu(t), Parameter::OgdenAlpha(t)]))
                .collect(),
        }
    }

    /// The same material with one parameter multiplied by `factor`; `None` when the law has no such parameter.
    pub fn scaled(&self, parameter: Parameter, factor: f64) -> Option<Self> {
        let mut material = self.clone();
        match (&mut material, parameter) {
            (
                Self::NeoHookean { shear_modulus_pa, compression_resistance_pa, .. }
                | Self::StableNeoHookean { shear_modulus_pa, compression_resistance_pa, .. },
                Parameter::Stiffness,
            ) => {
                *shear_modulus_pa *= factor;
                *compression_resistance_pa *= factor;
            }
            (Self::MooneyRivlin { c1_pa, c2_pa, compression_resistance_pa, .. }, Parameter::Stiffness) => {
                *c1_pa *= factor;
                *c2_pa *= factor;
                *compression_resistance_pa *= factor;
            }
            (Self::Ogden { terms, compression_resistance_pa, .. }, Parameter::Stiffness) => {
                for term in terms {
                    term.mu_pa *= factor;
                }
                *compression_resistance_pa *= factor;
            }
            (
                Self::NeoHookean { poisson_ratio, .. }
                | Self::StableNeoHookean { poisson_ratio, .. }
                | Self::MooneyRivlin { poisson_ratio, .. }
                | Self::Ogden { poisson_ratio, .. },
                Parameter::PoissonRatio,
            ) => *poisson_ratio *= factor,
            (Self::MooneyRivlin { c1_pa, .. }, Parameter::C1) => *c1_pa *= factor,
            (Self::MooneyRivlin { c2_pa, .. }, Parameter::C2) => *c2_pa *= factor,
            (Self::Ogden { terms, .. }, Parameter::OgdenMu(t)) => terms.get_mut(t)?.mu_pa *= factor,
            (Self::Ogden { terms, .. }, Parameter::OgdenAlpha(t)) => terms.get_mut(t)?.alpha *= factor,
            _ => return None,
        }
        Some(material)
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// [`MaterialError`] names the first key that breaks a rule.
    pub fn check(&self) -> Result<(), MaterialError> {
        let finite = |key: &str, value: f64| {
            if value.is_finite() { Ok(()) } else { Err(MaterialError::NotFinite { key: key.to_owned(), value }) }
        };
        let rule = match self {
            Self::NeoHookean { shear_modulus_pa, .. } | Self::StableNeoHookean { shear_modulus_pa, .. } => {
                finite("shear_modulus_pa", *shear_modulus_pa)?;
                "`shear_modulus_pa`"
            }
            Self::MooneyRivlin { c1_pa, c2_pa, .. } => {
                finite("c1_pa", *c1_pa)?;
                finite("c2_pa", *c2_pa)?;
                "2 (`c1_pa` + `c2_pa`)"
            }
            Self::Ogden { terms, .. } => {
                for (n, term) in terms.iter().enumerate() {
                    finite(&format!("alpha` of term `{}", n + 1), term.alpha)?;
                    finite(&format!("mu_pa` of term `{}", n + 1), term.mu_pa)?;
                }
                if terms.is_empty() || terms.iter().any(|t| t.alpha == 0.0) {
                    return Err(MaterialError::OgdenTerms);
                }
                "half the sum of `mu_pa` times `alpha`"
            }
        };
        finite("poisson_ratio", self.poisson_ratio())?;
        finite("compression_resistance_pa", self.compression_resistance_pa())?;
        finite("inversion_threshold", self.inversion_threshold())?;
        let value = self.shear_modulus_pa();
        if value <= 0.0 {
            return Err(MaterialError::Modulus { value, rule });
        }
        let value = self.poisson_ratio();
        if !(0.0..0.5).contains(&value) {
            return Err(MaterialError::PoissonRatio { value });
        }
        let value = self.compression_resistance_pa();
        if value < 0.0 {
            return Err(MaterialError::Range { key: "compression_resistance_pa", value, rule: "0 or more" });
        }
        let value = self.inversion_threshold();
        if !(0.0..1.0).contains(&value) {
            return Err(MaterialError::Range { key: "inversion_threshold", value, rule: "at least 0 and below 1" });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_parameters_are_refused_by_key() {
        assert!(matches!(Material::neo_hookean(-1.0, 0.45).check(), Err(MaterialError::Modulus { .. })));
        assert!(matches!(Material::neo_hookean(1e3, 0.5).check(), Err(MaterialError::PoissonRatio { .. })));
        assert!(matches!(Material::neo_hookean(f64::NAN, 0.4).check(), Err(MaterialError::NotFinite { .. })));
        let text = "law = 'neo-hookean'\nshear_modulus_pa = 1.0\npoisson_ratio = 0.4\nyoung = 3.0";
        assert!(toml::from_str::<Material>(text).unwrap_err().to_string().contains("young"));
    }

    #[test]
    fn every_parameter_a_law_lists_can_be_scaled() {
        let terms = vec![OgdenTerm { alpha: -4.0, mu_pa: -500.0 }];
        let ogden: Material =
            Material::Ogden { terms, poisson_ratio: 0.45, compression_resistance_pa: 0.0, inversion_threshold: 0.0 };
        for parameter in ogden.parameters() {
            assert_ne!(ogden.scaled(parameter, 1.1), Some(ogden.clone()));
            assert!(ogden.scaled(parameter, 1.1).is_some());
        }
        assert_eq!(ogden.scaled(Parameter::C1, 2.0), None);
    }
}
