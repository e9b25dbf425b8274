//! Exact Euclidean distance on the voxel grid.
//!
//! Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", Theory of Computing 8 (2012): the squared
//! distance is separable, and along a line it is the lower envelope of parabolas. Spacing may differ per axis; the
//! grid's axes are taken as perpendicular (they are, unless an affine shears).

use super::pieces::each_piece;
use super::volume::{Mask, Volume};
use crate::geometry::Frame;

/// Values per task where every value is by itself.
const AT_ONCE: usize = 1 << 16;

/// Distance in mm from each voxel centre to the nearest voxel centre inside the mask: 0 inside, infinite everywhere
/// when the mask is empty.
#[must_use]
pub fn distance_mm<F: Frame>(mask: &Mask<F>) -> Volume<f32, F> {
    let mut volume = squared_distance_mm2(mask, true);
    each_piece(&mut volume.data, AT_ONCE, &|_, piece| piece.iter_mut().for_each(|d| *d = d.sqrt()));
    volume
}

/// Signed distance in mm, negative inside. Zero lies half a voxel between an inside and an outside centre along the
/// axes, so the value is the distance to the mask's surface to within that half voxel. All `+inf` for an empty mask,
/// all `-inf` for a full one.
#[must_use]
pub fn signed_distance_mm<F: Frame>(mask: &Mask<F>) -> Volume<f32, F> {
    let spacing_mm = mask.grid.spacing_mm();
    let half = (0.5 * spacing_mm.iter().copied().fold(f64::INFINITY, f64::min)) as f32;
    let mut signed = squared_distance_mm2(mask, true);
    each_piece(&mut signed.data, AT_ONCE, &|_, piece| {
        for d in piece {
            *d = if *d > 0.0 { d.sqrt() - half } else { *d };
        }
    });
    let Some(around) = mask.bounding_box() else { return signed };
    // The nearest voxel outside lies in the box or in the layer around it.
    let around = around.grown(&mask.grid, 1e-3 * f64::from(half));
    let mut part = signed.cropped(&around);
    let inward = squared_distance_mm2(&mask.cropped(&around), false);
    each_piece(&mut part.data, AT_ONCE, &|first, out| {
        for (o, i) in out.iter_mut().zip(&inward.data[first..]) {
            *o = if *i > 0.0 { half - i.sqrt() } else { *o };
        }
    });
    signed.paste(&part, &around);
    signed
}

/// Squared distance in mm2 to the nearest voxel whose value is `seed`.
pub(super) fn squared_distance_mm2<F: Frame>(mask: &Mask<F>, seed: bool) -> Volume<f32, F> {
    let [nx, ny, nz] = mask.grid.dims;
    let h = mask.grid.spacing_mm();
    let mut data = vec![0f32; mask.data.len()];
    if data.is_empty() {
        return Volume::from_data(mask.grid, data);
    }
    each_piece(&mut data, nx * ny, &|first, plane| {
        let inside = &mask.data[first..][..nx * ny];
        for (row, inside) in plane.chunks_exact_mut(nx).zip(inside.chunks_exact(nx)) {
            row_distance(row, inside, seed, h[0]);
        }
        if ny > 1 {
            let mut envelope = Envelope::new(ny);
            let mut columns = vec![0f32; ny * LANES];
            for first in (0..nx).step_by(LANES) {
                let lanes = LANES.min(nx - first);
                for j in 0..ny {
                    for l in 0..lanes {
                        columns[l * ny + j] = plane[j * nx + first + l];
                    }
                }
                for column in columns.chunks_exact_mut(ny).take(lanes) {
                    envelope.transform(column, h[1]);
                }
                for j in 0..ny {
                    for l in 0..lanes {
                        plane[j * nx + first + l] = columns[l * ny + j];
                    }
                }
            }
        }
    });
    if nz > 1 {
        // Lines along k made contiguous, one plane of j per task, then turned back.
        let mut lines = vec![0f32; data.len()];
        each_piece(&mut lines, nx * nz, &|first, lines| {
            let j = first / (nx * nz);
            let mut envelope = Envelope::new(nz);
            for first in (0..nx).step_by(LANES) {
                let lanes = LANES.min(nx - first);
                for k in 0..nz {
                    let row = &data[(k * ny + j) * nx + first..][..lanes];
                    for (l, &d) in row.iter().enumerate() {
                        lines[(first + l) * nz + k] = d;
                    }
                }
                for line in lines[first * nz..].chunks_exact_mut(nz).take(lanes) {
                    envelope.transform(line, h[2]);
                }
            }
        });
        each_piece(&mut data, nx * ny, &|first, plane| {
            let k = first / (nx * ny);
            for (j, row) in plane.chunks_exact_mut(nx).enumerate() {
                for (i, d) in row.iter_mut().enumerate() {
                    *d = lines[(j * nx + i) * nz + k];
                }
            }
        });
    }
    Volume::from_data(mask.grid, data)
}

/// Neighbouring lines gathered together, so that a strided read uses the whole cache line.
const LANES: usize = 16;

/// Squared distance along a row, mm2.
pub(super) fn row_distance(row: &mut [f32], inside: &[bool], seed: bool, spacing_mm: f64) {
    let n = row.len();
    let mut last = None;
    for i in 0..n {
        if inside[i] == seed {
            last = Some(i);
        }
        row[i] = last.map_or(f32::INFINITY, |seed| (i - seed) as f32);
    }
    let mut next = None;
    for i in (0..n).rev() {
        if inside[i] == seed {
            next = Some(i);
        }
        let steps = next.map_or(row[i], |seed: usize| row[i].min((seed - i) as f32));
        row[i] = (f64::from(steps) * spacing_mm).powi(2) as f32;
    }
}

/// Lower envelope of the parabolas `f(q) + h^2 (p - q)^2` along one line.
struct Envelope {
    /// Places of the parabolas of the envelope.
    vertex: Vec<usize>,
    /// Their heights over h^2.
    height: Vec<f64>,
    /// Where each parabola's part of the envelope begins.
    begin: Vec<f64>,
}

impl Envelope {
    fn new(n: usize) -> Self {
        Self { vertex: vec![0; n], height: vec![0.0; n], begin: vec![0.0; n] }
    }

    fn transform(&mut self, line: &mut [f32], spacing_mm: f64) {
        if line.iter().all(|&f| f == 0.0) {
            return;
        }
        let h2 = spacing_mm * spacing_mm;
        let mut count = 0;
        for (q, &f) in line.iter().enumerate() {
            if f == f32::INFINITY {
                continue;
            }
            let (q_mm, f) = (q as f64, f64::from(f) / h2);
            let mut begin = f64::NEG_INFINITY;
            while count > 0 {
                let v = self.vertex[count - 1] as f64;
                begin = 0.5 * ((f - self.height[count - 1]) / (q_mm - v) + q_mm + v);
                if begin > self.begin[count - 1] {
                    break;
                }
                count -= 1;
                begin = f64::NEG_INFINITY;
            }
            (self.vertex[count], self.height[count], self.begin[count]) = (q, f, begin);
            count += 1;
        }
        if count == 0 {
            return;
        }
        let mut part = 0;
        for (p, out) in line.iter_mut().enumerate() {
            while part + 1 < count && self.begin[part + 1] < p as f64 {
                part += 1;
            }
            let step = p as f64 - self.vertex[part] as f64;
            *out = (h2 * (step * step + self.height[part])) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;
    use proptest::prelude::*;

    fn brute_force(mask: &Mask<Pre>, seed: bool) -> Vec<f32> {
        let seeds: Vec<_> = (0..mask.grid.len()).filter(|&n| mask.data[n] == seed).collect();
        let h = mask.grid.spacing_mm();
        let squared = |a: usize, b: usize| -> f64 {
            let (a, b) = (mask.grid.voxel(a), mask.grid.voxel(b));
            (0..3).map(|d| ((a[d] as f64 - b[d] as f64) * h[d]).powi(2)).sum()
        };
        (0..mask.grid.len())
            .map(|n| seeds.iter().map(|&s| squared(n, s)).fold(f64::INFINITY, f64::min).sqrt() as f32)
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn distance_is_the_brute_force_minimum(
            data in proptest::collection::vec(prop::bool::weighted(0.04), 7 * 6 * 9),
            spacing in [0.5f64..3.0, 0.5..3.0, 0.5..3.0],
        ) {
            let mask = Mask::from_data(Grid::<Pre>::axis_aligned([7, 6, 9], spacing, [0.0; 3]), data);
            for (d, b) in distance_mm(&mask).data.iter().zip(brute_force(&mask, true)) {
                prop_assert!(*d == b || (d - b).abs() < 1e-4, "{d} {b}");
            }
        }
    }

    #[test]
    fn signed_distance_changes_sign_at_the_surface() {
        let grid = Grid::<Pre>::axis_aligned([41, 41, 41], [1.0; 3], [-20.0; 3]);
        let ball = Mask::from_data(
            grid,
            (0..grid.len())
                .map(|n| grid.voxel(n).iter().map(|&v| (v as f64 - 20.0).powi(2)).sum::<f64>() <= 100.0)
                .collect(),
        );
        let signed = signed_distance_mm(&ball);
        for (n, &d) in signed.data.iter().enumerate() {
            assert_eq!(d < 0.0, ball.data[n]);
            let r = grid.voxel(n).iter().map(|&v| (v as f64 - 20.0).powi(2)).sum::<f64>().sqrt();
            assert!((f64::from(d) - (r - 10.0)).abs() < 1.0, "{d} at {r}");
        }
        assert!(distance_mm(&ball.map(|_| false)).data.iter().all(|&d| d == f32::INFINITY));
    }
}
