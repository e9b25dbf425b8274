//! The generative model in one call: literature, Gaussian process, meta-model; everything embedded, no file, no
//! network, a few milliseconds.
//!
//! ```
//! use hgm::material::{Task, generative::{SampleSettings, nine_levels, sample_shear_moduli}};
//! let samples = sample_shear_moduli(Task::HYPERELASTIC_HEALTHY, &nine_levels(), &SampleSettings::default())?;
//! assert_eq!(samples.len(), 9);
//! assert!(samples.windows(2).all(|pair| pair[0].shear_modulus_pa < pair[1].shear_modulus_pa));
//! # Ok::<(), hgm::material::meta_model::FitError>(())
//! ```

use super::gp::{Hyperparameters, JointPosterior, Spread, TissuePrior, joint_posterior, posterior};
use super::literature::{Curves, LiteratureModel, table};
use super::meta_model::{Fit, FitError, MetaModel, MetaModelSettings, Search, fit};
use super::task::{Task, stretches};
use super::training::TrainingData;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How samples are made.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleSettings {
    /// Curves of the two studies the published program coded differently.
    pub curves: Curves,
    /// Hyperparameters of the Gaussian process.
    pub hyperparameters: Hyperparameters,
    /// The law fitted to each sample.
    pub model: MetaModel,
    /// How it is fitted.
    pub meta_model: MetaModelSettings,
    /// Stretches over the task's window.
    pub stretches: usize,
}

impl Default for SampleSettings {
    /// The literature as its papers have it, the published hyperparameters, an exactly fitted neo-Hookean law.
    fn default() -> Self {
        Self {
            curves: Curves::Corrected,
            hyperparameters: Hyperparameters::published(),
            model: MetaModel::NEO_HOOKEAN,
            meta_model: MetaModelSettings::default(),
            stretches: 501,
        }
    }
}

impl SampleSettings {
    /// All choices of the published program: its figures come out.
    pub fn published() -> Self {
        let meta_model = MetaModelSettings { search: Search::Published, ..MetaModelSettings::default() };
        Self { curves: Curves::Published, meta_model, ..Self::default() }
    }
}

/// Which generative model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GenerativeModel {
    /// The Gaussian process of the paper: studies are noise about one function a task.
    #[default]
    Published,
    /// Studies differ from one another, and curves within them: what is expected of a person nobody has measured.
    StudyLevel,
}

impl std::str::FromStr for GenerativeModel {
    type Err = String;
    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "published" => Ok(Self::Published),
            "study-level" => Ok(Self::StudyLevel),
            _ => Err("say published or study-level".to_owned()),
        }
    }
}

/// A material for a simulation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SampledMaterial {
    /// Standard deviations from the mean of ln W.
    pub sd_level: f64,
    /// Small-strain shear modulus, Pa.
    pub shear_modulus_pa: f64,
    /// The fitted law.
    pub fit: Fit,
}

/// -2, -1.5 ... 2 standard deviations: the nine samples of the paper's sweeps.
pub fn nine_levels() -> [f64; 9] {
    std::array::from_fn(|i| -2.0 + 0.5 * i as f64)
}

/// What the Gaussian process says of one task, over its window.
pub fn tissue_prior(task: Task, settings: &SampleSettings) -> TissuePrior {
    let data = TrainingData::from_literature(&table(), settings.curves);
    let [low, high] = task.stretch_window();
    posterior(&settings.hyperparameters, &data, task, &stretches(low, high, settings.stretches))
}

/// Materials at these standard deviations of one task's Gaussian process, with the sd of a new observation as in the
/// paper: each is a quantile envelope of ln W with the law fitted to it.
///
/// # Errors
/// [`FitError`] when the settings leave fewer stretches than the law needs.
pub fn sample_shear_moduli(
    task: Task,
    sd_levels: &[f64],
    settings: &SampleSettings,
) -> Result<Vec<SampledMaterial>, FitError> {
    sample_prior(&tissue_prior(task, settings), sd_levels, settings)
}

/// Same, from a prior at hand.
///
/// # Errors
/// As [`sample_shear_moduli`].
pub fn sample_prior(
    prior: &TissuePrior,
    sd_levels: &[f64],
    settings: &SampleSettings,
) -> Result<Vec<SampledMaterial>, FitError> {
    let sample = |sd_level: &f64| {
        let fit = fit(settings.model, &prior.stretches, &prior.quantile(*sd_level), &settings.meta_model)?;
        Ok(SampledMaterial { sd_level: *sd_level, shear_modulus_pa: fit.shear_modulus_pa, fit })
    };
    sd_levels.iter().map(sample).collect()
}

/// What the Gaussian process over these studies says of one task, over its window, with covariances between stretches.
pub fn joint_tissue_prior(task: Task, studies: &[LiteratureModel], settings: &SampleSettings) -> JointPosterior {
    let data = TrainingData::from_literature(studies, settings.curves);
    let [low, high] = task.stretch_window();
    joint_posterior(&settings.hyperparameters, &data, task, &stretches(low, high, settings.stretches))
}

/// A material fitted to a random curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DrawnMaterial {
    /// Number of the draw.
    pub draw: u64,
    /// Small-strain shear modulus, Pa.
    pub shear_modulus_pa: f64,
    /// The fitted law.
    pub fit: Fit,
}

/// Materials fitted to draws 0, 1, ... of whole curves; draw n is the same whatever their number.
///
/// # Errors
/// As [`sample_shear_moduli`].
pub fn draw_materials(
    joint: &JointPosterior,
    draws: u64,
    seed: u64,
    spread: Spread,
    settings: &SampleSettings,
) -> Result<Vec<DrawnMaterial>, FitError> {
    let one = |draw: u64| {
        let targets = joint.draw(seed, draw, spread);
        let fit = fit(settings.model, &joint.prior.stretches, &targets, &settings.meta_model)?;
        Ok(DrawnMaterial { draw, shear_modulus_pa: fit.shear_modulus_pa, fit })
    };
    (0..draws).into_par_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moduli(task: Task, levels: &[f64], settings: &SampleSettings) -> Vec<f64> {
        let samples = sample_shear_moduli(task, levels, settings).unwrap();
        samples.into_iter().map(|sample| sample.shear_modulus_pa).collect()
    }

    #[test]
    fn published_settings_reproduce_the_shear_moduli_of_the_papers_first_table() {
        let settings = SampleSettings::published();
        // Granados et al., IJCARS 2021, Table 1; the printed table lost the minus signs of its SDs.
        let linear = |region| Task { kind: crate::material::StudyKind::Linear, region };
        let cases: [(Task, &[f64], &[f64]); 5] = [
            (
                Task::HYPERELASTIC_GREY,
                &[-2.0, -1.5, -1.0, -0.5, 0.5, 2.0],
                &[525.0, 628.0, 754.0, 912.0, 1317.0, 2299.0],
            ),
            (
                Task::HYPERELASTIC_WHITE,
                &[-2.0, -1.5, -1.0, -0.5, 0.0, 2.0],
                &[309.0, 365.0, 440.0, 519.0, 610.0, 1195.0],
            ),
            (Task::HYPERELASTIC_HEALTHY, &[-0.5], &[353.0]),
            (linear(crate::material::Region::Healthy), &[-0.5], &[465.0]),
            (linear(crate::material::Region::Grey), &[0.0], &[2746.0]),
        ];
        for (task, levels, table) in cases {
            for (found, printed) in moduli(task, levels, &settings).into_iter().zip(table) {
                assert!((found - printed).abs() < 1.0, "{task}: {found} against {printed}");
            }
        }
    }

    #[test]
    fn the_exact_jacobian_gives_the_moduli_that_the_published_search_stops_short_of() {
        let mut settings = SampleSettings::published();
        settings.meta_model = MetaModelSettings::default();
        let grey = moduli(Task::HYPERELASTIC_GREY, &[-2.0, -1.5, -1.0, -0.5, 0.5, 2.0], &settings);
        for (found, exact) in grey.iter().zip([528.7, 636.0, 765.0, 920.2, 1331.0, 2314.9]) {
            assert!((found - exact).abs() < 0.06, "{found} against {exact}");
        }
        let white = moduli(Task::HYPERELASTIC_WHITE, &[-2.0, -1.5, -1.0, -0.5, 0.0, 2.0], &settings);
        for (found, exact) in white.iter().zip([314.8, 372.4, 440.5, 521.0, 616.2, 1205.1]) {
            assert!((found - exact).abs() < 0.06, "{found} against {exact}");
        }
    }

    #[test]
    fn default_samples_rise_with_the_level_and_are_stable_everywhere() {
        for task in [Task::HYPERELASTIC_GREY, Task::HYPERELASTIC_WHITE, Task::HYPERELASTIC_HEALTHY] {
            let samples = sample_shear_moduli(task, &nine_levels(), &SampleSettings::default()).unwrap();
            assert!(samples.windows(2).all(|pair| pair[0].shear_modulus_pa < pair[1].shear_modulus_pa));
            assert!(samples.iter().all(|sample| sample.fit.stability.everywhere() && sample.fit.converged));
        }
    }

    #[test]
    fn every_draw_is_fitted_by_a_stable_law() {
        let cases = [
            (MetaModel::NEO_HOOKEAN, 10_000, Task::HYPERELASTIC_WHITE),
            (MetaModel::MOONEY_RIVLIN, 300, Task::HYPERELASTIC_GREY),
            (MetaModel::OGDEN, 300, Task::HYPERELASTIC_HEALTHY),
        ];
        for (model, draws, task) in cases {
            let settings = SampleSettings { stretches: 101, model, ..SampleSettings::default() };
            let joint = joint_tissue_prior(task, &table(), &settings);
            let materials = draw_materials(&joint, draws, 11, Spread::Study, &settings).unwrap();
            let stable = |m: &&DrawnMaterial| m.fit.stability.everywhere() && m.shear_modulus_pa > 0.0;
            assert_eq!(materials.iter().filter(stable).count() as u64, draws, "{model}");
        }
    }

    #[test]
    fn moduli_of_draws_spread_around_that_of_the_mean_curve() {
        let settings = SampleSettings { stretches: 101, ..SampleSettings::default() };
        let joint = joint_tissue_prior(Task::HYPERELASTIC_WHITE, &table(), &settings);
        let middle = sample_prior(&joint.prior, &[0.0], &settings).unwrap()[0].shear_modulus_pa;
        let mut moduli: Vec<f64> = draw_materials(&joint, 999, 5, Spread::Study, &settings)
            .unwrap()
            .into_iter()
            .map(|m| m.shear_modulus_pa)
            .collect();
        moduli.sort_by(f64::total_cmp);
        assert!((moduli[499] / middle - 1.0).abs() < 0.05, "{} {middle}", moduli[499]);
        // The noise alone has an sd of 0.33 in ln W.
        assert!(moduli[840] / moduli[499] > 1.25 && moduli[840] / moduli[499] < 1.6);
    }
}
