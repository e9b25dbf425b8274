//! How much of the brain that the template expects is in what is taken for the brain, part by part.

use super::{BrainSource, Region, SegmentWarning, atlas};
use crate::geometry::{Mni, Position};
use crate::image::Mask;
use rayon::prelude::*;

/// One voxel in so many along each axis is looked at.
const STRIDE: usize = 2;

/// What a brain leaves out of what the fitted template expects where the scan shows something.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// Each part of the brain and the share of it that is left out, 0 to 1.
    pub parts: Vec<(Region, f64)>,
    /// The share of the whole brain.
    pub whole: f64,
}

impl LeftOut {
    /// Compares a brain with the template's, as far as the scan is known.
    pub fn of(
        brain: &Mask<Mni>,
        known: &Mask<Mni>,
        template_from_patient: impl Fn(Position<Mni>) -> Position<Mni> + Sync,
    ) -> Self {
        let (grid, template) = (brain.grid, &atlas::template().t1);
        let seen_at = |n: usize| {
            let p = template_from_patient(grid.centre(grid.voxel(n)));
            let expected = known.data[n] && template.nearest(p).is_some_and(|t1| t1 > 0);
            expected.then(|| (Region::at(p), brain.data[n]))
        };
        let of_slice = |k: usize| -> Vec<(Region, bool)> {
            let rows = (0..grid.dims[1]).step_by(STRIDE);
            let places = rows.flat_map(|j| (0..grid.dims[0]).step_by(STRIDE).map(move |i| grid.index(i, j, k)));
            places.filter_map(seen_at).collect()
        };
        let seen: Vec<Vec<(Region, bool)>> = (0..grid.dims[2]).into_par_iter().step_by(STRIDE).map(of_slice).collect();
        let share = |of: &dyn Fn(Region) -> bool| {
            let own = seen.iter().flatten().filter(|(region, _)| of(*region));
            let (all, out) = own.fold((0usize, 0usize), |(all, out), (_, held)| (all + 1, out + usize::from(!held)));
            out as f64 / all.max(1) as f64
        };
        let parts = Region::ALL.into_iter().map(|part| (part, share(&|region| region == part))).collect();
        Self { parts, whole: share(&|_| true) }
    }

    /// What is to be said of it, the parts that miss most first.
    pub fn noted(&self, source: BrainSource) -> Option<SegmentWarning> {
        let percent = 100.0 * self.whole;
        let mut parts: Vec<(Region, f64)> = self.parts.iter().map(|(region, share)| (*region, 100.0 * share)).collect();
        parts.retain(|(_, part)| *part >= source.noted_percent());
        parts.sort_by(|a, b| b.1.total_cmp(&a.1));
        (percent >= source.most_percent() || !parts.is_empty()).then_some(SegmentWarning::LeavesOut {
            brain: source,
            percent,
            parts,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noted(given: BrainSource, keeps: &(dyn Fn(Position<Mni>) -> bool + Sync)) -> Option<SegmentWarning> {
        let t1 = &atlas::template().t1;
        let brain = Mask::from_fn(t1.grid, |n| t1.data[n] > 0 && keeps(t1.grid.centre(t1.grid.voxel(n))));
        LeftOut::of(&brain, &Mask::filled(t1.grid, true), |p| p).noted(given)
    }

    #[test]
    fn what_a_brain_leaves_out_is_named_and_much_of_it_belies_it() {
        let belied = |given, keeps: &(dyn Fn(Position<Mni>) -> bool + Sync)| {
            noted(given, keeps).map(|warning| (warning.to_string(), warning.belies_the_masks()))
        };
        assert_eq!(belied(BrainSource::Labels, &|_| true), None);
        assert_eq!(belied(BrainSource::Mask, &|p| p.mm.y < 45.0), None, "the tip of the frontal pole");
        let (said, belied_half) = belied(BrainSource::Mask, &|p| p.mm.x > 0.0).unwrap();
        assert!(belied_half && said.contains("brain mask") && said.contains("left frontal lobe: 100 %"), "{said}");
        let (said, belied_lobe) = belied(BrainSource::Labels, &|p| Region::at(p) != Region::Cerebellum).unwrap();
        assert!(belied_lobe && said.contains("label map") && said.contains("cerebellum: 100 %"), "{said}");
        let temporal = |p: Position<Mni>| Region::at(p) != Region::LeftTemporal || p.mm.y < -20.0;
        let (said, belied_lobectomy) = belied(BrainSource::Labels, &temporal).unwrap();
        assert!(!belied_lobectomy && said.contains("left temporal lobe"), "an earlier operation: {said}");
    }

    #[test]
    fn what_a_brain_that_was_found_leaves_out_is_told_and_left_to_a_person() {
        let hemisphere = noted(BrainSource::Found, &|p| p.mm.x > 0.0).unwrap();
        assert!(
            !hemisphere.belies_the_masks() && hemisphere.to_string().contains("a lesion, or the outline"),
            "{hemisphere}"
        );
        assert_eq!(noted(BrainSource::Found, &|p| p.mm.y < 55.0), None, "the tip of the frontal pole");
    }

    #[test]
    fn what_the_scan_does_not_show_is_not_asked_for() {
        let t1 = &atlas::template().t1;
        let shown = Mask::from_fn(t1.grid, |n| t1.grid.centre(t1.grid.voxel(n)).mm.z > 0.0);
        let brain = Mask::from_fn(t1.grid, |n| t1.data[n] > 0 && shown.data[n]);
        assert_eq!(LeftOut::of(&brain, &shown, |p| p).noted(BrainSource::Labels), None);
    }
}
