//! Vectors between the voxels of a grid.

use crate::geometry::{Frame, Position};
use crate::image::Volume;
use nalgebra::{Matrix3, Point3, Vector3};

/// The eight voxels around a place and how far it lies between them.
pub(super) struct Cell {
    first: usize,
    step: [usize; 3],
    part: [f64; 3],
}

impl Cell {
    /// `None` outside the centres of the outermost voxels.
    #[inline]
    pub fn at(dims: [usize; 3], v: &Point3<f64>) -> Option<Self> {
        let (mut base, mut part) = ([0usize; 3], [0.0; 3]);
        for a in 0..3 {
            let last = dims[a].checked_sub(1)? as f64;
            // Written so that NaN is outside.
            if !(v[a] >= -1e-6 && v[a] <= last + 1e-6) {
                return None;
            }
            let x = v[a].clamp(0.0, last);
            base[a] = (x as usize).min(dims[a].saturating_sub(2));
            part[a] = x - base[a] as f64;
        }
        let stride = [1, dims[0], dims[0] * dims[1]];
        let step = [0, 1, 2].map(|a| if dims[a] > 1 { stride[a] } else { 0 });
        Some(Self { first: base[0] + stride[1] * base[1] + stride[2] * base[2], step, part })
    }

    #[inline]
    fn corners(&self, data: &[[f32; 3]]) -> [Vector3<f64>; 8] {
        std::array::from_fn(|c| {
            let at = self.first + (c & 1) * self.step[0] + (c >> 1 & 1) * self.step[1] + (c >> 2 & 1) * self.step[2];
            let [x, y, z] = data[at];
            Vector3::new(f64::from(x), f64::from(y), f64::from(z))
        })
    }

    /// The eight values of another volume on the same grid with their linear weights.
    #[inline]
    pub fn weighed<T: Copy>(&self, data: &[T]) -> [(T, f64); 8] {
        std::array::from_fn(|c| {
            let up = [c & 1, c >> 1 & 1, c >> 2 & 1];
            let at = self.first + (0..3).map(|a| up[a] * self.step[a]).sum::<usize>();
            let weight = (0..3).map(|a| if up[a] == 1 { self.part[a] } else { 1.0 - self.part[a] }).product();
            (data[at], weight)
        })
    }

    /// The vector in between.
    #[inline]
    pub fn value(&self, data: &[[f32; 3]]) -> Vector3<f64> {
        let c = self.corners(data);
        let [x, y, z] = self.part;
        let line = |n: usize| c[n] * (1.0 - x) + c[n + 1] * x;
        let plane = |n: usize| line(n) * (1.0 - y) + line(n + 2) * y;
        plane(0) * (1.0 - z) + plane(4) * z
    }

    /// The same with its derivatives along the voxel axes, as columns.
    #[inline]
    pub fn value_and_gradient(&self, data: &[[f32; 3]]) -> (Vector3<f64>, Matrix3<f64>) {
        let c = self.corners(data);
        let [x, y, z] = self.part;
        let mix = |a: Vector3<f64>, b: Vector3<f64>, t: f64| a * (1.0 - t) + b * t;
        let lines = [0, 2, 4, 6].map(|n| mix(c[n], c[n + 1], x));
        let planes = [mix(lines[0], lines[1], y), mix(lines[2], lines[3], y)];
        let along_x = [0, 2, 4, 6].map(|n| c[n + 1] - c[n]);
        let dx = mix(mix(along_x[0], along_x[1], y), mix(along_x[2], along_x[3], y), z);
        let dy = mix(lines[1] - lines[0], lines[3] - lines[2], z);
        (mix(planes[0], planes[1], z), Matrix3::from_columns(&[dx, dy, planes[1] - planes[0]]))
    }
}

/// The vector of a field at a point, linear between the voxels' centres; `None` beyond the outermost ones.
pub fn at<F: Frame>(field: &Volume<[f32; 3], F>, p: Position<F>) -> Option<[f64; 3]> {
    let v = field.grid.voxel_at(p);
    Cell::at(field.grid.dims, &v).map(|cell| cell.value(&field.data).into())
}

/// Where a field carries a point, mm; `None` beyond the field.
pub fn carried<F: Frame>(field: &Volume<[f32; 3], F>, x_mm: [f64; 3]) -> Option<[f64; 3]> {
    let d = at(field, Position::new(x_mm[0], x_mm[1], x_mm[2]))?;
    Some([0, 1, 2].map(|a| x_mm[a] + d[a]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;

    #[test]
    fn a_linear_field_and_its_gradient_are_exact_between_voxels() {
        let grid = Grid::<Pre>::axis_aligned([4, 5, 3], [1.0; 3], [0.0; 3]);
        let linear = |v: [f64; 3]| [0.5 * v[0] - v[1], 0.25 * v[2], 2.0 + v[0]];
        let field = Volume::from_fn(grid, |n| linear(grid.voxel(n).map(|x| x as f64)).map(|x| x as f32));
        let p = Point3::new(1.3, 3.9, 0.4);
        let cell = Cell::at(grid.dims, &p).unwrap();
        let (value, gradient) = cell.value_and_gradient(&field.data);
        let expected = Vector3::from(linear([p.x, p.y, p.z]));
        assert!((value - expected).norm() < 1e-6 && (cell.value(&field.data) - expected).norm() < 1e-6);
        let slope = Matrix3::new(0.5, -1.0, 0.0, 0.0, 0.0, 0.25, 1.0, 0.0, 0.0);
        assert!((gradient - slope).norm() < 1e-6);
        assert!(Cell::at(grid.dims, &Point3::new(3.1, 0.0, 0.0)).is_none());
        assert!(at(&field, Position::new(f64::NAN, 0.0, 0.0)).is_none());
    }
}
