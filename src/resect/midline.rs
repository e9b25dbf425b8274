//! Midline shift: how far the septum pellucidum lies aside after surgery.

use crate::geometry::{Mni, Position};
use crate::register::deformable::DisplacementField;

/// The septum pellucidum of the MNI152 template between the frontal horns, above and before the foramina of Monro, the
/// level at which radiologists measure: ranges of x, y, z in mm.
const SEPTUM_MM: [[f64; 2]; 3] = [[-1.5, 1.5], [-5.0, 25.0], [5.0, 20.0]];

/// Mean sideways displacement of the septum from rest to the post-operative scan, mm; positive to the right (+x).
/// `sag` maps a rest position to where it is seen, `template_from_patient` a rest position to its like in the template.
/// `None` when no voxel of the patient is the template's septum.
pub fn midline_shift_mm(sag: &DisplacementField<Mni>, template_from_patient: &DisplacementField<Mni>) -> Option<f64> {
    let grid = sag.grid();
    let (mut sum, mut count) = (0.0, 0usize);
    for n in 0..grid.len() {
        let at: Position<Mni> = grid.centre(grid.voxel(n));
        let like = template_from_patient.apply(at);
        if SEPTUM_MM.iter().enumerate().all(|(axis, [low, high])| (*low..=*high).contains(&like.mm[axis])) {
            sum += sag.apply(at).mm.x - at.mm.x;
            count += 1;
        }
    }
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Grid, Volume};

    /// A field that moves everything by `shift`.
    fn moved(shift: [f32; 3]) -> DisplacementField<Mni> {
        let grid = Grid::<Mni>::axis_aligned([40, 50, 40], [2.0; 3], [-40.0, -40.0, -30.0]);
        DisplacementField::from_displacement(&Volume::filled(grid, shift))
    }

    #[test]
    fn a_brain_pushed_to_the_right_has_its_midline_there() {
        let template = moved([0.0; 3]);
        let found = midline_shift_mm(&moved([2.5, -4.0, -7.0]), &template).unwrap();
        assert!((found - 2.5).abs() < 1e-5, "{found}");
    }

    #[test]
    fn the_septum_is_where_the_template_has_it() {
        // Only what lies right of x = 10 mm moves; a patient whose midline is at x = 12 mm sees it.
        let grid = Grid::<Mni>::axis_aligned([40, 50, 40], [2.0; 3], [-40.0, -40.0, -30.0]);
        let mut sag = Volume::filled(grid, [0f32; 3]);
        for n in 0..grid.len() {
            if grid.centre(grid.voxel(n)).mm.x > 10.0 {
                sag.data[n] = [3.0, 0.0, 0.0];
            }
        }
        let sag = DisplacementField::from_displacement(&sag);
        assert_eq!(midline_shift_mm(&sag, &moved([0.0; 3])), Some(0.0));
        let found = midline_shift_mm(&sag, &moved([-14.0, 0.0, 0.0])).unwrap();
        assert!((found - 3.0).abs() < 1e-5, "{found}");
        assert_eq!(midline_shift_mm(&sag, &moved([200.0, 0.0, 0.0])), None);
    }
}
