//! Coarser copies of an image: Gaussian smoothing and subsampling in one step, each axis by its own whole factor.
//! Masks on their grids.

use crate::geometry::Native;
use crate::image::pieces::each_piece;
use crate::image::{Grid, Mask, Volume};
use nalgebra::{Matrix4, Point3};
use std::borrow::Cow;

/// The image with every axis reduced by the whole factor that brings its spacing nearest to `spacing_mm`; axes that
/// are already as coarse stay as they are.
pub(super) fn reduced_to(image: &Volume<f32, Native>, spacing_mm: f64) -> Volume<f32, Native> {
    let spacing = image.grid.spacing_mm();
    let mut out = Cow::Borrowed(image);
    for axis in 0..3 {
        let factor = (spacing_mm / spacing[axis]).round().max(1.0) as usize;
        // Keep a few slices, however thin the slab.
        let factor = factor.min((image.grid.dims[axis] / 4).max(1));
        if factor > 1 {
            out = Cow::Owned(reduced_along(&out, axis, factor));
        }
    }
    out.into_owned()
}

/// One axis reduced by `factor`: a Gaussian of sigma `factor / 2` voxels, read at the centres of groups of `factor`
/// voxels. The border voxels are repeated outwards.
fn reduced_along(image: &Volume<f32, Native>, axis: usize, factor: usize) -> Volume<f32, Native> {
    let n_in = image.grid.dims[axis];
    let n_out = n_in / factor;
    let centre = (factor as f64 - 1.0) / 2.0;
    let sigma = factor as f64 / 2.0;
    let reach = (3.0 * sigma).ceil() as isize;
    let first = centre.ceil() as isize - reach;
    let last = centre.floor() as isize + reach;
    let mut weights: Vec<f32> =
        (first..=last).map(|o| (-0.5 * ((o as f64 - centre) / sigma).powi(2)).exp() as f32).collect();
    let sum: f32 = weights.iter().sum();
    for w in &mut weights {
        *w /= sum;
    }
    let source =
        |o: usize, tap: usize| ((o * factor) as isize + first + tap as isize).clamp(0, n_in as isize - 1) as usize;

    let [nx, ny, _] = image.grid.dims;
    let mut dims = image.grid.dims;
    dims[axis] = n_out;
    let mut data = vec![0f32; dims.iter().product()];
    each_piece(&mut data, dims[0] * dims[1], &|first, slice| {
        let k = first / (dims[0] * dims[1]);
        let mut padded = Vec::new();
        for (j, row) in slice.chunks_mut(dims[0]).enumerate() {
            if axis == 0 {
                let line = &image.data[nx * (j + ny * k)..][..nx];
                padded.clear();
                padded.extend((0..(n_out - 1) * factor + weights.len()).map(|t| line[source(0, t)]));
            }
            for (tap, &w) in weights.iter().enumerate() {
                if axis == 0 {
                    for (out, x) in row.iter_mut().zip(padded[tap..].iter().step_by(factor)) {
                        *out += w * x;
                    }
                } else {
                    let (jj, kk) = if axis == 1 { (source(j, tap), k) } else { (j, source(k, tap)) };
                    let line = &image.data[nx * (jj + ny * kk)..][..nx];
                    for (out, x) in row.iter_mut().zip(line) {
                        *out += w * x;
                    }
                }
            }
        }
    });
    let mut fine_from_coarse = Matrix4::identity();
    fine_from_coarse[(axis, axis)] = factor as f64;
    fine_from_coarse[(axis, 3)] = centre;
    // The product of two invertible matrices is invertible; the identity is never taken.
    let grid = Grid::new(dims, image.grid.mm_from_voxel * fine_from_coarse)
        .unwrap_or_else(|| Grid::axis_aligned(dims, [1.0; 3], [0.0; 3]));
    Volume::from_data(grid, data)
}

/// A mask read at the voxels of an image (nearest voxel).
pub(super) fn on_grid_of(mask: &Mask<Native>, image: &Volume<f32, Native>) -> Mask<Native> {
    let to_mask = mask.grid.voxel_from_mm() * image.grid.mm_from_voxel;
    Volume::from_fn(image.grid, |n| {
        let p = to_mask.transform_point(&Point3::from(image.grid.voxel(n).map(|i| i as f64)));
        mask.get(p.x.round() as isize, p.y.round() as isize, p.z.round() as isize).unwrap_or(false)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_ramp_stays_at_its_place_when_reduced() {
        let grid = Grid::<Native>::axis_aligned([40, 36, 30], [1.0, 0.5, 1.5], [-7.0, 3.0, 11.0]);
        let data = (0..grid.len()).map(|n| {
            let [i, j, k] = grid.voxel(n);
            let p = grid.position(Point3::new(i as f64, j as f64, k as f64)).mm;
            (p.x - 2.0 * p.y + 0.5 * p.z) as f32
        });
        let coarse = reduced_to(&Volume::from_data(grid, data.collect()), 2.0);
        assert_eq!(coarse.grid.dims, [20, 9, 30]);
        let p = coarse.grid.position(Point3::new(9.0, 4.0, 12.0)).mm;
        assert!((coarse.at(9, 4, 12) - (p.x - 2.0 * p.y + 0.5 * p.z) as f32).abs() < 1e-4);
    }
}
