//! The points at which mutual information reads the images.
//!
//! Points lie off the voxel grid (a fixed jitter from a counter hash), so that identical grids do not favour whole-voxel
//! shifts. Along thick slices they stay on the slices, and the other image is averaged over the slice's thickness there.

use super::bspline;
use crate::geometry::Native;
use crate::image::{Mask, Volume};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Sample points of one image with the histogram bins of their values.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    /// Points relative to the centre of rotation, in mm.
    pub offsets_mm: Vec<[f32; 3]>,
    /// The histogram bin of each point's value.
    pub bins: Vec<u8>,
    /// Where across the slice the other image is read (one zero offset for thin slices), in mm.
    pub profile: Vec<Vector3<f64>>,
    /// Unit normal of thick slices, or zero.
    pub slice_axis: Vector3<f64>,
    /// Root mean square distance from the centre in mm: turns a rotation into a length.
    pub radius_mm: f64,
}

impl Samples {
    pub(super) fn len(&self) -> usize {
        self.bins.len()
    }
}

/// Uniform in [0, 1) from a counter (SplitMix64; Steele et al. 2014).
pub(super) fn uniform(seed: u64, counter: u64) -> f64 {
    let mut z = seed.wrapping_mul(0xD134_2543_DE82_EF95).wrapping_add(counter.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// How samples are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw {
    /// At most about this many points.
    pub most: usize,
    /// Spacing of the other image: a slice more than 1.5 times as thick is treated as thick.
    pub other_spacing_mm: f64,
    /// Bins of the histogram.
    pub bins: usize,
    /// Values that map to the first and last bin.
    pub range: [f32; 2],
    /// Centre of rotation.
    pub centre_mm: Vector3<f64>,
    /// Seed of the jitter.
    pub seed: u64,
}

/// Draws points from the voxels inside `region`.
pub(super) fn draw(image: &Volume<f32, Native>, region: &Mask<Native>, draw: &Draw) -> Samples {
    let grid = &image.grid;
    let spacing = grid.spacing_mm();
    let thick: [bool; 3] = spacing.map(|s| s > 1.5 * draw.other_spacing_mm);
    let region_from_voxel = region.grid.voxel_from_mm() * grid.mm_from_voxel;
    let [nx, ny, nz] = grid.dims;
    let inside = |i: usize, j: usize, k: usize| {
        let p = region_from_voxel.transform_point(&Point3::new(i as f64, j as f64, k as f64));
        region.get(p.x.round() as isize, p.y.round() as isize, p.z.round() as isize).unwrap_or(false)
    };
    let per_slice: Vec<Vec<u32>> = (0..nz)
        .into_par_iter()
        .map(|k| {
            let voxels = (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j)));
            voxels.filter(|&(i, j)| inside(i, j, k)).map(|(i, j)| grid.index(i, j, k) as u32).collect()
        })
        .collect();
    let total: usize = per_slice.iter().map(Vec::len).sum();
    let share = draw.most as f64 / total.max(1) as f64;
    let scale = draw.bins as f32 / (draw.range[1] - draw.range[0]);
    let parts: Vec<Vec<([f32; 3], u8)>> = per_slice
        .par_iter()
        .map(|voxels| {
            let kept = voxels.iter().filter(|&&v| share >= 1.0 || uniform(draw.seed, 4 * u64::from(v)) < share);
            kept.filter_map(|&v| {
                let voxel = grid.voxel(v as usize);
                let at: [f64; 3] = std::array::from_fn(|a| {
                    let jitter = if thick[a] || grid.dims[a] < 2 {
                        0.0
                    } else {
                        uniform(draw.seed, 4 * u64::from(v) + 1 + a as u64) - 0.5
                    };
                    (voxel[a] as f64 + jitter).clamp(0.0, grid.dims[a] as f64 - 1.0)
                });
                let value = if thick.contains(&true) {
                    in_slice_value(image, at, thick)
                } else {
                    bspline::value_and_gradient(image, at)?.0
                };
                let bin = ((value - draw.range[0]) * scale).clamp(0.0, draw.bins as f32 - 1.0) as u8;
                let x = grid.mm_from_voxel.transform_point(&Point3::from(at)).coords - draw.centre_mm;
                Some((x.map(|x| x as f32).into(), bin))
            })
            .collect()
        })
        .collect();
    let (offsets_mm, bins): (Vec<[f32; 3]>, Vec<u8>) = parts.into_iter().flatten().unzip();

    // One thick axis at most: the thickest.
    let axis = (0..3).filter(|&a| thick[a]).max_by(|&a, &b| spacing[a].total_cmp(&spacing[b]));
    let (slice_axis, profile) = axis.map_or((Vector3::zeros(), vec![Vector3::zeros()]), |a| {
        let column: Vector3<f64> = grid.mm_from_voxel.fixed_view::<3, 1>(0, a).into_owned();
        // The nominal slice profile is a box of the slice's thickness; read at the middles of equal layers
        // (the spline's own width fills the gaps between layers up to 1.75 voxels apart).
        let layers = (spacing[a] / (1.75 * draw.other_spacing_mm)).ceil().max(2.0) as usize;
        let offset = |l: usize| column * ((l as f64 + 0.5) / layers as f64 - 0.5);
        (column.normalize(), (0..layers).map(offset).collect())
    });
    let squares: f64 = offsets_mm.iter().map(|x| x.iter().map(|&c| f64::from(c).powi(2)).sum::<f64>()).sum();
    let radius_mm = (squares / offsets_mm.len().max(1) as f64).sqrt().max(1.0);
    Samples { offsets_mm, bins, profile, slice_axis, radius_mm }
}

/// The spline's value where along thick axes the voxel itself is taken: `at` is whole there.
fn in_slice_value(image: &Volume<f32, Native>, at: [f64; 3], thick: [bool; 3]) -> f32 {
    let mut base = [0isize; 3];
    let mut w = [[0f32; 4]; 3];
    for a in 0..3 {
        let floor = at[a].floor();
        base[a] = floor as isize - 1;
        w[a] = if thick[a] { [0.0, 1.0, 0.0, 0.0] } else { bspline::weights((at[a] - floor) as f32) };
    }
    let place = |a: usize, o: usize| (base[a] + o as isize).clamp(0, image.grid.dims[a] as isize - 1) as usize;
    let mut value = 0f32;
    for c in (0..4).filter(|&c| w[2][c] != 0.0) {
        for b in (0..4).filter(|&b| w[1][b] != 0.0) {
            for a in (0..4).filter(|&a| w[0][a] != 0.0) {
                value += w[0][a] * w[1][b] * w[2][c] * image.at(place(0, a), place(1, b), place(2, c));
            }
        }
    }
    value
}
