//! Size and shears of a head that already lies nearly right: an affine map held to what heads are like.

use super::bfgs::Stopping;
use super::mutual_information::Pose;
use super::search::{Freedom, Level, TETHER, optimise};
use super::whole_head::{CLEAR, MeanHead, Subject, level, likelier, likeness, search_level};
use crate::geometry::{AffineTransform, Frame, Native};
use crate::image::{Mask, Volume};
use nalgebra::Matrix3;

/// Sizes that the search begins from where the mean head's own leads to nothing like a head: a small child's, and more than a
/// large man's. From a start a sixth too small the folds line up with others.
const OTHER_SIZES: [f64; 2] = [0.88, 1.14];

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
    let prepared = likelier(head, &subject, &aligned);
    let climbed = |level: &Level<'_>, from: &Pose| {
        let stopping = Stopping {
            longest_step_mm: 0.5 * level.spacing_mm,
            shortest_step_mm: 0.02 * level.spacing_mm,
            evaluations: 40,
        };
        optimise(level, from, Freedom::Affine(TETHER), None, stopping).pose
    };
    let search = search_level(&prepared, &subject, 1, 30_000);
    let from = |size: f64| climbed(&search, &Pose { linear: Matrix3::from_diagonal_element(size), ..aligned });
    let likely = |pose: Pose| (likeness(&prepared, &subject, &pose), pose);
    let mut agreed = likely(from(1.0));
    for size in OTHER_SIZES {
        if agreed.0 >= CLEAR {
            break;
        }
        let other = likely(from(size));
        agreed = if other.0 > agreed.0 { other } else { agreed };
    }
    let informed = likely(climbed(&level(&prepared, &subject, 2, 60_000), &agreed.1));
    let (_, pose) = if informed.0 >= agreed.0 { informed } else { agreed };
    AffineTransform::from_parts(pose.linear, pose.target - pose.linear * pose.centre)
}
