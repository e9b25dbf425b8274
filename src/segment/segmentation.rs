//! The whole way from a T1 image to its labels.

use super::border::with_the_scans_border;
use super::brain::{BrainSettings, at_each, brain_mask};
use super::coil::{evened, strong_gain};
use super::confidence::RegionEvidence;
use super::folia::with_whole_folia;
use super::label;
use super::mixture::{Mixture, MixtureSettings, fit_mixture};
use super::native::{labels_on, mask_on};
use super::noise::calmed;
use super::posed_scan::PosedScan;
use super::priors::AtlasPriors;
use super::ventricle::{
    VentricleSettings, enhanced_plexus, not_ventricles, ventricles, with_shared_wall, with_white_walls,
};
use super::warning::SegmentWarning;
use crate::geometry::{Frame, Mni};
use crate::image::blocks::{coarser, on_finer_grid};
use crate::image::{Grid, LabelMap, Mask, Volume};
use thiserror::Error;

/// Everything that steers [`segment_t1`].
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SegmentSettings {
    /// Brain mask.
    pub brain: BrainSettings,
    /// Ventricles.
    pub ventricle: VentricleSettings,
    /// Most iterations of expectation maximisation.
    pub iterations: usize,
    /// Order of the bias field's polynomial, 0 (none) to 3.
    pub bias_order: usize,
    /// Iterations before the bias field is estimated: a bias fitted to unsettled classes swallows their contrast.
    pub bias_starts_at: usize,
    /// Weight of one of six neighbours in the Markov field.
    pub neighbour_weight: f64,
    /// Share of the tissue prior that does not believe the template, 0 to 1.
    pub disbelief: f64,
    /// Smallest brain volume that is accepted, in cubic centimetres.
    pub smallest_brain_cc: f64,
    /// Largest brain volume that is accepted, in cubic centimetres.
    pub largest_brain_cc: f64,
}

impl Default for SegmentSettings {
    fn default() -> Self {
        Self {
            brain: BrainSettings::default(),
            ventricle: VentricleSettings::default(),
            iterations: 30,
            bias_order: 3,
            bias_starts_at: 5,
            neighbour_weight: 0.25,
            disbelief: 0.3,
            smallest_brain_cc: 700.0,
            largest_brain_cc: 2200.0,
        }
    }
}

/// Masks the user brings; they win over the computed ones.
#[derive(Clone, Debug)]
pub struct SegmentOverrides<'a, F: Frame> {
    /// The brain, on any grid of the image's frame.
    pub brain: Option<&'a Mask<F>>,
    /// Lateral and third ventricles, on any grid of the image's frame.
    pub ventricle: Option<&'a Mask<F>>,
}

impl<F: Frame> Default for SegmentOverrides<'_, F> {
    fn default() -> Self {
        Self { brain: None, ventricle: None }
    }
}

/// A T1 image taken apart, in its own grid and on the template's grid (reached rigidly: sizes are the patient's).
#[derive(Clone, Debug)]
pub struct Segmentation<F: Frame> {
    /// The brain in the image's grid: tissue, ventricles and sulci inside the pia.
    pub brain: Mask<F>,
    /// Labels in the image's grid, see [`label`].
    pub labels: LabelMap<F>,
    /// The image on the template's grid with its bias taken out.
    pub t1_mni: Volume<f32, Mni>,
    /// Where the image's field of view covers the template's grid. Elsewhere nothing is known.
    pub known_mni: Mask<Mni>,
    /// The brain on the template's grid.
    pub brain_mni: Mask<Mni>,
    /// Labels on the template's grid.
    pub labels_mni: LabelMap<Mni>,
    /// Mean intensities of voxels full of CSF, grey matter and white matter after the bias is taken out, in the image's
    /// own units.
    pub tissue_means: [f64; 3],
    /// Intensity of a voxel that is half CSF and half grey matter.
    pub csf_grey_border: f64,
    /// Volumes on the template's grid.
    pub volumes: TissueVolumes,
    /// What speaks for the labels, by parts of the brain; empty where nothing was fitted to tell by.
    pub regions: Vec<RegionEvidence>,
    /// What a reader should know.
    pub warnings: Vec<SegmentWarning>,
}

/// Volumes in cubic centimetres.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TissueVolumes {
    /// Everything inside the pia.
    pub brain_cc: f64,
    /// CSF outside the ventricles.
    pub csf_cc: f64,
    /// Grey matter.
    pub grey_matter_cc: f64,
    /// White matter.
    pub white_matter_cc: f64,
    /// Lateral and third ventricles.
    pub ventricle_cc: f64,
}

/// Why an image could not be segmented.
#[derive(Debug, Error)]
pub enum SegmentError {
    /// The image shows too little of the brain.
    #[error(
        "only {percent:.0} % of the expected brain lies in the field of view: at least half is needed; check the \
         registration to the template, or give an image of the whole head"
    )]
    LittleBrain {
        /// Share of the template's brain inside the image, in percent.
        percent: f64,
    },
    /// No three tissues of rising intensity.
    #[error(
        "CSF, grey and white matter cannot be told apart by intensity: the image must be T1-weighted (CSF dark, white \
         matter bright) and registered to the template"
    )]
    NoTissueContrast,
    /// The mask found (or given) is no brain.
    #[error(
        "the brain's volume is {found_cc:.0} cc, outside {smallest_cc:.0} to {largest_cc:.0} cc: check the voxel size \
         and the registration, or, for the pre-operative scan, give a brain mask"
    )]
    ImplausibleBrain {
        /// Volume found.
        found_cc: f64,
        /// Smallest accepted.
        smallest_cc: f64,
        /// Largest accepted.
        largest_cc: f64,
    },
    /// A setting has no meaning.
    #[error("segmentation: `{name}` is {value}: it must be {rule}")]
    Setting {
        /// The setting's name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
}

/// Labels CSF, grey matter, white matter and ventricles of a T1 image that has been registered rigidly to the template.
///
/// The template's maps are used as they stand; after a deformable fit call [`segment_with_priors`].
///
/// # Errors
/// [`SegmentError`] when the image shows too little brain or no tissue contrast, or when the mask is no brain.
pub fn segment_t1<F: Frame>(
    scan: &PosedScan<'_, F>,
    overrides: &SegmentOverrides<'_, F>,
    settings: &SegmentSettings,
) -> Result<Segmentation<F>, SegmentError> {
    segment_with_priors(scan, &AtlasPriors::rigid(&scan.on_template().grid), overrides, settings)
}

/// [`segment_t1`] with the template's maps already carried onto the patient. The work is done on the part of the template's grid on
/// which they lie.
///
/// # Errors
/// As [`segment_t1`].
pub fn segment_with_priors<F: Frame>(
    scan: &PosedScan<'_, F>,
    priors: &AtlasPriors,
    overrides: &SegmentOverrides<'_, F>,
    settings: &SegmentSettings,
) -> Result<Segmentation<F>, SegmentError> {
    settings.check()?;
    let found = find_brain(scan, priors, overrides.brain, settings)?;
    labelled(scan, found, priors, overrides, settings)
}

/// A brain found or given, and nothing looked at inside it; the volumes lie on the priors' grid.
pub(super) struct FoundBrain {
    /// Logarithm of a strong coil's gain, on a coarse grid.
    gain: Option<Volume<f32, Mni>>,
    /// The image with that gain taken out.
    pub raw: Volume<f32, Mni>,
    /// Where the field of view covers the grid.
    pub known: Mask<Mni>,
    pub brain: Mask<Mni>,
    pub warnings: Vec<SegmentWarning>,
}

/// The brain where the template expects it, or the one given.
///
/// # Errors
/// As [`segment_with_priors`].
pub(super) fn find_brain<F: Frame>(
    scan: &PosedScan<'_, F>,
    priors: &AtlasPriors,
    given: Option<&Mask<F>>,
    settings: &SegmentSettings,
) -> Result<FoundBrain, SegmentError> {
    let mut warnings = Vec::new();
    let near = scan.on_template().grid.box_of(&priors.brain_mm.grid);
    let (mut raw, known) = (scan.on_template().cropped(&near), scan.known().cropped(&near));
    let gain = strong_gain(&raw, &known, priors).map(|(gain, times)| {
        warnings.push(SegmentWarning::StrongGain { times });
        raw = evened(&raw, &gain);
        gain
    });
    let expected = priors.brain_mm.map(|d| d < 0.0);
    let seen = at_each(&raw, |n| expected.data[n] && known.data[n]);
    let percent = 100.0 * seen.count() as f64 / expected.count().max(1) as f64;
    if percent < 50.0 {
        return Err(SegmentError::LittleBrain { percent });
    }
    if percent < 98.0 {
        warnings.push(SegmentWarning::CroppedBrain { percent: 100.0 - percent });
    }
    let brain = match given {
        Some(mask) => mask_on(mask, &raw.grid, &scan.mni_from_t1.inverse()),
        None => computed_brain(&raw, &known, priors, settings)?,
    };
    let found_cc = brain.volume_cc();
    if !(settings.smallest_brain_cc..=settings.largest_brain_cc).contains(&found_cc) {
        return Err(SegmentError::ImplausibleBrain {
            found_cc,
            smallest_cc: settings.smallest_brain_cc,
            largest_cc: settings.largest_brain_cc,
        });
    }
    Ok(FoundBrain { gain, raw, known, brain, warnings })
}

/// What is inside the brain.
///
/// # Errors
/// As [`segment_with_priors`].
pub(super) fn labelled<F: Frame>(
    scan: &PosedScan<'_, F>,
    found: FoundBrain,
    priors: &AtlasPriors,
    overrides: &SegmentOverrides<'_, F>,
    settings: &SegmentSettings,
) -> Result<Segmentation<F>, SegmentError> {
    let FoundBrain { gain, raw, known, brain, mut warnings } = found;
    let PosedScan { t1, mni_from_t1, .. } = scan;
    let (grid, t1_from_mni, found_cc) = (raw.grid, mni_from_t1.inverse(), brain.volume_cc());
    let inside = at_each(&raw, |n| brain.data[n] && known.data[n]);
    let fitted = |stride: usize, begun: Option<&Mixture>| {
        fit_mixture(&raw, &inside, priors, &mixture_settings(settings, stride), begun)
            .ok_or(SegmentError::NoTissueContrast)
    };
    // An eighth of the voxels knows the means and the bias as well as all of them.
    let model = fitted(1, Some(&fitted(2, None)?))?;
    let ratio = 2.0 * (model.means[2] - model.means[1]) / (model.deviations[1] + model.deviations[2]);
    if ratio < 1.5 {
        warnings.push(SegmentWarning::LowContrast { ratio });
    }
    let mut labels_mni = most_probable(&model, priors);
    let csf = labels_mni.map(|l| l == label::CSF);
    let even = without_bias(&raw, &model, |_| true);
    drop(raw);
    let ventricle = if let Some(mask) = overrides.ventricle {
        let given = mask_on(mask, &grid, &t1_from_mni);
        warnings.extend(not_ventricles(&given, &even, priors, &model));
        at_each(&even, |n| given.data[n] && brain.data[n])
    } else {
        let plexus = enhanced_plexus(&even, model.means[2], priors);
        let found = ventricles(&csf, &plexus, &brain, priors, &settings.ventricle);
        with_shared_wall(&found, &even, &brain, &model)
    };
    if ventricle.count() == 0 {
        warnings.push(SegmentWarning::NoVentricle);
    }
    for (l, &inside) in labels_mni.data.iter_mut().zip(&ventricle.data) {
        if inside {
            *l = label::VENTRICLE;
        }
    }
    with_white_walls(&mut labels_mni, &ventricle, &priors.deep_grey);
    with_whole_folia(&mut labels_mni, priors);
    let volume = |l: u8| labels_mni.map(|v| v == l).volume_cc();
    let volumes = TissueVolumes {
        brain_cc: found_cc,
        csf_cc: volume(label::CSF),
        grey_matter_cc: volume(label::GREY_MATTER),
        white_matter_cc: volume(label::WHITE_MATTER),
        ventricle_cc: volume(label::VENTRICLE),
    };
    let mut labels = labels_on(&labels_mni, &t1.grid, mni_from_t1);
    // A strong coil's gain was taken out on the working grid alone.
    if !warnings.iter().any(|w| matches!(w, SegmentWarning::StrongGain { .. })) {
        labels = with_the_scans_border(labels, t1, mni_from_t1, &model, priors);
    }
    if let Some(mask) = overrides.ventricle.filter(|m| m.grid.coincides(&t1.grid, 1e-3)) {
        // Voxel by voxel what the user drew, without the way there and back.
        for (l, &drawn) in labels.data.iter_mut().zip(&mask.data) {
            *l = match *l {
                label::BACKGROUND => label::BACKGROUND,
                _ if drawn => label::VENTRICLE,
                label::VENTRICLE => label::CSF,
                other => other,
            };
        }
    }
    Ok(Segmentation {
        brain: overrides
            .brain
            .filter(|m| m.grid.coincides(&t1.grid, 1e-3))
            .cloned()
            .unwrap_or_else(|| labels.map(|l| l > 0)),
        labels,
        t1_mni: evened(scan.on_template(), &whole_gain(&scan.on_template().grid, &grid, &model, gain.as_ref())),
        known_mni: scan.known().clone(),
        brain_mni: brain.within(&scan.on_template().grid, false),
        labels_mni: labels_mni.within(&scan.on_template().grid, label::BACKGROUND),
        tissue_means: model.means,
        csf_grey_border: model.csf_grey_border(),
        volumes,
        regions: Vec::new(),
        warnings,
    })
}

impl SegmentSettings {
    /// Refuses settings out of range, by name.
    ///
    /// # Errors
    /// [`SegmentError::Setting`].
    pub fn check(&self) -> Result<(), SegmentError> {
        let rules: [(&'static str, f64, std::ops::RangeInclusive<f64>, &'static str); 14] = [
            ("brain.reach_mm", self.brain.reach_mm, 0.0..=30.0, "0 to 30 mm"),
            ("brain.opening_mm", self.brain.opening_mm, 0.0..=10.0, "0 to 10 mm"),
            ("brain.closing_mm", self.brain.closing_mm, 0.0..=20.0, "0 to 20 mm"),
            ("brain.trusted_depth_mm", self.brain.trusted_depth_mm, 0.0..=30.0, "0 to 30 mm"),
            ("ventricle.reach_mm", self.ventricle.reach_mm, 0.0..=30.0, "0 to 30 mm"),
            ("ventricle.cistern_clearance_mm", self.ventricle.cistern_clearance_mm, 0.0..=30.0, "0 to 30 mm"),
            ("ventricle.closing_mm", self.ventricle.closing_mm, 0.0..=5.0, "0 to 5 mm"),
            ("iterations", self.iterations as f64, 1.0..=1000.0, "1 to 1000"),
            ("bias_order", self.bias_order as f64, 0.0..=3.0, "0 to 3"),
            ("bias_starts_at", self.bias_starts_at as f64, 0.0..=1000.0, "0 to 1000"),
            ("disbelief", self.disbelief, 0.0..=1.0, "0 to 1"),
            ("neighbour_weight", self.neighbour_weight, 0.0..=5.0, "0 to 5"),
            ("smallest_brain_cc", self.smallest_brain_cc, 0.0..=10_000.0, "0 to 10000 cc"),
            (
                "largest_brain_cc",
                self.largest_brain_cc,
                self.smallest_brain_cc..=10_000.0,
                "smallest_brain_cc to 10000 cc",
            ),
        ];
        for (name, value, range, rule) in rules {
            if !range.contains(&value) {
                return Err(SegmentError::Setting { name, value, rule });
            }
        }
        Ok(())
    }
}

fn mixture_settings(settings: &SegmentSettings, stride: usize) -> MixtureSettings {
    MixtureSettings {
        iterations: settings.iterations,
        bias_order: settings.bias_order,
        bias_starts_at: settings.bias_starts_at,
        neighbour_weight: settings.neighbour_weight,
        disbelief: settings.disbelief,
        stride,
    }
}

/// Intensities are learnt on every second voxel deep in the template's brain, then the mask is found with them.
fn computed_brain(
    raw: &Volume<f32, Mni>,
    known: &Mask<Mni>,
    priors: &AtlasPriors,
    settings: &SegmentSettings,
) -> Result<Mask<Mni>, SegmentError> {
    /// What is averaged at the edge of the reach.
    const ROOM_MM: f32 = 4.0;
    let deep = at_each(raw, |n| known.data[n] && priors.brain_mm.data[n] < -4.0);
    let model =
        fit_mixture(raw, &deep, priors, &mixture_settings(settings, 2), None).ok_or(SegmentError::NoTissueContrast)?;
    let reach = settings.brain.reach_mm as f32;
    let flat = without_bias(raw, &model, |n| known.data[n] && priors.brain_mm.data[n] < reach + ROOM_MM);
    let calm = calmed(&flat, known, priors, &model);
    Ok(brain_mask(calm.as_ref().unwrap_or(&flat), known, &model, priors, &settings.brain))
}

/// The logarithm of all gain that was found on the grid `near` the brain, on a coarse one over all of `whole`; far from the brain
/// it is as where it was last looked for.
fn whole_gain(
    whole: &Grid<Mni>,
    near: &Grid<Mni>,
    model: &Mixture,
    strong: Option<&Volume<f32, Mni>>,
) -> Volume<f32, Mni> {
    /// Finer than any gain.
    const FACTOR: usize = 4;
    let coarse = coarser(whole, FACTOR);
    let strong = strong.map(|gain| on_finer_grid(gain, &coarse));
    Volume::from_fn(coarse, |n| {
        let place = near.voxel_at(coarse.centre(coarse.voxel(n)));
        model.bias.at_point([place.x, place.y, place.z]) as f32 + strong.as_ref().map_or(0.0, |gain| gain.data[n])
    })
}

/// The image with its bias taken out where it is `wanted`, 0 elsewhere.
fn without_bias(raw: &Volume<f32, Mni>, model: &Mixture, wanted: impl Fn(usize) -> bool + Sync) -> Volume<f32, Mni> {
    let grid = raw.grid;
    Volume::from_fn(grid, |n| {
        if wanted(n) { (f64::from(raw.data[n]) * (-model.bias.at(grid.voxel(n))).exp()) as f32 } else { 0.0 }
    })
}

fn most_probable(model: &Mixture, priors: &AtlasPriors) -> LabelMap<Mni> {
    let mut labels = Volume::filled(priors.brain_mm.grid, label::BACKGROUND);
    for (&n, p) in model.voxels.iter().zip(&model.contents) {
        let deep = priors.deep_grey.data[n as usize] > 0.5;
        labels.data[n as usize] = if p[0] > p[1] && p[0] > p[2] {
            label::CSF
        } else if deep || p[1] >= p[2] {
            label::GREY_MATTER
        } else {
            label::WHITE_MATTER
        };
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Position, Pre, RigidTransform};
    use crate::image::VoxelBox;
    use crate::segment::atlas;

    fn template() -> Volume<f32, Pre> {
        atlas::template().t1_f32().relabelled()
    }

    fn refusal(t1: &Volume<f32, Pre>, brain: Option<&Mask<Pre>>) -> SegmentError {
        let masks = SegmentOverrides { brain, ventricle: None };
        segment_t1(&PosedScan::new(t1, &RigidTransform::identity()), &masks, &SegmentSettings::default()).unwrap_err()
    }

    #[test]
    fn a_brain_smaller_than_700_or_larger_than_2200_cc_is_refused_with_its_volume() {
        let t1 = template();
        let ball = |radius_mm: f64| {
            Mask::from_fn(t1.grid, |n| {
                let voxel = nalgebra::Point3::from(t1.grid.voxel(n).map(|v| v as f64));
                t1.grid.position(voxel).distance_mm(&Position::new(0.0, -18.0, 8.0)) < radius_mm
            })
        };
        for mask in [ball(54.0), ball(85.0)] {
            let message = refusal(&t1, Some(&mask)).to_string();
            let words = format!("is {:.0} cc", mask.volume_cc());
            assert!(message.contains(&words) && message.contains("outside 700 to 2200 cc"), "{message}");
            assert!(message.contains("give a brain mask"), "{message}");
        }
    }

    #[test]
    fn an_image_of_less_than_half_the_brain_is_refused_with_its_share() {
        let whole = template();
        let [nx, ny, nz] = whole.grid.dims;
        let upper = whole.cropped(&VoxelBox { first: [0, 0, nz * 6 / 10], end: [nx, ny, nz] });
        let error = refusal(&upper, None);
        assert!(matches!(error, SegmentError::LittleBrain { percent } if (15.0..50.0).contains(&percent)), "{error}");
    }
}
