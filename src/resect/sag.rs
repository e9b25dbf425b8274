//! The sag of the brain from one scan to the other.

use super::sets::{both, without};
use crate::geometry::Mni;
use crate::image::morphology::{dilate, dilations};
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
    let skull = skull_is_shown(scans);
    let shown = |n: usize| scans.pre_brain.data[n] || (skull && scans.pre.data[n] > 0.0 && scans.post.data[n] > 0.0);
    let pre = Volume::from_fn(scans.pre.grid, |n| if shown(n) { scans.pre.data[n] } else { f32::NAN });
    let post = |n: usize| if shown(n) && scans.post_known.data[n] { scans.post.data[n] } else { f32::NAN };
    let post = Volume::from_fn(scans.post.grid, post);
    fit_scan(&post, &pre, scans.pre_brain, Some(&dilate(scans.cavity, EDGE_MM)), settings)
}

/// Where skull and scalp lie, so many mm outside the brain.
const SKULL_MM: [f64; 2] = [4.0, 10.0];
/// What is as bright as this share of the brain is no background.
const LEAST_BRIGHT: f64 = 0.25;
/// A scan that shows less of skull and scalp than this share is stripped; one that is defaced shows more (docs/evidence/patients.md).
const LEAST_SHOWN: f64 = 0.3;

/// Whether both scans show what surrounds the brain: neither is stripped.
pub fn skull_is_shown(scans: &SagScans<'_>) -> bool {
    let [within, skull] = dilations(scans.pre_brain, SKULL_MM);
    let around = both(&without(&skull, &within), scans.post_known);
    let brain = both(scans.pre_brain, scans.post_known);
    let shows = |scan: &Volume<f32, Mni>| {
        let sum: f64 = (0..brain.data.len()).filter(|&n| brain.data[n]).map(|n| f64::from(scan.data[n])).sum();
        let least = (LEAST_BRIGHT * sum / brain.count().max(1) as f64) as f32;
        let shown = (0..around.data.len()).filter(|&n| around.data[n] && scan.data[n] > least).count();
        shown as f64 >= LEAST_SHOWN * around.count() as f64
    };
    shows(scans.pre) && shows(scans.post)
}

/// The pre-operative scan as it would look had its brain moved: `rest_from_moved` says where the tissue at a point was. Skull and
/// scalp stay, and where brain has left the skull's wall lies fluid of the intensity `fluid`; where there is no fluid to tell of, as
/// on stripped scans, the brain stands alone.
pub fn moved_scan(
    pre: &Volume<f32, Mni>,
    pre_brain: &Mask<Mni>,
    fluid: Option<f32>,
    rest_from_moved: &DisplacementField<Mni>,
) -> Volume<f32, Mni> {
    let [moved, share] = rest_from_moved.warp([pre, &pre_brain.map(f32::from)], &pre.grid);
    let is_brain = |n: usize| share.data[n] >= 0.5;
    let Some(fluid) = fluid else {
        return Volume::from_fn(pre.grid, |n| if is_brain(n) { moved.data[n] } else { 0.0 });
    };
    Volume::from_fn(pre.grid, |n| match (pre_brain.data[n], is_brain(n)) {
        (true, true) => moved.data[n],
        (true, false) => fluid,
        (false, _) => pre.data[n],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Position;
    use crate::image::Grid;

    struct Head {
        brain: Mask<Mni>,
        scan: Volume<f32, Mni>,
    }

    /// A ball of folds in a shell.
    fn head() -> Head {
        let grid = Grid::<Mni>::axis_aligned([60; 3], [1.0; 3], [-29.5; 3]);
        let brain = Mask::from_fn(grid, |n| grid.centre(grid.voxel(n)).mm.coords.norm() < 14.0);
        let scan = Volume::from_fn(grid, |n| if brain.data[n] { 100.0 + grid.voxel(n)[0] as f32 } else { 500.0 });
        Head { brain, scan }
    }

    impl Head {
        /// What it shows along x through its middle once its brain has moved by 2 mm that way.
        fn moved(&self, fluid: Option<f32>) -> impl Fn(f64) -> f32 + use<> {
            let back = DisplacementField::from_displacement(&Volume::filled(self.scan.grid, [-2.0f32, 0.0, 0.0]));
            let moved = moved_scan(&self.scan, &self.brain, fluid, &back);
            move |x| moved.nearest(Position::new(x, 0.5, 0.5)).unwrap()
        }
    }

    #[test]
    fn a_moved_scan_shows_the_tissue_where_it_went_and_fluid_where_it_left() {
        let at = head().moved(Some(7.0));
        assert_eq!(at(0.5), 100.0 + 28.0, "what was 2 mm to the left");
        assert_eq!(at(-13.5), 7.0, "left by the brain");
        assert_eq!(at(16.5), 500.0, "the skull stays");
    }

    #[test]
    fn a_moved_brain_without_a_skull_stands_alone_wherever_it_went() {
        let at = head().moved(None);
        assert_eq!((at(0.5), at(14.5)), (100.0 + 28.0, 100.0 + 42.0), "the brain, where it went");
        assert_eq!((at(-13.5), at(17.5)), (0.0, 0.0), "nothing else");
    }

    #[test]
    fn a_skull_is_shown_where_neither_scan_is_stripped_whatever_the_background_and_the_face() {
        let head = head();
        let (all, none) = (head.brain.map(|_| true), head.brain.map(|_| false));
        let shown = |pre, post| {
            skull_is_shown(&SagScans { pre, pre_brain: &head.brain, post, post_known: &all, cavity: &none })
        };
        // Noise is not black.
        let bare = Volume::from_fn(head.scan.grid, |n| if head.brain.data[n] { head.scan.data[n] } else { 3.0 });
        assert!(shown(&head.scan, &head.scan));
        assert!(!shown(&head.scan, &bare) && !shown(&bare, &head.scan) && !shown(&bare, &bare));
        let defaced = Volume::from_fn(head.scan.grid, |n| {
            let [i, j, _] = head.scan.grid.voxel(n);
            if i < 30 && j < 30 && !head.brain.data[n] { 0.0 } else { head.scan.data[n] }
        });
        assert!(shown(&head.scan, &defaced));
    }
}
