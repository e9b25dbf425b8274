//! A scalar, label or mask on a grid.

use super::grid::Grid;
use super::pieces::each_piece;
use crate::geometry::{Frame, Position};

/// Voxel values on a [`Grid`], i fastest in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume<T, F: Frame> {
    /// Where the voxels lie.
    pub grid: Grid<F>,
    /// One value per voxel, i fastest.
    pub data: Vec<T>,
}

/// One small integer per voxel; the meaning of the integers is `segment::label`'s.
pub type LabelMap<F> = Volume<u8, F>;
/// One truth value per voxel.
pub type Mask<F> = Volume<bool, F>;

/// Voxels per task.
const VOXELS_AT_ONCE: usize = 1 << 14;

impl<T: Copy, F: Frame> Volume<T, F> {
    /// A volume of one value.
    pub fn filled(grid: Grid<F>, value: T) -> Self {
        Self { grid, data: vec![value; grid.len()] }
    }

    /// A volume from values in memory order.
    ///
    /// # Panics
    /// When the number of values is not the number of voxels (a programming error; readers check before).
    pub fn from_data(grid: Grid<F>, data: Vec<T>) -> Self {
        assert_eq!(grid.len(), data.len(), "one value per voxel");
        Self { grid, data }
    }

    /// Value of voxel (i, j, k).
    #[inline]
    pub fn at(&self, i: usize, j: usize, k: usize) -> T {
        self.data[self.grid.index(i, j, k)]
    }

    /// Value of voxel (i, j, k), or `None` outside the grid.
    #[inline]
    pub fn get(&self, i: isize, j: isize, k: isize) -> Option<T> {
        let [nx, ny, nz] = self.grid.dims;
        let inside = i >= 0 && j >= 0 && k >= 0 && (i as usize) < nx && (j as usize) < ny && (k as usize) < nz;
        inside.then(|| self.at(i as usize, j as usize, k as usize))
    }

    /// Value of the voxel whose centre is nearest, or `None` outside the grid.
    pub fn nearest(&self, p: Position<F>) -> Option<T> {
        let v = self.grid.voxel_at(p);
        self.get(v.x.round() as isize, v.y.round() as isize, v.z.round() as isize)
    }

    /// Every value through a function.
    pub fn map<U: Copy + Default + Send>(&self, f: impl Fn(T) -> U + Sync) -> Volume<U, F>
    where
        T: Sync,
    {
        let mut data = vec![U::default(); self.data.len()];
        each_piece(&mut data, VOXELS_AT_ONCE, &|first, values| {
            values.iter_mut().zip(&self.data[first..]).for_each(|(value, x)| *value = f(*x));
        });
        Volume { grid: self.grid, data }
    }

    /// The value of a function of the position in memory at every voxel of a grid.
    pub fn from_fn(grid: Grid<F>, f: impl Fn(usize) -> T + Sync + Send) -> Self
    where
        T: Default + Send,
    {
        let mut data = vec![T::default(); grid.len()];
        each_piece(&mut data, VOXELS_AT_ONCE, &|first, values| {
            values.iter_mut().enumerate().for_each(|(n, value)| *value = f(first + n));
        });
        Self { grid, data }
    }

    /// The value of a function of the voxel (i, j, k) at every voxel of a grid.
    pub fn from_voxels(grid: Grid<F>, f: impl Fn([usize; 3]) -> T + Sync + Send) -> Self
    where
        T: Default + Send,
    {
        let [nx, ny, _] = grid.dims.map(|n| n.max(1));
        let mut data = vec![T::default(); grid.len()];
        // By rows: a voxel's place in memory need not be taken apart.
        each_piece(&mut data, nx, &|first, values| {
            let (j, k) = (first / nx % ny, first / nx / ny);
            values.iter_mut().enumerate().for_each(|(i, value)| *value = f([i, j, k]));
        });
        Self { grid, data }
    }

    /// The same voxels in another frame: for a caller that has learnt what a `Native` image is.
    pub fn relabelled<G: Frame>(self) -> Volume<T, G> {
        Volume { grid: self.grid.relabelled(), data: self.data }
    }
}

impl<F: Frame> Mask<F> {
    /// Number of voxels inside.
    pub fn count(&self) -> usize {
        self.data.iter().filter(|&&inside| inside).count()
    }

    /// Volume inside in cubic centimetres.
    pub fn volume_cc(&self) -> f64 {
        self.count() as f64 * self.grid.voxel_volume_mm3() / 1000.0
    }

    /// Overlap 2|A and B| / (|A| + |B|); 1 for two empty masks.
    pub fn dice(&self, other: &Self) -> f64 {
        let both = self.data.iter().zip(&other.data).filter(|(a, b)| **a && **b).count();
        let total = self.count() + other.count();
        if total == 0 { 1.0 } else { 2.0 * both as f64 / total as f64 }
    }
}

impl<F: Frame> Volume<f32, F> {
    /// Trilinear interpolation, or `None` outside the centres of the outermost voxels.
    pub fn trilinear(&self, p: Position<F>) -> Option<f32> {
        let v = self.grid.voxel_at(p);
        let c = [v.x, v.y, v.z];
        let (mut base, mut w) = ([0usize; 3], [0f32; 3]);
        for a in 0..3 {
            let last = self.grid.dims[a].checked_sub(1)? as f64;
            // Written so that NaN is outside.
            if !(c[a] >= -1e-6 && c[a] <= last + 1e-6) {
                return None;
            }
            let x = c[a].clamp(0.0, last);
            base[a] = (x.floor() as usize).min(self.grid.dims[a].saturating_sub(2));
            w[a] = (x - base[a] as f64) as f32;
        }
        let [nx, ny, _] = self.grid.dims;
        let step = [
            usize::from(nx > 1),
            if self.grid.dims[1] > 1 { nx } else { 0 },
            if self.grid.dims[2] > 1 { nx * ny } else { 0 },
        ];
        let o = self.grid.index(base[0], base[1], base[2]);
        let line = |o: usize| self.data[o] * (1.0 - w[0]) + self.data[o + step[0]] * w[0];
        let plane = |o: usize| line(o) * (1.0 - w[1]) + line(o + step[1]) * w[1];
        Some(plane(o) * (1.0 - w[2]) + plane(o + step[2]) * w[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use nalgebra::Point3;

    #[test]
    fn trilinear_reproduces_a_linear_field_and_stops_at_the_border() {
        let grid = Grid::<Pre>::axis_aligned([4, 3, 5], [1.0, 2.0, 0.5], [3.0, -1.0, 0.0]);
        let value = |p: Point3<f64>| (2.0 * p.x - p.y + 3.0 * p.z) as f32;
        let data = (0..grid.len()).map(|n| {
            let [i, j, k] = grid.voxel(n);
            value(grid.position(Point3::new(i as f64, j as f64, k as f64)).mm)
        });
        let volume = Volume::from_data(grid, data.collect());
        for v in [Point3::new(0.3, 1.7, 2.2), Point3::new(3.0, 2.0, 4.0), Point3::new(0.0, 0.0, 0.0)] {
            let p = grid.position(v);
            assert!((volume.trilinear(p).unwrap() - value(p.mm)).abs() < 1e-5);
        }
        assert!(volume.trilinear(grid.position(Point3::new(3.1, 0.0, 0.0))).is_none());
    }
}
