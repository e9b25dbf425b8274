//! What is to be taken out, by a mask on the labels of the pre-operative scan.

use crate::geometry::Frame;
use crate::image::components::{Connectivity, components};
use crate::image::{Grid, LabelMap, Mask};
use crate::segment::label;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A plan in numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Planned {
    /// Tissue that is to be taken, cc.
    pub resected_cc: f64,
    /// Tissue of the whole brain, cc.
    pub tissue_cc: f64,
    /// Part of the mask that lies outside the brain.
    pub outside: f64,
}

/// Why a plan cannot be followed.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum PlannedError {
    #[error("{plan}: the mask is empty; draw what is to be taken, or check which label means it")]
    Empty { plan: String },
    #[error(
        "{plan}: what it marks is too small ({mm3:.1} mm3): in the grid of the labels (1 mm) nothing is left of it; draw what is to be \
         taken whole"
    )]
    TooSmall { plan: String, mm3: f64 },
    #[error(
        "{plan}: {percent:.0} % of what is to be taken lies outside the brain of this scan; check that it was drawn on this scan, in \
         its grid and frame (mm, RAS+)"
    )]
    Outside { plan: String, percent: f64 },
    #[error(
        "{plan}: it touches no grey or white matter, only fluid ({cc:.2} cc): nothing would be taken; draw it on the tissue that is \
         to be taken"
    )]
    NoTissue { plan: String, cc: f64 },
    #[error(
        "{plan}: it would take {resected_cc:.0} of {tissue_cc:.0} cc of tissue, more than half of the brain; check that it marks what is \
         taken and not what stays"
    )]
    MoreThanHalf { plan: String, resected_cc: f64, tissue_cc: f64 },
    #[error(
        "{plan}: it would cut loose {apart_cc:.0} cc of tissue, which would hang on nothing; leave bridges of tissue, or take what is \
         behind the cuts as well"
    )]
    InTwo { plan: String, apart_cc: f64 },
}

/// More of a mask than this outside the brain: it belongs to another scan.
const MOST_OUTSIDE: f64 = 0.5;
/// Parts that come loose and are more than this together are a part of the brain; less is specks at the border, cc.
const LARGEST_SPECK_CC: f64 = 10.0;

/// Looks at a plan before anything is computed from it; `plan` is its name for messages, `drawn_mm3` its volume as it was drawn.
///
/// # Errors
/// [`PlannedError`] says what is wrong with it and what to do.
pub fn planned<F: Frame>(
    plan: &str,
    drawn_mm3: f64,
    mask: &Mask<F>,
    labels: &LabelMap<F>,
) -> Result<Planned, PlannedError> {
    let plan = || plan.to_owned();
    let voxel_cc = labels.grid.voxel_volume_mm3() / 1000.0;
    let both = || mask.data.iter().zip(&labels.data);
    let marked = mask.count();
    if marked == 0 {
        let (plan, mm3) = (plan(), drawn_mm3);
        return Err(if mm3 > 0.0 { PlannedError::TooSmall { plan, mm3 } } else { PlannedError::Empty { plan } });
    }
    let inside = both().filter(|(m, l)| **m && **l != label::BACKGROUND).count();
    let outside = 1.0 - inside as f64 / marked as f64;
    if outside > MOST_OUTSIDE {
        return Err(PlannedError::Outside { plan: plan(), percent: 100.0 * outside });
    }
    let resected_cc = tissue_cc(mask, labels);
    if resected_cc == 0.0 {
        return Err(PlannedError::NoTissue { plan: plan(), cc: marked as f64 * voxel_cc });
    }
    let tissue = labels.map(label::is_tissue);
    let found = Planned { resected_cc, tissue_cc: tissue.count() as f64 * voxel_cc, outside };
    if found.resected_cc > 0.5 * found.tissue_cc {
        let (resected_cc, tissue_cc) = (found.resected_cc, found.tissue_cc);
        return Err(PlannedError::MoreThanHalf { plan: plan(), resected_cc, tissue_cc });
    }
    let left = Mask::from_fn(labels.grid, |n| tissue.data[n] && !mask.data[n]);
    let apart_cc = (apart(&left) as f64 - apart(&tissue) as f64) * voxel_cc;
    if apart_cc > LARGEST_SPECK_CC {
        return Err(PlannedError::InTwo { plan: plan(), apart_cc });
    }
    Ok(found)
}

/// How much of a mask is tissue, cc: what an operation takes of the brain, without the fluid between it. Of a plan and of what a second
/// scan shows alike.
pub fn tissue_cc<F: Frame>(mask: &Mask<F>, labels: &LabelMap<F>) -> f64 {
    let taken = mask.data.iter().zip(&labels.data).filter(|(m, l)| **m && label::is_tissue(**l)).count();
    taken as f64 * labels.grid.voxel_volume_mm3() / 1000.0
}

/// Voxels that are not of the largest part: a mesh holds that one alone, however many pieces the others are.
fn apart<F: Frame>(mask: &Mask<F>) -> usize {
    let voxels = components(mask, Connectivity::Faces).voxels;
    voxels.iter().sum::<usize>() - voxels.iter().copied().max().unwrap_or(0)
}

/// The voxels of a grid whose centre lies in an ellipsoid along the axes of its frame, mm.
pub fn ellipsoid_mask<F: Frame>(grid: &Grid<F>, centre_mm: [f64; 3], half_axes_mm: [f64; 3]) -> Mask<F> {
    Mask::from_fn(*grid, |n| {
        let p = grid.centre(grid.voxel(n)).mm;
        (0..3).map(|a| ((p[a] - centre_mm[a]) / half_axes_mm[a]).powi(2)).sum::<f64>() <= 1.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;

    /// Two blocks of tissue with a bridge between them, fluid around.
    fn labels() -> LabelMap<Mni> {
        let grid = Grid::<Mni>::axis_aligned([60, 40, 40], [1.0; 3], [0.0; 3]);
        LabelMap::from_fn(grid, |n| {
            let [x, y, z] = grid.voxel(n);
            let within = |v: usize, low: usize, high: usize| (low..high).contains(&v);
            if within(x, 5, 55) && within(y, 5, 35) && within(z, 5, 35) {
                let bridge = within(y, 15, 25) && within(z, 15, 25);
                if within(x, 27, 33) && !bridge { label::CSF } else { label::WHITE_MATTER }
            } else {
                label::BACKGROUND
            }
        })
    }

    fn of(centre: [f64; 3], half_axes: [f64; 3]) -> Result<Planned, PlannedError> {
        let labels = labels();
        let volume_mm3 = 4.0 / 3.0 * std::f64::consts::PI * half_axes.iter().product::<f64>();
        planned("plan.nii", volume_mm3, &ellipsoid_mask(&labels.grid, centre, half_axes), &labels)
    }

    #[test]
    fn what_is_taken_is_the_tissue_of_a_mask_alone() {
        // Over the fluid between the blocks and out of the brain.
        let labels = labels();
        let [wide, exact] = [false, true].map(|exact| {
            let mask = ellipsoid_mask(&labels.grid, [29.5, 10.0, 10.0], [10.0; 3]);
            Mask::from_fn(labels.grid, |n| mask.data[n] && (!exact || label::is_tissue(labels.data[n])))
        });
        assert!(wide.volume_cc() > 1.5 * exact.volume_cc());
        assert!((tissue_cc(&wide, &labels) - exact.volume_cc()).abs() < 1e-9);
        assert!((planned("p", 1.0, &wide, &labels).unwrap().resected_cc - exact.volume_cc()).abs() < 1e-9);
    }

    #[test]
    fn parts_that_come_loose_count_together() {
        // A block with four arms of 8 cc each, and plans that cut the first ones off.
        let grid = Grid::<Mni>::axis_aligned([80, 80, 40], [1.0; 3], [0.0; 3]);
        let of = |arms: usize| {
            let at = |n: usize| [0, 1].map(|a| grid.voxel(n)[a] as i32 - 40);
            let within = |n: usize| {
                let [far, near] = [at(n)[0].abs().max(at(n)[1].abs()), at(n)[0].abs().min(at(n)[1].abs())];
                (far < 16 || far < 36 && near < 8) && (4..36).contains(&grid.voxel(n)[2])
            };
            let labels = LabelMap::from_fn(grid, |n| if within(n) { label::WHITE_MATTER } else { label::BACKGROUND });
            let cut = Mask::from_fn(grid, |n| {
                let [x, y] = at(n);
                let along = [x, -x, y, -y];
                within(n) && along[..arms].iter().any(|far| (16..19).contains(far))
            });
            planned("plan.nii", cut.count() as f64, &cut, &labels)
        };
        assert!(of(1).is_ok(), "{:?}", of(1));
        let said = of(4).unwrap_err().to_string();
        assert!(said.contains("cut loose 33 cc"), "{said}");
    }

    #[test]
    fn a_plan_is_taken_where_it_takes_a_piece_and_refused_where_it_cannot_be_followed() {
        let good = of([15.0, 20.0, 30.0], [8.0, 6.0, 8.0]).unwrap();
        assert!(good.resected_cc > 0.5 && good.outside < 0.5 && good.resected_cc < 0.05 * good.tissue_cc, "{good:?}");
        let said = |centre, half_axes| of(centre, half_axes).unwrap_err().to_string();
        let cases = [
            ([15.0, 20.0, 20.3], [0.5, 0.5, 0.2], "too small (0.2 mm3)"),
            ([15.0, 20.0, 20.3], [0.0; 3], "is empty"),
            ([15.0, 20.0, 39.0], [4.0; 3], "outside the brain"),
            ([29.5, 8.0, 8.0], [2.0; 3], "touches no grey or white matter"),
            ([20.0, 20.0, 20.0], [40.0, 30.0, 30.0], "more than half"),
            ([29.5, 19.5, 19.5], [4.0, 12.0, 12.0], "cut loose"),
        ];
        for (centre, half_axes, words) in cases {
            let said = said(centre, half_axes);
            assert!(said.contains(words) && said.starts_with("plan.nii: "), "{said}");
        }
    }
}
