//! The sag of the brain from one scan to the other.

use super::sets::both;
use crate::geometry::Mni;
use crate::image::morphology::dilate;
use crate::image::{Mask, Volume};
use crate::register::deformable::{AtlasFit, DeformableError, DeformableSettings, DisplacementField, fit_scan};

/// The cavity's own edge is nowhere on the pre-operative scan, mm.
const EDGE_MM: f64 = 1.5;

/// Both scans in the MNI frame reached rigidly, on one grid.
#[derive(Clone, Copy, Debug)]
pub struct SagScans<'a> {
    /// Pre-operative intensities.
    pub pre: &'a Volume<f32, Mni>,
    /// Brain on the pre-operative scan.
    pub pre_brain: &'a Mask<Mni>,
    /// Post-operative intensities.
    pub post: &'a Volume<f32, Mni>,
    /// Where the post-operative scan looked.
    pub post_known: &'a Mask<Mni>,
    /// The cavity on the post-operative scan.
    pub cavity: &'a Mask<Mni>,
}

/// The pre-operative brain deformed onto the post-operative one around the cavity.
///
/// # Errors
/// [`DeformableError`] when too little of the brain is known on the post-operative scan.
pub fn fit_sag(scans: &SagScans<'_>, settings: &DeformableSettings) -> Result<AtlasFit<Mni>, DeformableError> {
    // Skull and scalp, which do not move, hold the map at the brain's surface where both scans show them: not where one of them
    // was stripped or defaced.
    let shown = |n: usize| scans.pre_brain.data[n] || (scans.pre.data[n] > 0.0 && scans.post.data[n] > 0.0);
    let pre = Volume::from_fn(scans.pre.grid, |n| if shown(n) { scans.pre.data[n] } else { f32::NAN });
    let post = |n: usize| if shown(n) && scans.post_known.data[n] { scans.post.data[n] } else { f32::NAN };
    let post = Volume::from_fn(scans.post.grid, post);
    fit_scan(&post, &pre, scans.pre_brain, Some(&dilate(scans.cavity, EDGE_MM)), settings)
}

/// The pre-operative scan as it would look had its brain moved: `rest_from_moved` says where the tissue at a point was.
/// Skull and scalp stay, and where brain has left the skull's wall lies fluid of the intensity `fluid`.
pub fn moved_scan(
    pre: &Volume<f32, Mni>,
    pre_brain: &Mask<Mni>,
    fluid: f32,
    rest_from_moved: &DisplacementField<Mni>,
) -> Volume<f32, Mni> {
    let [moved, share] = rest_from_moved.warp([pre, &pre_brain.map(f32::from)], &pre.grid);
    let still_brain = both(&share.map(|s| s >= 0.5), pre_brain);
    let mut out = pre.clone();
    for (n, value) in out.data.iter_mut().enumerate().filter(|(n, _)| pre_brain.data[*n]) {
        *value = if still_brain.data[n] { moved.data[n] } else { fluid };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Position;
    use crate::image::Grid;

    /// A ball of folds in a shell, moved by 2 mm along x.
    #[test]
    fn a_moved_scan_shows_the_tissue_where_it_went_and_fluid_where_it_left() {
        let grid = Grid::<Mni>::axis_aligned([40; 3], [1.0; 3], [-19.5; 3]);
        let radius = |n: usize| {
            let v = grid.voxel(n).map(|v| v as f64 - 19.5);
            (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
        };
        let brain = Mask::from_fn(grid, |n| radius(n) < 14.0);
        let pre = Volume::from_fn(grid, |n| if radius(n) < 14.0 { 100.0 + grid.voxel(n)[0] as f32 } else { 500.0 });
        let back = DisplacementField::from_displacement(&Volume::filled(grid, [-2.0f32, 0.0, 0.0]));
        let moved = moved_scan(&pre, &brain, 7.0, &back);
        let at = |x: f64| moved.nearest(Position::new(x, 0.5, 0.5)).unwrap();
        assert_eq!(at(0.5), 100.0 + 18.0, "what was 2 mm to the left");
        assert_eq!(at(-13.5), 7.0, "left by the brain");
        assert_eq!(at(16.5), 500.0, "the skull stays");
    }
}
