//! Changes of connectivity that raise the worst quality of a cavity: edge removal, 2-3 flips, edge collapse.
//!
//! Edge removal triangulates the ring by dynamic programming (Klincsek 1980; Shewchuk, "Two discrete optimization
//! algorithms for the topological improvement of tetrahedral meshes", 2002). An edge on an interface may go as well:
//! the ring is then triangulated on each side of the new diagonal, which is a flip of the interface itself, allowed
//! where it moves the interface by less than [`Limits::interface_shift`] of the edge length.

use super::complex::{AIR, Complex, EDGES, Point, Ring, quality};
use crate::mesh::TET_FACES;

/// What a change may do.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Largest shift of an interface as a share of the edge length.
    pub interface_shift: f64,
    /// Rings with more tets are left alone: the search grows with the cube.
    pub longest_ring: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { interface_shift: 0.12, longest_ring: 8 }
    }
}

/// Quality above which a tet of air is neither inside out nor flat.
const FLAT: f64 = 1e-3;

/// An improvement below this is not worth a change (and could cycle).
const GAIN: f64 = 1e-4;

/// Triangles over a chain of ring vertices, best worst tet first; see the module.
fn triangulate(complex: &Complex, chain: &[u32], a: u32, b: u32, beat: f64) -> Option<(f64, Vec<[u32; 3]>)> {
    let n = chain.len();
    if n < 3 {
        return Some((f64::MAX, Vec::new()));
    }
    let p: Vec<Point> = chain.iter().map(|&v| complex.x[v as usize]).collect();
    let (pa, pb) = (complex.x[a as usize], complex.x[b as usize]);
    let mut best = vec![f64::MAX; n * n];
    let mut choice = vec![0usize; n * n];
    for span in 2..n {
        for i in 0..n - span {
            let j = i + span;
            let (mut top, mut at) = (f64::MIN, 0);
            for k in i + 1..j {
                let rest = best[i * n + k].min(best[k * n + j]);
                if rest <= top || rest <= beat {
                    continue;
                }
                let with_b = quality(&p[i], &p[k], &p[j], &pb);
                if with_b <= top {
                    continue;
                }
                let quality = rest.min(with_b).min(quality(&p[i], &p[j], &p[k], &pa));
                if quality > top {
                    (top, at) = (quality, k);
                }
            }
            best[i * n + j] = top;
            choice[i * n + j] = at;
        }
    }
    if best[n - 1] <= beat {
        return None;
    }
    let mut triangles = Vec::with_capacity(n - 2);
    let mut open = vec![(0, n - 1)];
    while let Some((i, j)) = open.pop() {
        if j - i >= 2 {
            let k = choice[i * n + j];
            triangles.push([chain[i], chain[k], chain[j]]);
            open.extend([(i, k), (k, j)]);
        }
    }
    Some((best[n - 1], triangles))
}

/// The chains of ring vertices that share a field, with the field; for a closed ring of one field the ring itself.
fn sectors(complex: &Complex, ring: &Ring) -> Vec<(u8, Vec<u32>)> {
    let n = ring.tets.len();
    let field = |k: usize| complex.field[ring.tets[k % n] as usize];
    let start = if ring.closed { (0..n).find(|&k| field(k) != field(k + n - 1)) } else { Some(0) };
    let Some(start) = start else { return vec![(field(0), ring.vertices.clone())] };
    let vertex = |k: usize| ring.vertices[if ring.closed { (start + k) % n } else { k }];
    let mut parts: Vec<(u8, Vec<u32>)> = Vec::new();
    for k in 0..n {
        if k == 0 || field(start + k) != field(start + k - 1) {
            parts.push((field(start + k), vec![vertex(k)]));
        }
        if let Some(part) = parts.last_mut() {
            part.1.push(vertex(k + 1));
        }
    }
    parts
}

/// Whether an edge lies inside one field.
fn edge_is_inside(complex: &Complex, a: u32, b: u32) -> bool {
    complex.ring(a, b).is_some_and(|ring| {
        ring.closed && ring.tets.iter().all(|&t| complex.field[t as usize] == complex.field[ring.tets[0] as usize])
    })
}

/// Distance between the lines of two edges as a share of the longer edge.
fn shift(complex: &Complex, a: u32, b: u32, p: u32, q: u32) -> f64 {
    let [a, b, p, q] = complex.points(&[a, b, p, q]);
    let (u, w) = (b - a, q - p);
    let normal = u.cross(&w);
    let length = u.norm().max(w.norm());
    (p - a).dot(&normal).abs() / (normal.norm() * length).max(f64::MIN_POSITIVE)
}

/// Takes the edge out when its ring can be filled better; `Some` names the new tets.
pub(crate) fn remove_edge(complex: &mut Complex, a: u32, b: u32, limits: &Limits) -> Option<Vec<u32>> {
    let ring = complex.ring(a, b)?;
    if ring.tets.len() > limits.longest_ring {
        return None;
    }
    let solid = ring.tets.iter().filter(|&&t| complex.is_solid(t));
    let old = solid.map(|&t| complex.quality(t)).fold(f64::MAX, f64::min);
    let beat = old + GAIN;
    let parts = sectors(complex, &ring);
    let whole = ring.closed && parts.len() == 1;
    if !whole {
        // The interface edge a-b becomes the interface edge p-q.
        if parts.len() != if ring.closed { 2 } else { 1 } {
            return None;
        }
        let chain = &parts[0].1;
        let (p, q) = (chain[0], chain[chain.len() - 1]);
        let joined = complex.sharing(&[p, q]).next().is_some();
        let thin = parts.iter().any(|part| part.1.len() == 2);
        if joined != thin || (thin && !edge_is_inside(complex, p, q)) {
            return None;
        }
        let loose = parts.len() == 2 && [p, q].iter().all(|&v| complex.is_loose(parts[0].0, parts[1].0, [a, b, v]));
        if !loose && shift(complex, a, b, p, q) > limits.interface_shift {
            return None;
        }
    }
    let mut fresh: Vec<([u32; 4], u8)> = Vec::new();
    for (field, chain) in &parts {
        // Outside the mesh a tet need only be right-handed.
        let (_, triangles) = triangulate(complex, chain, a, b, if *field == AIR { FLAT } else { beat })?;
        for [i, j, k] in triangles {
            fresh.push(([i, j, k, b], *field));
            fresh.push(([i, k, j, a], *field));
        }
    }
    if fresh.is_empty() {
        // A lone outer tet: taking it out must not bare a vertex.
        let loses = |v: u32| complex.star[v as usize].len() <= ring.tets.len();
        if [a, b].into_iter().chain(ring.vertices.iter().copied()).any(loses) {
            return None;
        }
    }
    ring.tets.iter().for_each(|&t| complex.take_out(t));
    Some(fresh.into_iter().map(|(tet, field)| complex.put_in(tet, field)).collect())
}

/// Replaces the face opposite `corner` by an edge (2-3 flip) when that is better.
pub(crate) fn face_to_edge(complex: &mut Complex, t: u32, corner: usize) -> Option<Vec<u32>> {
    let other = complex.across(t, corner)?;
    let field = complex.field[t as usize];
    if complex.field[other as usize] != field || field == AIR {
        return None;
    }
    let tet = complex.tets[t as usize];
    let face = TET_FACES[corner].map(|c| tet[c]);
    let d = tet[corner];
    let e = complex.tets[other as usize].into_iter().find(|v| !face.contains(v))?;
    let beat = complex.quality(t).min(complex.quality(other)) + GAIN;
    let fresh: [[u32; 4]; 3] = std::array::from_fn(|n| [d, e, face[n], face[(n + 1) % 3]]);
    for tet in &fresh {
        let [a, b, c, d] = complex.points(tet);
        if quality(&a, &b, &c, &d) <= beat {
            return None;
        }
    }
    complex.take_out(t);
    complex.take_out(other);
    Some(fresh.into_iter().map(|tet| complex.put_in(tet, field)).collect())
}

/// Merges vertex `a` into `b` when the worst quality around `a` rises above `beat` and no interface moves by more than
/// the limit; `fields` are the masks of [`Complex::all_fields`].
pub(crate) fn collapse(
    complex: &mut Complex,
    a: u32,
    b: u32,
    fields: &[u64],
    beat: f64,
    limits: &Limits,
) -> Option<Vec<u32>> {
    let (at_a, at_b) = (fields[a as usize], fields[b as usize]);
    let on_interface = at_a.count_ones() > 1;
    if at_a & !at_b != 0 {
        return None;
    }
    let pb = complex.x[b as usize];
    let mut fresh: Vec<([u32; 4], u8)> = Vec::new();
    for &t in &complex.star[a as usize] {
        let tet = complex.tets[t as usize];
        if tet.contains(&b) {
            continue;
        }
        let moved = tet.map(|v| if v == a { b } else { v });
        let p: [Point; 4] = moved.map(|v| complex.x[v as usize]);
        let beat = if complex.is_solid(t) { beat } else { FLAT };
        if quality(&p[0], &p[1], &p[2], &p[3]) <= beat {
            return None;
        }
        fresh.push((moved, complex.field[t as usize]));
    }
    if fresh.is_empty() {
        return None;
    }
    let ring = complex.ring(a, b)?;
    // Link condition: what is joined to both ends must be joined to the edge.
    let (near_a, near_b) = (complex.neighbours(a), complex.neighbours(b));
    let common: Vec<u32> = near_a.iter().copied().filter(|v| near_b.binary_search(v).is_ok()).collect();
    if common.iter().any(|v| !ring.vertices.contains(v)) {
        return None;
    }
    for (n, &p) in common.iter().enumerate() {
        for &q in &common[n + 1..] {
            let face = |v: u32| complex.sharing(&[v, p, q]).next().is_some();
            if face(a) && face(b) && complex.sharing(&[a, b, p, q]).next().is_none() {
                return None;
            }
        }
    }
    if on_interface {
        let parts = sectors(complex, &ring);
        let faces = parts.len() + usize::from(!ring.closed);
        let families = at_a.count_ones() as usize;
        // A vertex of a surface moves along the surface, one of a curve along the curve.
        if (ring.closed && parts.len() == 1) || (families > 2 && faces < families) {
            return None;
        }
        let edge = pb - complex.x[a as usize];
        let (mut shift, mut area) = (0.0, 0.0);
        for (normal, _) in interface_normals(complex, a) {
            shift += normal.dot(&edge).powi(2) / normal.norm().max(f64::MIN_POSITIVE);
            area += normal.norm();
        }
        if shift > (limits.interface_shift * edge.norm()).powi(2) * area {
            return None;
        }
    }
    let old: Vec<u32> = complex.star[a as usize].clone();
    for t in old {
        complex.take_out(t);
    }
    Some(fresh.into_iter().map(|(tet, field)| complex.put_in(tet, field)).collect())
}

/// Area vectors (away from the lower tet) and corners of the interface facets at a vertex that are not loose.
pub(crate) fn interface_normals(complex: &Complex, v: u32) -> Vec<(Point, [u32; 3])> {
    let mut normals = Vec::new();
    for &t in &complex.star[v as usize] {
        let tet = complex.tets[t as usize];
        for corner in (0..4).filter(|&c| tet[c] != v) {
            let across = complex.across(t, corner);
            let field = |t: u32| complex.field[t as usize];
            // Each facet once: from its lower-numbered tet, or from its only one.
            if across.is_none_or(|other| field(other) != field(t) && t < other) {
                let face = TET_FACES[corner].map(|c| tet[c]);
                if across.is_some_and(|other| complex.is_loose(field(t), field(other), face)) {
                    continue;
                }
                let [p, q, r] = face.map(|v| complex.x[v as usize]);
                normals.push(((q - p).cross(&(r - p)) * 0.5, face));
            }
        }
    }
    normals
}

/// Tries every connectivity change at a tet; returns the tets made by the first that helps.
pub(crate) fn improve_connectivity(complex: &mut Complex, t: u32, limits: &Limits) -> Option<Vec<u32>> {
    let tet = complex.tets[t as usize];
    for [i, j] in EDGES {
        if let Some(fresh) = remove_edge(complex, tet[i], tet[j], limits) {
            return Some(fresh);
        }
    }
    (0..4).find_map(|corner| face_to_edge(complex, t, corner))
}
