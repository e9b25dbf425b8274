//! Many simulations of one body that differ only in their materials, each held against one reference.

use super::observed::ObservedSurfaces;
use super::outcome::SampleOutcome;
use super::rmse::{node_errors_mm, root_mean_square};
use super::sample::{Sample, Tissue};
use crate::fem::{FemError, Outcome, Progress, Scenario, simulate};
use crate::mesh::TetMesh;
use std::collections::BTreeMap;
use thiserror::Error;

/// What a simulation is compared with.
#[derive(Clone, Debug)]
pub enum Reference {
    /// A displacement of the same nodes, mm: a phantom.
    Nodes(Vec<[f64; 3]>),
    /// Surfaces seen after surgery.
    Surfaces(ObservedSurfaces),
}

/// Errors of one state against the reference.
#[derive(Clone, Debug)]
pub struct StateErrors {
    /// RMSE per set, mm; a phantom has the one set `all`.
    pub rmse_mm: BTreeMap<String, f64>,
    /// Symmetric distance between the surfaces, root mean square per set, mm; none for a phantom.
    pub surface_distance_mm: BTreeMap<String, f64>,
    /// Error per node, mm; zero where `node_observed` is false.
    pub node_error_mm: Vec<f64>,
    /// Whether the reference says anything of the node.
    pub node_observed: Vec<bool>,
}

/// One simulated sample.
#[derive(Debug)]
pub struct SolvedSample {
    /// Its line in the outcome.
    pub record: SampleOutcome,
    /// The deformed state with its errors, or why no equilibrium was found.
    pub state: Result<(Outcome, StateErrors), FemError>,
}

/// Why a sweep cannot go on (a sample without equilibrium is recorded, not an error).
#[derive(Debug, Error)]
pub enum SweepError {
    /// The sample does not fit the tissues.
    #[error("sample {id}, tissue `{tissue}`: {reason}")]
    Law {
        /// The sample.
        id: String,
        /// Its tissue.
        tissue: String,
        /// What is wrong.
        reason: String,
    },
    /// The scenario or mesh was refused.
    #[error(transparent)]
    Fem(#[from] FemError),
}

impl Reference {
    /// Errors of a displacement (mm per node).
    pub fn errors(&self, mesh: &TetMesh, displacement_mm: &[[f64; 3]]) -> StateErrors {
        match self {
            Self::Nodes(reference_mm) => {
                let node_error_mm = node_errors_mm(displacement_mm, reference_mm);
                let all = root_mean_square(&node_error_mm).map(|rmse| ("all".to_owned(), rmse));
                StateErrors {
                    rmse_mm: all.into_iter().collect(),
                    surface_distance_mm: BTreeMap::new(),
                    node_observed: vec![true; node_error_mm.len()],
                    node_error_mm,
                }
            }
            Self::Surfaces(observed) => {
                let errors = observed.errors(mesh, displacement_mm);
                StateErrors {
                    rmse_mm: errors.rmse_mm,
                    surface_distance_mm: errors.symmetric.into_iter().map(|(set, d)| (set, d.rms_mm)).collect(),
                    node_error_mm: errors.node_error_mm,
                    node_observed: errors.node_observed,
                }
            }
        }
    }
}

/// The scenario `template` with the sample's materials; tissues that are not varied keep those of the template, unless the
/// sample has one of that name (a lesion's).
///
/// # Errors
/// [`SweepError::Law`] when a tissue has no material or a label no name.
pub fn scenario_of(template: &Scenario, tissues: &[Tissue], sample: &Sample) -> Result<Scenario, SweepError> {
    let mut scenario = template.clone();
    for tissue in tissues {
        let refuse = |reason: String| SweepError::Law { id: sample.id.clone(), tissue: tissue.name.clone(), reason };
        let material =
            &sample.tissues.get(&tissue.name).ok_or_else(|| refuse("the sample has none".to_owned()))?.material;
        for &label in &tissue.labels {
            let name = template.label_name(label).ok_or_else(|| refuse(format!("label {label} has no name")))?;
            scenario.materials.insert(name.to_owned(), material.clone());
        }
    }
    for (name, own) in sample.tissues.iter().filter(|(name, _)| tissues.iter().all(|tissue| tissue.name != **name)) {
        let Some(material) = scenario.materials.get_mut(name) else {
            let reason = "the body has no such tissue".to_owned();
            return Err(SweepError::Law { id: sample.id.clone(), tissue: name.clone(), reason });
        };
        material.clone_from(&own.material);
    }
    Ok(scenario)
}

/// Simulates one sample and compares it.
///
/// # Errors
/// [`SweepError`] when the scenario or the mesh is refused.
pub fn solve_sample(
    mesh: &TetMesh,
    template: &Scenario,
    tissues: &[Tissue],
    sample: &Sample,
    reference: &Reference,
    progress: &dyn Fn(&Progress),
) -> Result<SolvedSample, SweepError> {
    let scenario = scenario_of(template, tissues, sample)?;
    let mut record = SampleOutcome {
        id: sample.id.clone(),
        task: sample.task.map(|task| task.to_string()),
        sd_levels: sample.tissues.iter().map(|(name, t)| (name.clone(), t.sd_level)).collect(),
        shear_modulus_pa: sample.tissues.iter().map(|(name, t)| (name.clone(), t.shear_modulus_pa)).collect(),
        laws: sample.tissues.iter().map(|(name, t)| (name.clone(), t.law())).collect(),
        rmse_mm: BTreeMap::new(),
        surface_distance_mm: BTreeMap::new(),
        converged: false,
        newton_iterations: 0,
        relative_residuals: Vec::new(),
        displacement_max_mm: None,
        file: None,
    };
    let outcome = match simulate(mesh, &scenario, progress) {
        Ok(outcome) => outcome,
        Err(error @ FemError::NoEquilibrium { .. }) => {
            return Ok(SolvedSample { record, state: Err(error) });
        }
        Err(error) => return Err(error.into()),
    };
    let errors = reference.errors(mesh, &outcome.displacement_mm);
    record.rmse_mm.clone_from(&errors.rmse_mm);
    record.surface_distance_mm.clone_from(&errors.surface_distance_mm);
    record.converged = true;
    record.newton_iterations = outcome.convergence.iterations.len();
    record.relative_residuals = outcome.convergence.iterations.iter().map(|i| i.relative_residual).collect();
    record.displacement_max_mm = Some(largest_norm(&outcome.displacement_mm));
    Ok(SolvedSample { record, state: Ok((outcome, errors)) })
}

fn largest_norm(vectors: &[[f64; 3]]) -> f64 {
    vectors.iter().map(|v| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()).fold(0.0, f64::max)
}

/// The converged sample with the smallest RMSE at `set`; the first one on a tie.
pub fn best_sample<'a>(samples: &'a [SampleOutcome], set: &str) -> Option<&'a SampleOutcome> {
    let rmse = |s: &SampleOutcome| s.rmse_mm.get(set).copied();
    let known = samples.iter().filter(|s| s.converged && rmse(s).is_some());
    known.min_by(|a, b| rmse(a).unwrap_or(f64::MAX).total_cmp(&rmse(b).unwrap_or(f64::MAX)))
}
