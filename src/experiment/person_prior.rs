//! What the study-level model expects of the tissue of a person nobody has measured.

use super::moments::mean_and_sd;
use crate::material::Task;
use crate::material::generative::{SampleSettings, SampledMaterial};
use crate::material::literature::{Curves, table};
use crate::material::study_level::{
    Evidence, FitError, MeanPosterior, ModuliPrior, Of, Spreads, Studies, StudyLevelPrior, drawn_materials,
    materials_at_levels, predict, predict_jointly, refit,
};
use crate::material::task::stretches;
use nalgebra::DMatrix;
use std::sync::OnceLock;

/// A fitted model: spreads of highest posterior density, and the tasks' means under them.
type Fitted = Result<(Spreads, MeanPosterior), FitError>;

/// Fitted once in a program: some seconds, and the same every time.
static CORRECTED: OnceLock<Fitted> = OnceLock::new();
static PUBLISHED: OnceLock<Fitted> = OnceLock::new();

fn fitted(curves: Curves) -> Fitted {
    let publications = Studies::from_literature(&table(), curves);
    let spreads = refit(&publications, &Spreads::default())?.spreads;
    let evidence = Evidence::new(&publications, &spreads).ok_or(FitError::NotFinite)?;
    Ok((spreads, evidence.means))
}

fn known(curves: Curves) -> Result<&'static (Spreads, MeanPosterior), FitError> {
    let known = match curves {
        Curves::Published => &PUBLISHED,
        Curves::Corrected => &CORRECTED,
    };
    known.get_or_init(|| fitted(curves)).as_ref().map_err(Clone::clone)
}

/// The prediction for one task at `points` stretches over its window, from the embedded studies.
///
/// # Errors
/// [`FitError`] where the embedded studies cannot be fitted.
pub fn person_prior(task: Task, curves: Curves, points: usize) -> Result<StudyLevelPrior, FitError> {
    let (spreads, means) = known(curves)?;
    let [low, high] = task.stretch_window();
    Ok(predict(means, spreads, task, Of::Person, &stretches(low, high, points)))
}

/// Persons drawn for the moments of a modulus: its standard deviation is known to 3 %.
const PERSONS: u64 = 500;

/// Laws at these standard deviations of ln(shear modulus) over persons, each fitted to a whole random function; their shape is
/// that of the mean function. An envelope at so many standard deviations everywhere would be no person's: shapes differ, too.
///
/// # Errors
/// [`FitError`], also for a law that cannot be fitted.
pub fn person_materials(
    task: Task,
    sd_levels: &[f64],
    points: usize,
    settings: &SampleSettings,
) -> Result<Vec<SampledMaterial>, FitError> {
    let person = person_prior(task, settings.curves, points)?;
    let drawn = drawn_materials(&person, PERSONS, 0, settings)?;
    let logs: Vec<f64> = drawn.iter().map(|d| d.shear_modulus_pa.ln()).collect();
    let (mean, sd) = mean_and_sd(&logs);
    let of_mean = materials_at_levels(&person, &[0.0], settings)?.remove(0);
    let at = |level: &f64| {
        let mut moved = person.clone();
        // An energy that is so many times as large has a law that is as many times as stiff.
        let change = mean + level * sd - of_mean.shear_modulus_pa.ln();
        moved.mean.iter_mut().for_each(|log_modulus| *log_modulus += change);
        let material = materials_at_levels(&moved, &[0.0], settings)?.remove(0);
        Ok(SampledMaterial { sd_level: *level, ..material })
    };
    sd_levels.iter().map(at).collect()
}

/// How ln(shear modulus) of several tasks goes together in persons nobody has measured: correlations, row by row.
///
/// # Errors
/// [`FitError`], also for a law that cannot be fitted.
pub fn person_correlations(tasks: &[Task], points: usize, settings: &SampleSettings) -> Result<DMatrix<f64>, FitError> {
    let (spreads, means) = known(settings.curves)?;
    let joint = predict_jointly(means, spreads, tasks, Of::Person, points);
    let moduli = ModuliPrior::from_draws(&joint, PERSONS, 0, settings)?;
    let (sds, covariance) = (moduli.sds_ln(), moduli.covariance_ln);
    Ok(DMatrix::from_fn(tasks.len(), tasks.len(), |i, j| covariance[i][j] / (sds[i] * sds[j])))
}
