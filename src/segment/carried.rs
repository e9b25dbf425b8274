//! The template carried onto a head by a deformable fit, and the head segmented with it.

use super::brain_source::BrainSource;
use super::confidence::evidence;
use super::coverage::LeftOut;
use super::overhang::{beyond, onto_the_brain, short};
use super::posed_scan::PosedScan;
use super::segmentation::{FoundBrain, find_brain, labelled};
use super::turned::Turned;
use super::{AtlasPriors, SegmentError, SegmentOverrides, SegmentSettings, SegmentWarning, Segmentation, atlas};
use crate::geometry::{AffineTransform, Frame, Mni, Position, RigidTransform};
use crate::image::{Mask, Volume, blank_slices, with_filled};
use crate::register::deformable::{AtlasFit, DeformableError, DeformableSettings, fit_atlas};
use crate::register::{
    MeanHead, RegisterError, RigidFit, register_to_mean_head, register_to_mean_head_from, subject_from_mean_head,
    without_gain,
};
use thiserror::Error;

/// What is left of the misfit between the carried template and a head, mm: about a voxel of the fit's finest level.
const MISFIT_MM: f64 = 1.5;

/// Why a head could not be taken apart.
#[derive(Debug, Error)]
pub enum HeadError {
    /// The template does not fit.
    #[error(transparent)]
    Fit(#[from] DeformableError),
    /// The labels are refused.
    #[error(transparent)]
    Segment(#[from] SegmentError),
    /// The deformed template does not look like the head.
    #[error(
        "the template does not fit this head (local correlation {correlation:.2}, at least {least:.2} is needed): the scan must \
         be T1-weighted and show the whole brain; look at the pose, or give a brain mask of an unusual brain"
    )]
    PoorFit {
        /// Mean local correlation over the brain after the fit.
        correlation: f64,
        /// What is needed.
        least: f64,
    },
    /// The brain found is not the one that the fitted template expects.
    #[error(
        "the brain found has {found_cc:.0} cc where the fitted template expects {expected_cc:.0} cc: scalp or neck was taken for \
         brain, or a part is missing; look at the labels, and for the pre-operative scan give a brain mask"
    )]
    UnlikeTemplate {
        /// Volume found.
        found_cc: f64,
        /// Volume of the carried template.
        expected_cc: f64,
    },
}

/// Local correlation under which the fit is tried again without the stretch that was found.
const DOUBTFUL: f64 = 0.5;
/// Local correlation under which a fit is refused: half way between what a deformable fit reaches from a wrong pose, where it
/// lines up whatever folds it meets, and what it reaches from the right one on the hardest heads (thick slices, small
/// children, lesions, wide ventricles).
const LEAST: f64 = 0.4;
/// Share of the layer outside the carried surface that is found to be brain from which on the template came out too small.
/// Half way between heads that it fits, where fluid and bone fill that layer, and those whose gyral crowns it cut.
const CROWDED: f64 = 0.04;
/// Share from which on the outline is doubtful where nothing has helped.
const DOUBTFUL_SHARE: f64 = 0.15;
/// What is tried then, one after the other while it helps: a wider rim around the brain is compared, which draws the surface
/// out, and larger starts.
const LARGER: [Larger; 3] = [Larger::WiderRim, Larger::Start, Larger::Start];
/// How much wider the rim is, mm.
const WIDER_RIM_MM: f64 = 2.0;
/// Slices lost over more than this, mm, are more than can be read between their neighbours.
const WIDEST_GAP_MM: f64 = 10.0;
/// Loss of local correlation with which a larger template is not believed.
const MUCH_WORSE: f64 = 0.02;
/// The brain found over the brain expected; hydrocephalus and atrophy change both.
const VOLUME_RATIO: std::ops::RangeInclusive<f64> = 0.8..=1.2;

/// The mean of many heads, to be compared with.
fn mean_head() -> MeanHead<'static, Mni> {
    let head = atlas::mean_head();
    MeanHead { t1: &head.t1, brain: &head.brain, bare: &head.bare }
}

/// The pose of a head in the template's frame, found against the mean of whole heads.
///
/// # Errors
/// [`RegisterError`].
pub fn pose_of_head<F: Frame>(t1: &Volume<f32, F>) -> Result<RigidFit<F, Mni>, RegisterError> {
    register_to_mean_head(t1, &mean_head())
}

/// Where a head lies in the MNI frame, from where a hand has laid it.
///
/// # Errors
/// The registration's.
pub fn pose_of_head_from<F: Frame>(
    t1: &Volume<f32, F>,
    start: &RigidTransform<F, Mni>,
) -> Result<RigidFit<F, Mni>, RegisterError> {
    register_to_mean_head_from(t1, &mean_head(), start)
}

/// The template deformed onto a head; both in the MNI frame reached rigidly.
///
/// # Errors
/// The fit's.
pub fn fit_template<F: Frame>(
    t1: &Volume<f32, F>,
    mni_from_t1: &RigidTransform<F, Mni>,
    settings: &DeformableSettings,
) -> Result<AtlasFit<Mni>, DeformableError> {
    Ok(Carried::onto(&PosedScan::new(t1, mni_from_t1), settings)?.fit)
}

/// A way to a larger template.
#[derive(Clone, Copy, PartialEq)]
enum Larger {
    WiderRim,
    Start,
}

/// A fit with what it began from.
struct Carried {
    /// The head on the template's grid as the fit saw it; not a number where nothing is known.
    subject: Volume<f32, Mni>,
    /// Subject from template, before the deformable part.
    start: AffineTransform<Mni, Mni>,
    fit: AtlasFit<Mni>,
}

impl Carried {
    fn from(
        subject: Volume<f32, Mni>,
        start: AffineTransform<Mni, Mni>,
        settings: &DeformableSettings,
    ) -> Result<Self, DeformableError> {
        let fit = fit_atlas(&subject, &atlas::template().t1_f32(), &start, None, settings)?;
        Ok(Self { subject, start, fit })
    }

    fn correlation(&self) -> f64 {
        self.fit.quality.correlation[1]
    }

    fn or(self, other: Self) -> Self {
        if other.correlation() > self.correlation() { other } else { self }
    }

    /// The fit from the stretch that was found, with the coil's gain taken out: it bends what is compared at coarse levels,
    /// and where it leaves the crown dim the surface would be drawn in. Where the fit is doubtful, also with the head as it
    /// is and from the mean head's size.
    fn onto<F: Frame>(scan: &PosedScan<'_, F>, settings: &DeformableSettings) -> Result<Self, DeformableError> {
        let (subject, known) = (scan.on_template(), scan.known());
        let start = if settings.affine { stretch(subject, known) } else { AffineTransform::identity() };
        let flat = without_gain(&subject.clone().relabelled());
        let first = Self::from(where_known(&flat.relabelled(), known), start, settings)?;
        if !settings.affine || first.correlation() >= DOUBTFUL {
            return Ok(first);
        }
        let best = first.or(Self::from(where_known(subject, known), start, settings)?);
        let plain = Self::from(best.subject.clone(), atlas::head_from_template(), settings)?;
        Ok(best.or(plain))
    }
}

/// Not a number where nothing is known.
fn where_known(subject: &Volume<f32, Mni>, known: &Mask<Mni>) -> Volume<f32, Mni> {
    Volume::from_fn(subject.grid, |n| if known.data[n] { subject.data[n] } else { f32::NAN })
}

/// From the template to a head that lies rigidly aligned with it: by way of the mean head in its natural size.
fn stretch(subject: &Volume<f32, Mni>, known: &Mask<Mni>) -> AffineTransform<Mni, Mni> {
    atlas::head_from_template().then(&subject_from_mean_head(subject, &mean_head(), Some(known)))
}

/// The template's maps read through `template_from_patient`, a map that [`fit_template`] made, where brain may be.
pub fn carried_priors(template_from_patient: impl Fn(Position<Mni>) -> Position<Mni> + Sync) -> AtlasPriors {
    AtlasPriors::near_brain(&atlas::template().grid(), template_from_patient, MISFIT_MM)
}

/// A head on the template's grid, and what its brain is looked for with.
struct BrainSearch<'a, F: Frame> {
    scan: &'a PosedScan<'a, F>,
    /// The brain's mask where the user brought one.
    given: Option<&'a Mask<F>>,
    settings: &'a SegmentSettings,
}

/// The brain found with a carried template.
struct FittedBrain {
    carried: Carried,
    found: FoundBrain,
    /// The template's maps; let go while another template is tried, since two of them at a time would be the peak of memory.
    priors: Option<AtlasPriors>,
    beyond: f64,
}

impl<F: Frame> BrainSearch<'_, F> {
    fn with(&self, carried: Carried) -> Result<FittedBrain, SegmentError> {
        let priors = self.priors_of(&carried.fit);
        let found = find_brain(self.scan, &priors, self.given, self.settings)?;
        let beyond = beyond(&found.brain, &found.known, &priors).share;
        Ok(FittedBrain { carried, found, priors: Some(priors), beyond })
    }

    fn priors_of(&self, fit: &AtlasFit<Mni>) -> AtlasPriors {
        let template_from_patient = |p| fit.atlas_from_subject.apply(p);
        // A brain that was given counts wherever it lies: the user may know better than the fit.
        if self.given.is_some() {
            AtlasPriors::through(&atlas::template().grid(), template_from_patient, MISFIT_MM)
        } else {
            carried_priors(template_from_patient)
        }
    }

    /// Of the fit that was kept; made again where they had to be let go.
    fn priors(&self, fitted: &mut FittedBrain) -> AtlasPriors {
        fitted.priors.take().unwrap_or_else(|| self.priors_of(&fitted.carried.fit))
    }

    /// The template fitted again to the scan without a strong coil's gain, where there is one: what the first fit saw was
    /// flattened without knowing where the brain lies, and what is left hides the contrast of its dim parts.
    fn with_the_coil_known(
        &self,
        mut first: FittedBrain,
        deformable: &DeformableSettings,
    ) -> Result<FittedBrain, HeadError> {
        if !first.found.warnings.iter().any(|warning| matches!(warning, SegmentWarning::StrongGain { .. })) {
            return Ok(first);
        }
        let subject = where_known(&first.found.raw, &first.found.known);
        first.priors = None;
        let again = Carried::from(subject, first.carried.start, deformable)?;
        if again.correlation() > first.carried.correlation() { Ok(self.with(again)?) } else { Ok(first) }
    }

    /// The template made larger for as long as brain is found beyond it and that helps.
    fn grown(&self, mut best: FittedBrain, deformable: &DeformableSettings) -> Result<FittedBrain, HeadError> {
        let mut settings = deformable.clone();
        for way in LARGER {
            if best.beyond < CROWDED {
                break;
            }
            let mut tried = settings.clone();
            let mut start = best.carried.start;
            match way {
                Larger::WiderRim => {
                    tried.margin_mm = (tried.margin_mm + WIDER_RIM_MM).min(DeformableSettings::WIDEST_MARGIN_MM);
                }
                Larger::Start => {
                    let priors = self.priors(&mut best);
                    start = start.then(&onto_the_brain(&best.found.brain, &priors));
                }
            }
            best.priors = None;
            let larger = Carried::from(best.carried.subject.clone(), start, &tried)?;
            if larger.correlation() >= best.carried.correlation() - MUCH_WORSE {
                let larger = self.with(larger)?;
                if larger.beyond < best.beyond {
                    (best, settings) = (larger, tried);
                    continue;
                }
            }
            if way == Larger::Start {
                // The same start again would end the same.
                break;
            }
        }
        Ok(best)
    }
}

/// The scan with slices that show nothing between others filled, and what to say of them; `None` where there are none.
pub fn without_gaps<F: Frame>(t1: &Volume<f32, F>) -> Option<(Volume<f32, F>, Vec<SegmentWarning>)> {
    let gaps = blank_slices(t1, WIDEST_GAP_MM);
    let told = || gaps.iter().map(|gap| SegmentWarning::blank(gap, &t1.grid)).collect();
    (!gaps.is_empty()).then(|| (with_filled(t1, &gaps), told()))
}

/// Labels of a head that has been registered rigidly to the template: fits the template, then [`super::segment_with_priors`].
/// Slices that show nothing between others are filled first.
///
/// # Errors
/// [`HeadError`].
pub fn segment_head<F: Frame>(
    scan: &PosedScan<'_, F>,
    overrides: &SegmentOverrides<'_, F>,
    deformable: &DeformableSettings,
    settings: &SegmentSettings,
) -> Result<(Segmentation<F>, AtlasFit<Mni>), HeadError> {
    settings.check()?;
    let (filled, gaps) = without_gaps(scan.t1).unzip();
    let filled = filled.as_ref().map(|t1| PosedScan::new(t1, &scan.mni_from_t1));
    let scan = filled.as_ref().unwrap_or(scan);
    let carried = Carried::onto(scan, deformable)?;
    let correlation = carried.correlation();
    if correlation < LEAST {
        return Err(HeadError::PoorFit { correlation, least: LEAST });
    }
    let search = BrainSearch { scan, given: overrides.brain, settings };
    let mut best = search.with(carried)?;
    best = search.with_the_coil_known(best, deformable)?;
    if deformable.affine && overrides.brain.is_none() {
        best = search.grown(best, deformable)?;
    }
    let priors = search.priors(&mut best);
    let FittedBrain { carried, found, .. } = best;
    let (outside, short) = (beyond(&found.brain, &found.known, &priors), short(&found.brain, &found.known, &priors));
    let known = &found.known.data;
    let expected = Mask::from_fn(priors.brain_mm.grid, |n| priors.brain_mm.data[n] < 0.0 && known[n]);
    let mut segmentation = labelled(scan, found, &priors, overrides, settings)?;
    let on_template = |p| carried.fit.atlas_from_subject.apply(p);
    segmentation.regions = evidence(&segmentation.labels_mni, &segmentation.t1_mni, on_template);
    segmentation.warnings.extend(gaps.unwrap_or_default());
    segmentation.warnings.extend(Turned::of(&expected, on_template).noted());
    let left_out = LeftOut::of(&segmentation.brain_mni, &segmentation.known_mni, on_template);
    if overrides.brain.is_some() {
        segmentation.warnings.extend(left_out.noted(BrainSource::Mask));
        return Ok((segmentation, carried.fit));
    }
    segmentation.warnings.extend(left_out.noted(BrainSource::Found));
    if outside.share > DOUBTFUL_SHARE || outside.worst.is_some() {
        let (place, percent) = (outside.worst.map(|worst| worst.name), 100.0 * outside.share);
        segmentation.warnings.push(SegmentWarning::BeyondTemplate { percent, place });
    }
    if let Some(place) = short.worst {
        let (place, percent) = (place.name, 100.0 * place.share);
        segmentation.warnings.push(SegmentWarning::ShortOfTemplate { place, percent });
    }
    let (found_cc, expected_cc) = (segmentation.volumes.brain_cc, expected.volume_cc());
    if !VOLUME_RATIO.contains(&(found_cc / expected_cc.max(1.0))) {
        return Err(HeadError::UnlikeTemplate { found_cc, expected_cc });
    }
    Ok((segmentation, carried.fit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;
    use crate::image::resample::{Interpolation, resample_through};
    use nalgebra::{Matrix3, Point3, Vector3};

    /// The mean head a tenth smaller, turned by half a radian and moved, under a coil that sees one side twice as bright.
    fn a_child_askew() -> (Volume<f32, Pre>, RigidTransform<Pre, Mni>) {
        a_child_turned_by(Vector3::new(0.35, -0.3, 0.2))
    }

    /// The same, turned by a rotation vector.
    fn a_child_turned_by(turn: Vector3<f64>) -> (Volume<f32, Pre>, RigidTransform<Pre, Mni>) {
        let mean = atlas::mean_head();
        let pose =
            RigidTransform::<Pre, Mni>::about(Point3::new(0.0, -20.0, 10.0), turn, Vector3::new(12.0, -20.0, 30.0));
        let grid = Grid::<Pre>::axis_aligned([70, 76, 70], [3.0; 3], [-115.0, -120.0, -130.0]);
        let middle = Point3::new(0.0, -20.0, 8.0);
        let larger = Matrix3::identity() / 0.9;
        let seen = resample_through(
            &mean.t1,
            &grid,
            |p| Some(Position::from_point(middle + larger * (pose.apply(p).mm - middle))),
            Interpolation::Linear,
            0.0,
        );
        let shaded = Volume::from_fn(grid, |n| {
            let p = grid.centre(grid.voxel(n)).mm;
            seen.volume.data[n] * (0.004 * p.x + 0.002 * p.z).exp() as f32
        });
        (shaded, pose)
    }

    #[test]
    fn slow_a_small_head_far_askew_under_a_surface_coil_is_found() {
        let (scan, truth) = a_child_askew();
        assert!(apart_mm(&pose_of_head(&scan).unwrap().fixed_from_moving, &truth) < 1.5);
    }

    /// How far two poses are apart where a head has its sides, front, back and top.
    fn apart_mm(found: &RigidTransform<Pre, Mni>, truth: &RigidTransform<Pre, Mni>) -> f64 {
        let corners =
            [[60.0, -20.0, 10.0], [-60.0, -20.0, 10.0], [0.0, 50.0, 20.0], [0.0, -90.0, 0.0], [0.0, -20.0, 70.0]];
        let apart = corners.map(|[x, y, z]| {
            let p = truth.inverse().apply(Position::new(x, y, z));
            found.apply(p).distance_mm(&truth.apply(p))
        });
        apart.into_iter().fold(0.0, f64::max)
    }

    #[test]
    fn slow_a_head_whose_header_has_lost_its_axes_is_found() {
        // A quarter turn about two axes, nodding a little.
        let (scan, truth) = a_child_turned_by(Vector3::new(1.4, -1.3, 1.2));
        let found = pose_of_head(&scan).unwrap();
        assert!(apart_mm(&found.fixed_from_moving, &truth) < 1.5 && found.warnings.is_empty(), "{:?}", found.warnings);
    }

    #[test]
    fn slow_a_head_upside_down_is_found_from_a_start_by_hand() {
        // Further than any start of the search lies.
        let (scan, truth) = a_child_turned_by(Vector3::new(0.0, 2.6, 0.3));
        let off = RigidTransform::<Mni, Mni>::about(
            Point3::new(0.0, -18.0, 8.0),
            Vector3::new(0.2, -0.15, 0.2),
            Vector3::new(8.0, -10.0, 9.0),
        );
        let start = truth.then(&off);
        assert!(apart_mm(&start, &truth) > 20.0);
        assert!(apart_mm(&pose_of_head_from(&scan, &start).unwrap().fixed_from_moving, &truth) < 1.5);
        // From nowhere near there is no head.
        let upright = RigidTransform::about(Point3::origin(), Vector3::zeros(), Vector3::zeros());
        assert!(matches!(pose_of_head_from(&scan, &upright), Err(RegisterError::NoHead { .. })));
    }

    #[test]
    fn slow_a_brain_given_by_hand_counts_wherever_it_lies() {
        let (scan, pose) = a_child_askew();
        // Far from any brain, within the scan.
        let hand = |p: Position<Mni>| (p.mm - Point3::new(0.0, -20.0, 10.0)).norm() < 60.0 || p.mm.x > 90.0;
        let given = Mask::from_fn(scan.grid, |n| hand(pose.apply(scan.grid.centre(scan.grid.voxel(n)))));
        let overrides = SegmentOverrides { brain: Some(&given), ventricle: None };
        let (deformable, settings) = (DeformableSettings::default(), SegmentSettings::default());
        let (found, _) = segment_head(&PosedScan::new(&scan, &pose), &overrides, &deformable, &settings).unwrap();
        let there = super::super::native::mask_on(&given, &found.brain_mni.grid, &pose.inverse());
        assert_eq!(found.brain_mni, there);
        let grid = found.brain_mni.grid;
        assert_eq!(found.brain_mni.bounding_box().unwrap().end[0], grid.dims[0], "the side of the template's grid");
    }

    #[test]
    fn an_image_without_a_head_is_refused_with_its_likeness() {
        let grid = Grid::<Pre>::axis_aligned([48, 48, 48], [4.0; 3], [-94.0, -94.0, -94.0]);
        let stripes = Volume::from_fn(grid, |n| {
            let [i, j, k] = grid.voxel(n).map(|v| v as f64);
            (100.0 + 80.0 * (0.9 * i).sin() * (1.1 * j).cos() * (0.7 * k).sin()) as f32
        });
        let message = pose_of_head(&stripes).unwrap_err().to_string();
        assert!(message.contains("looks like a head") && message.contains("likeness"), "{message}");
    }
}
