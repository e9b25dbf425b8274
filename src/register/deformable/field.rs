//! Displacement fields: a map of points, kept on a grid.

use super::velocity::{Cell, VectorField};
use crate::geometry::{Frame, Position};
use crate::image::resample::{Interpolation, Resampled, resample_through};
use crate::image::{Grid, Mask, Volume};
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// A smooth map of the points of a frame: an affine part that holds everywhere and a deformation kept on a grid (beyond
/// the grid's border the deformation of the border holds).
#[derive(Clone, Debug)]
pub struct DisplacementField<F: Frame> {
    grid: Grid<F>,
    /// Displacement of the deformation in voxels of the grid.
    components: [Vec<f32>; 3],
    /// The affine part before and after the deformation.
    before: Affine,
    after: Affine,
}

#[derive(Clone, Copy, Debug)]
struct Affine {
    linear: Matrix3<f64>,
    shift_mm: Vector3<f64>,
}

impl Affine {
    fn identity() -> Self {
        Self { linear: Matrix3::identity(), shift_mm: Vector3::zeros() }
    }
}

impl<F: Frame> DisplacementField<F> {
    /// First the flow, then the affine map.
    pub(super) fn after_flow(flow: &VectorField, linear: &Matrix3<f64>, shift_mm: &Vector3<f64>) -> Self {
        let after = Affine { linear: *linear, shift_mm: *shift_mm };
        Self { grid: flow.grid.relabelled(), components: flow.components.clone(), before: Affine::identity(), after }
    }

    /// First the inverse of the affine map (the identity when it has none), then the flow.
    pub(super) fn before_flow(flow: &VectorField, linear: &Matrix3<f64>, shift_mm: &Vector3<f64>) -> Self {
        let inverse = linear.try_inverse().unwrap_or_else(Matrix3::identity);
        let before = Affine { linear: inverse, shift_mm: -(inverse * shift_mm) };
        Self { grid: flow.grid.relabelled(), components: flow.components.clone(), before, after: Affine::identity() }
    }

    /// The grid the deformation is kept on.
    pub fn grid(&self) -> &Grid<F> {
        &self.grid
    }

    /// Where a point goes.
    pub fn apply(&self, p: Position<F>) -> Position<F> {
        let q = Position::<F>::from_point(Point3::from(self.before.linear * p.mm.coords + self.before.shift_mm));
        let v = self.grid.voxel_at(q);
        let cell = Cell::at(self.grid.dims, [v.x as f32, v.y as f32, v.z as f32]);
        let d = Vector3::from([0, 1, 2].map(|a| f64::from(cell.of(&self.components[a]))));
        let moved = self.grid.mm_from_voxel.transform_point(&(v + d)).coords;
        Position::from_point(Point3::from(self.after.linear * moved + self.after.shift_mm))
    }

    /// An image seen through the map on a grid: the value at `p` is the image's at `apply(p)`, linearly interpolated;
    /// `outside` where the image has none.
    #[must_use]
    pub fn warp(&self, image: &Volume<f32, F>, onto: &Grid<F>, outside: f32) -> Volume<f32, F> {
        let Resampled { volume, .. } =
            resample_through(image, onto, |p| Some(self.apply(p)), Interpolation::Linear, outside);
        volume
    }

    /// A mask seen through the map: inside where the linearly interpolated mask is at least one half.
    #[must_use]
    pub fn warp_mask(&self, mask: &Mask<F>, onto: &Grid<F>) -> Mask<F> {
        self.warp(&mask.map(f32::from), onto, 0.0).map(|x| x >= 0.5)
    }

    /// Labels seen through the map, nearest voxel.
    #[must_use]
    pub fn warp_labels(&self, labels: &Volume<u8, F>, onto: &Grid<F>) -> Volume<u8, F> {
        let mut data = vec![0u8; onto.len()];
        data.par_chunks_mut(1 << 14).enumerate().for_each(|(c, chunk)| {
            for (i, out) in chunk.iter_mut().enumerate() {
                let p = onto.position(Point3::from(onto.voxel((c << 14) + i).map(|x| x as f64)));
                *out = labels.nearest(self.apply(p)).unwrap_or(0);
            }
        });
        Volume::from_data(*onto, data)
    }

    /// Smallest and largest determinant of the map's gradient at the voxels of the mask (on the field's grid), by central
    /// differences.
    pub(super) fn jacobian_range<G: Frame>(&self, mask: &Mask<G>) -> (f64, f64) {
        let dims = self.grid.dims;
        let stride = [1, dims[0], dims[0] * dims[1]];
        let affine = self.before.linear.determinant() * self.after.linear.determinant();
        let determinant = |n: usize| {
            let x = self.grid.voxel(n);
            let mut gradient = Matrix3::<f64>::identity();
            for b in 0..3 {
                if x[b] == 0 || x[b] + 1 == dims[b] {
                    continue;
                }
                for a in 0..3 {
                    let c = &self.components[a];
                    gradient[(a, b)] += 0.5 * f64::from(c[n + stride[b]] - c[n - stride[b]]);
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
