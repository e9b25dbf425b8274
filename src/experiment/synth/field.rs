//! Smooth displacement fields on a coarse grid.

use super::frame::Patient;
use crate::geometry::{Mni, Position};
use crate::image::{Grid, Volume};
use crate::material::random::CounterRng;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// A displacement in mm, trilinear between the nodes of a grid and constant beyond it.
#[derive(Clone, Debug)]
pub struct Field {
    mm: Volume<[f64; 3], Patient>,
}

impl Field {
    /// The field with these displacements (mm) at the nodes of a grid.
    pub fn of(mm: Volume<[f64; 3], Patient>) -> Self {
        Self { mm }
    }

    /// The field of a function of position, sampled on `grid`.
    pub fn sampled(grid: Grid<Patient>, at: impl Fn(Point3<f64>) -> Vector3<f64> + Sync) -> Self {
        let value = |n: usize| at(grid.centre(grid.voxel(n)).mm).into();
        let data = (0..grid.len()).into_par_iter().map(value).collect();
        Self { mm: Volume::from_data(grid, data) }
    }

    /// The displacement at a point.
    pub fn at(&self, p: Point3<f64>) -> Vector3<f64> {
        let grid = &self.mm.grid;
        let v = grid.voxel_at(Position::from_point(p));
        let (mut base, mut w) = ([0; 3], [0.0; 3]);
        for a in 0..3 {
            let x = v[a].clamp(0.0, grid.dims[a] as f64 - 1.0);
            base[a] = (x as usize).min(grid.dims[a] - 2);
            w[a] = x - base[a] as f64;
        }
        let sides = w.map(|w| [1.0 - w, w]);
        let mut sum = Vector3::zeros();
        for corner in 0..8 {
            let [i, j, k] = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
            let weight = sides[0][i] * sides[1][j] * sides[2][k];
            sum += weight * Vector3::from(self.mm.at(base[0] + i, base[1] + j, base[2] + k));
        }
        sum
    }

    /// The point that `p -> p + self(p)` takes to `x`, by fixed-point iteration (the fields here stretch by far less
    /// than 1, so it contracts).
    pub fn origin_of(&self, x: Point3<f64>) -> Point3<f64> {
        let mut p = x - self.at(x);
        for _ in 0..30 {
            let next = x - self.at(p);
            let step = (next - p).norm();
            p = next;
            if step < 1e-6 {
                break;
            }
        }
        p
    }

    /// Largest length of the field at its nodes, in mm.
    pub fn largest_mm(&self) -> f64 {
        self.mm.data.iter().map(|&d| Vector3::from(d).norm()).fold(0.0, f64::max)
    }
}

/// A smooth random change of anatomy: uniform cubic B-splines (Rueckert et al., IEEE TMI 18(8), 1999) on a lattice of 34 mm
/// with random coefficients, and a random stretch of each axis. It maps a point of the patient to the template.
///
/// Coefficients below .48 of the lattice spacing cannot fold (Choi and Lee, Graphical Models 62(1), 2000).
pub fn random_anatomy(grid: Grid<Patient>, seed: u64, size_mm: f64) -> Field {
    const LATTICE_MM: f64 = 34.0;
    let rng = CounterRng::new(seed, 1);
    let stretch = [0, 1, 2].map(|a| 0.012 * size_mm * (2.0 * rng.uniform(a) - 1.0));
    // A uniform number in -1..1 has .58; the spline's average leaves about half of it on each axis.
    let amplitude_mm = (2.0 * size_mm).min(0.45 * LATTICE_MM);
    let coefficient = |i: i64, j: i64, k: i64, axis: u64| {
        let counter = [i, j, k].iter().fold(0u64, |c, &x| c << 16 | ((x + 512) as u64 & 0xffff));
        amplitude_mm * (2.0 * rng.uniform(1000 + 3 * counter + axis) - 1.0)
    };
    let weights = |t: f64| {
        let s = 1.0 - t;
        [s * s * s, 3.0 * t * t * t - 6.0 * t * t + 4.0, 3.0 * s * s * s - 6.0 * s * s + 4.0, t * t * t]
            .map(|w| w / 6.0)
    };
    Field::sampled(grid, |p| {
        let scaled = p.coords / LATTICE_MM;
        let base = scaled.map(f64::floor);
        let w = [0, 1, 2].map(|a| weights(scaled[a] - base[a]));
        let mut sum = Vector3::zeros();
        for (c, wk) in w[2].iter().enumerate() {
            for (b, wj) in w[1].iter().enumerate() {
                for (a, wi) in w[0].iter().enumerate() {
                    let at = [0, 1, 2].map(|d| base[d] as i64 + [a, b, c][d] as i64 - 1);
                    for axis in 0..3 {
                        sum[axis] += wi * wj * wk * coefficient(at[0], at[1], at[2], axis as u64);
                    }
                }
            }
        }
        sum + Vector3::new(stretch[0] * p.x, stretch[1] * p.y, stretch[2] * p.z)
    })
}

/// The point of the template that looks like point `p` of the patient.
pub fn in_template(anatomy: &Field, p: Point3<f64>) -> Position<Mni> {
    Position::from_point(p + anatomy.at(p))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid<Patient> {
        Grid::axis_aligned([30, 30, 30], [4.0; 3], [-60.0; 3])
    }

    #[test]
    fn origin_undoes_the_displacement() {
        let field = random_anatomy(grid(), 3, 3.0);
        for n in 0..50 {
            let rng = CounterRng::new(9, n);
            let p = Point3::new(rng.between(0, -45.0, 45.0), rng.between(1, -45.0, 45.0), rng.between(2, -45.0, 45.0));
            let x = p + field.at(p);
            assert!((field.origin_of(x) - p).norm() < 1e-4);
        }
    }

    #[test]
    fn anatomy_differs_by_seed_has_the_asked_size_and_does_not_fold() {
        let (a, b) = (random_anatomy(grid(), 1, 3.0), random_anatomy(grid(), 2, 3.0));
        let length = |f: &Field| {
            let n = f.mm.data.len() as f64;
            (f.mm.data.iter().map(|&d| Vector3::from(d).norm_squared()).sum::<f64>() / n).sqrt()
        };
        assert!((1.5..6.0).contains(&length(&a)) && (1.5..6.0).contains(&length(&b)), "{} {}", length(&a), length(&b));
        assert!((a.at(Point3::origin()) - b.at(Point3::origin())).norm() > 0.1);
        for n in 0..grid().len() {
            let p = grid().centre(grid().voxel(n)).mm;
            let h = 1.0;
            let jacobian = nalgebra::Matrix3::from_columns(&[0, 1, 2].map(|axis| {
                let step = Vector3::ith(axis, h);
                Vector3::ith(axis, 1.0) + (a.at(p + step) - a.at(p)) / h
            }));
            assert!(jacobian.determinant() > 0.2, "{}", jacobian.determinant());
        }
    }
}
