//! Stage `registration`: post to pre with the skull on, pre to MNI with the template's mask dilated.

use super::earlier::Earlier;
use super::reading::WithReading;
use crate::artefact::{Produced, Stage};
use crate::experiment::outcome::{GIVEN_BY_HAND, RegistrationOutcome};
use crate::experiment::resection::GravityFrame;
use crate::geometry::{Frame, Mni, Position, Post, Pre, RigidTransform};
use crate::image::{Grid, LabelMap, Volume};
use crate::layout;
use crate::register::transform_text::{rigid_from_text, to_itk_text, to_matrix_text};
use crate::register::{FitWarning, RigidFit, register_two_scans};
use crate::segment::{pose_of_head, pose_of_head_from, pose_of_labels};
use crate::workflow::case::Case;
use crate::workflow::error::WorkflowError;
use crate::workflow::inputs::{HandPose, OwnMasks, ScanSums, Scans};
use crate::workflow::stage_name::StageName;
use crate::workflow::warning::{Warning, all_of};
use crate::workflow::work::{Made, Work, facts};
use nalgebra::{Point3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 8;
const NAME: StageName = StageName::Registration;
/// What the pose is called, and how what is odd about it begins.
pub(crate) const OF_POSE: &str = "pre to MNI";

/// What the report says of the two fits.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RegistrationFacts {
    /// Post to pre, then pre to MNI.
    pub fits: Vec<RegistrationOutcome>,
    /// Why the fit of the second scan is not to be believed, a sentence each.
    #[serde(default)]
    pub implausible: Vec<String>,
}

/// The stage with its settings and inputs.
pub(crate) fn registration_stage(work: &Work<'_>, sums: &ScanSums) -> Stage {
    let posed = WithReading { settings: &work.settings.register, image: work.settings.image };
    work.stage(&Made::default(), &NAME, VERSION, &posed)
        .input_sha256("pre", &sums.pre)
        .input_sha256("post", &sums.post)
        .frame(Mni::NAME)
}

/// Fits both scans and writes both transforms as text and as ITK .tfm.
pub(crate) fn registration(
    work: &Work<'_>,
    made: &mut Made,
    scans: &Scans,
    own: &OwnMasks,
    earlier: Option<&Earlier>,
) -> Result<RegistrationFacts, WorkflowError> {
    let settings = &work.settings.register;
    let stage = registration_stage(work, &scans.sums);
    let stage = own.posing().fold(stage, |stage, (role, bytes)| stage.input(&role.to_string(), bytes));
    work.run(made, &NAME, &stage, || {
        work.tell(|p| p.begin("registration", 2));
        work.tell(|p| p.doing("post to pre"));
        let refused = |what| move |source| WorkflowError::Registration { what, source };
        let pre_from_post = register_two_scans(&scans.post, &scans.pre, settings)
            .map_err(refused("the post-operative scan (moving) onto the pre-operative one (fixed)"))?;
        work.tell(|p| p.step());
        work.tell(|p| p.doing(OF_POSE));
        let mut produced = Produced::default();
        produced.warn(&scans.warnings);
        produced.warn(all_of("post to pre", &pre_from_post.warnings));
        let given = (own.pose.as_ref(), own.labels.as_ref().map(|(labels, _)| labels));
        let (text, itk) = (layout::MNI_FROM_PRE_TEXT, layout::MNI_FROM_PRE_ITK);
        let fit = if let Some(earlier) = earlier {
            // As they stand: a number read and written again may differ in its last digit.
            for name in [text, itk] {
                produced.files.push((name.to_owned(), earlier.case.read(name)?));
            }
            produced.warnings.extend_from_slice(&earlier.fit.1);
            earlier.fit.0.clone()
        } else {
            let (mni_from_pre, fit, odd) = pose_of(&scans.pre, given)?;
            produced.warn(&odd);
            write_transform(&mut produced, text, itk, &mni_from_pre);
            fit
        };
        work.tell(|p| p.end());
        let (text, itk) = (layout::PRE_FROM_POST_TEXT, layout::PRE_FROM_POST_ITK);
        write_transform(&mut produced, text, itk, &pre_from_post.fixed_from_moving);
        let fits = vec![outcome(&pre_from_post, &scans.post.grid), fit];
        let implausible = denied(&pre_from_post.warnings);
        produced.facts = facts(&RegistrationFacts { fits, implausible });
        Ok(produced)
    })
}

/// Why the second scan's fit is not to be believed. Masks of one's own say that two scans are one person's, not which side is which,
/// nor that one was found to lie on the other.
fn denied(warnings: &[FitWarning]) -> Vec<String> {
    let denying = warnings.iter().filter(|warning| warning.denies_the_fit());
    denying.map(|warning| format!("post to pre: {warning}")).collect()
}

/// A pose, how it was found, and what was odd about it.
type FoundPose = (RigidTransform<Pre, Mni>, RegistrationOutcome, Vec<Warning>);

/// The pose of the pre-operative scan in the MNI frame, given, or found from a label map or from the scan; and what was odd about
/// it.
pub(super) fn pose_of(
    pre: &Volume<f32, Pre>,
    (given, labels): (Option<&HandPose>, Option<&LabelMap<Pre>>),
) -> Result<FoundPose, WorkflowError> {
    let found = match (labels, given) {
        // A label map says where the brain is, whatever the scan's contrast.
        (Some(labels), _) => pose_of_labels(labels),
        (None, Some(HandPose { start: true, mni_from_pre, .. })) => pose_of_head_from(pre, mni_from_pre),
        (None, _) => pose_of_head(pre),
    };
    if let Some(HandPose { start: false, mni_from_pre: pose, .. }) = given {
        // Where none is found there is nothing to hold it against: that is what it is given for.
        let far = found.ok().and_then(|found| far_from(pose, &found.fixed_from_moving));
        return Ok((*pose, by_hand(pose, &pre.grid), far.map(|far| far.of(OF_POSE)).into_iter().collect()));
    }
    let what = "the pre-operative scan (moving) onto the MNI template (fixed)";
    let found = found.map_err(|source| WorkflowError::Registration { what, source })?;
    Ok((found.fixed_from_moving, outcome(&found, &pre.grid), all_of(OF_POSE, &found.warnings).collect()))
}

/// What to say of a pose by hand that is not near the one found: nobody draws one as well, but nobody misses by so much.
fn far_from(by_hand: &RigidTransform<Pre, Mni>, found: &RigidTransform<Pre, Mni>) -> Option<Warning> {
    const FAR_DEG: f64 = 8.0;
    const FAR_MM: f64 = 12.0;
    /// The middle of the template's brain, mm.
    const MIDDLE: [f64; 3] = [0.0, -18.0, 8.0];
    let middle = found.inverse().apply(Position::new(MIDDLE[0], MIDDLE[1], MIDDLE[2]));
    let apart_mm = by_hand.apply(middle).distance_mm(&found.apply(middle));
    let turned_deg = by_hand.rotation.angle_to(&found.rotation).to_degrees();
    (apart_mm > FAR_MM || turned_deg > FAR_DEG).then_some(Warning::PoseFarFromFound { apart_mm, turned_deg })
}

/// Post to pre, and pre to MNI.
type Poses = (RigidTransform<Post, Pre>, RigidTransform<Pre, Mni>);

/// The two transforms of a case, as the files hold them.
pub(crate) fn transforms(case: &Case) -> Result<Poses, WorkflowError> {
    let post = layout::PRE_FROM_POST_TEXT;
    Ok((rigid_from_text(&case.read_text(post)?, post)?, pose(case)?))
}

/// Pre to MNI, as the file holds it.
pub(crate) fn pose(case: &Case) -> Result<RigidTransform<Pre, Mni>, WorkflowError> {
    let pre = layout::MNI_FROM_PRE_TEXT;
    Ok(rigid_from_text(&case.read_text(pre)?, pre)?)
}

/// What turns a vector of the frame that gravity is given in to the MNI frame.
pub(crate) fn mni_from_gravity_frame(case: &Case, frame: GravityFrame) -> Result<UnitQuaternion<f64>, WorkflowError> {
    let (pre_from_post, mni_from_pre) = transforms(case)?;
    Ok(match frame {
        GravityFrame::Mni => UnitQuaternion::identity(),
        GravityFrame::Pre => mni_from_pre.rotation,
        GravityFrame::Post => pre_from_post.then(&mni_from_pre).rotation,
    })
}

pub(super) fn write_transform<M: Frame, F: Frame>(
    produced: &mut Produced,
    text: &str,
    itk: &str,
    transform: &RigidTransform<M, F>,
) {
    produced.files.push((text.to_owned(), to_matrix_text(transform).into_bytes()));
    produced.files.push((itk.to_owned(), to_itk_text(transform).into_bytes()));
}

fn outcome<M: Frame, F: Frame>(fit: &RigidFit<M, F>, moving: &Grid<M>) -> RegistrationOutcome {
    RegistrationOutcome {
        similarity: "Mattes mutual information (nats)".to_owned(),
        similarity_after: Some(fit.quality.mutual_information),
        ..by_hand(&fit.fixed_from_moving, moving)
    }
}

/// A transform that nothing was compared for.
fn by_hand<M: Frame, F: Frame>(transform: &RigidTransform<M, F>, moving: &Grid<M>) -> RegistrationOutcome {
    let centre = moving.position(Point3::from(moving.dims.map(|n| (n as f64 - 1.0) / 2.0)));
    let moved = transform.apply(centre).mm - centre.mm;
    RegistrationOutcome {
        moving: M::NAME.to_owned(),
        fixed: F::NAME.to_owned(),
        rotation_deg: transform.rotation.angle().to_degrees(),
        translation_mm: moved.into(),
        similarity: GIVEN_BY_HAND.to_owned(),
        similarity_before: None,
        similarity_after: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_fit_that_hardly_stands_out_is_no_more_believed_than_one_of_a_mirrored_head() {
        let low = FitWarning::LowSimilarity { normalised_information: 0.03, distinctness: 1.2 };
        let mirrored = |mirrored_ratio| FitWarning::MirrorFitsBetter { mirrored_ratio };
        let said = denied(&[low, mirrored(1.01), mirrored(1.4), FitWarning::LittleOverlap { overlap: 0.3 }]);
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(
            said[0].starts_with("post to pre: the images hardly resemble") && said[1].contains("mirror"),
            "{said:?}"
        );
    }

    #[test]
    fn a_pose_by_hand_is_held_against_the_one_found() {
        let found = RigidTransform::about(Point3::origin(), Vector3::new(0.1, 0.0, 0.2), Vector3::new(5.0, -20.0, 9.0));
        let moved = |turn: f64, shift: f64| {
            let by: RigidTransform<Mni, Mni> = RigidTransform::about(
                Point3::new(0.0, -18.0, 8.0),
                Vector3::new(turn, 0.0, 0.0),
                Vector3::new(0.0, shift, 0.0),
            );
            far_from(&found.then(&by), &found)
        };
        assert_eq!(moved(0.0, 0.0), None);
        assert_eq!(moved(0.1, 8.0), None);
        let Some(Warning::PoseFarFromFound { apart_mm, turned_deg }) = moved(0.2, 15.0) else { panic!() };
        assert!((apart_mm - 15.0).abs() < 1e-9 && (turned_deg - 0.2f64.to_degrees()).abs() < 1e-9);
        assert!(moved(0.2, 0.0).is_some() && moved(0.0, -15.0).is_some());
    }
}
