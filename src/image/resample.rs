//! Values of a volume on another grid, seen through a transform.

use super::grid::Grid;
use super::pieces::{each_pair, each_piece};
use super::spline::{coefficients, value_at};
use super::volume::{Mask, Volume};
use crate::geometry::{AffineTransform, Frame, Position};
use nalgebra::{Matrix4, Point3};
use rayon::prelude::*;

/// How values between voxel centres are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the nearest centre.
    Nearest,
    /// Trilinear: no overshoot, some blur.
    Linear,
    /// Cubic B-spline through the values (mirrored border): sharp, may overshoot by a few percent at edges.
    CubicBSpline,
}

/// A resampled volume and where it holds real values.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampled<F: Frame> {
    /// The values; where `inside` is false, the caller's value for the outside.
    pub volume: Volume<f32, F>,
    /// Voxels that lie within the source's outermost voxel centres. Outside of it nothing is known.
    pub inside: Mask<F>,
}

/// Samples `source` at every voxel of `target`: the value at `p` is the source's value at `source_from_target(p)`.
///
/// Resampling onto the source's own grid through the identity changes nothing (bit for bit with [`Interpolation::Nearest`] and
/// [`Interpolation::Linear`]). The result does not depend on the number of threads.
#[must_use]
pub fn resample<S: Frame, T: Frame>(
    source: &Volume<f32, S>,
    target: &Grid<T>,
    source_from_target: &AffineTransform<T, S>,
    interpolation: Interpolation,
    outside: f32,
) -> Resampled<T> {
    let voxel_from_voxel = voxel_from_voxel(&source.grid, target, source_from_target);
    let at = |v: [usize; 3]| on_centre(affine_point(&voxel_from_voxel, v.map(|x| x as f64)));
    sampled(source, target, interpolation, outside, at)
}

/// [`resample`] through any map of points, for example a displacement field; `None` (or NaN) is outside.
#[must_use]
pub fn resample_through<S: Frame, T: Frame>(
    source: &Volume<f32, S>,
    target: &Grid<T>,
    source_from_target: impl Fn(Position<T>) -> Option<Position<S>> + Sync,
    interpolation: Interpolation,
    outside: f32,
) -> Resampled<T> {
    let nowhere = [f64::NAN; 3];
    let at = |v: [usize; 3]| {
        let p = affine_point(&target.mm_from_voxel, v.map(|x| x as f64));
        let p = source_from_target(Position::from_point(p.into()));
        p.map_or(nowhere, |p| on_centre(affine_point(source.grid.voxel_from_mm(), p.mm.into())))
    };
    sampled(source, target, interpolation, outside, at)
}

/// Several volumes on one grid, all through the same map, linearly: the map is asked once for each voxel, not once for
/// each volume. `outside` holds each volume's value where the map leaves the grid.
///
/// # Panics
/// When the volumes lie on different grids.
#[must_use]
pub fn resample_together<const N: usize, S: Frame, T: Frame>(
    sources: [&Volume<f32, S>; N],
    target: &Grid<T>,
    source_from_target: impl Fn(Position<T>) -> Position<S> + Sync,
    outside: [f32; N],
) -> [Volume<f32, T>; N] {
    let grid = sources[0].grid;
    assert!(sources.iter().all(|s| s.grid.coincides(&grid, 0.0)), "the volumes lie on one grid");
    filled_together(&grid, target, source_from_target, outside, |cell| sources.map(|source| cell.of(&source.data)))
}

/// Several volumes of what `values` makes of the cell around each voxel's place in a grid.
fn filled_together<const N: usize, S: Frame, T: Frame>(
    grid: &Grid<S>,
    target: &Grid<T>,
    source_from_target: impl Fn(Position<T>) -> Position<S> + Sync,
    outside: [f32; N],
    values: impl Fn(&Cell) -> [f32; N] + Sync,
) -> [Volume<f32, T>; N] {
    let last = grid.dims.map(|n| n as f64 - 1.0);
    let [nx, ny, nz] = target.dims;
    let mut out = outside.map(|value| Volume::filled(*target, value));
    let mut rest = out.each_mut().map(|volume| volume.data.chunks_mut((nx * ny).max(1)));
    let planes: Vec<[&mut [f32]; N]> =
        (0..nz).map(|_| rest.each_mut().map(|planes| planes.next().unwrap_or_default())).collect();
    planes.into_par_iter().enumerate().for_each(|(k, mut planes)| {
        for n in 0..nx * ny {
            let p = affine_point(&target.mm_from_voxel, [n % nx, n / nx, k].map(|x| x as f64));
            let p = source_from_target(Position::from_point(p.into()));
            let v = affine_point(grid.voxel_from_mm(), p.mm.into());
            if (0..3).all(|a| v[a] >= 0.0 && v[a] <= last[a]) {
                let found = values(&Cell::at(grid, v));
                planes.iter_mut().zip(found).for_each(|(plane, value)| plane[n] = value);
            }
        }
    });
    out
}

/// [`resample_together`] of values that lie side by side: each corner around a point is one read for all of them.
#[must_use]
pub fn resample_each<const N: usize, V: Copy + Into<f32> + Sync, S: Frame, T: Frame>(
    source: &Volume<[V; N], S>,
    target: &Grid<T>,
    source_from_target: impl Fn(Position<T>) -> Position<S> + Sync,
    outside: [f32; N],
) -> [Volume<f32, T>; N] {
    filled_together(&source.grid, target, source_from_target, outside, |cell| cell.of_each(&source.data))
}

/// Labels (or any values that cannot be mixed) of the nearest centres; `outside` where the source's voxels do not reach.
#[must_use]
pub fn resample_nearest<V: Copy + Send + Sync, S: Frame, T: Frame>(
    source: &Volume<V, S>,
    target: &Grid<T>,
    source_from_target: &AffineTransform<T, S>,
    outside: V,
) -> Volume<V, T> {
    let voxel_from_voxel = voxel_from_voxel(&source.grid, target, source_from_target);
    let mut out = Volume::filled(*target, outside);
    let [nx, ny, _] = target.dims;
    let plane = (nx * ny).max(1);
    each_piece(&mut out.data, plane, &|start, values| {
        let k = start / plane;
        for (n, value) in values.iter_mut().enumerate() {
            let v = on_centre(affine_point(&voxel_from_voxel, [n % nx, n / nx, k].map(|x| x as f64))).map(f64::round);
            // as-casts saturate, and NaN cannot occur behind a finite affine.
            if let Some(found) = source.get(v[0] as isize, v[1] as isize, v[2] as isize) {
                *value = found;
            }
        }
    });
    out
}

/// The grid that covers the same field of view with voxels of about `spacing_mm` (each axis gets a whole number).
#[must_use]
pub fn grid_with_spacing<F: Frame>(grid: &Grid<F>, spacing_mm: [f64; 3]) -> Grid<F> {
    let old_mm = grid.spacing_mm();
    let dims = [0, 1, 2].map(|a| ((grid.dims[a] as f64 * old_mm[a] / spacing_mm[a]).round() as usize).max(1));
    let mut affine = grid.mm_from_voxel;
    let mut first = [0.0; 3];
    for a in 0..3 {
        let ratio = grid.dims[a] as f64 / dims[a] as f64;
        affine.column_mut(a).scale_mut(ratio);
        // The outer faces coincide: the first centre lies half a new voxel inside.
        first[a] = 0.5 * ratio - 0.5;
    }
    let origin = grid.position(Point3::from(first));
    affine.fixed_view_mut::<3, 1>(0, 3).copy_from(&origin.mm.coords);
    Grid::new(dims, affine).unwrap_or(*grid)
}

/// Fractional source voxel of each target voxel.
fn voxel_from_voxel<S: Frame, T: Frame>(
    source: &Grid<S>,
    target: &Grid<T>,
    source_from_target: &AffineTransform<T, S>,
) -> Matrix4<f64> {
    source.voxel_from_mm() * source_from_target.to_matrix() * target.mm_from_voxel
}

#[inline]
fn affine_point(m: &Matrix4<f64>, [i, j, k]: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|r| m[(r, 0)] * i + (m[(r, 1)] * j + (m[(r, 2)] * k + m[(r, 3)])))
}

/// A coordinate within 1e-9 of a centre is that centre, so that rounding in the affine neither blurs nor leaves the grid.
#[inline]
fn on_centre(v: [f64; 3]) -> [f64; 3] {
    // Adding and taking away 1.5 x 2^52 rounds to a whole number without a call of the mathematics library.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    v.map(|x| {
        let centre = (x + WHOLE) - WHOLE;
        if (x - centre).abs() < 1e-9 { centre } else { x }
    })
}

fn sampled<S: Frame, T: Frame>(
    source: &Volume<f32, S>,
    target: &Grid<T>,
    interpolation: Interpolation,
    outside: f32,
    at: impl Fn([usize; 3]) -> [f64; 3] + Sync,
) -> Resampled<T> {
    match interpolation {
        Interpolation::Nearest => fill(source, target, outside, at, nearest),
        Interpolation::Linear => fill(source, target, outside, at, linear),
        Interpolation::CubicBSpline => fill(&coefficients(source), target, outside, at, value_at),
    }
}

fn fill<S: Frame, T: Frame>(
    source: &Volume<f32, S>,
    target: &Grid<T>,
    outside: f32,
    at: impl Fn([usize; 3]) -> [f64; 3] + Sync,
    value_at: impl Fn(&Volume<f32, S>, [f64; 3]) -> f32 + Sync,
) -> Resampled<T> {
    let [nx, ny, _] = target.dims;
    let mut volume = Volume::filled(*target, outside);
    let mut inside = Mask::filled(*target, false);
    let last = source.grid.dims.map(|n| n as f64 - 1.0);
    let plane = (nx * ny).max(1);
    each_pair((&mut volume.data, &mut inside.data), plane, &|start, values, inside| {
        let k = start / plane;
        for (n, (value, inside)) in values.iter_mut().zip(inside).enumerate() {
            let v = at([n % nx, n / nx, k]);
            // Written so that NaN is outside.
            if (0..3).all(|a| v[a] >= 0.0 && v[a] <= last[a]) {
                *inside = true;
                *value = value_at(source, v);
            }
        }
    });
    Resampled { volume, inside }
}

fn nearest<S: Frame>(source: &Volume<f32, S>, v: [f64; 3]) -> f32 {
    let [i, j, k] = v.map(|x| x.round() as usize);
    source.at(i, j, k)
}

#[inline]
fn linear<S: Frame>(source: &Volume<f32, S>, v: [f64; 3]) -> f32 {
    Cell::at(&source.grid, v).of(&source.data)
}

/// The eight centres around a point within a grid and the weights of trilinear interpolation.
struct Cell {
    corner: usize,
    step: [usize; 3],
    weight: [f32; 3],
}

impl Cell {
    #[inline]
    fn at<S: Frame>(grid: &Grid<S>, v: [f64; 3]) -> Self {
        let dims = grid.dims;
        // By way of 32 bits: the cheaper cast (docs/evidence/choices.md).
        let [i, j, k] = [0, 1, 2].map(|a| (v[a] as u32 as usize).min(dims[a].saturating_sub(2)));
        let stride = [1, dims[0], dims[0] * dims[1]];
        Self {
            corner: grid.index(i, j, k),
            step: [0, 1, 2].map(|a| if dims[a] > 1 { stride[a] } else { 0 }),
            weight: [(v[0] - i as f64) as f32, (v[1] - j as f64) as f32, (v[2] - k as f64) as f32],
        }
    }

    #[inline]
    fn of(&self, d: &[f32]) -> f32 {
        let (o, [step, up, over], w) = (self.corner, self.step, self.weight);
        // a + w (b - a) would not return b exactly at w = 1.
        let mix = |a: f32, b: f32, w: f32| a * (1.0 - w) + b * w;
        let line = |o: usize| mix(d[o], d[o + step], w[0]);
        let plane = |o: usize| mix(line(o), line(o + up), w[1]);
        mix(plane(o), plane(o + over), w[2])
    }
}

impl Cell {
    /// [`Self::of`] for values side by side.
    #[inline]
    fn of_each<const N: usize, V: Copy + Into<f32>>(&self, d: &[[V; N]]) -> [f32; N] {
        let (o, [step, up, over], w) = (self.corner, self.step, self.weight);
        let mix =
            |a: [f32; N], b: [f32; N], w: f32| -> [f32; N] { std::array::from_fn(|n| a[n] * (1.0 - w) + b[n] * w) };
        let line = |o: usize| mix(d[o].map(Into::into), d[o + step].map(Into::into), w[0]);
        let plane = |o: usize| mix(line(o), line(o + up), w[1]);
        mix(plane(o), plane(o + over), w[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mni, Pre, RigidTransform};
    use nalgebra::Vector3;

    fn noise(grid: Grid<Pre>) -> Volume<f32, Pre> {
        let data = (0..grid.len() as u32).map(|n| (n.wrapping_mul(2654435761) >> 16) as f32 / 65536.0);
        Volume::from_data(grid, data.collect())
    }

    fn oblique() -> Grid<Pre> {
        let turn = RigidTransform::<Pre, Pre>::about(
            Point3::new(1.0, 2.0, 3.0),
            Vector3::new(0.2, -0.3, 0.4),
            Vector3::new(-30.0, 5.0, 70.0),
        );
        let scale = Matrix4::new_nonuniform_scaling(&Vector3::new(-0.9, 1.1, 3.0));
        Grid::new([12, 11, 40], turn.to_matrix() * scale).unwrap()
    }

    #[test]
    fn resampling_to_own_grid_changes_nothing() {
        let volume = noise(oblique());
        for interpolation in [Interpolation::Nearest, Interpolation::Linear] {
            let same = resample(&volume, &volume.grid, &AffineTransform::identity(), interpolation, -1.0);
            assert_eq!(same.volume, volume);
            assert_eq!(same.inside.count(), volume.grid.len());
        }
        let same = resample(&volume, &volume.grid, &AffineTransform::identity(), Interpolation::CubicBSpline, -1.0);
        for (a, b) in same.volume.data.iter().zip(&volume.data) {
            assert!((a - b).abs() < 2e-6, "{a} {b}");
        }
        assert_eq!(resample_nearest(&volume, &volume.grid, &AffineTransform::identity(), -1.0), volume);
    }

    #[test]
    fn a_rigid_move_finds_the_same_physical_values() {
        // A smooth function of position, sampled on one grid, must read the same through the transform on another.
        let function = |p: Point3<f64>| (0.11 * p.x).sin() + (0.13 * p.y).cos() * (0.07 * p.z).sin();
        let grid = Grid::<Pre>::axis_aligned([40, 40, 40], [1.0; 3], [-20.0; 3]);
        let volume = Volume::from_data(
            grid,
            (0..grid.len())
                .map(|n| function(grid.position(Point3::from(grid.voxel(n).map(|x| x as f64))).mm) as f32)
                .collect(),
        );
        let pre_from_mni = RigidTransform::<Mni, Pre>::about(
            Point3::origin(),
            Vector3::new(0.1, 0.2, -0.15),
            Vector3::new(2.0, -3.0, 1.0),
        );
        let target = Grid::<Mni>::axis_aligned([20, 20, 20], [1.3; 3], [-12.0; 3]);
        for (interpolation, tolerance) in [(Interpolation::Linear, 8e-3), (Interpolation::CubicBSpline, 5e-5)] {
            let moved = resample(&volume, &target, &pre_from_mni.to_affine(), interpolation, f32::NAN);
            let through = resample_through(&volume, &target, |p| Some(pre_from_mni.apply(p)), interpolation, f32::NAN);
            assert!(moved.inside.count() > 7000);
            for n in 0..target.len() {
                let p = target.position(Point3::from(target.voxel(n).map(|x| x as f64)));
                let truth = function(pre_from_mni.apply(p).mm);
                if moved.inside.data[n] {
                    // Mirroring bends a slope at the border; its trace falls by the spline's pole (.27) per voxel.
                    let v = volume.grid.voxel_at(pre_from_mni.apply(p));
                    let border = v.iter().map(|x| x.min(39.0 - x)).fold(f64::INFINITY, f64::min);
                    let allowed = tolerance + 0.02 * 0.27f64.powf(border);
                    let error = (f64::from(moved.volume.data[n]) - truth).abs();
                    assert!(error < allowed, "{interpolation:?}: {error} at {border} voxels from the border");
                    assert!((moved.volume.data[n] - through.volume.data[n]).abs() < 1e-5);
                } else {
                    assert!(moved.volume.data[n].is_nan());
                }
            }
        }
    }

    #[test]
    fn volumes_resampled_together_are_those_resampled_alone() {
        let (a, b) = (noise(oblique()), noise(oblique()).map(|x| 3.0 - x));
        let map = RigidTransform::<Mni, Pre>::about(
            a.grid.position(Point3::new(6.0, 5.0, 20.0)).mm,
            Vector3::new(0.3, -0.2, 0.1),
            Vector3::new(1.0, 2.0, -4.0),
        );
        let target = Grid::<Mni>::new([20, 18, 25], a.grid.mm_from_voxel).unwrap();
        let together = resample_together([&a, &b], &target, |p| map.apply(p), [-1.0, -2.0]);
        for ((volume, outside), found) in [(&a, -1.0), (&b, -2.0)].into_iter().zip(together) {
            let alone = resample_through(volume, &target, |p| Some(map.apply(p)), Interpolation::Linear, outside);
            assert!((100..target.len() - 100).contains(&alone.inside.count()));
            assert_eq!(found, alone.volume);
        }
    }

    #[test]
    fn outside_is_the_callers_value_and_marked() {
        let grid = Grid::<Pre>::axis_aligned([4, 4, 1], [1.0; 3], [0.0; 3]);
        let volume = Volume::filled(grid, 5.0);
        let wide = Grid::<Pre>::axis_aligned([8, 4, 1], [1.0; 3], [-2.0, 0.0, 0.0]);
        for interpolation in [Interpolation::Nearest, Interpolation::Linear, Interpolation::CubicBSpline] {
            let out = resample(&volume, &wide, &AffineTransform::identity(), interpolation, -9.0);
            for (n, &x) in out.volume.data.iter().enumerate() {
                let within = (2..6).contains(&(n % 8));
                assert_eq!(out.inside.data[n], within);
                assert!((x - if within { 5.0 } else { -9.0 }).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn a_grid_of_other_spacing_covers_the_same_field_of_view() {
        let grid = oblique();
        let coarse = grid_with_spacing(&grid, [2.0; 3]);
        let face = |g: &Grid<Pre>, end: bool| {
            let v = g.dims.map(|n| if end { n as f64 - 0.5 } else { -0.5 });
            g.position(Point3::from(v))
        };
        for end in [false, true] {
            assert!(face(&grid, end).distance_mm(&face(&coarse, end)) < 1e-9);
        }
        assert_eq!(coarse.dims, [5, 6, 60]);
    }
}
