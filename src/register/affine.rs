//! Affine registration of a template to a head that already lies nearly right: sizes and shears before anything local.

use super::bfgs::Stopping;
use super::head;
use super::mutual_information::{Bins, Interpolated, Pose};
use super::pyramid::{on_grid_of, reduced_to};
use super::sample::{Draw, draw};
use super::search::{Freedom, Level, optimise};
use crate::geometry::Native;
use crate::image::{Mask, Volume};
use nalgebra::Matrix3;

/// Histogram bins on the template's axis.
const BINS: usize = 32;

/// The affine map from template points (inside `region`) to head points with the largest mutual information, searched at 4
/// and 2 mm from the identity. Points of `unknown` (on the head's grid) are left out.
pub(super) fn head_from_template(
    template: &Volume<f32, Native>,
    region: &Mask<Native>,
    head_image: &Volume<f32, Native>,
    known: Option<&Mask<Native>>,
) -> Pose {
    let centre = head::centre_mm(region);
    let mut pose = Pose { linear: Matrix3::identity(), centre, target: centre };
    for (spacing_mm, most) in [(4.0, 40_000), (2.0, 100_000)] {
        let (coarse_template, coarse_head) = (reduced_to(template, spacing_mm), reduced_to(head_image, spacing_mm));
        let known = known.map(|k| on_grid_of(k, &coarse_head));
        let spacing = coarse_head.grid.spacing_mm().into_iter().fold(f64::INFINITY, f64::min);
        let request = Draw {
            most,
            other_spacing_mm: spacing,
            bins: BINS,
            range: head::range_inside(&coarse_template, region),
            centre_mm: centre,
            seed: 1,
        };
        let level = Level {
            samples: draw(&coarse_template, region, &request),
            other: Interpolated {
                image: &coarse_head,
                mask: known.as_ref(),
                range: head::range_inside(&coarse_head, region),
            },
            bins: Bins { sampled: BINS, interpolated: BINS + 4 },
            spacing_mm,
        };
        let stopping =
            Stopping { longest_step_mm: 0.5 * spacing_mm, shortest_step_mm: 0.01 * spacing_mm, evaluations: 60 };
        pose = optimise(&level, &pose, Freedom::Rigid, None, stopping).pose;
        pose = optimise(&level, &pose, Freedom::Affine, None, stopping).pose;
    }
    pose
}
