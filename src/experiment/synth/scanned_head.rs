//! A head of a real scan as the anatomy of a synthetic patient.

use super::head::{FLUID, GREY, Head, WHITE};
use super::settings::SynthError;
use crate::geometry::{AffineTransform, Frame, Mni, RigidTransform};
use crate::image::components::fill_holes;
use crate::image::distance::{distance_mm, signed_distance_mm};
use crate::image::gaussian::gaussian;
use crate::image::morphology::close;
use crate::image::resample::{Interpolation, resample, resample_nearest};
use crate::image::{Mask, Volume};
use crate::register::deformable::DisplacementField;
use crate::segment::{Segmentation, label};

/// Fluid between the brain's hull and the skull of a real head, mm.
const FLUID_LAYER_MM: f64 = 2.0;

impl Head {
    /// The head that a scan shows, in the template's frame and in the units of a built head: fluid, grey and white matter
    /// have their intensities, so that cavities and noise are in scale. `template_from_head` is the template's fit to it.
    ///
    /// # Errors
    /// [`SynthError::NotT1`] where fluid, grey and white matter do not grow brighter in this order.
    pub fn of_scan<F: Frame>(
        t1: &Volume<f32, F>,
        mni_from_t1: &RigidTransform<F, Mni>,
        segmented: &Segmentation<F>,
        template_from_head: DisplacementField<Mni>,
    ) -> Result<Self, SynthError> {
        let means = segmented.tissue_means;
        let [fluid, grey, white] = means;
        if !(0.0 < fluid && fluid < grey && grey < white) {
            return Err(SynthError::NotT1 { fluid, grey, white });
        }
        let grid = super::head::grid();
        let knots = [(0.0, 0.0), (fluid, f64::from(FLUID)), (grey, f64::from(GREY)), (white, f64::from(WHITE))];
        let in_units = |x: f32| {
            let x = f64::from(x.max(0.0));
            let upper = knots.iter().position(|k| x < k.0).unwrap_or(knots.len() - 1).max(1);
            let ((x0, y0), (x1, y1)) = (knots[upper - 1], knots[upper]);
            (y0 + (y1 - y0) * (x - x0) / (x1 - x0)) as f32
        };
        let seen = resample(t1, &grid, &mni_from_t1.inverse().to_affine(), Interpolation::Linear, 0.0);
        let labels = resample_nearest(&segmented.labels_mni, &grid, &AffineTransform::identity(), label::BACKGROUND);
        // The dura spans fissures; the skull follows it.
        let hull = fill_holes(&close(&labels.map(|l| l != label::BACKGROUND), 12.0));
        let from_hull = distance_mm(&hull);
        let intracranial = Mask::from_fn(grid, |n| f64::from(from_hull.data[n]) <= FLUID_LAYER_MM);
        Ok(Self {
            t1: seen.volume.map(in_units),
            labels,
            skull_mm: gaussian(&signed_distance_mm(&intracranial), 1.0),
            template_from_head: Some(template_from_head),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::{Grid, LabelMap};
    use crate::segment::{PosedScan, atlas, segment_by_labels};

    fn own_place() -> DisplacementField<Mni> {
        let grid = Grid::axis_aligned([2; 3], [200.0; 3], [-100.0; 3]);
        DisplacementField::from_displacement(&Volume::from_fn(grid, |_| [0.0; 3]))
    }

    #[test]
    fn slow_a_scan_keeps_its_labels_and_takes_the_units_of_a_built_head() {
        let template = atlas::template();
        let t1: Volume<f32, Pre> = template.t1_f32().map(|x| 7.0 * x).relabelled();
        let labels: LabelMap<Pre> = template.labels.clone().relabelled();
        let same = RigidTransform::identity();
        let (segmented, _) = segment_by_labels(&PosedScan::new(&t1, &same), &labels);
        let head = Head::of_scan(&t1, &same, &segmented, own_place()).unwrap();
        let mean = |l: u8| {
            let inside = (0..head.labels.data.len()).filter(|&n| head.labels.data[n] == l);
            let (sum, count) = inside.fold((0.0, 0.0), |(s, c), n| (s + f64::from(head.t1.data[n]), c + 1.0));
            sum / count
        };
        assert!((mean(label::WHITE_MATTER) - f64::from(WHITE)).abs() < 8.0, "{}", mean(label::WHITE_MATTER));
        assert!((mean(label::GREY_MATTER) - f64::from(GREY)).abs() < 12.0, "{}", mean(label::GREY_MATTER));
        let bright = t1.map(|x| if x > 0.0 { 2000.0 - x } else { 0.0 });
        let mut turned = segmented;
        turned.tissue_means.reverse();
        assert!(matches!(Head::of_scan(&bright, &same, &turned, own_place()), Err(SynthError::NotT1 { .. })));
    }
}
