//! The sheet between the halves of split labels, laid flat.

use super::complex::{Complex, EDGES, Point};
use super::smooth::move_guarded;

/// Moves the vertices between left and right halves of split labels into the midplane, where no tet falls below the smaller of
/// `floor` and its quality, and keeps them there: from then on they move in the plane only.
pub(crate) fn flatten(complex: &mut Complex, floor: f64) {
    let Some(sheet) = complex.sheet.clone() else { return };
    let mut vertices: Vec<u32> = complex
        .interface_facets()
        .iter()
        .filter(|f| sheet.crosses(f.below, f.above) && !complex.is_loose(f.below, f.above, f.corners))
        .flat_map(|f| f.corners)
        .collect();
    vertices.sort_unstable();
    vertices.dedup();
    complex.flat = vec![false; complex.x.len()];
    let normal = sheet.normal();
    for v in vertices {
        let x = complex.x[v as usize];
        let goal = x - normal * sheet.distance_mm(&x);
        complex.flat[v as usize] = move_guarded(complex, v, &goal, floor) == 1.0;
    }
}

/// An edge is cut by the midplane when both ends are at least this share of its length away from it.
const CUT: f64 = 0.1;

/// Cuts the tets that the midplane passes through, so that the sheet need not make a detour around them, and gives each half
/// of a label what lies on its side. Detours arise where laying a vertex flat would have crushed a tet, mostly at the rim.
pub(crate) fn cut(complex: &mut Complex) {
    let Some(sheet) = complex.sheet.clone() else { return };
    let x = |p: &Point| sheet.distance_mm(p);
    let mut edges: Vec<(f64, [u32; 2], Point)> = Vec::new();
    for t in complex.alive().filter(|&t| sheet.is_half(complex.field[t as usize])) {
        let tet = complex.tets[t as usize];
        for [i, j] in EDGES {
            let ends = [tet[i].min(tet[j]), tet[i].max(tet[j])];
            let [a, b] = ends.map(|v| complex.x[v as usize]);
            let (xa, xb, length) = (x(&a), x(&b), (b - a).norm());
            let through = a + (b - a) * (xa / (xa - xb));
            if xa * xb < 0.0 && xa.abs().min(xb.abs()) > CUT * length && !sheet.is_below(&through) {
                edges.push((length, ends, through));
            }
        }
    }
    // The longest first, which leaves the best shapes; an edge has as many entries as tets.
    edges.sort_by(|p, q| q.0.total_cmp(&p.0).then(p.1.cmp(&q.1)));
    edges.dedup_by_key(|edge| edge.1);
    for (_, [a, b], through) in edges {
        let middle = complex.add(through);
        for t in complex.sharing(&[a, b]).collect::<Vec<_>>() {
            let (tet, field) = (complex.tets[t as usize], complex.field[t as usize]);
            complex.take_out(t);
            for end in [a, b] {
                complex.put_in(tet.map(|v| if v == end { middle } else { v }), field);
            }
        }
    }
    for t in 0..complex.tets.len() {
        let centre = complex.points(&complex.tets[t]).iter().sum::<Point>() / 4.0;
        if !sheet.is_below(&centre) {
            complex.field[t] = sheet.on_side(complex.field[t], x(&centre));
        }
    }
}
