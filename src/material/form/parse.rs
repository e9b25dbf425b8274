//! Forms from a table's words: a form name and parameters such as `mu_pa=-3543|-2723; alpha=1|-1`.

use super::any::Form;
use super::fung::{Demiray, FungMihai};
use super::gent::Gent;
use super::laksari::{Laksari, LaksariAsCoded};
use super::linear::Linear;
use super::mooney_rivlin::MooneyRivlin;
use super::neo_hookean::NeoHookean;
use super::ogden::{OgdenMihai, OgdenModified};
use super::reduced_polynomial::ReducedPolynomial;
use std::collections::BTreeMap;
use thiserror::Error;

/// The form names of tables, each with its parameters.
pub const FORM_NAMES: [(&str, &[&str]); 11] = [
    ("linear", &["E_pa", "nu"]),
    ("neo-hookean", &["mu_pa"]),
    ("mooney-rivlin", &["c1_pa", "c2_pa"]),
    ("ogden-mihai", &["mu_pa", "alpha"]),
    ("ogden-modified", &["mu_pa", "alpha"]),
    ("fung-mihai", &["c_pa", "alpha"]),
    ("demiray", &["mu_pa", "beta"]),
    ("gent", &["mu_pa", "jm"]),
    ("reduced-polynomial", &["c10_pa", "c30_pa"]),
    ("laksari", &["c10_pa", "c01_pa", "c11_pa", "k_pa", "a", "nu"]),
    ("laksari-as-coded", &["c10_pa", "c01_pa", "c11_pa", "k_pa", "a", "nu"]),
];

/// Why words are not a form.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FormError {
    /// No such form.
    #[error("form `{name}` is unknown: say one of {known}")]
    UnknownForm {
        /// The word.
        name: String,
        /// The known words.
        known: String,
    },
    /// A parameter of the form is not there.
    #[error(
        "form `{form}` needs `{parameter}`, which is missing: add `{parameter}=VALUE` to the parameters, with a \
         semicolon between"
    )]
    MissingParameter {
        /// The form.
        form: String,
        /// The parameter.
        parameter: String,
    },
    /// A parameter the form does not have.
    #[error("form `{form}` has no parameter `{parameter}`: its parameters are {known}")]
    UnknownParameter {
        /// The form.
        form: String,
        /// The parameter.
        parameter: String,
        /// The form's parameters.
        known: String,
    },
    /// Not `name=value; name=value`, or a name twice.
    #[error("parameters `{0}` are not written `name=value; name=value` with each name once")]
    Syntax(String),
    /// Not a finite number.
    #[error("parameter `{parameter}` is `{value}`, which is not a finite number")]
    NotANumber {
        /// The parameter.
        parameter: String,
        /// The word.
        value: String,
    },
    /// A list where one number is meant, or two lists of different lengths.
    #[error("parameter `{parameter}` has {found} values where the form takes {expected} (several stand as `1|2|3`)")]
    Count {
        /// The parameter.
        parameter: String,
        /// Values found.
        found: usize,
        /// Values meant.
        expected: usize,
    },
    /// A value the form cannot take.
    #[error("parameter `{parameter}` is {value}; it must be {rule}")]
    Range {
        /// The parameter.
        parameter: String,
        /// The value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
}

fn parse_parameters(text: &str) -> Result<BTreeMap<String, Vec<f64>>, FormError> {
    let mut parameters = BTreeMap::new();
    for item in text.split(';').map(str::trim).filter(|item| !item.is_empty()) {
        let (name, values) = item.split_once('=').ok_or_else(|| FormError::Syntax(text.to_owned()))?;
        let name = name.trim();
        let values = values.split('|').map(str::trim).map(|word| match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(FormError::NotANumber { parameter: name.to_owned(), value: word.to_owned() }),
        });
        if parameters.insert(name.to_owned(), values.collect::<Result<Vec<_>, _>>()?).is_some() {
            return Err(FormError::Syntax(text.to_owned()));
        }
    }
    Ok(parameters)
}

fn positive(parameter: &str, value: f64) -> Result<f64, FormError> {
    if value > 0.0 {
        Ok(value)
    } else {
        Err(FormError::Range { parameter: parameter.to_owned(), value, rule: "positive" })
    }
}

fn not_zero(parameter: &str, value: f64) -> Result<f64, FormError> {
    if value == 0.0 {
        return Err(FormError::Range { parameter: parameter.to_owned(), value, rule: "other than zero" });
    }
    Ok(value)
}

impl Form {
    /// The form of this name with parameters written `name=value; name=value`, lists as `1|2|3`.
    ///
    /// # Errors
    /// [`FormError`] names the word and what would be right.
    pub fn parse(name: &str, parameters: &str) -> Result<Self, FormError> {
        let unknown = || {
            let known = FORM_NAMES.map(|(known, _)| known).join(", ");
            FormError::UnknownForm { name: name.to_owned(), known }
        };
        let (_, wanted) = FORM_NAMES.iter().find(|(known, _)| *known == name).ok_or_else(unknown)?;
        let found = parse_parameters(parameters)?;
        if let Some(extra) = found.keys().find(|key| !wanted.contains(&key.as_str())) {
            return Err(FormError::UnknownParameter {
                form: name.to_owned(),
                parameter: extra.clone(),
                known: wanted.join(", "),
            });
        }
        let list = |key: &str| {
            found
                .get(key)
                .ok_or_else(|| FormError::MissingParameter { form: name.to_owned(), parameter: key.to_owned() })
        };
        let one = |key: &str| match list(key)?.as_slice() {
            [value] => Ok(*value),
            values => Err(FormError::Count { parameter: key.to_owned(), found: values.len(), expected: 1 }),
        };
        let poisson = |key: &str| match one(key)? {
            nu if nu > -1.0 && nu < 0.5 => Ok(nu),
            value => Err(FormError::Range { parameter: key.to_owned(), value, rule: "above -1 and below 0.5" }),
        };
        let laksari = || {
            Ok(Laksari {
                c10_pa: one("c10_pa")?,
                c01_pa: one("c01_pa")?,
                c11_pa: one("c11_pa")?,
                k_pa: one("k_pa")?,
                a: positive("a", one("a")?)?,
                poisson_ratio: poisson("nu")?,
            })
        };
        Ok(match name {
            "linear" => Self::Linear(Linear {
                young_modulus_pa: positive("E_pa", one("E_pa")?)?,
                poisson_ratio: poisson("nu")?,
            }),
            "neo-hookean" => Self::NeoHookean(NeoHookean { shear_modulus_pa: positive("mu_pa", one("mu_pa")?)? }),
            "mooney-rivlin" => Self::MooneyRivlin(MooneyRivlin { c1_pa: one("c1_pa")?, c2_pa: one("c2_pa")? }),
            "ogden-mihai" => {
                let (mu, alpha) = (list("mu_pa")?, list("alpha")?);
                if mu.len() != alpha.len() {
                    let (found, expected) = (alpha.len(), mu.len());
                    return Err(FormError::Count { parameter: "alpha".to_owned(), found, expected });
                }
                for a in alpha {
                    not_zero("alpha", *a)?;
                }
                Self::OgdenMihai(OgdenMihai { terms: mu.iter().copied().zip(alpha.iter().copied()).collect() })
            }
            "ogden-modified" => Self::OgdenModified(OgdenModified {
                shear_modulus_pa: positive("mu_pa", one("mu_pa")?)?,
                alpha: not_zero("alpha", one("alpha")?)?,
            }),
            "fung-mihai" => Self::FungMihai(FungMihai {
                c_pa: positive("c_pa", one("c_pa")?)?,
                alpha: positive("alpha", one("alpha")?)?,
            }),
            "demiray" => Self::Demiray(Demiray {
                shear_modulus_pa: positive("mu_pa", one("mu_pa")?)?,
                beta: positive("beta", one("beta")?)?,
            }),
            "gent" => Self::Gent(Gent {
                shear_modulus_pa: positive("mu_pa", one("mu_pa")?)?,
                jm: positive("jm", one("jm")?)?,
            }),
            "reduced-polynomial" => {
                Self::ReducedPolynomial(ReducedPolynomial { c10_pa: one("c10_pa")?, c30_pa: one("c30_pa")? })
            }
            "laksari" => Self::Laksari(laksari()?),
            "laksari-as-coded" => Self::LaksariAsCoded(LaksariAsCoded(laksari()?)),
            _ => return Err(unknown()),
        })
    }
}
