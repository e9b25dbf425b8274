//! What is told of a segmentation that does not stop the work.

use super::brain_source::BrainSource;
use super::overhang::VaultPart;
use super::region::Region;
use crate::geometry::Frame;
use crate::image::{BlankSlices, Grid};
use thiserror::Error;

/// Findings that do not stop the work.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, Error)]
#[serde(rename_all = "kebab-case")]
pub enum SegmentWarning {
    /// The field of view ends inside the brain.
    #[error("{percent:.0} % of the expected brain lies outside the field of view: nothing is said about that part")]
    CroppedBrain {
        /// Share of the template's brain outside the image, in percent.
        percent: f64,
    },
    /// The field of view cuts parts of the brain.
    #[error("{}: nothing is said about that", in_words(parts, "lies outside the scan"))]
    RegionsOutside {
        /// The parts and how much of each lies outside, percent.
        parts: Vec<(Region, f64)>,
    },
    /// What is known of the labels speaks less for them than elsewhere.
    #[error(
        "{}: look at the labels there before relying on them, and give a brain mask or a label map where they are wrong",
        in_words(parts, "of the labels are expected to be right")
    )]
    UnsureRegions {
        /// The parts and how much of each is expected to be right, percent.
        parts: Vec<(Region, f64)>,
    },
    /// A surface coil saw parts of the brain much brighter than others.
    #[error(
        "parts of the brain are {times:.1} times as bright as others (a surface coil): taken out, but the outline is less sure \
         where it is brightest, the crown as a rule; the scanner's normalised reconstruction of the scan is better"
    )]
    StrongGain {
        /// How many times.
        times: f64,
    },
    /// Some slices show nothing, between others that do.
    #[error(
        "the scan is blank from slice {first} to {last} of voxel axis {axis} ({thickness_mm:.1} mm): filled from the slices on \
         either side, so what lies there is a guess"
    )]
    BlankSlices {
        /// Index of the first, from 0.
        first: usize,
        /// Index of the last.
        last: usize,
        /// The voxel axis across them, 0 to 2.
        axis: usize,
        /// How thick they are together.
        thickness_mm: f64,
    },
    /// Much of what lies just outside the fitted template under the vault looks like brain.
    #[error(
        "{percent:.0} % of what lies 2 to 4.5 mm outside the fitted template under the vault{} looks like brain: the outline may \
         cut the crown, or take in bone or dura there; look at it, and give a brain mask where it is wrong",
        place.map(|place| format!(" (most of it at the {place})")).unwrap_or_default()
    )]
    BeyondTemplate {
        /// Share of that layer, in percent.
        percent: f64,
        /// The part of the vault where most of it does, if there is one.
        place: Option<VaultPart>,
    },
    /// Much of what lies just inside the fitted template does not look like brain.
    #[error(
        "at the {place} {percent:.0} % of what lies 2 to 4.5 mm inside the fitted template does not look like brain: a lesion or \
         wide sulci, or the outline cuts the brain there; look at it, and give a brain mask where it is wrong"
    )]
    ShortOfTemplate {
        /// The part of the vault.
        place: VaultPart,
        /// Share of that layer there, in percent.
        percent: f64,
    },
    /// The template was fitted in another pose than the one found.
    #[error(
        "the fitted template is turned by {deg:.0} degrees and moved by {shift_mm:.0} mm from the pose that was found: what is taken \
         from the frame (gravity, falx, base, names of places) is off by as much; give the pose by hand, or where to look for it"
    )]
    PoseOff {
        /// Angle, degrees.
        deg: f64,
        /// Way of the brain's middle, mm.
        shift_mm: f64,
    },
    /// What is taken for the brain leaves out parts of the one that the fitted template expects.
    #[error(
        "the {brain} leaves out {percent:.0} % of the brain that the fitted template expects{}: {}",
        if parts.is_empty() { String::new() } else { format!("; {}", in_words(parts, "is missing")) },
        brain.question()
    )]
    LeavesOut {
        /// What is taken for the brain.
        brain: BrainSource,
        /// Share of the whole brain, in percent.
        percent: f64,
        /// The parts that miss most, percent of each.
        parts: Vec<(Region, f64)>,
    },
    /// Scans that do not look like one head, taken for one since a cavity was drawn by hand.
    #[error(
        "the two scans do not look like one head (once one lies on the other their folds correlate by {folds:.2}; one head: .9 and \
         more): two people, two weightings, or the registration failed; nothing but the masks that were given says that they are one"
    )]
    UnlikeScans {
        /// The correlation of their folds.
        folds: f64,
    },
    /// A cavity, or what was taken, drawn by hand holds tissue.
    #[error(
        "{percent:.0} % of the tissue under the mask of the cavity, or of what was taken, looks as it did before the operation: is it of \
         this scan, and on the right side?"
    )]
    UnchangedCavity {
        /// Share of that tissue, in percent.
        percent: f64,
    },
    /// The mask of what was taken has no cavity beside it that the second scan shows.
    #[error(
        "no cavity is seen where the mask of the resected tissue says that one is: it is taken to be that mask, moved as the brain has \
         moved; look at the scan after the operation, and give a cavity mask"
    )]
    CavityOfMask,
    /// The cavity ends where the scan does.
    #[error(
        "{percent:.0} % of the cavity's outside borders on brain that the post-operative scan does not show: the cavity and what was \
         resected run on beyond it and are found too small"
    )]
    CavityAtEdge {
        /// Share of the cavity's outside, in percent.
        percent: f64,
    },
    /// The cavity runs on into the fluid above a brain that has sunk.
    #[error(
        "{percent:.0} % of the cavity lies where, the brain's sag undone, no brain was: the brain has sunk beside the cavity, and the \
         fluid above it is taken for a part of it, which is found too large; look at it, and give a cavity mask where it is wrong"
    )]
    AboveSunkBrain {
        /// Share of the cavity, in percent.
        percent: f64,
    },
    /// Tissue is gone elsewhere than in the cavity.
    #[error(
        "{cc:.1} cc of tissue are fluid after the operation elsewhere than in the cavity: a second cavity, a cut or a new lesion; \
         look at the post-operative scan, and give a cavity mask that holds all of what was taken"
    )]
    LostElsewhere {
        /// Volume, cc.
        cc: f64,
    },
    /// What has changed beside the cavity may be blood, oedema or contrast agent.
    #[error(
        "beside the dark part of the cavity {cc:.1} cc have changed as oedema or contrast agent changes tissue: they are left out; \
         where they are blood, the cavity is found too small: give a cavity mask"
    )]
    ChangedBeside {
        /// Volume, cc.
        cc: f64,
    },
    /// Blood in the cavity could not be told from tissue.
    #[error(
        "along {percent:.0} % of the cavity's wall blood as bright as tissue would be taken for tissue: no folds were there before \
         the operation, or the slices are too thick or too noisy to show them; where there is such blood, the cavity is found too \
         small: look at it, and give a cavity mask"
    )]
    BloodUntold {
        /// Share of the wall, percent.
        percent: f64,
    },
    /// A mask of the ventricles lies on tissue, or where none are.
    #[error(
        "of the ventricle mask {tissue_percent:.0} % is as bright as tissue and {far_percent:.0} % lies far from where the fitted \
         template has its ventricles: is it of this scan, and of the ventricles?"
    )]
    NotVentricles {
        /// Share that is brighter than half way from fluid to grey matter, percent.
        tissue_percent: f64,
        /// Share that is far from the template's ventricles, percent.
        far_percent: f64,
    },
    /// No ventricle was found.
    #[error(
        "no ventricle was found: their fluid is taken for that of the sulci (tissue of the mesh where narrow, a hole where wide); look at \
         the labels, and give a ventricle mask or a label map that has them"
    )]
    NoVentricle,
    /// Grey and white matter are hard to tell apart.
    #[error("grey and white matter differ by only {ratio:.1} standard deviations: is this a T1-weighted image?")]
    LowContrast {
        /// Difference of the means over the mean of the deviations.
        ratio: f64,
    },
}

/// A cavity drawn by hand that holds so much of the tissue that was there before is of another place or scan, percent; on the wrong side
/// of one patient it held all of it. Well above what is noted, since a cavity full of blood looks like tissue.
const STILL_THERE_PERCENT: f64 = 85.0;

/// So much of a cavity's outside at the scan's edge hides a tenth of the cavity and more, percent: of a ball, the disc where a
/// plane cuts that part off.
const HIDDEN_PERCENT: f64 = 16.0;

/// A fit this far from the pose found it wrong: no head lies so.
const OTHER_POSE_DEG: f64 = 10.0;
const OTHER_POSE_MM: f64 = 18.0;

/// So much of a ventricle mask on tissue or far from where ventricles are, percent: it is of something else.
const OF_SOMETHING_ELSE_PERCENT: f64 = 60.0;

impl SegmentWarning {
    /// The warning of a gap in a scan of this grid.
    pub(super) fn blank<F: Frame>(gap: &BlankSlices, grid: &Grid<F>) -> Self {
        let thickness_mm = gap.slices.len() as f64 * grid.spacing_mm()[gap.axis];
        Self::BlankSlices { first: gap.slices.start, last: gap.slices.end - 1, axis: gap.axis, thickness_mm }
    }

    /// Whether brain or cavity, and what follows from them, cannot be believed for it.
    pub fn belies_the_masks(&self) -> bool {
        match self {
            Self::CavityAtEdge { percent } => *percent >= HIDDEN_PERCENT,
            Self::UnchangedCavity { percent } => *percent >= STILL_THERE_PERCENT,
            Self::NotVentricles { tissue_percent, far_percent } => {
                tissue_percent.max(*far_percent) >= OF_SOMETHING_ELSE_PERCENT
            }
            // Without them their fluid passes for fluid of the sulci: it is filled up where it is narrow, and a hole where it is wide.
            Self::NoVentricle => true,
            Self::PoseOff { deg, shift_mm } => *deg >= OTHER_POSE_DEG || *shift_mm >= OTHER_POSE_MM,
            Self::LeavesOut { brain, percent, parts } => brain.leaves_too_much(parts, *percent),
            _ => false,
        }
    }
}

/// "left temporal lobe: 18 % lies outside the scan (cerebellum: 7 %)".
fn in_words(parts: &[(Region, f64)], what: &str) -> String {
    let of = |(region, percent): &(Region, f64)| format!("{region}: {percent:.0} %");
    let others: Vec<String> = parts.iter().skip(1).map(of).collect();
    let first = parts.first().map(|first| format!("{} {what}", of(first))).unwrap_or_default();
    if others.is_empty() { first } else { format!("{first} ({})", others.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cavity_drawn_over_living_tissue_is_not_believed_and_one_with_blood_in_it_is() {
        assert!(SegmentWarning::UnchangedCavity { percent: 100.0 }.belies_the_masks());
        assert!(SegmentWarning::NoVentricle.belies_the_masks());
        assert!(!SegmentWarning::UnchangedCavity { percent: 60.0 }.belies_the_masks());
        assert!(
            !SegmentWarning::UnlikeScans { folds: 0.3 }.belies_the_masks(),
            "the masks were given to go on all the same"
        );
    }
}
