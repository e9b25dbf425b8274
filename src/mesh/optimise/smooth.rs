//! Moving a vertex to raise the worst quality around it.

use super::complex::{Complex, Point, THIN, quality, thickness};
use super::flip::interface_normals;
use nalgebra::{Matrix3, Vector3};

/// How strongly leaving the interface counts against quality: a normal shift of a tenth of the edge length costs
/// `INTERFACE_WEIGHT / 100`.
const INTERFACE_WEIGHT: f64 = 6.0;

const DIRECTIONS: [[f64; 3]; 14] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [0.577, 0.577, 0.577],
    [-0.577, -0.577, -0.577],
    [0.577, 0.577, -0.577],
    [-0.577, -0.577, 0.577],
    [0.577, -0.577, 0.577],
    [-0.577, 0.577, -0.577],
    [-0.577, 0.577, 0.577],
    [0.577, -0.577, -0.577],
];

/// The link of a vertex, oriented so that a tet is (vertex, p, q, r).
struct Link {
    /// Faces of the mesh's tets.
    faces: Vec<[Point; 3]>,
    /// Faces of tets outside and the thickness that these keep at least: that of today or [`THIN`].
    air: Vec<([Point; 3], f64)>,
}

impl Link {
    fn of(complex: &Complex, v: u32) -> Self {
        let x = complex.x[v as usize];
        let mut faces: Vec<(f64, [Point; 3])> = Vec::with_capacity(complex.star[v as usize].len());
        let mut air = Vec::new();
        for &t in &complex.star[v as usize] {
            let tet = complex.tets[t as usize];
            let corner = tet.iter().position(|&w| w == v).unwrap_or(0);
            // The face opposite corner c, seen from outside, is turned around for (v, p, q, r).
            let face = crate::mesh::TET_FACES[corner].map(|c| complex.x[tet[c] as usize]);
            if complex.is_solid(t) {
                faces.push((quality(&x, &face[0], &face[1], &face[2]), face));
            } else {
                air.push((face, thickness(&x, &face[0], &face[1], &face[2]).min(THIN)));
            }
        }
        // Worst first, so that a bad candidate is refused early.
        faces.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { faces: faces.into_iter().map(|f| f.1).collect(), air }
    }

    /// Worst quality with the vertex at `p`, or some value not above `enough` when it is not above or a tet outside gets
    /// too thin.
    fn quality(&self, p: &Point, enough: f64) -> f64 {
        let mut worst = f64::MAX;
        for [a, b, c] in &self.faces {
            worst = worst.min(quality(p, a, b, c));
            if worst <= enough {
                return worst;
            }
        }
        let crushed = |([a, b, c], least): &([Point; 3], f64)| thickness(p, a, b, c) < *least;
        if self.air.iter().any(crushed) { enough.min(-1.0) } else { worst }
    }
}

/// Sum of n n^T A over the interface facets at a vertex, divided by the area: squared normal shift per squared shift.
pub(super) fn quadric(complex: &Complex, v: u32) -> Matrix3<f64> {
    let (mut sum, mut area) = (Matrix3::zeros(), 0.0);
    for (normal, _) in interface_normals(complex, v) {
        let a = normal.norm().max(f64::MIN_POSITIVE);
        sum += normal * normal.transpose() / a;
        area += a;
    }
    sum / area.max(f64::MIN_POSITIVE)
}

/// Pattern search for a better place; interface vertices (`on_interface`) slide along their facets. Returns whether it
/// moved. The worst quality around the vertex never falls.
pub(crate) fn improve_position(complex: &mut Complex, v: u32, on_interface: bool) -> bool {
    let start = complex.x[v as usize];
    let link = Link::of(complex, v);
    if link.faces.is_empty() {
        return false;
    }
    let edge = link.faces.iter().map(|f| (f[0] - start).norm()).sum::<f64>() / link.faces.len() as f64;
    let stay = if on_interface { quadric(complex, v) * (INTERFACE_WEIGHT / (edge * edge)) } else { Matrix3::zeros() };
    let penalty = |p: &Point| {
        let step: Vector3<f64> = p - start;
        step.dot(&(stay * step))
    };
    let mut at = start;
    let mut score = link.quality(&start, f64::MIN);
    let initial = score;
    if !on_interface {
        let centre = link.faces.iter().flatten().sum::<Point>() / (3 * link.faces.len()) as f64;
        let quality = link.quality(&centre, score);
        if quality > score {
            (at, score) = (centre, quality);
        }
    }
    let mut step = 0.16 * edge;
    for _ in 0..5 {
        let mut moved = true;
        let mut turns = 0;
        while moved && turns < 3 {
            moved = false;
            turns += 1;
            for direction in DIRECTIONS {
                let candidate = at + complex.allowed(v, Vector3::from(direction) * step);
                let cost = penalty(&candidate);
                let quality = link.quality(&candidate, score + cost) - cost;
                if quality > score + 1e-6 {
                    (at, score) = (candidate, quality);
                    moved = true;
                }
            }
        }
        step *= 0.5;
    }
    let better = score > initial + 1e-5;
    if better {
        complex.x[v as usize] = at;
    }
    better
}

/// Moves a vertex towards `goal` as far as the worst quality around it stays at or above the smaller of `floor` and
/// what it is now. Returns the share of the way that it went.
pub(crate) fn move_guarded(complex: &mut Complex, v: u32, goal: &Point, floor: f64) -> f64 {
    let start = complex.x[v as usize];
    let link = Link::of(complex, v);
    let limit = link.quality(&start, f64::MIN).min(floor) - 1e-12;
    for share in [1.0, 0.6, 0.3, 0.1] {
        let candidate = start + (goal - start) * share;
        if link.quality(&candidate, limit) > limit {
            complex.x[v as usize] = candidate;
            return share;
        }
    }
    0.0
}
