//! Dilation, erosion, opening and closing of masks by a ball of a radius in mm.
//!
//! The ball is exact (thresholds of the Euclidean distance). Beyond the grid nothing is known: the border is not a
//! surface, so an erosion does not eat into a structure that the field of view cuts, and a closing never shrinks.

use super::near_distance::squared_distance_within_mm2;
use super::volume::Mask;
use crate::geometry::Frame;

/// Every voxel whose centre lies at most `radius_mm` from a centre inside. A radius of 0 changes nothing.
#[must_use]
pub fn dilate<F: Frame>(mask: &Mask<F>, radius_mm: f64) -> Mask<F> {
    let [dilated] = dilations(mask, [radius_mm]);
    dilated
}

/// [`dilate`] by several radii, for little more than by the largest.
#[must_use]
pub fn dilations<const N: usize, F: Frame>(mask: &Mask<F>, radii_mm: [f64; N]) -> [Mask<F>; N] {
    let Some(around) = mask.bounding_box() else { return radii_mm.map(|_| mask.clone()) };
    let largest_mm = radii_mm.into_iter().fold(0.0, f64::max);
    // Outside this box the mask and the results are empty.
    let around = around.grown(&mask.grid, largest_mm);
    let squared = squared_distance_within_mm2(&mask.cropped(&around), true, squared_limit(largest_mm));
    radii_mm.map(|radius_mm| {
        let limit = squared_limit(radius_mm);
        squared.map(|d2| d2 <= limit).within(&mask.grid, false)
    })
}

/// Every inside voxel whose centre lies more than `radius_mm` from all centres outside. A radius of 0 changes nothing.
#[must_use]
pub fn erode<F: Frame>(mask: &Mask<F>, radius_mm: f64) -> Mask<F> {
    let Some(around) = mask.bounding_box() else { return mask.clone() };
    // One voxel of margin shows the nearest outside voxels (unless the grid ends there, which is no surface).
    let smallest_mm = mask.grid.spacing_mm().iter().copied().fold(f64::INFINITY, f64::min);
    let around = around.grown(&mask.grid, 1e-3 * smallest_mm);
    let part = mask.cropped(&around);
    let limit = squared_limit(radius_mm);
    squared_distance_within_mm2(&part, false, limit).map(|d2| d2 > limit).within(&mask.grid, false)
}

/// Erosion, then dilation: removes what is thinner than twice the radius.
#[must_use]
pub fn open<F: Frame>(mask: &Mask<F>, radius_mm: f64) -> Mask<F> {
    dilate(&erode(mask, radius_mm), radius_mm)
}

/// Dilation, then erosion: closes gaps narrower than twice the radius.
#[must_use]
pub fn close<F: Frame>(mask: &Mask<F>, radius_mm: f64) -> Mask<F> {
    erode(&dilate(mask, radius_mm), radius_mm)
}

/// Square of the radius, a little larger so that a centre at exactly that distance counts in spite of rounding.
fn squared_limit(radius_mm: f64) -> f32 {
    let radius_mm = radius_mm.max(0.0);
    (radius_mm * radius_mm * (1.0 + 1e-6)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;
    use proptest::prelude::*;

    fn masks() -> impl Strategy<Value = Mask<Pre>> {
        proptest::collection::vec(prop::bool::weighted(0.3), 9 * 8 * 7)
            .prop_map(|data| Mask::from_data(Grid::axis_aligned([9, 8, 7], [1.0, 1.2, 2.0], [0.0; 3]), data))
    }

    fn within(a: &Mask<Pre>, b: &Mask<Pre>) -> bool {
        a.data.iter().zip(&b.data).all(|(&a, &b)| !a || b)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn opening_shrinks_closing_grows_and_both_are_idempotent(mask in masks(), radius in 0.0f64..2.6) {
            let (opened, closed) = (open(&mask, radius), close(&mask, radius));
            prop_assert!(within(&opened, &mask) && within(&mask, &closed));
            prop_assert_eq!(&open(&opened, radius), &opened);
            prop_assert_eq!(&close(&closed, radius), &closed);
        }

        #[test]
        fn erosion_is_dilation_of_the_outside(mask in masks(), radius in 0.0f64..2.6) {
            let outside = mask.map(|inside| !inside);
            prop_assert_eq!(erode(&mask, radius), dilate(&outside, radius).map(|inside| !inside));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn several_dilations_at_once_are_those_one_by_one(mask in masks(), radii in [0.0f64..4.0, 0.0f64..4.0]) {
            prop_assert_eq!(dilations(&mask, radii), radii.map(|radius| dilate(&mask, radius)));
        }
    }

    #[test]
    fn a_voxel_dilates_to_a_ball_in_mm_and_zero_radius_changes_nothing() {
        let grid = Grid::<Pre>::axis_aligned([21, 21, 21], [1.0, 1.0, 2.0], [0.0; 3]);
        let mut point = Mask::filled(grid, false);
        point.data[grid.index(10, 10, 10)] = true;
        let ball = dilate(&point, 4.0);
        let span = ball.bounding_box().unwrap();
        assert_eq!((span.first, span.end), ([6, 6, 8], [15, 15, 13]));
        assert_eq!(dilate(&point, 0.0), point);
        assert_eq!(erode(&ball, 0.0), ball);
        assert_eq!(erode(&ball, 4.0), point);
    }
}
