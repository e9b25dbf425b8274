//! The body that is meshed: tissue with its sulci closed.

use super::label;
use crate::geometry::Frame;
use crate::image::components::{Connectivity, components, fill_holes};
use crate::image::morphology::{dilate, erode};
use crate::image::{LabelMap, Mask};

/// Sulci and fissures up to twice this width are closed in a brain that is one body, mm.
pub const SULCUS_MM: f64 = 4.0;
/// Fluid that brain encloses is a hole of the body where this much of it lies farther from tissue than a sulcus is closed, mm3:
/// an old stroke, a cyst. What closing leaves of a healthy brain's cisterns is less than a tenth of it.
const POCKET_MM3: f64 = 1000.0;

/// Labels for meshing: CSF in sulci and fissures narrower than `2 * closing_mm` becomes grey matter, CSF in wide
/// cisterns becomes background. A mesh whose every sulcus is open has neither a falx to hold nor a surface to load, and
/// its thin bridges carry loads that no brain carries; pia and arachnoid hold the banks of a sulcus together.
/// CSF that this encloses becomes grey matter where it is little, and a hole of the body where it is a pocket.
pub fn with_closed_sulci<F: Frame>(labels: &LabelMap<F>, closing_mm: f64) -> LabelMap<F> {
    closed_sulci(labels, closing_mm).0
}

/// [`with_closed_sulci`], and how much enclosed fluid is a hole of that body, mm3.
pub fn closed_sulci<F: Frame>(labels: &LabelMap<F>, closing_mm: f64) -> (LabelMap<F>, f64) {
    let Closing { near, closed, filled } = Closing::of(labels, closing_mm);
    let enclosed = Mask::from_fn(labels.grid, |n| filled.data[n] && !closed.data[n]);
    let pockets = components(&enclosed, Connectivity::Faces);
    let mut deep = vec![0usize; pockets.voxels.len() + 1];
    for (n, &pocket) in pockets.labels.data.iter().enumerate() {
        deep[pocket as usize] += usize::from(labels.data[n] == label::CSF && !near.data[n]);
    }
    let voxel_mm3 = labels.grid.voxel_volume_mm3();
    let open = |pocket: u32| pocket > 0 && deep[pocket as usize] as f64 * voxel_mm3 >= POCKET_MM3;
    let (mut out, mut holes) = (labels.clone(), 0usize);
    for (n, l) in out.data.iter_mut().enumerate().filter(|(_, l)| **l == label::CSF) {
        let hole = open(pockets.labels.data[n]);
        holes += usize::from(hole);
        *l = if filled.data[n] && !hole { label::GREY_MATTER } else { label::BACKGROUND };
    }
    (out, holes as f64 * voxel_mm3)
}

/// What the cortex encloses: tissue, closed sulci and every pocket of fluid within.
pub fn inside_of_cortex<F: Frame>(labels: &LabelMap<F>, closing_mm: f64) -> Mask<F> {
    let Closing { filled, .. } = Closing::of(labels, closing_mm);
    Mask::from_fn(labels.grid, |n| match labels.data[n] {
        label::BACKGROUND => false,
        label::CSF => filled.data[n],
        _ => true,
    })
}

/// A closing, step by step.
struct Closing<F: Frame> {
    /// What lies within the radius of tissue.
    near: Mask<F>,
    /// Tissue with its narrow gaps.
    closed: Mask<F>,
    /// The same with all that it encloses.
    filled: Mask<F>,
}

impl<F: Frame> Closing<F> {
    fn of(labels: &LabelMap<F>, closing_mm: f64) -> Self {
        let solid = labels.map(|l| l != label::BACKGROUND && l != label::CSF);
        let near = dilate(&solid, closing_mm);
        let closed = erode(&near, closing_mm);
        let filled = fill_holes(&closed);
        Self { near, closed, filled }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    #[test]
    fn a_narrow_sulcus_is_closed_and_a_wide_cistern_left_out() {
        let grid = Grid::<Mni>::axis_aligned([60, 12, 12], [1.0; 3], [0.0; 3]);
        // Tissue, 4 mm of CSF, tissue, 20 mm of CSF, tissue.
        let value = |i: usize| match i {
            10..14 | 26..46 => label::CSF,
            _ => label::WHITE_MATTER,
        };
        let labels = LabelMap::from_data(grid, (0..grid.len()).map(|n| value(grid.voxel(n)[0])).collect());
        let closed = with_closed_sulci(&labels, 3.0);
        assert_eq!(closed.at(12, 6, 6), label::GREY_MATTER);
        assert_eq!(closed.at(36, 6, 6), label::BACKGROUND);
        assert_eq!(closed.at(5, 6, 6), label::WHITE_MATTER);
    }

    /// A block of tissue with fluid in a ball of this radius in its middle, mm.
    fn enclosed(radius_mm: f64) -> (LabelMap<Mni>, [usize; 3]) {
        let grid = Grid::<Mni>::axis_aligned([60; 3], [1.0; 3], [0.0; 3]);
        let labels = LabelMap::from_fn(grid, |n| {
            let voxel = grid.voxel(n);
            let apart_mm = voxel.map(|v| v as f64 - 30.0).iter().map(|x| x * x).sum::<f64>().sqrt();
            match voxel.iter().all(|v| (4..56).contains(v)) {
                true if apart_mm <= radius_mm => label::CSF,
                true => label::WHITE_MATTER,
                false => label::BACKGROUND,
            }
        });
        (labels, [30; 3])
    }

    #[test]
    fn a_cyst_within_the_brain_is_a_hole_and_a_narrow_pocket_is_not() {
        // 20 cc.
        let (labels, [i, j, k]) = enclosed(16.84);
        let (closed, hole_mm3) = closed_sulci(&labels, SULCUS_MM);
        assert_eq!(closed.at(i, j, k), label::BACKGROUND);
        let fluid_mm3 = labels.data.iter().filter(|&&l| l == label::CSF).count() as f64;
        assert!((fluid_mm3 - 20e3).abs() < 500.0, "{fluid_mm3}");
        assert!(hole_mm3 > 0.9 * fluid_mm3 && hole_mm3 <= fluid_mm3, "{hole_mm3} of {fluid_mm3}");
        assert!(inside_of_cortex(&labels, SULCUS_MM).at(i, j, k), "the skull has no hole");
        // Narrow: closed by the ball. Little: enclosed fluid that no ball reaches, and yet no pocket.
        for radius_mm in [3.0, 7.0] {
            let (labels, [i, j, k]) = enclosed(radius_mm);
            let (closed, hole_mm3) = closed_sulci(&labels, SULCUS_MM);
            assert_eq!((closed.at(i, j, k), hole_mm3), (label::GREY_MATTER, 0.0), "{radius_mm}");
        }
    }
}
