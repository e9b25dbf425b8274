//! What an experiment found: the numbers behind its report, as they are kept in `sim/outcome.json`.
//!
//! Lengths in mm, moduli in Pa, areas in mm2, volumes in cc. A figure that could not be computed is absent, never NaN
//! (JSON has none). Maps are ordered by name, samples in order of their grid: the same experiment gives the same bytes.

pub use super::law_outcome::LawOutcome;

use super::compare::Comparison;
use super::estimate::EstimateOutcome;
use super::verdict::Verdict;
use crate::segment::ScanQualities;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use thiserror::Error;

/// Which experiment was run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ExperimentKind {
    /// A reference simulated with known moduli, looked for again among the samples.
    Phantom,
    #[default]
    /// A patient: the rest mesh without the resected tissue against the post-operative surfaces.
    Resection,
    /// A patient before an operation: how the brain will move.
    Prediction,
}

/// What two scans say where no operation can be followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    /// One head twice, and nothing was taken out.
    NoOperation,
    /// Two heads.
    NotOnePerson,
}

impl Answer {
    /// The word of tables and of JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoOperation => "no-operation",
            Self::NotOnePerson => "not-one-person",
        }
    }
}

/// The name of an estimate's state among the samples.
pub const ESTIMATE: &str = "estimate";

/// One experiment: settings' worth of samples against one reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExperimentOutcome {
    /// Which experiment.
    pub kind: ExperimentKind,
    /// Why there is nothing more, where the scans themselves say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answer: Option<Answer>,
    /// What the samples are compared with, one sentence.
    pub reference: String,
    /// Tissues whose material is varied (`grey_matter`, ...), in the order of the grid's axes.
    pub tissues: Vec<String>,
    /// Every sample, in the order of the grid.
    pub samples: Vec<SampleOutcome>,
    /// `id` of the sample with the smallest RMSE.
    pub best_sample: Option<String>,
    /// The estimate, where one was made.
    #[serde(default)]
    pub estimate: Option<EstimateOutcome>,
    /// RMSE of the undeformed mesh per node set, mm: what a sample must beat.
    #[serde(default)]
    pub rest_rmse_mm: BTreeMap<String, f64>,
    /// The same as symmetric distance between surfaces, mm.
    #[serde(default)]
    pub rest_surface_distance_mm: BTreeMap<String, f64>,
    /// The moduli behind the reference where they are known (a phantom's truth), Pa per tissue.
    #[serde(default)]
    pub reference_shear_modulus_pa: BTreeMap<String, f64>,
    /// Tissues that were not varied but held at the mean of their prior (tumour, oedema): shear modulus, Pa.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub held_shear_modulus_pa: BTreeMap<String, f64>,
    /// Measurement errors below which differences mean nothing.
    #[serde(default)]
    pub noise_floor: Option<NoiseFloor>,
    /// Volumes of a resection.
    #[serde(default)]
    pub volumes: Option<ResectionVolumes>,
    /// How good the scans are; absent from cases of before it was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scans: Option<ScanQualities>,
    /// The boundary sets of the mesh.
    #[serde(default)]
    pub sets: Vec<SetOutcome>,
    /// The registrations behind the case, in the order they were run.
    #[serde(default)]
    pub registrations: Vec<RegistrationOutcome>,
    /// The mesh and its quality.
    #[serde(default)]
    pub mesh: Option<MeshOutcome>,
    /// Loads in words, for the methods paragraph: "gravity 9.81 m/s2 towards -z".
    #[serde(default)]
    pub loads: Vec<String>,
    /// Warnings in the order they were raised.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// What it comes down to; found once all else is there ([`ExperimentOutcome::with_verdict`]).
    #[serde(default)]
    pub verdict: Verdict,
    /// The models that an estimate has tried, where there were several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
}

/// One simulation of a sweep.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleOutcome {
    /// Name of the sample, part of its file's name: `sample-05`.
    pub id: String,
    /// The task its material comes from, where several are compared: `hyperelastic-grey`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// How many standard deviations of the prior each tissue lies from its mean.
    #[serde(default)]
    pub sd_levels: BTreeMap<String, f64>,
    /// Shear modulus at rest per tissue, Pa.
    pub shear_modulus_pa: BTreeMap<String, f64>,
    /// The constitutive law per tissue.
    #[serde(default)]
    pub laws: BTreeMap<String, LawOutcome>,
    /// RMSE per node set (`all`, `ventricle`, `margin`), mm; empty when the sample did not converge.
    #[serde(default)]
    pub rmse_mm: BTreeMap<String, f64>,
    /// Symmetric distance between the set's surface and the observed one, root mean square, mm: closest points alone hide
    /// what of the observed surface nothing comes near to. Empty for a phantom.
    #[serde(default)]
    pub surface_distance_mm: BTreeMap<String, f64>,
    /// Whether the solver reached its tolerance.
    pub converged: bool,
    /// Newton iterations over all load steps.
    #[serde(default)]
    pub newton_iterations: usize,
    /// Relative residual after every Newton iteration.
    #[serde(default)]
    pub relative_residuals: Vec<f64>,
    /// Largest displacement, mm.
    #[serde(default)]
    pub displacement_max_mm: Option<f64>,
    /// The sample's mesh file, relative to the case directory: `sim/sample-05.vtu`.
    #[serde(default)]
    pub file: Option<String>,
}

/// Errors of the measurement itself, mm, each where it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseFloor {
    /// Expected error of the rigid registration over the brain.
    #[serde(default)]
    pub registration_mm: Option<f64>,
    /// What the voxel size alone costs.
    #[serde(default)]
    pub voxel_mm: Option<f64>,
    /// Expected error of the segmented surfaces.
    #[serde(default)]
    pub segmentation_mm: Option<f64>,
    /// What the pair itself shows where nothing can have moved, on the mesh and surfaces in use: all the others in one,
    /// measured instead of expected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_rest_mm: Option<f64>,
}

impl NoiseFloor {
    /// What was measured at rest, else the expected parts together as independent errors, mm; `None` when none is known.
    pub fn combined_mm(&self) -> Option<f64> {
        if self.at_rest_mm.is_some() {
            return self.at_rest_mm;
        }
        let parts = [self.registration_mm, self.voxel_mm, self.segmentation_mm];
        let squares: Vec<f64> = parts.iter().flatten().map(|mm| mm * mm).collect();
        (!squares.is_empty()).then(|| squares.iter().sum::<f64>().sqrt())
    }
}

/// What the images show of a resection: volumes in cubic centimetres, and the midline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResectionVolumes {
    /// The cavity on the post-operative image.
    #[serde(default)]
    pub cavity_cc: Option<f64>,
    /// The resected tissue on the pre-operative image, without the fluid between it.
    #[serde(default)]
    pub resected_cc: Option<f64>,
    /// The ventricles before surgery.
    #[serde(default)]
    pub ventricle_before_cc: Option<f64>,
    /// The ventricles after surgery.
    #[serde(default)]
    pub ventricle_after_cc: Option<f64>,
    /// The brain before surgery.
    #[serde(default)]
    pub brain_cc: Option<f64>,
    /// How far the septum pellucidum has moved sideways, mm; positive to the right.
    #[serde(default)]
    pub midline_shift_mm: Option<f64>,
}

/// One boundary set of the mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SetOutcome {
    /// Name: `ventricle`, `margin`, `base`, `falx`, `superior`.
    pub name: String,
    /// Nodes in the set.
    pub nodes: usize,
    /// Area of its facets, mm2.
    #[serde(default)]
    pub area_mm2: Option<f64>,
    /// Area-weighted centre, mm, RAS+ of the MNI frame.
    #[serde(default)]
    pub centroid_mm: Option<[f64; 3]>,
}

/// One rigid registration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegistrationOutcome {
    /// Frame of the moving image: `post`.
    pub moving: String,
    /// Frame of the fixed image: `pre`.
    pub fixed: String,
    /// Rotation angle of the result, degrees.
    pub rotation_deg: f64,
    /// Translation of the brain's centre, mm.
    pub translation_mm: [f64; 3],
    /// The similarity's name: `Mattes mutual information`; [`GIVEN_BY_HAND`] where nothing was compared.
    pub similarity: String,
    /// Similarity at the start.
    #[serde(default)]
    pub similarity_before: Option<f64>,
    /// Similarity at the end.
    #[serde(default)]
    pub similarity_after: Option<f64>,
}

/// The similarity of a transform that was given and not looked for.
pub const GIVEN_BY_HAND: &str = "given by hand";

impl RegistrationOutcome {
    /// Whether it was given by hand: nothing was registered for it.
    pub fn is_by_hand(&self) -> bool {
        self.similarity == GIVEN_BY_HAND
    }
}

/// A mesh in numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshOutcome {
    /// The meshing engine: `lattice`, `cgal`, `gmsh`, `tetgen`.
    pub engine: String,
    /// Nodes.
    pub nodes: usize,
    /// Tetrahedra.
    pub tets: usize,
    /// Volume per label name, cc.
    #[serde(default)]
    pub volume_cc: BTreeMap<String, f64>,
    /// Smallest dihedral angle, degrees.
    #[serde(default)]
    pub dihedral_min_deg: Option<f64>,
    /// First percentile of the smallest dihedral angle of each tetrahedron, degrees.
    #[serde(default)]
    pub dihedral_percentile_1_deg: Option<f64>,
    /// Tetrahedra with a dihedral angle below 10 degrees, percent.
    #[serde(default)]
    pub dihedral_below_10_percent: Option<f64>,
    /// Dihedral angles in 18 parts of 10 degrees.
    #[serde(default)]
    pub dihedral_counts: Vec<usize>,
    /// Smallest radius ratio (1 is regular).
    #[serde(default)]
    pub radius_ratio_min: Option<f64>,
    /// Mean radius ratio (1 is regular).
    #[serde(default)]
    pub radius_ratio_mean: Option<f64>,
    /// Smallest scaled Jacobian (1 is regular).
    #[serde(default)]
    pub scaled_jacobian_min: Option<f64>,
    /// Volume against the label map, percent of its voxels, per label name.
    #[serde(default)]
    pub volume_error_percent: BTreeMap<String, f64>,
    /// Dice overlap with the label map per label name.
    #[serde(default)]
    pub dice: BTreeMap<String, f64>,
    /// Mean distance between the outer surface and the border of the labelled voxels, mm.
    #[serde(default)]
    pub surface_distance_mean_mm: Option<f64>,
    /// 95th percentile of that distance, mm.
    #[serde(default)]
    pub surface_distance_95_mm: Option<f64>,
}

/// Why a text is not an outcome.
#[derive(Debug, Error)]
#[error(
    "{name}: not an outcome of this version of hgm ({reason}); make it again with `hgm run`, `hgm sweep` or \
     `hgm phantom`"
)]
pub struct OutcomeError {
    name: String,
    reason: String,
}

impl ExperimentOutcome {
    /// The text of `sim/outcome.json`.
    ///
    /// # Errors
    /// [`OutcomeError`] when a number is not finite: JSON cannot hold it.
    pub fn to_json(&self, name: &str) -> Result<String, OutcomeError> {
        let fail = |reason: String| OutcomeError { name: name.to_owned(), reason };
        let value = serde_json::to_value(self).map_err(|e| fail(e.to_string()))?;
        // serde_json turns NaN into null without a word; reading it back would then fail far from the cause.
        let again: Result<Self, _> = serde_json::from_str(&value.to_string());
        again.map_err(|e| fail(format!("a figure is not a finite number: {e}")))?;
        serde_json::to_string_pretty(&value).map(|text| text + "\n").map_err(|e| fail(e.to_string()))
    }

    /// An outcome from the text of `sim/outcome.json`; `name` is the file's name for messages.
    ///
    /// # Errors
    /// [`OutcomeError`] naming file and place.
    pub fn from_json(text: &str, name: &str) -> Result<Self, OutcomeError> {
        serde_json::from_str(text).map_err(|e| OutcomeError { name: name.to_owned(), reason: e.to_string() })
    }

    /// The sample with the smallest RMSE, as named by `best_sample`.
    pub fn best(&self) -> Option<&SampleOutcome> {
        let id = self.best_sample.as_ref()?;
        self.samples.iter().find(|s| &s.id == id)
    }

    /// The state that the verdict is about: the estimate's where there is one, else the best sample's.
    pub fn judged(&self) -> Option<&SampleOutcome> {
        let estimate = self.estimate.as_ref().and_then(|_| self.samples.iter().find(|s| s.id == ESTIMATE));
        estimate.or_else(|| self.best())
    }

    /// Names of the node sets with an RMSE, `all` first, then in alphabetical order.
    pub fn rmse_sets(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for map in self.samples.iter().map(|s| &s.rmse_mm).chain([&self.rest_rmse_mm]) {
            names.extend(map.keys().cloned());
        }
        names.sort_by_key(|name| (name != "all", name.clone()));
        names.dedup();
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome() -> ExperimentOutcome {
        let sample = |n: usize, rmse: f64| SampleOutcome {
            task: None,
            id: format!("sample-{n:02}"),
            sd_levels: BTreeMap::from([("grey_matter".to_owned(), n as f64 - 1.0)]),
            shear_modulus_pa: BTreeMap::from([("grey_matter".to_owned(), 300.0 + 100.0 * n as f64)]),
            laws: BTreeMap::new(),
            rmse_mm: BTreeMap::from([("ventricle".to_owned(), rmse), ("all".to_owned(), rmse)]),
            surface_distance_mm: BTreeMap::new(),
            converged: true,
            newton_iterations: 5,
            relative_residuals: vec![1e-3, 1e-9],
            displacement_max_mm: Some(4.0),
            file: None,
        };
        ExperimentOutcome {
            kind: ExperimentKind::Phantom,
            reference: "a simulation".to_owned(),
            tissues: vec!["grey_matter".to_owned()],
            samples: vec![sample(0, 2.0), sample(1, 0.5)],
            best_sample: Some("sample-01".to_owned()),
            ..ExperimentOutcome::default()
        }
    }

    #[test]
    fn json_brings_the_same_outcome_back() {
        let text = outcome().to_json("outcome.json").unwrap();
        assert_eq!(ExperimentOutcome::from_json(&text, "outcome.json").unwrap(), outcome());
        assert_eq!(outcome().best().unwrap().id, "sample-01");
        assert_eq!(outcome().rmse_sets(), ["all", "ventricle"]);
    }

    #[test]
    fn nan_and_unknown_fields_are_refused_by_name() {
        let mut bad = outcome();
        bad.samples[0].rmse_mm.insert("all".to_owned(), f64::NAN);
        assert!(bad.to_json("outcome.json").unwrap_err().to_string().contains("outcome.json"));
        let text = outcome().to_json("x").unwrap().replacen("\"kind\"", "\"kinds\"", 1);
        assert!(ExperimentOutcome::from_json(&text, "outcome.json").unwrap_err().to_string().contains("kinds"));
    }

    #[test]
    fn independent_errors_add_in_squares() {
        let floor = NoiseFloor { registration_mm: Some(0.3), voxel_mm: Some(0.4), ..NoiseFloor::default() };
        assert!((floor.combined_mm().unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(
            NoiseFloor { at_rest_mm: Some(0.8), ..floor }.combined_mm(),
            Some(0.8),
            "measured wins over expected"
        );
        assert!(NoiseFloor::default().combined_mm().is_none());
    }
}
