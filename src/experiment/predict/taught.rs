//! Whether a cohort's prior is of what a prediction draws. A prior that is taken up in part, or not at all, would be called the
//! cohort's all the same.

use super::settings::PredictSettings;
use crate::experiment::population::Kind;
use crate::experiment::prior::PriorSettings;
use crate::experiment::resection::ResectionSettings;
use crate::experiment::sample::Tissue;
use crate::material::generative::GenerativeModel;
use thiserror::Error;

/// What a cohort's moduli are called, before the tissue's name.
const MODULUS: &str = "shear_modulus_pa of ";

/// Why a cohort says nothing of a prediction.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum TaughtError {
    #[error(
        "`population` of the table [prior] teaches {}, and the prediction has {}: give `tissues = {}` in the table [predict], or leave \
         the population out",
        in_words(taught), in_words(drawn), 3 - drawn.len().clamp(1, 2)
    )]
    OtherTissues { taught: Vec<String>, drawn: Vec<String> },
    #[error(
        "`population` of the table [prior] was learnt under an effective density of {learnt} kg/m3, and where a part of the fluid has drained \
         (`drained` or `fluid_level` of the table [predict]) tissue weighs {weighs} kg/m3: moduli go with the weight; leave the population or that out"
    )]
    OtherWeight { learnt: f64, weighs: f64 },
    #[error(
        "`population` of the table [prior] was learnt with {learnt}, and `drained` or `fluid_level` of the table [predict] says {given}: moduli \
         go with the fluid that carries the brain; leave the population or that out"
    )]
    OtherFluid { learnt: String, given: String },
}

impl PredictSettings {
    /// Refuses a cohort of other tissues, or one that was weighed otherwise or in another fluid.
    ///
    /// # Errors
    /// [`TaughtError`].
    pub fn check_taught(&self, own: &ResectionSettings, prior: &PriorSettings) -> Result<(), TaughtError> {
        let Some(population) = prior.population.as_ref().filter(|p| !p.parameters.is_empty()) else { return Ok(()) };
        let drawn: Vec<String> = self.tissue_list().into_iter().map(|tissue| tissue.name).collect();
        let taught: Vec<String> = prior.taught_tissues().map(str::to_owned).collect();
        if taught.iter().any(|tissue| !drawn.contains(tissue)) {
            return Err(TaughtError::OtherTissues { taught, drawn });
        }
        // Where nothing is said of the fluid the load is what the settings were held against already.
        let fluid = self.drained.is_some() || self.fluid_level.is_some();
        let weighs = if fluid { self.tissue_density_kg_per_m3 } else { own.density_kg_per_m3 };
        let learnt = population.kind();
        let job = Kind { density_kg_per_m3: weighs, drained: self.drained, ..learnt };
        if !learnt.weighs_as(&job) {
            return Err(TaughtError::OtherWeight { learnt: population.density_kg_per_m3, weighs });
        }
        // Which part of the fluid a level leaves is another one in every head and every way of lying.
        let level = self.fluid_level.is_some() && learnt.tells_fluid();
        if level || (fluid && !learnt.floats_as(&job)) {
            let given = if level { "a level of its own".to_owned() } else { job.fluid() };
            return Err(TaughtError::OtherFluid { learnt: learnt.fluid(), given });
        }
        Ok(())
    }
}

impl PriorSettings {
    /// The tissues whose moduli a cohort has taught.
    pub fn taught_tissues(&self) -> impl Iterator<Item = &str> {
        let taught = self.population.iter().flat_map(|population| &population.parameters);
        taught.filter_map(|learnt| learnt.name.strip_prefix(MODULUS))
    }

    /// Where the stiffness of these tissues is drawn from, in words.
    pub(super) fn source_of(&self, tissues: &[Tissue]) -> String {
        let studies = "what published studies of brain tissue found";
        let taught = |tissue: &&Tissue| self.taught_tissues().any(|name| name == tissue.name);
        let (cohort, others): (Vec<&Tissue>, Vec<&Tissue>) = tissues.iter().partition(taught);
        let Some(patients) = self.patients().filter(|_| !cohort.is_empty()) else { return studies.to_owned() };
        let shown = format!("what the scans of {patients} patients of a cohort have shown");
        if others.is_empty() {
            return shown;
        }
        let names = |of: &[&Tissue]| of.iter().map(|t| t.name.replace('_', " ")).collect::<Vec<_>>().join(" and ");
        format!("{shown} ({}) and {studies} ({})", names(&cohort), names(&others))
    }

    /// What the spread of that stiffness is the spread of, a sentence each.
    pub(super) fn spread_of(&self, tissues: &[Tissue]) -> Vec<String> {
        let literature = tissues.iter().filter(|tissue| !self.taught_tissues().any(|name| name == tissue.name)).count();
        let mut said = Vec::new();
        if literature > 0 {
            said.push(self.spread_of_studies(literature > 1));
        }
        if literature < tissues.len() {
            said.push(
                "The cohort's moduli were learnt under one load for all of its patients, so what their loads differed by is in the spread of the moduli; \
                 the load is drawn beside it all the same, which makes the spread too wide rather than too narrow."
                    .to_owned(),
            );
        }
        said
    }

    fn spread_of_studies(&self, several: bool) -> String {
        if self.for_predictions().model == Some(GenerativeModel::StudyLevel) {
            return "The spread of the studies' stiffness is that from person to person, as far as studies tell it apart from what \
                    laboratories differ by."
                .to_owned();
        }
        let apart = if several { ", each tissue drawn by itself" } else { "" };
        format!(
            "The spread of the studies' stiffness is that of what one more study would report{apart}; it is not the spread from person to person, which is wider and which \
             `model = \"study-level\"` of the table [prior] draws from."
        )
    }
}

fn in_words(tissues: &[String]) -> String {
    tissues.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" and ")
}

#[cfg(test)]
mod tests {
    use super::super::known_level::KnownLevel;
    use super::*;
    use crate::experiment::moments::mean_and_sd;
    use crate::experiment::population::{LearntPrior, PopulationPrior};
    use crate::experiment::prior::{law_priors, task_of};
    use crate::material::generative::{SampleSettings, draw_materials, joint_tissue_prior};
    use crate::material::gp::Spread;
    use crate::material::literature::table;
    use crate::material::meta_model::MetaModel;

    fn taught(names: &[&str]) -> PriorSettings {
        let learnt = |name: &&str| LearntPrior { name: format!("{MODULUS}{name}"), log_mean: 6.3, log_sd: 0.2 };
        let parameters = names.iter().map(learnt).collect();
        let population =
            PopulationPrior { density_kg_per_m3: 100.0, patients: 8, parameters, ..PopulationPrior::none() };
        PriorSettings { population: Some(population), ..PriorSettings::default() }
    }

    fn refused(settings: &PredictSettings, names: &[&str]) -> Option<String> {
        let own = ResectionSettings::default();
        settings.check_taught(&own, &taught(names)).err().map(|e| e.to_string())
    }

    #[test]
    fn a_cohort_of_other_tissues_is_refused_and_one_of_some_of_them_is_said_to_be() {
        let two = PredictSettings::default();
        let one = PredictSettings { tissues: 1, ..PredictSettings::default() };
        let said = refused(&two, &["brain"]).unwrap();
        for words in ["teaches `brain`", "`grey_matter` and `white_matter`", "`tissues = 1`"] {
            assert!(said.contains(words), "{said}");
        }
        assert!(refused(&one, &["grey_matter", "white_matter"]).unwrap().contains("`tissues = 2`"));
        assert_eq!(
            (refused(&one, &["brain"]), refused(&two, &["grey_matter"]), refused(&two, &[])),
            (None, None, None)
        );
        let of = |names: &[&str]| taught(names).source_of(&two.tissue_list());
        assert!(!of(&[]).contains("cohort") && !of(&["grey_matter", "white_matter"]).contains("studies"));
        assert!(of(&["grey_matter"]).contains("cohort have shown (grey matter) and what published studies"));
    }

    #[test]
    fn which_spread_the_stiffness_has_is_said_and_what_a_cohort_counts_twice() {
        let tissues = PredictSettings::default().tissue_list();
        let of = |prior: &PriorSettings| prior.spread_of(&tissues).join(" ");
        let usual = PriorSettings::default();
        let study = of(&usual);
        for words in [
            "that of what one more study would report",
            "each tissue drawn by itself",
            "not the spread from person to person",
        ] {
            assert!(study.contains(words), "{words}: {study}");
        }
        let person = of(&PriorSettings { model: Some(GenerativeModel::StudyLevel), ..usual.clone() });
        assert!(person.contains("is that from person to person") && !person.contains("one more study"), "{person}");
        assert_eq!(of(&PriorSettings { law: MetaModel::OGDEN, ..usual.clone() }), study);
        // The setting that the sentence names makes the spread wider indeed, and ties the tissues.
        let priors = |prior: &PriorSettings| law_priors(&tissues, &prior.for_predictions()).unwrap();
        let [narrow, wide] = [None, Some(GenerativeModel::StudyLevel)]
            .map(|model| priors(&PriorSettings { model, ..PriorSettings::default() }));
        assert!(narrow.iter().zip(&wide).all(|((_, a), (_, b))| b.sd.unwrap() > 1.5 * a.sd.unwrap()));
        assert!(narrow.iter().all(|(_, a)| a.correlation.is_empty()) && wide[1].1.correlation[0] > 0.5);

        let cohort = of(&taught(&["grey_matter", "white_matter"]));
        assert!(cohort.contains("too wide rather than too narrow") && !cohort.contains("studies'"), "{cohort}");
        assert!(!study.contains("cohort") && of(&taught(&["grey_matter"])).contains("would report; it"));
    }

    #[test]
    fn the_spread_of_the_studies_is_that_of_one_more_study_and_not_of_how_well_their_mean_is_known() {
        let tissues = PredictSettings::default().tissue_list();
        let usual = PriorSettings::default().for_predictions();
        let drawn = law_priors(&tissues[..1], &usual).unwrap()[0].1.sd.unwrap();
        let settings = SampleSettings { stretches: 51, ..SampleSettings::default() };
        let process = joint_tissue_prior(task_of(&tissues[0], usual.study).unwrap(), &table(), &settings);
        let sd_of = |spread: Spread| {
            let draws = draw_materials(&process, 400, 0, spread, &settings).unwrap();
            mean_and_sd(&draws.iter().map(|draw| draw.shear_modulus_pa.ln()).collect::<Vec<f64>>()).1
        };
        // The sd of 400 draws' sd is 3.5 % of it.
        assert!((drawn / sd_of(Spread::Study) - 1.0).abs() < 0.15, "{drawn}");
        assert!(drawn > 10.0 * sd_of(Spread::Tissue), "{drawn}");
    }

    #[test]
    fn a_cohort_weighed_otherwise_is_refused_where_fluid_has_drained_too() {
        let drained = PredictSettings { tissues: 1, drained: Some(0.3), ..PredictSettings::default() };
        let said = refused(&drained, &["brain"]).unwrap();
        assert!(said.contains("100 kg/m3") && said.contains("1040 kg/m3") && said.contains("`drained`"), "{said}");
        let fluid_level = Some(KnownLevel { below_top_mm: 20.0, sd_mm: 5.0 });
        let level = PredictSettings { drained: None, fluid_level, ..drained.clone() };
        assert!(refused(&level, &["brain"]).unwrap().contains("`fluid_level`"));
        assert_eq!(refused(&PredictSettings { tissue_density_kg_per_m3: 100.0, ..drained }, &["brain"]), None);
    }

    #[test]
    fn a_cohort_in_another_fluid_is_refused_and_one_in_the_same_is_taken() {
        let own = ResectionSettings::default();
        let weighs = PredictSettings::default().tissue_density_kg_per_m3;
        let said = |learnt: Option<f64>, settings: &PredictSettings| {
            let mut prior = taught(&["brain"]);
            let population = prior.population.as_mut().unwrap();
            (population.density_kg_per_m3, population.poisson_ratio, population.drained) = (weighs, Some(0.45), learnt);
            settings.check_taught(&own, &prior).err().map(|e| e.to_string())
        };
        let drained = PredictSettings { tissues: 1, drained: Some(0.3), ..PredictSettings::default() };
        assert_eq!(said(Some(0.3), &drained), None);
        let other = said(Some(0.5), &drained).unwrap();
        assert!(
            other.contains("a part of 0.5") && other.contains("a part of 0.3") && other.contains("`drained`"),
            "{other}"
        );
        assert!(said(None, &drained).unwrap().contains("no fluid"));
        let fluid_level = Some(KnownLevel { below_top_mm: 20.0, sd_mm: 5.0 });
        let level = PredictSettings { drained: None, fluid_level, ..drained };
        assert!(said(Some(0.3), &level).unwrap().contains("`fluid_level`"));
    }
}
