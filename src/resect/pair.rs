//! A pre- and a post-operative scan taken apart together.

use super::blood::{SaggedPair, with_blood};
use super::by_hand::{filling, subtract, takes_tissue};
use super::edge::{at_edge_percent, outside_percent};
use super::elsewhere::{lost_elsewhere_cc, with_losses_elsewhere};
use super::sag::{SagScans, fit_sag};
use super::sets::both;
use super::{
    CavityFinding, CavityPair, CavitySettings, Likeness, ResectError, apart_from, find_cavity, likeness,
    on_the_scale_of,
};
use crate::geometry::{Mni, Post, Pre};
use crate::image::{LabelMap, Mask, Volume, VoxelBox};
use crate::register::deformable::{AtlasFit, DeformableSettings, DisplacementField};
use crate::segment::atlas;
use crate::segment::native::labels_on;
use crate::segment::{
    BrainSource, HeadError, LeftOut, PosedScan, Scale, SegmentOverrides, SegmentSettings, SegmentWarning, Segmentation,
    carried_priors, fit_template_to_labels, label, segment_by_labels, segment_head, segment_with_priors, without_gaps,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Everything that steers [`take_pair_apart`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PairSettings {
    /// Fit of the template to each head.
    pub deformable: DeformableSettings,
    /// Fit of the pre-operative brain to the post-operative one.
    pub sag: DeformableSettings,
    /// Brain mask, tissue, ventricles.
    pub segment: SegmentSettings,
    /// Cavity.
    pub cavity: CavitySettings,
}

impl PairSettings {
    /// Refuses settings out of range, by name.
    ///
    /// # Errors
    /// The first that is, in words.
    pub fn check(&self) -> Result<(), String> {
        self.deformable.check().map_err(|e| format!("[anat.deformable]: {e}"))?;
        self.sag.check().map_err(|e| format!("[anat.sag]: {e}"))?;
        self.segment.check().map_err(|e| format!("[anat.segment]: {e}"))?;
        self.cavity.check().map_err(|e| format!("[anat.cavity]: {e}"))
    }
}

impl Default for PairSettings {
    fn default() -> Self {
        Self {
            deformable: DeformableSettings::default(),
            // One brain twice: its sag is smoother than what differs between heads. What moves most is a small part of the brain,
            // whose gain its mean correlation does not show.
            sag: DeformableSettings {
                affine: false,
                iterations: vec![80, 80, 60],
                update_sigma_voxels: 4.0,
                // What surrounds the brain does not sink with it.
                margin_mm: 4.0,
                least_gain: 0.0,
                ..DeformableSettings::default()
            },
            segment: SegmentSettings::default(),
            cavity: CavitySettings::default(),
        }
    }
}

/// Masks the user brings, on the template's grid but for brain and ventricle; they win over the computed ones.
#[derive(Clone, Debug, Default)]
pub struct GivenMasks {
    /// Labels of the pre-operative scan, on any grid of its frame: nothing is segmented then, and the scans may have
    /// another contrast than T1.
    pub labels: Option<LabelMap<Pre>>,
    /// The brain on the pre-operative scan.
    pub brain: Option<Mask<Pre>>,
    /// Lateral and third ventricles on the pre-operative scan.
    pub ventricle: Option<Mask<Pre>>,
    /// The cavity.
    pub cavity: Option<Mask<Mni>>,
    /// The resected tissue.
    pub resected: Option<Mask<Mni>>,
    /// The pre-operative head as [`take_head_apart`] has left it, with these masks and settings.
    pub head: Option<HeadApart>,
}

/// A pre-operative head taken apart.
#[derive(Clone, Debug)]
pub struct HeadApart {
    /// Its tissue.
    pub pre: Segmentation<Pre>,
    /// Where in the template a point of the patient lies; both in the MNI frame reached rigidly.
    pub template_from_patient: DisplacementField<Mni>,
    /// How its intensities go with tissue.
    pub scale: Scale,
    /// Mean local correlation of the fitted template with the scan; `None` where labels were given and nothing was fitted to it.
    pub template_correlation: Option<f64>,
}

/// Both scans with their labels and what the operation took.
#[derive(Clone, Debug)]
pub struct OperatedBrain {
    /// How alike the folds of the scans are; `None` where too little is seen in both.
    pub likeness: Option<Likeness>,
    /// The pre-operative scan.
    pub pre: Segmentation<Pre>,
    /// The post-operative scan.
    pub post: Segmentation<Post>,
    /// Cavity, resected tissue, side.
    pub finding: CavityFinding,
    /// Where in the template a point of the pre-operative head lies; both in the MNI frame reached rigidly.
    pub template_from_patient: DisplacementField<Mni>,
    /// See [`HeadApart::template_correlation`].
    pub template_correlation: Option<f64>,
    /// Where the pre-operative brain lies after the operation, around the cavity; both in the MNI frame reached rigidly.
    pub sag: AtlasFit<Mni>,
    /// Ventricles of the post-operative scan, apart from the cavity.
    pub post_ventricle: Mask<Mni>,
    /// Brain of the post-operative scan without the cavity.
    pub post_brain: Mask<Mni>,
}

/// Why a pair could not be taken apart.
#[derive(Debug, Error)]
pub enum PairError {
    /// Two heads, or one that does not lie on itself.
    #[error(
        "the two scans do not show one person: once one lies on the other their folds correlate by {folds:.2} (one head: .9 \
         and more, two heads: .7 and less); check that both files are of this patient; if they are, the registration failed: \
         look at both images together, or give a cavity mask to go on all the same"
    )]
    NotOnePerson {
        /// See [`Likeness::folds`].
        folds: f64,
    },
    /// One head, in two weightings.
    #[error(
        "what is bright in one of the two scans is dark in the other (once one lies on the other their folds correlate by {folds:.2}): \
         they have two weightings; a cavity is told by what has become dark, so give two T1-weighted scans, or a cavity mask to go on \
         all the same"
    )]
    OtherWeighting {
        /// See [`Likeness::folds`].
        folds: f64,
    },
    /// A scan cannot be taken apart, or the brain of one not be found in the other.
    #[error("{scan}: {source}")]
    Head {
        /// Which of the two.
        scan: &'static str,
        /// The fit's or the segmentation's own words.
        source: HeadError,
    },
    /// No cavity, or one outside the brain.
    #[error(transparent)]
    Resect(#[from] ResectError),
    /// Nothing was taken out.
    #[error(
        "no resected tissue was found: the cavity holds no tissue of the pre-operative brain, or hardly any (in labels of your own, what was taken has to be tissue); check the cavity \
         mask, or give a mask of the resected tissue"
    )]
    NothingResected,
    /// The operation's ventricle cannot be told from the cavity.
    #[error(
        "no ventricle is left on the post-operative scan: it is empty or lies within the cavity; check the cavity mask"
    )]
    NoVentricle,
}

/// Labels both scans with the template's maps carried onto each head, finds the cavity on the post-operative scan and
/// the tissue that filled it on the pre-operative one.
///
/// `step` is told what is being done, five times.
///
/// # Errors
/// [`PairError`], which names the scan.
pub fn take_pair_apart(
    pre: &PosedScan<'_, Pre>,
    post: &PosedScan<'_, Post>,
    given: &GivenMasks,
    settings: &PairSettings,
    step: impl Fn(&'static str),
) -> Result<OperatedBrain, PairError> {
    // The slices that one scan has lost are no tissue that the patient has.
    let (filled, gaps) = without_gaps(post.t1).unzip();
    let filled = filled.as_ref().map(|t1| PosedScan::new(t1, &post.mni_from_t1));
    let post = filled.as_ref().unwrap_or(post);
    let (filled, pre_gaps) = without_gaps(pre.t1).unzip();
    let filled = filled.as_ref().map(|t1| PosedScan::new(t1, &pre.mni_from_t1));
    let pre = filled.as_ref().unwrap_or(pre);
    let likeness = likeness(pre.t1, post.t1, &pre.mni_from_t1, &post.mni_from_t1);
    let by_hand = given.cavity.is_some() || given.resected.is_some();
    if let Some(found) = likeness.filter(|found| !by_hand && !found.is_one_head()) {
        let folds = found.folds;
        let labels = given.labels.as_ref();
        return Err(if found.is_reversed() || labels.is_some_and(|labels| tissues_exchanged(pre, post, labels)) {
            PairError::OtherWeighting { folds }
        } else {
            PairError::NotOnePerson { folds }
        });
    }

    step("pre-operative tissue");
    let HeadApart { pre: before, template_from_patient, scale, template_correlation } =
        if let Some(head) = &given.head { head.clone() } else { head_apart(pre, pre_gaps, given, settings)? };

    step("cavity");
    let (post_raw, post_known) = (post.on_template(), post.known());
    let of_masks = subtract(given.cavity.clone(), given.resected.clone(), &before.brain_mni, &before.labels_mni)?;
    let tissue = tissue_of(&before.labels_mni);
    let known_tissue = both(&tissue, post_known);
    // Ratios of gain are those of the scans as they are; turning back is turning again.
    let as_scanned = before.t1_mni.map(|x| scale.of(x));
    let alike = |pre: &Volume<f32, Mni>| on_the_scale_of(pre, post_raw, &known_tissue, settings.cavity.bias_sigma_mm);
    let post_t1 = if given.labels.is_some() {
        // Where labels were given no gain was looked for.
        alike(&as_scanned)
    } else {
        // What was taken out of one scan goes out of the other, around the brain as within it: a skull that is bright on one of
        // them alone would draw the brain to it, or away.
        let raw = pre.on_template();
        let post = alike(raw);
        Volume::from_fn(raw.grid, |n| {
            if raw.data[n] > 0.0 { post.data[n] * (as_scanned.data[n] / raw.data[n]) } else { post.data[n] }
        })
    };
    let post_t1 = if scale.turned_at.is_some() { post_t1.map(|x| scale.of(x)) } else { post_t1 };
    let drawn = given.cavity.as_ref().or(given.resected.as_ref());
    let unchanged = drawn.and_then(|cavity| unchanged_percent(cavity, &before, &post_t1, post_known));
    let pair = CavityPair {
        pre: &before.t1_mni,
        pre_labels: &before.labels_mni,
        pre_brain: &before.brain_mni,
        post: &post_t1,
        post_known,
        csf_grey_border: before.csf_grey_border,
        grey_mean: before.tissue_means[1],
        grey_white_contrast: before.tissue_means[2] - before.tissue_means[1],
    };

    step("sag");
    let fit_around = |cavity: &Mask<Mni>| {
        let scans = SagScans { pre: &before.t1_mni, pre_brain: &before.brain_mni, post: &post_t1, post_known, cavity };
        let fit = fit_sag(&scans, &settings.sag);
        fit.map_err(|source| PairError::Head { scan: "the post-operative scan", source: source.into() })
    };
    let template = &atlas::template().labels;
    let has_tissue = |p| template.nearest(template_from_patient.apply(p)).is_some_and(label::is_tissue);
    let seen =
        || with_losses_elsewhere(find_cavity(&pair, &settings.cavity), &pair, fit_around, has_tissue, &settings.cavity);
    let around_mask = |finding: CavityFinding| -> Result<_, PairError> {
        let sag = fit_around(&finding.cavity)?;
        let at_rest = given.cavity.is_none();
        let finding =
            if at_rest { CavityFinding { cavity: carried(&finding.cavity, &sag), ..finding } } else { finding };
        let cc = lost_elsewhere_cc(&pair, &sag, &finding.cavity, has_tissue, &settings.cavity);
        Ok((finding, sag, cc))
    };
    let mut beside: Vec<SegmentWarning> = Vec::new();
    let (computed, (mut finding, sag, lost_elsewhere_cc)) = match of_masks {
        None => (true, seen()?),
        Some(drawn) if given.cavity.is_some() => (false, around_mask(drawn)?),
        // The mask of what was taken says what is gone of the brain at rest. Where its walls are now the second scan shows.
        Some(drawn) => match seen() {
            Ok((seen, sag, cc)) if undone(&seen.cavity, &sag).dice(&drawn.resected) >= ONE_PLACE => {
                (true, (seen, sag, cc))
            }
            _ => {
                beside.push(SegmentWarning::CavityOfMask);
                (false, around_mask(drawn)?)
            }
        },
    };
    if computed {
        let near = around(&finding.cavity, settings.cavity.blood_mm + NEAR_MM);
        let cavity = finding.cavity.cropped(&near);
        let carried = [&before.t1_mni, &tissue.map(f32::from), &before.brain_mni.map(f32::from)];
        let [pre, tissue, brain] = sag.atlas_from_subject.warp(carried, &cavity.grid);
        let pair = SaggedPair {
            pre: &pre,
            tissue: &tissue.map(|share| share >= 0.5),
            brain: &brain.map(|share| share >= 0.5),
            post: &post_t1.cropped(&near),
            post_known: &post_known.cropped(&near),
            csf_grey_border: before.csf_grey_border,
            grey_mean: before.tissue_means[1],
            grey_white_contrast: before.tissue_means[2] - before.tissue_means[1],
        };
        let with_blood = with_blood(&cavity, &pair, &settings.cavity);
        finding.cavity.paste(&with_blood.cavity, &near);
        beside.extend(with_blood.told(settings.cavity.smallest_cc));
    }
    let filled_before = undone(&finding.cavity, &sag);
    let filled = || filling(&filled_before, &before.brain_mni, &before.labels_mni);
    finding.resected = given.resected.clone().unwrap_or_else(filled);
    if !takes_tissue(&finding.resected, &before.labels_mni) {
        return Err(PairError::NothingResected);
    }

    step("post-operative tissue");
    let post_priors = carried_priors(|p| template_from_patient.apply(sag.atlas_from_subject.apply(p)));
    let [fluid, grey, white] = before.tissue_means;
    let as_in_t1 = scale.turned_at.is_none() && fluid < grey && grey < white;
    let mut after = if given.labels.is_some() && !as_in_t1 {
        // Without T1's contrast nothing is known of the tissue after the operation but where it went.
        let moved = labels_through(&before.labels_mni, &sag);
        segment_by_labels(post, &labels_on(&moved, &post.t1.grid, &post.mni_from_t1)).0
    } else {
        segment_with_priors(post, &post_priors, &SegmentOverrides::default(), &settings.segment)
            .map_err(|source| PairError::Head { scan: "the post-operative scan", source: source.into() })?
    };
    after.warnings.extend(gaps.unwrap_or_default());
    after.warnings.extend(unchanged.map(|percent| SegmentWarning::UnchangedCavity { percent }));
    let unlike = likeness.filter(|found| !found.is_one_head());
    after.warnings.extend(unlike.map(|found| SegmentWarning::UnlikeScans { folds: found.folds }));
    after.warnings.extend(lost_elsewhere_cc.map(|cc| SegmentWarning::LostElsewhere { cc }));
    after.warnings.extend(beside);
    if computed {
        let percent = outside_percent(&filled_before, &before.brain_mni);
        after.warnings.extend((percent > NOTED_ABOVE_BRAIN).then_some(SegmentWarning::AboveSunkBrain { percent }));
    }
    if computed || given.resected.is_none() {
        let percent = at_edge_percent(&finding.cavity, &before.brain_mni, post_known);
        after.warnings.extend((percent > NOTED_AT_EDGE).then_some(SegmentWarning::CavityAtEdge { percent }));
    }
    let post_ventricle = apart_from(&after.labels_mni.map(|l| l == label::VENTRICLE), &finding.cavity, 1.0);
    if post_ventricle.count() == 0 {
        return Err(PairError::NoVentricle);
    }
    let post_brain = apart_from(&after.brain_mni, &finding.cavity, 0.0);
    Ok(OperatedBrain {
        likeness,
        pre: before,
        post: after,
        finding,
        template_from_patient,
        template_correlation,
        sag,
        post_ventricle,
        post_brain,
    })
}

/// [`take_head_apart`], with what is told of the slices that its scan had lost.
fn head_apart(
    pre: &PosedScan<'_, Pre>,
    gaps: Option<Vec<SegmentWarning>>,
    given: &GivenMasks,
    settings: &PairSettings,
) -> Result<HeadApart, PairError> {
    let (mut pre, template, scale) = take_head_apart(pre, given, settings)?;
    pre.warnings.extend(gaps.unwrap_or_default());
    let template_correlation = template_correlation(given, &template);
    Ok(HeadApart { pre, template_from_patient: template.atlas_from_subject, scale, template_correlation })
}

/// Labels the pre-operative scan with the template's maps carried onto the head, or by a label map that was given; with the
/// template's fit and how intensities go with tissue.
///
/// # Errors
/// [`PairError::Head`].
pub fn take_head_apart(
    pre: &PosedScan<'_, Pre>,
    given: &GivenMasks,
    settings: &PairSettings,
) -> Result<(Segmentation<Pre>, AtlasFit<Mni>, Scale), PairError> {
    let masks = SegmentOverrides { brain: given.brain.as_ref(), ventricle: given.ventricle.as_ref() };
    let in_pre = |source| PairError::Head { scan: "the pre-operative scan", source };
    if let Some(labels) = &given.labels {
        let (filled, gaps) = without_gaps(pre.t1).unzip();
        let filled = filled.as_ref().map(|t1| PosedScan::new(t1, &pre.mni_from_t1));
        let (mut before, scale) = segment_by_labels(filled.as_ref().unwrap_or(pre), labels);
        let fit = fit_template_to_labels(&before.labels_mni, &settings.deformable).map_err(|e| in_pre(e.into()))?;
        let on_template = |p| fit.atlas_from_subject.apply(p);
        let left_out = LeftOut::of(&before.brain_mni, &before.known_mni, on_template).noted(BrainSource::Labels);
        before.warnings.extend(left_out.into_iter().chain(gaps.unwrap_or_default()));
        return Ok((before, fit, scale));
    }
    let head = segment_head(pre, &masks, &settings.deformable, &settings.segment);
    let (before, fit) = head.map_err(in_pre)?;
    Ok((before, fit, Scale { turned_at: None }))
}

/// Whether white matter is the brighter tissue in one of the scans alone, where a label map of the first lies: two weightings (a T1 and
/// a FLAIR), whose folds are not each other's opposite as a T1's and a T2's are.
fn tissues_exchanged(pre: &PosedScan<'_, Pre>, post: &PosedScan<'_, Post>, labels: &LabelMap<Pre>) -> bool {
    /// Of grey matter's intensity: closer together neither tissue is the brighter one.
    const APART: f64 = 0.05;
    let labels = labels_on(labels, &pre.on_template().grid, &pre.mni_from_t1.inverse());
    let contrast = |scan: &Volume<f32, Mni>, known: &Mask<Mni>| {
        let [grey, white] = [label::GREY_MATTER, label::WHITE_MATTER].map(|tissue| {
            let (mut sum, mut count) = (0.0, 0.0f64);
            for n in (0..scan.data.len()).filter(|&n| known.data[n] && labels.data[n] == tissue) {
                sum += f64::from(scan.data[n]);
                count += 1.0;
            }
            sum / count.max(1.0)
        });
        (white - grey) / grey.max(1e-6)
    };
    let (before, after) = (contrast(pre.on_template(), pre.known()), contrast(post.on_template(), post.known()));
    before.abs().min(after.abs()) > APART && before * after < 0.0
}

/// How much of a cavity drawn by hand shows after the operation what it showed before, percent; `None` where that is little
/// enough for a cavity.
fn unchanged_percent(
    cavity: &Mask<Mni>,
    before: &Segmentation<Pre>,
    post: &Volume<f32, Mni>,
    known: &Mask<Mni>,
) -> Option<f64> {
    /// A cavity full of blood is as bright as tissue, but has not its folds.
    const MOST_PERCENT: f64 = 50.0;
    let [_, grey, white] = before.tissue_means;
    let alike = 0.5 * (white - grey).abs();
    let tissue = |n: usize| cavity.data[n] && known.data[n] && label::is_tissue(before.labels_mni.data[n]);
    let (mut same, mut all) = (0usize, 0usize);
    for n in (0..cavity.data.len()).filter(|&n| tissue(n)) {
        all += 1;
        same += usize::from(f64::from(post.data[n] - before.t1_mni.data[n]).abs() < alike);
    }
    let percent = 100.0 * same as f64 / all.max(1) as f64;
    (percent > MOST_PERCENT).then_some(percent)
}

/// How well the fitted template looks like the scan; of one fitted to labels nothing is known.
pub fn template_correlation(given: &GivenMasks, fit: &AtlasFit<Mni>) -> Option<f64> {
    given.labels.is_none().then_some(fit.quality.correlation[1])
}

/// What lies further from the cavity than this has no part in it, mm: more than any brain sags, and more than the windows
/// of all filters.
const NEAR_MM: f64 = 25.0;
/// More of a cavity's surroundings outside the scan than this is told, percent.
const NOTED_AT_EDGE: f64 = 2.0;
/// More of a cavity where, by the sag, no brain was is told, percent (docs/evidence/choices.md).
const NOTED_ABOVE_BRAIN: f64 = 12.0;

/// The box around a mask with a margin; the whole grid for an empty mask.
fn around(mask: &Mask<Mni>, margin_mm: f64) -> VoxelBox {
    let whole = VoxelBox { first: [0; 3], end: mask.grid.dims };
    mask.bounding_box().map_or(whole, |found| found.grown(&mask.grid, margin_mm))
}

/// The labels where the tissue is after the operation.
fn labels_through(labels: &LabelMap<Mni>, sag: &AtlasFit<Mni>) -> LabelMap<Mni> {
    let grid = labels.grid;
    Volume::from_fn(grid, |n| {
        let p = grid.position(grid.voxel(n).map(|v| v as f64).into());
        labels.nearest(sag.atlas_from_subject.apply(p)).unwrap_or(label::BACKGROUND)
    })
}

/// Where the cavity lies once the sag is undone: what of it was brain filled it.
fn undone(cavity: &Mask<Mni>, sag: &AtlasFit<Mni>) -> Mask<Mni> {
    let near = around(cavity, NEAR_MM);
    let [undone] = sag.subject_from_atlas.warp([&cavity.map(f32::from)], &cavity.grid.cropped(&near));
    undone.map(|share| share >= 0.5).within(&cavity.grid, false)
}

/// From this Dice on with the mask of what was taken, the sag undone, a cavity that is seen is that mask's. Well below what the
/// cavity of a synthetic patient has with its own mask (docs/evidence/synthetic-faults.md), since outlines drawn by hand differ.
const ONE_PLACE: f64 = 0.6;

/// Where a place of the brain at rest is after its sag.
fn carried(at_rest: &Mask<Mni>, sag: &AtlasFit<Mni>) -> Mask<Mni> {
    let near = around(at_rest, NEAR_MM);
    let [moved] = sag.atlas_from_subject.warp([&at_rest.map(f32::from)], &at_rest.grid.cropped(&near));
    moved.map(|share| share >= 0.5).within(&at_rest.grid, false)
}

fn tissue_of(labels: &LabelMap<Mni>) -> Mask<Mni> {
    labels.map(label::is_tissue)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::RigidTransform;
    use crate::image::Grid;
    use crate::segment::TissueVolumes;

    #[test]
    fn a_t1_and_a_flair_have_their_tissues_exchanged_and_two_t1_have_not() {
        let labels: LabelMap<Pre> = atlas::template().labels.clone().relabelled();
        let drawn = |grey: f32, white: f32| {
            labels.map(|l| match l {
                label::BACKGROUND => 0.0,
                label::GREY_MATTER => grey,
                label::WHITE_MATTER => white,
                _ => 30.0,
            })
        };
        let (same, moved) = (RigidTransform::identity(), RigidTransform::identity());
        let t1 = drawn(70.0, 100.0);
        let exchanged = |post: Volume<f32, Pre>| {
            let post = post.relabelled();
            tissues_exchanged(&PosedScan::new(&t1, &same), &PosedScan::new(&post, &moved), &labels)
        };
        assert!(exchanged(drawn(100.0, 80.0)));
        assert!(!exchanged(drawn(80.0, 110.0)));
        assert!(!exchanged(drawn(90.0, 88.0)), "neither tissue is the brighter one");
    }

    #[test]
    fn a_slice_that_a_scan_with_labels_has_lost_is_filled_and_told() {
        let labels: LabelMap<Pre> = atlas::template().labels.clone().relabelled();
        let lost = labels.grid.dims[2] / 2;
        let t1 = Volume::from_fn(labels.grid, |n| {
            let shown = [0.0, 30.0, 70.0, 100.0, 30.0].get(usize::from(labels.data[n])).copied().unwrap_or(70.0f32);
            if labels.grid.voxel(n)[2] == lost { 0.0 } else { shown }
        });
        let rough = DeformableSettings { iterations: vec![1], levels_mm: vec![8.0], ..DeformableSettings::default() };
        let settings = PairSettings { deformable: rough, ..PairSettings::default() };
        let given = GivenMasks { labels: Some(labels.clone()), ..GivenMasks::default() };
        let pose = RigidTransform::identity();
        let (before, ..) = take_head_apart(&PosedScan::new(&t1, &pose), &given, &settings).unwrap();
        let told = before.warnings.iter().filter(|w| matches!(w, SegmentWarning::BlankSlices { .. })).count();
        assert_eq!(told, 1, "{:?}", before.warnings);
        let dark = (0..labels.data.len()).filter(|&n| labels.grid.voxel(n)[2] == lost && before.brain_mni.data[n]);
        let dark = dark.filter(|&n| before.t1_mni.data[n] == 0.0).count();
        assert!(dark < 100, "{dark}");
    }

    #[test]
    fn a_cavity_drawn_over_tissue_that_is_still_there_is_told() {
        let grid = Grid::<Mni>::axis_aligned([24; 3], [1.0; 3], [0.0; 3]);
        let folds = Volume::from_fn(grid, |n| if (n / 3) % 2 == 0 { 100.0 } else { 160.0 });
        let labels = folds.map(|x| if x > 130.0 { label::WHITE_MATTER } else { label::GREY_MATTER });
        let brain = labels.map(|_| true);
        let before = Segmentation::<Pre> {
            brain: brain.clone().relabelled(),
            labels: labels.clone().relabelled(),
            t1_mni: folds.clone(),
            known_mni: brain.clone(),
            brain_mni: brain.clone(),
            labels_mni: labels,
            tissue_means: [30.0, 100.0, 160.0],
            csf_grey_border: 65.0,
            volumes: TissueVolumes {
                brain_cc: 1.0,
                csf_cc: 0.0,
                grey_matter_cc: 0.5,
                white_matter_cc: 0.5,
                ventricle_cc: 0.0,
            },
            regions: Vec::new(),
            warnings: Vec::new(),
        };
        let cavity = Mask::from_fn(grid, |n| grid.voxel(n).iter().all(|v| (6..18).contains(v)));
        let shown = |inside: f32| Volume::from_fn(grid, |n| if cavity.data[n] { inside } else { folds.data[n] });
        let percent = |post: &Volume<f32, Mni>| unchanged_percent(&cavity, &before, post, &brain);
        assert!(percent(&folds).is_some_and(|p| p > 99.0));
        // Fluid, and blood between the two tissues.
        assert_eq!((percent(&shown(30.0)), percent(&shown(130.0))), (None, None));
    }
}
