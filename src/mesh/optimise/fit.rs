//! Interfaces fitted to the label fields in the least-squares sense.
//!
//! Vertices *on* a curved interface leave the flat facets inside it: convex regions shrink, narrow ones vanish. Here every
//! interface facet is sampled at quadrature points, the distance from each to the true interface along the facet's
//! normal is found by marching, and the vertices move so that the sum of squared distances falls: facets straddle the
//! interface, which keeps volumes and halves the misclassified layer.

use super::complex::{Complex, InterfaceFacet, Point};
use super::smooth::move_guarded;
use crate::mesh::label_field::LabelField;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Degree-4 quadrature of a triangle (Dunavant 1985): barycentric coordinates and weights.
const QUADRATURE: [([f64; 3], f64); 6] = {
    const A: f64 = 0.445948490915965;
    const B: f64 = 0.091576213509771;
    const WA: f64 = 0.223381589678011;
    const WB: f64 = 0.109951743655322;
    [
        ([A, A, 1.0 - 2.0 * A], WA),
        ([A, 1.0 - 2.0 * A, A], WA),
        ([1.0 - 2.0 * A, A, A], WA),
        ([B, B, 1.0 - 2.0 * B], WB),
        ([B, 1.0 - 2.0 * B, B], WB),
        ([1.0 - 2.0 * B, B, B], WB),
    ]
};

/// Distance from `p` along the unit vector `n` (from field `below` to field `above`) to where the two fields are equal;
/// `None` when that is further than `reach`.
pub(crate) fn distance_along(
    field: &LabelField,
    below: u8,
    above: u8,
    p: &Point,
    n: &Point,
    reach: f64,
    step: f64,
) -> Option<f64> {
    let value = |t: f64| field.difference(below, above, &(p + n * t));
    let here = value(0.0);
    if here == 0.0 {
        return None;
    }
    // Positive: still below, so the interface lies ahead.
    let direction = here.signum();
    let (mut t0, mut v0) = (0.0, here);
    while t0 < reach {
        let t1 = t0 + step;
        let v1 = value(direction * t1);
        if v1 * here <= 0.0 {
            // The fields are trilinear: two secant steps are within a hundredth of a voxel.
            let mut t = t0 + step * v0 / (v0 - v1);
            let v = value(direction * t);
            t = if v * here > 0.0 { t + (t1 - t) * v / (v - v1) } else { t0 + (t - t0) * v0 / (v0 - v) };
            return t.is_finite().then_some(direction * t);
        }
        (t0, v0) = (t1, v1);
    }
    None
}

/// One facet's pull on its three corners: weighted normal matrix share and right-hand side per corner.
#[derive(Clone, Copy)]
struct Pull {
    normal: Point,
    weight: [f64; 3],
    moment: [f64; 3],
}

fn pull(complex: &Complex, field: &LabelField, facet: &InterfaceFacet, step: f64) -> Pull {
    let [a, b, c] = facet.corners.map(|v| complex.x[v as usize]);
    let area_vector = (b - a).cross(&(c - a)) * 0.5;
    let area = area_vector.norm().max(f64::MIN_POSITIVE);
    let normal = area_vector / area;
    let reach = area.sqrt().max(2.0 * step);
    let mut pull = Pull { normal, weight: [0.0; 3], moment: [0.0; 3] };
    for (l, w) in QUADRATURE {
        let p = a * l[0] + b * l[1] + c * l[2];
        if let Some(distance) = distance_along(field, facet.below, facet.above, &p, &normal, reach, step) {
            for n in 0..3 {
                pull.weight[n] += area * w * l[n];
                pull.moment[n] += area * w * l[n] * distance;
            }
        }
    }
    pull
}

/// One sweep: every interface vertex moves to its lumped least-squares place, as far as the quality `floor` lets it.
/// Returns the root mean square of the wanted moves in mm.
pub(crate) fn sweep(complex: &mut Complex, field: &LabelField, floor: f64) -> f64 {
    let mut facets = complex.interface_facets();
    facets.retain(|f| !complex.is_loose(f.below, f.above, f.corners));
    let step = 0.6 * field.spacing_mm().into_iter().fold(f64::MAX, f64::min);
    let pulls: Vec<Pull> = facets.par_iter().map(|f| pull(complex, field, f, step)).collect();
    let mut system = vec![(Matrix3::<f64>::zeros(), Point::zeros(), 0.0f64); complex.x.len()];
    for (facet, pull) in facets.iter().zip(&pulls) {
        for n in 0..3 {
            let (matrix, moment, weight) = &mut system[facet.corners[n] as usize];
            *matrix += pull.normal * pull.normal.transpose() * pull.weight[n];
            *moment += pull.normal * pull.moment[n];
            *weight += pull.weight[n];
        }
    }
    let (mut sum, mut count) = (0.0, 0);
    for v in 0..system.len() {
        let (matrix, moment, weight) = system[v];
        if weight <= 0.0 {
            continue;
        }
        // The small diagonal keeps the vertex from sliding where its facets are coplanar.
        let Some(inverse) = (matrix + Matrix3::identity() * (0.05 * weight)).try_inverse() else { continue };
        let step = complex.allowed(v as u32, inverse * moment);
        let goal = complex.x[v] + step;
        sum += step.norm_squared();
        count += 1;
        move_guarded(complex, v as u32, &goal, floor);
    }
    (sum / f64::from(count.max(1))).sqrt()
}
