//! The map back.

use super::vectors::Cell;
use crate::geometry::Frame;
use crate::image::Volume;
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// Newton steps before a voxel is given up.
const STEPS: usize = 40;
/// How near the point carried back must come to the one it started from, in voxels.
const NEAR: f64 = 1e-4;
/// The gradient is taken anew where a step leaves more than this part of what was missed.
const SLOW: f64 = 0.1;

/// The inverse on the same grid: `y + inverse(y) = x` where `x + field(x) = y`, by Newton's method on the field as it is
/// read, linear between voxels. Where no point of the grid is carried to a voxel, the field is continued with its value
/// at the grid's border.
pub fn inverse<F: Frame>(field: &Volume<[f32; 3], F>) -> Volume<[f32; 3], F> {
    let grid = field.grid;
    let dims = grid.dims;
    let voxel_from_mm: Matrix3<f64> = grid.voxel_from_mm().fixed_view::<3, 3>(0, 0).into_owned();
    let mm_from_voxel: Matrix3<f64> = grid.mm_from_voxel.fixed_view::<3, 3>(0, 0).into_owned();
    let last = dims.map(|n| n as f64 - 1.0);
    let within =
        |x: &Vector3<f64>| Vector3::new(x.x.clamp(0.0, last[0]), x.y.clamp(0.0, last[1]), x.z.clamp(0.0, last[2]));
    let cell = |x: &Vector3<f64>| Cell::at(dims, &Point3::from(within(x)));
    // Displacement in voxels, and what makes a miss a step by its gradient.
    let shift = |x: &Vector3<f64>| Some(voxel_from_mm * cell(x)?.value(&field.data));
    let newton = |x: &Vector3<f64>| {
        let (_, gradient) = cell(x)?.value_and_gradient(&field.data);
        (Matrix3::identity() + voxel_from_mm * gradient).try_inverse()
    };
    let mut back = Volume::filled(grid, [0f32; 3]);
    back.data.par_chunks_mut(dims[0].max(1)).enumerate().for_each(|(row, out)| {
        let (j, k) = (row % dims[1], row / dims[1]);
        // The voxel before is a good place to start from, and its gradient a good one to try first.
        let (mut start, mut slope) = (Vector3::zeros(), Matrix3::identity());
        for (i, out) in out.iter_mut().enumerate() {
            if field.data[row * dims[0] + i] == [0.0; 3] {
                // Nothing has moved there: it came from where it is.
                start = Vector3::zeros();
                continue;
            }
            let y = Vector3::new(i as f64, j as f64, k as f64);
            let mut x = y + start;
            let mut best = (f64::INFINITY, x, Vector3::zeros());
            let (mut damping, mut fresh) = (1.0, false);
            for _ in 0..STEPS {
                let Some(d) = shift(&x) else { break };
                let miss = x + d - y;
                let size = miss.norm();
                let (nearer, slow) = (size < best.0, size > SLOW * best.0);
                if nearer {
                    best = (size, x, miss);
                    damping = f64::min(1.0, 2.0 * damping);
                    if size < NEAR {
                        break;
                    }
                    fresh = false;
                }
                if slow && !fresh {
                    slope = newton(&best.1).unwrap_or_else(Matrix3::identity);
                    fresh = true;
                } else if !nearer {
                    // Past a kink of the field: half the way from the best place so far.
                    damping *= 0.5;
                }
                x = best.1 - damping * (slope * best.2);
            }
            start = best.1 - y;
            let d = mm_from_voxel * start;
            *out = [d.x as f32, d.y as f32, d.z as f32];
        }
    });
    back
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::field::vectors::carried;
    use crate::geometry::Pre;
    use crate::image::Grid;
    use nalgebra::{Matrix4, UnitQuaternion};

    #[test]
    fn forth_and_back_comes_home_on_an_oblique_left_handed_grid() {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.5)).to_homogeneous();
        let affine = Matrix4::new_translation(&Vector3::new(30.0, -40.0, 10.0))
            * turn
            * Matrix4::new_nonuniform_scaling(&Vector3::new(-2.0, 2.0, 3.0));
        let grid = Grid::<Pre>::new([40, 36, 24], affine).unwrap();
        let centre = grid.position(Point3::new(20.0, 18.0, 12.0)).mm;
        let bump = |p: Point3<f64>| (-(p - centre).norm_squared() / 400.0).exp();
        let field = Volume::from_fn(grid, |n| {
            let p = grid.centre(grid.voxel(n)).mm;
            [6.0, -4.0, 3.0].map(|x| (x * bump(p)) as f32)
        });
        let back = inverse(&field);
        let mut worst = 0.0f64;
        for n in 0..2000u64 {
            let rng = crate::material::random::CounterRng::new(5, n);
            let p = grid.position(Point3::new(
                rng.between(0, 6.0, 33.0),
                rng.between(1, 6.0, 29.0),
                rng.between(2, 5.0, 18.0),
            ));
            let there = carried(&field, p.mm.into()).unwrap();
            let home = carried(&back, there).unwrap();
            worst = worst.max((Vector3::from(home) - p.mm.coords).norm());
        }
        assert!(worst < 0.1, "{worst}");
    }
}
