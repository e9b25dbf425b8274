//! The sheet between the halves of split labels, laid flat.

use super::complex::Complex;
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
