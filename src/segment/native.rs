//! Labels and masks from one grid to another without stairs.

use crate::geometry::{Frame, RigidTransform};
use crate::image::pieces::each_piece;
use crate::image::{Grid, LabelMap, Mask, Volume};
use nalgebra::{Matrix4, Point3};

/// Highest label that is carried over.
const LABELS: usize = 8;

/// The label with the largest trilinear weight at each voxel of `target` (the smaller of equals), 0 outside the source.
pub fn labels_on<S: Frame, T: Frame>(
    source: &LabelMap<S>,
    target: &Grid<T>,
    source_from_target: &RigidTransform<T, S>,
) -> LabelMap<T> {
    let mut out = Volume::filled(*target, 0u8);
    carried(source, target, source_from_target, &mut out, |corners| {
        let mut weights = [0.0f64; LABELS];
        for &(value, weight) in corners {
            weights[usize::from(value).min(LABELS - 1)] += weight;
        }
        let mut best = 0;
        for l in 1..LABELS {
            if weights[l] > weights[best] {
                best = l;
            }
        }
        best as u8
    });
    out
}

/// Where the trilinear weight of the inside is at least one half at each voxel of `target`; outside the source is outside.
pub fn mask_on<S: Frame, T: Frame>(
    source: &Mask<S>,
    target: &Grid<T>,
    source_from_target: &RigidTransform<T, S>,
) -> Mask<T> {
    let mut out = Volume::filled(*target, false);
    carried(source, target, source_from_target, &mut out, |corners| {
        corners.iter().filter(|c| c.0).map(|c| c.1).sum::<f64>() >= 0.5
    });
    out
}

/// What `value_of` makes of the values and weights of the eight corners around each voxel of `target`, or their value where
/// they have but one.
fn carried<V: Copy + Default + PartialEq + Send + Sync, S: Frame, T: Frame>(
    source: &Volume<V, S>,
    target: &Grid<T>,
    source_from_target: &RigidTransform<T, S>,
    out: &mut Volume<V, T>,
    value_of: impl Fn(&[(V, f64); 8]) -> V + Sync,
) {
    let m: Matrix4<f64> = source.grid.voxel_from_mm() * source_from_target.to_matrix() * target.mm_from_voxel;
    let [nx, ny, _] = target.dims;
    let dims = source.grid.dims;
    // Further than a voxel from everything that is labelled there is nothing, as `out` holds it.
    let Some(labelled) = source.map(|value| value != V::default()).bounding_box() else { return };
    let (first, end) = (labelled.first.map(|v| v as f64 - 1.0), labelled.end.map(|v| v as f64));
    let plane = (nx * ny).max(1);
    each_piece(&mut out.data, plane, &|start, values| {
        let k = start / plane;
        for (n, value) in values.iter_mut().enumerate() {
            let p = m.transform_point(&Point3::new((n % nx) as f64, (n / nx) as f64, k as f64));
            let c = [p.x, p.y, p.z];
            // Half a voxel beyond the outermost centres still belongs to the outermost voxels.
            if (0..3).any(|a| !(c[a] >= first[a].max(-0.5) && c[a] <= end[a].min(dims[a] as f64 - 0.5))) {
                continue;
            }
            let (mut low, mut high, mut w) = ([0; 3], [0; 3], [0.0; 3]);
            for a in 0..3 {
                let x = c[a].clamp(0.0, dims[a] as f64 - 1.0);
                low[a] = x.floor() as usize;
                high[a] = (low[a] + 1).min(dims[a] - 1);
                w[a] = x - x.floor();
            }
            let at = |bits: usize| {
                let pick = |a: usize| if bits >> a & 1 == 1 { high[a] } else { low[a] };
                source.at(pick(0), pick(1), pick(2))
            };
            let first = at(0);
            if (1..8).all(|bits| at(bits) == first) {
                *value = first;
                continue;
            }
            let corner = |bits: usize| {
                let pick = |a: usize| if bits >> a & 1 == 1 { (high[a], w[a]) } else { (low[a], 1.0 - w[a]) };
                let (x, y, z) = (pick(0), pick(1), pick(2));
                (source.at(x.0, y.0, z.0), x.1 * y.1 * z.1)
            };
            *value = value_of(&[0, 1, 2, 3, 4, 5, 6, 7].map(corner));
        }
    });
}
