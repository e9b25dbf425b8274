//! Moving vertices to raise the mean radius ratio, where raising the worst has nothing more to say.

use super::complex::{Complex, Point, THIN, quality, shape, thickness};
use super::smooth::quadric;
use crate::mesh::TET_FACES;

/// A vertex of an interface may leave the plane of its facets by this share of the way it moves.
const TANGENT: f64 = 0.02;

/// One sweep: every vertex goes towards the mean of the places where each tet around it would have its opposite face's
/// regular tet, as far as the sum of radius ratios rises and none falls below the smaller of `floor` and what it was.
/// Vertices of interfaces go along them, or stay when `inner` ones alone may move; those of curves, where facets of several
/// planes meet, stay.
pub(crate) fn sweep(complex: &mut Complex, floor: f64, inner: bool) {
    let fields = complex.all_fields();
    for v in 0..complex.x.len() as u32 {
        let mask = fields[v as usize];
        if mask <= 1 || mask.count_ones() > if inner { 1 } else { 2 } {
            continue;
        }
        let start = complex.x[v as usize];
        let mut faces: Vec<[Point; 3]> = Vec::new();
        let mut air: Vec<([Point; 3], f64)> = Vec::new();
        for &t in &complex.star[v as usize] {
            let tet = complex.tets[t as usize];
            let corner = tet.iter().position(|&w| w == v).unwrap_or(0);
            let face = TET_FACES[corner].map(|c| complex.x[tet[c] as usize]);
            if complex.is_solid(t) {
                faces.push(face);
            } else {
                air.push((face, thickness(&start, &face[0], &face[1], &face[2]).min(THIN)));
            }
        }
        let measure = |x: &Point, least: f64| {
            let (mut sum, mut worst) = (0.0, f64::MAX);
            for [a, b, c] in &faces {
                worst = worst.min(quality(x, a, b, c));
                if worst < least {
                    return None;
                }
                sum += shape(x, a, b, c)[1];
            }
            air.iter().all(|([a, b, c], least)| thickness(x, a, b, c) >= *least).then_some((sum, worst))
        };
        let Some((sum, worst)) = measure(&start, f64::MIN) else { continue };
        let mut goal = Point::zeros();
        for [a, b, c] in &faces {
            let normal = (b - a).cross(&(c - a));
            let length = normal.norm().max(f64::MIN_POSITIVE);
            // Height of the regular tet over a face of this area: (2/3 * 4/3^(1/2) * length/2)^(1/2); the normal points
            // away from the vertex.
            goal += (a + b + c) / 3.0 - normal * (0.877_382_675 / length.sqrt());
        }
        let mut step = goal / faces.len() as f64 - start;
        if mask.count_ones() == 2 {
            let plane = quadric(complex, v).symmetric_eigen();
            let flat = plane.eigenvalues.iter().enumerate().filter(|(_, e)| **e < TANGENT);
            step = flat.map(|(n, _)| plane.eigenvectors.column(n) * plane.eigenvectors.column(n).dot(&step)).sum();
        }
        let step = complex.allowed(v, step);
        for share in [1.0, 0.5, 0.2] {
            let x = start + step * share;
            if measure(&x, worst.min(floor)).is_some_and(|(s, _)| s > sum) {
                complex.x[v as usize] = x;
                break;
            }
        }
    }
}
