//! Rigid registration of two images of one head, or of a head and a template.

use super::bfgs::Stopping;
use super::bspline::prefilter;
use super::head;
use super::mutual_information::{Bins, Interpolated, Pose};
use super::pyramid::reduced_to;
use super::sample::{Draw, draw};
use super::search::{Freedom, Level, Optimum, Reach, coarse, optimise, rank};
use crate::geometry::{Frame, Native, RigidTransform};
use crate::image::{Mask, Volume, morphology};
use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How a rigid registration is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigidSettings {
    /// Resolutions in mm, coarse to fine.
    pub levels_mm: Vec<f64>,
    /// Resolution of the search over starting poses, in mm.
    pub start_level_mm: f64,
    /// Bins of the joint histogram on each axis.
    pub histogram_bins: usize,
    /// About how many points are sampled at the finest level; coarser levels take what they have, up to this.
    pub samples: usize,
    /// A step shorter than this ends the search at the finest level, in mm.
    pub tolerance_mm: f64,
    /// Whether the mirror image is tried too, to warn of exchanged sides; useless against a symmetric template.
    pub try_mirror: bool,
    /// Seed of the sampling pattern.
    pub seed: u64,
}

impl Default for RigidSettings {
    fn default() -> Self {
        Self {
            levels_mm: vec![4.0, 2.0, 1.0],
            start_level_mm: 8.0,
            histogram_bins: 48,
            samples: 250_000,
            tolerance_mm: 1e-3,
            try_mirror: true,
            seed: 1,
        }
    }
}

/// Where the images count; `None` lets the head itself decide.
#[derive(Clone, Copy, Debug)]
pub struct RigidMasks<'a, M: Frame, F: Frame> {
    /// Region of the moving image.
    pub moving: Option<&'a Mask<M>>,
    /// Region of the fixed image.
    pub fixed: Option<&'a Mask<F>>,
}

impl<M: Frame, F: Frame> Default for RigidMasks<'_, M, F> {
    fn default() -> Self {
        Self { moving: None, fixed: None }
    }
}

/// The transform found and how far it can be trusted.
#[derive(Clone, Debug)]
pub struct RigidFit<M: Frame, F: Frame> {
    /// Maps a point of the moving image to the fixed image.
    pub fixed_from_moving: RigidTransform<M, F>,
    /// Figures behind the verdict.
    pub quality: FitQuality,
    /// What a person should look at.
    pub warnings: Vec<FitWarning>,
}

/// Figures that describe a fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FitQuality {
    /// Mutual information at the finest level, nats.
    pub mutual_information: f64,
    /// Mutual information over the smaller marginal entropy, 0 to 1.
    pub normalised_information: f64,
    /// Fraction of the sampled region that lies in the other image.
    pub overlap: f64,
    /// How many times the information of an ordinary wrong pose the best pose has, at the start level.
    pub distinctness: f64,
    /// Information of the best mirrored pose over that of the fit, at the coarsest level; above 1 the mirror fits
    /// better. `None` when it was not tried.
    pub mirrored_ratio: Option<f64>,
    /// Evaluations of mutual information with gradient.
    pub evaluations: usize,
}

/// A reason to look at the fit before believing it.
#[derive(Clone, Debug, PartialEq, Error, Serialize)]
pub enum FitWarning {
    /// The best pose hardly stands out.
    #[error(
        "the images hardly resemble each other (normalised information {normalised_information:.3}, {distinctness:.2} times a wrong pose): look at the overlay before using this transform"
    )]
    LowSimilarity {
        /// See [`FitQuality::normalised_information`].
        normalised_information: f64,
        /// See [`FitQuality::distinctness`].
        distinctness: f64,
    },
    /// Little of one image is seen in the other.
    #[error("only {:.0} % of the head lies in both images: check the fields of view", overlap * 100.0)]
    LittleOverlap {
        /// See [`FitQuality::overlap`].
        overlap: f64,
    },
    /// Left and right may be exchanged.
    #[error(
        "the mirror image fits better ({mirrored_ratio:.3} times the information): left and right may be exchanged in one header"
    )]
    MirrorFitsBetter {
        /// See [`FitQuality::mirrored_ratio`].
        mirrored_ratio: f64,
    },
}

/// Why two images could not be registered.
#[derive(Debug, Error, PartialEq)]
pub enum RegisterError {
    /// A voxel is NaN or infinite.
    #[error("the {which} image has {count} voxels that are not finite: replace them (for example by 0) first")]
    NotFinite {
        /// "moving" or "fixed".
        which: &'static str,
        /// How many voxels.
        count: usize,
    },
    /// All voxels are alike.
    #[error("the {which} image is constant ({value}): there is nothing to register; give the T1 image itself")]
    Constant {
        /// "moving" or "fixed".
        which: &'static str,
        /// The value.
        value: f32,
    },
    /// Too small to hold a head.
    #[error(
        "the {which} image has {} x {} x {} voxels: registration needs at least 8 along each axis", dims[0], dims[1], dims[2]
    )]
    TooSmall {
        /// "moving" or "fixed".
        which: &'static str,
        /// Voxels along each axis.
        dims: [usize; 3],
    },
    /// A mask has no voxel inside.
    #[error("the mask of the {which} image is empty: leave it out or give one with voxels inside")]
    EmptyMask {
        /// "moving" or "fixed".
        which: &'static str,
    },
    /// A setting has no meaning.
    #[error("the registration setting `{name}` is {value}: it must be {rule}")]
    Setting {
        /// The setting's name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// The images do not overlap at any pose tried.
    #[error("no pose was found at which the images share information: are both T1 images of a head?")]
    NoOverlap,
}

/// One image of the pair, without its frame.
struct Side {
    image: Volume<f32, Native>,
    mask: Option<Mask<Native>>,
}

/// An image and its foreground at one resolution.
struct Reduced {
    image: Volume<f32, Native>,
    coefficients: Volume<f32, Native>,
    spacing_mm: f64,
}

/// Finds the rigid motion that takes the moving image onto the fixed one.
///
/// Mattes' mutual information (Mattes et al. 2003) of the two images over the head with its skull, or inside the masks,
/// by a quasi-Newton search at 4, 2 and 1 mm, after a search over starting poses at 8 mm around aligned centres (turns to
/// 30 degrees, shifts to 60 mm). Values are read by smoothing B-splines off the voxel grid; along slices 1.5 times
/// thicker than the other image's voxels that image is averaged over the slice's thickness. Outside its field of view an
/// image is unknown. The result is the same on any number of threads.
///
/// # Errors
/// [`RegisterError`] when an image holds no information or the settings are out of range.
pub fn register_rigid<M: Frame, F: Frame>(
    moving: &Volume<f32, M>,
    fixed: &Volume<f32, F>,
    masks: RigidMasks<'_, M, F>,
    settings: &RigidSettings,
) -> Result<RigidFit<M, F>, RegisterError> {
    check_settings(settings)?;
    let moving = side("moving", moving, masks.moving)?;
    let fixed = side("fixed", fixed, masks.fixed)?;
    // The image with the thicker slices is sampled: its slices can be read as they are, and the finer image can be
    // averaged over their thickness. A mask names the region to sample, so it wins over a small difference.
    let thickness = |s: &Side| s.image.grid.spacing_mm().into_iter().fold(0.0, f64::max);
    let ratio = thickness(&moving) / thickness(&fixed);
    let sample_moving = if fixed.mask.is_some() && moving.mask.is_none() { ratio > 2.0 } else { ratio > 1.2 };
    let (sampled, other) = if sample_moving { (&moving, &fixed) } else { (&fixed, &moving) };
    let (pose, quality) = fit(sampled, other, settings)?;

    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.linear));
    let other_from_sampled: RigidTransform<Native, Native> =
        RigidTransform::new(rotation, pose.target - rotation * pose.centre);
    let fixed_from_moving = if sample_moving { other_from_sampled } else { other_from_sampled.inverse() };

    let mut warnings = Vec::new();
    let FitQuality { normalised_information, overlap, distinctness, mirrored_ratio, .. } = quality;
    if normalised_information < 0.05 || distinctness < 1.5 {
        warnings.push(FitWarning::LowSimilarity { normalised_information, distinctness });
    }
    if overlap < 0.5 {
        warnings.push(FitWarning::LittleOverlap { overlap });
    }
    if let Some(mirrored_ratio) = mirrored_ratio.filter(|&r| r > 1.0) {
        warnings.push(FitWarning::MirrorFitsBetter { mirrored_ratio });
    }
    Ok(RigidFit { fixed_from_moving: fixed_from_moving.relabelled(), quality, warnings })
}

/// Finds the rigid motion that takes a head onto a skull-stripped template.
///
/// As [`register_rigid`], over the template's brain (all that is not zero, 6 mm widened), without a mirrored trial: the
/// template is taken to be symmetric.
///
/// # Errors
/// As [`register_rigid`].
pub fn register_to_template<M: Frame, F: Frame>(
    moving: &Volume<f32, M>,
    template: &Volume<f32, F>,
    settings: &RigidSettings,
) -> Result<RigidFit<M, F>, RegisterError> {
    const MARGIN_MM: f64 = 6.0;
    let region = morphology::dilate(&template.map(|x| x > 0.0), MARGIN_MM);
    let masks = RigidMasks { moving: None, fixed: Some(&region) };
    register_rigid(moving, template, masks, &RigidSettings { try_mirror: false, ..settings.clone() })
}

fn check_settings(settings: &RigidSettings) -> Result<(), RegisterError> {
    let refuse = |name, value, rule| Err(RegisterError::Setting { name, value, rule });
    let first = settings.levels_mm.first().copied().unwrap_or(0.0);
    if !settings.levels_mm.iter().all(|&l| l > 0.0 && l <= 16.0) || first == 0.0 {
        return refuse("levels_mm", first, "one or more resolutions between 0 and 16 mm");
    }
    if !(settings.start_level_mm > 0.0 && settings.start_level_mm <= 16.0) {
        return refuse("start_level_mm", settings.start_level_mm, "between 0 and 16 mm");
    }
    if !(8..=255).contains(&settings.histogram_bins) {
        return refuse("histogram_bins", settings.histogram_bins as f64, "between 8 and 255");
    }
    if settings.samples < 1000 {
        return refuse("samples", settings.samples as f64, "at least 1000");
    }
    if !(settings.tolerance_mm > 0.0 && settings.tolerance_mm <= 1.0) {
        return refuse("tolerance_mm", settings.tolerance_mm, "above 0 and at most 1 mm");
    }
    Ok(())
}

fn side<F: Frame>(which: &'static str, image: &Volume<f32, F>, mask: Option<&Mask<F>>) -> Result<Side, RegisterError> {
    if image.grid.dims.iter().any(|&n| n < 8) {
        return Err(RegisterError::TooSmall { which, dims: image.grid.dims });
    }
    let count = image.data.iter().filter(|x| !x.is_finite()).count();
    if count > 0 {
        return Err(RegisterError::NotFinite { which, count });
    }
    let value = image.data[0];
    if image.data.iter().all(|&x| x == value) {
        return Err(RegisterError::Constant { which, value });
    }
    if mask.is_some_and(|m| m.count() == 0) {
        return Err(RegisterError::EmptyMask { which });
    }
    Ok(Side { image: image.clone().relabelled(), mask: mask.map(|m| m.clone().relabelled()) })
}

/// The image at each resolution, coarse to fine; coarser ones are made from finer ones.
fn pyramid(image: &Volume<f32, Native>, levels_mm: &[f64]) -> Vec<Reduced> {
    let mut finer = image.clone();
    let mut out: Vec<Reduced> = levels_mm
        .iter()
        .rev()
        .map(|&spacing_mm| {
            finer = reduced_to(&finer, spacing_mm);
            let mut coefficients = finer.clone();
            let spacing = finer.grid.spacing_mm();
            let thinnest = spacing.into_iter().fold(f64::INFINITY, f64::min);
            for axis in (0..3).filter(|&a| spacing[a] > 1.5 * thinnest) {
                prefilter(&mut coefficients, axis);
            }
            Reduced { image: finer.clone(), coefficients, spacing_mm }
        })
        .collect();
    out.reverse();
    out
}

fn fit(sampled: &Side, other: &Side, settings: &RigidSettings) -> Result<(Pose, FitQuality), RegisterError> {
    let mut levels_mm = vec![settings.start_level_mm];
    levels_mm.extend(&settings.levels_mm);
    let (sampled_levels, other_levels) = (pyramid(&sampled.image, &levels_mm), pyramid(&other.image, &levels_mm));
    let head_of = |side: &Side, levels: &[Reduced]| {
        side.mask.clone().unwrap_or_else(|| head::foreground(&levels[levels.len().min(2) - 1].image))
    };
    let (sampled_head, other_head) = (head_of(sampled, &sampled_levels), head_of(other, &other_levels));
    let centre = head::centre_mm(&sampled_head);
    let target = head::centre_mm(&other_head);

    // A mask of the other image is asked at each of its resolutions.
    let other_masks: Vec<Option<Mask<Native>>> =
        other_levels.iter().map(|l| other.mask.as_ref().map(|m| on_grid_of(m, &l.image))).collect();
    let level = |n: usize, most: usize, bins: usize| {
        let (s, o) = (&sampled_levels[n], &other_levels[n]);
        let spacing = o.image.grid.spacing_mm().into_iter().fold(f64::INFINITY, f64::min);
        let request = Draw {
            most,
            other_spacing_mm: spacing,
            bins,
            range: head::range_inside(&s.image, &sampled_head),
            centre_mm: centre,
            seed: settings.seed + n as u64,
        };
        Level {
            samples: draw(&s.image, &sampled_head, &request),
            other: Interpolated {
                image: &o.coefficients,
                mask: other_masks[n].as_ref(),
                range: head::range_inside(&o.image, &other_head),
            },
            bins: Bins { sampled: bins, interpolated: bins + 4 },
            spacing_mm: s.spacing_mm,
        }
    };

    let bins = settings.histogram_bins;
    let start_level = level(0, 3000, bins.min(24));
    if start_level.samples.len() < 64 {
        return Err(RegisterError::NoOverlap);
    }
    let aligned = Pose { linear: Matrix3::identity(), centre, target };
    let as_they_lie = Pose { target: centre, ..aligned };
    let turn = 20f64.to_radians();
    let reach = Reach {
        turns_rad: vec![-turn, 0.0, turn],
        shifts_mm: [vec![-20.0, 0.0, 20.0], vec![-25.0, 0.0, 25.0], vec![-50.0, -25.0, 0.0, 25.0, 50.0]],
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
        let narrow = Reach { turns_rad: reach.turns_rad.clone(), shifts_mm };
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
        let stopping = Stopping {
            longest_step_mm: 0.5 * level.spacing_mm,
            shortest_step_mm: if finest { settings.tolerance_mm } else { 0.01 * level.spacing_mm },
            evaluations: 60,
        };
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
        mutual_information: last.mutual_information,
        normalised_information: last.mutual_information / last.entropy.max(1e-12),
        overlap: last.overlap,
        distinctness,
        mirrored_ratio,
        evaluations,
    };
    Ok((pose, quality))
}

fn refine_all(level: &Level<'_>, poses: &[Pose]) -> Vec<Pose> {
    let stopping =
        Stopping { longest_step_mm: level.spacing_mm, shortest_step_mm: 0.02 * level.spacing_mm, evaluations: 40 };
    poses.iter().map(|p| optimise(level, p, Freedom::Rigid, None, stopping).pose).collect()
}

/// A mask read at the voxels of an image (nearest voxel).
pub(super) fn on_grid_of(mask: &Mask<Native>, image: &Volume<f32, Native>) -> Mask<Native> {
    let to_mask = mask.grid.voxel_from_mm() * image.grid.mm_from_voxel;
    Volume::from_fn(image.grid, |n| {
        let p = to_mask.transform_point(&Point3::from(image.grid.voxel(n).map(|i| i as f64)));
        mask.get(p.x.round() as isize, p.y.round() as isize, p.z.round() as isize).unwrap_or(false)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mni, Position, Post, Pre};
    use crate::image::Grid;
    use crate::register::synthetic_head::head_value;
    use nalgebra::{Matrix4, Vector3};

    /// The head as a scanner with this grid sees it at this pose, with noise.
    fn scan<F: Frame>(
        grid: &Grid<F>,
        head_from_scanner: &RigidTransform<F, Mni>,
        gamma: f64,
        seed: u64,
    ) -> Volume<f32, F> {
        let data = (0..grid.len()).map(|n| {
            let v: Vector3<f64> = Vector3::from(grid.voxel(n).map(|i| i as f64));
            let value = head_value(head_from_scanner.apply(grid.position(v.into())).mm);
            let noise: f64 = (0..4).map(|c| super::super::sample::uniform(seed, 4 * n as u64 + c) - 0.5).sum();
            (1000.0 * (value.max(0.0) / 1000.0).powf(gamma) + 25.0 * noise) as f32
        });
        Volume::from_data(*grid, data.collect())
    }

    fn largest_error_mm(found: &RigidTransform<Post, Pre>, truth: &RigidTransform<Post, Pre>) -> f64 {
        let corners = [[60.0, 0.0, 0.0], [-60.0, 0.0, 0.0], [0.0, 80.0, 0.0], [0.0, -80.0, 0.0], [0.0, 0.0, 65.0]];
        let error = |c: [f64; 3]| {
            let x = truth.inverse().apply(Position::new(c[0], c[1], c[2]));
            found.apply(x).distance_mm(&truth.apply(x))
        };
        corners.into_iter().map(error).fold(0.0, f64::max)
    }

    fn known_motion() -> (RigidTransform<Pre, Mni>, RigidTransform<Post, Mni>) {
        let centre = Point3::new(4.0, -6.0, 3.0);
        (
            RigidTransform::about(centre, Vector3::new(0.05, -0.03, 0.08), Vector3::new(3.0, -2.0, 5.0)),
            RigidTransform::about(centre, Vector3::new(-0.2, 0.1, -0.15), Vector3::new(-14.0, 9.0, -11.0)),
        )
    }

    fn ras<F: Frame>(spacing: f64, half_mm: [f64; 3]) -> Grid<F> {
        let dims = half_mm.map(|h| (2.0 * h / spacing) as usize);
        Grid::axis_aligned(dims, [spacing; 3], half_mm.map(|h| -h))
    }

    #[test]
    fn slow_a_known_rigid_move_comes_back_within_two_hundredths_of_a_mm() {
        let (head_from_pre, head_from_post) = known_motion();
        let pre = scan(&ras(1.5, [96.0, 114.0, 102.0]), &head_from_pre, 1.0, 1);
        let post = scan(&ras(1.5, [99.0, 117.0, 102.0]), &head_from_post, 0.8, 2);
        let settings = RigidSettings { levels_mm: vec![4.0, 2.0, 1.5], ..RigidSettings::default() };
        let fit = register_rigid(&post, &pre, RigidMasks::default(), &settings).unwrap();
        let truth = head_from_post.then(&head_from_pre.inverse());
        let error = largest_error_mm(&fit.fixed_from_moving, &truth);
        assert!(error <= 0.02, "{error} mm, {:?}", fit.quality);
        assert!(fit.warnings.is_empty(), "{:?}", fit.warnings);
    }

    #[test]
    fn the_same_image_twice_stays_where_it_is_on_any_number_of_threads() {
        let (head_from_pre, _) = known_motion();
        let pre = scan(&ras(3.0, [99.0, 120.0, 105.0]), &head_from_pre, 1.0, 7);
        let post = pre.clone().relabelled();
        let settings = RigidSettings { levels_mm: vec![4.0, 3.0], ..RigidSettings::default() };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| register_rigid(&post, &pre, RigidMasks::default(), &settings)).unwrap()
        };
        let (one, three) = (on(1), on(3));
        assert_eq!(one.fixed_from_moving, three.fixed_from_moving);
        assert_eq!(one.quality, three.quality);
        let error = largest_error_mm(&one.fixed_from_moving, &RigidTransform::identity());
        assert!(error <= 0.01, "{error} mm");
    }

    #[test]
    fn thick_oblique_cropped_slices_find_the_head() {
        let (head_from_pre, head_from_post) = known_motion();
        let pre = scan(&ras(2.0, [105.0, 125.0, 112.0]), &head_from_pre, 1.0, 3);
        // Slices of 5 mm tilted by 15 degrees, left and posterior first, the top and bottom of the head cut off.
        let (s, c) = 15f64.to_radians().sin_cos();
        let affine = Matrix4::new(
            -1.8,
            0.0,
            0.0,
            100.0,
            0.0,
            -1.8 * c,
            5.0 * s,
            100.0,
            0.0,
            -1.8 * s,
            -5.0 * c,
            95.0,
            0.0,
            0.0,
            0.0,
            1.0,
        );
        let post = scan(&Grid::new([112, 128, 28], affine).unwrap(), &head_from_post, 1.2, 4);
        let settings = RigidSettings { levels_mm: vec![4.0, 2.0], ..RigidSettings::default() };
        let fit = register_rigid(&post, &pre, RigidMasks::default(), &settings).unwrap();
        let truth = head_from_post.then(&head_from_pre.inverse());
        let error = largest_error_mm(&fit.fixed_from_moving, &truth);
        assert!(error <= 0.3, "{error} mm, {:?}", fit.quality);
    }

    #[test]
    fn an_image_with_exchanged_sides_is_warned_of() {
        let (head_from_pre, head_from_post) = known_motion();
        let pre = scan(&ras(3.0, [105.0, 125.0, 112.0]), &head_from_pre, 1.0, 5);
        let post = scan(&ras::<Post>(3.0, [110.0, 128.0, 115.0]), &head_from_post, 1.0, 6);
        let mirror = Matrix4::new_nonuniform_scaling(&Vector3::new(-1.0, 1.0, 1.0));
        let flipped =
            Volume::from_data(Grid::<Post>::new(post.grid.dims, mirror * post.grid.mm_from_voxel).unwrap(), post.data);
        let settings = RigidSettings { levels_mm: vec![4.0, 3.0], ..RigidSettings::default() };
        let fit = register_rigid(&flipped, &pre, RigidMasks::default(), &settings).unwrap();
        assert!(
            fit.warnings.iter().any(|w| matches!(w, FitWarning::MirrorFitsBetter { .. })),
            "{:?} {:?}",
            fit.warnings,
            fit.quality
        );
    }

    #[test]
    fn images_without_information_and_wrong_settings_are_refused() {
        let grid = Grid::<Pre>::axis_aligned([10; 3], [10.0; 3], [0.0; 3]);
        let flat = Volume::filled(grid, 3f32);
        let ramp = Volume::from_data(grid, (0..1000).map(|n| n as f32).collect());
        let mut broken = ramp.clone();
        broken.data[7] = f32::NAN;
        let try_with = |a: &Volume<f32, Pre>, mask: Option<&Mask<Pre>>, settings: &RigidSettings| {
            register_rigid(a, &ramp, RigidMasks { moving: mask, fixed: None }, settings).unwrap_err().to_string()
        };
        let usual = RigidSettings::default();
        assert!(try_with(&flat, None, &usual).contains("the moving image is constant (3)"));
        assert!(try_with(&broken, None, &usual).contains("1 voxels that are not finite"));
        assert!(
            try_with(&ramp, Some(&Volume::filled(grid, false)), &usual).contains("mask of the moving image is empty")
        );
        let none = RigidSettings { levels_mm: vec![], ..usual.clone() };
        assert!(try_with(&ramp, None, &none).contains("levels_mm"));
        let few = RigidSettings { histogram_bins: 2, ..usual };
        assert!(try_with(&ramp, None, &few).contains("histogram_bins"));
    }
}
