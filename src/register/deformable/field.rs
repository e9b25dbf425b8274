//! Displacement fields: a map of points, kept on a grid.

use super::velocity::{Cell, Flow};
use crate::geometry::{Frame, Position};
use crate::image::resample::resample_together;
use crate::image::{Grid, Mask, Volume};
use nalgebra::{Matrix3, Matrix4, Point3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A smooth map of the points of a frame: an affine part that holds everywhere and a deformation kept on a grid (beyond
/// the grid's border the deformation of the border holds).
#[derive(Clone, Debug)]
pub struct DisplacementField<F: Frame> {
    /// Displacement of the deformation in voxels of its grid, and a 0.
    deformation: Volume<[f32; 4], F>,
    /// To voxels of the grid, by way of the affine part before the deformation.
    to_voxel: Affine,
    /// From voxels of the grid to mm and through the affine part after the deformation.
    to_mm: Affine,
}

#[derive(Clone, Copy, Debug)]
struct Affine {
    linear: Matrix3<f64>,
    shift: Vector3<f64>,
}

/// What a field is beside the deformation at its voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldFrame {
    dims: [usize; 3],
    /// Three rows of an affine map each, as the ones below.
    mm_from_voxel: [[f64; 4]; 3],
    to_voxel: [[f64; 4]; 3],
    to_mm: [[f64; 4]; 3],
}

impl Affine {
    fn of(matrix: &Matrix4<f64>) -> Self {
        let (linear, shift) = (matrix.fixed_view::<3, 3>(0, 0).into(), matrix.fixed_view::<3, 1>(0, 3).into());
        Self { linear, shift }
    }

    fn rows(&self) -> [[f64; 4]; 3] {
        [0, 1, 2].map(|a| [0, 1, 2, 3].map(|b| if b < 3 { self.linear[(a, b)] } else { self.shift[a] }))
    }

    fn of_rows(rows: &[[f64; 4]; 3]) -> Self {
        let (linear, shift) = (Matrix3::from_fn(|a, b| rows[a][b]), Vector3::from_fn(|a, _| rows[a][3]));
        Self { linear, shift }
    }

    /// First `self`, then `other`.
    fn then(self, other: Self) -> Self {
        Self { linear: other.linear * self.linear, shift: other.linear * self.shift + other.shift }
    }

    #[inline]
    fn apply(&self, x: Vector3<f64>) -> Vector3<f64> {
        self.linear * x + self.shift
    }
}

fn with_a_zero([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}

impl<F: Frame> DisplacementField<F> {
    /// A deformation without an affine part.
    fn plain(deformation: Volume<[f32; 4], F>) -> Self {
        let grid = &deformation.grid;
        let (to_voxel, to_mm) = (Affine::of(grid.voxel_from_mm()), Affine::of(&grid.mm_from_voxel));
        Self { deformation, to_voxel, to_mm }
    }

    /// First the flow, then the affine map.
    pub(super) fn after_flow(flow: Flow, linear: &Matrix3<f64>, shift_mm: &Vector3<f64>) -> Self {
        let plain = Self::plain(flow.relabelled());
        Self { to_mm: plain.to_mm.then(Affine { linear: *linear, shift: *shift_mm }), ..plain }
    }

    /// First the inverse of the affine map (the identity when it has none), then the flow.
    pub(super) fn before_flow(flow: Flow, linear: &Matrix3<f64>, shift_mm: &Vector3<f64>) -> Self {
        let inverse = linear.try_inverse().unwrap_or_else(Matrix3::identity);
        let before = Affine { linear: inverse, shift: -(inverse * shift_mm) };
        let plain = Self::plain(flow.relabelled());
        Self { to_voxel: before.then(plain.to_voxel), ..plain }
    }

    /// The map that a displacement (mm) sampled on a grid stands for.
    pub fn from_displacement(displacement_mm: &Volume<[f32; 3], F>) -> Self {
        let grid = displacement_mm.grid;
        let voxels_from_mm = grid.voxel_from_mm().fixed_view::<3, 3>(0, 0).into_owned();
        Self::plain(displacement_mm.map(|d| {
            let voxels = voxels_from_mm * Vector3::from(d.map(f64::from));
            with_a_zero([voxels.x, voxels.y, voxels.z].map(|v| v as f32))
        }))
    }

    /// How far every point of the field's grid moves, mm: what [`Self::from_displacement`] takes. Rounded to a 64th
    /// of a mm, far below what a registration is worth, so that it packs well.
    pub fn displacement_mm(&self) -> Volume<[f32; 3], F> {
        let grid = *self.grid();
        Volume::from_voxels(grid, |voxel| {
            let p = grid.centre(voxel);
            let d = self.apply(p).mm - p.mm;
            [d.x, d.y, d.z].map(|x| ((x * 64.0).round() / 64.0) as f32)
        })
    }

    /// The field to the last digit: its frame, and the deformation in voxels.
    pub fn parts(&self) -> (FieldFrame, Volume<[f32; 3], F>) {
        let Self { deformation, to_voxel, to_mm } = self;
        let grid = deformation.grid;
        let mm_from_voxel = Affine::of(&grid.mm_from_voxel).rows();
        let (to_voxel, to_mm) = (to_voxel.rows(), to_mm.rows());
        let frame = FieldFrame { dims: grid.dims, mm_from_voxel, to_voxel, to_mm };
        (frame, deformation.map(|[x, y, z, _]| [x, y, z]))
    }

    /// The field that [`Self::parts`] has told; `None` where the two are not one field's.
    pub fn from_parts(frame: &FieldFrame, deformation: &[[f32; 3]]) -> Option<Self> {
        let of_grid = Affine::of_rows(&frame.mm_from_voxel);
        let mut mm_from_voxel = of_grid.linear.to_homogeneous();
        mm_from_voxel.fixed_view_mut::<3, 1>(0, 3).copy_from(&of_grid.shift);
        let grid = Grid::new(frame.dims, mm_from_voxel)?;
        (deformation.len() == grid.len()).then(|| Self {
            deformation: Volume::from_fn(grid, |n| with_a_zero(deformation[n])),
            to_voxel: Affine::of_rows(&frame.to_voxel),
            to_mm: Affine::of_rows(&frame.to_mm),
        })
    }

    /// The grid the deformation is kept on.
    pub fn grid(&self) -> &Grid<F> {
        &self.deformation.grid
    }

    /// Where a point goes.
    pub fn apply(&self, p: Position<F>) -> Position<F> {
        let v = self.to_voxel.apply(p.mm.coords);
        let cell = Cell::at(self.grid().dims, [v.x as f32, v.y as f32, v.z as f32]);
        let [x, y, z, _] = cell.of_all(&self.deformation.data).map(f64::from);
        Position::from_point(Point3::from(self.to_mm.apply(v + Vector3::new(x, y, z))))
    }

    /// Images seen through the map on a grid: the value at `p` is the image's at `apply(p)`, linearly interpolated; 0 where
    /// the images have none. A mask goes as 0 and 1, and is inside again from one half on.
    ///
    /// # Panics
    /// When the images lie on different grids.
    #[must_use]
    pub fn warp<const N: usize>(&self, images: [&Volume<f32, F>; N], onto: &Grid<F>) -> [Volume<f32, F>; N] {
        resample_together(images, onto, |p| self.apply(p), [0.0; N])
    }

    /// Smallest and largest determinant of the map's gradient at the voxels of the mask (on the field's grid), by central
    /// differences.
    pub(super) fn jacobian_range<G: Frame>(&self, mask: &Mask<G>) -> (f64, f64) {
        let (grid, values) = (self.grid(), &self.deformation.data);
        let dims = grid.dims;
        let stride = [1, dims[0], dims[0] * dims[1]];
        let affine = self.to_voxel.linear.determinant() * self.to_mm.linear.determinant();
        let determinant = |n: usize| {
            let x = grid.voxel(n);
            let mut gradient = Matrix3::<f64>::identity();
            for b in 0..3 {
                if x[b] == 0 || x[b] + 1 == dims[b] {
                    continue;
                }
                for a in 0..3 {
                    gradient[(a, b)] += 0.5 * f64::from(values[n + stride[b]][a] - values[n - stride[b]][a]);
                }
            }
            // Voxel and mm gradients are similar matrices: one determinant.
            affine * gradient.determinant()
        };
        (0..mask.data.len())
            .into_par_iter()
            .filter(|&n| mask.data[n])
            .map(|n| (determinant(n), determinant(n)))
            .reduce(|| (f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)))
    }
}
