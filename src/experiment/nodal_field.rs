//! A displacement of nodes as a field on a grid.

use crate::geometry::Frame;
use crate::image::gaussian::gaussian;
use crate::image::{Grid, Volume};
use nalgebra::{Matrix3, Point3, Vector3};

/// Widths of the Gaussians that continue the field, mm; each counts a thousand times less than the one before.
const WIDTHS_MM: [f64; 4] = [3.0, 6.0, 12.0, 24.0];
const TRUST_PER_WIDTH: f64 = 1e-3;

/// The nodes' displacement (mm) at the voxels of a grid: interpolated inside the tetrahedra, continued smoothly around
/// them by means that the narrowest Gaussian to reach tissue decides. `nodes_mm` may lie anywhere: the rest positions give
/// the field at rest, moved ones the field where the tissue has gone.
pub fn on_grid<F: Frame>(
    tets: &[[u32; 4]],
    nodes_mm: &[[f64; 3]],
    displacement_mm: &[[f64; 3]],
    grid: &Grid<F>,
) -> Volume<[f64; 3], F> {
    let inside = interpolated(tets, nodes_mm, displacement_mm, grid);
    let weight = Volume::from_data(*grid, inside.iter().map(|d| f32::from(d.is_some())).collect());
    let part = |a: usize| Volume::from_data(*grid, inside.iter().map(|d| d.map_or(0.0, |d| d[a] as f32)).collect());
    let parts = [part(0), part(1), part(2)];
    let mut sums = vec![([0f64; 3], 0f64); grid.len()];
    let mut trust = 1.0;
    for width_mm in WIDTHS_MM {
        let smooth = parts.each_ref().map(|part| gaussian(part, width_mm));
        let total = gaussian(&weight, width_mm);
        for (n, (sum, weights)) in sums.iter_mut().enumerate() {
            for a in 0..3 {
                sum[a] += trust * f64::from(smooth[a].data[n]);
            }
            *weights += trust * f64::from(total.data[n]);
        }
        trust *= TRUST_PER_WIDTH;
    }
    let value = |(inside, (sum, weights)): (&Option<Vector3<f64>>, &([f64; 3], f64))| {
        inside.map_or_else(|| sum.map(|s| s / weights.max(1e-30)), Into::into)
    };
    Volume::from_data(*grid, inside.iter().zip(&sums).map(value).collect())
}

/// The displacement at the voxels whose centre lies in a tetrahedron.
fn interpolated<F: Frame>(
    tets: &[[u32; 4]],
    nodes_mm: &[[f64; 3]],
    displacement_mm: &[[f64; 3]],
    grid: &Grid<F>,
) -> Vec<Option<Vector3<f64>>> {
    let voxel_from_mm = grid.voxel_from_mm();
    let mut inside = vec![None; grid.len()];
    for tet in tets {
        let x = tet.map(|n| Vector3::from(nodes_mm[n as usize]));
        let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
        // A flat tetrahedron holds no voxel.
        let Some(barycentric) = edges.try_inverse() else { continue };
        let v = x.map(|x| voxel_from_mm.transform_point(&Point3::from(x)));
        let range = [0, 1, 2].map(|a| {
            let low = v.iter().map(|p| p[a]).fold(f64::INFINITY, f64::min).ceil().max(0.0);
            let high = v.iter().map(|p| p[a]).fold(f64::NEG_INFINITY, f64::max).floor();
            low as usize..((high + 1.0).max(0.0) as usize).min(grid.dims[a])
        });
        for k in range[2].clone() {
            for j in range[1].clone() {
                for i in range[0].clone() {
                    let p = grid.position(Point3::new(i as f64, j as f64, k as f64)).mm;
                    let b = barycentric * (p.coords - x[0]);
                    let weight = [1.0 - b.sum(), b.x, b.y, b.z];
                    if weight.iter().all(|&w| w >= -1e-9) {
                        let parts = tet.iter().zip(weight);
                        let sum = parts.map(|(&n, w)| w * Vector3::from(displacement_mm[n as usize]));
                        inside[grid.index(i, j, k)] = Some(sum.fold(Vector3::zeros(), |a, b| a + b));
                    }
                }
            }
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;
    use crate::geometry::Mni;

    #[test]
    fn a_linear_field_is_exact_inside_and_goes_on_outside() {
        let mesh = block(3);
        let linear = |x: [f64; 3]| [0.1 * x[0] - 0.2 * x[2], 0.3, 0.05 * x[1]];
        let u: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| linear(*x)).collect();
        let grid = Grid::<Mni>::axis_aligned([60; 3], [2.0; 3], [-61.0; 3]);
        let field = on_grid(mesh.tets(), mesh.nodes_mm(), &u, &grid);
        let largest = u.iter().flatten().fold(0f64, |m, v| m.max(v.abs()));
        let mut within = 0;
        for (n, d) in field.data.iter().enumerate() {
            let p = grid.centre(grid.voxel(n)).mm;
            assert!(d.iter().all(|v| v.abs() <= largest + 1e-6), "no mean exceeds what it is a mean of: {d:?}");
            let bounds = mesh.nodes_mm().iter().fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), x| {
                ([0, 1, 2].map(|a| low[a].min(x[a])), [0, 1, 2].map(|a| high[a].max(x[a])))
            });
            if (0..3).all(|a| p[a] >= bounds.0[a] && p[a] <= bounds.1[a]) {
                within += 1;
                let expected = linear([p.x, p.y, p.z]);
                assert!((0..3).all(|a| (d[a] - expected[a]).abs() < 1e-9), "{d:?} {expected:?}");
            }
        }
        assert!(within > 100);
    }
}
