//! Which way something has moved and which way gravity pulls, as a text has it.

use nalgebra::Vector3;

/// Where a direction of the MNI frame points to, by its largest component.
fn side_of_head(direction: &Vector3<f64>) -> &'static str {
    const SIDES: [[&str; 2]; 3] =
        [["the left side", "the right side"], ["the back of the head", "the face"], ["the feet", "the crown"]];
    let axis = direction.iamax();
    SIDES[axis][usize::from(direction[axis] > 0.0)]
}

/// Which way was moved, and which way gravity pulls as assumed.
pub(super) fn other_way(seen_mm: &[f64; 3], gravity_m_per_s2: &[f64; 3]) -> String {
    let (seen, down) = (Vector3::from(*seen_mm), Vector3::from(*gravity_m_per_s2));
    format!(
        "what is seen has moved {:.1} mm on average towards {}, {:.0} degrees from gravity as assumed (towards {})",
        seen.norm(),
        side_of_head(&seen),
        seen.angle(&down).to_degrees(),
        side_of_head(&down)
    )
}
