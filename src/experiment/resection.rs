//! The patient: the brain without the resected tissue under gravity, against what the post-operative scan shows.

use super::outcome::NoiseFloor;
use super::sample::Tissue;
use super::setting::{
    LEVELS_RULE, POISSON_RULE, SETS_RULE, SettingError, TISSUES_RULE, first_broken, levels_hold, sets_hold,
};
use super::skull::{SkullSettings, level_when_drained};
use super::verdict::Finding;
use crate::fem::{CsfLevel, Loads, PressureLoad, Scenario, SolverSettings, Support};
use crate::geometry::Frame;
use crate::image::LabelMap;
use nalgebra::{UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The frame that gravity is given in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum GravityFrame {
    /// The MNI frame reached rigidly.
    #[default]
    Mni,
    /// The pre-operative scanner's: a patient on the back has gravity along -y there.
    Pre,
    /// The post-operative scanner's, whose scan the sag is seen on.
    Post,
}

/// Cerebrospinal fluid that is left; the table `[resection.csf]` of the settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CsfSettings {
    /// Density of the fluid.
    pub density_kg_per_m3: f64,
    /// Part of the fluid seen before the operation that has drained, from the top.
    pub drained: f64,
}

/// Density of brain tissue itself (33 more than that of the fluid that it displaces).
pub const TISSUE_KG_PER_M3: f64 = 1040.0;

impl Default for CsfSettings {
    fn default() -> Self {
        Self { density_kg_per_m3: 1007.0, drained: 0.3 }
    }
}

impl CsfSettings {
    /// Refuses what no fluid can be.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let density = self.density_kg_per_m3;
        first_broken(&[
            ("csf.density_kg_per_m3", &density, density > 0.0 && density.is_finite(), "positive"),
            ("csf.drained", &self.drained, (0.0..=1.0).contains(&self.drained), "a part from 0 to 1"),
        ])
    }

    /// The fluid as a load: its level by the labels of the pre-operative scan and gravity in their frame. `None` where no
    /// fluid was seen.
    pub fn level<F: Frame>(&self, labels: &LabelMap<F>, gravity_m_per_s2: [f64; 3]) -> Option<CsfLevel> {
        let level_mm = level_when_drained(labels, gravity_m_per_s2, self.drained)?;
        Some(CsfLevel { density_kg_per_m3: self.density_kg_per_m3, level_mm })
    }
}

/// How the skull holds a patient's brain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Supports {
    /// Not known: an estimate tries the others and weighs them by their evidence; samples are simulated as `fixed`.
    #[default]
    Evidence,
    /// At its base, which does not move, as in the paper.
    Fixed,
    /// Only the cut brainstem is held, and the skull pushes back without friction.
    Sliding,
}

impl Supports {
    /// What an estimate tries, in this order.
    pub fn family(self) -> Vec<Self> {
        if self == Self::Evidence { vec![Self::Fixed, Self::Sliding] } else { vec![self] }
    }

    /// The word of files and texts.
    pub fn name(self) -> &'static str {
        match self {
            Self::Evidence => "evidence",
            Self::Fixed => "fixed",
            Self::Sliding => "sliding",
        }
    }
}

/// Loads, supports and samples of a patient's sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ResectionSettings {
    /// 1: the whole brain one material; 2: grey and white matter apart (81 samples).
    pub tissues: usize,
    /// Gravity. Along -z of the MNI frame by default (head upright, as in the paper's scenario); a patient who lies on
    /// the back in the scanner has it along -y of that scanner's frame.
    pub gravity_m_per_s2: [f64; 3],
    /// The frame of `gravity_m_per_s2`.
    pub gravity_frame: GravityFrame,
    /// Effective density: tissue less the fluid that carries it, from 33 (all submerged: 1040 - 1007) to 1040 (all
    /// drained). Gravity fixes only modulus / density, so a modulus is only as good as this assumption; 100 is a
    /// brain of which about a fifteenth of the weight is no longer carried.
    pub density_kg_per_m3: f64,
    /// Pressures on sets (ventricle wall, margin); none by default.
    pub pressure: Vec<PressureLoad>,
    /// Poisson's ratio of every tissue.
    pub poisson_ratio: f64,
    /// Levels of the prior that are tried, in standard deviations.
    pub sd_levels: Vec<f64>,
    /// Samples of every task of the generative model (elastography, linear, hyperelastic; grey, white, healthy brain; abnormal
    /// tissue where there is a lesion) instead of one task's; with one tissue only.
    pub every_task: bool,
    /// Node sets held still.
    pub fixed: Vec<String>,
    /// How the skull holds the brain.
    pub supports: Supports,
    /// How the falx holds it where `supports` slide: `fixed` to it, or `sliding` along either side.
    pub falx: Support,
    /// The skull of `supports = "sliding"`.
    pub skull: SkullSettings,
    /// Fluid left around the brain, with `density_kg_per_m3` the tissue's own; none by default, where that density is an
    /// effective one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub csf: Option<CsfSettings>,
    /// Expected error of the rigid registration over the brain, mm: part of the noise floor.
    pub registration_error_mm: f64,
    /// Solver.
    pub solver: SolverSettings,
}

impl Default for ResectionSettings {
    fn default() -> Self {
        Self {
            tissues: 1,
            gravity_m_per_s2: [0.0, 0.0, -9.81],
            gravity_frame: GravityFrame::default(),
            density_kg_per_m3: 100.0,
            pressure: Vec::new(),
            poisson_ratio: 0.45,
            sd_levels: vec![-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0],
            every_task: false,
            fixed: vec!["base".to_owned(), "falx".to_owned()],
            supports: Supports::Evidence,
            falx: Support::Fixed,
            skull: SkullSettings::default(),
            csf: None,
            registration_error_mm: 0.2,
            solver: SolverSettings::default(),
        }
    }
}

/// What a tissue's density must be where there is a fluid.
const TISSUE_RULE: &str = "at least the fluid's density in the table [resection.csf]: beside a fluid it is the tissue's own (1040), an \
    effective density (100, 300) goes without that table";

impl ResectionSettings {
    /// Whether anything pulls or pushes.
    pub fn is_loaded(&self) -> bool {
        let weight = self.gravity_m_per_s2 != [0.0; 3] && self.density_kg_per_m3 > 0.0;
        weight || self.pressure.iter().any(|load| load.pressure_pa != 0.0)
    }

    /// The part of the fluid that has drained, where there is a fluid.
    pub fn drained(&self) -> Option<f64> {
        self.csf.as_ref().map(|csf| csf.drained)
    }

    /// The same brain in fluid: as these settings have it, or as most are.
    #[must_use]
    pub fn in_fluid(&self) -> Self {
        match self.csf {
            Some(_) => self.clone(),
            None => Self { csf: Some(CsfSettings::default()), density_kg_per_m3: TISSUE_KG_PER_M3, ..self.clone() },
        }
    }

    /// Refuses what no simulation can be posed with.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let (g, density) = (self.gravity_m_per_s2, self.density_kg_per_m3);
        let pressures = self.pressure.iter().all(|load| load.pressure_pa.is_finite());
        let registration = self.registration_error_mm;
        self.skull.check()?;
        if let Some(csf) = &self.csf {
            csf.check()?;
        }
        // Lighter tissue would float: an effective density has the fluid's part of the weight taken off already.
        let own = self.csf.as_ref().is_none_or(|csf| density >= csf.density_kg_per_m3);
        first_broken(&[
            ("tissues", &self.tissues, (1..=2).contains(&self.tissues), TISSUES_RULE),
            ("gravity_m_per_s2", &g, g.iter().all(|x| x.is_finite()), "three numbers"),
            ("density_kg_per_m3", &density, density >= 0.0 && density.is_finite(), "0 or more"),
            ("density_kg_per_m3", &density, own, TISSUE_RULE),
            ("pressure", &self.pressure, pressures, "pressures in Pa, each a number"),
            ("poisson_ratio", &self.poisson_ratio, (0.0..0.5).contains(&self.poisson_ratio), POISSON_RULE),
            ("sd_levels", &self.sd_levels, levels_hold(&self.sd_levels), LEVELS_RULE),
            ("fixed", &self.fixed, sets_hold(&self.fixed), SETS_RULE),
            ("registration_error_mm", &registration, (0.0..=20.0).contains(&registration), "0 to 20 mm"),
        ])
    }

    /// The tissues varied.
    pub fn tissue_list(&self) -> Vec<Tissue> {
        if self.tissues == 1 { Tissue::whole_brain() } else { Tissue::grey_and_white() }
    }

    /// The scenario without its materials; `mni_from_scanner` turns a vector of [`Self::gravity_frame`].
    pub fn scenario(&self, mni_from_scanner: &UnitQuaternion<f64>) -> Scenario {
        Scenario {
            fixed: self.fixed.clone(),
            loads: Loads {
                gravity_m_per_s2: (mni_from_scanner * Vector3::from(self.gravity_m_per_s2)).into(),
                density_kg_per_m3: self.density_kg_per_m3,
                pressure: self.pressure.clone(),
                ..Loads::default()
            },
            solver: self.solver.clone(),
            ..Scenario::default()
        }
    }

    /// What the measurement itself is worth: the registration's expected error, the position of a boundary within the
    /// coarsest voxel (uniform over its width: width / sqrt 12) and a segmented surface, which two raters place about
    /// half a voxel apart.
    pub fn noise_floor(&self, coarsest_voxel_mm: f64) -> NoiseFloor {
        NoiseFloor {
            registration_mm: Some(self.registration_error_mm),
            voxel_mm: Some(coarsest_voxel_mm / 12f64.sqrt()),
            segmentation_mm: Some(0.5 * coarsest_voxel_mm),
            at_rest_mm: None,
        }
    }
}

/// Whether `deformed` is better than `rest` by more than the measurement is worth, in words.
pub fn improvement(rest_mm: f64, deformed_mm: f64, floor: &NoiseFloor) -> &'static str {
    Finding::against_rest(rest_mm, deformed_mm, floor.combined_mm().unwrap_or(0.0)).short()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beside_a_fluid_a_density_is_the_tissues_own() {
        let with = |csf: Option<CsfSettings>, density_kg_per_m3: f64| {
            ResectionSettings { density_kg_per_m3, csf, ..ResectionSettings::default() }.check()
        };
        let fluid = || Some(CsfSettings::default());
        for effective in [33.0, 100.0, 300.0, 1006.0] {
            assert_eq!(with(fluid(), effective).unwrap_err().name, "density_kg_per_m3");
            assert_eq!(with(None, effective), Ok(()));
        }
        assert_eq!(with(fluid(), 1040.0), Ok(()));
        let none = Some(CsfSettings { density_kg_per_m3: 0.0, ..CsfSettings::default() });
        assert_eq!(with(none, 1040.0).unwrap_err().name, "csf.density_kg_per_m3");
    }

    #[test]
    fn a_pressure_is_a_load_without_gravity() {
        let still = ResectionSettings { gravity_m_per_s2: [0.0; 3], ..ResectionSettings::default() };
        assert!(ResectionSettings::default().is_loaded() && !still.is_loaded());
        let pressure = vec![PressureLoad { set: "ventricle".to_owned(), pressure_pa: -200.0 }];
        assert!(ResectionSettings { pressure, ..still }.is_loaded());
    }

    #[test]
    fn a_change_below_the_noise_floor_is_not_distinguishable() {
        let floor = ResectionSettings::default().noise_floor(1.0);
        let combined = floor.combined_mm().unwrap();
        assert!((combined - (0.04f64 + 1.0 / 12.0 + 0.25).sqrt()).abs() < 1e-12);
        assert_eq!(improvement(3.0, 2.9, &floor), "not distinguishable from rest");
        assert_eq!(improvement(3.0, 2.0, &floor), "better than rest");
        assert_eq!(improvement(2.0, 3.0, &floor), "worse than rest");
    }
}
