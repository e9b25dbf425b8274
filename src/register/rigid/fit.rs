//! From two images to the pose between them, coarse to fine.

use super::side::Side;
use super::{FitQuality, RegisterError, RigidSettings};
use crate::geometry::{Native, Position, RigidTransform};
use crate::image::{Mask, Volume};
use crate::register::bfgs::Stopping;
use crate::register::bspline::prefilter;
use crate::register::head;
use crate::register::mutual_information::{Bins, Interpolated, Pose};
use crate::register::pyramid::{on_grid_of, reduced_to};
use crate::register::sample::{Draw, draw};
use crate::register::search::{
    Freedom, Level, Measure, Optimum, Reach, TETHER, coarse, optimise, rank, turns_about_axes,
};
use nalgebra::Matrix3;

/// Resolution at which a head is told from air, mm.
const HEAD_MM: f64 = 4.0;

/// An image and its foreground at one resolution.
struct Reduced {
    image: Volume<f32, Native>,
    coefficients: Volume<f32, Native>,
    spacing_mm: f64,
}

/// The image at each resolution, coarse to fine; coarser ones are made from finer ones.
fn pyramid(image: &Volume<f32, Native>, levels_mm: &[f64]) -> Vec<Reduced> {
    let mut out: Vec<Reduced> = Vec::new();
    for &spacing_mm in levels_mm.iter().rev() {
        let image = reduced_to(out.last().map_or(image, |finer| &finer.image), spacing_mm);
        let mut coefficients = image.clone();
        let spacing = image.grid.spacing_mm();
        let thinnest = spacing.into_iter().fold(f64::INFINITY, f64::min);
        for axis in (0..3).filter(|&a| spacing[a] > 1.5 * thinnest) {
            prefilter(&mut coefficients, axis);
        }
        out.push(Reduced { image, coefficients, spacing_mm });
    }
    out.reverse();
    out
}

/// Both images at every resolution, with where they count.
struct Pair<'a> {
    settings: &'a RigidSettings,
    sampled: Vec<Reduced>,
    other: Vec<Reduced>,
    sampled_head: Mask<Native>,
    other_head: Mask<Native>,
    /// A mask of the other image is asked at each of its resolutions.
    other_masks: Vec<Option<Mask<Native>>>,
}

impl<'a> Pair<'a> {
    fn new(sampled: &Side, other: &Side, levels_mm: &[f64], settings: &'a RigidSettings) -> Self {
        let (sampled_levels, other_levels) =
            rayon::join(|| pyramid(&sampled.image, levels_mm), || pyramid(&other.image, levels_mm));
        let head_of = |side: &Side, levels: &[Reduced]| {
            side.mask.clone().unwrap_or_else(|| head::foreground(&levels[levels.len().min(2) - 1].image))
        };
        Self {
            settings,
            sampled_head: head_of(sampled, &sampled_levels),
            other_head: head_of(other, &other_levels),
            other_masks: other_levels.iter().map(|l| other.mask.as_ref().map(|m| on_grid_of(m, &l.image))).collect(),
            sampled: sampled_levels,
            other: other_levels,
        }
    }

    /// One resolution, each with a draw of its own.
    fn level(&self, n: usize, most: usize, bins: usize) -> Level<'_> {
        let (s, o) = (&self.sampled[n], &self.other[n]);
        let spacing = o.image.grid.spacing_mm().into_iter().fold(f64::INFINITY, f64::min);
        let request = Draw {
            most,
            other_spacing_mm: spacing,
            bins,
            range: head::range_inside(&s.image, &self.sampled_head),
            centre_mm: head::centre_mm(&self.sampled_head),
            seed: self.settings.seed + n as u64,
        };
        Level {
            measure: Measure::Information,
            samples: draw(&s.image, &self.sampled_head, &request),
            other: Interpolated {
                image: &o.coefficients,
                mask: self.other_masks[n].as_ref(),
                range: head::range_inside(&o.image, &self.other_head),
            },
            bins: Bins { sampled: bins, interpolated: bins + 4 },
            spacing_mm: s.spacing_mm,
        }
    }

    fn finest(&self) -> Stopping {
        let spacing_mm = self.sampled.last().map_or(1.0, |level| level.spacing_mm);
        Stopping { longest_step_mm: 0.5 * spacing_mm, shortest_step_mm: self.settings.tolerance_mm, evaluations: 60 }
    }
}

/// The pose near one that is known (from the sampled image to the other one), at the finest resolution.
pub(super) fn fit_near(
    sampled: &Side,
    other: &Side,
    near: &RigidTransform<Native, Native>,
    settings: &RigidSettings,
) -> Result<Pose, RegisterError> {
    let finest_mm = settings.levels_mm.last().copied().unwrap_or(1.0);
    // Only the last is looked at; the head is found on the second.
    let levels_mm = [settings.start_level_mm, HEAD_MM.max(finest_mm), finest_mm];
    let pair = Pair::new(sampled, other, &levels_mm, settings);
    let finest = levels_mm.len() - 1;
    let level = pair.level(finest, settings.samples.max(20_000), settings.histogram_bins);
    if level.samples.len() < 64 {
        return Err(RegisterError::NoOverlap);
    }
    let centre = head::centre_mm(&pair.sampled_head);
    let target = near.apply(Position::from_point(centre.into())).mm.coords;
    let start = Pose { linear: *near.rotation.to_rotation_matrix().matrix(), centre, target };
    Ok(optimise(&level, &start, Freedom::Rigid, None, pair.finest()).pose)
}

/// The pose that takes the sampled image onto the other one, how far it can be trusted, and the linear map near it that would
/// do so best.
pub(super) fn fit(
    sampled: &Side,
    other: &Side,
    settings: &RigidSettings,
) -> Result<(Pose, FitQuality, Matrix3<f64>), RegisterError> {
    let mut levels_mm = vec![settings.start_level_mm];
    levels_mm.extend(&settings.levels_mm);
    let pair = Pair::new(sampled, other, &levels_mm, settings);
    let centre = head::centre_mm(&pair.sampled_head);
    let target = head::centre_mm(&pair.other_head);
    let level = |n: usize, most: usize, bins: usize| pair.level(n, most, bins);

    let bins = settings.histogram_bins;
    let start_level = level(0, 3000, bins.min(24));
    if start_level.samples.len() < 64 {
        return Err(RegisterError::NoOverlap);
    }
    let aligned = Pose { linear: Matrix3::identity(), centre, target };
    let as_they_lie = Pose { target: centre, ..aligned };
    let turns = turns_about_axes(20f64.to_radians());
    let reach = Reach {
        turns: turns.clone(),
        shifts_mm: [vec![-20.0, 0.0, 20.0], vec![-25.0, 0.0, 25.0], vec![-50.0, -25.0, 0.0, 25.0, 50.0]],
        scales: vec![1.0],
        freedom: Freedom::Rigid,
    };
    let (starts, ordinary) = coarse(&start_level, &[aligned, as_they_lie], &reach, 4);
    if starts.is_empty() || ordinary <= 0.0 {
        return Err(RegisterError::NoOverlap);
    }
    let distinctness = rank(&start_level, vec![starts[0]])[0].0 / ordinary;

    let first = level(1, 20_000, bins.min(32));
    let refined = refine_all(&first, &starts);
    let mut pose = rank(&first, refined)[0].1;

    let mirrored_ratio = settings.try_mirror.then(|| {
        // The same search for the mirror image: the sampled head reflected in its own left-right axis.
        let mut mirror = Matrix3::identity();
        mirror[(0, 0)] = -1.0;
        let mirrored = Pose { linear: pose.linear * mirror, ..pose };
        let shifts_mm = [vec![-10.0, 0.0, 10.0], vec![0.0], vec![0.0]];
        let narrow = Reach { turns: turns.clone(), shifts_mm, ..reach };
        let (starts, _) = coarse(&start_level, &[mirrored], &narrow, 2);
        let best = rank(&first, refine_all(&first, &starts)).first().map_or(0.0, |r| r.0);
        best / rank(&first, vec![pose])[0].0.max(1e-12)
    });

    let mut inverse_hessian = None;
    let mut evaluations = 0;
    let mut last = None;
    for n in 1..levels_mm.len() {
        let finest = n + 1 == levels_mm.len();
        // Half the points per halving of the spacing: coarse levels need to come close, no more.
        let most = (settings.samples >> (levels_mm.len() - 1 - n)).max(20_000);
        let level = level(n, most, bins);
        let coarser = Stopping {
            longest_step_mm: 0.5 * level.spacing_mm,
            shortest_step_mm: 0.01 * level.spacing_mm,
            evaluations: 60,
        };
        let stopping = if finest { pair.finest() } else { coarser };
        let Optimum { pose: found, inverse_hessian: h, evaluations: used } =
            optimise(&level, &pose, Freedom::Rigid, inverse_hessian.take(), stopping);
        pose = found;
        inverse_hessian = Some(h);
        evaluations += used;
        if finest {
            last = Some(level.at(&pose));
        }
    }
    let last = last.ok_or(RegisterError::NoOverlap)?;
    let quality = FitQuality {
        likeness: None,
        mutual_information: last.mutual_information,
        normalised_information: last.mutual_information / last.entropy.max(1e-12),
        overlap: last.overlap,
        distinctness,
        mirrored_ratio,
        evaluations,
        size: None,
    };
    let stopping = Stopping {
        longest_step_mm: 0.5 * first.spacing_mm,
        shortest_step_mm: 0.01 * first.spacing_mm,
        evaluations: 60,
    };
    let linear = optimise(&first, &pose, Freedom::Affine(TETHER), None, stopping).pose.linear;
    Ok((pose, quality, linear))
}

fn refine_all(level: &Level<'_>, poses: &[Pose]) -> Vec<Pose> {
    let stopping =
        Stopping { longest_step_mm: level.spacing_mm, shortest_step_mm: 0.02 * level.spacing_mm, evaluations: 40 };
    poses.iter().map(|p| optimise(level, p, Freedom::Rigid, None, stopping).pose).collect()
}
