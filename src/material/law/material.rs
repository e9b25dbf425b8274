//! A tissue's law with its numbers, as files name them.

use super::LAWS;
use super::compression_resistance::CompressionResistance;
use super::definition::{Law, LawParameter, Role, Values, Volume};
use super::hyperelastic::Hyperelastic;
use super::stability::Stability;
use super::volume::lame_lambda_pa;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One `[materials.NAME]` table: `law = "neo-hookean"` and its parameters.
///
/// ```
/// use hgm::material::law::Material;
/// let grey: Material = toml::from_str("law = 'neo-hookean'\nshear_modulus_pa = 1370.0\npoisson_ratio = 0.45").unwrap();
/// assert_eq!(grey, Material::neo_hookean(1370.0, 0.45));
/// ```
#[derive(Clone, Debug)]
pub struct Material {
    pub(super) law: &'static dyn Law,
    /// In the order of the law's parameters; of a law of terms term by term.
    pub(super) values: Values,
    pub(super) poisson_ratio: f64,
    /// k of [`CompressionResistance`], Pa; 0: none.
    pub(super) compression_resistance_pa: f64,
    /// Volume ratio below which the energy is continued so that inverted elements can recover; 0: never.
    pub(super) inversion_threshold: f64,
}

/// A material parameter that sensitivities may be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// All stress-like parameters together, nu held.
    Stiffness,
    /// nu, moduli held.
    PoissonRatio,
    /// The law's own parameter of this place in its list, nu held; see [`Material::parameter`].
    Own(usize),
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
    #[error("`terms` is empty: the law `{law}` needs at least one term")]
    NoTerms { law: &'static str },
    #[error("`{key}` is {value}: it must be {rule}")]
    Range { key: String, value: f64, rule: &'static str },
}

impl Material {
    /// A law with its numbers, which are as many as [`Law::card`] asks for.
    pub fn new(law: &'static dyn Law, values: Values, poisson_ratio: f64) -> Self {
        Self { law, values, poisson_ratio, compression_resistance_pa: 0.0, inversion_threshold: 0.0 }
    }

    /// The same with another Poisson's ratio.
    #[must_use]
    pub fn with_poisson_ratio(self, poisson_ratio: f64) -> Self {
        Self { poisson_ratio, ..self }
    }

    /// The same with its energy continued below this volume ratio, so that inverted elements can recover; a law that is
    /// finite at every ratio, and one that is continued already, stay as they are.
    #[must_use]
    pub fn continued_below(self, volume_ratio: f64) -> Self {
        let needed = self.law.card().continued && self.inversion_threshold == 0.0;
        Self { inversion_threshold: if needed { volume_ratio } else { self.inversion_threshold }, ..self }
    }

    /// The paper's law.
    pub fn neo_hookean(shear_modulus_pa: f64, poisson_ratio: f64) -> Self {
        Self::new(&super::neo_hookean::Definition, vec![shear_modulus_pa], poisson_ratio)
    }

    /// The law of this name in files.
    pub fn law_named(name: &str) -> Option<&'static dyn Law> {
        LAWS.into_iter().find(|law| law.card().name == name)
    }

    /// The law's name in files.
    pub fn name(&self) -> &'static str {
        self.law.card().name
    }

    /// Shear modulus at rest, Pa.
    pub fn shear_modulus_pa(&self) -> f64 {
        self.law.shear_modulus_pa(&self.values)
    }

    /// nu.
    pub fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio
    }

    /// lambda, Pa.
    pub fn lame_lambda_pa(&self) -> f64 {
        lame_lambda_pa(self.shear_modulus_pa(), self.poisson_ratio)
    }

    /// k of the compression resistance, Pa.
    pub fn compression_resistance_pa(&self) -> f64 {
        self.compression_resistance_pa
    }

    /// Volume ratio below which the energy is continued; 0: never.
    pub fn inversion_threshold(&self) -> f64 {
        self.inversion_threshold
    }

    /// Over which stretches the law was measured, with the verdict there; `None` where it makes no claim.
    pub fn measured(&self) -> Option<([f64; 2], Stability)> {
        self.law.measured(&self.values)
    }

    /// The law itself.
    pub fn law(&self) -> Box<dyn Hyperelastic> {
        self.law_with_lambda(self.lame_lambda_pa())
    }

    /// The law with another lambda (Pa): 0 leaves what an element with its own pressure evaluates point by point.
    pub fn law_with_lambda(&self, lame_lambda_pa: f64) -> Box<dyn Hyperelastic> {
        let volume = Volume { lame_lambda_pa, inversion_threshold: self.inversion_threshold };
        let inner = self.law.solid(&self.values, volume);
        match self.compression_resistance_pa {
            0.0 => inner,
            resistance_pa => Box::new(CompressionResistance { inner, resistance_pa }),
        }
    }

    /// What stands in each place of the numbers: the parameter, and of which term (from 0) where there are terms.
    pub(super) fn places(&self) -> impl Iterator<Item = (&'static LawParameter, Option<usize>)> + '_ {
        let card = self.law.card();
        let count = card.parameters.len();
        (0..self.values.len()).map(move |n| (&card.parameters[n % count], card.of_terms.then_some(n / count)))
    }

    /// The parameters of this law.
    pub fn parameters(&self) -> Vec<Parameter> {
        let scalable = self.places().enumerate().filter(|(_, (p, _))| !matches!(p.role, Role::Word(_)));
        let own = scalable.map(|(n, _)| Parameter::Own(n));
        [Parameter::Stiffness, Parameter::PoissonRatio].into_iter().chain(own).collect()
    }

    /// A parameter of the law by its name in files; of a law of terms that of a term (from 0).
    pub fn parameter(&self, name: &str, term: usize) -> Option<Parameter> {
        let found = self.places().position(|(p, of)| p.name == name && of.unwrap_or(0) == term);
        found.map(Parameter::Own)
    }

    /// Whether stresses are linear in a parameter.
    pub fn linear_in(&self, parameter: Parameter) -> bool {
        match parameter {
            Parameter::Stiffness => true,
            Parameter::PoissonRatio => false,
            Parameter::Own(n) => self.places().nth(n).is_some_and(|(p, _)| matches!(p.role, Role::Modulus)),
        }
    }

    /// The same material with one parameter multiplied by `factor`; `None` when the law has no such parameter.
    pub fn scaled(&self, parameter: Parameter, factor: f64) -> Option<Self> {
        let mut material = self.clone();
        match parameter {
            Parameter::Stiffness => {
                for (n, (p, _)) in self.places().enumerate() {
                    if matches!(p.role, Role::Modulus) {
                        material.values[n] *= factor;
                    }
                }
                material.compression_resistance_pa *= factor;
            }
            Parameter::PoissonRatio => material.poisson_ratio *= factor,
            Parameter::Own(n) => {
                self.places().nth(n).filter(|(p, _)| !matches!(p.role, Role::Word(_)))?;
                material.values[n] *= factor;
            }
        }
        Some(material)
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// [`MaterialError`] names the first key that breaks a rule.
    pub fn check(&self) -> Result<(), MaterialError> {
        let card = self.law.card();
        let key = |p: &LawParameter, term: Option<usize>| {
            term.map_or_else(|| p.name.to_owned(), |t| format!("{}` of term `{}", p.name, t + 1))
        };
        let finite = |key: String, value: f64| {
            if value.is_finite() { Ok(()) } else { Err(MaterialError::NotFinite { key, value }) }
        };
        if card.of_terms && self.values.is_empty() {
            return Err(MaterialError::NoTerms { law: card.name });
        }
        for ((p, term), value) in self.places().zip(&self.values) {
            finite(key(p, term), *value)?;
        }
        finite("poisson_ratio".to_owned(), self.poisson_ratio)?;
        finite("compression_resistance_pa".to_owned(), self.compression_resistance_pa)?;
        finite("inversion_threshold".to_owned(), self.inversion_threshold)?;
        let value = self.shear_modulus_pa();
        // A modulus that is no number comes of a parameter out of its range, which is named below.
        if value <= 0.0 {
            return Err(MaterialError::Modulus { value, rule: card.shear_modulus });
        }
        for ((p, term), value) in self.places().zip(&self.values) {
            if !(p.range.holds)(*value) {
                return Err(MaterialError::Range { key: key(p, term), value: *value, rule: p.range.rule });
            }
        }
        let value = self.poisson_ratio;
        if !(0.0..0.5).contains(&value) {
            return Err(MaterialError::PoissonRatio { value });
        }
        let range = |key: &str, value: f64, rule| Err(MaterialError::Range { key: key.to_owned(), value, rule });
        let value = self.compression_resistance_pa;
        if value < 0.0 {
            return range("compression_resistance_pa", value, "0 or more");
        }
        let value = self.inversion_threshold;
        if !(0.0..1.0).contains(&value) {
            return range("inversion_threshold", value, "at least 0 and below 1");
        }
        Ok(())
    }
}

impl PartialEq for Material {
    fn eq(&self, other: &Self) -> bool {
        let numbers = |m: &Self| (m.poisson_ratio, m.compression_resistance_pa, m.inversion_threshold);
        self.name() == other.name() && self.values == other.values && numbers(self) == numbers(other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Material {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn bad_parameters_are_refused_by_key() {
        assert!(matches!(Material::neo_hookean(-1.0, 0.45).check(), Err(MaterialError::Modulus { .. })));
        assert!(matches!(Material::neo_hookean(1e3, 0.5).check(), Err(MaterialError::PoissonRatio { .. })));
        assert!(matches!(Material::neo_hookean(f64::NAN, 0.4).check(), Err(MaterialError::NotFinite { .. })));
        let ogden = |terms: &str| read(&format!("law = 'ogden'\nterms = [{terms}]\npoisson_ratio = 0.4"));
        assert_eq!(ogden("").check(), Err(MaterialError::NoTerms { law: "ogden" }));
        let error = ogden("{ alpha = 2.0, mu_pa = 1.0 }, { alpha = 0.0, mu_pa = 1.0 }").check().unwrap_err();
        assert_eq!(error.to_string(), "`alpha` of term `2` is 0: it must be other than 0");
    }

    #[test]
    fn every_law_resists_small_changes_of_volume_as_poissons_ratio_says() {
        for law in LAWS {
            for (values, poisson_ratio) in law.examples().into_iter().flat_map(|v| [(v.clone(), 0.3), (v, 0.45)]) {
                let material = Material::new(law, values, poisson_ratio);
                let (mu, lambda) = (material.shear_modulus_pa(), material.lame_lambda_pa());
                let tangent = material.law().tangent_pa(&nalgebra::Matrix3::zeros());
                // The second invariant of the published Mooney-Rivlin law resists a change of volume itself.
                let of_invariant = if law.card().name == "mooney-rivlin" { 4.0 * material.values[1] } else { 0.0 };
                // Columns first: (0, 4) is dP11/dF22, which is lambda, (0, 0) dP11/dF11.
                let seen = [tangent[(0, 4)], tangent[(0, 0)] - 2.0 * mu].map(|l| l - of_invariant);
                assert!(
                    seen.iter().all(|l| (l - lambda).abs() < 1e-9 * lambda.max(mu)),
                    "{law:?}: {seen:?}, not {lambda}"
                );
            }
        }
    }

    #[test]
    fn every_parameter_a_law_lists_can_be_scaled() {
        for law in LAWS {
            for values in law.examples() {
                let material = Material::new(law, values, 0.45);
                for parameter in material.parameters() {
                    let scaled = material.scaled(parameter, 1.1).unwrap();
                    assert_ne!(scaled, material, "{law:?} {parameter:?}");
                }
                assert_eq!(material.scaled(Parameter::Own(material.values.len()), 2.0), None);
            }
        }
    }

    #[test]
    fn forces_are_linear_in_what_is_called_a_modulus() {
        let h = nalgebra::Matrix3::new(0.02, -0.01, 0.03, 0.01, -0.02, 0.01, -0.02, 0.01, 0.03);
        for law in LAWS {
            for values in law.examples() {
                let material = Material::new(law, values, 0.4);
                let stress = material.law().first_piola_kirchhoff_pa(&h);
                let twice = material.scaled(Parameter::Stiffness, 2.0).unwrap().law().first_piola_kirchhoff_pa(&h);
                assert!((twice - stress * 2.0).abs().max() <= 1e-12 * twice.abs().max(), "{law:?}");
                for parameter in material.parameters().into_iter().filter(|p| material.linear_in(*p)) {
                    let at = |f: f64| material.scaled(parameter, f).unwrap().law().first_piola_kirchhoff_pa(&h);
                    let bend = at(0.8) + at(1.2) - stress * 2.0;
                    assert!(bend.abs().max() <= 1e-9 * stress.abs().max(), "{law:?} {parameter:?}: {bend}");
                }
            }
        }
    }
}
