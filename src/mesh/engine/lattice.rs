//! Our own engine: a body-centred cubic lattice whose vertices snap to the label interfaces.
//!
//! The lattice's tets all have dihedral angles of 60 and 90 degrees. Wherever an edge joins two fields, its nearer end
//! moves to the interface (as in isosurface stuffing, Labelle and Shewchuk 2007, and its multi-material sibling,
//! lattice cleaving, Bronson et al. 2012, but without cutting: the quality pass does what their stencils do, at a third
//! of the tets). A tet then takes the label that fills most of it. Conforming by construction.

use crate::mesh::label_field::LabelField;
use crate::mesh::optimise::{Complex, Point, min_sine};
use rayon::prelude::*;

/// Lattice tets with corner numbers into a list of points.
struct Lattice {
    x: Vec<Point>,
    tets: Vec<[u32; 4]>,
}

/// All tets of the body-centred lattice of cube edge `cube_mm` that touch a labelled part of the box, and those around them.
fn lattice(field: &LabelField, cube_mm: f64) -> Lattice {
    let extent = field.extent_mm();
    let cells: [usize; 3] = std::array::from_fn(|a| (extent[a] / cube_mm).ceil() as usize + 4);
    // The lattice is centred on the box and overhangs it by about two cubes.
    let origin: [f64; 3] = std::array::from_fn(|a| 0.5 * (extent[a] - cells[a] as f64 * cube_mm));
    let corners = cells.map(|c| c + 1);
    let corner = |c: [usize; 3]| (c[0] + corners[0] * (c[1] + corners[1] * c[2])) as u32;
    let first_centre = corners.iter().product::<usize>() as u32;
    let centre = |c: [usize; 3]| first_centre + (c[0] + cells[0] * (c[1] + cells[1] * c[2])) as u32;
    let at = |c: [usize; 3], half: f64| -> Point {
        Point::from(std::array::from_fn::<f64, 3, _>(|a| origin[a] + (c[a] as f64 + half) * cube_mm))
    };
    let mut x = Vec::with_capacity(2 * first_centre as usize);
    for half in [0.0, 0.5] {
        let n = if half == 0.0 { corners } else { cells };
        for k in 0..n[2] {
            for j in 0..n[1] {
                for i in 0..n[0] {
                    x.push(at([i, j, k], half));
                }
            }
        }
    }
    let mut tets = Vec::new();
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                for axis in 0..3 {
                    let c = [i, j, k];
                    if c[axis] + 1 == cells[axis] {
                        continue;
                    }
                    let mut next = c;
                    next[axis] += 1;
                    // The square between two centres, counter-clockwise seen from the second.
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let square = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[du, dv]| {
                        let mut s = next;
                        s[u] += du;
                        s[v] += dv;
                        corner(s)
                    });
                    let (a, b) = (centre(c), centre(next));
                    for n in 0..4 {
                        let tet = [a, b, square[n], square[(n + 1) % 4]];
                        tets.push(tet);
                    }
                }
            }
        }
    }
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

/// Meshes every field but the outside; `cube_mm` is the lattice's cube edge (its tets have edges of 1 and 0.87 of it).
pub(crate) fn mesh(field: &LabelField, cube_mm: f64) -> Complex {
    let Lattice { mut x, tets } = lattice(field, cube_mm);
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
