//! Vector fields on a grid, and the deformation a stationary velocity field generates.
//!
//! phi = exp(v) is the flow of v at time one, found by scaling and squaring (Arsigny et al. 2006); exp(-v) is its inverse.

use crate::geometry::Native;
use crate::image::gaussian::gaussian;
use crate::image::{Grid, Volume};
use rayon::prelude::*;

/// Three components per voxel, in voxels of the grid.
#[derive(Clone, Debug)]
pub(super) struct VectorField {
    pub grid: Grid<Native>,
    pub components: [Vec<f32>; 3],
}

/// The displacement of a flow, in voxels of its grid: the three components side by side with a 0, so that each of the eight
/// corners around a point is one read.
pub(super) type Flow = Volume<[f32; 4], Native>;

/// Linear interpolation between the eight voxels around a point; beyond the border the border's value holds.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    corner: usize,
    step: [usize; 3],
    fraction: [f32; 3],
}

impl Cell {
    #[inline(always)]
    pub(super) fn at(dims: [usize; 3], p: [f32; 3]) -> Self {
        let stride = [1, dims[0], dims[0] * dims[1]];
        let (mut corner, mut step, mut fraction) = (0, [0; 3], [0f32; 3]);
        for a in 0..3 {
            let x = p[a].clamp(0.0, (dims[a] - 1) as f32);
            // By way of 32 bits: the cheaper cast (docs/evidence/choices.md).
            let base = (x as u32 as usize).min(dims[a].saturating_sub(2));
            corner += base * stride[a];
            step[a] = if dims[a] > 1 { stride[a] } else { 0 };
            fraction[a] = x - base as f32;
        }
        Self { corner, step, fraction }
    }

    #[inline(always)]
    pub(super) fn of(&self, data: &[f32]) -> f32 {
        let [sx, sy, sz] = self.step;
        let [fx, fy, fz] = self.fraction;
        let line = |o: usize| data[o] + fx * (data[o + sx] - data[o]);
        let plane = |o: usize| {
            let (a, b) = (line(o), line(o + sy));
            a + fy * (b - a)
        };
        let (a, b) = (plane(self.corner), plane(self.corner + sz));
        a + fz * (b - a)
    }
}

impl Cell {
    /// [`Self::of`] for components side by side.
    #[inline(always)]
    pub(super) fn of_all(&self, data: &[[f32; 4]]) -> [f32; 4] {
        let [sx, sy, sz] = self.step;
        let [fx, fy, fz] = self.fraction;
        let between =
            |a: [f32; 4], b: [f32; 4], f: f32| -> [f32; 4] { std::array::from_fn(|n| a[n] + f * (b[n] - a[n])) };
        let line = |o: usize| between(data[o], data[o + sx], fx);
        let plane = |o: usize| between(line(o), line(o + sy), fy);
        between(plane(self.corner), plane(self.corner + sz), fz)
    }
}

/// Far from everything that is known the map fades: where less than this of the surroundings is.
const LEAST_SHARE: f32 = 0.1;

impl VectorField {
    pub(super) fn zeros(grid: &Grid<Native>) -> Self {
        let component = || vec![0f32; grid.len()];
        Self { grid: *grid, components: [component(), component(), component()] }
    }

    /// Every component smoothed by a Gaussian of `sigma_mm`.
    pub(super) fn smoothed(self, sigma_mm: f64) -> Self {
        let grid = self.grid;
        let components = self.components.map(|c| gaussian(&Volume::from_data(grid, c), sigma_mm).data);
        Self { grid, components }
    }

    /// A field smoothed by `sigma_mm` over the share of its surroundings that was known (normalised convolution: Knutsson and
    /// Westin 1993): what was not known has not held it back.
    pub(super) fn over(mut self, weight: &[f32], sigma_mm: f64) -> Self {
        let share = gaussian(&Volume::from_data(self.grid, weight.to_vec()), sigma_mm);
        for c in &mut self.components {
            c.par_iter_mut().zip(&share.data).for_each(|(x, share)| *x /= share.max(LEAST_SHARE));
        }
        self
    }

    pub(super) fn scaled(mut self, factor: f32) -> Self {
        for c in &mut self.components {
            c.par_iter_mut().for_each(|x| *x *= factor);
        }
        self
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (a, b) in self.components.iter_mut().zip(&other.components) {
            a.par_iter_mut().zip(b).for_each(|(a, b)| *a += b);
        }
    }

    /// Longest vector, in voxels.
    pub(super) fn longest(&self) -> f32 {
        let [x, y, z] = &self.components;
        let squares = x.par_iter().zip(y).zip(z).map(|((x, y), z)| x * x + y * y + z * z);
        squares.reduce(|| 0.0, f32::max).sqrt()
    }

    /// Displacement of the flow of this velocity at time one; the first of its steps, a straight one, is at most
    /// `first_step` voxels long.
    pub(super) fn exponential(&self, first_step: f32) -> Flow {
        let halvings = (self.longest() / first_step).log2().ceil().clamp(0.0, 12.0) as i32;
        let scale = 0.5f32.powi(halvings);
        let [x, y, z] = &self.components;
        let mut flow = Flow::from_fn(self.grid, |n| [x[n] * scale, y[n] * scale, z[n] * scale, 0.0]);
        for _ in 0..halvings {
            flow = twice(&flow);
        }
        flow
    }

    /// The same field on another grid over the same place.
    pub(super) fn on(&self, grid: &Grid<Native>) -> Self {
        let to_here = self.grid.voxel_from_mm() * grid.mm_from_voxel;
        let ratio: [f32; 3] = std::array::from_fn(|a| (self.grid.spacing_mm()[a] / grid.spacing_mm()[a]) as f32);
        let mut out = Self::zeros(grid);
        let at = |n: usize| {
            let p = to_here.transform_point(&nalgebra::Point3::from(grid.voxel(n).map(|x| x as f64)));
            Cell::at(self.grid.dims, [p.x as f32, p.y as f32, p.z as f32])
        };
        for a in 0..3 {
            let source = &self.components[a];
            out.components[a].par_iter_mut().enumerate().for_each(|(n, x)| *x = ratio[a] * at(n).of(source));
        }
        out
    }
}

/// The displacement of a flow followed by itself.
fn twice(flow: &Flow) -> Flow {
    let dims = flow.grid.dims;
    Flow::from_voxels(flow.grid, |[i, j, k]| {
        let d = flow.at(i, j, k);
        let more = Cell::at(dims, [i as f32 + d[0], j as f32 + d[1], k as f32 + d[2]]).of_all(&flow.data);
        std::array::from_fn(|a| d[a] + more[a])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x -> first(x) + outer(x + first(x))`: the displacement of first `first`, then `outer`.
    fn then(first: &Flow, outer: &Flow) -> Flow {
        Flow::from_voxels(first.grid, |x| {
            let d = first.at(x[0], x[1], x[2]);
            let cell = Cell::at(first.grid.dims, std::array::from_fn(|a| x[a] as f32 + d[a]));
            let more = cell.of_all(&outer.data);
            std::array::from_fn(|a| d[a] + more[a])
        })
    }

    /// A turn about the z axis that fades with the distance from the centre of the grid: 0.4 rad at the centre.
    fn angle(r2: f32) -> f32 {
        0.4 * (-r2 / 50.0).exp()
    }

    fn swirl() -> VectorField {
        let grid = Grid::<Native>::axis_aligned([32, 32, 32], [2.0; 3], [0.0; 3]);
        let mut field = VectorField::zeros(&grid);
        for n in 0..grid.len() {
            let [x, y, z] = grid.voxel(n).map(|i| i as f32 - 15.5);
            let w = angle(x * x + y * y + z * z);
            (field.components[0][n], field.components[1][n]) = (-w * y, w * x);
        }
        field
    }

    /// Linear interpolation errs by at most an eighth of the second differences, whose sum over the axes stays below 0.32
    /// voxels for this field; time is one.
    const INTERPOLATION_VOXELS: f32 = 0.04;

    #[test]
    fn the_flow_of_a_swirl_turns_every_point_about_the_axis() {
        let v = swirl();
        let flow = v.exponential(0.1);
        for n in (0..v.grid.len()).step_by(7) {
            let [x, y, z] = v.grid.voxel(n).map(|i| i as f32 - 15.5);
            // The distance from the axis never changes, so neither does the angular velocity.
            let (s, c) = angle(x * x + y * y + z * z).sin_cos();
            let [moved_x, moved_y, ..] = flow.data[n];
            let error = [c * x - s * y - x - moved_x, s * x + c * y - y - moved_y];
            assert!(error.iter().all(|e| e.abs() < INTERPOLATION_VOXELS), "{error:?} at {x} {y} {z}");
        }
    }

    #[test]
    fn the_flow_of_the_negative_velocity_is_the_inverse() {
        let v = swirl();
        let round = then(&v.exponential(0.1), &v.clone().scaled(-1.0).exponential(0.1));
        let longest = round.data.iter().map(|d| d.iter().map(|x| x * x).sum::<f32>().sqrt()).fold(0.0, f32::max);
        assert!(v.longest() > 1.0 && longest < 2.0 * INTERPOLATION_VOXELS, "{longest}");
    }
}
