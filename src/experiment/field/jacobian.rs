//! Whether a field can be inverted: the smallest determinant of its gradient, and a field mended where it folds.

use crate::geometry::Frame;
use crate::image::Volume;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// A field without folds.
#[derive(Clone, Debug)]
pub struct Mended<F: Frame> {
    /// The field.
    pub field: Volume<[f32; 3], F>,
    /// Voxels whose vector was changed.
    pub changed: Vec<bool>,
    /// Smallest determinant, over every corner of every cell.
    pub jacobian_min: f64,
}

/// Rounds of smoothing before a field is given up; each reaches a voxel further.
const ROUNDS: usize = 60;

/// The smallest determinant of `x -> x + d(x)`, linear between voxels, over every corner of every cell: there the
/// determinant of a cell is smallest or within the variation along its edges.
pub fn jacobian_min<F: Frame>(field: &Volume<[f32; 3], F>) -> f64 {
    let (slope, steepest) = slope(field);
    // Only a cell that may lie lower is looked at: the least of all is the same in any order.
    let lower = |least: f64, first: usize| {
        if bound(field, steepest, first) >= least { least } else { least.min(lowest(field, &slope, first)) }
    };
    let [nx, ny, nz] = field.grid.dims;
    let [rows, planes] = [ny, nz].map(|n| n.saturating_sub(1));
    let of_row = |least: f64, row: usize| {
        let first = field.grid.index(0, row % rows, row / rows);
        let end = first + nx.saturating_sub(1);
        (first..end).step_by(TOGETHER).fold(least, |least, first| {
            let cells = first..end.min(first + TOGETHER);
            if bound_of_all(field, steepest, cells.clone()) >= least { least } else { cells.fold(least, lower) }
        })
    };
    (0..rows * planes).into_par_iter().fold(|| f64::INFINITY, of_row).reduce(|| f64::INFINITY, f64::min)
}

/// The field smoothed, as little as it takes, where a determinant is below `least`.
pub fn mended<F: Frame>(mut field: Volume<[f32; 3], F>, least: f64) -> Mended<F> {
    let dims = field.grid.dims;
    let stride = [1, dims[0], dims[0] * dims[1]];
    let mut changed = vec![false; field.data.len()];
    let as_it_is = jacobian_min(&field);
    if as_it_is >= least {
        return Mended { field, changed, jacobian_min: as_it_is };
    }
    let (slope, steepest) = slope(&field);
    // After the first round only cells with a corner that has changed can have changed.
    let mut looked_at: Vec<u32> = (0..cells(dims) as u32).collect();
    for round in 0..ROUNDS {
        let folded: Vec<u32> = looked_at
            .par_iter()
            .map(|&c| first_of(dims, c as usize))
            .filter(|&first| bound(&field, steepest, first) < least && lowest(&field, &slope, first) < least)
            .map(|first| first as u32)
            .collect();
        if folded.is_empty() {
            break;
        }
        let reach = 1 + round / 4;
        let mut around: Vec<u32> = Vec::new();
        for &n in &folded {
            let n = n as usize;
            let v = [n % dims[0], n / dims[0] % dims[1], n / stride[2]];
            let range = |a: usize| v[a].saturating_sub(reach - 1)..(v[a] + 1 + reach).min(dims[a]);
            for k in range(2) {
                for j in range(1) {
                    around.extend(range(0).map(|i| (i + stride[1] * j + stride[2] * k) as u32));
                }
            }
        }
        around.sort_unstable();
        around.dedup();
        let smooth: Vec<[f32; 3]> = around
            .par_iter()
            .map(|&n| {
                let n = n as usize;
                let v = [n % dims[0], n / dims[0] % dims[1], n / stride[2]];
                let (mut sum, mut count) = ([0f32; 3], 0f32);
                for a in 0..3 {
                    for m in [(v[a] > 0).then(|| n - stride[a]), (v[a] + 1 < dims[a]).then(|| n + stride[a])] {
                        let Some(m) = m else { continue };
                        (0..3).for_each(|c| sum[c] += field.data[m][c]);
                        count += 1.0;
                    }
                }
                std::array::from_fn(|c| 0.5 * field.data[n][c] + 0.5 * sum[c] / count)
            })
            .collect();
        for (&n, value) in around.iter().zip(smooth) {
            field.data[n as usize] = value;
            changed[n as usize] = true;
        }
        looked_at = around.iter().flat_map(|&n| cells_at(dims, n as usize)).collect();
        looked_at.sort_unstable();
        looked_at.dedup();
    }
    let jacobian_min = jacobian_min(&field);
    Mended { field, changed, jacobian_min }
}

fn cells(dims: [usize; 3]) -> usize {
    dims.iter().map(|n| n.saturating_sub(1)).product()
}

/// The cells that a voxel is a corner of.
fn cells_at(dims: [usize; 3], n: usize) -> impl Iterator<Item = u32> {
    let v = [n % dims[0], n / dims[0] % dims[1], n / (dims[0] * dims[1])];
    (0..8usize).filter_map(move |c| {
        let at = |a: usize| v[a].checked_sub(c >> a & 1).filter(|&x| x + 1 < dims[a]);
        Some((at(0)? + (dims[0] - 1) * (at(1)? + (dims[1] - 1) * at(2)?)) as u32)
    })
}

/// The voxel that a cell begins at.
fn first_of(dims: [usize; 3], cell: usize) -> usize {
    let [cx, cy] = [dims[0] - 1, dims[1] - 1];
    cell % cx + dims[0] * (cell / cx % cy + dims[1] * (cell / (cx * cy)))
}

/// Cells of a row that are looked at together first.
const TOGETHER: usize = 16;

/// What no [`bound`] of some cells of a row is below: by the largest change of a component along each axis.
fn bound_of_all<F: Frame>(field: &Volume<[f32; 3], F>, steepest: f64, cells: std::ops::Range<usize>) -> f64 {
    let components = field.data.as_flattened();
    let [b, c] = [field.grid.dims[0], field.grid.dims[0] * field.grid.dims[1]];
    let (first, count) = (cells.start, cells.len());
    // Sizes as bits are in order, and what is no number is the largest.
    let largest = |from: usize, step: usize, count: usize| {
        let (low, high) = (&components[3 * from..][..3 * count], &components[3 * (from + step)..][..3 * count]);
        low.iter().zip(high).fold(0, |most: u32, (u, v)| most.max((v - u).to_bits() & !(1 << 31)))
    };
    let along = [
        [first, first + b, first + c, first + b + c].map(|row| largest(row, 1, count)).into_iter().fold(0, u32::max),
        largest(first, b, count + 1).max(largest(first + c, b, count + 1)),
        largest(first, c, count + 1).max(largest(first + b, c, count + 1)),
    ];
    above(along.map(|bits| 3.0 * f32::from_bits(bits).powi(2)).iter().sum(), steepest)
}

/// What makes differences between voxels gradients, and its norm.
fn slope<F: Frame>(field: &Volume<[f32; 3], F>) -> (Matrix3<f64>, f64) {
    let slope = field.grid.voxel_from_mm().fixed_view::<3, 3>(0, 0).into_owned();
    (slope, slope.singular_values().max())
}

/// What no determinant at the corners of the cell that begins at a voxel is below: a gradient whose norm is g < 1 has
/// eigenvalues no further than g from 0, and 1 + g no determinant below (1 - g)^3. Cells where little changes, nearly all,
/// need no more than that.
#[inline]
fn bound<F: Frame>(field: &Volume<[f32; 3], F>, steepest: f64, first: usize) -> f64 {
    let dims = field.grid.dims;
    let stride = [1, dims[0], dims[0] * dims[1]];
    let (mut sum, data) = (0f32, &field.data);
    for a in 0..3 {
        let (b, c) = (stride[(a + 1) % 3], stride[(a + 2) % 3]);
        let longest = [first, first + b, first + c, first + b + c].map(|from| {
            let (u, v) = (data[from], data[from + stride[a]]);
            let d = [v[0] - u[0], v[1] - u[1], v[2] - u[2]];
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        });
        sum += longest[0].max(longest[1]).max(longest[2].max(longest[3]));
    }
    above(sum, steepest)
}

/// What no determinant is below where the squares of the changes along the axes are not more than `sum` together.
fn above(sum: f32, steepest: f64) -> f64 {
    // Of single precision, and on the safe side of it.
    let norm = 1.000_01 * f64::from(sum).sqrt() * steepest;
    // Written so that NaN is looked at.
    if norm < 1.0 { (1.0 - norm).powi(3) } else { f64::NEG_INFINITY }
}

/// The smallest determinant at the corners of the cell that begins at a voxel.
fn lowest<F: Frame>(field: &Volume<[f32; 3], F>, voxel_from_mm: &Matrix3<f64>, first: usize) -> f64 {
    let dims = field.grid.dims;
    let corner = |c: usize| {
        let at = first + (c & 1) + (c >> 1 & 1) * dims[0] + (c >> 2 & 1) * dims[0] * dims[1];
        let [x, y, z] = field.data[at];
        Vector3::new(f64::from(x), f64::from(y), f64::from(z))
    };
    let v: [Vector3<f64>; 8] = std::array::from_fn(corner);
    if v[1..].iter().all(|x| *x == v[0]) {
        return 1.0;
    }
    let mut least = f64::INFINITY;
    for c in 0..8usize {
        let along = |a: usize| v[c | 1 << a] - v[c & !(1 << a)];
        let gradient = Matrix3::from_columns(&[along(0), along(1), along(2)]) * voxel_from_mm;
        least = least.min((Matrix3::identity() + gradient).determinant());
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;

    #[test]
    fn a_stretch_has_its_own_determinant_on_any_grid() {
        let grid = Grid::<Pre>::axis_aligned([6, 7, 5], [1.0, 2.0, 3.0], [-3.0; 3]);
        let at = |n: usize| grid.centre(grid.voxel(n)).mm;
        let field = Volume::from_fn(grid, |n| [0.1 * at(n).x as f32, -0.2 * at(n).y as f32, 0.3 * at(n).z as f32]);
        assert!((jacobian_min(&field) - 1.1 * 0.8 * 1.3).abs() < 1e-5);
        let mended = mended(field.clone(), 0.1);
        assert!(mended.field == field && !mended.changed.contains(&true), "what does not fold is left alone");
    }

    #[test]
    fn no_determinant_is_below_its_bound_and_the_least_is_found_as_if_all_were_looked_at() {
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.5)).to_homogeneous();
        let affine = turn * nalgebra::Matrix4::new_nonuniform_scaling(&Vector3::new(-0.7, 1.0, 2.5));
        let grid = Grid::<Pre>::new([17, 15, 13], affine).unwrap();
        for (seed, size) in [(1, 0.02), (2, 0.1), (3, 0.4), (4, 3.0)] {
            let noise = |n: usize, c: u64| {
                crate::material::random::CounterRng::new(seed, n as u64).between(c, -size, size) as f32
            };
            let field = Volume::from_fn(grid, |n| [noise(n, 0), noise(n, 1), noise(n, 2)]);
            let (slope, steepest) = slope(&field);
            let mut least_of_all = f64::INFINITY;
            for first in (0..cells(grid.dims)).map(|c| first_of(grid.dims, c)) {
                let least = lowest(&field, &slope, first);
                assert!(bound(&field, steepest, first) <= least, "{seed} {first}");
                least_of_all = least_of_all.min(least);
            }
            let row = 0..grid.dims[0] - 1;
            let lowest_of_row = row.clone().map(|first| lowest(&field, &slope, first)).fold(f64::INFINITY, f64::min);
            assert!(bound_of_all(&field, steepest, row.clone()) <= lowest_of_row, "{seed}");
            let mut broken = field.clone();
            broken.data[5][1] = f32::NAN;
            assert_eq!(bound_of_all(&broken, steepest, row), f64::NEG_INFINITY, "what is no number is looked at");
            assert_eq!(jacobian_min(&field), least_of_all);
        }
    }

    #[test]
    fn a_voxel_is_a_corner_of_the_cells_that_begin_at_most_one_before_it() {
        let dims = [4, 3, 5];
        for n in 0..60 {
            let corner = |c: usize| {
                let first = first_of(dims, c);
                (0..8).any(|k| first + (k & 1) + 4 * (k >> 1 & 1) + 12 * (k >> 2 & 1) == n)
            };
            let expected: Vec<u32> = (0..cells(dims)).filter(|&c| corner(c)).map(|c| c as u32).collect();
            let mut found: Vec<u32> = cells_at(dims, n).collect();
            found.sort_unstable();
            assert_eq!(found, expected, "voxel {n}");
        }
    }

    #[test]
    fn a_fold_is_mended_and_what_lies_far_from_it_stays() {
        let grid = Grid::<Pre>::axis_aligned([40, 20, 20], [1.0; 3], [0.0; 3]);
        // Tissue pushed 4 mm into a wall a voxel away.
        let field = Volume::from_fn(grid, |n| [if grid.voxel(n)[0] < 20 { 4.0f32 } else { 0.0 }, 0.0, 0.0]);
        assert!(jacobian_min(&field) < -2.0);
        let mended = mended(field.clone(), 0.05);
        assert!(mended.jacobian_min >= 0.05, "{}", mended.jacobian_min);
        assert!((jacobian_min(&mended.field) - mended.jacobian_min).abs() < 1e-12);
        for n in 0..grid.len() {
            assert!(mended.changed[n] || mended.field.data[n] == field.data[n]);
            assert!(grid.voxel(n)[0] > 1 || !mended.changed[n]);
        }
    }
}
