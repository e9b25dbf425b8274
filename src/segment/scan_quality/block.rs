//! Blocks of voxels, about as long as wide whatever the voxels are.

use crate::geometry::Frame;
use crate::image::blocks::{block_means_along, coarser_along};
use crate::image::{Grid, Volume};

/// About how long a block is.
const BLOCK_MM: f64 = 4.0;

/// The blocks of a grid.
pub(super) struct Blocks<F: Frame> {
    grid: Grid<F>,
    /// Voxels to a block along each axis.
    factor: [usize; 3],
    /// Along each axis what a voxel's index adds to the place in memory of its block: a table is quicker than to divide.
    place: [Vec<usize>; 3],
}

impl<F: Frame> Blocks<F> {
    pub fn of(grid: &Grid<F>) -> Self {
        let factor = grid.spacing_mm().map(|mm| (BLOCK_MM / mm).round().max(1.0) as usize);
        let [nx, ny, _] = coarser_along(grid, factor).dims;
        let steps = [1, nx, nx * ny];
        let place = [0, 1, 2].map(|a| (0..grid.dims[a]).map(|v| v / factor[a] * steps[a]).collect());
        Self { grid: *grid, factor, place }
    }

    /// Means of a function of the voxel's place in memory.
    pub fn means(&self, value: impl Fn(usize) -> f32 + Sync + Send) -> Volume<f32, F> {
        block_means_along(&self.grid, self.factor, value)
    }

    /// The place in memory of the block that holds a voxel.
    #[inline]
    pub fn place(&self, [i, j, k]: [usize; 3]) -> usize {
        self.place[0][i] + self.place[1][j] + self.place[2][k]
    }
}
