//! The materials a sweep tries: one law per tissue, drawn from the prior at stated levels.

use super::law_outcome::LawOutcome;
use crate::material::Task;
use crate::material::law::Material;
use crate::segment::label;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Labels that share one material under one name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tissue {
    /// `brain`, `grey_matter`, `white_matter`.
    pub name: String,
    /// The labels of the mesh it stands for.
    pub labels: Vec<u8>,
}

impl Tissue {
    /// Grey and white matter as one material.
    pub fn whole_brain() -> Vec<Self> {
        vec![Self { name: "brain".to_owned(), labels: vec![label::GREY_MATTER, label::WHITE_MATTER] }]
    }

    /// Grey and white matter apart.
    pub fn grey_and_white() -> Vec<Self> {
        let tissue = |name: &str, label| Self { name: name.to_owned(), labels: vec![label] };
        vec![tissue("grey_matter", label::GREY_MATTER), tissue("white_matter", label::WHITE_MATTER)]
    }
}

/// One tissue's material and where in the prior it stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TissueSample {
    /// Standard deviations from the prior's mean.
    pub sd_level: f64,
    /// Shear modulus at rest, Pa.
    pub shear_modulus_pa: f64,
    /// The meta-model fitted to that level.
    pub material: Material,
}

impl TissueSample {
    /// The law as the outcome records it: name and every number by its name.
    pub fn law(&self) -> LawOutcome {
        let value = serde_json::to_value(&self.material).unwrap_or_default();
        let mut law = LawOutcome { law: String::new(), parameters: BTreeMap::new() };
        for (name, value) in value.as_object().into_iter().flatten() {
            match (name.as_str(), value) {
                ("law", value) => value.as_str().unwrap_or_default().clone_into(&mut law.law),
                ("terms", value) => {
                    for (n, term) in value.as_array().into_iter().flatten().enumerate() {
                        for (name, value) in term.as_object().into_iter().flatten() {
                            law.parameters.insert(format!("{name}_{}", n + 1), value.as_f64().unwrap_or_default());
                        }
                    }
                }
                // Only numbers are parameters; no law of the prior has a word.
                (_, serde_json::Value::String(_)) => {}
                (name, value) => {
                    law.parameters.insert(name.to_owned(), value.as_f64().unwrap_or_default());
                }
            }
        }
        law
    }
}

/// One simulation to be run: a material per tissue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// `sample-05`: its place in the list.
    pub id: String,
    /// Material per tissue name.
    pub tissues: BTreeMap<String, TissueSample>,
    /// The task of the generative model that all of it comes from, where several are compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<Task>,
}

/// Every combination of the tissues' levels, the first tissue slowest: 9 levels of two tissues give the paper's 81.
pub fn every_combination(levels: &[(Tissue, Vec<TissueSample>)]) -> Vec<Sample> {
    let total: usize = levels.iter().map(|(_, samples)| samples.len()).product();
    let digits = total.saturating_sub(1).to_string().len().max(2);
    let combination = |n: usize| {
        let mut rest = n;
        let mut tissues = BTreeMap::new();
        for (tissue, samples) in levels.iter().rev() {
            tissues.insert(tissue.name.clone(), samples[rest % samples.len()].clone());
            rest /= samples.len();
        }
        Sample { id: format!("sample-{n:0digits$}"), tissues, task: None }
    };
    (0..total).map(combination).collect()
}

/// The samples of shard `number` of `shards` (1-based): every `shards`-th, so that hard and easy ones are shared out.
pub fn shard(samples: &[Sample], number: usize, shards: usize) -> Vec<Sample> {
    samples.iter().enumerate().filter(|(n, _)| n % shards + 1 == number).map(|(_, s)| s.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(shear_modulus_pa: f64) -> TissueSample {
        TissueSample { sd_level: 0.0, shear_modulus_pa, material: Material::neo_hookean(shear_modulus_pa, 0.45) }
    }

    #[test]
    fn the_outcome_records_every_number_of_the_law() {
        let law = level(333.28).law();
        assert_eq!((law.law.as_str(), law.parameters["shear_modulus_pa"]), ("neo-hookean", 333.28));
        assert_eq!(law.parameters["poisson_ratio"], 0.45);
    }

    #[test]
    fn combinations_are_the_product_in_order_without_repeats() {
        let tissues = Tissue::grey_and_white();
        let levels = vec![
            (tissues[0].clone(), vec![level(1.0), level(2.0), level(3.0)]),
            (tissues[1].clone(), vec![level(10.0), level(20.0)]),
        ];
        let samples = every_combination(&levels);
        let pair = |s: &Sample| (s.tissues["grey_matter"].shear_modulus_pa, s.tissues["white_matter"].shear_modulus_pa);
        let pairs: Vec<_> = samples.iter().map(pair).collect();
        assert_eq!(pairs, [(1.0, 10.0), (1.0, 20.0), (2.0, 10.0), (2.0, 20.0), (3.0, 10.0), (3.0, 20.0)]);
        assert_eq!(samples[5].id, "sample-05");
    }

    #[test]
    fn shards_share_out_every_sample_once() {
        let tissue = Tissue::whole_brain().remove(0);
        let samples = every_combination(&[(tissue, (0..9).map(|n| level(f64::from(n))).collect())]);
        let mut together: Vec<Sample> = (1..=4).flat_map(|k| shard(&samples, k, 4)).collect();
        together.sort_by(|a, b| a.id.cmp(&b.id));
        assert_eq!(together, samples);
    }
}
