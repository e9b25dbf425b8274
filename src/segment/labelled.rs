//! A scan of any contrast taken apart by a label map that somebody else made.

use super::native::{labels_on, mask_on};
use super::{PosedScan, SegmentWarning, Segmentation, TissueVolumes, atlas};
use crate::anatomy::label;
use crate::geometry::{Frame, Mni, RigidTransform};
use crate::image::components::fill_holes;
use crate::image::morphology::close;
use crate::image::resample::resample_nearest;
use crate::image::{LabelMap, Mask, Volume};
use crate::register::deformable::{AtlasFit, DeformableError, DeformableSettings, fit_atlas};
use crate::register::{MeanHead, RegisterError, RigidFit, register_to_mean_head, subject_from_mean_head};
use serde::{Deserialize, Serialize};

/// Sulci narrower than twice this are part of the brain, as in a computed mask, mm.
const CLOSING_MM: f64 = 5.0;

/// How the intensities of a scan are read.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Fluid is brighter than tissue (T2): values are read as this less the value, so that fluid is dark.
    pub turned_at: Option<f32>,
}

impl Scale {
    /// A value so that fluid is dark.
    pub fn of(self, value: f32) -> f32 {
        self.turned_at.map_or(value, |top| (top - value).max(0.0))
    }
}

/// Labels, masks and intensities of a scan whose label map is given on any grid of the scan's frame; the intensities are
/// turned where fluid is bright.
pub fn segment_by_labels<F: Frame>(scan: &PosedScan<'_, F>, given: &LabelMap<F>) -> (Segmentation<F>, Scale) {
    let (raw, known) = (scan.on_template(), scan.known());
    let (grid, scan_from_mni) = (raw.grid, scan.mni_from_t1.inverse());
    let labels = if given.grid.coincides(&scan.t1.grid, 1e-3) {
        given.clone()
    } else {
        labels_on(given, &scan.t1.grid, &RigidTransform::identity())
    };
    let drawn = labels_on(given, &grid, &scan_from_mni);
    let brain = whole_brain(&drawn);
    // Sulci that the map leaves to the background are fluid within the brain; fluid outside it is none of the brain's.
    let labels_mni = Volume::from_fn(grid, |n| match (brain.data[n], drawn.data[n]) {
        (true, label::BACKGROUND) => label::CSF,
        (true, own) => own,
        (false, _) => label::BACKGROUND,
    });

    let median = |of: &[u8]| {
        let mut values: Vec<f32> = (0..raw.data.len())
            .filter(|&n| known.data[n] && of.contains(&labels_mni.data[n]))
            .map(|n| raw.data[n])
            .collect();
        let middle = values.len() / 2;
        if values.is_empty() { None } else { Some(f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1)) }
    };
    // The middle of the ventricles is fluid alone; sulci are half tissue.
    let grey = median(&[label::GREY_MATTER]).unwrap_or(0.0);
    let white = median(&[label::WHITE_MATTER]).unwrap_or(0.0);
    let fluid = median(&[label::VENTRICLE]).or_else(|| median(&[label::CSF])).unwrap_or(0.0);
    let bright = fluid > grey.max(white);
    let scale = Scale { turned_at: bright.then_some((1.1 * fluid) as f32) };
    let [fluid, grey, white] = [fluid, grey, white].map(|x| f64::from(scale.of(x as f32)));

    let volume = |l: u8| labels_mni.map(|v| v == l).volume_cc();
    let segmentation = Segmentation {
        // As on the template's grid: tools differ in how much of the fluid they draw.
        brain: mask_on(&brain, &scan.t1.grid, &scan.mni_from_t1),
        labels,
        t1_mni: raw.map(|x| scale.of(x)),
        known_mni: known.clone(),
        tissue_means: [fluid, grey, white],
        // The nearer of the two tissues to fluid bounds what is fluid.
        csf_grey_border: 0.5 * (fluid + grey.min(white)),
        volumes: TissueVolumes {
            brain_cc: brain.volume_cc(),
            csf_cc: volume(label::CSF),
            grey_matter_cc: volume(label::GREY_MATTER),
            white_matter_cc: volume(label::WHITE_MATTER),
            ventricle_cc: volume(label::VENTRICLE),
        },
        brain_mni: brain,
        regions: Vec::new(),
        warnings: if labels_mni.data.contains(&label::VENTRICLE) {
            Vec::new()
        } else {
            vec![SegmentWarning::NoVentricle]
        },
        labels_mni,
    };
    (segmentation, scale)
}

/// Everything a map labels, with the sulci between its gyri.
fn whole_brain(labels: &LabelMap<Mni>) -> Mask<Mni> {
    let tissue = labels.map(|l| l != label::BACKGROUND && l != label::CSF);
    // Of the fluid a map draws, only what lies between gyri counts: some tools label all of it up to the skull.
    fill_holes(&close(&tissue, CLOSING_MM))
}

/// The pose of a scan in the template's frame, found from its label map alone: tissues drawn with the template's intensities
/// against the template's own, drawn alike in natural size.
///
/// # Errors
/// [`RegisterError`].
pub fn pose_of_labels<F: Frame>(labels: &LabelMap<F>) -> Result<RigidFit<F, Mni>, RegisterError> {
    let head = drawn_head();
    register_to_mean_head(&drawn(labels), &MeanHead { t1: &head, brain: &atlas::mean_head().brain, bare: &head })
}

/// The template fitted to a label map: its tissues drawn with the template's own intensities, so that the scan's contrast
/// does not matter.
///
/// # Errors
/// The fit's.
pub fn fit_template_to_labels(
    labels_mni: &LabelMap<Mni>,
    settings: &DeformableSettings,
) -> Result<AtlasFit<Mni>, DeformableError> {
    let (subject, head) = (drawn(labels_mni), drawn_head());
    let mean = MeanHead { t1: &head, brain: &atlas::mean_head().brain, bare: &head };
    let start = atlas::head_from_template().then(&subject_from_mean_head(&subject, &mean, None));
    fit_atlas(&subject, &atlas::template().t1_f32(), &start, None, settings)
}

/// The template's labels drawn in natural size on the mean head's grid.
fn drawn_head() -> Volume<f32, Mni> {
    let template_from_head = atlas::head_from_template().inverse().expect("a stretch can be inverted");
    let labels = resample_nearest(&atlas::template().labels, &atlas::mean_head().t1.grid, &template_from_head, 0);
    drawn(&labels)
}

/// Labels with the intensities that the template has in its own.
fn drawn<F: Frame>(labels: &LabelMap<F>) -> Volume<f32, F> {
    let template = atlas::template();
    let mean = |l: u8| {
        let values = template.labels.data.iter().zip(&template.t1.data).filter(|(own, _)| **own == l);
        let (sum, count) = values.fold((0.0, 0.0), |(s, c), (_, &t1)| (s + f64::from(t1), c + 1.0));
        (sum / f64::max(count, 1.0)) as f32
    };
    let means = [label::CSF, label::GREY_MATTER, label::WHITE_MATTER, label::VENTRICLE].map(mean);
    labels.map(|l| match l {
        label::BACKGROUND => 0.0,
        label::CSF => means[0],
        label::WHITE_MATTER | label::OEDEMA => means[2],
        label::VENTRICLE => means[3],
        _ => means[1],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Position, Pre};
    use crate::image::Grid;

    #[test]
    fn slow_a_turned_label_map_finds_its_own_pose() {
        let truth = RigidTransform::<Pre, Mni>::about(
            [0.0, -20.0, 10.0].into(),
            nalgebra::Vector3::new(0.25, -0.2, 0.15),
            nalgebra::Vector3::new(10.0, -15.0, 20.0),
        );
        let grid = Grid::<Pre>::axis_aligned([96, 112, 96], [2.0; 3], [-105.0, -120.0, -100.0]);
        let head_from_pre = truth.to_affine();
        let template_from_head = atlas::head_from_template().inverse().unwrap();
        let turned = resample_nearest(&atlas::template().labels, &grid, &head_from_pre.then(&template_from_head), 0);
        let found = pose_of_labels(&turned).unwrap().fixed_from_moving;
        for corner in [[60.0, -20.0, 10.0], [-60.0, -20.0, 10.0], [0.0, 50.0, 20.0], [0.0, -20.0, 70.0]] {
            let p = truth.inverse().apply(Position::new(corner[0], corner[1], corner[2]));
            let apart = found.apply(p).distance_mm(&truth.apply(p));
            assert!(apart < 1.0, "{apart} mm at {corner:?}");
        }
    }

    #[test]
    fn slow_the_template_by_its_own_labels_has_its_own_tissues_whatever_the_contrast() {
        let template = atlas::template();
        let t1: Volume<f32, Pre> = template.t1_f32().relabelled();
        let labels: LabelMap<Pre> = template.labels.clone().relabelled();
        let same = RigidTransform::identity();
        let t2 = t1.map(|x| if x > 0.0 { 260.0 - x } else { 0.0 });
        for (scan, turned) in [(&t1, false), (&t2, true)] {
            let (found, scale) = segment_by_labels(&PosedScan::new(scan, &same), &labels);
            assert_eq!(scale.turned_at.is_some(), turned);
            let [fluid, grey, white] = found.tissue_means;
            assert!(
                fluid < found.csf_grey_border && found.csf_grey_border < grey && grey < white,
                "{:?}",
                found.tissue_means
            );
            let ventricle = found.labels_mni.map(|l| l == label::VENTRICLE);
            assert!(ventricle.dice(&template.labels.map(|l| l == label::VENTRICLE)) > 0.99);
            assert_eq!(found.brain.clone().relabelled(), found.brain_mni);
        }
    }
}
