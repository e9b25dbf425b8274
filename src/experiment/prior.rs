//! From what the Gaussian process says of a tissue to the samples a sweep tries and the prior an estimate starts from.

use super::estimate::{Average, LogPrior, Scale, Unknown};
use super::moments::mean_and_sd;
use super::person_prior::{person_correlations, person_materials, person_prior};
use super::population::{Kind, PopulationPrior};
use super::sample::{Sample, Tissue, TissueSample, every_combination};
use crate::material::generative::{
    GenerativeModel, SampleSettings, SampledMaterial, draw_materials, joint_tissue_prior, sample_shear_moduli,
};
use crate::material::gp::Spread;
use crate::material::law::{Estimated, Shape, ShapeKnown};
use crate::material::literature::{Curves, LiteratureModel, table};
use crate::material::meta_model::{FitError, MetaModel, MetaModelSettings};
use crate::material::rheometry::{Measured, Rheometry, fit_rheometry};
use crate::material::study_level::{self, drawn_materials};
use crate::material::{Region, StudyKind, Task};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Which prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PriorSettings {
    /// The published program's choices instead of the exact ones.
    pub published: bool,
    /// The generative model: the paper's, or what the spread between studies and people leaves to expect of a person. Left out:
    /// estimates start from a person, whom the literature knows far less well than what one more study would report; levels of a
    /// sweep and predictions are the paper's, of what one more study would report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<GenerativeModel>,
    /// Whose studies: elastography, linear elasticity or hyperelastic tests.
    pub study: StudyKind,
    /// The law fitted to every sample; its volumetric part takes the experiment's Poisson's ratio.
    #[schemars(with = "String")]
    pub law: MetaModel,
    /// What a cohort says of people, in place of the literature's prior in estimates and predictions; a sweep's levels stay the
    /// literature's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub population: Option<PopulationPrior>,
}

impl Default for PriorSettings {
    fn default() -> Self {
        Self {
            published: false,
            model: None,
            study: StudyKind::Hyperelastic,
            law: MetaModel::NEO_HOOKEAN,
            population: None,
        }
    }
}

impl PriorSettings {
    /// Of whom levels and predictions are.
    fn model_of_levels(&self) -> GenerativeModel {
        self.model.unwrap_or(GenerativeModel::Published)
    }

    /// What an estimate starts from. Who asks for the published program's choices gets its prior.
    fn model_of_estimates(&self) -> GenerativeModel {
        let own = if self.published { GenerativeModel::Published } else { GenerativeModel::StudyLevel };
        self.model.unwrap_or(own)
    }

    /// The same with the model that levels and predictions are of, where none is named.
    #[must_use]
    pub fn for_predictions(&self) -> Self {
        Self { model: Some(self.model_of_levels()), ..self.clone() }
    }

    /// The same with the model that an estimate starts from, where none is named.
    fn for_estimates(&self) -> Self {
        Self { model: Some(self.model_of_estimates()), ..self.clone() }
    }

    /// Refuses a population that is not of patients like this one, whose load and Poisson's ratio are these.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(&self, density_kg_per_m3: f64, poisson_ratio: f64, drained: Option<f64>) -> Result<(), String> {
        let job = Kind { law: self.law, density_kg_per_m3, poisson_ratio: Some(poisson_ratio), drained };
        self.population.as_ref().map_or(Ok(()), |population| population.check(&job))
    }

    /// The cohort's prior of an unknown where it has one, else what was known before.
    #[must_use]
    pub fn learnt(&self, prior: LogPrior) -> LogPrior {
        match self.population.as_ref().and_then(|population| population.of(&prior.name)) {
            Some(learnt) => LogPrior { mean: learnt.log_mean, sd: Some(learnt.log_sd), average: None, ..prior },
            None => prior,
        }
    }

    /// Patients behind the prior, where a cohort has taught any of it.
    pub fn patients(&self) -> Option<usize> {
        self.population.as_ref().filter(|p| !p.parameters.is_empty()).map(|p| p.patients)
    }
}

/// Why there are no samples.
#[derive(Debug, Error)]
pub enum PriorError {
    /// The tissue has no task of its own.
    #[error("there is no prior for the tissue `{0}`; use brain, grey_matter, white_matter, tumour or oedema")]
    UnknownTissue(String),
    /// The meta-model could not be fitted.
    #[error("the prior of `{tissue}` gives no material: {source}")]
    Fit {
        /// The tissue.
        tissue: String,
        /// Why.
        source: FitError,
    },
    /// The study-level model of the embedded studies could not be fitted.
    #[error("the study-level model gives no prior: {0}")]
    StudyLevel(#[from] study_level::FitError),
    /// The law does not say what an estimate may change of it.
    #[error(
        "setting `law` of the table [prior] is `{law}`, whose parameters no estimate can change; take one of {}",
        MetaModel::estimable().join(", ")
    )]
    NotEstimated {
        /// The law.
        law: MetaModel,
    },
    /// No level.
    #[error(
        "setting `sd_levels` of the table [resection] (of a phantom: [phantom]) is empty: give at least one level, \
         such as [-2.0, 0.0, 2.0]"
    )]
    NoLevels,
}

/// The task of a tissue among these studies: healthy brain, grey or white matter, abnormal tissue.
///
/// # Errors
/// [`PriorError::UnknownTissue`].
pub fn task_of(tissue: &Tissue, study: StudyKind) -> Result<Task, PriorError> {
    let region = match tissue.name.as_str() {
        "brain" => Region::Healthy,
        "grey_matter" => Region::Grey,
        "white_matter" => Region::White,
        // Oedema is in the studies of abnormal tissue, and in no task of its own.
        "tumour" | "oedema" => Region::Abnormal,
        other => return Err(PriorError::UnknownTissue(other.to_owned())),
    };
    Ok(Task { kind: study, region })
}

fn materials(tissue: &Tissue, levels: &[f64], prior: &PriorSettings) -> Result<Vec<SampledMaterial>, PriorError> {
    materials_of_task(tissue, task_of(tissue, prior.study)?, levels, prior)
}

fn materials_of_task(
    tissue: &Tissue,
    task: Task,
    levels: &[f64],
    prior: &PriorSettings,
) -> Result<Vec<SampledMaterial>, PriorError> {
    if levels.is_empty() {
        return Err(PriorError::NoLevels);
    }
    let settings = sample_settings(prior);
    match prior.model_of_levels() {
        GenerativeModel::Published => sample_shear_moduli(task, levels, &settings)
            .map_err(|source| PriorError::Fit { tissue: tissue.name.clone(), source }),
        GenerativeModel::StudyLevel => Ok(person_materials(task, levels, DRAWN_STRETCHES, &settings)?),
    }
}

fn sample_settings(prior: &PriorSettings) -> SampleSettings {
    let settings = if prior.published { SampleSettings::published() } else { SampleSettings::default() };
    SampleSettings { model: prior.law, ..settings }
}

/// The material of a tissue that is not varied: the mean of its prior. A lesion is too small a part of what moves for two
/// scans to say anything of it.
///
/// # Errors
/// [`PriorError`].
pub fn held_material(name: &str, poisson_ratio: f64, prior: &PriorSettings) -> Result<TissueSample, PriorError> {
    let tissue = Tissue { name: name.to_owned(), labels: Vec::new() };
    let mean = materials(&tissue, &[0.0], prior)?;
    mean.first().map(|m| tissue_sample(m, poisson_ratio)).ok_or(PriorError::NoLevels)
}

/// Every combination of the tissues' levels as materials of the given Poisson's ratio.
///
/// # Errors
/// [`PriorError`].
pub fn samples_of_prior(
    tissues: &[Tissue],
    sd_levels: &[f64],
    poisson_ratio: f64,
    prior: &PriorSettings,
) -> Result<Vec<Sample>, PriorError> {
    let mut levels = Vec::new();
    for tissue in tissues {
        let list = materials(tissue, sd_levels, prior)?;
        let sample = |m: &SampledMaterial| tissue_sample(m, poisson_ratio);
        levels.push((tissue.clone(), list.iter().map(sample).collect()));
    }
    Ok(every_combination(&levels))
}

/// The whole brain as one material of every task that is not of abnormal tissue, at each level: the curves of the paper's
/// Fig. 4. Where the body has `lesions` (names of labels that are not varied otherwise), also those of every task of abnormal
/// tissue, at each level alike, in a brain at the mean of the healthy task of the same kind of study.
///
/// # Errors
/// [`PriorError`].
pub fn samples_of_every_task(
    lesions: &[String],
    sd_levels: &[f64],
    poisson_ratio: f64,
    prior: &PriorSettings,
) -> Result<Vec<Sample>, PriorError> {
    let brain = Tissue::whole_brain().remove(0);
    let mut samples = Vec::new();
    for task in Task::all().filter(|task| task.region != Region::Abnormal || !lesions.is_empty()) {
        let list = materials_of_task(&brain, task, sd_levels, prior)?;
        let levels = list.iter().map(|m| tissue_sample(m, poisson_ratio)).collect();
        for mut sample in every_combination(&[(brain.clone(), levels)]) {
            sample.id = sample.id.replace("sample", &task.to_string());
            sample.task = Some(task);
            if task.region == Region::Abnormal {
                let healthy = Task { region: Region::Healthy, ..task };
                let mean = materials_of_task(&brain, healthy, &[0.0], prior)?.remove(0);
                let around = tissue_sample(&mean, poisson_ratio);
                if let Some(lesion) = sample.tissues.insert(brain.name.clone(), around) {
                    sample.tissues.extend(lesions.iter().map(|name| (name.clone(), lesion.clone())));
                }
            }
            samples.push(sample);
        }
    }
    Ok(samples)
}

fn tissue_sample(m: &SampledMaterial, poisson_ratio: f64) -> TissueSample {
    TissueSample { sd_level: m.sd_level, shear_modulus_pa: m.shear_modulus_pa, material: m.fit.material(poisson_ratio) }
}

/// The prior of ln(shear modulus): the samples at -1, 0 and 1 standard deviations span its mean and spread (the
/// meta-model's modulus is close to log-linear in the level).
///
/// # Errors
/// [`PriorError`].
pub fn log_prior(tissue: &Tissue, prior: &PriorSettings) -> Result<LogPrior, PriorError> {
    let three = materials(tissue, &[-1.0, 0.0, 1.0], prior)?;
    let log = |n: usize| three[n].shear_modulus_pa.ln();
    Ok(LogPrior {
        name: format!("shear_modulus_pa of {}", tissue.name),
        mean: log(1),
        sd: Some(0.5 * (log(2) - log(0))),
        scale: Scale::Logarithm,
        correlation: Vec::new(),
        average: None,
    })
}

/// Draws behind the joint prior of a law's parameters: their mean is good to a fourteenth of their spread.
const DRAWS: u64 = 200;
/// Stretches that a draw is fitted over.
const DRAWN_STRETCHES: usize = 101;
/// Standard deviation of the log odds of a share of which nothing is known but that it is one (the logistic's).
const ANY_SHARE_SD: f64 = 1.813_799_364_234_217_8;

/// The joint prior of all that an estimate may change of a tissue's law: the shear modulus at rest, and what the
/// law names beside it: the exponent of Ogden's, the limit of Gent's, the share of C1 of Mooney and Rivlin's. The modulus' mean and
/// spread, and its correlation with an exponent or a limit, are those of laws fitted to whole random curves of the Gaussian process ([`Spread::Study`]: what one more study would
/// report) or, of the study-level model, of persons nobody has measured; then what the paper's process says stands beside it, as the
/// average of the studies with the spread of one more of them. Those curves share their shape far more than studies do, so an exponent's or a limit's mean and spread are those
/// of the published hyperelastic models of healthy tissue themselves. An exponent at its bound of 5 says nothing of the exponent:
/// Ogden's law is fitted without that bound. Draws put C1 at its bound of 0: then any share that a stable law has is as likely
/// as another. A person's tissues go together (a laboratory that finds one soft finds the other soft): how much stiffer one is
/// than the other is known better than how stiff they are. What a cohort has taught takes the place of mean and
/// spread, tissue by tissue.
///
/// # Errors
/// [`PriorError`].
pub fn law_priors(tissues: &[Tissue], prior: &PriorSettings) -> Result<Vec<(Unknown, LogPrior)>, PriorError> {
    let prior = &prior.for_estimates();
    let mut known = Vec::new();
    for tissue in tissues {
        known.extend(literature_priors(tissue, prior)?.into_iter().map(|of_law| (tissue, of_law)));
    }
    if prior.model == Some(GenerativeModel::StudyLevel) {
        let papers = PriorSettings { model: Some(GenerativeModel::Published), ..prior.clone() };
        let mut averages = Vec::new();
        for tissue in tissues {
            averages.extend(literature_priors(tissue, &papers)?);
        }
        for ((_, (_, known)), (_, average)) in known.iter_mut().zip(averages) {
            known.average = average.sd.map(|sd| Average { mean: average.mean, sd });
        }
        if tissues.len() > 1 {
            of_one_person(&mut known, prior)?;
        }
    }
    Ok(known.into_iter().map(|(_, (unknown, known))| (unknown, prior.learnt(known))).collect())
}

/// Parameters of a law in each of several tissues, which are one person's: the moduli go together as the study-level model draws
/// them, anything else of a law only through the modulus beside it.
fn of_one_person(known: &mut [(&Tissue, (Unknown, LogPrior))], prior: &PriorSettings) -> Result<(), PriorError> {
    let mut tasks = Vec::new();
    for (tissue, _) in &*known {
        let task = task_of(tissue, prior.study)?;
        if !tasks.contains(&task) {
            tasks.push(task);
        }
    }
    let moduli = person_correlations(&tasks, DRAWN_STRETCHES, &sample_settings(prior))?;
    let taught = |known: &LogPrior| prior.learnt(known.clone()) != *known;
    // How far each goes along with its own tissue's modulus; not at all where a cohort knows better.
    let along: Vec<(usize, f64)> = known
        .iter()
        .map(|(tissue, (unknown, known))| {
            let place = task_of(tissue, prior.study).ok().and_then(|task| tasks.iter().position(|t| *t == task));
            let along = match unknown {
                _ if taught(known) => 0.0,
                Unknown::ShearModulus(_) => 1.0,
                _ => known.correlation.first().copied().unwrap_or(0.0),
            };
            (place.unwrap_or(0), along)
        })
        .collect();
    for late in 0..known.len() {
        let own = known[late].1.1.correlation.clone();
        let with = |early: usize| {
            let ((i, a), (j, b)) = (along[late], along[early]);
            if i == j { own.get(late - early - 1).copied().unwrap_or(0.0) } else { a * b * moduli[(i, j)] }
        };
        known[late].1.1.correlation = (0..late).rev().map(with).collect();
    }
    Ok(())
}

/// The same as the literature alone has it.
fn literature_priors(tissue: &Tissue, prior: &PriorSettings) -> Result<Vec<(Unknown, LogPrior)>, PriorError> {
    let modulus = Unknown::ShearModulus(tissue.clone());
    let shape = match prior.law.estimated() {
        Estimated::Modulus => return Ok(vec![(modulus, log_prior(tissue, prior)?)]),
        Estimated::Shaped(shape) => shape,
        Estimated::Not => return Err(PriorError::NotEstimated { law: prior.law }),
    };
    let law = if prior.law == MetaModel::OGDEN { MetaModel::OGDEN_HIGH } else { prior.law };
    let settings = SampleSettings { model: law, stretches: DRAWN_STRETCHES, ..sample_settings(prior) };
    let task = task_of(tissue, prior.study)?;
    let draws = match prior.model_of_levels() {
        GenerativeModel::Published => {
            draw_materials(&joint_tissue_prior(task, &table(), &settings), DRAWS, 0, Spread::Study, &settings)
        }
        GenerativeModel::StudyLevel => {
            drawn_materials(&person_prior(task, settings.curves, DRAWN_STRETCHES)?, DRAWS, 0, &settings)
        }
    };
    let draws = draws.map_err(|source| PriorError::Fit { tissue: tissue.name.clone(), source })?;
    let moduli: Vec<f64> = draws.iter().map(|d| d.shear_modulus_pa.ln()).collect();
    let (mean, sd) = mean_and_sd(&moduli);
    let unknown = Unknown::Shape(tissue.clone(), shape);
    let of_shape = match shape.known {
        ShapeKnown::AnyShare => unknown.prior(0.0, ANY_SHARE_SD),
        ShapeKnown::Studies => {
            let drawn: Vec<f64> = draws.iter().map(|d| (shape.number)(&law.values(&d.fit.parameters))).collect();
            let (drawn_mean, drawn_sd) = mean_and_sd(&drawn);
            let products = moduli.iter().zip(&drawn).map(|(m, e)| (m - mean) * (e - drawn_mean));
            let correlation = products.sum::<f64>() / (draws.len() as f64 - 1.0) / (sd * drawn_sd);
            let (shape_mean, shape_sd) = mean_and_sd(&shapes_of_studies(law, shape));
            LogPrior { correlation: vec![correlation], ..unknown.prior(shape_mean, shape_sd) }
        }
    };
    Ok(vec![(modulus.clone(), modulus.prior(mean, sd)), (unknown, of_shape)])
}

/// Shapes of the published hyperelastic models of healthy tissue, each fitted over the stretches it was measured at.
fn shapes_of_studies(law: MetaModel, shape: &Shape) -> Vec<f64> {
    let healthy = |model: &LiteratureModel| model.task.region != Region::Abnormal;
    let hyperelastic = |model: &LiteratureModel| model.task.kind == StudyKind::Hyperelastic;
    let fitted = |model: LiteratureModel| {
        let curve = model.curve(Curves::Corrected);
        let values_pa = curve.energies_pa.iter().map(|w| w.max(0.0)).collect();
        let test = Rheometry { measured: Measured::Energy, stretches: curve.stretches, values_pa };
        let fit = fit_rheometry(law, &test, &MetaModelSettings::default()).ok()?;
        Some((shape.number)(&law.values(&fit.parameters)))
    };
    table().into_iter().filter(hyperelastic).filter(healthy).filter_map(fitted).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::{joint_precision, prior_correlation};

    #[test]
    fn nine_levels_of_two_tissues_are_the_papers_81_samples() {
        let levels = crate::material::generative::nine_levels();
        let samples = samples_of_prior(
            &Tissue::grey_and_white(),
            &levels,
            0.45,
            &PriorSettings { published: true, ..PriorSettings::default() },
        )
        .unwrap();
        assert_eq!(samples.len(), 81);
        // Granados et al. 2021, Table 1: grey at +2 SD 2299 Pa, white at 0 SD 610 Pa.
        let last = &samples[80].tissues["grey_matter"];
        assert!((last.shear_modulus_pa - 2299.0).abs() < 1.0);
        assert!((samples[4].tissues["white_matter"].shear_modulus_pa - 610.0).abs() < 1.0);
    }

    #[test]
    fn every_healthy_task_has_its_nine_samples_under_its_own_name() {
        let levels = crate::material::generative::nine_levels();
        let samples = samples_of_every_task(&[], &levels, 0.45, &PriorSettings::default()).unwrap();
        assert_eq!(samples.len(), 81);
        let ids: std::collections::BTreeSet<_> = samples.iter().map(|s| s.id.as_str()).collect();
        assert_eq!(ids.len(), 81);
        let of = |name: &str| samples.iter().filter(|s| s.id.starts_with(name)).collect::<Vec<_>>();
        assert_eq!(of("hyperelastic-white-").len(), 9);
        assert!(of("mre-abnormal").is_empty());
        // The task with a tissue of its own is the one that the prior of that tissue takes.
        let healthy = samples_of_prior(&Tissue::whole_brain(), &levels, 0.45, &PriorSettings::default()).unwrap();
        let moduli = |list: Vec<&Sample>| list.iter().map(|s| s.tissues["brain"].shear_modulus_pa).collect::<Vec<_>>();
        assert_eq!(moduli(of("hyperelastic-healthy-")), moduli(healthy.iter().collect()));
    }

    #[test]
    fn tasks_of_abnormal_tissue_vary_the_lesions_alike_and_hold_the_brain_at_its_own_mean() {
        let (prior, lesions) = (PriorSettings::default(), ["oedema", "tumour"].map(str::to_owned));
        let levels = [-1.0, 0.0, 1.0];
        let samples = samples_of_every_task(&lesions, &levels, 0.45, &prior).unwrap();
        assert_eq!(samples.len(), 36);
        for kind in StudyKind::ALL {
            let of = |region: Region| {
                let task = Task { kind, region };
                samples.iter().filter(|s| s.task == Some(task)).collect::<Vec<_>>()
            };
            let (abnormal, healthy) = (of(Region::Abnormal), of(Region::Healthy));
            let task = Task { kind, region: Region::Abnormal };
            let known = sample_shear_moduli(task, &levels, &SampleSettings::default()).unwrap();
            for (sample, known) in abnormal.iter().zip(&known) {
                let modulus = |tissue: &str| sample.tissues[tissue].shear_modulus_pa;
                assert_eq!([modulus("oedema"), modulus("tumour")], [known.shear_modulus_pa; 2], "{}", sample.id);
                assert_eq!(modulus("brain"), healthy[1].tissues["brain"].shear_modulus_pa, "{}", sample.id);
            }
            assert!(healthy.iter().all(|s| s.tissues.len() == 1));
        }
    }

    #[test]
    fn the_study_level_prior_is_that_of_a_person_and_wider_than_the_papers() {
        let tissue = Tissue::whole_brain().remove(0);
        let person = PriorSettings { model: Some(GenerativeModel::StudyLevel), ..PriorSettings::default() };
        let [papers, own] = [&PriorSettings::default(), &person].map(|prior| log_prior(&tissue, prior).unwrap());
        assert!(own.sd.unwrap() > 1.5 * papers.sd.unwrap(), "{own:?} beside {papers:?}");
        // The law fitted to ln g at the mean has about the modulus that ln g has at rest.
        let task = task_of(&tissue, StudyKind::Hyperelastic).unwrap();
        let known = person_prior(task, Curves::Corrected, DRAWN_STRETCHES).unwrap();
        let at_rest = (0..DRAWN_STRETCHES)
            .min_by(|a, b| (known.stretches[*a] - 1.0).abs().total_cmp(&(known.stretches[*b] - 1.0).abs()));
        let (mean, sd) = (known.mean[at_rest.unwrap()], known.sd[at_rest.unwrap()]);
        assert!((own.mean - mean).abs() < 0.5 * sd, "{} beside {mean} +- {sd}", own.mean);
        // A law of one number sees the whole window, at whose ends persons differ most.
        let widest = known.sd.iter().copied().fold(sd, f64::max);
        assert!((0.95 * sd..widest).contains(&own.sd.unwrap()), "{own:?} beside {sd} to {widest}");
        let two =
            law_priors(std::slice::from_ref(&tissue), &PriorSettings { law: MetaModel::OGDEN, ..person }).unwrap();
        assert!(two.len() == 2 && two.iter().all(|(_, prior)| prior.mean.is_finite() && prior.sd.unwrap() > 0.0));
    }

    #[test]
    fn an_estimate_starts_from_a_person_and_keeps_the_papers_average_beside_it() {
        let tissue = &Tissue::grey_and_white()[..1];
        let own = PriorSettings::default();
        let [started, predicted] = [&own, &own.for_predictions()].map(|p| law_priors(tissue, p).unwrap().remove(0).1);
        let papers = log_prior(&tissue[0], &own).unwrap();
        assert_eq!(started.average, papers.sd.map(|sd| Average { mean: papers.mean, sd }));
        assert_eq!(predicted, papers);
        assert!(started.sd.unwrap() > 2.0 * papers.sd.unwrap(), "{started:?}");
        // Who asks for the published program gets its prior.
        let published = PriorSettings { published: true, ..PriorSettings::default() };
        assert_eq!(law_priors(tissue, &published).unwrap()[0].1, log_prior(&tissue[0], &published).unwrap());
    }

    #[test]
    fn a_persons_tissues_go_together() {
        let tissues = Tissue::grey_and_white();
        for law in MetaModel::all() {
            let person = PriorSettings { model: Some(GenerativeModel::StudyLevel), law, ..PriorSettings::default() };
            let priors: Vec<LogPrior> = law_priors(&tissues, &person).unwrap().into_iter().map(|(_, p)| p).collect();
            let white = priors.len() / 2;
            let [grey_sd, white_sd] = [0, white].map(|n| priors[n].sd.unwrap());
            // What is known of how much stiffer one is than the other.
            let together = prior_correlation(&priors, 0, white) * grey_sd * white_sd;
            let ratio_sd = (grey_sd * grey_sd + white_sd * white_sd - 2.0 * together).sqrt();
            assert!(ratio_sd < 0.6 * grey_sd.min(white_sd), "{law:?}: {ratio_sd} of {grey_sd}, {white_sd}");
            // The parameters of one law go together as they do where there is one tissue, and all of them are possible.
            let alone = law_priors(&tissues[1..], &person).unwrap();
            for n in 0..alone.len() {
                for m in 0..n {
                    let own = prior_correlation(&[alone[m].1.clone(), alone[n].1.clone()], 0, 1);
                    assert_eq!(prior_correlation(&priors, white + m, white + n), own, "{law:?}");
                }
            }
            assert!(joint_precision(&priors).cholesky().is_some(), "{law:?}: {priors:?}");
        }
    }

    #[test]
    fn a_tumour_is_held_at_the_mean_of_abnormal_tissue() {
        let prior = PriorSettings::default();
        let held = held_material("tumour", 0.45, &prior).unwrap();
        let task = Task { kind: prior.study, region: Region::Abnormal };
        let mean = sample_shear_moduli(task, &[0.0], &SampleSettings::default()).unwrap();
        assert_eq!((held.sd_level, held.shear_modulus_pa), (0.0, mean[0].shear_modulus_pa));
        assert_eq!(held.shear_modulus_pa, held_material("oedema", 0.45, &prior).unwrap().shear_modulus_pa);
    }

    #[test]
    fn the_log_prior_lies_between_its_samples_and_an_unknown_tissue_is_refused() {
        let prior = log_prior(&Tissue::whole_brain()[0], &PriorSettings::default()).unwrap();
        assert!(prior.sd.unwrap() > 0.1 && prior.mean.exp() > 100.0);
        let bone = Tissue { name: "bone".to_owned(), labels: vec![9] };
        assert!(matches!(log_prior(&bone, &PriorSettings::default()), Err(PriorError::UnknownTissue(_))));
        let none = samples_of_prior(&Tissue::whole_brain(), &[], 0.45, &PriorSettings::default());
        assert!(matches!(none, Err(PriorError::NoLevels)));
    }

    #[test]
    fn the_joint_prior_of_ogdens_law_has_an_exponent_off_its_bound_and_a_modulus_near_the_neo_hookean_one() {
        let tissue = &Tissue::grey_and_white()[0];
        let ogden = law_priors(
            std::slice::from_ref(tissue),
            &PriorSettings { law: MetaModel::OGDEN, ..PriorSettings::default() },
        )
        .unwrap();
        let neo = law_priors(std::slice::from_ref(tissue), &PriorSettings::default()).unwrap();
        assert_eq!((ogden.len(), neo.len()), (2, 1));
        assert!((ogden[0].1.mean - neo[0].1.mean).abs() < 0.5 * neo[0].1.sd.unwrap(), "{ogden:?} {neo:?}");
        assert!(ogden[1].1.mean < -6.0 && ogden[1].1.sd.unwrap() > 0.1, "{ogden:?}");
        assert!(ogden[1].1.correlation[0].abs() < 1.0);
        // Random curves share their shape, studies do not: a limit is known within powers of ten, in its logarithm.
        let gent = PriorSettings { law: "gent".parse().unwrap(), ..PriorSettings::default() };
        let gent = law_priors(std::slice::from_ref(tissue), &gent).unwrap();
        let limit = &gent[1].1;
        assert_eq!((limit.scale, limit.name.as_str()), (Scale::Logarithm, "jm of grey_matter"));
        assert!(limit.of_average().sd.unwrap() > 1.0 && limit.correlation[0].abs() < 1.0, "{limit:?}");
    }
}
