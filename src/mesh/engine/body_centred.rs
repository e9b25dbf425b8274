//! A graded body-centred lattice (see [`octree`](super::octree)) whose vertices snap to the label interfaces.
//!
//! The lattice is coarse where no interface is near. Wherever an edge joins two fields, its nearer end
//! moves to the interface (as in isosurface stuffing, Labelle and Shewchuk 2007, and its multi-material sibling,
//! lattice cleaving, Bronson et al. 2012, but without cutting: the quality pass does what their stencils do, at a third
//! of the tets). A tet then takes the label that fills most of it. Conforming by construction.

use super::octree::Octree;
use super::sizing::EdgeField;
use crate::mesh::label_field::LabelField;
use crate::mesh::optimise::{Complex, Point, min_sine};
use rayon::prelude::*;

/// Lattice tets with corner numbers into a list of points.
struct Lattice {
    x: Vec<Point>,
    tets: Vec<[u32; 4]>,
}

/// Levels by which leaves without an interface may be coarser than asked.
const INSIDE: u8 = 1;
/// Cube edge of the lattice whose tets have the volume that the edge asks for: (12 * TET_SHARE)^(1/3).
const CUBE_PER_EDGE: f64 = 1.268;

/// The octree over the box, its finest cell's edge and its origin. Leaves have the size asked for to the nearest power of two.
fn octree(field: &LabelField, edge: &EdgeField) -> (Octree, f64, [f64; 3]) {
    let cube_mm = CUBE_PER_EDGE * edge.target_mm;
    let [least, most] = edge.range_mm().map(|e| (e / edge.target_mm).log2());
    let below = (-least - 0.5).ceil().max(0.0) as u8;
    let top = below + (most + 0.5).floor().max(0.0) as u8 + INSIDE;
    let finest_mm = cube_mm / f64::from(1u32 << below);
    let extent = field.extent_mm();
    // The lattice is centred on the box and overhangs it by about two cubes.
    let cubes: [usize; 3] = std::array::from_fn(|a| (extent[a] / cube_mm).ceil() as usize + 4);
    let origin: [f64; 3] = std::array::from_fn(|a| 0.5 * (extent[a] - cubes[a] as f64 * cube_mm));
    let cells = cubes.map(|n| (n << below).next_multiple_of(1 << top));
    let tree = Octree::new(cells, top, |low, level| {
        let low_mm: [f64; 3] = std::array::from_fn(|a| origin[a] + low[a] as f64 * finest_mm);
        let high_mm = low_mm.map(|x| x + f64::from(1u32 << level) * finest_mm);
        let asked = (CUBE_PER_EDGE * edge.least_mm(low_mm, high_mm) / finest_mm).log2().round().max(0.0) as u8;
        level <= asked || (level <= asked + INSIDE && !field.holds_interface(low_mm, high_mm))
    });
    (tree, finest_mm, origin)
}

/// All tets of the lattice that touch a labelled part of the box, and those around them.
fn lattice(field: &LabelField, edge: &EdgeField) -> Lattice {
    let (tree, finest_mm, origin) = octree(field, edge);
    let (x, mut tets) = tree.tets();
    let x: Vec<Point> = x.iter().map(|p| Point::from(origin) + Point::from(*p) * finest_mm).collect();
    // What touches a labelled vertex, and one layer more: every vertex that may snap then has all its tets.
    let mut near: Vec<bool> = x.par_iter().map(|p| field.field_at(p) != 0).collect();
    for _ in 0..2 {
        let before = near.clone();
        for tet in &tets {
            if tet.iter().any(|&v| before[v as usize]) {
                for &v in tet {
                    near[v as usize] = true;
                }
            }
        }
    }
    tets.retain(|tet| tet.iter().all(|&v| near[v as usize]));
    Lattice { x, tets }
}

/// Where the label changes first along an edge, as a share of its length.
fn cut(field: &LabelField, from: &Point, to: &Point, label: u8) -> f64 {
    let (mut near, mut far) = (0.0, 1.0);
    for _ in 0..8 {
        let middle = 0.5 * (near + far);
        if field.field_at(&(from + (to - from) * middle)) == label {
            near = middle;
        } else {
            far = middle;
        }
    }
    0.5 * (near + far)
}

/// Barycentric sample points of a tet: 4-fold symmetric, weights equal.
const SAMPLES: [[f64; 4]; 11] = {
    const A: f64 = 0.7;
    const B: f64 = 0.1;
    const C: f64 = 0.4;
    [
        [0.25; 4],
        [A, B, B, B],
        [B, A, B, B],
        [B, B, A, B],
        [B, B, B, A],
        [C, C, B, B],
        [C, B, C, B],
        [C, B, B, C],
        [B, C, C, B],
        [B, C, B, C],
        [B, B, C, C],
    ]
};

/// The field that fills most of a tet.
pub(crate) fn majority(field: &LabelField, corners: &[Point; 4]) -> u8 {
    let mut votes = [0u8; 64];
    for weights in SAMPLES {
        let p = (0..4).map(|n| corners[n] * weights[n]).sum::<Point>();
        votes[field.field_at(&p) as usize & 63] += 1;
    }
    (0..64).max_by_key(|&k| (votes[k], 64 - k)).unwrap_or(0) as u8
}

/// A snapped vertex may not leave a tet with a smaller dihedral sine than this.
const SNAP_FLOOR: f64 = 0.15;

/// Meshes every field but the outside.
pub(super) fn tets(field: &LabelField, edge: &EdgeField) -> Complex {
    let Lattice { mut x, tets } = lattice(field, edge);
    let label: Vec<u8> = x.par_iter().map(|p| field.field_at(p)).collect();
    let mut edges: Vec<[u32; 2]> = tets
        .iter()
        .flat_map(|t| [[t[0], t[1]], [t[0], t[2]], [t[0], t[3]], [t[1], t[2]], [t[1], t[3]], [t[2], t[3]]])
        .filter(|e| label[e[0] as usize] != label[e[1] as usize])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.par_sort_unstable();
    edges.dedup();
    let cuts: Vec<f64> =
        edges.par_iter().map(|&[a, b]| cut(field, &x[a as usize], &x[b as usize], label[a as usize])).collect();
    // Nearest cuts first; an edge with an end that has moved already needs nothing more.
    let mut order: Vec<usize> = (0..edges.len()).collect();
    let nearness = |n: usize| cuts[n].min(1.0 - cuts[n]);
    order.sort_by(|&m, &n| nearness(m).total_cmp(&nearness(n)).then(m.cmp(&n)));
    let mut pull: Vec<(Point, f64)> = vec![(Point::zeros(), 0.0); x.len()];
    let mut snapped = vec![false; x.len()];
    for n in order {
        let [a, b] = edges[n].map(|v| v as usize);
        let (near, far, share) = if cuts[n] <= 0.5 { (a, b, cuts[n]) } else { (b, a, 1.0 - cuts[n]) };
        if snapped[far] && !snapped[near] {
            continue;
        }
        snapped[near] = true;
        pull[near].0 += (x[far] - x[near]) * share;
        pull[near].1 += 1.0;
    }
    let mut star = vec![Vec::new(); x.len()];
    for (t, tet) in tets.iter().enumerate() {
        for &v in tet {
            star[v as usize].push(t as u32);
        }
    }
    for v in (0..x.len()).filter(|&v| snapped[v]) {
        let start = x[v];
        for share in [1.0, 0.75, 0.5, 0.25, 0.0] {
            x[v] = start + pull[v].0 / pull[v].1 * share;
            let fine = |&t: &u32| {
                let [a, b, c, d] = tets[t as usize].map(|v| x[v as usize]);
                min_sine(&a, &b, &c, &d) > SNAP_FLOOR
            };
            if star[v].iter().all(fine) {
                break;
            }
        }
    }
    let fields: Vec<u8> = tets.par_iter().map(|t| majority(field, &t.map(|v| x[v as usize]))).collect();
    // Of the outside, the layer that touches the mesh stays.
    let mut used = vec![false; x.len()];
    for (tet, _) in tets.iter().zip(&fields).filter(|(_, f)| **f != 0) {
        for &v in tet {
            used[v as usize] = true;
        }
    }
    let kept: Vec<usize> =
        (0..tets.len()).filter(|&n| fields[n] != 0 || tets[n].iter().any(|&v| used[v as usize])).collect();
    let fields = kept.iter().map(|&n| fields[n]).collect();
    Complex::new(x, kept.iter().map(|&n| tets[n]).collect(), fields)
}
