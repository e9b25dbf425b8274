//! Size and shears of a head that already lies nearly right: an affine map held to what heads are like.

use super::bfgs::Stopping;
use super::mutual_information::Pose;
use super::search::{Freedom, TETHER, optimise};
use super::whole_head::{MeanHead, Subject, level, likelier};
use crate::geometry::{AffineTransform, Frame, Native};
use crate::image::{Mask, Volume};
use nalgebra::Matrix3;

/// The affine map from the mean head to a head that lies rigidly aligned with it.
///
/// Mutual information over the head with its skull (without, where the scan has none) at 4 and 2 mm, from the identity,
/// with a Gaussian prior of stretches and shears. Points outside `known` are left out.
#[must_use]
pub fn subject_from_mean_head<F: Frame>(
    subject: &Volume<f32, F>,
    head: &MeanHead<F>,
    known: Option<&Mask<F>>,
) -> AffineTransform<F, F> {
    let subject = Subject::new(&subject.clone().relabelled(), known.map(|k| k.clone().relabelled::<Native>()).as_ref());
    let centre = head.centre_mm();
    let mut pose = Pose { linear: Matrix3::identity(), centre, target: centre };
    let prepared = likelier(head, &subject, &pose);
    for n in [1, 2] {
        let level = level(&prepared, &subject, n, if n == 1 { 30_000 } else { 60_000 });
        let stopping = Stopping {
            longest_step_mm: 0.5 * level.spacing_mm,
            shortest_step_mm: 0.02 * level.spacing_mm,
            evaluations: 40,
        };
        pose = optimise(&level, &pose, Freedom::Affine(TETHER), None, stopping).pose;
    }
    AffineTransform::from_parts(pose.linear, pose.target - pose.linear * pose.centre)
}
