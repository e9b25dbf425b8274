//! A scan of any contrast taken apart by a label map that somebody else made.

use super::native::labels_on;
use super::{Segmentation, TissueVolumes, atlas};
use crate::anatomy::label;
use crate::geometry::{AffineTransform, Frame, Mni, RigidTransform};
use crate::image::components::fill_holes;
use crate::image::morphology::close;
use crate::image::resample::{Interpolation, resample};
use crate::image::{LabelMap, Mask, Volume};
use crate::register::deformable::{AtlasFit, DeformableError, DeformableSettings, fit_atlas};
use nalgebra::{Matrix3, Vector3};

/// Sulci narrower than twice this are part of the brain, as in a computed mask, mm.
const CLOSING_MM: f64 = 5.0;

/// How the intensities of a scan are read.
#[derive(Clone, Copy, Debug, PartialEq)]
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
pub fn segment_by_labels<F: Frame>(
    scan: &Volume<f32, F>,
    mni_from_scan: &RigidTransform<F, Mni>,
    given: &LabelMap<F>,
) -> (Segmentation<F>, Scale) {
    let grid = atlas::template().grid();
    let scan_from_mni = mni_from_scan.inverse();
    let on_grid = resample(scan, &grid, &scan_from_mni.to_affine(), Interpolation::CubicBSpline, 0.0);
    let labels = if given.grid.coincides(&scan.grid, 1e-3) {
        given.clone()
    } else {
        labels_on(given, &scan.grid, &RigidTransform::identity())
    };
    let drawn = labels_on(given, &grid, &scan_from_mni);
    let brain = whole_brain(&drawn);
    // Sulci that the map leaves to the background are fluid within the brain; fluid outside it is none of the brain's.
    let labels_mni = Volume::from_fn(grid, |n| match (brain.data[n], drawn.data[n]) {
        (true, label::BACKGROUND) => label::CSF,
        (true, own) => own,
        (false, _) => label::BACKGROUND,
    });

    let raw = on_grid.volume.map(|x| x.max(0.0));
    let median = |of: &[u8]| {
        let mut values: Vec<f32> = (0..raw.data.len())
            .filter(|&n| on_grid.inside.data[n] && of.contains(&labels_mni.data[n]))
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
        brain: labels.map(|l| l > 0),
        labels,
        t1_mni: raw.map(|x| scale.of(x)),
        known_mni: on_grid.inside,
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
        labels_mni,
        warnings: Vec::new(),
    };
    (segmentation, scale)
}

/// Everything a map labels, with the sulci between its gyri.
fn whole_brain(labels: &LabelMap<Mni>) -> Mask<Mni> {
    let tissue = labels.map(|l| l != label::BACKGROUND && l != label::CSF);
    // Of the fluid a map draws, only what lies between gyri counts: some tools label all of it up to the skull.
    fill_holes(&close(&tissue, CLOSING_MM))
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
    let template = atlas::template();
    let mean = |l: u8| {
        let values = template.labels.data.iter().zip(&template.t1.data).filter(|(own, _)| **own == l);
        let (sum, count) = values.fold((0.0, 0.0), |(s, c), (_, &t1)| (s + f64::from(t1), c + 1.0));
        (sum / f64::max(count, 1.0)) as f32
    };
    let means = [label::CSF, label::GREY_MATTER, label::WHITE_MATTER, label::VENTRICLE].map(mean);
    let drawn = labels_mni.map(|l| match l {
        label::BACKGROUND => 0.0,
        label::CSF => means[0],
        label::WHITE_MATTER | label::OEDEMA => means[2],
        label::VENTRICLE => means[3],
        _ => means[1],
    });
    fit_atlas(&drawn, &template.t1_f32(), &extent_from(&template.brain(), &drawn.map(|x| x > 0.0)), None, settings)
}

/// Shift and stretch along the axes that bring the extent of one brain to that of another: a label map has no skull whose
/// size would say it, and needs none.
fn extent_from(template: &Mask<Mni>, subject: &Mask<Mni>) -> AffineTransform<Mni, Mni> {
    let moments = |mask: &Mask<Mni>| {
        let (mut count, mut sum, mut squares) = (0.0, Vector3::zeros(), Vector3::zeros());
        for n in (0..mask.data.len()).filter(|&n| mask.data[n]) {
            let p = mask.grid.position(mask.grid.voxel(n).map(|v| v as f64).into()).mm.coords;
            count += 1.0;
            sum += p;
            squares += p.component_mul(&p);
        }
        let mean: Vector3<f64> = sum / f64::max(count, 1.0);
        let variance: Vector3<f64> = squares / f64::max(count, 1.0) - mean.component_mul(&mean);
        (mean, variance.map(|v| v.max(1.0).sqrt()))
    };
    let ((from, wide_from), (to, wide_to)) = (moments(template), moments(subject));
    let stretch = wide_to.component_div(&wide_from);
    AffineTransform::from_parts(Matrix3::from_diagonal(&stretch), to - stretch.component_mul(&from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;

    #[test]
    fn slow_the_template_by_its_own_labels_has_its_own_tissues_whatever_the_contrast() {
        let template = atlas::template();
        let t1: Volume<f32, Pre> = template.t1_f32().relabelled();
        let labels: LabelMap<Pre> = template.labels.clone().relabelled();
        let same = RigidTransform::identity();
        let t2 = t1.map(|x| if x > 0.0 { 260.0 - x } else { 0.0 });
        for (scan, turned) in [(&t1, false), (&t2, true)] {
            let (found, scale) = segment_by_labels(scan, &same, &labels);
            assert_eq!(scale.turned_at.is_some(), turned);
            let [fluid, grey, white] = found.tissue_means;
            assert!(
                fluid < found.csf_grey_border && found.csf_grey_border < grey && grey < white,
                "{:?}",
                found.tissue_means
            );
            let ventricle = found.labels_mni.map(|l| l == label::VENTRICLE);
            assert!(ventricle.dice(&template.labels.map(|l| l == label::VENTRICLE)) > 0.99);
        }
    }
}
