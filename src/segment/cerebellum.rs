//! Where the template has its cerebellum.

use super::atlas;
use crate::geometry::{Mni, Position};
use crate::image::Mask;

/// The template's cerebellum: below its upper surface and behind the brain stem, both by places read off by eye. Rough in
/// front, where peduncles run on into the stem.
pub(super) fn cerebellum() -> Mask<Mni> {
    let t1 = &atlas::template().t1;
    Mask::from_fn(t1.grid, |n| {
        let p = t1.grid.centre(t1.grid.voxel(n)).mm;
        t1.data[n] > 0 && holds(Position::from_point(p))
    })
}

/// Whether a point of the template lies in it.
pub(super) fn holds(p: Position<Mni>) -> bool {
    let p = p.mm;
    p.y < behind_mm(p.x.abs(), p.z) && p.z < below_mm(p.x.abs(), p.y)
}

/// Height of the upper surface, mm, at distances from the middle (rows) and from back to front (columns).
const BELOW: [[f64; 7]; 9] = [
    [-20.0, -20.0, -13.0, -4.0, 2.0, -4.0, -20.0],
    [-30.0, -24.0, -15.0, -5.0, 0.0, -5.0, -15.0],
    [-27.0, -18.0, -11.0, -7.0, -5.0, -7.0, -15.0],
    [-25.0, -17.0, -13.5, -12.0, -11.0, -13.0, -19.0],
    [-25.0, -18.0, -16.0, -15.0, -15.5, -17.0, -22.0],
    [-24.0, -19.0, -18.0, -18.5, -20.5, -23.0, -28.0],
    [-24.0, -21.0, -20.0, -20.5, -22.5, -26.0, -32.0],
    [-24.0, -22.0, -20.5, -21.5, -24.5, -28.5, -33.0],
    [-28.0, -27.0, -25.5, -26.0, -27.5, -31.0, -35.0],
];
const ASIDE_MM: [f64; 9] = [0.0, 5.0, 10.0, 15.0, 20.0, 27.0, 34.0, 42.0, 50.0];
const ALONG_MM: [f64; 7] = [-95.0, -85.0, -75.0, -65.0, -55.0, -45.0, -35.0];

/// The back of the stem and of the fourth ventricle in the midsagittal plane, (z, y); it recedes sideways.
const STEM: [[f64; 2]; 7] =
    [[-62.0, -50.0], [-50.0, -46.0], [-32.0, -46.0], [-20.0, -41.0], [-8.0, -41.0], [2.0, -44.0], [12.0, -46.0]];

fn below_mm(aside: f64, y: f64) -> f64 {
    let (row, across) = place(&ASIDE_MM, aside);
    let (column, along) = place(&ALONG_MM, y);
    let at = |row: usize| BELOW[row][column] * (1.0 - along) + BELOW[row][column + 1] * along;
    at(row) * (1.0 - across) + at(row + 1) * across
}

fn behind_mm(aside: f64, z: f64) -> f64 {
    let (part, along) = place(&STEM.map(|[z, _]| z), z);
    let middle = STEM[part][1] * (1.0 - along) + STEM[part + 1][1] * along;
    middle + (aside - 6.0).clamp(0.0, 18.0)
}

/// The interval of rising `knots` that holds `x`, and how far along it, 0 to 1; level beyond them.
fn place(knots: &[f64], x: f64) -> (usize, f64) {
    let part = knots.partition_point(|&k| k <= x).clamp(1, knots.len() - 1) - 1;
    (part, ((x - knots[part]) / (knots[part + 1] - knots[part])).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::atlas::head_from_template;

    #[test]
    fn the_region_has_a_cerebellums_size_and_leaves_stem_and_occipital_lobe_out() {
        let region = cerebellum();
        // In natural size with its fissures, between what two label maps of other programs give theirs.
        let natural = region.volume_cc() * head_from_template().linear.determinant();
        assert!((115.0..150.0).contains(&natural), "{natural}");
        let at = |x, y, z| region.nearest(Position::new(x, y, z)).unwrap_or(false);
        for (x, y, z) in [(0.0, -60.0, -15.0), (20.0, -60.0, -35.0), (45.0, -60.0, -35.0), (8.0, -50.0, -55.0)] {
            assert!(at(x, y, z) && at(-x, y, z), "{x} {y} {z}");
        }
        for (x, y, z) in [(0.0, -28.0, -30.0), (20.0, -75.0, -5.0), (35.0, -45.0, -15.0), (0.0, -36.0, -60.0)] {
            assert!(!at(x, y, z) && !at(-x, y, z), "{x} {y} {z}");
        }
    }
}
