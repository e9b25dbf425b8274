//! How an estimate is posed.

use crate::experiment::estimate::{DisplacementSettings, EstimateSettings, ShapeError};
use crate::fem::ElementKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a patient's estimate is fitted to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Observed {
    /// The displacement of the brain's depth, by deformable registration of the two scans.
    #[default]
    Displacement,
    /// The distance to the surfaces of ventricle and cavity, closest points.
    Surfaces,
}

/// What carries a patient's brain in an estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fluid {
    /// What `[resection]` says: an effective density, or the part of the fluid that `[resection.csf]` has drained.
    #[default]
    AsGiven,
    /// Fluid of which an unknown part has drained: that part is estimated with the moduli.
    Unknown,
    /// Both are tried and weighed by their evidence.
    Evidence,
}

impl Fluid {
    /// Whether an estimate tries a fluid of unknown level.
    pub fn may_be_unknown(self) -> bool {
        self != Self::AsGiven
    }

    /// Whether an estimate tries what is given.
    pub fn may_be_given(self) -> bool {
        self != Self::Unknown
    }
}

/// How the estimate is posed; the table `[estimate]` of the settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[allow(clippy::struct_excessive_bools, reason = "independent switches of a table of settings")]
pub struct EstimateOptions {
    /// The descent; its noise is the noise floor's where that is known.
    pub descent: EstimateSettings,
    /// What a patient's estimate is fitted to. Closest points pull towards no displacement at all: the surfaces are
    /// there for comparison with what is published.
    pub observed: Observed,
    /// Which nodes' displacement is believed, and how far.
    pub displacement: DisplacementSettings,
    /// Errors of a segmented surface are alike over this distance, mm: nodes nearer to each other count as one.
    pub correlation_mm: f64,
    /// The element of a patient's body. Plain linear tetrahedra lock: with them grey matter comes out too soft
    /// (docs/evidence/estimate.md).
    #[schemars(with = "String")]
    pub element: ElementKind,
    /// Standard deviation of ln(modulus) that a patient's mesh and element add, where two meshes do not tell it
    /// (docs/evidence/choices.md).
    pub model_log_sd: f64,
    /// Solve for a patient in a mesh of a quarter of the tetrahedra as well: what the mesh adds to the moduli is found from
    /// the difference instead of taken from `model_log_sd`.
    pub two_meshes: bool,
    /// Standard deviation of ln(modulus) that labels and outline of the body add, whatever the mesh: sulci are closed, grey and
    /// white matter part where the segmentation says (docs/evidence/choices.md).
    pub labels_log_sd: f64,
    /// The same where the body slides on a wall, which is not everywhere where it is taken to be (docs/evidence/estimate.md).
    pub wall_log_sd: f64,
    /// How far the segmented outline of a patient's brain may be off, mm: standard deviation everywhere, and of what changes from
    /// end to end of the head. It is estimated along with the moduli, in the mesh that `two_meshes` asks for; 0 to take it as it
    /// is (docs/evidence/estimate.md).
    pub outline_mm: f64,
    /// How far a patient's falx may stand beside where it is meshed, mm, as between hemispheres that touch it is hardly seen:
    /// standard deviation everywhere, and of what changes from back to front and from below to above. Estimated as `outline_mm` is;
    /// 0 to take it as it is (docs/evidence/estimate.md).
    pub falx_mm: f64,
    /// How much farther base and falx may hold a patient's brain than they are taken to, mm: the free edge of the falx down, the
    /// edge of the base up, both placed by an atlas; standard deviation everywhere, and of what changes from back to front.
    /// Estimated as `outline_mm` is where the base holds; 0 to take them as they are (docs/evidence/estimate.md).
    pub support_edges_mm: f64,
    /// Also estimate the effective density, with the prior below.
    pub density: bool,
    /// Standard deviation of ln(effective density): the default spans 33 (all submerged) to 300 kg/m3 around 100.
    pub density_log_sd: f64,
    /// What carries the brain: `as-given` in `[resection]`, fluid of `unknown` level (tissue of 1040 kg/m3 above it has its whole
    /// weight and is buoyant below it; `[resection.csf]` says what is thought of the part drained and of the fluid, `[resection]`
    /// then of the tissue), or `evidence` for both.
    pub fluid: Fluid,
    /// Standard deviation of ln(part of the fluid drained) where that is not known: a factor of 1.5 to either side, as before a
    /// prediction; around `drained` of `[resection.csf]`, or 0.3.
    pub drained_log_sd: f64,
    /// Also estimate the direction of gravity, around the one given.
    pub gravity_direction: bool,
    /// Standard deviation of either angle, degrees: how differently a head lies on its pillow.
    pub gravity_direction_sd_deg: f64,
    /// Also estimate every pressure of the settings' `[[resection.pressure]]`, around the one given.
    pub pressure: bool,
    /// Standard deviation of ln(pressure).
    pub pressure_log_sd: f64,
    /// Noise of a phantom's displacements, mm: they are known to the solver's residual.
    pub phantom_noise_mm: f64,
}

impl Default for EstimateOptions {
    fn default() -> Self {
        Self {
            descent: EstimateSettings::default(),
            observed: Observed::default(),
            displacement: DisplacementSettings::default(),
            correlation_mm: 5.0,
            element: ElementKind::TET4_NODAL,
            model_log_sd: 0.15,
            two_meshes: true,
            labels_log_sd: 0.09,
            wall_log_sd: 0.15,
            outline_mm: 0.5,
            falx_mm: 1.0,
            support_edges_mm: 3.0,
            density: false,
            density_log_sd: 0.56,
            fluid: Fluid::default(),
            drained_log_sd: 0.4,
            gravity_direction: false,
            gravity_direction_sd_deg: 15.0,
            pressure: false,
            pressure_log_sd: 0.7,
            phantom_noise_mm: 0.01,
        }
    }
}

impl EstimateOptions {
    /// How far a patient's body may be off.
    pub fn shape_error(&self) -> ShapeError {
        ShapeError { outline_mm: self.outline_mm, falx_mm: self.falx_mm, support_edges_mm: self.support_edges_mm }
    }

    /// Refuses what no estimate can be posed with.
    ///
    /// # Errors
    /// The first setting out of its range, in words.
    pub fn check(&self) -> Result<(), String> {
        self.descent.check().map_err(|e| format!("[estimate.descent]: {e}"))?;
        self.displacement.check().map_err(|e| format!("[estimate.displacement]: {e}"))?;
        let above_zero = [
            ("correlation_mm", self.correlation_mm),
            ("density_log_sd", self.density_log_sd),
            ("drained_log_sd", self.drained_log_sd),
            ("gravity_direction_sd_deg", self.gravity_direction_sd_deg),
            ("pressure_log_sd", self.pressure_log_sd),
            ("phantom_noise_mm", self.phantom_noise_mm),
        ];
        if let Some((name, value)) = above_zero.into_iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            return Err(format!("`{name}` is {value}: it must be above 0"));
        }
        let not_below = [
            ("model_log_sd", self.model_log_sd),
            ("labels_log_sd", self.labels_log_sd),
            ("wall_log_sd", self.wall_log_sd),
            ("outline_mm", self.outline_mm),
            ("falx_mm", self.falx_mm),
            ("support_edges_mm", self.support_edges_mm),
        ];
        if let Some((name, value)) = not_below.into_iter().find(|(_, value)| !(*value >= 0.0 && value.is_finite())) {
            return Err(format!("`{name}` is {value}: it must be 0 or more"));
        }
        Ok(())
    }
}
