//! Euclidean distance where it is at most a few voxels.
//!
//! As for the [whole distance](super::distance) the square is separable. A short reach is looked through voxel by voxel, whole
//! rows at a time, and rows without anything near are passed over (docs/evidence/choices.md has what that gains).

use super::distance::{row_distance, squared_distance_mm2};
use super::pieces::each_piece;
use super::volume::{Mask, Volume};
use crate::geometry::Frame;

/// Voxels of reach beyond which the whole distance is found instead: its work does not grow with the reach.
const MOST_VOXELS: usize = 16;

/// Squared distance in mm2 to the nearest voxel whose value is `seed`, where it is at most `limit`; elsewhere something
/// larger than `limit`.
pub(super) fn squared_distance_within_mm2<F: Frame>(mask: &Mask<F>, seed: bool, limit: f32) -> Volume<f32, F> {
    let [nx, ny, nz] = mask.grid.dims;
    let h = mask.grid.spacing_mm();
    let reach = h.map(|h| (f64::from(limit).sqrt() / h) as usize);
    if reach.iter().any(|&voxels| voxels > MOST_VOXELS) || mask.data.is_empty() {
        return squared_distance_mm2(mask, seed);
    }
    let squares = [1, 2].map(|axis| (0..=reach[axis]).map(|d| (d as f64 * h[axis]).powi(2) as f32).collect::<Vec<_>>());
    let mut along_plane = vec![f32::INFINITY; mask.data.len()];
    each_piece(&mut along_plane, nx * ny, &|first, plane| {
        let mut rows = vec![0f32; nx * ny];
        let inside = &mask.data[first..][..nx * ny];
        let mut near = vec![false; ny];
        for ((row, inside), near) in rows.chunks_exact_mut(nx).zip(inside.chunks_exact(nx)).zip(&mut near) {
            *near = inside.contains(&seed);
            if *near {
                row_distance(row, inside, seed, h[0]);
            }
        }
        for (j, out) in plane.chunks_exact_mut(nx).enumerate() {
            nearest_of(out, j, &squares[0], |j| near.get(j)?.then(|| &rows[j * nx..][..nx]));
        }
    });
    let mut data = vec![f32::INFINITY; mask.data.len()];
    each_piece(&mut data, nx * ny, &|first, plane| {
        let k = first / (nx * ny);
        for (j, out) in plane.chunks_exact_mut(nx).enumerate() {
            nearest_of(out, k, &squares[1], |k| (k < nz).then(|| &along_plane[(k * ny + j) * nx..][..nx]));
        }
    });
    Volume::from_data(mask.grid, data)
}

/// The least of the rows around row `at`, each with the square of its distance added.
fn nearest_of<'a>(out: &mut [f32], at: usize, squares: &[f32], row: impl Fn(usize) -> Option<&'a [f32]>) {
    for (d, &square) in squares.iter().enumerate() {
        let before = at.checked_sub(d);
        let after = (d > 0).then_some(at + d);
        for row in [before, after].into_iter().flatten().filter_map(&row) {
            for (least, &x) in out.iter_mut().zip(row) {
                let here = x + square;
                *least = if here < *least { here } else { *least };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn what_is_near_is_as_far_as_by_the_whole_distance(
            data in proptest::collection::vec(prop::bool::weighted(0.04), 7 * 6 * 9),
            spacing in [0.5f64..3.0, 0.5..3.0, 0.5..3.0],
            reach_mm in 0.0f32..9.0,
            seed in proptest::bool::ANY,
        ) {
            let mask = Mask::from_data(Grid::<Pre>::axis_aligned([7, 6, 9], spacing, [0.0; 3]), data);
            let limit = reach_mm * reach_mm;
            let whole = squared_distance_mm2(&mask, seed);
            let near = squared_distance_within_mm2(&mask, seed, limit);
            for (near, whole) in near.data.iter().zip(&whole.data) {
                if *whole <= limit {
                    prop_assert!((near - whole).abs() <= 1e-6 * whole, "{near} {whole}");
                } else {
                    prop_assert!(*near >= limit * (1.0 - 1e-6), "{near} {whole}");
                }
            }
        }
    }
}
