//! The body that is meshed: tissue with its sulci closed.

use super::label;
use crate::geometry::Frame;
use crate::image::LabelMap;
use crate::image::components::fill_holes;
use crate::image::morphology::close;

/// Sulci and fissures up to twice this width are closed in a brain that is one body, mm.
pub const SULCUS_MM: f64 = 4.0;

/// Labels for meshing: CSF in sulci and fissures narrower than `2 * closing_mm` becomes grey matter, CSF in wide
/// cisterns becomes background. A mesh whose every sulcus is open has neither a falx to hold nor a surface to load, and
/// its thin bridges carry loads that no brain carries; pia and arachnoid hold the banks of a sulcus together.
pub fn with_closed_sulci<F: Frame>(labels: &LabelMap<F>, closing_mm: f64) -> LabelMap<F> {
    let solid = labels.map(|l| l != label::BACKGROUND && l != label::CSF);
    let body = fill_holes(&close(&solid, closing_mm));
    let mut out = labels.clone();
    for ((l, inside), before) in out.data.iter_mut().zip(&body.data).zip(&labels.data) {
        if *before == label::CSF {
            *l = if *inside { label::GREY_MATTER } else { label::BACKGROUND };
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    #[test]
    fn a_narrow_sulcus_is_closed_and_a_wide_cistern_left_out() {
        let grid = Grid::<Mni>::axis_aligned([60, 12, 12], [1.0; 3], [0.0; 3]);
        // Tissue, 4 mm of CSF, tissue, 20 mm of CSF, tissue.
        let value = |i: usize| match i {
            10..14 | 26..46 => label::CSF,
            _ => label::WHITE_MATTER,
        };
        let labels = LabelMap::from_data(grid, (0..grid.len()).map(|n| value(grid.voxel(n)[0])).collect());
        let closed = with_closed_sulci(&labels, 3.0);
        assert_eq!(closed.at(12, 6, 6), label::GREY_MATTER);
        assert_eq!(closed.at(36, 6, 6), label::BACKGROUND);
        assert_eq!(closed.at(5, 6, 6), label::WHITE_MATTER);
    }
}
