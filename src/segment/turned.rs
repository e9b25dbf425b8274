//! How far the fitted template says that a rigid pose is off.

use super::SegmentWarning;
use crate::geometry::{Mni, Position, nearest_rotation};
use crate::image::Mask;
use nalgebra::{Matrix3, Vector3};

/// One voxel in so many along each axis is enough for six unknowns.
const STRIDE: usize = 4;

/// A brain in the right pose is turned and moved by less than a third of this: fifteen heads by at most 1.7 degrees and 2.8 mm,
/// a small child and a large stroke among them (docs/evidence/choices.md).
const NOTED: Turned = Turned { deg: 5.0, shift_mm: 9.0 };

/// The rigid part of a map over a brain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turned {
    /// Angle, degrees.
    pub deg: f64,
    /// How far the middle of the brain is moved, mm.
    pub shift_mm: f64,
}

impl Turned {
    /// What is to be said of the pose.
    pub fn noted(self) -> Option<SegmentWarning> {
        let Self { deg, shift_mm } = self;
        (deg > NOTED.deg || shift_mm > NOTED.shift_mm).then_some(SegmentWarning::PoseOff { deg, shift_mm })
    }

    /// Of the map of a posed brain to the template: the rotation nearest to it (Kabsch 1976), and the way of the middle. A brain of
    /// any size and shape in the right pose is hardly turned.
    pub fn of(brain: &Mask<Mni>, template_from_patient: impl Fn(Position<Mni>) -> Position<Mni>) -> Self {
        let grid = brain.grid;
        let mut here: Vec<Vector3<f64>> = Vec::new();
        for k in (0..grid.dims[2]).step_by(STRIDE) {
            for j in (0..grid.dims[1]).step_by(STRIDE) {
                let row = (0..grid.dims[0]).step_by(STRIDE).filter(|&i| brain.data[grid.index(i, j, k)]);
                here.extend(row.map(|i| grid.centre([i, j, k]).mm.coords));
            }
        }
        let on_template = |p: &Vector3<f64>| template_from_patient(Position::from_point((*p).into())).mm.coords;
        let there: Vec<Vector3<f64>> = here.iter().map(on_template).collect();
        let middle = |points: &[Vector3<f64>]| points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        let (middle_here, middle_there) = (middle(&here), middle(&there));
        let arms = here.iter().zip(&there).map(|(p, q)| (q - middle_there) * (p - middle_here).transpose());
        let moment: Matrix3<f64> = arms.sum();
        let deg = nearest_rotation(&moment).angle().to_degrees();
        Self { deg, shift_mm: (middle_there - middle_here).norm() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::RigidTransform;
    use crate::image::Grid;
    use nalgebra::Point3;

    #[test]
    fn the_turn_of_a_map_is_read_whatever_it_stretches() {
        let grid = Grid::<Mni>::axis_aligned([40, 40, 40], [4.0; 3], [-80.0; 3]);
        let brain = Mask::from_fn(grid, |n| {
            grid.centre(grid.voxel(n)).mm.coords.component_div(&Vector3::new(60.0, 75.0, 55.0)).norm() < 1.0
        });
        let turn = RigidTransform::<Mni, Mni>::about(
            Point3::origin(),
            Vector3::new(0.2, 0.0, 0.0),
            Vector3::new(0.0, 6.0, 0.0),
        );
        let stretched =
            |p: Position<Mni>| Position::from_point(p.mm.coords.component_mul(&Vector3::new(0.9, 1.0, 1.1)).into());
        let none = Turned::of(&brain, stretched);
        assert!(none.deg < 1e-6 && none.shift_mm < 1.0, "{none:?}");
        let turned = Turned::of(&brain, |p| turn.apply(stretched(p)));
        assert!((turned.deg - 0.2f64.to_degrees()).abs() < 1e-6 && (turned.shift_mm - 6.0).abs() < 1.0, "{turned:?}");
    }

    #[test]
    fn a_pose_is_told_where_no_head_lies_so_and_denied_further_off() {
        let told = |deg, shift_mm| Turned { deg, shift_mm }.noted().map(|said| said.belies_the_masks());
        assert_eq!(told(1.7, 2.8), None);
        assert_eq!((told(6.0, 0.0), told(0.0, 10.0)), (Some(false), Some(false)));
        assert_eq!((told(12.0, 0.0), told(0.0, 20.0)), (Some(true), Some(true)));
    }
}
