//! The generative model over the literature.

use crate::arrays::array1;
use crate::errors::{raised, refused};
use hgm::cli::Failure;
use hgm::material::Task;
use hgm::material::generative::{SampleSettings, draw_materials, joint_tissue_prior, sample_prior};
use hgm::material::gp::{JointPosterior, Spread};
use hgm::material::literature::Curves;
use hgm::material::meta_model::{Fit, MetaModel};
use hgm::workflow::Studies;
use numpy::PyArray1;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Stretches over a task's window, as `hgm gp sample` has them.
const STRETCHES: usize = 501;

/// What the Gaussian process over the studies says of one task.
#[pyclass(frozen)]
pub struct Prior {
    joint: JointPosterior,
    settings: SampleSettings,
}

/// A fitted law with the table of a scenario that stands for it.
fn told(fit: &Fit, poisson_ratio: f64) -> serde_json::Value {
    serde_json::json!({ "fit": fit, "material": fit.material(poisson_ratio) })
}

#[pymethods]
impl Prior {
    #[new]
    fn new(py: Python<'_>, task: &str, law: &str, studies: Option<PathBuf>) -> PyResult<Self> {
        let task = task.parse::<Task>().map_err(|error| refused(py, &error.to_string()))?;
        let model: MetaModel = law.parse().map_err(|error: String| refused(py, &error))?;
        let made = move || {
            let studies = Studies::read(studies.as_deref(), Curves::Corrected)?;
            let settings = SampleSettings { model, stretches: STRETCHES, ..SampleSettings::default() };
            Ok(Self { joint: joint_tissue_prior(task, &studies.models, &settings), settings })
        };
        py.detach(made).map_err(|failure: Failure| raised(py, &failure))
    }

    /// Stretches over the task's window.
    fn stretches<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, self.joint.prior.stretches.clone())
    }

    /// Mean of ln W (W in Pa) at the stretches.
    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, self.joint.prior.mean.clone())
    }

    /// Standard deviations of ln W: of the tissue's own curve, and of a new observation.
    fn sds<'py>(&self, py: Python<'py>) -> [Bound<'py, PyArray1<f64>>; 2] {
        let prior = &self.joint.prior;
        [array1(py, prior.latent_sd.clone()), array1(py, prior.observation_sd.clone())]
    }

    /// Materials fitted to random curves, as JSON.
    fn draw(&self, py: Python<'_>, n: u64, seed: u64, study: bool, poisson_ratio: f64) -> PyResult<String> {
        let spread = if study { Spread::Study } else { Spread::Tissue };
        let drawn = py
            .detach(|| draw_materials(&self.joint, n, seed, spread, &self.settings))
            .map_err(|error| refused(py, &error.to_string()))?;
        let list: Vec<_> = drawn.iter().map(|one| told(&one.fit, poisson_ratio)).collect();
        Ok(serde_json::Value::from(list).to_string())
    }

    /// Materials at standard deviations from the mean, as JSON.
    fn levels(&self, py: Python<'_>, levels: Vec<f64>, poisson_ratio: f64) -> PyResult<String> {
        let found = py
            .detach(|| sample_prior(&self.joint.prior, &levels, &self.settings))
            .map_err(|error| refused(py, &error.to_string()))?;
        let list: Vec<_> = found.iter().map(|one| told(&one.fit, poisson_ratio)).collect();
        Ok(serde_json::Value::from(list).to_string())
    }
}
