//! Laws fitted to a laboratory's test in a file, or to a literature model.

use super::error::{AskedError, WorkflowError};
use super::generative::Studies;
use super::user_file::read_input;
use crate::material::law::Material;
use crate::material::literature::citation;
use crate::material::meta_model::{Fit, MetaModel, MetaModelSettings};
use crate::material::rheometry::{Measured, Rheometry, fit_rheometry, read_rheometry};
use serde::Serialize;
use std::path::Path;

/// What laws are fitted to.
#[derive(Clone, Debug)]
pub struct LawTest {
    /// The file, or the model with its citation.
    pub name: String,
    /// The points.
    pub points: Rheometry,
}

impl LawTest {
    /// A uniaxial test (CSV).
    ///
    /// # Errors
    /// A file that cannot be read or is no test.
    pub fn measured(file: &Path) -> Result<Self, WorkflowError> {
        let name = file.display().to_string();
        let points = read_rheometry(&read_input(file)?);
        let points = points.map_err(|source| WorkflowError::Rheometry { file: name.clone(), source })?;
        Ok(Self { name, points })
    }

    /// A literature model by its id.
    ///
    /// # Errors
    /// An id that the studies do not hold.
    pub fn literature(id: u32, studies: &Studies) -> Result<Self, WorkflowError> {
        let model = studies.model(id)?;
        let curve = model.curve(studies.curves);
        let values_pa = curve.energies_pa.iter().map(|w| w.max(0.0)).collect();
        let words = [model.study.clone(), citation(model)].into_iter().filter(|w| !w.is_empty()).collect::<Vec<_>>();
        let name = format!("literature model {id} {}", words.join(", "));
        Ok(Self { name, points: Rheometry { measured: Measured::Energy, stretches: curve.stretches, values_pa } })
    }
}

/// One fitted law.
#[derive(Clone, Debug, Serialize)]
pub struct FittedLaw {
    /// The fit.
    pub fit: Fit,
    /// Names of its parameters.
    pub parameter_names: &'static [&'static str],
    /// Their standard deviations.
    pub parameter_sd: Vec<f64>,
    /// Whether the law is stable at every stretch.
    pub stable_everywhere: bool,
    /// A `[materials.NAME]` table of a scenario.
    pub material: Material,
}

/// Each law fitted to a test, or every one where none is named; `poisson_ratio` is that of the materials.
///
/// # Errors
/// A ratio out of range, points that cannot determine a law.
pub fn fit_laws(
    test: &LawTest,
    laws: &[MetaModel],
    poisson_ratio: f64,
    settings: &MetaModelSettings,
) -> Result<Vec<FittedLaw>, WorkflowError> {
    if !(0.0..0.5).contains(&poisson_ratio) {
        return Err(AskedError::PoissonRatio { poisson_ratio }.into());
    }
    let laws = if laws.is_empty() { MetaModel::all().collect() } else { laws.to_vec() };
    let fitted = |law: MetaModel| {
        let fit = fit_rheometry(law, &test.points, settings)
            .map_err(|source| WorkflowError::LawOfTest { test: test.name.clone(), source })?;
        let parameter_sd = (0..fit.parameters.len()).map(|i| fit.covariance[i][i].sqrt()).collect();
        let material = fit.material(poisson_ratio);
        let (parameter_names, stable_everywhere) = (law.parameter_names(), fit.stability.everywhere());
        Ok(FittedLaw { fit, parameter_names, parameter_sd, stable_everywhere, material })
    };
    laws.into_iter().map(fitted).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_that_no_material_has_is_refused_before_anything_is_fitted() {
        // Points that no law could be fitted to.
        let points = Rheometry { measured: Measured::Energy, stretches: Vec::new(), values_pa: Vec::new() };
        let test = LawTest { name: "test.csv".to_owned(), points };
        for poisson_ratio in [0.5, -0.1, f64::NAN] {
            let refused = fit_laws(&test, &[], poisson_ratio, &MetaModelSettings::default()).unwrap_err();
            assert!(matches!(refused, WorkflowError::Asked(AskedError::PoissonRatio { .. })), "{refused}");
        }
    }
}
