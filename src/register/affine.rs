//! Size and shears of a head that already lies nearly right: an affine map held to what heads are like.

use super::bfgs::Stopping;
use super::mutual_information::Pose;
use super::search::{Freedom, Level, TETHER, optimise};
use super::whole_head::{MeanHead, Prepared, Subject, level, likelier_first, likeness, search_level};
use crate::geometry::{AffineTransform, Frame, Native};
use crate::image::{Mask, Volume};
use nalgebra::Matrix3;

/// Sizes that the search begins from, one after the other until it is certain: the mean head's own, a small child's, and more
/// than a large man's. From a start a sixth too small the folds line up with others.
const SIZES: [f64; 3] = [1.0, 0.88, 1.14];
/// Local correlation with the mean head above which nothing else is tried. The bare brain agrees by half with a whole head
/// that is a fifth too small: scalp lies then where pia is expected.
const CERTAIN: f64 = 0.6;

/// The affine map from the mean head to a head that lies rigidly aligned with it.
///
/// Agreement of neighbourhoods over the head with its skull (without, where the scan has none) at 4 mm, from the mean size and
/// where need be from others, with a Gaussian prior of stretches and shears; from there mutual information at 2 mm, taken
/// where the anatomy then agrees better: contrast agent in the dura, or a coil's shading, can lead a histogram to another
/// size. Points outside `known` are left out.
#[must_use]
pub fn subject_from_mean_head<F: Frame>(
    subject: &Volume<f32, F>,
    head: &MeanHead<F>,
    known: Option<&Mask<F>>,
) -> AffineTransform<F, F> {
    let subject = Subject::new(&subject.clone().relabelled(), known.map(|k| k.clone().relabelled::<Native>()).as_ref());
    let centre = head.centre_mm();
    let aligned = Pose { linear: Matrix3::identity(), centre, target: centre };
    let climbed = |level: &Level<'_>, from: &Pose| {
        let stopping = Stopping {
            longest_step_mm: 0.5 * level.spacing_mm,
            shortest_step_mm: 0.02 * level.spacing_mm,
            evaluations: 40,
        };
        optimise(level, from, Freedom::Affine(TETHER), None, stopping).pose
    };
    let looks = likelier_first(head, &subject, &aligned);
    let starts = looks.iter().flat_map(|look| SIZES.map(|size| (look, size)));
    let mut best: Option<(f64, Pose, &Prepared)> = None;
    for (look, size) in starts {
        if best.as_ref().is_some_and(|(likely, ..)| *likely >= CERTAIN) {
            break;
        }
        let search = search_level(look, &subject, 1, 30_000);
        let pose = climbed(&search, &Pose { linear: Matrix3::from_diagonal_element(size), ..aligned });
        let likely = likeness(look, &subject, &pose);
        if best.as_ref().is_none_or(|(other, ..)| likely > *other) {
            best = Some((likely, pose, look));
        }
    }
    let Some((agreed, mut pose, look)) = best else { return AffineTransform::identity() };
    let informed = climbed(&level(look, &subject, 2, 60_000), &pose);
    if likeness(look, &subject, &informed) >= agreed {
        pose = informed;
    }
    AffineTransform::from_parts(pose.linear, pose.target - pose.linear * pose.centre)
}
