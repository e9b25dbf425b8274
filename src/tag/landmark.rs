//! Where the falx, the tentorium and the skull base lie in MNI152 2009a (mm, RAS+), placed by hand on the template's
//! T1 and checked by eye.

use crate::mesh::line_height;

/// Free edge of the falx in the midsagittal plane, (y, z) from front to back; the falx is above it. It runs from the
/// crista galli over the corpus callosum to the internal occipital protuberance.
pub(super) const FALX_EDGE: [[f64; 2]; 16] = [
    [68.0, -16.0],
    [60.0, -4.0],
    [52.0, 12.0],
    [44.0, 24.0],
    [34.0, 34.0],
    [20.0, 42.0],
    [4.0, 47.0],
    [-12.0, 48.0],
    [-26.0, 44.0],
    [-38.0, 34.0],
    [-46.0, 22.0],
    [-52.0, 12.0],
    [-62.0, 4.0],
    [-76.0, -4.0],
    [-92.0, -12.0],
    [-106.0, -16.0],
];

/// Below this line (y, z) a pial facet that looks down belongs to the base: anterior and middle fossae, brainstem,
/// cerebellum.
const BASE_LINE: [[f64; 2]; 6] =
    [[70.0, -16.0], [20.0, -26.0], [0.0, -34.0], [-30.0, -34.0], [-60.0, -50.0], [-110.0, -50.0]];

/// Ridge of the tentorium in the midsagittal plane, (y, z).
const TENTORIUM_RIDGE: [[f64; 2]; 6] =
    [[-40.0, 10.0], [-52.0, 10.0], [-62.0, 4.0], [-76.0, -4.0], [-92.0, -12.0], [-106.0, -16.0]];

/// Whether a point of the midsagittal plane is above the free edge of the falx.
pub(super) fn above_falx_edge([_, y, z]: [f64; 3]) -> bool {
    z > line_height(&FALX_EDGE, y)
}

/// Whether a point is below the line under which the brain rests on the skull.
pub(super) fn below_base_line([_, y, z]: [f64; 3]) -> bool {
    z < line_height(&BASE_LINE, y)
}

/// Distance along z from the tentorium, mm; `None` where there is no tentorium: in front of its edge, beyond its
/// sides, below it, and in the incisura through which the brainstem passes.
pub(super) fn above_tentorium_mm([x, y, z]: [f64; 3]) -> Option<f64> {
    let incisura = (x / 26.0).powi(2) + ((y + 34.0) / 24.0).powi(2) < 1.0;
    if y >= -20.0 || x.abs() >= 65.0 || z <= -45.0 || incisura {
        return None;
    }
    let sheet = line_height(&TENTORIUM_RIDGE, y) - 0.42 * x.abs() - 0.05 * (x.abs() - 25.0).max(0.0);
    Some(z - sheet)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polylines_run_through_their_points_and_stay_level_beyond() {
        for line in [FALX_EDGE.as_slice(), &BASE_LINE, &TENTORIUM_RIDGE] {
            for [y, z] in line {
                assert!((line_height(line, *y) - z).abs() < 1e-12);
            }
            assert_eq!(line_height(line, 500.0), line[0][1]);
            assert_eq!(line_height(line, -500.0), line[line.len() - 1][1]);
        }
        assert!((line_height(&FALX_EDGE, 64.0) + 10.0).abs() < 1e-12);
    }

    #[test]
    fn the_brainstem_passes_the_tentorium() {
        assert_eq!(above_tentorium_mm([0.0, -30.0, -20.0]), None);
        assert!(above_tentorium_mm([40.0, -60.0, 40.0]).unwrap() > 0.0);
        assert!(above_tentorium_mm([40.0, -60.0, -40.0]).unwrap() < 0.0);
    }
}
