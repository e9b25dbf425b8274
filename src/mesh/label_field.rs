//! Label maps as smooth fields: what every engine meshes and every optimiser fits to.
//!
//! Field k at a point is the trilinear value of the smoothed indicator of label k; the label of a point is the
//! largest field. Two labels meet where their fields are equal, three where three are equal, so all interfaces of a
//! map are defined at once and nothing overlaps. Coordinates here are the map's own box: millimetres from the first
//! voxel centre along i, j, k; [`LabelField::to_frame`] takes them to the map's frame.

use crate::geometry::Frame;
use crate::image::LabelMap;
use crate::mesh::sheet::Sheet;
use nalgebra::{Matrix4, Vector3};
use rayon::prelude::*;

/// Smooth label fields on a cropped, padded box.
#[derive(Clone, Debug)]
pub struct LabelField {
    dims: [usize; 3],
    spacing_mm: [f64; 3],
    /// Label of every field; field 0 is the outside.
    labels: Vec<u8>,
    /// Where labels are split, see [`LabelField::split_at_midplane`].
    sheet: Option<Sheet>,
    /// The fields of a voxel side by side, i fastest.
    values: Vec<f32>,
    largest: Vec<u8>,
    frame_from_box: Matrix4<f64>,
}

/// How fast the halves of a split label part from the midplane. Small, because the kink of the larger half is blurred over a
/// voxel and moves other interfaces there by a quarter of this; large enough to outdo rounding.
const SPLIT_SLOPE_PER_VOXEL: f64 = 0.4;

/// Voxels between the labelled part and the border of the box: the Gaussian's reach and one more.
const PAD: usize = 4;

impl LabelField {
    /// The fields of `labels` on their bounding box (padded with the outside, also where a label touches the border
    /// of the map), smoothed by a Gaussian-like kernel of `smoothing_voxels` along every axis. `None` when no voxel carries a label.
    pub fn new<F: Frame>(map: &LabelMap<F>, smoothing_voxels: f64) -> Option<Self> {
        let [lo, hi] = bounding_box(map)?;
        let dims: [usize; 3] = std::array::from_fn(|a| hi[a] - lo[a] + 1 + 2 * PAD);
        let spacing_mm = map.grid.spacing_mm();
        let mut present = [false; 256];
        let mut dense = vec![0u8; dims.iter().product()];
        for k in lo[2]..=hi[2] {
            for j in lo[1]..=hi[1] {
                let from = map.grid.index(lo[0], j, k);
                let to = PAD + dims[0] * (j - lo[1] + PAD + dims[1] * (k - lo[2] + PAD));
                let row = &map.data[from..=from + hi[0] - lo[0]];
                dense[to..to + row.len()].copy_from_slice(row);
                for &l in row {
                    present[l as usize] = true;
                }
            }
        }
        present[0] = true;
        let labels: Vec<u8> = (0..=255u8).filter(|&l| present[l as usize]).collect();
        let smooth: Vec<Vec<f32>> =
            labels[1..].par_iter().map(|&label| smooth_indicator(&dense, label, dims, smoothing_voxels)).collect();
        let count = labels.len();
        let mut values = vec![0f32; dense.len() * count];
        let mut largest = vec![0u8; dense.len()];
        each_voxel(&mut values, &mut largest, &|voxel, value| {
            value[0] = 1.0;
            for k in 1..count {
                value[k] = smooth[k - 1][voxel];
                value[0] -= value[k];
            }
        });
        let mut shift = Matrix4::identity();
        for a in 0..3 {
            shift[(a, 3)] = lo[a] as f64 - PAD as f64;
        }
        let scale = Matrix4::from_diagonal(&Vector3::from(spacing_mm.map(|s| 1.0 / s)).push(1.0));
        let frame_from_box = map.grid.mm_from_voxel * shift * scale;
        Some(Self { dims, spacing_mm, labels, sheet: None, values, largest, frame_from_box })
    }

    /// The same fields, those of `labels` cut in two by the plane x = 0 of the frame: the field that was there is the left
    /// half, a new one at the end of the list, with the same label, the right half. Their difference is linear in x, which
    /// trilinear interpolation keeps, so that they meet in the plane itself whatever the grid. See [`Sheet`] for `above_yz_mm`.
    #[must_use]
    pub(crate) fn split_at_midplane(self, labels: &[u8], above_yz_mm: &[[f64; 2]]) -> Self {
        let halves: Vec<usize> = (1..self.labels.len()).filter(|&k| labels.contains(&self.labels[k])).collect();
        let (old_count, count) = (self.labels.len(), self.labels.len() + halves.len());
        let slope = SPLIT_SLOPE_PER_VOXEL / self.spacing_mm.iter().product::<f64>().cbrt();
        let mut values = vec![0f32; self.largest.len() * count];
        let mut largest = vec![0u8; self.largest.len()];
        each_voxel(&mut values, &mut largest, &|voxel, value| {
            value[..old_count].copy_from_slice(&self.values[voxel * old_count..(voxel + 1) * old_count]);
            let x = slope * self.frame_from_box.transform_point(&self.voxel_mm(voxel).into()).x;
            for (n, &k) in halves.iter().enumerate() {
                value[old_count + n] = value[k] + x.min(0.0) as f32;
                value[k] -= x.max(0.0) as f32;
            }
        });
        let mask = |fields: &mut dyn Iterator<Item = usize>| fields.fold(0u64, |mask, k| mask | 1 << k);
        let sheet = Sheet {
            frame_from_box: self.frame_from_box,
            left: mask(&mut halves.iter().copied()),
            right: mask(&mut (old_count..count)),
            above_yz_mm: above_yz_mm.to_vec(),
        };
        let labels = self.labels.iter().copied().chain(halves.iter().map(|&k| self.labels[k])).collect();
        Self { labels, sheet: Some(sheet), values, largest, ..self }
    }

    /// Where labels are split, if they are.
    pub(crate) fn sheet(&self) -> Option<&Sheet> {
        self.sheet.as_ref()
    }

    /// Millimetres of the box of a voxel's centre.
    fn voxel_mm(&self, voxel: usize) -> Vector3<f64> {
        let [nx, ny, _] = self.dims;
        let at = [voxel % nx, voxel / nx % ny, voxel / (nx * ny)];
        Vector3::from(std::array::from_fn::<f64, 3, _>(|a| at[a] as f64 * self.spacing_mm[a]))
    }

    /// Voxels of the box along i, j, k.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Voxel size in mm.
    pub fn spacing_mm(&self) -> [f64; 3] {
        self.spacing_mm
    }

    /// Extent of the box in mm.
    pub fn extent_mm(&self) -> [f64; 3] {
        std::array::from_fn(|a| (self.dims[a] - 1) as f64 * self.spacing_mm[a])
    }

    /// Label of every field; the first is the outside.
    pub fn labels(&self) -> &[u8] {
        &self.labels
    }

    /// The fields, those of a voxel side by side, i fastest.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// For every field, the first with the same label: the halves of a split label belong together.
    pub(crate) fn groups(&self) -> Vec<usize> {
        let first = |label: &u8| self.labels.iter().position(|l| l == label).unwrap_or(0);
        self.labels.iter().map(first).collect()
    }

    /// Number of the largest field at every voxel, i fastest.
    pub fn largest(&self) -> &[u8] {
        &self.largest
    }

    /// Whether voxels in or next to a box between two of its corners differ in their largest field.
    pub(crate) fn holds_interface(&self, low_mm: [f64; 3], high_mm: [f64; 3]) -> bool {
        let [nx, ny, _] = self.dims;
        let voxels = |a: usize| {
            let clip = |x: f64| x.clamp(0.0, (self.dims[a] - 1) as f64) as usize;
            clip((low_mm[a] / self.spacing_mm[a]).floor())..=clip((high_mm[a] / self.spacing_mm[a]).ceil())
        };
        let first = self.largest[*voxels(0).start() + nx * (*voxels(1).start() + ny * *voxels(2).start())];
        voxels(2).any(|k| {
            voxels(1).any(|j| {
                let row = nx * (j + ny * k);
                self.largest[row + *voxels(0).start()..=row + *voxels(0).end()].iter().any(|&l| l != first)
            })
        })
    }

    /// Box coordinates to the frame of the map.
    pub fn frame_from_box(&self) -> &Matrix4<f64> {
        &self.frame_from_box
    }

    /// The same fields with a constant added to each: interfaces move towards fields with less.
    pub(crate) fn shifted(&self, by: &[f64]) -> Self {
        let mut shifted = self.clone();
        each_voxel(&mut shifted.values, &mut shifted.largest, &|_, value| {
            value.iter_mut().zip(by).for_each(|(value, by)| *value += *by as f32);
        });
        shifted
    }

    /// Corner voxel and weights along the axes; `None` outside the box.
    #[inline]
    fn cell(&self, p: &Vector3<f64>) -> Option<(usize, [f64; 3])> {
        let mut base = [0usize; 3];
        let mut w = [0.0; 3];
        for a in 0..3 {
            let x = p[a] / self.spacing_mm[a];
            // Written so that NaN is outside.
            if !(x >= 0.0 && x < (self.dims[a] - 1) as f64) {
                return None;
            }
            base[a] = x as usize;
            w[a] = x - base[a] as f64;
        }
        Some((base[0] + self.dims[0] * (base[1] + self.dims[1] * base[2]), w))
    }

    #[inline]
    fn corners(&self, o: usize) -> [usize; 8] {
        let (sy, sz) = (self.dims[0], self.dims[0] * self.dims[1]);
        [o, o + 1, o + sy, o + sy + 1, o + sz, o + sz + 1, o + sz + sy, o + sz + sy + 1]
    }

    /// Number of the largest field at a point of the box; 0 outside the box.
    pub fn field_at(&self, p: &Vector3<f64>) -> u8 {
        let Some((o, w)) = self.cell(p) else { return 0 };
        let corners = self.corners(o);
        let first = self.largest[o];
        // A trilinear blend of fields that agree on the largest agrees too.
        if corners.iter().all(|&c| self.largest[c] == first) {
            return first;
        }
        let weights = trilinear_weights(w);
        let count = self.labels.len();
        let (mut best, mut best_value) = (0, f64::MIN);
        for k in 0..count {
            let value: f64 = (0..8).map(|c| weights[c] * f64::from(self.values[corners[c] * count + k])).sum();
            if value > best_value {
                (best, best_value) = (k as u8, value);
            }
        }
        best
    }

    /// Field `a` minus field `b` at a point; outside the box field 0 is one and the others zero.
    #[inline]
    pub fn difference(&self, a: u8, b: u8, p: &Vector3<f64>) -> f64 {
        let Some((o, w)) = self.cell(p) else {
            return f64::from(u8::from(a == 0)) - f64::from(u8::from(b == 0));
        };
        let (corners, weights, count) = (self.corners(o), trilinear_weights(w), self.labels.len());
        let (a, b) = (a as usize, b as usize);
        let at =
            |c: usize| f64::from(self.values[corners[c] * count + a]) - f64::from(self.values[corners[c] * count + b]);
        (0..8).map(|c| weights[c] * at(c)).sum()
    }
}

#[inline]
fn trilinear_weights(w: [f64; 3]) -> [f64; 8] {
    let v = w.map(|x| 1.0 - x);
    let low = [v[0] * v[1], w[0] * v[1], v[0] * w[1], w[0] * w[1]];
    [
        low[0] * v[2],
        low[1] * v[2],
        low[2] * v[2],
        low[3] * v[2],
        low[0] * w[2],
        low[1] * w[2],
        low[2] * w[2],
        low[3] * w[2],
    ]
}

/// Renews the fields of every voxel, which lie side by side, and which of them is largest.
fn each_voxel(values: &mut [f32], largest: &mut [u8], renew: &(dyn Fn(usize, &mut [f32]) + Sync)) {
    const AT_ONCE: usize = 4096;
    let count = values.len() / largest.len().max(1);
    let pieces = values.par_chunks_mut((count * AT_ONCE).max(1)).zip(largest.par_chunks_mut(AT_ONCE)).enumerate();
    pieces.for_each(|(piece, (values, largest))| {
        for (n, (value, best)) in values.chunks_mut(count).zip(largest).enumerate() {
            renew(piece * AT_ONCE + n, value);
            *best = argmax(value);
        }
    });
}

fn argmax(values: &[f32]) -> u8 {
    let mut best = 0;
    for k in 1..values.len() {
        if values[k] > values[best] {
            best = k;
        }
    }
    best as u8
}

/// First and last labelled voxel along every axis.
pub(crate) fn bounding_box<F: Frame>(map: &LabelMap<F>) -> Option<[[usize; 3]; 2]> {
    let (mut lo, mut hi) = ([usize::MAX; 3], [0usize; 3]);
    let [nx, ny, _] = map.grid.dims;
    for (row, voxels) in map.data.chunks(nx.max(1)).enumerate() {
        let Some(first) = voxels.iter().position(|&l| l != 0) else { continue };
        let last = voxels.iter().rposition(|&l| l != 0).unwrap_or(first);
        let at = [[first, row % ny, row / ny], [last, row % ny, row / ny]];
        for a in 0..3 {
            lo[a] = lo[a].min(at[0][a]);
            hi[a] = hi[a].max(at[1][a]);
        }
    }
    (lo[0] != usize::MAX).then_some([lo, hi])
}

/// Taps of a Gaussian, centre first, sum (both sides) one.
fn gaussian(sigma_voxels: f64) -> Vec<f32> {
    if sigma_voxels <= 0.0 {
        return vec![1.0];
    }
    let taps: Vec<f64> = (0..=PAD).map(|n| (-0.5 * (n as f64 / sigma_voxels).powi(2)).exp()).collect();
    let sum = taps[0] + 2.0 * taps[1..].iter().sum::<f64>();
    taps.iter().map(|t| (t / sum) as f32).collect()
}

/// 2 G(s) - G(2s) of the indicator of `label`. A plain Gaussian moves an interface of curvature k by k times the second
/// moment of the Gaussian's central slice, which takes percents of every gyrus. That moment grows with s, the weight of
/// the slice falls with 1/s: in this difference the shift cancels.
fn smooth_indicator(dense: &[u8], label: u8, dims: [usize; 3], sigma_voxels: f64) -> Vec<f32> {
    let mut sharp: Vec<f32> = dense.iter().map(|&l| f32::from(u8::from(l == label))).collect();
    let mut wide = sharp.clone();
    smooth_in_place(&mut sharp, dims, &gaussian(sigma_voxels));
    smooth_in_place(&mut wide, dims, &gaussian(2.0 * sigma_voxels));
    for (s, w) in sharp.iter_mut().zip(wide) {
        *s = 2.0 * *s - w;
    }
    sharp
}

fn smooth_in_place(field: &mut [f32], dims: [usize; 3], kernel: &[f32]) {
    let strides = [1, dims[0], dims[0] * dims[1]];
    let mut out = vec![0f32; field.len()];
    for a in 0..3 {
        let stride = strides[a];
        // Blocks of `stride * dims[a]` values: inside one, a step along the axis is `stride`.
        for (block, out) in field.chunks(stride * dims[a]).zip(out.chunks_mut(stride * dims[a])) {
            for (n, value) in out.iter_mut().enumerate() {
                *value = block[n] * kernel[0];
            }
            for (step, &tap) in kernel.iter().enumerate().skip(1) {
                let shift = step * stride;
                if shift >= block.len() {
                    continue;
                }
                // The pad is wider than the kernel, so what falls off the ends is zero.
                let reach = block.len() - shift;
                for n in 0..reach {
                    out[n] += tap * block[n + shift];
                    out[n + shift] += tap * block[n];
                }
            }
        }
        field.copy_from_slice(&out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    fn ball() -> LabelMap<Mni> {
        let grid = Grid::axis_aligned([24, 24, 24], [1.0; 3], [-12.0, 5.0, 7.0]);
        let data = (0..grid.len())
            .map(|n| {
                let r = grid.voxel(n).map(|c| c as f64 - 11.5).iter().map(|c| c * c).sum::<f64>().sqrt();
                if r < 5.0 { 3 } else { 2 * u8::from(r < 9.0) }
            })
            .collect();
        LabelMap::from_data(grid, data)
    }

    #[test]
    fn the_largest_field_repeats_the_label_map_away_from_edges() {
        let map = ball();
        let field = LabelField::new(&map, 0.7).unwrap();
        assert_eq!(field.labels(), [0, 2, 3]);
        let mut agree = 0;
        for n in 0..map.grid.len() {
            let v = map.grid.voxel(n).map(|c| c as f64);
            let mm = map.grid.position(v.into()).mm;
            let inverse = field.frame_from_box().try_inverse().unwrap();
            let in_box = inverse.transform_point(&mm).coords;
            agree += usize::from(field.labels()[field.field_at(&in_box) as usize] == map.data[n]);
        }
        assert!(agree as f64 > 0.98 * map.grid.len() as f64, "{agree} of {}", map.grid.len());
    }

    #[test]
    fn fields_sum_to_one_and_differences_are_antisymmetric() {
        let field = LabelField::new(&ball(), 0.7).unwrap();
        for value in field.values().chunks(3) {
            assert!((value.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        }
        let p = Vector3::new(8.3, 9.1, 12.6);
        assert!((field.difference(1, 2, &p) + field.difference(2, 1, &p)).abs() < 1e-12);
        assert!(field.difference(0, 1, &Vector3::new(-9.0, 0.0, 0.0)) > 0.99);
    }

    #[test]
    fn halves_of_a_label_meet_in_the_midplane_itself() {
        let map = ball();
        // The frame's x = 0 lies between voxels at a third of their distance when the origin is moved.
        let grid = Grid::axis_aligned([24, 24, 24], [1.0; 3], [-11.7, 5.0, 7.0]);
        let map = LabelMap::<Mni>::from_data(grid, map.data);
        let whole = LabelField::new(&map, 0.7).unwrap();
        let field = whole.clone().split_at_midplane(&[2, 3], &[]);
        assert_eq!((field.labels(), field.groups()), ([0, 2, 3, 2, 3].as_slice(), vec![0, 1, 2, 1, 2]));
        let crosses = |a, b| field.sheet().unwrap().crosses(a, b);
        assert!(crosses(1, 4) && crosses(3, 2) && !crosses(1, 2) && !crosses(0, 3));
        for n in 0..500 {
            let p = Vector3::new(f64::from(n % 23) * 0.9 + 2.0, f64::from(n % 19) + 2.3, f64::from(n % 17) + 3.1);
            let (k, before) = (field.field_at(&p), whole.field_at(&p));
            let x = field.sheet().unwrap().distance_mm(&p);
            if x.abs() > 1.0 {
                assert_eq!(field.labels()[k as usize], whole.labels()[before as usize], "{p}");
            }
            if k != 0 && x.abs() > 1e-6 {
                assert_eq!(k >= 3, x > 0.0, "{p}");
            }
        }
    }

    #[test]
    fn a_map_without_labels_has_no_fields() {
        let grid = Grid::<Mni>::axis_aligned([3, 3, 3], [1.0; 3], [0.0; 3]);
        assert!(LabelField::new(&LabelMap::filled(grid, 0), 0.7).is_none());
    }
}
