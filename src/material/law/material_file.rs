//! Materials in scenario files and manifests: the keys of the law's parameters and of what all laws share.

use super::LAWS;
use super::definition::{Card, LawParameter, Role, Values};
use super::material::Material;
use serde::de::{DeserializeOwned, Error};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;

const LAW: &str = "law";
const TERMS: &str = "terms";
const POISSON_RATIO: &str = "poisson_ratio";
const COMPRESSION_RESISTANCE: &str = "compression_resistance_pa";
const INVERSION_THRESHOLD: &str = "inversion_threshold";

/// A number, or the word that stands for it.
#[derive(Serialize)]
#[serde(untagged)]
enum Written<'a> {
    Number(f64),
    Word(&'a str),
}

fn written(parameter: &LawParameter, value: f64) -> Written<'static> {
    match parameter.role {
        Role::Modulus | Role::Shape => Written::Number(value),
        Role::Word(words) => Written::Word(words().get(value as usize).map_or("unknown", String::as_str)),
    }
}

/// One term of a law of terms.
struct Term<'a> {
    parameters: &'a [LawParameter],
    values: &'a [f64],
}

impl Serialize for Term<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.parameters.iter().zip(self.values).map(|(p, v)| (p.name, written(p, *v))))
    }
}

impl Serialize for Material {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let card = self.law.card();
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry(LAW, card.name)?;
        if card.of_terms {
            let term = |values| Term { parameters: card.parameters, values };
            let terms: Vec<Term> = self.values.chunks(card.parameters.len()).map(term).collect();
            map.serialize_entry(TERMS, &terms)?;
        } else {
            for ((parameter, _), value) in self.places().zip(&self.values) {
                map.serialize_entry(parameter.name, &written(parameter, *value))?;
            }
        }
        map.serialize_entry(POISSON_RATIO, &self.poisson_ratio)?;
        map.serialize_entry(COMPRESSION_RESISTANCE, &self.compression_resistance_pa)?;
        if card.continued {
            map.serialize_entry(INVERSION_THRESHOLD, &self.inversion_threshold)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Material {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut keys = Keys(BTreeMap::deserialize(deserializer)?);
        let name: String = keys.needed(LAW)?;
        let law = Self::law_named(&name).ok_or_else(|| {
            let known = LAWS.map(|law| format!("`{}`", law.card().name)).join(", ");
            D::Error::custom(format!("unknown variant `{name}`, expected one of {known}"))
        })?;
        let card = law.card();
        let mut values = Vec::new();
        if card.of_terms {
            let terms: Vec<BTreeMap<String, toml::Value>> = keys.needed(TERMS)?;
            for term in terms {
                let mut keys = Keys(term);
                values.extend(keys.values(card)?);
                keys.nothing_left(&card.parameters.iter().map(|p| p.name).collect::<Vec<_>>())?;
            }
        } else {
            values = keys.values(card)?;
        }
        let material = Self {
            law,
            values,
            poisson_ratio: keys.needed(POISSON_RATIO)?,
            compression_resistance_pa: keys.taken(COMPRESSION_RESISTANCE)?.unwrap_or(0.0),
            inversion_threshold: if card.continued { keys.taken(INVERSION_THRESHOLD)?.unwrap_or(0.0) } else { 0.0 },
        };
        let own = if card.of_terms { vec![TERMS] } else { card.parameters.iter().map(|p| p.name).collect() };
        let shared = [POISSON_RATIO, COMPRESSION_RESISTANCE, INVERSION_THRESHOLD];
        let known: Vec<&str> = own.into_iter().chain(shared).filter(|k| card.continued || *k != shared[2]).collect();
        keys.nothing_left(&known)?;
        Ok(material)
    }
}

/// The keys of a table that are not yet read.
struct Keys(BTreeMap<String, toml::Value>);

impl Keys {
    fn taken<T: DeserializeOwned, E: Error>(&mut self, key: &str) -> Result<Option<T>, E> {
        let value = self.0.remove(key).map(toml::Value::try_into::<T>).transpose();
        value.map_err(|e| E::custom(format!("`{key}`: {}", e.message())))
    }

    fn needed<T: DeserializeOwned, E: Error>(&mut self, key: &'static str) -> Result<T, E> {
        self.taken(key)?.ok_or_else(|| E::missing_field(key))
    }

    /// The law's own numbers.
    fn values<E: Error>(&mut self, card: &Card) -> Result<Values, E> {
        let one = |p: &LawParameter| match p.role {
            Role::Modulus | Role::Shape => match (self.taken(p.name)?, p.default) {
                (Some(value), _) | (None, Some(value)) => Ok(value),
                (None, None) => Err(E::missing_field(p.name)),
            },
            Role::Word(words) => {
                // A number is taken for the word of its digits.
                let written: toml::Value = self.needed(p.name)?;
                let word = written.as_str().map_or_else(|| written.to_string(), str::to_owned);
                let found = words().iter().position(|known| *known == word);
                found.map(|n| n as f64).ok_or_else(|| E::custom(unknown_word(p, &word, words())))
            }
        };
        card.parameters.iter().map(one).collect()
    }

    /// Refuses a key that no law knows.
    fn nothing_left<E: Error>(&self, known: &[&str]) -> Result<(), E> {
        let Some(key) = self.0.keys().next() else { return Ok(()) };
        let known = known.iter().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", ");
        Err(E::custom(format!("unknown field `{key}`, expected one of {known}")))
    }
}

/// Names the words that begin alike where there are any, else the first and the last.
fn unknown_word(parameter: &LawParameter, word: &str, words: &[String]) -> String {
    let close: Vec<&str> =
        words.iter().map(String::as_str).filter(|w| w.split('-').next() == word.split('-').next()).collect();
    let known = match (close.as_slice(), words) {
        ([], [first, .., last]) => format!("`{first}` to `{last}`"),
        (close, _) => close.iter().map(|w| format!("`{w}`")).collect::<Vec<_>>().join(" or "),
    };
    format!("`{}` is `{word}`: there is no such {}; say {known}", parameter.name, parameter.meaning)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_is_read_back_as_it_was_written() {
        for law in LAWS {
            for values in law.examples() {
                let mut material = Material::new(law, values, 0.45);
                material.compression_resistance_pa = 10.0;
                material.inversion_threshold = if law.card().continued { 0.1 } else { 0.0 };
                let text = serde_json::to_string(&material).unwrap();
                assert_eq!(serde_json::from_str::<Material>(&text).unwrap(), material, "{text}");
                assert_eq!(toml::from_str::<Material>(&toml::to_string(&material).unwrap()).unwrap(), material);
            }
        }
    }

    #[test]
    fn the_keys_stand_in_the_order_of_the_law() {
        let text = serde_json::to_string(&Material::neo_hookean(333.28, 0.45)).unwrap();
        let wanted = "{\"law\":\"neo-hookean\",\"shear_modulus_pa\":333.28,\"poisson_ratio\":0.45,\
                      \"compression_resistance_pa\":0.0,\"inversion_threshold\":0.0}";
        assert_eq!(text, wanted);
        let terms = "law = 'ogden'\nterms = [{ mu_pa = -500, alpha = -4 }]\npoisson_ratio = 0.45";
        let text = serde_json::to_string(&toml::from_str::<Material>(terms).unwrap()).unwrap();
        assert!(
            text.starts_with("{\"law\":\"ogden\",\"terms\":[{\"alpha\":-4.0,\"mu_pa\":-500.0}],\"poisson"),
            "{text}"
        );
    }

    #[test]
    fn what_is_not_known_is_refused_by_name() {
        let refused = |text: &str| toml::from_str::<Material>(text).unwrap_err().message().to_owned();
        let plain = "law = 'neo-hookean'\nshear_modulus_pa = 1.0\npoisson_ratio = 0.4\n";
        assert!(refused(&format!("{plain}young = 3.0")).contains("unknown field `young`"));
        assert!(
            refused(&plain.replace("neo-hookean", "hooke")).starts_with("unknown variant `hooke`, expected one of")
        );
        assert!(refused(&plain.replace("shear_modulus_pa = 1.0", "")).contains("missing field `shear_modulus_pa`"));
        assert!(refused(&plain.replace("1.0", "'soft'")).contains("shear_modulus_pa"));
        let stable = plain.replace("neo-hookean", "stable-neo-hookean");
        assert!(refused(&format!("{stable}inversion_threshold = 0.1")).contains("unknown field"));
        let term = "law = 'ogden'\nterms = [{ mu_pa = 1.0, alpha = 2.0, beta = 1.0 }]\npoisson_ratio = 0.4";
        assert!(refused(term).contains("unknown field `beta`"));
    }
}
