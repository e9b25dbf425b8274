//! The cavity that surgery left, and the tissue that filled it.

use super::belief::{Doubt, Evidence};
use super::cavity_pair::CavityPair;
use super::sets::{both, either, without};
use crate::geometry::Mni;
use crate::image::Mask;
use crate::image::components::{Connectivity, components, fill_holes, largest_component};
use crate::image::distance::distance_mm;
use crate::image::gaussian::gaussian;
use crate::image::morphology::{close, dilate, erode, open};
use crate::segment::label;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How the cavity is found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CavitySettings {
    /// Smoothness of the ratio between the scans' intensities, mm.
    pub bias_sigma_mm: f64,
    /// The rim of the brain where a small error of mask or registration looks like a loss, mm.
    pub rim_mm: f64,
    /// Sulci that have opened are thinner than twice this, mm.
    pub opening_mm: f64,
    /// How far the boundary may grow from the seed through dark voxels, mm.
    pub growth_mm: f64,
    /// How far blood, as bright as tissue but without its folds, is followed from the dark part, mm.
    pub blood_mm: f64,
    /// Correlation of the two scans within a window above which the folds of grey and white matter are still there.
    pub folds_kept: f64,
    /// Fluid that was there before belongs to the cavity where most tissue within about this distance was lost, mm.
    pub surroundings_mm: f64,
    /// Gaps (vessels) narrower than twice this are closed, mm.
    pub closing_mm: f64,
    /// Smallest volume that counts as a cavity, cc.
    pub smallest_cc: f64,
}

impl Default for CavitySettings {
    fn default() -> Self {
        Self {
            bias_sigma_mm: 25.0,
            rim_mm: 2.0,
            opening_mm: 2.0,
            growth_mm: 8.0,
            blood_mm: 12.0,
            folds_kept: 0.4,
            surroundings_mm: 3.0,
            closing_mm: 3.0,
            smallest_cc: 1.0,
        }
    }
}

impl CavitySettings {
    /// Refuses settings that mean nothing, by name: a boundary that grows without end, a filter of negative width.
    ///
    /// # Errors
    /// [`ResectError::Setting`].
    pub fn check(&self) -> Result<(), ResectError> {
        let rules: [(&'static str, f64, std::ops::RangeInclusive<f64>, &'static str); 9] = [
            ("bias_sigma_mm", self.bias_sigma_mm, 5.0..=200.0, "5 to 200 mm"),
            ("rim_mm", self.rim_mm, 0.0..=10.0, "0 to 10 mm"),
            ("opening_mm", self.opening_mm, 0.0..=10.0, "0 to 10 mm"),
            ("growth_mm", self.growth_mm, 0.0..=50.0, "0 to 50 mm"),
            ("blood_mm", self.blood_mm, 0.0..=50.0, "0 to 50 mm"),
            ("folds_kept", self.folds_kept, 0.0..=1.0, "0 to 1"),
            ("surroundings_mm", self.surroundings_mm, 0.0..=20.0, "0 to 20 mm"),
            ("closing_mm", self.closing_mm, 0.0..=20.0, "0 to 20 mm"),
            ("smallest_cc", self.smallest_cc, 0.01..=100.0, "0.01 to 100 cc"),
        ];
        match rules.into_iter().find(|(_, value, range, _)| !range.contains(value)) {
            Some((name, value, _, rule)) => Err(ResectError::Setting { name, value, rule }),
            None => Ok(()),
        }
    }
}

/// Hemisphere of the cavity's centre.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The patient's left.
    Left,
    /// The patient's right.
    Right,
}

/// What was found, on the common grid.
#[derive(Clone, Debug)]
pub struct CavityFinding {
    /// The cavity as the post-operative scan shows it.
    pub cavity: Mask<Mni>,
    /// The tissue that filled it, on the pre-operative scan.
    pub resected: Mask<Mni>,
    /// Hemisphere.
    pub side: Side,
    /// What made it be believed; `None` for a mask given by hand.
    pub evidence: Option<Evidence>,
}

/// More of the brain than this outside the field of view is told, percent: as of a scan that is segmented.
const TOLD_PERCENT: f64 = 2.0;

/// There is no cavity to speak of.
#[derive(Debug, Error, PartialEq)]
pub enum ResectError {
    /// Post looks like pre.
    #[error(
        "no operation is seen: no cavity of at least {smallest_cc} cc was found on the post-operative scan (largest loss of \
         tissue: {largest_cc:.2} cc{}{}); check that the files are not swapped or the same, or give a cavity mask",
        doubt.map_or_else(String::new, |d| format!("; {d}")),
        if *unseen_percent > TOLD_PERCENT {
            format!("; {unseen_percent:.0} % of the brain lies outside that scan's field of view, where nothing can be seen")
        } else {
            String::new()
        }
    )]
    NoOperation {
        /// The part that the doubt is about; the largest where none is large enough.
        largest_cc: f64,
        /// What would have counted.
        smallest_cc: f64,
        /// Why the largest part that was looked at is not believed.
        doubt: Option<Doubt>,
        /// Share of the brain that the post-operative scan does not show, in percent.
        unseen_percent: f64,
    },
    /// What pre lacks, post has.
    #[error(
        "the pre-operative scan has {before_cc:.1} cc of fluid where the post-operative one has tissue, which lacks only \
         {after_cc:.1} cc: the two files look swapped; give the pre-operative scan first, or give a cavity mask"
    )]
    Swapped {
        /// Largest part that is fluid on pre and tissue on post.
        before_cc: f64,
        /// Largest part that is tissue on pre and fluid on post.
        after_cc: f64,
    },
    /// A given mask lies elsewhere.
    #[error(
        "the cavity or resected mask lies outside the brain: only {percent:.0} % of it was brain before; check the \
         masks and their grids"
    )]
    OutsideBrain {
        /// Share of the mask that was brain on the pre-operative scan: without the ventricles for a cavity alone.
        percent: f64,
    },
    /// A given mask marks no tissue.
    #[error(
        "the cavity or resected mask lies in fluid: only {percent:.0} % of what it takes was tissue before, the rest sulci, cisterns or \
         ventricles; check the mask and its grid, or give a mask of the resected tissue; where labels of your own were given, what was \
         taken has to be tissue in them"
    )]
    OnlyFluid {
        /// Share of what is taken that was tissue on the pre-operative scan.
        percent: f64,
    },
    /// A setting has no meaning.
    #[error("`{name}` is {value}: it must be {rule}")]
    Setting {
        /// The setting's name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
}

/// Candidates that are looked at, the likeliest first.
const MOST_CANDIDATES: usize = 6;

/// Finds the cavity: dark on post and tissue on pre, away from the brain's rim, opened; of the parts that make sense as a
/// cavity ([`Evidence`]) the one largest by volume x depth x loss; grown through dark voxels, closed, smoothed, without
/// the ventricles.
///
/// # Errors
/// [`ResectError::Swapped`] when more has appeared than was lost, [`ResectError::NoOperation`] when no part is large
/// enough and makes sense.
pub fn find_cavity(pair: &CavityPair<'_>, settings: &CavitySettings) -> Result<CavityFinding, ResectError> {
    let grid = pair.pre.grid;
    let post = pair.post;
    let border = pair.csf_grey_border as f32;
    let tissue = pair.pre_labels.map(label::is_tissue);
    // A lesion that was dark before is no loss, whatever its label.
    let bright_before = gaussian(pair.pre, 0.8).map(|x| x >= border);
    let dark = Mask::from_fn(grid, |n| pair.post_known.data[n] && post.data[n] < border);
    let inner = erode(pair.pre_brain, settings.rim_mm);
    let lost = open(&both(&both(&both(&dark, &tissue), &bright_before), &inner), settings.opening_mm);
    let depth_mm = distance_mm(&pair.pre_brain.map(|inside| !inside));
    let loss = |n: usize| f64::from((pair.pre.data[n] - post.data[n]).max(0.0)) * f64::from(depth_mm.data[n]);
    let parts = components(&lost, Connectivity::Faces);
    let mut scores = vec![0.0; parts.voxels.len() + 1];
    for (n, &part) in parts.labels.data.iter().enumerate().filter(|(_, part)| **part > 0) {
        scores[part as usize] += loss(n);
    }
    let mut order: Vec<usize> = (1..scores.len()).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
    let part_of = |best: usize| parts.labels.map(|part| best > 0 && part as usize == best);
    let seed = part_of(order.first().copied().unwrap_or(0));
    let fluid = pair.pre_labels.map(|l| l == label::CSF);
    let appeared = Mask::from_fn(grid, |n| fluid.data[n] && inner.data[n] && pair.post_known.data[n] && !dark.data[n]);
    let before_cc = largest_component(&open(&appeared, settings.opening_mm), Connectivity::Faces).volume_cc();
    if before_cc >= settings.smallest_cc.max(seed.volume_cc()) {
        return Err(ResectError::Swapped { before_cc, after_cc: seed.volume_cc() });
    }
    let volume_cc = |part: usize| parts.voxels[part - 1] as f64 * grid.voxel_volume_mm3() / 1000.0;
    let mut doubted: Option<(f64, Doubt)> = None;
    let mut believed = None;
    for part in order.into_iter().filter(|&part| volume_cc(part) >= settings.smallest_cc).take(MOST_CANDIDATES) {
        let candidate = part_of(part);
        let evidence = Evidence::of(&candidate, pair);
        match evidence.doubt() {
            None => {
                believed = Some((candidate, evidence));
                break;
            }
            Some(why) if doubted.is_none_or(|(cc, _)| cc < volume_cc(part)) => doubted = Some((volume_cc(part), why)),
            Some(_) => {}
        }
    }
    let Some((seed, evidence)) = believed else {
        let seen = both(pair.pre_brain, pair.post_known).count() as f64 / pair.pre_brain.count().max(1) as f64;
        let unseen_percent = 100.0 * (1.0 - seen);
        let largest_cc = (1..scores.len()).map(volume_cc).fold(0.0, f64::max);
        let (largest_cc, doubt) = doubted.map_or((largest_cc, None), |(cc, why)| (cc, Some(why)));
        return Err(ResectError::NoOperation { largest_cc, smallest_cc: settings.smallest_cc, doubt, unseen_percent });
    };

    let grown = grow(&seed, &both(&dark, pair.pre_brain), settings.growth_mm);
    let cavity = settled(&grown, pair.pre_brain, settings.closing_mm);
    let cavity = with_fluid_of(&cavity, &tissue, settings.surroundings_mm);
    let cavity = both(&cavity, pair.pre_brain);
    let ventricle = pair.pre_labels.map(|l| l == label::VENTRICLE);
    let resected = without(&cavity, &ventricle);
    let side = side_of(&cavity);
    Ok(CavityFinding { cavity, resected, side, evidence: Some(evidence) })
}

/// Gaps closed, holes filled, stairs smoothed, within the brain.
pub(super) fn settled(mask: &Mask<Mni>, brain: &Mask<Mni>, closing_mm: f64) -> Mask<Mni> {
    let closed = fill_holes(&close(mask, closing_mm));
    both(&gaussian(&closed.map(f32::from), 1.0).map(|share| share > 0.5), brain)
}

/// Tissue as it stands; fluid that was there before belongs to the cavity where most of the tissue around was lost: a
/// sulcus or a horn of the ventricle within it, but not the fissure or the ventricle it opens to.
pub(super) fn with_fluid_of(lost: &Mask<Mni>, tissue: &Mask<Mni>, sigma_mm: f64) -> Mask<Mni> {
    let all = gaussian(&tissue.map(f32::from), sigma_mm);
    let gone = gaussian(&both(lost, tissue).map(f32::from), sigma_mm);
    let fluid_lost = |n: usize| all.data[n] > 1e-3 && gone.data[n] > 0.5 * all.data[n];
    let belongs = |n: usize| if tissue.data[n] { lost.data[n] } else { fluid_lost(n) };
    Mask::from_fn(lost.grid, belongs)
}

/// Layers of one voxel (6-neighbours) from the seed through `allowed`, as many as fit into `limit_mm`.
pub(super) fn grow(seed: &Mask<Mni>, allowed: &Mask<Mni>, limit_mm: f64) -> Mask<Mni> {
    let [nx, ny, nz] = seed.grid.dims;
    let [sx, sy, sz] = seed.grid.spacing_mm();
    let mut grown = seed.clone();
    let mut front: Vec<usize> = (0..seed.data.len()).filter(|&n| seed.data[n]).collect();
    for _ in 0..(limit_mm / sx.min(sy).min(sz)).round() as usize {
        let mut next = Vec::new();
        for n in front {
            let [i, j, k] = seed.grid.voxel(n);
            let around = [
                (i > 0).then(|| n - 1),
                (i + 1 < nx).then(|| n + 1),
                (j > 0).then(|| n - nx),
                (j + 1 < ny).then(|| n + nx),
                (k > 0).then(|| n - nx * ny),
                (k + 1 < nz).then(|| n + nx * ny),
            ];
            for m in around.into_iter().flatten() {
                if allowed.data[m] && !grown.data[m] {
                    grown.data[m] = true;
                    next.push(m);
                }
            }
        }
        if next.is_empty() {
            break;
        }
        front = next;
    }
    // What only hangs on by a thread is a sulcus that opened into the cavity.
    let opened = open(&grown, 1.5);
    either(&opened, seed)
}

pub(super) fn side_of(mask: &Mask<Mni>) -> Side {
    let x_mm = |n: usize| mask.grid.position(mask.grid.voxel(n).map(|c| c as f64).into()).mm.x;
    let sum: f64 = (0..mask.data.len()).filter(|&n| mask.data[n]).map(x_mm).sum();
    if sum < 0.0 { Side::Left } else { Side::Right }
}

/// A mask without what touches another within `margin_mm`: the post-operative ventricle next to the cavity.
pub fn apart_from(mask: &Mask<Mni>, other: &Mask<Mni>, margin_mm: f64) -> Mask<Mni> {
    without(mask, &dilate(other, margin_mm))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::cavity_pair::MadePair;
    use super::*;
    use crate::image::{Grid, LabelMap, Volume};

    /// A ball of white matter of radius 40 mm with a ventricle, and a second scan with other gain and a hole.
    pub(in super::super) fn head(hole_radius_mm: f64) -> MadePair {
        let grid = Grid::axis_aligned([60, 60, 60], [1.5; 3], [-44.25; 3]);
        let at = |n: usize| grid.position(grid.voxel(n).map(|c| c as f64).into()).mm;
        let far = |n: usize, c: [f64; 3]| (at(n) - nalgebra::Point3::from(c)).norm();
        let mask = |f: &dyn Fn(usize) -> bool| Mask::from_data(grid, (0..grid.len()).map(f).collect());
        let brain = mask(&|n| far(n, [0.0; 3]) < 40.0);
        let ventricle = mask(&|n| far(n, [0.0; 3]) < 8.0);
        let hole = mask(&|n| far(n, [-22.0, 5.0, 0.0]) < hole_radius_mm);
        let label_of = |n: usize| if ventricle.data[n] { 4 } else { 3 * u8::from(brain.data[n]) };
        let labels = LabelMap::from_data(grid, (0..grid.len()).map(label_of).collect());
        let value = |n: usize| if labels.data[n] == 3 { 100.0f32 } else { 25.0 };
        let pre = Volume::from_data(grid, (0..grid.len()).map(value).collect());
        let dark = |n: usize| if hole.data[n] { 25.0 } else { value(n) };
        let post = Volume::from_data(grid, (0..grid.len()).map(|n| 2.5 * dark(n)).collect());
        let post = super::super::on_the_scale_of(&pre, &post, &brain, 25.0);
        MadePair { pre, labels, brain, post, gone: hole }
    }

    #[test]
    fn the_hole_is_found_whole_on_its_side() {
        let h = head(12.0);
        let known = h.brain.map(|_| true);
        let found = find_cavity(&h.pair(&known), &CavitySettings::default()).unwrap();
        assert!(found.cavity.dice(&h.gone) > 0.95, "{}", found.cavity.dice(&h.gone));
        assert_eq!(found.side, Side::Left);
    }

    #[test]
    fn without_a_hole_nothing_is_found_and_the_message_says_what_to_do() {
        let h = head(0.0);
        let known = h.brain.map(|_| true);
        let error = find_cavity(&h.pair(&known), &CavitySettings::default()).unwrap_err();
        assert!(error.to_string().contains("no operation is seen") && error.to_string().contains("give a cavity mask"));
    }

    #[test]
    fn a_hole_that_was_there_before_is_no_operation() {
        let h = head(12.0);
        let known = h.brain.map(|_| true);
        let old = CavityPair { pre: &h.post, ..h.pair(&known) };
        assert!(matches!(find_cavity(&old, &CavitySettings::default()), Err(ResectError::NoOperation { .. })));
    }

    #[test]
    fn a_shadow_over_folds_that_are_still_there_is_no_cavity() {
        let h = head(12.0);
        let known = h.brain.map(|_| true);
        let fold = |n: usize| {
            if (h.pre.grid.voxel(n)[0] / 2 + h.pre.grid.voxel(n)[2] / 3).is_multiple_of(2) { 30.0 } else { 0.0 }
        };
        let folded = |v: &Volume<f32, Mni>| Volume::from_fn(v.grid, |n| v.data[n] + fold(n));
        let pre = folded(&h.pre);
        // As coils shade: over centimetres.
        let shade = |n: usize| {
            let p = pre.grid.position(pre.grid.voxel(n).map(|c| c as f64).into()).mm;
            let far_mm = (p - nalgebra::Point3::new(-22.0, 5.0, 0.0)).norm();
            1.0 - 0.65 * (-0.5 * (far_mm / 25.0).powi(2)).exp() as f32
        };
        let shadow = Volume::from_fn(pre.grid, |n| pre.data[n] * shade(n));
        let shaded = CavityPair { pre: &pre, post: &shadow, ..h.pair(&known) };
        let error = find_cavity(&shaded, &CavitySettings::default()).unwrap_err();
        let ResectError::NoOperation { doubt: Some(Doubt::FoldsKept { correlation }), .. } = error else {
            panic!("{error}")
        };
        assert!(correlation > 0.7, "{correlation}");
        let hole = Volume::from_fn(pre.grid, |n| if h.gone.data[n] { 25.0 } else { pre.data[n] });
        let operated = CavityPair { pre: &pre, post: &hole, ..h.pair(&known) };
        assert!(find_cavity(&operated, &CavitySettings::default()).is_ok());
    }

    #[test]
    fn ventricles_that_have_grown_are_no_cavity() {
        let mut h = head(0.0);
        let known = h.brain.map(|_| true);
        let far = |n: usize| {
            let p = h.pre.grid.position(h.pre.grid.voxel(n).map(|c| c as f64).into()).mm;
            p.coords.norm()
        };
        let grown = Volume::from_fn(h.pre.grid, |n| if far(n) < 12.0 { 25.0 } else { h.pre.data[n] });
        h.post = grown;
        let error = find_cavity(&h.pair(&known), &CavitySettings::default()).unwrap_err();
        assert!(matches!(error, ResectError::NoOperation { doubt: Some(Doubt::Ventricle { .. }), .. }), "{error}");
    }

    #[test]
    fn a_hole_on_the_first_scan_only_says_that_the_files_are_swapped() {
        let h = head(12.0);
        let known = h.brain.map(|_| true);
        let mut labels = h.labels.clone();
        for (l, _) in labels.data.iter_mut().zip(&h.gone.data).filter(|(_, hole)| **hole) {
            *l = label::CSF;
        }
        let swapped = CavityPair { pre: &h.post, post: &h.pre, pre_labels: &labels, ..h.pair(&known) };
        let error = find_cavity(&swapped, &CavitySettings::default()).unwrap_err();
        assert!(matches!(error, ResectError::Swapped { before_cc, .. } if before_cc > 5.0), "{error}");
        assert!(error.to_string().contains("swapped"));
    }

    #[test]
    fn what_the_second_scan_does_not_show_is_no_cavity() {
        let h = head(12.0);
        let known = h.gone.map(|inside| !inside);
        let unseen = MadePair { post: h.post.map(|_| 0.0), ..head(12.0) };
        assert!(find_cavity(&unseen.pair(&h.gone.map(|_| false)), &CavitySettings::default()).is_err());
        assert!(find_cavity(&h.pair(&known), &CavitySettings::default()).is_err());
    }

    #[test]
    fn where_the_second_scan_ends_within_the_brain_no_operation_seen_says_how_much_it_does_not_show() {
        let h = head(12.0);
        let told = |known: &Mask<Mni>| find_cavity(&h.pair(known), &CavitySettings::default()).unwrap_err().to_string();
        let hidden = told(&h.gone.map(|inside| !inside));
        let percent = 100.0 * both(&h.gone, &h.brain).count() as f64 / h.brain.count() as f64;
        assert!(hidden.contains(&format!("{percent:.0} % of the brain lies outside")), "{hidden}");
        let whole = head(0.0);
        let seen = find_cavity(&whole.pair(&whole.brain.map(|_| true)), &CavitySettings::default()).unwrap_err();
        assert!(!seen.to_string().contains("field of view"), "{seen}");
    }

    /// A head with so much darker places, and what it shows before.
    fn with_places(places: &[([f64; 3], f64, [f32; 2])]) -> (MadePair, Mask<Mni>) {
        let mut h = head(0.0);
        let grid = h.pre.grid;
        for &(centre, radius_mm, [before, after]) in places {
            let near = |n: usize| (grid.centre(grid.voxel(n)).mm - nalgebra::Point3::from(centre)).norm() < radius_mm;
            for n in (0..grid.len()).filter(|&n| near(n)) {
                (h.pre.data[n], h.post.data[n]) = (before, after);
                h.gone.data[n] = true;
            }
        }
        let known = h.brain.map(|_| true);
        (h, known)
    }

    #[test]
    fn the_size_that_is_told_is_that_of_the_part_that_is_doubted() {
        // A small deep hole has lost more, but is too small to be looked at.
        let hole = ([17.0, 0.0, 0.0], 5.8, [100.0, 25.0]);
        let faint = ([0.0, -30.0, 0.0], 8.0, [85.0, 55.0]);
        let told = |places: &[_]| {
            let (h, known) = with_places(places);
            match find_cavity(&h.pair(&known), &CavitySettings::default()) {
                Err(ResectError::NoOperation { largest_cc, doubt, .. }) => (largest_cc, doubt.is_some()),
                other => panic!("{other:?}"),
            }
        };
        let (alone, both) = (told(&[hole]), told(&[hole, faint]));
        assert!((0.5..1.0).contains(&alone.0) && !alone.1, "{alone:?}");
        assert!((1.5..2.5).contains(&both.0) && both.1, "{both:?}");
    }

    #[test]
    fn parts_that_are_too_small_take_no_candidates_place() {
        let small = |axis: usize, side: f64| {
            let mut centre = [0.0; 3];
            centre[axis] = 17.0 * side;
            (centre, 5.8, [100.0, 25.0])
        };
        let mut places: Vec<_> = (0..3).flat_map(|axis| [small(axis, -1.0), small(axis, 1.0)]).collect();
        assert_eq!(places.len(), MOST_CANDIDATES);
        places.push(([17.3; 3], 7.0, [100.0, 25.0]));
        let (h, known) = with_places(&places);
        let found = find_cavity(&h.pair(&known), &CavitySettings::default()).unwrap();
        let (hole, _) = with_places(&places[MOST_CANDIDATES..]);
        assert!(found.cavity.dice(&hole.gone) > 0.8, "{}", found.cavity.dice(&hole.gone));
    }

    #[test]
    fn a_boundary_that_may_grow_without_end_ends_where_nothing_is_left_to_grow_into() {
        let h = head(12.0);
        let seed = erode(&h.gone, 4.0);
        assert_eq!(grow(&seed, &h.gone, 1e12), grow(&seed, &h.gone, 100.0));
    }
}
