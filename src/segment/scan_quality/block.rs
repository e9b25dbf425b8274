//! Blocks of voxels, about as long as wide whatever the voxels are.

use crate::geometry::Frame;
use crate::image::Grid;

/// Voxels to a block along each axis: blocks of about 4 mm.
pub(super) fn factors<F: Frame>(grid: &Grid<F>) -> [usize; 3] {
    const BLOCK_MM: f64 = 4.0;
    grid.spacing_mm().map(|mm| (BLOCK_MM / mm).round().max(1.0) as usize)
}

/// The place in memory of the block that holds a voxel.
pub(super) fn block_of<F: Frame>(blocks: &Grid<F>, factor: [usize; 3], [i, j, k]: [usize; 3]) -> usize {
    blocks.index(i / factor[0], j / factor[1], k / factor[2])
}
