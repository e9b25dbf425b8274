//! Size and shears of a head that already lies nearly right: an affine map held to what heads are like.

use super::bfgs::Stopping;
use super::mutual_information::Pose;
use super::search::{Freedom, Level, TETHER, optimise};
use super::whole_head::{MeanHead, Subject, level, likelier, likeness, search_level};
use crate::geometry::{AffineTransform, Frame, Native};
use crate::image::{Mask, Volume};
use nalgebra::Matrix3;

/// The affine map from the mean head to a head that lies rigidly aligned with it.
///
/// Agreement of neighbourhoods over the head with its skull (without, where the scan has none) at 4 mm, from the identity,
/// with a Gaussian prior of stretches and shears; from there mutual information at 2 mm, taken where the anatomy then
/// agrees better: contrast agent in the dura, or a coil's shading, can lead a histogram to another size. Points outside
/// `known` are left out.
#[must_use]
pub fn subject_from_mean_head<F: Frame>(
    subject: &Volume<f32, F>,
    head: &MeanHead<F>,
    known: Option<&Mask<F>>,
) -> AffineTransform<F, F> {
    let subject = Subject::new(&subject.clone().relabelled(), known.map(|k| k.clone().relabelled::<Native>()).as_ref());
    let centre = head.centre_mm();
    let aligned = Pose { linear: Matrix3::identity(), centre, target: centre };
    let prepared = likelier(head, &subject, &aligned);
    let climbed = |level: &Level<'_>, from: &Pose| {
        let stopping = Stopping {
            longest_step_mm: 0.5 * level.spacing_mm,
            shortest_step_mm: 0.02 * level.spacing_mm,
            evaluations: 40,
        };
        optimise(level, from, Freedom::Affine(TETHER), None, stopping).pose
    };
    let agreed = climbed(&search_level(&prepared, &subject, 1, 30_000), &aligned);
    let informed = climbed(&level(&prepared, &subject, 2, 60_000), &agreed);
    let better = likeness(&prepared, &subject, &informed) >= likeness(&prepared, &subject, &agreed);
    let pose = if better { informed } else { agreed };
    AffineTransform::from_parts(pose.linear, pose.target - pose.linear * pose.centre)
}
