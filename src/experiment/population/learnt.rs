//! What a cohort has taught, as the prior of the next patient.

use crate::material::meta_model::MetaModel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A cohort's say in place of the literature's; the table `[prior.population]` of the settings, which `--population FILE`
/// fills. Without parameters the literature's priors stand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PopulationPrior {
    /// The law that the patients were estimated with; a job with another one refuses this prior.
    #[schemars(with = "String")]
    pub law: MetaModel,
    /// The effective density that the patients were estimated under: gravity fixes a modulus only in proportion to it.
    pub density_kg_per_m3: f64,
    /// Patients behind it.
    pub patients: usize,
    /// The parameters that it knows better than the literature does.
    #[serde(default)]
    pub parameters: Vec<LearntPrior>,
}

/// One parameter of the next patient.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntPrior {
    /// As estimates call it: `shear_modulus_pa of grey_matter`.
    pub name: String,
    /// Mean of its logarithm.
    pub log_mean: f64,
    /// Standard deviation of its logarithm: of people, and of what is not known of their mean.
    pub log_sd: f64,
}

/// Effective densities nearer to each other than this share are the same.
const SAME_DENSITY: f64 = 1e-6;

impl PopulationPrior {
    /// No population: the literature's priors.
    pub fn none() -> Self {
        Self { law: MetaModel::NEO_HOOKEAN, density_kg_per_m3: 0.0, patients: 0, parameters: Vec::new() }
    }

    /// What it says of a parameter.
    pub fn of(&self, name: &str) -> Option<&LearntPrior> {
        self.parameters.iter().find(|learnt| learnt.name == name)
    }

    /// Whether its patients were estimated under this effective density.
    pub fn is_under(&self, density_kg_per_m3: f64) -> bool {
        (self.density_kg_per_m3 - density_kg_per_m3).abs() <= SAME_DENSITY * density_kg_per_m3.abs()
    }

    /// Refuses numbers that are no prior, and a job that is not the patients'.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(&self, law: MetaModel, density_kg_per_m3: f64) -> Result<(), String> {
        for (n, learnt) in self.parameters.iter().enumerate() {
            let LearntPrior { name, log_mean, log_sd } = learnt;
            if !(log_mean.is_finite() && *log_sd > 0.0 && log_sd.is_finite()) {
                return Err(format!(
                    "`population`: of `{name}` `log_mean` is {log_mean} and `log_sd` {log_sd}: the first must be a number and the \
                     second above 0"
                ));
            }
            if self.parameters[..n].iter().any(|earlier| earlier.name == *name) {
                return Err(format!("`population` holds `{name}` twice"));
            }
        }
        if self.parameters.is_empty() {
            return Ok(());
        }
        if self.law != law {
            return Err(format!(
                "`population` was learnt with the law {}, and this job's is {law}: give `law = \"{}\"` in the table [prior], or leave \
                 the population out",
                self.law, self.law
            ));
        }
        if !self.is_under(density_kg_per_m3) {
            return Err(format!(
                "`population` was learnt under an effective density of {} kg/m3, and `density_kg_per_m3` of [resection] is {}: moduli \
                 go with it; give the same, or leave the population out",
                self.density_kg_per_m3, density_kg_per_m3
            ));
        }
        Ok(())
    }
}
