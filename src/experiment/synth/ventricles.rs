//! Wide ventricles: a smooth change of the head's anatomy, so that scans, labels and whatever is made of them follow.

use super::field::Field;
use super::frame::Patient;
use super::head::Head;
use crate::geometry::{Mni, Position};
use crate::image::distance::signed_distance_mm;
use crate::image::gaussian::gaussian;
use crate::image::{Grid, Volume};
use crate::segment::label;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// How far from the ventricles the brain makes room, mm.
const REACH_MM: f64 = 32.0;

/// The furthest that their wall may move, mm: less than half the reach, so that the brain beside them keeps more than half its width.
const FURTHEST_MM: f64 = 15.0;

/// In how many steps it moves. A step is shorter than the smoothing of the distance, so that none folds, and what does not fold
/// does not fold after another either: in a narrow horn the walls part from its middle, however far they go.
const STEPS: usize = 12;

/// Anatomy whose ventricles are about `factor` times as large as those of the head under `anatomy`.
pub fn widened(anatomy: &Field, head: &Head, factor: f64) -> Field {
    let wall = Wall::of(head);
    let wall_mm = wall.moved_for(head, factor);
    // Ventricles have horns of a few mm: finer than the anatomy's own lattice.
    let grid = Grid::<Patient>::axis_aligned([128, 144, 136], [2.0; 3], [-126.0, -160.0, -140.0]);
    Field::sampled(grid, |p| {
        let own = p + anatomy.at(p);
        own + wall.origin(own, wall_mm) - p
    })
}

/// The ventricles' wall in the head.
struct Wall {
    /// Signed distance from it, negative inside, smooth where the ventricle has its middle.
    distance_mm: Volume<f32, Mni>,
    /// 0 at the skull, 1 a centimetre below it.
    free: Volume<f32, Mni>,
}

impl Wall {
    fn of(head: &Head) -> Self {
        let ventricle = head.labels.map(|l| l == label::VENTRICLE);
        let free = head.skull_mm.map(|d| {
            let t = (-d / 10.0).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        });
        Self { distance_mm: gaussian(&signed_distance_mm(&ventricle), 1.5), free }
    }

    /// From a point of the head with wider ventricles to where it was, with the wall moved out by `wall_mm`.
    fn origin(&self, p: Point3<f64>, wall_mm: f64) -> Vector3<f64> {
        let step_mm = wall_mm / STEPS as f64;
        (0..STEPS).fold(p, |q, _| q - step_mm * self.outwards(q)) - p
    }

    /// The way out of the ventricles: of length 1 at their wall, less further off and in their middle, nothing at the skull.
    fn outwards(&self, p: Point3<f64>) -> Vector3<f64> {
        const STEP_MM: f64 = 1.0;
        let at = |p: Point3<f64>| self.distance_mm.trilinear(Position::from_point(p)).map(f64::from);
        let t = (1.0 - at(p).unwrap_or(REACH_MM).max(0.0) / REACH_MM).clamp(0.0, 1.0);
        let free = self.free.trilinear(Position::from_point(p)).map_or(0.0, f64::from);
        if t * free <= 0.0 {
            return Vector3::zeros();
        }
        let slope = [0, 1, 2].map(|a| {
            let step = Vector3::ith(a, STEP_MM);
            at(p + step).zip(at(p - step)).map_or(0.0, |(up, down)| (up - down) / (2.0 * STEP_MM))
        });
        free * t * t * (3.0 - 2.0 * t) * Vector3::from(slope)
    }

    /// How far the wall moves so that the ventricles become `factor` times as large; as far as it may where that is not enough.
    fn moved_for(&self, head: &Head, factor: f64) -> f64 {
        let grid = head.labels.grid;
        let near: Vec<Point3<f64>> = (0..grid.len())
            .into_par_iter()
            .filter(|&n| f64::from(self.distance_mm.data[n]) < FURTHEST_MM + 2.0)
            // Every other voxel along each axis says the volume well enough.
            .filter(|&n| grid.voxel(n).iter().all(|x| x % 2 == 0))
            .map(|n| grid.centre(grid.voxel(n)).mm)
            .collect();
        let inside = |wall_mm: f64| {
            let there = |p: Point3<f64>| Position::from_point(p + self.origin(p, wall_mm));
            near.par_iter().filter(|&&p| head.labels.nearest(there(p)) == Some(label::VENTRICLE)).count() as f64
        };
        let wanted = factor * inside(0.0);
        let (mut low, mut high) = (0.0, FURTHEST_MM);
        for _ in 0..12 {
            let middle = 0.5 * (low + high);
            if inside(middle) < wanted { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::synth::head::head_around;
    use crate::segment::atlas;

    #[test]
    fn slow_ventricles_are_wider_by_about_the_factor_and_the_brain_neither_folds_nor_moves_at_the_skull() {
        let head = head_around(atlas::template(), 1);
        let coarse = Grid::<Patient>::axis_aligned([64, 72, 68], [4.0; 3], [-126.0, -160.0, -140.0]);
        let own = Field::sampled(coarse, |_| Vector3::zeros());
        let brain = Grid::<Patient>::axis_aligned([93, 117, 96], [2.0; 3], [-92.0, -134.0, -88.0]);
        let count = |field: &Field| {
            let there = |n: usize| {
                let p = brain.centre(brain.voxel(n)).mm;
                head.labels.nearest(Position::from_point(p + field.at(p))) == Some(label::VENTRICLE)
            };
            (0..brain.len()).into_par_iter().filter(|&n| there(n)).count() as f64
        };
        let before = count(&own);
        for factor in [1.5, 2.5, 4.0] {
            let field = widened(&own, &head, factor);
            let found = count(&field) / before;
            assert!((found / factor - 1.0).abs() < 0.1, "{found} for {factor}");
            for n in (0..brain.len()).step_by(7) {
                let p = brain.centre(brain.voxel(n)).mm;
                let columns = [0, 1, 2].map(|a| {
                    let step = Vector3::ith(a, 1.0);
                    step + (field.at(p + step) - field.at(p - step)) / 2.0
                });
                let volume = nalgebra::Matrix3::from_columns(&columns).determinant();
                assert!(volume > 0.0, "{volume} at {p} for {factor}");
                let skull_mm = head.skull_mm.trilinear(Position::from_point(p)).unwrap_or(1.0);
                assert!(skull_mm < 0.0 || field.at(p).norm() < 0.3, "{} at {p}", field.at(p).norm());
            }
        }
    }
}
