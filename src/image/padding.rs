//! What a scan was filled up with where it was not taken: zeros behind a plane.
//!
//! A scan that was resampled onto another's grid, as registration programs write it, is zero where its own field of view did not
//! reach. Nothing is known there, though the grid goes on: such a zero is no dark tissue. The air around a head may be zero as well, but it
//! begins at a rounded surface; a field of view ends at a plane that all of the scan lies on one side of.

use super::Volume;
use crate::geometry::Frame;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// The half of a grid behind a plane that only padding lies in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Padding {
    /// The voxel axis from the padded side into the scan.
    axis: usize,
    /// The other two.
    across: [usize; 2],
    /// Whether the padded side is the axis's end.
    at_end: bool,
    /// Voxels along the axis.
    length: f64,
    /// How deep it is, voxels: `plane[0] + plane[1] u + plane[2] v` at the voxel (u, v) of the side.
    plane: [f64; 3],
}

/// A plane that so much of the scan begins at is no rounded head's, mm2: of a ball of 90 mm a third of that lies as near to a plane
/// in voxels of a millimetre.
const LEAST_MM2: f64 = 2500.0;
/// So much more for each mm that its voxels are deeper than one, mm2. [`NEAR`] holds two slices at most, and two of a rounded head have
/// 4 pi r for each mm of their depth less what its curving takes: of a ball of 100 mm that is below this line for slices of any depth,
/// and a field of view that ends well within a head lies above it.
const MORE_MM2_PER_MM: f64 = 1000.0;
/// How far from the plane what begins at it may begin, voxels: it passes between voxels.
const NEAR: f64 = 0.75;
/// Share of that many columns that may begin before it: what an interpolation leaves at a corner.
const BEFORE: f64 = 0.005;
/// Less padding than this, voxels, is none.
const LEAST_DEPTH: f64 = 1.5;
/// A voxel at the plane is read in part from what lies behind it.
const RIM: f64 = 1.0;
/// Over how far a slope is read, mm: planes of voxels have steps.
const BASELINE_MM: f64 = 10.0;
/// Slopes are counted in bins of this width, up to half a right angle either way: beyond it another side is nearer.
const BIN: f64 = 0.125;
const BINS: usize = 17;
/// How many of the commonest slopes are tried.
const CANDIDATES: usize = 3;
/// Fits of a plane, each to what lies near the one before.
const FITS: usize = 6;

impl Padding {
    /// Whether a place (voxel indices, between centres too) lies behind the plane or is read from behind it.
    pub fn contains(&self, voxel: [f64; 3]) -> bool {
        let [a, b, c] = self.plane;
        let deep = if self.at_end { self.length - 1.0 - voxel[self.axis] } else { voxel[self.axis] };
        deep < a + b * voxel[self.across[0]] + c * voxel[self.across[1]] + RIM - 0.5
    }
}

/// The padding of a scan, one plane a side at most.
pub fn padding<F: Frame>(image: &Volume<f32, F>) -> Vec<Padding> {
    let sides = (0..3).flat_map(|axis| [(axis, false), (axis, true)]);
    sides.filter_map(|(axis, at_end)| Side::of(image, axis, at_end).padding()).collect()
}

/// A side of a grid: how many zeros every column begins with.
struct Side {
    axis: usize,
    across: [usize; 2],
    at_end: bool,
    length: usize,
    columns: [usize; 2],
    /// `None` where there is nothing but zeros.
    depth: Vec<Option<f64>>,
    /// Edges of a voxel along the axis and across it, mm.
    spacing: [f64; 3],
}

impl Side {
    fn of<F: Frame>(image: &Volume<f32, F>, axis: usize, at_end: bool) -> Self {
        let grid = &image.grid;
        let across = [(axis + 1) % 3, (axis + 2) % 3];
        let (length, columns) = (grid.dims[axis], across.map(|a| grid.dims[a]));
        let shows = |u: usize, v: usize, deep: usize| {
            let mut voxel = [0; 3];
            voxel[axis] = if at_end { length - 1 - deep } else { deep };
            (voxel[across[0]], voxel[across[1]]) = (u, v);
            let value = image.at(voxel[0], voxel[1], voxel[2]);
            value.is_finite() && value != 0.0
        };
        let column = |n: usize| {
            let (u, v) = (n % columns[0], n / columns[0]);
            (0..length).find(|&deep| shows(u, v, deep)).map(|deep| deep as f64)
        };
        let spacing = grid.spacing_mm();
        Self {
            axis,
            across,
            at_end,
            length,
            columns,
            depth: (0..columns[0] * columns[1]).map(column).collect(),
            spacing: [spacing[axis], spacing[across[0]], spacing[across[1]]],
        }
    }

    fn at(&self, u: usize, v: usize) -> Option<f64> {
        self.depth[u + self.columns[0] * v]
    }

    fn padding(&self) -> Option<Padding> {
        // Slopes as they are counted are rough: what lies near is looked for in a wider layer at first. Of thick slices such a layer
        // holds so much of a head behind the plane that the fit leaves it.
        let near =
            |slopes| [4.0 * NEAR, NEAR].into_iter().find_map(|first_near| self.behind_slopes(slopes, first_near));
        self.commonest_slopes().into_iter().find_map(near)
    }

    /// Slopes (mm per mm) that most columns have to those some way off, the commonest first.
    fn commonest_slopes(&self) -> Vec<[f64; 2]> {
        let [along, wide, high] = self.spacing;
        let baseline = [wide, high].map(|edge| (BASELINE_MM / edge).round().max(1.0) as usize);
        let mut counts = [[0usize; BINS]; BINS];
        let bin = |slope: f64| {
            let bin = (slope / BIN).round() + (BINS / 2) as f64;
            (0.0..BINS as f64).contains(&bin).then_some(bin as usize)
        };
        for v in 0..self.columns[1].saturating_sub(baseline[1]) {
            for u in 0..self.columns[0].saturating_sub(baseline[0]) {
                let (here, right, up) = (self.at(u, v), self.at(u + baseline[0], v), self.at(u, v + baseline[1]));
                let (Some(here), Some(right), Some(up)) = (here, right, up) else { continue };
                let slope = |there: f64, edge: f64, voxels: usize| (there - here) * along / (edge * voxels as f64);
                let bins = (bin(slope(right, wide, baseline[0])), bin(slope(up, high, baseline[1])));
                if let (Some(b), Some(c)) = bins {
                    counts[b][c] += 1;
                }
            }
        }
        let mut order: Vec<usize> = (0..BINS * BINS).filter(|n| counts[n / BINS][n % BINS] > 0).collect();
        order.sort_by_key(|n| std::cmp::Reverse(counts[n / BINS][n % BINS]));
        let slope = |bin: usize| (bin as f64 - (BINS / 2) as f64) * BIN;
        order.into_iter().take(CANDIDATES).map(|n| [slope(n / BINS), slope(n % BINS)]).collect()
    }

    /// The plane of about these slopes that the scan begins at, where it is one; the first fit is to what lies so near, voxels.
    fn behind_slopes(&self, [b, c]: [f64; 2], first_near: f64) -> Option<Padding> {
        let [along, wide, high] = self.spacing;
        let mut plane = [0.0, b * wide / along, c * high / along];
        let shown = || {
            let columns = self.depth.iter().enumerate();
            columns.filter_map(|(n, d)| Some(((n % self.columns[0]) as f64, (n / self.columns[0]) as f64, (*d)?)))
        };
        // The commonest distance from a plane of these slopes.
        let mut offsets: Vec<i64> = shown().map(|(u, v, d)| (d - plane[1] * u - plane[2] * v).round() as i64).collect();
        offsets.sort_unstable();
        let runs = offsets.chunk_by(|a, b| a == b).max_by_key(|run| run.len())?;
        plane[0] = runs[0] as f64;
        let beyond = |plane: [f64; 3], (u, v, d): (f64, f64, f64)| d - plane[0] - plane[1] * u - plane[2] * v;
        for fit in 0..FITS {
            let near = if fit == 0 { first_near } else { NEAR };
            let (mut matrix, mut right) = (Matrix3::<f64>::zeros(), Vector3::zeros());
            for column in shown().filter(|column| beyond(plane, *column).abs() <= near) {
                let row = Vector3::new(1.0, column.0, column.1);
                matrix += row * row.transpose();
                right += row * column.2;
            }
            plane = matrix.try_inverse().map(|inverse| inverse * right)?.into();
        }
        let (mut on, mut before, mut depth) = (0usize, 0usize, 0.0);
        for column in shown() {
            let beyond = beyond(plane, column);
            if beyond.abs() <= NEAR {
                on += 1;
                depth += column.2;
            } else if beyond < 0.0 {
                before += 1;
            }
        }
        let least_mm2 = LEAST_MM2 + MORE_MM2_PER_MM * (along - 1.0).max(0.0);
        let is_plane = on as f64 * wide * high >= least_mm2 && before as f64 <= BEFORE * on as f64;
        let is_deep = depth / on.max(1) as f64 >= LEAST_DEPTH;
        let Self { axis, across, at_end, length, .. } = *self;
        (is_plane && is_deep).then_some(Padding { axis, across, at_end, length: length as f64, plane })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Native;
    use crate::image::Grid;
    use proptest::prelude::*;

    /// A head of 1 within a ball, noise or nothing around it.
    fn ball(air: bool) -> Volume<f32, Native> {
        let grid = Grid::axis_aligned([64, 60, 70], [3.0, 3.0, 2.5], [0.0; 3]);
        Volume::from_voxels(grid, |[i, j, k]| {
            let from = [i as f64 * 3.0 - 95.0, j as f64 * 3.0 - 90.0, k as f64 * 2.5 - 88.0];
            let inside = from.iter().map(|x| x * x).sum::<f64>().sqrt() < 80.0;
            if inside {
                1.0
            } else if air {
                0.02 + 0.001 * ((i * 7 + j * 5 + k * 3) % 11) as f32
            } else {
                0.0
            }
        })
    }

    /// Zero beyond a plane through a voxel.
    fn cut(image: &Volume<f32, Native>, through: [f64; 3], normal: [f64; 3]) -> Volume<f32, Native> {
        Volume::from_fn(image.grid, |n| {
            let v = image.grid.voxel(n);
            let side: f64 = (0..3).map(|a| (v[a] as f64 - through[a]) * normal[a]).sum();
            if side > 0.0 { 0.0 } else { image.data[n] }
        })
    }

    #[test]
    fn a_round_head_in_empty_air_and_a_whole_field_of_view_have_no_padding() {
        assert_eq!(padding(&ball(false)), []);
        assert_eq!(padding(&ball(true)), []);
        assert_eq!(padding(&ball(true).map(|_| 0.0f32)), []);
    }

    /// A ball of so many mm in empty air, in thick slices, the first of them so far above its middle that so many mm of it are cut off.
    fn in_thick_slices(radius_mm: f64, slice_mm: f64, cut_mm: f64, offset_mm: f64) -> Volume<f32, Native> {
        let grid = Grid::axis_aligned([80, 80, (240.0 / slice_mm) as usize], [3.0, 3.0, slice_mm], [0.0; 3]);
        Volume::from_voxels(grid, |[i, j, k]| {
            let from = [i as f64 * 3.0 - 119.0, j as f64 * 3.0 - 118.0, k as f64 * slice_mm - 120.0 + offset_mm];
            let inside = from.iter().map(|x| x * x).sum::<f64>() < radius_mm * radius_mm;
            f32::from(u8::from(inside && from[2] <= radius_mm - cut_mm))
        })
    }

    #[test]
    fn the_field_of_view_of_thick_slices_is_found_where_it_cuts_a_head_and_nowhere_else() {
        for (slice_mm, offsets) in [(3.0, 3), (5.0, 5), (6.0, 6)] {
            for offset_mm in (0..offsets).map(f64::from) {
                let found = padding(&in_thick_slices(80.0, slice_mm, 20.0, offset_mm));
                assert!(
                    matches!(found[..], [Padding { axis: 2, at_end: true, .. }]),
                    "{slice_mm} {offset_mm}: {found:?}"
                );
                for radius_mm in [70.0, 80.0, 100.0] {
                    let whole = padding(&in_thick_slices(radius_mm, slice_mm, 0.0, offset_mm));
                    assert_eq!(whole, [], "{radius_mm} {slice_mm} {offset_mm}");
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn what_lies_behind_a_plane_is_padding_and_nothing_else(
            tilt in -0.4..0.4f64, roll in -0.4..0.4f64, from_middle in -6.0..12.0f64, side in 0..6usize, air in any::<bool>(),
        ) {
            let image = ball(air);
            let mut normal = [tilt, roll, tilt - roll];
            normal[side / 2] = if side % 2 == 0 { 1.0 } else { -1.0 };
            let mut through = [31.5, 29.5, 34.5];
            through[side / 2] += from_middle * normal[side / 2];
            let found = padding(&cut(&image, through, normal));
            prop_assert!(!found.is_empty());
            let (mut missed, mut wrong) = (0, 0);
            for n in 0..image.data.len() {
                let v = image.grid.voxel(n).map(|x| x as f64);
                let away: f64 = (0..3).map(|a| (v[a] - through[a]) * normal[a]).sum::<f64>()
                    / normal.iter().map(|x| x * x).sum::<f64>().sqrt();
                let told = found.iter().any(|padding| padding.contains(v));
                if image.data[n] > 0.5 {
                    missed += usize::from(away > 0.5 && !told);
                    wrong += usize::from(away < -3.6 && told);
                }
            }
            prop_assert!(missed == 0 && wrong == 0, "{missed} {wrong} {found:?}");
        }
    }
}
