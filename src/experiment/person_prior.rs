//! What the study-level model expects of the tissue of a person nobody has measured.

use crate::material::Task;
use crate::material::literature::{Curves, table};
use crate::material::study_level::{
    Evidence, FitError, MeanPosterior, Of, Spreads, Studies, StudyLevelPrior, predict, refit,
};
use crate::material::task::stretches;
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

/// The prediction for one task at `points` stretches over its window, from the embedded studies.
///
/// # Errors
/// [`FitError`] where the embedded studies cannot be fitted.
pub fn person_prior(task: Task, curves: Curves, points: usize) -> Result<StudyLevelPrior, FitError> {
    let known = match curves {
        Curves::Published => &PUBLISHED,
        Curves::Corrected => &CORRECTED,
    };
    let (spreads, means) = known.get_or_init(|| fitted(curves)).as_ref().map_err(Clone::clone)?;
    let [low, high] = task.stretch_window();
    Ok(predict(means, spreads, task, Of::Person, &stretches(low, high, points)))
}
