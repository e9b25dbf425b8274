//! What changes slowly, kept on a coarse grid: means over blocks of voxels, and the way back.

use super::grid::Grid;
use super::pieces::each_piece;
use super::volume::Volume;
use crate::geometry::Frame;
use nalgebra::{Matrix4, Vector3};

/// A voxel for each block of `factor` voxels along each axis.
///
/// # Panics
/// For a factor of 0.
#[must_use]
pub fn coarser<F: Frame>(grid: &Grid<F>, factor: usize) -> Grid<F> {
    coarser_along(grid, [factor; 3])
}

/// [`coarser`] with a factor for each of the axes i, j, k.
///
/// # Panics
/// For a factor of 0.
#[must_use]
pub fn coarser_along<F: Frame>(grid: &Grid<F>, factor: [usize; 3]) -> Grid<F> {
    let factors = Vector3::from(factor.map(|f| f as f64));
    let middle = factors.map(|f| (f - 1.0) / 2.0);
    let fine_from_coarse = Matrix4::new_translation(&middle) * Matrix4::new_nonuniform_scaling(&factors);
    let dims = [0, 1, 2].map(|a| grid.dims[a].div_ceil(factor[a]));
    Grid::new(dims, grid.mm_from_voxel * fine_from_coarse).expect("a scaled grid is a grid")
}

/// Means of a function of the voxel over blocks of `factor` voxels along each axis; where the grid ends within a block, what is
/// missing counts as 0.
#[must_use]
pub fn block_means<F: Frame>(
    grid: &Grid<F>,
    factor: usize,
    value: impl Fn(usize) -> f32 + Sync + Send,
) -> Volume<f32, F> {
    block_means_along(grid, [factor; 3], value)
}

/// [`block_means`] with a factor for each of the axes i, j, k.
#[must_use]
pub fn block_means_along<F: Frame>(
    grid: &Grid<F>,
    factor: [usize; 3],
    value: impl Fn(usize) -> f32 + Sync + Send,
) -> Volume<f32, F> {
    Volume::from_voxels(coarser_along(grid, factor), |block| {
        let first = [0, 1, 2].map(|a| block[a] * factor[a]);
        let end = [0, 1, 2].map(|a| (first[a] + factor[a]).min(grid.dims[a]));
        let mut sum = 0.0;
        for k in first[2]..end[2] {
            for j in first[1]..end[1] {
                sum += (first[0]..end[0]).map(|i| value(grid.index(i, j, k))).sum::<f32>();
            }
        }
        sum / factor.iter().product::<usize>() as f32
    })
}

/// A coarse volume read linearly on a finer grid whose axes are its own; beyond its outermost centres their values hold.
#[must_use]
pub fn on_finer_grid<F: Frame>(coarse: &Volume<f32, F>, grid: &Grid<F>) -> Volume<f32, F> {
    let to_coarse = coarse.grid.voxel_from_mm() * grid.mm_from_voxel;
    // Axis by axis: the coarse voxels on both sides, and the share of the upper one.
    let [along_x, along_y, along_z] = [0, 1, 2].map(|a| {
        let last = coarse.grid.dims[a] - 1;
        let place = |i: usize| {
            let x = (to_coarse[(a, a)] * i as f64 + to_coarse[(a, 3)]).clamp(0.0, last as f64);
            let low = x as usize;
            (low, (low + 1).min(last), (x - low as f64) as f32)
        };
        (0..grid.dims[a]).map(place).collect::<Vec<(usize, usize, f32)>>()
    });
    let (nx, ny) = (grid.dims[0], grid.dims[1]);
    let row_of = |j: usize, k: usize| &coarse.data[coarse.grid.index(0, j, k)..][..coarse.grid.dims[0]];
    let mix = |low: f32, high: f32, share: f32| low * (1.0 - share) + high * share;
    let mut out = Volume::filled(*grid, 0.0);
    each_piece(&mut out.data, nx, &|first, values| {
        let row = first / nx;
        let ((j0, j1, v), (k0, k1, w)) = (along_y[row % ny], along_z[row / ny]);
        let rows = [row_of(j0, k0), row_of(j1, k0), row_of(j0, k1), row_of(j1, k1)];
        let across = |i: usize| mix(mix(rows[0][i], rows[1][i], v), mix(rows[2][i], rows[3][i], v), w);
        let line: Vec<f32> = (0..rows[0].len()).map(across).collect();
        for (value, (i0, i1, u)) in values.iter_mut().zip(&along_x) {
            *value = mix(line[*i0], line[*i1], *u);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;

    #[test]
    fn what_changes_evenly_comes_back_from_its_blocks_oblique_or_not() {
        let oblique = Matrix4::new_rotation(Vector3::new(0.3, -0.2, 0.5))
            * Matrix4::new_nonuniform_scaling(&Vector3::new(1.0, 1.2, 2.0));
        let grid = Grid::<Pre>::new([48, 40, 24], oblique).unwrap();
        let value = |[i, j, k]: [usize; 3]| 10.0 + 0.2 * i as f32 - 0.1 * j as f32 + 0.3 * k as f32;
        let back = on_finer_grid(&block_means(&grid, 4, |n| value(grid.voxel(n))), &grid);
        for (n, x) in back.data.iter().enumerate() {
            let voxel = grid.voxel(n);
            if (0..3).all(|a| (2..grid.dims[a] - 2).contains(&voxel[a])) {
                assert!((x - value(voxel)).abs() < 1e-3, "{voxel:?} {x}");
            }
        }
    }
}
