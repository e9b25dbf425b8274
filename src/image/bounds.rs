//! Boxes of voxels, and cutting a volume down to one.

use super::grid::Grid;
use super::volume::{Mask, Volume};
use crate::geometry::Frame;
use nalgebra::Point3;
use rayon::prelude::*;

/// A box of voxels: `first` is inside, `end` is one past the last, along i, j, k.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoxelBox {
    /// First voxel along i, j, k.
    pub first: [usize; 3],
    /// One past the last voxel along i, j, k.
    pub end: [usize; 3],
}

impl VoxelBox {
    /// Number of voxels along i, j, k.
    pub fn dims(&self) -> [usize; 3] {
        [0, 1, 2].map(|a| self.end[a] - self.first[a])
    }

    /// The box grown by whole voxels that cover `margin_mm` on every side, cut at the border of `grid`.
    #[must_use]
    pub fn grown<F: Frame>(&self, grid: &Grid<F>, margin_mm: f64) -> Self {
        let spacing_mm = grid.spacing_mm();
        let step = |a: usize| (margin_mm / spacing_mm[a]).ceil().max(0.0) as usize;
        Self {
            first: [0, 1, 2].map(|a| self.first[a].saturating_sub(step(a))),
            end: [0, 1, 2].map(|a| (self.end[a] + step(a)).min(grid.dims[a])),
        }
    }
}

impl<F: Frame> Mask<F> {
    /// The smallest box that holds every voxel of the mask; `None` when the mask is empty.
    pub fn bounding_box(&self) -> Option<VoxelBox> {
        let [nx, ny, nz] = self.grid.dims;
        let nothing = || VoxelBox { first: [usize::MAX; 3], end: [0; 3] };
        let both = |a: VoxelBox, b: VoxelBox| VoxelBox {
            first: [0, 1, 2].map(|d| a.first[d].min(b.first[d])),
            end: [0, 1, 2].map(|d| a.end[d].max(b.end[d])),
        };
        let in_plane = |k: usize| {
            let rows = (0..ny).filter_map(|j| {
                let row = &self.data[self.grid.index(0, j, k)..][..nx];
                let first = row.iter().position(|&inside| inside)?;
                let last = row.iter().rposition(|&inside| inside).unwrap_or(first);
                Some(VoxelBox { first: [first, j, k], end: [last + 1, j + 1, k + 1] })
            });
            rows.fold(nothing(), both)
        };
        let found = (0..nz).into_par_iter().map(in_plane).reduce(nothing, both);
        (found.end[0] > 0).then_some(found)
    }
}

impl<F: Frame> Grid<F> {
    /// The part of the grid in a box; every voxel stays where it was in space.
    #[must_use]
    pub fn cropped(&self, to: &VoxelBox) -> Self {
        let origin = self.position(Point3::from(to.first.map(|v| v as f64)));
        let mut affine = self.mm_from_voxel;
        affine.fixed_view_mut::<3, 1>(0, 3).copy_from(&origin.mm.coords);
        // The linear part is the one this grid was built with, so it is invertible; keep self if it ever is not.
        Self::new(to.dims(), affine).unwrap_or(*self)
    }

    /// The box that [`Self::cropped`] has cut `part` out at.
    pub fn box_of(&self, part: &Self) -> VoxelBox {
        let corner = self.voxel_at(part.centre([0; 3]));
        let first = [0, 1, 2].map(|a| corner[a].round().max(0.0) as usize);
        VoxelBox { first, end: [0, 1, 2].map(|a| first[a] + part.dims[a]) }
    }
}

impl<T: Copy, F: Frame> Volume<T, F> {
    /// The part of the volume in a box.
    #[must_use]
    pub fn cropped(&self, to: &VoxelBox) -> Self {
        let grid = self.grid.cropped(to);
        let mut data = Vec::with_capacity(grid.len());
        for k in to.first[2]..to.end[2] {
            for j in to.first[1]..to.end[1] {
                data.extend_from_slice(&self.data[self.grid.index(to.first[0], j, k)..][..grid.dims[0]]);
            }
        }
        Self::from_data(grid, data)
    }

    /// The volume within a larger grid, which it was cut out of; `outside` everywhere else.
    #[must_use]
    pub fn within(&self, grid: &Grid<F>, outside: T) -> Self {
        let mut whole = Self::filled(*grid, outside);
        whole.paste(self, &grid.box_of(&self.grid));
        whole
    }

    /// Writes the voxels of `part`, which was cut out with [`Volume::cropped`] at the same box, back in place.
    pub fn paste(&mut self, part: &Self, at: &VoxelBox) {
        let n = part.grid.dims[0];
        for k in at.first[2]..at.end[2] {
            for j in at.first[1]..at.end[1] {
                let from = part.grid.index(0, j - at.first[1], k - at.first[2]);
                let to = self.grid.index(at.first[0], j, k);
                self.data[to..to + n].copy_from_slice(&part.data[from..from + n]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;

    #[test]
    fn cropping_keeps_positions_and_pasting_restores() {
        let grid = Grid::<Pre>::axis_aligned([7, 6, 5], [1.0, 2.0, 0.5], [-3.0, 4.0, 1.0]);
        let volume = Volume::from_data(grid, (0..grid.len()).map(|n| n as f32).collect());
        let mask = volume.map(|x| x == 45.0 || x == 130.0);
        let around = mask.bounding_box().unwrap();
        let (a, b) = (grid.voxel(45), grid.voxel(130));
        assert_eq!(around.first, [0, 1, 2].map(|d| a[d].min(b[d])));
        assert_eq!(around.end, [0, 1, 2].map(|d| a[d].max(b[d]) + 1));
        let part = volume.cropped(&around);
        let corner = part.grid.position(Point3::origin());
        assert_eq!(volume.nearest(corner), Some(part.at(0, 0, 0)));
        assert_eq!(grid.box_of(&part.grid), around);
        assert_eq!(part.within(&grid, -1.0).cropped(&around), part);
        assert_eq!(part.within(&grid, -1.0).data[0], -1.0);
        let mut copy = volume.map(|_| 0.0);
        copy.paste(&part, &around);
        assert_eq!(copy.at(b[0], b[1], b[2]), 130.0);
        assert_eq!(around.grown(&grid, 100.0), VoxelBox { first: [0; 3], end: [7, 6, 5] });
        assert!(mask.map(|_| false).bounding_box().is_none());
    }
}
