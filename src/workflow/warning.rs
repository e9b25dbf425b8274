//! What a reader must know of the files of a job: its kind with the values. Manifests, outcomes and pages keep the sentence.

use crate::fem::FemWarning;
use crate::image::nifti::NiftiWarning;
use crate::mesh::format::gifti::Space;
use crate::overlay::{Drawing, NotCarried};
use crate::register::FitWarning;
use crate::segment::SegmentWarning;
use crate::tag::TagWarning;
use crate::workflow::lost_label::LostLabel;
use serde::{Serialize, Serializer};
use std::fmt::Display;
use thiserror::Error;

/// What a reader must know of the files of a job.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum Warning {
    /// Of a scan (`pre`), a fit (`pre to MNI`) or a file, by name.
    #[error("{whose}: {warning}")]
    Of { whose: String, warning: Box<Warning> },
    #[error(transparent)]
    Image(#[from] NiftiWarning),
    #[error(transparent)]
    Fit(#[from] FitWarning),
    #[error(transparent)]
    Head(#[from] SegmentWarning),
    #[error(transparent)]
    Set(#[from] TagWarning),
    #[error(transparent)]
    Drawing(#[from] NotCarried),
    #[error(transparent)]
    Simulation(#[from] FemWarning),
    #[error(
        "the pose given lies {apart_mm:.0} mm and {turned_deg:.0} degrees from the one found; it is used as it is: look at how the \
         brain lies before trusting the boundary sets and the direction of gravity"
    )]
    PoseFarFromFound { apart_mm: f64, turned_deg: f64 },
    #[error(
        "{file}: it says Talairach's space, which programs also write of surfaces in the scanner's frame, and is taken for one of those: \
         look at where it lies"
    )]
    SaysTalairach { file: String },
    #[error(
        "{file}: {percent:.1} % of it leave the image or lie beyond the field, and are not in the result: give the image more room \
         around it, or a larger field"
    )]
    LeftBehind { file: String, percent: f64 },
    #[error("both files hold the same bytes: was one image given twice?")]
    SameBytes,
    #[error("{plan}: {percent:.0} % of it lie outside the scan and count for nothing")]
    PlanBesideScan { plan: String, percent: f64 },
    #[error("{plan}: {percent:.0} % of what is to be taken lies outside the brain and counts for nothing")]
    PlanOutsideBrain { plan: String, percent: f64 },
    #[error("a part of {tissue} of {:.2} cc lay apart and was left out of the mesh", volume_mm3 / 1000.0)]
    Island { tissue: &'static str, volume_mm3: f64 },
    #[error(
        "{cc:.1} cc of tissue ({parts}) are cut off from the rest of the brain and left out of the mesh, as if they were not there: \
         look at the labels around them; what a resection cuts off belongs to what is taken"
    )]
    CutOff { cc: f64, parts: String },
    #[error(
        "{cc:.1} cc of fluid within the brain (an old stroke, a cyst, ventricles that the map does not label) are a hole of the body: nothing \
         presses on its wall; look at the labels where there is none"
    )]
    EnclosedFluid { cc: f64 },
    #[error(transparent)]
    Lost(#[from] LostLabel),
    #[error("{sample} is left out: its body finds no equilibrium under this load")]
    SampleLeftOut { sample: String },
    #[error("{model}: left out: {reason}")]
    ModelLeftOut { model: String, reason: String },
    #[error(
        "head {head}, supports {supports}: {unbalanced} of {draws} draws are so heavy and soft that they find no equilibrium; they are \
         read from lighter ones, and how far the brain may move at most is less sure"
    )]
    UnbalancedDraws { head: String, supports: String, unbalanced: usize, draws: usize },
    #[error(
        "{draws} draws are few: of so few of Halton's points some unknowns go together that should not, and intervals of 95 % have next \
         to no draws beyond their ends; give {} or more (`draws` of the table [predict], --draws)",
        crate::experiment::predict::ENOUGH_DRAWS
    )]
    FewDraws { draws: usize },
    #[error("{state}: tissue folds over at {voxels} voxels; the displacement field is smoothed there and not believed")]
    Folds { state: String, voxels: usize },
    #[error("its quality gate is not passed ({why}): look at its page before trusting what it carries")]
    GateNotPassed { why: String },
    #[error("is of an earlier run with more plans, and not in this comparison: delete it where it is wanted no more")]
    EarlierPlan,
    #[error("the best sample is not the one nearest to the reference's moduli")]
    OtherSampleIsBest,
}

impl Warning {
    /// The same of whom it is about.
    #[must_use]
    pub fn of(self, whose: impl Display) -> Self {
        Self::Of { whose: whose.to_string(), warning: Box::new(self) }
    }
}

/// What to say of a drawing whose frame is in doubt.
pub(crate) fn says_talairach(drawing: &Drawing, file: &str) -> Option<Warning> {
    (drawing.declared() == Some(Space::Talairach)).then(|| Warning::SaysTalairach { file: file.to_owned() })
}

/// Warnings of a room, of whom they are about.
pub(crate) fn all_of<'a, W>(whose: &'a str, warnings: &'a [W]) -> impl Iterator<Item = Warning> + 'a
where
    W: Clone + Into<Warning>,
{
    warnings.iter().map(move |warning| warning.clone().into().of(whose))
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_is_kept_as_the_sentence_with_whom_it_is_about_before_it() {
        let odd = NiftiWarning::NotFinite { voxels: 2 };
        let of_scan = Warning::from(odd.clone()).of("pre");
        assert_eq!(serde_json::to_value(&of_scan).unwrap(), "pre: 2 voxels are NaN or infinite and were set to 0");
        assert_eq!(all_of("pre", std::slice::from_ref(&odd)).collect::<Vec<_>>(), [of_scan]);
        let twice = Warning::from(FitWarning::LittleOverlap { overlap: 0.4 }).of("pre to MNI").of("scan.nii");
        assert_eq!(
            twice.to_string(),
            "scan.nii: pre to MNI: only 40 % of the head lies in both images: check the fields of view"
        );
    }
}
