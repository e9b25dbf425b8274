//! Where the voxels of an image lie in space.

use crate::geometry::{Frame, Position};
use nalgebra::{Matrix3, Matrix4, Point3, RowVector4, Vector3};
use std::marker::PhantomData;

/// An oriented grid: `dims` voxels along i, j, k and the affine that takes a voxel index (centre of the voxel) to mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid<F: Frame> {
    /// Number of voxels along i (fastest in memory), j, k.
    pub dims: [usize; 3],
    /// Voxel index to mm, RAS+.
    pub mm_from_voxel: Matrix4<f64>,
    voxel_from_mm: Matrix4<f64>,
    frame: PhantomData<F>,
}

impl<F: Frame> Grid<F> {
    /// A grid; `None` when the affine cannot be inverted or holds a number that is not finite.
    pub fn new(dims: [usize; 3], mm_from_voxel: Matrix4<f64>) -> Option<Self> {
        let determinant = mm_from_voxel.fixed_view::<3, 3>(0, 0).determinant();
        if !mm_from_voxel.iter().all(|x| x.is_finite()) || determinant.abs() < 1e-12 {
            return None;
        }
        let mut voxel_from_mm = mm_from_voxel.try_inverse()?;
        // Of an affine: what rounding leaves there is none of it.
        voxel_from_mm.set_row(3, &RowVector4::new(0.0, 0.0, 0.0, 1.0));
        Some(Self { dims, mm_from_voxel, voxel_from_mm, frame: PhantomData })
    }

    /// An axis-aligned RAS+ grid whose first voxel centre lies at `origin_mm`; spacings must be positive.
    pub fn axis_aligned(dims: [usize; 3], spacing_mm: [f64; 3], origin_mm: [f64; 3]) -> Self {
        let mut m = Matrix4::from_diagonal(&Vector3::from(spacing_mm).push(1.0));
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::from(origin_mm));
        let mut inverse = Matrix4::from_diagonal(&Vector3::from(spacing_mm.map(|s| 1.0 / s)).push(1.0));
        for a in 0..3 {
            inverse[(a, 3)] = -origin_mm[a] / spacing_mm[a];
        }
        Self { dims, mm_from_voxel: m, voxel_from_mm: inverse, frame: PhantomData }
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.dims.iter().product()
    }

    /// Whether the grid has no voxels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Position of voxel (i, j, k) in memory: i runs fastest.
    #[inline]
    pub fn index(&self, i: usize, j: usize, k: usize) -> usize {
        i + self.dims[0] * (j + self.dims[1] * k)
    }

    /// Voxel (i, j, k) at a position in memory.
    #[inline]
    pub fn voxel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// mm to (fractional) voxel index.
    pub fn voxel_from_mm(&self) -> &Matrix4<f64> {
        &self.voxel_from_mm
    }

    /// Centre of a (fractional) voxel index.
    #[inline]
    pub fn position(&self, voxel: Point3<f64>) -> Position<F> {
        Position::from_point(through(&self.mm_from_voxel, &voxel))
    }

    /// Centre of voxel (i, j, k).
    #[inline]
    pub fn centre(&self, voxel: [usize; 3]) -> Position<F> {
        self.position(Point3::new(voxel[0] as f64, voxel[1] as f64, voxel[2] as f64))
    }

    /// Fractional voxel index of a point.
    #[inline]
    pub fn voxel_at(&self, p: Position<F>) -> Point3<f64> {
        through(&self.voxel_from_mm, &p.mm)
    }

    /// Distance between neighbouring voxel centres along i, j, k in mm.
    pub fn spacing_mm(&self) -> [f64; 3] {
        let m: Matrix3<f64> = self.mm_from_voxel.fixed_view::<3, 3>(0, 0).into_owned();
        [m.column(0).norm(), m.column(1).norm(), m.column(2).norm()]
    }

    /// Volume of one voxel in mm3.
    pub fn voxel_volume_mm3(&self) -> f64 {
        self.mm_from_voxel.fixed_view::<3, 3>(0, 0).determinant().abs()
    }

    /// The same numbers in another frame: for a caller that has learnt what a `Native` image is.
    pub fn relabelled<G: Frame>(&self) -> Grid<G> {
        Grid {
            dims: self.dims,
            mm_from_voxel: self.mm_from_voxel,
            voxel_from_mm: self.voxel_from_mm,
            frame: PhantomData,
        }
    }

    /// Whether both grids have the same voxels: none is further than `tolerance_mm` from where the other grid has it.
    pub fn coincides(&self, other: &Self, tolerance_mm: f64) -> bool {
        let apart = self.mm_from_voxel - other.mm_from_voxel;
        // What an affine map does to a box is largest at a corner.
        let corner = |n: usize| {
            let along = |axis: usize| if n >> axis & 1 == 0 { 0.0 } else { self.dims[axis].saturating_sub(1) as f64 };
            through(&apart, &Point3::new(along(0), along(1), along(2))).coords.norm()
        };
        self.dims == other.dims && (0..8).map(corner).all(|mm| mm <= tolerance_mm)
    }
}

/// A point through an affine, without the division that only a perspective needs: this is done for every voxel of every image.
#[inline]
fn through(m: &Matrix4<f64>, p: &Point3<f64>) -> Point3<f64> {
    let row = |r: usize| m[(r, 0)] * p.x + m[(r, 1)] * p.y + m[(r, 2)] * p.z + m[(r, 3)];
    Point3::new(row(0), row(1), row(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;

    #[test]
    fn grids_that_part_far_from_their_first_voxel_do_not_coincide() {
        let grid = Grid::<Pre>::axis_aligned([200, 200, 200], [1.0; 3], [-100.0; 3]);
        let turned = |angle: f64| {
            let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), angle).to_homogeneous();
            // About the first voxel.
            let shift = nalgebra::Translation3::new(-100.0, -100.0, -100.0).to_homogeneous();
            Grid::<Pre>::new(grid.dims, shift * turn * shift.try_inverse().unwrap() * grid.mm_from_voxel).unwrap()
        };
        assert!(grid.coincides(&turned(1e-4), 0.1) && !grid.coincides(&turned(0.002), 0.1));
    }

    #[test]
    fn voxel_and_position_invert_each_other() {
        let grid = Grid::<Pre>::axis_aligned([4, 5, 6], [1.0, 2.0, 3.0], [-10.0, 20.0, 5.0]);
        let p = grid.position(Point3::new(1.5, 2.0, 3.0));
        assert_eq!(p.mm, Point3::new(-8.5, 24.0, 14.0));
        assert!((grid.voxel_at(p) - Point3::new(1.5, 2.0, 3.0)).norm() < 1e-12);
        for index in 0..grid.len() {
            let [i, j, k] = grid.voxel(index);
            assert_eq!(grid.index(i, j, k), index);
        }
    }

    #[test]
    fn singular_or_nan_affine_is_refused() {
        assert!(Grid::<Pre>::new([1, 1, 1], Matrix4::zeros()).is_none());
        assert!(Grid::<Pre>::new([1, 1, 1], Matrix4::identity() * f64::NAN).is_none());
    }
}
