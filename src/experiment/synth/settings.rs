//! What a synthetic patient is made of.

use super::fault::ScanFaults;
use super::lobe::Lobe;
use super::pathology::Pathology;
use super::scans::Scans;
use crate::fem::Support;
use crate::segment::atlas::Side;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use thiserror::Error;

/// How the brain's sag after the resection is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SagKind {
    /// No movement: the post-operative brain is the pre-operative one with a hole.
    None,
    /// A smooth analytic field: along gravity, strongest at the cavity, zero at the skull.
    Smooth,
    /// Finite elements under gravity with the materials of [`SynthSettings`].
    Fem,
}

/// Everything that decides the bytes of a synthetic patient.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SynthSettings {
    /// Seed of anatomy, poses, bias and noise.
    pub seed: u64,
    /// The operated hemisphere.
    pub side: Side,
    /// The operated lobe.
    pub lobe: Lobe,
    /// Volume to be resected, in cubic centimetres.
    pub resection_cc: f64,
    /// Voxel size of both scans in mm.
    pub spacing_mm: f64,
    /// Slice thickness of the post-operative scan in mm (at least `spacing_mm`; 3 to 5 is a thick clinical slice).
    pub post_slice_mm: f64,
    /// Tilt of the post-operative slices out of the scanner's axes in degrees.
    pub post_oblique_deg: f64,
    /// Largest rotation of the head in either scan in degrees (up to 15).
    pub rotation_deg: f64,
    /// Largest shift of the head in either scan in mm (up to 20).
    pub translation_mm: f64,
    /// Typical size of the smooth change of anatomy from the template in mm.
    pub anatomy_mm: f64,
    /// Bias field: relative half range of the multiplicative shading.
    pub bias_fraction: f64,
    /// Standard deviation of the Gaussian noise in either channel over the white matter intensity (Rician magnitude).
    pub noise_fraction: f64,
    /// How the sag is made.
    pub sag: SagKind,
    /// Largest displacement of the smooth sag in mm.
    pub sag_mm: f64,
    /// Shear modulus of grey matter for the finite-element sag in Pa.
    pub grey_pa: f64,
    /// Shear modulus of white matter for the finite-element sag in Pa.
    pub white_pa: f64,
    /// Poisson ratio of both for the finite-element sag.
    pub poisson_ratio: f64,
    /// Density the finite-element sag feels gravity with, in kg/m3: tissue less the fluid that still buoys it.
    pub effective_density_kg_per_m3: f64,
    /// What the skull does in the finite-element sag: `fixed` holds the brain at its base, `sliding` only pushes back, without
    /// friction, and the cut brainstem is held; the falx is held in both.
    pub supports: Support,
    /// Room between cortex and bone of a skull that the brain slides on, in mm.
    pub room_mm: f64,
    /// About how many tetrahedra the finite-element sag has. A truth that an estimate is measured by wants a finer mesh than the
    /// estimate's: a coarse one is too stiff.
    pub cells: usize,
    /// Blood along the cavity's wall and pooled in its lowest part.
    pub blood: bool,
    /// An air pocket in the cavity's highest part.
    pub air: bool,
    /// Scans with gadolinium: bright vessels, sinuses, dura and plexus, a lesion's rim before and its bed after.
    pub contrast: Scans,
    /// What else than the operation is the matter.
    pub pathology: Pathology,
    /// What is wrong with the pre-operative scan.
    pub pre: ScanFaults,
    /// What is wrong with the post-operative scan.
    pub post: ScanFaults,
}

impl Default for SynthSettings {
    fn default() -> Self {
        Self {
            seed: 1,
            side: Side::Left,
            lobe: Lobe::Temporal,
            resection_cc: 35.0,
            spacing_mm: 1.0,
            post_slice_mm: 1.0,
            post_oblique_deg: 0.0,
            rotation_deg: 8.0,
            translation_mm: 10.0,
            anatomy_mm: 3.0,
            bias_fraction: 0.15,
            noise_fraction: 0.02,
            sag: SagKind::Smooth,
            sag_mm: 5.0,
            grey_pa: 1370.0,
            white_pa: 990.0,
            poisson_ratio: 0.45,
            effective_density_kg_per_m3: 300.0,
            supports: Support::Fixed,
            room_mm: 1.0,
            cells: 85_000,
            blood: false,
            air: false,
            contrast: Scans::None,
            pathology: Pathology::default(),
            pre: ScanFaults::default(),
            post: ScanFaults::default(),
        }
    }
}

/// Why no patient could be made.
#[derive(Debug, Error)]
pub enum SynthError {
    /// A setting outside of what makes sense.
    #[error(
        "`{name}` is {value}; it must lie between {low} and {high}{}: change its option or the table [synth] of the \
         settings file",
        if name == "post_slice_mm" { " (no thinner than the voxels)" } else { "" }
    )]
    Setting {
        /// The field of [`SynthSettings`].
        name: Cow<'static, str>,
        /// Its value.
        value: f64,
        /// The least allowed.
        low: f64,
        /// The most allowed.
        high: f64,
    },
    /// The lobe is smaller than what is to be taken from it.
    #[error(
        "a resection of {wanted_cc:.1} cc: this patient's {side} {} lobe has {lobe_cc:.1} cc; ask for at most {:.1} \
         cc (80 % of it)",
        lobe.name(),
        0.8 * lobe_cc
    )]
    LobeTooSmall {
        /// What was asked for.
        wanted_cc: f64,
        /// What there is.
        lobe_cc: f64,
        /// The side.
        side: Side,
        /// Which lobe.
        lobe: Lobe,
    },
    /// No part of the brain far enough from the resection has the old lesion's size.
    #[error(
        "an old lesion of {wanted_cc:.1} cc: no part of this brain away from the resection has that size; ask for a smaller \
         pathology.old_lesion_cc, or a smaller resection"
    )]
    NoRoomForLesion {
        /// What was asked for.
        wanted_cc: f64,
    },
    /// What is to be taken out holds no brain.
    #[error("the mask of what is to be taken out holds no brain of this head; draw it on the scan of the head")]
    NothingToTake,
    /// What is to be taken out is no resection's size.
    #[error(
        "the mask of what is to be taken out is {found_cc:.1} cc; it must lie between {least_cc} and {most_cc} cc: draw a resection"
    )]
    MaskSize {
        /// Its volume in the brain.
        found_cc: f64,
        /// The least allowed.
        least_cc: f64,
        /// The most allowed.
        most_cc: f64,
    },
    /// A head whose tissues are not those of a T1.
    #[error(
        "the head is no T1-weighted scan: fluid {fluid:.0}, grey matter {grey:.0} and white matter {white:.0} must grow brighter \
         in this order; give a T1"
    )]
    NotT1 {
        /// Mean intensity.
        fluid: f64,
        /// Mean intensity.
        grey: f64,
        /// Mean intensity.
        white: f64,
    },
    /// A head that cannot be taken apart.
    #[error("the head: {0}")]
    Head(#[from] crate::segment::HeadError),
    /// The simulated sag failed.
    #[error(
        "the finite-element sag failed: {0}; ask for a smaller effective_density_kg_per_m3 or stiffer tissue, or sag = \"smooth\""
    )]
    Sag(String),
}

impl SynthSettings {
    /// How thick the post-operative slices are where the voxels get this size: as they are, and never thinner than those.
    pub fn slices_of_voxels_mm(&self, spacing_mm: f64) -> f64 {
        self.post_slice_mm.max(spacing_mm)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::Setting`] names the first field outside of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        let ranges = [
            ("resection_cc", self.resection_cc, 2.0, 90.0),
            ("spacing_mm", self.spacing_mm, 0.5, 4.0),
            ("post_slice_mm", self.post_slice_mm, self.spacing_mm, 8.0),
            ("post_oblique_deg", self.post_oblique_deg, 0.0, 45.0),
            ("rotation_deg", self.rotation_deg, 0.0, 15.0),
            ("translation_mm", self.translation_mm, 0.0, 20.0),
            ("anatomy_mm", self.anatomy_mm, 0.0, 6.0),
            ("bias_fraction", self.bias_fraction, 0.0, 0.5),
            ("noise_fraction", self.noise_fraction, 0.0, 0.2),
            ("sag_mm", self.sag_mm, 0.0, 10.0),
            ("grey_pa", self.grey_pa, 50.0, 50_000.0),
            ("white_pa", self.white_pa, 50.0, 50_000.0),
            ("poisson_ratio", self.poisson_ratio, 0.0, 0.4999),
            ("room_mm", self.room_mm, 0.0, 10.0),
            ("cells", self.cells as f64, 5_000.0, 2_000_000.0),
            ("effective_density_kg_per_m3", self.effective_density_kg_per_m3, 0.0, 1100.0),
        ];
        let of_scan = |scan: &'static str, faults: &ScanFaults| {
            faults.ranges().map(|(name, value, low, high)| (Cow::Owned(format!("{scan}.{name}")), value, low, high))
        };
        let named = |(name, value, low, high)| (Cow::Borrowed(name), value, low, high);
        let all = ranges.into_iter().chain(self.pathology.ranges()).map(named);
        let mut all = all.chain(of_scan("pre", &self.pre)).chain(of_scan("post", &self.post));
        match all.find(|&(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => Err(SynthError::Setting { name, value, low, high }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_or_pathology_out_of_range_is_refused_by_its_full_name() {
        let own = SynthSettings::default;
        let refused = |settings: SynthSettings| settings.check().unwrap_err().to_string();
        let ghost = ScanFaults { ghost_fraction: 0.7, ..ScanFaults::default() };
        let gain = ScanFaults { coil_gain: f64::NAN, ..ScanFaults::default() };
        let lesion = Pathology { old_lesion_cc: 0.2, ..Pathology::default() };
        for (settings, name) in [
            (SynthSettings { pre: ghost, ..own() }, "`pre.ghost_fraction` is 0.7"),
            (SynthSettings { post: gain, ..own() }, "`post.coil_gain` is NaN"),
            (SynthSettings { pathology: lesion, ..own() }, "`pathology.old_lesion_cc` is 0.2"),
        ] {
            let said = refused(settings);
            assert!(said.starts_with(name) && said.contains("[synth]"), "{said}");
        }
    }

    #[test]
    fn slices_of_other_voxels_are_never_thinner_than_they_and_thick_ones_stay() {
        let thick = SynthSettings { post_slice_mm: 4.0, ..SynthSettings::default() };
        assert_eq!([1.0, 4.0].map(|mm| thick.slices_of_voxels_mm(mm)), [4.0; 2]);
        for spacing_mm in [0.5, 1.0, 3.0] {
            let own = SynthSettings::default();
            let post_slice_mm = own.slices_of_voxels_mm(spacing_mm);
            assert!(SynthSettings { spacing_mm, post_slice_mm, ..own }.check().is_ok(), "{spacing_mm}");
        }
    }
}
