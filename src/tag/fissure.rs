//! The fissure between the hemispheres, closed where the falx stands in it.
//!
//! Both hemispheres lie against the falx. Whether a segmentation closes the fissure between them or leaves it open hangs on a
//! millimetre of its outline; where it is open there is no sheet to hold them, and a body that has lost the front of its falx
//! in this way seems to be of twice the stiffness (docs/evidence/estimate.md).

use super::landmark::above_falx_edge;
use crate::geometry::{Frame, Position};
use crate::image::LabelMap;
use crate::segment::label;

/// A hemisphere this near to the midline lies against the falx, mm.
const BESIDE_FALX_MM: f64 = 8.0;
/// Step of the search for it, mm.
const STEP_MM: f64 = 1.0;

/// Labels for meshing of a straight midline, x = 0: background between two hemispheres that both lie against the falx becomes grey
/// matter, as in any narrower sulcus. `template` finds a point of the labels (mm) in the template.
pub fn with_closed_fissure<F: Frame>(
    straight: &LabelMap<F>,
    template: impl Fn([f64; 3]) -> [f64; 3] + Sync,
) -> LabelMap<F> {
    let nearest = |x: f64, y: f64, z: f64| straight.nearest(Position::new(x, y, z)).unwrap_or(label::BACKGROUND);
    // What is met first on the way to one side.
    let lies_against = |[x, y, z]: [f64; 3], side: f64| {
        let steps = (1..).map(|n| x + side * STEP_MM * f64::from(n)).take_while(|x| x.abs() <= BESIDE_FALX_MM);
        steps.map(|x| nearest(x, y, z)).find(|l| *l != label::BACKGROUND).is_some_and(label::is_tissue)
    };
    LabelMap::from_fn(straight.grid, |n| {
        let [x, y, z]: [f64; 3] = straight.grid.centre(straight.grid.voxel(n)).mm.into();
        let open = straight.data[n] == label::BACKGROUND && x.abs() <= BESIDE_FALX_MM;
        let closed = open
            && [-1.0, 1.0].into_iter().all(|side| lies_against([x, y, z], side))
            && above_falx_edge(template([0.0, y, z]));
        if closed { label::GREY_MATTER } else { straight.data[n] }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    /// Two hemispheres from y = 20 to 60 and z = 20 to 70, apart by so much on either side of x = 0.
    fn hemispheres(apart_mm: f64) -> LabelMap<Mni> {
        let grid = Grid::<Mni>::axis_aligned([61, 41, 61], [1.0; 3], [-30.0, 20.0, 20.0]);
        LabelMap::from_fn(grid, |n| {
            let [x, _, z]: [f64; 3] = grid.centre(grid.voxel(n)).mm.into();
            if x.abs() > apart_mm && z <= 70.0 { label::GREY_MATTER } else { label::BACKGROUND }
        })
    }

    #[test]
    fn hemispheres_against_the_falx_are_one_body_up_to_their_crests() {
        let closed = with_closed_fissure(&hemispheres(5.5), |p| p);
        let at = |x: f64, y: f64, z: f64| closed.nearest(Position::new(x, y, z)).unwrap();
        assert_eq!([at(0.0, 40.0, 68.0), at(-5.0, 40.0, 50.0), at(3.0, 30.0, 70.0)], [label::GREY_MATTER; 3]);
        assert_eq!(at(0.0, 40.0, 73.0), label::BACKGROUND);
    }

    #[test]
    fn what_lies_far_from_the_falx_or_below_it_stays_apart() {
        assert_eq!(with_closed_fissure(&hemispheres(9.5), |p| p), hemispheres(9.5));
        // The same lowered by 80 mm lies under the free edge.
        let below = with_closed_fissure(&hemispheres(5.5), |[x, y, z]| [x, y, z - 80.0]);
        assert_eq!(below, hemispheres(5.5));
    }

    #[test]
    fn a_cavity_at_the_midline_is_not_filled() {
        let mut operated = hemispheres(5.5);
        let grid = operated.grid;
        for n in 0..grid.len() {
            let [x, ..]: [f64; 3] = grid.centre(grid.voxel(n)).mm.into();
            if x > 5.5 && x < 15.0 && operated.data[n] == label::GREY_MATTER {
                operated.data[n] = label::RESECTED;
            }
        }
        assert_eq!(with_closed_fissure(&operated, |p| p), operated);
    }
}
