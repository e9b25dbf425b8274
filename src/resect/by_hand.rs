//! Masks of the cavity and of what was taken that were drawn by hand, and what fills a cavity whose place is known.

use super::cavity::{CavityFinding, ResectError, side_of};
use super::sets::{both, without};
use crate::geometry::Mni;
use crate::image::{LabelMap, Mask};
use crate::segment::label;

/// Less of what is taken than this is the edge of what lies in fluid, percent. A cyst or a tumour's dead core has more of a wall.
const LEAST_TISSUE_PERCENT: f64 = 5.0;

/// The finding of a mask (or two) given by hand; what is missing is the other one within the brain.
///
/// # Errors
/// [`ResectError::OutsideBrain`] when less than half of a mask was brain before, [`ResectError::OnlyFluid`] when hardly any of what is
/// taken was tissue.
pub fn subtract(
    cavity: Option<Mask<Mni>>,
    resected: Option<Mask<Mni>>,
    pre_brain: &Mask<Mni>,
    pre_labels: &LabelMap<Mni>,
) -> Result<Option<CavityFinding>, ResectError> {
    let ventricle = pre_labels.map(|l| l == label::VENTRICLE);
    let beside_ventricle = without(pre_brain, &ventricle);
    // Each mask by itself: a small piece may have left a large cavity, and a large one a cavity that has closed.
    // What a cavity alone takes is all of it but the ventricle; beside a mask of what was taken it may open to one.
    let of_cavity = if resected.is_some() { pre_brain } else { &beside_ventricle };
    let given = [(cavity.as_ref(), of_cavity), (resected.as_ref(), pre_brain)];
    let inside = given.into_iter().filter_map(|(mask, brain)| Some(percent_of(mask?, |n| brain.data[n])));
    let percent = inside.fold(100.0, f64::min);
    if percent < 50.0 {
        return Err(ResectError::OutsideBrain { percent });
    }
    let (cavity, resected) = match (cavity, resected) {
        (None, None) => return Ok(None),
        (Some(cavity), Some(resected)) => (cavity, resected),
        (Some(cavity), None) => {
            let resected = both(&cavity, &beside_ventricle);
            (cavity, resected)
        }
        (None, Some(resected)) => (resected.clone(), resected),
    };
    if !takes_tissue(&resected, pre_labels) {
        return Err(ResectError::OnlyFluid {
            percent: percent_of(&resected, |n| label::is_tissue(pre_labels.data[n])),
        });
    }
    let side = side_of(&cavity);
    Ok(Some(CavityFinding { cavity, resected, side, evidence: None }))
}

/// Whether a mask of what is taken holds tissue, and not its edge alone.
pub(super) fn takes_tissue(resected: &Mask<Mni>, labels: &LabelMap<Mni>) -> bool {
    percent_of(resected, |n| label::is_tissue(labels.data[n])) >= LEAST_TISSUE_PERCENT
}

/// What filled the cavity, of the place where it lies at rest: brain, but not the ventricle that it opens to.
pub(super) fn filling(at_rest: &Mask<Mni>, brain: &Mask<Mni>, labels: &LabelMap<Mni>) -> Mask<Mni> {
    Mask::from_fn(at_rest.grid, |n| at_rest.data[n] && brain.data[n] && labels.data[n] != label::VENTRICLE)
}

/// How much of a mask something holds for, percent; 0 of an empty mask.
fn percent_of(mask: &Mask<Mni>, holds: impl Fn(usize) -> bool) -> f64 {
    let held = (0..mask.data.len()).filter(|&n| mask.data[n] && holds(n)).count();
    100.0 * held as f64 / mask.count().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::super::cavity::tests::head;
    use super::*;
    use crate::image::Volume;
    use crate::image::morphology::erode;

    #[test]
    fn each_mask_by_hand_is_held_against_the_brain_by_itself() {
        let h = head(12.0);
        let [small, large] = [head(8.0).gone, h.gone.clone()];
        let outside = h.brain.map(|inside| !inside);
        let of = |cavity: &Mask<Mni>, resected: &Mask<Mni>| {
            subtract(Some(cavity.clone()), Some(resected.clone()), &h.brain, &h.labels)
        };
        // A large cavity that a small piece has left, and the other way round.
        assert!(of(&large, &small).is_ok() && of(&small, &large).is_ok());
        for (cavity, resected) in [(&outside, &large), (&large, &outside)] {
            let refused = of(cavity, resected);
            assert!(matches!(refused, Err(ResectError::OutsideBrain { percent }) if percent < 1.0), "{refused:?}");
        }
    }

    #[test]
    fn a_mask_by_hand_that_holds_fluid_alone_is_refused() {
        let h = head(12.0);
        let mut labels = h.labels.clone();
        let cistern = |n: usize| h.gone.data[n];
        (0..labels.data.len()).filter(|&n| cistern(n)).for_each(|n| labels.data[n] = label::CSF);
        for given in [(Some(h.gone.clone()), None), (None, Some(h.gone.clone()))] {
            let refused = subtract(given.0.clone(), given.1.clone(), &h.brain, &labels).unwrap_err();
            assert_eq!(refused, ResectError::OnlyFluid { percent: 0.0 });
            // A cyst with its wall holds some.
            let wall = erode(&h.gone, 1.5);
            let walled = Volume::from_fn(labels.grid, |n| if wall.data[n] { label::CSF } else { h.labels.data[n] });
            assert!(subtract(given.0, given.1, &h.brain, &walled).is_ok());
        }
    }

    #[test]
    fn what_filled_a_cavity_is_never_the_ventricle() {
        let h = head(12.0);
        // Over the tissue and a part of the ventricle, and out of the brain.
        let drawn = Mask::from_fn(h.brain.grid, |n| {
            let [i, j, k] = h.brain.grid.voxel(n);
            i < 30 && (20..40).contains(&j) && (20..40).contains(&k)
        });
        let ventricle = h.labels.map(|l| l == label::VENTRICLE);
        let filled = filling(&drawn, &h.brain, &h.labels);
        assert!(both(&drawn, &ventricle).count() > 100 && both(&drawn, &h.brain).count() < drawn.count());
        assert_eq!(filled.count(), both(&drawn, &h.brain).count() - both(&drawn, &ventricle).count());
        assert!(both(&filled, &ventricle).count() == 0 && takes_tissue(&filled, &h.labels));
        assert!(!takes_tissue(&ventricle, &h.labels));
    }

    #[test]
    fn a_mask_by_hand_must_lie_in_the_brain() {
        let h = head(12.0);
        let outside = h.brain.map(|inside| !inside);
        assert!(matches!(subtract(Some(outside), None, &h.brain, &h.labels), Err(ResectError::OutsideBrain { .. })));
        let given = subtract(Some(h.gone.clone()), None, &h.brain, &h.labels).unwrap().unwrap();
        assert!(given.resected.dice(&h.gone) > 0.99);
        assert_eq!(subtract(None, None, &h.brain, &h.labels).unwrap().map(|f| f.side), None);
    }
}
