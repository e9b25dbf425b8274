//! What a cohort has taught, as the prior of the next patient.

use super::kind::Kind;
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
    /// The Poisson's ratio that they were estimated with; left out by older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poisson_ratio: Option<f64>,
    /// The part of a given fluid that had drained; left out without a fluid, and by older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drained: Option<f64>,
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

impl PopulationPrior {
    /// No population: the literature's priors.
    pub fn none() -> Self {
        Self {
            law: MetaModel::NEO_HOOKEAN,
            density_kg_per_m3: 0.0,
            poisson_ratio: None,
            drained: None,
            patients: 0,
            parameters: Vec::new(),
        }
    }

    /// What it says of a parameter.
    pub fn of(&self, name: &str) -> Option<&LearntPrior> {
        self.parameters.iter().find(|learnt| learnt.name == name)
    }

    /// How its patients were estimated.
    pub fn kind(&self) -> Kind {
        let Self { law, density_kg_per_m3, poisson_ratio, drained, .. } = *self;
        Kind { law, density_kg_per_m3, poisson_ratio, drained }
    }

    /// Refuses numbers that are no prior, and a job that is not the patients'.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(&self, job: &Kind) -> Result<(), String> {
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
        let own = self.kind();
        if own.law != job.law {
            return Err(format!(
                "`population` was learnt with the law {}, and this job's is {}: give `law = \"{}\"` in the table [prior], or leave \
                 the population out",
                own.law, job.law, own.law
            ));
        }
        if !own.weighs_as(job) {
            return Err(format!(
                "`population` was learnt under an effective density of {} kg/m3, and `density_kg_per_m3` of [resection] is {}: moduli \
                 go with it; give the same, or leave the population out",
                own.density_kg_per_m3, job.density_kg_per_m3
            ));
        }
        if let Some((learnt, given)) = own.poisson_ratio.zip(job.poisson_ratio).filter(|_| !own.gives_as(job)) {
            return Err(format!(
                "`population` was learnt with a Poisson's ratio of {learnt}, and `poisson_ratio` of [resection] is {given}: moduli go \
                 with it; give the same, or leave the population out"
            ));
        }
        if !own.floats_as(job) {
            return Err(format!(
                "`population` was learnt with {}, and the table [resection.csf] (`drained`) says {}: moduli go with the fluid that \
                 carries the brain; give the same, or leave the population out",
                own.fluid(),
                job.fluid()
            ));
        }
        Ok(())
    }
}
