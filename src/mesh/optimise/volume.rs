//! The last half percent: volumes of labels as the label map has them.
//!
//! Smoothing a label map and meshing it with tets that cannot follow every fold both shift interfaces by a hundredth of a
//! millimetre or two, the same way all over. A constant added to each field undoes that.

use super::complex::Complex;
use super::fit;
use crate::mesh::label_field::LabelField;
use nalgebra::{DMatrix, DVector};

/// Slope of the difference of two fields across their interface, per voxel: what [`LabelField`]'s kernel gives for a flat one.
const SLOPE_PER_VOXEL: f64 = 1.7;
/// Interfaces are shifted by at most this many voxels: more would be another segmentation.
const MOST_VOXELS: f64 = 0.15;
const ROUNDS: usize = 2;
const SWEEPS: usize = 2;

/// Fits interfaces to the fields plus constants, one per label, such that the fields with the label of field k together fill
/// `wanted_mm3[k]` (the first entry, of the outside, is not looked at). Tets keep the smaller of `floor` and their quality.
pub(crate) fn match_volumes(complex: &mut Complex, field: &LabelField, wanted_mm3: &[f64], floor: f64) {
    let voxel_mm = field.spacing_mm().iter().product::<f64>().cbrt();
    let count = wanted_mm3.len();
    let group = field.groups();
    let mut shift_mm = vec![0.0; count];
    for _ in 0..ROUNDS {
        let mut missing_mm3 =
            DVector::from_fn(count - 1, |k, _| if group[k + 1] == k + 1 { wanted_mm3[k + 1] } else { 0.0 });
        for t in complex.solid() {
            let [a, b, c, d] = complex.points(&complex.tets[t as usize]);
            missing_mm3[group[complex.field[t as usize] as usize] - 1] -= (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0;
        }
        // Volume of field k grows by the area it shares with field j times the difference of their shifts.
        let mut area_mm2 = DMatrix::zeros(count - 1, count - 1);
        for facet in complex.interface_facets() {
            let [a, b, c] = facet.corners.map(|v| complex.x[v as usize]);
            let area = 0.5 * (b - a).cross(&(c - a)).norm();
            let (k, j) = (group[facet.below as usize], group[facet.above as usize]);
            if k == j {
                continue;
            }
            for (own, other) in [(k, j), (j, k)] {
                if own > 0 {
                    area_mm2[(own - 1, own - 1)] += area;
                    if other > 0 {
                        area_mm2[(own - 1, other - 1)] -= area;
                    }
                }
            }
        }
        // A label that lost all its tets has no facet, and a second half no row: they must not make the rest unsolvable.
        for k in 0..count - 1 {
            if area_mm2[(k, k)] == 0.0 {
                area_mm2[(k, k)] = 1.0;
            }
        }
        let Some(step_mm) = area_mm2.lu().solve(&missing_mm3) else { return };
        for k in 1..count {
            shift_mm[k] = (shift_mm[k] + step_mm[group[k] - 1]).clamp(-MOST_VOXELS * voxel_mm, MOST_VOXELS * voxel_mm);
        }
        let by: Vec<f64> = shift_mm.iter().map(|s| s / voxel_mm * SLOPE_PER_VOXEL).collect();
        let shifted = field.shifted(&by);
        for _ in 0..SWEEPS {
            fit::sweep(complex, &shifted, floor);
        }
    }
}
