//! Deformable registration of a template to a head that lies rigidly aligned with it.

mod field;
pub(super) mod force;
mod velocity;

pub use field::{DisplacementField, FieldFrame};

use super::pyramid::{on_grid_of, reduced_to};
use crate::geometry::{AffineTransform, Frame, Native, Position};
use crate::image::{Mask, Volume, morphology};
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;
use velocity::{Cell, Flow, VectorField};

/// Beyond this distance from the atlas's brain nothing of the head is looked at.
const WIDE_MM: f64 = 6.0;
/// A fit is judged over the atlas's brain widened by this much, however wide the rim that is compared: fits of several rims
/// can be told apart by it.
const JUDGED_MM: f64 = 4.0;

/// How the atlas is deformed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DeformableSettings {
    /// Resolutions in mm, coarse to fine.
    pub levels_mm: Vec<f64>,
    /// Most iterations at each resolution.
    pub iterations: Vec<usize>,
    /// Smoothing of each update, in voxels of the level (a fluid).
    pub update_sigma_voxels: f64,
    /// Smoothing of the velocity after each update, in voxels of the level (an elastic body).
    pub velocity_sigma_voxels: f64,
    /// The images are compared over the atlas's brain widened by this much. With less, the carried brain comes out too small;
    /// with more, too large, since the subject is blank beyond 6 mm.
    pub margin_mm: f64,
    /// Whether an affine fit comes first; without it the heads are taken to be one head.
    pub affine: bool,
    /// A level ends when five iterations have raised the mean local correlation by less than this.
    pub least_gain: f64,
}

impl Default for DeformableSettings {
    fn default() -> Self {
        Self {
            levels_mm: vec![8.0, 4.0, 2.0],
            iterations: vec![40, 40, 20],
            update_sigma_voxels: 1.5,
            velocity_sigma_voxels: 0.5,
            margin_mm: 6.0,
            affine: true,
            least_gain: 2e-3,
        }
    }
}

/// A deformation from atlas to subject with its inverse. Both fields are in mm, in the frame the images share.
#[derive(Clone, Debug)]
pub struct AtlasFit<F: Frame> {
    /// Where in the atlas a subject point lies: reads atlas maps onto the subject.
    pub atlas_from_subject: DisplacementField<F>,
    /// Where in the subject an atlas point lies: carries landmarks.
    pub subject_from_atlas: DisplacementField<F>,
    /// Figures of the fit.
    pub quality: DeformableQuality,
}

/// Figures of a deformable fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeformableQuality {
    /// Mean local correlation over the brain and a rim of 4 mm after the affine fit, and at the end.
    pub correlation: [f64; 2],
    /// Smallest Jacobian determinant of the map from atlas to subject over the brain; positive means no fold.
    pub smallest_jacobian: f64,
    /// Largest Jacobian determinant.
    pub largest_jacobian: f64,
    /// Largest distance in mm between a brain point and itself after a round trip.
    pub round_trip_mm: f64,
    /// Iterations done at each level.
    pub iterations: Vec<usize>,
}

/// Why an atlas could not be fitted.
#[derive(Debug, Error, PartialEq)]
pub enum DeformableError {
    /// The atlas is zero everywhere.
    #[error("there is no brain to fit: every voxel of the brain or template image is 0; check the brain mask")]
    EmptyAtlas,
    /// Too little is known.
    #[error(
        "only {:.0} % of the template's brain lies in known parts of the image: give a scan of the whole head, or a \
         smaller cavity mask",
        known * 100.0
    )]
    TooLittleKnown {
        /// Fraction known.
        known: f64,
    },
    /// A setting has no meaning.
    #[error("deformable registration: `{name}` is {value}: it must be {rule}")]
    Setting {
        /// The setting's name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// No resolution to fit at.
    #[error("`levels_mm` of the deformable registration is empty: give one or more resolutions of 0.5 to 16 mm")]
    NoLevels,
}

/// Deforms a skull-stripped atlas onto a head with its skull.
///
/// `subject` and `atlas` share a frame: the subject has been brought to the atlas by a rigid registration. Voxels of
/// `left_out` (on any grid in that frame), such as a cavity, and voxels that are not finite say nothing; the map there
/// follows its surroundings. From the affine map `start` (subject from atlas) on, a stationary velocity field is driven by
/// local correlation over the atlas's brain and a narrow rim, coarse to fine. The skull is never compared with the atlas's empty
/// outside beyond that rim.
///
/// # Errors
/// [`DeformableError`] when there is nothing to fit or a setting is out of range.
pub fn fit_atlas<F: Frame>(
    subject: &Volume<f32, F>,
    atlas: &Volume<f32, F>,
    start: &AffineTransform<F, F>,
    left_out: Option<&Mask<F>>,
    settings: &DeformableSettings,
) -> Result<AtlasFit<F>, DeformableError> {
    let brain = atlas.map(|x| x > 0.0);
    fit(subject, atlas, &brain, Outside::Empty, start, left_out, settings)
}

/// Deforms one scan of a head onto another scan of it: as [`fit_atlas`], but both show what surrounds the brain, which is
/// compared as far as the settings' rim goes, and the map keeps up with its surroundings where nothing is known. Voxels of
/// `scan` that are not finite say nothing either. Both scans and the mask lie on one grid.
///
/// # Errors
/// Those of [`fit_atlas`].
pub fn fit_scan<F: Frame>(
    subject: &Volume<f32, F>,
    scan: &Volume<f32, F>,
    brain: &Mask<F>,
    left_out: Option<&Mask<F>>,
    settings: &DeformableSettings,
) -> Result<AtlasFit<F>, DeformableError> {
    fit(subject, scan, brain, Outside::Shown, &AffineTransform::identity(), left_out, settings)
}

/// What a fitted image has around the brain.
#[derive(Clone, Copy, PartialEq)]
enum Outside {
    /// Nothing, as an atlas.
    Empty,
    /// The head.
    Shown,
}

/// [`fit_atlas`] and [`fit_scan`], by what the atlas or scan has `outside` the brain.
fn fit<F: Frame>(
    subject: &Volume<f32, F>,
    atlas: &Volume<f32, F>,
    brain: &Mask<F>,
    outside: Outside,
    start: &AffineTransform<F, F>,
    left_out: Option<&Mask<F>>,
    settings: &DeformableSettings,
) -> Result<AtlasFit<F>, DeformableError> {
    settings.check()?;
    let brain_box = brain.bounding_box().ok_or(DeformableError::EmptyAtlas)?;
    // Room for the rim and for the velocity to fade.
    let around = brain_box.grown(&atlas.grid, settings.margin_mm + 8.0);
    let atlas: Volume<f32, Native> = atlas.cropped(&around).relabelled();
    let brain: Mask<Native> = brain.cropped(&around).relabelled();
    let [mut region, judged, wide] = morphology::dilations(&brain, [settings.margin_mm, JUDGED_MM, WIDE_MM]);
    region.data.iter_mut().zip(&atlas.data).filter(|(_, x)| !x.is_finite()).for_each(|(seen, _)| *seen = false);
    let atlas = atlas.map(|x| if x.is_finite() { x } else { 0.0 });

    let subject: Volume<f32, Native> = match outside {
        Outside::Empty => subject.clone().relabelled(),
        // Reduced alike, so that two scans that are the same stay so at every resolution.
        Outside::Shown => subject.cropped(&around).relabelled(),
    };
    let left_out = left_out.map(|m| on_grid_of(&m.clone().relabelled(), &subject));
    let is_known = |n: usize| subject.data[n].is_finite() && left_out.as_ref().is_none_or(|m| !m.data[n]);
    let known: Mask<Native> = Volume::from_fn(subject.grid, is_known);
    let subject = subject.map(|x| if x.is_finite() { x } else { 0.0 });

    let (linear, shift) = (start.linear, start.translation_mm);

    let mut velocity: Option<VectorField> = None;
    let finest_mm = settings.levels_mm.iter().copied().fold(f64::INFINITY, f64::min);
    let near_subject = match outside {
        Outside::Empty => reduced_to(&subject, finest_mm),
        Outside::Shown => subject,
    };
    let mut quality = DeformableQuality {
        correlation: [0.0; 2],
        smallest_jacobian: 0.0,
        largest_jacobian: 0.0,
        round_trip_mm: 0.0,
        iterations: Vec::new(),
    };
    for (level, (&spacing_mm, &iterations)) in settings.levels_mm.iter().zip(&settings.iterations).enumerate() {
        let fixed = reduced_to(&atlas, spacing_mm);
        let moving = match outside {
            Outside::Empty => {
                let near = near_brain(&near_subject, &wide, velocity.as_ref(), &linear, &shift);
                reduced_to(&near, spacing_mm)
            }
            Outside::Shown => reduced_to(&near_subject, spacing_mm),
        };
        let inside = on_grid_of(&region, &fixed);
        let judged = on_grid_of(&judged, &fixed);
        let grid = fixed.grid;
        let mut v = velocity.take().map_or_else(|| VectorField::zeros(&grid), |v| v.on(&grid));

        // Level voxel -> affine -> subject voxel, as a linear map on (voxel + displacement).
        let mut head_from_atlas = linear.to_homogeneous();
        head_from_atlas.fixed_view_mut::<3, 1>(0, 3).copy_from(&shift);
        let to_moving = moving.grid.voxel_from_mm() * head_from_atlas * grid.mm_from_voxel;
        let to_known = known.grid.voxel_from_mm() * head_from_atlas * grid.mm_from_voxel;
        let noise = noise_of(&fixed, &moving, &inside);

        let mut course: Vec<f64> = Vec::new();
        let (mut warped, mut weight) = (Vec::new(), Vec::new());
        for iteration in 0..=iterations {
            let displacement = v.exponential(0.8);
            let seen = |n: usize| {
                if !inside.data[n] {
                    return (0.0, 0.0);
                }
                let (x, d) = (grid.voxel(n), displacement.data[n]);
                let p: Point3<f64> = Point3::from([0, 1, 2].map(|a| x[a] as f64 + f64::from(d[a])));
                let k = to_known.transform_point(&p);
                if !known.get(k.x.round() as isize, k.y.round() as isize, k.z.round() as isize).unwrap_or(false) {
                    return (0.0, 0.0);
                }
                let m = to_moving.transform_point(&p);
                (Cell::at(moving.grid.dims, [m.x as f32, m.y as f32, m.z as f32]).of(&moving.data), 1.0)
            };
            (0..grid.len()).into_par_iter().map(seen).unzip_into_vecs(&mut warped, &mut weight);
            if level == 0 && iteration == 0 {
                let both = weight.iter().filter(|&&w| w > 0.0).count();
                let known = both as f64 / inside.count().max(1) as f64;
                if known < 0.3 {
                    return Err(DeformableError::TooLittleKnown { known });
                }
            }
            let (update, correlation) = force::force(&grid, &fixed.data, &warped, &weight, Some(&judged.data), noise);
            quality.correlation[1] = correlation;
            if level == 0 && iteration == 0 {
                quality.correlation[0] = correlation;
            }
            course.push(correlation);
            let stalled = iteration >= 5 && correlation < course[iteration - 5] + settings.least_gain;
            if iteration == iterations || stalled {
                break;
            }
            let sigma_mm = settings.update_sigma_voxels * spacing_mm;
            let update = update.smoothed(sigma_mm);
            v.add(&match outside {
                Outside::Empty => update,
                Outside::Shown => update.over(&weight, sigma_mm),
            });
            v = v.smoothed(settings.velocity_sigma_voxels * spacing_mm);
        }
        quality.iterations.push(course.len().saturating_sub(1));
        velocity = Some(v);
    }

    let v = velocity.unwrap_or_else(|| VectorField::zeros(&atlas.grid));
    let forward = v.exponential(0.1);
    let backward = v.scaled(-1.0).exponential(0.1);
    let brain = on_grid_of(&brain, &Volume::filled(forward.grid, 0f32));
    let subject_from_atlas = DisplacementField::<F>::after_flow(forward, &linear, &shift);
    let atlas_from_subject = DisplacementField::<F>::before_flow(backward, &linear, &shift);
    let range = subject_from_atlas.jacobian_range(&brain);
    (quality.smallest_jacobian, quality.largest_jacobian) = range;
    quality.round_trip_mm = (0..brain.data.len())
        .into_par_iter()
        .filter(|&n| brain.data[n])
        .map(|n| {
            let x: Position<F> =
                Position::from_point(brain.grid.position(Point3::from(brain.grid.voxel(n).map(|i| i as f64))).mm);
            atlas_from_subject.apply(subject_from_atlas.apply(x)).distance_mm(&x)
        })
        .reduce(|| 0.0, f64::max);
    Ok(AtlasFit { atlas_from_subject, subject_from_atlas, quality })
}

/// The subject with everything zero that does not lie in the template's region under the present map: the scalp would
/// otherwise blur into the brain's rim at coarse levels, where the atlas has nothing.
fn near_brain(
    subject: &Volume<f32, Native>,
    region: &Mask<Native>,
    velocity: Option<&VectorField>,
    linear: &Matrix3<f64>,
    shift_mm: &Vector3<f64>,
) -> Volume<f32, Native> {
    let still = || Flow::filled(region.grid, [0.0; 4]);
    let inverse = velocity.map_or_else(still, |v| v.clone().scaled(-1.0).exponential(0.8));
    let atlas_from_subject = DisplacementField::<Native>::before_flow(inverse, linear, shift_mm);
    let mut out = subject.clone();
    let grid = subject.grid;
    out.data.par_iter_mut().enumerate().for_each(|(n, x)| {
        let p = grid.position(Point3::from(grid.voxel(n).map(|i| i as f64)));
        if !region.nearest(atlas_from_subject.apply(p)).unwrap_or(false) {
            *x = 0.0;
        }
    });
    out
}

impl DeformableSettings {
    /// Largest [`Self::margin_mm`].
    pub const WIDEST_MARGIN_MM: f64 = 20.0;

    /// Refuses settings out of range, by name.
    ///
    /// # Errors
    /// [`DeformableError::Setting`] or [`DeformableError::NoLevels`].
    pub fn check(&self) -> Result<(), DeformableError> {
        let refuse = |name, value, rule| Err(DeformableError::Setting { name, value, rule });
        if self.levels_mm.is_empty() {
            return Err(DeformableError::NoLevels);
        }
        if let Some(&bad) = self.levels_mm.iter().find(|&l| !(0.5..=16.0).contains(l)) {
            return refuse("levels_mm", bad, "one or more of 0.5 to 16 mm");
        }
        if self.iterations.len() != self.levels_mm.len() {
            return refuse("iterations", self.iterations.len() as f64, "one number for each of levels_mm");
        }
        if !(0.5..=5.0).contains(&self.update_sigma_voxels) {
            return refuse("update_sigma_voxels", self.update_sigma_voxels, "0.5 to 5 voxels");
        }
        if !(0.0..=5.0).contains(&self.velocity_sigma_voxels) {
            return refuse("velocity_sigma_voxels", self.velocity_sigma_voxels, "0 to 5 voxels");
        }
        if !(0.0..=Self::WIDEST_MARGIN_MM).contains(&self.margin_mm) {
            return refuse("margin_mm", self.margin_mm, "0 to 20 mm");
        }
        if !(0.0..=1.0).contains(&self.least_gain) {
            return refuse("least_gain", self.least_gain, "0 to 1");
        }
        Ok(())
    }
}

/// Contrast below which a window is taken for noise: 3 % of each image's range over the brain.
fn noise_of(fixed: &Volume<f32, Native>, moving: &Volume<f32, Native>, inside: &Mask<Native>) -> [f32; 2] {
    let span = |image: &Volume<f32, Native>| {
        let [low, high] = super::head::range_inside(image, inside);
        0.03 * (high - low)
    };
    [span(fixed), span(moving)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;
    use crate::register::synthetic_head::{brain_value, head_value};

    /// Where in the atlas a subject point lies: a head 6 % larger with a local bulge of up to 5 mm.
    fn truth(p: Point3<f64>) -> Point3<f64> {
        let q = Point3::from(p.coords / 1.06 + Vector3::new(1.0, -2.0, 1.5));
        let bulge = (-(q - Point3::new(-20.0, 10.0, 25.0)).norm_squared() / 700.0).exp();
        q + Vector3::new(-5.0, 3.0, 2.0) * bulge
    }

    /// The affine part of it, as a start.
    fn larger() -> AffineTransform<Mni, Mni> {
        AffineTransform::from_parts(Matrix3::identity() * 1.06, -1.06 * Vector3::new(1.0, -2.0, 1.5))
    }

    fn imaged(grid: &Grid<Mni>, value: impl Fn(Point3<f64>) -> f64) -> Volume<f32, Mni> {
        let data =
            (0..grid.len()).map(|n| value(grid.position(Point3::from(grid.voxel(n).map(|i| i as f64))).mm) as f32);
        Volume::from_data(*grid, data.collect())
    }

    fn atlas_and_subject() -> (Volume<f32, Mni>, Volume<f32, Mni>) {
        let grid = Grid::axis_aligned([84, 104, 92], [2.0; 3], [-83.0, -103.0, -91.0]);
        let atlas = imaged(&grid, |p| if brain_value(p) < 30.0 { 0.0 } else { brain_value(p) });
        let subject = imaged(&grid, |p| (1.0 + 0.002 * p.x) * (1.3 * head_value(truth(p)) + 20.0));
        (atlas, subject)
    }

    fn mean_error_mm(atlas: &Volume<f32, Mni>, fit: &AtlasFit<Mni>, skip: impl Fn(Point3<f64>) -> bool) -> f64 {
        let errors = (0..atlas.grid.len()).step_by(11).filter_map(|n| {
            let p = atlas.grid.position(Point3::from(atlas.grid.voxel(n).map(|i| i as f64)));
            let goal = truth(p.mm);
            let inside = brain_value(goal) > 100.0 && !skip(p.mm);
            inside.then(|| (fit.atlas_from_subject.apply(p).mm - goal).norm())
        });
        let (sum, count) = errors.fold((0.0, 0.0), |(s, c), e| (s + e, c + 1.0));
        sum / count
    }

    #[test]
    fn slow_a_larger_bulging_head_is_found_through_its_skull_and_around_a_cavity() {
        let (atlas, mut subject) = atlas_and_subject();
        let settings = DeformableSettings::default();
        let fit = fit_atlas(&subject, &atlas, &larger(), None, &settings).unwrap();
        let error = mean_error_mm(&atlas, &fit, |_| false);
        let q = &fit.quality;
        assert!(error < 0.7, "{error} mm {q:?}");
        assert!(q.smallest_jacobian > 0.2 && q.round_trip_mm < 0.5, "{q:?}");

        // A hole of 40 cc full of something bright, left out by a mask, hardly changes the map around it.
        let hole = |p: Point3<f64>| (p - Point3::new(35.0, 20.0, -20.0)).norm() < 21.0;
        let left_out = imaged(&subject.grid, |p| f64::from(u8::from(hole(p)))).map(|x| x > 0.5);
        for (x, _) in subject.data.iter_mut().zip(&left_out.data).filter(|(_, out)| **out) {
            *x = 1500.0;
        }
        let around = fit_atlas(&subject, &atlas, &larger(), Some(&left_out), &settings).unwrap();
        let error = mean_error_mm(&atlas, &around, hole);
        assert!(error < 0.8, "{error} mm {:?}", around.quality);
    }

    /// One head twice, the second time at another gain and with a bulge of `bulge_mm` in it; and its brain.
    fn two_scans(bulge_mm: f64) -> (Volume<f32, Mni>, Volume<f32, Mni>, Mask<Mni>) {
        let (atlas, _) = atlas_and_subject();
        let before = imaged(&atlas.grid, head_value);
        let after = imaged(&atlas.grid, |p| 1.2 * head_value(p - bulge_at(p, bulge_mm)) + 5.0);
        (before, after, atlas.map(|x| x > 0.0))
    }

    /// Fades well within the brain.
    fn bulge_at(p: Point3<f64>, by_mm: f64) -> Vector3<f64> {
        Vector3::new(0.0, -by_mm, 0.0) * (-(p - BULGE).norm_squared() / 500.0).exp()
    }

    const BULGE: Point3<f64> = Point3::new(-20.0, 10.0, 20.0);

    fn of_one_head() -> DeformableSettings {
        DeformableSettings {
            margin_mm: 4.0,
            update_sigma_voxels: 3.0,
            least_gain: 0.0,
            ..DeformableSettings::default()
        }
    }

    /// Mean distance of what a fit says of the places from where the second scan shows them, mm.
    fn off_mm(fit: &AtlasFit<Mni>, grid: &Grid<Mni>, bulge_mm: f64, of: impl Fn(Point3<f64>) -> bool) -> f64 {
        let errors = (0..grid.len()).step_by(7).filter_map(|n| {
            let p = grid.centre(grid.voxel(n));
            let came_from = p.mm - bulge_at(p.mm, bulge_mm);
            of(p.mm).then(|| (fit.atlas_from_subject.apply(p).mm - came_from).norm())
        });
        let (sum, count) = errors.fold((0.0, 0.0), |(s, c), e| (s + e, c + 1.0));
        sum / count
    }

    #[test]
    fn the_surface_of_a_brain_that_has_not_moved_stays_where_it_is() {
        let (before, after, brain) = two_scans(0.0);
        let surface = morphology::erode(&brain, 3.0);
        let of = |p: Point3<f64>| {
            let at = Position::from_point(p);
            brain.nearest(at).unwrap_or(false) && !surface.nearest(at).unwrap_or(true)
        };
        let fit = fit_scan(&after, &before, &brain, None, &of_one_head()).unwrap();
        let shown = off_mm(&fit, &before.grid, 0.0, of);
        // With the skull taken from one of them the other's is brought into the brain.
        let stripped = Volume::from_fn(before.grid, |n| if brain.data[n] { before.data[n] } else { 0.0 });
        let fit = fit_atlas(&after, &stripped, &AffineTransform::identity(), None, &of_one_head()).unwrap();
        let bare = off_mm(&fit, &before.grid, 0.0, of);
        assert!(shown < 0.05 && shown < 0.2 * bare, "{shown} and {bare} mm");
    }

    #[test]
    fn the_map_keeps_up_beside_what_is_left_out() {
        let (before, mut after, brain) = two_scans(6.0);
        let hole = |p: Point3<f64>| (p - BULGE - Vector3::new(0.0, 0.0, 16.0)).norm() < 14.0;
        let left_out = imaged(&after.grid, |p| f64::from(u8::from(hole(p)))).map(|x| x > 0.5);
        for (x, _) in after.data.iter_mut().zip(&left_out.data).filter(|(_, out)| **out) {
            *x = 100.0;
        }
        let beside = |p: Point3<f64>| !hole(p) && (p - BULGE - Vector3::new(0.0, 0.0, 16.0)).norm() < 18.0;
        let fit = fit_scan(&after, &before, &brain, Some(&left_out), &of_one_head()).unwrap();
        let kept_up = off_mm(&fit, &before.grid, 6.0, beside);
        let rest = DisplacementField::from_displacement(&Volume::filled(before.grid, [0f32; 3]));
        let still =
            AtlasFit { atlas_from_subject: rest.clone(), subject_from_atlas: rest, quality: fit.quality.clone() };
        let moved = off_mm(&still, &before.grid, 6.0, beside);
        assert!(kept_up < 0.2 * moved, "{kept_up} of {moved} mm");
    }

    #[test]
    fn the_map_does_not_depend_on_the_number_of_threads() {
        let (atlas, subject) = atlas_and_subject();
        let settings =
            DeformableSettings { levels_mm: vec![8.0, 4.0], iterations: vec![6, 4], ..DeformableSettings::default() };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| fit_atlas(&subject, &atlas, &larger(), None, &settings)).unwrap()
        };
        let (one, three) = (on(1), on(3));
        assert_eq!(one.quality, three.quality);
        let p = Position::<Mni>::new(-20.0, 10.0, 25.0);
        assert_eq!(one.atlas_from_subject.apply(p), three.atlas_from_subject.apply(p));
    }

    #[test]
    fn an_empty_atlas_a_blind_mask_and_wrong_settings_are_refused() {
        let grid = Grid::<Mni>::axis_aligned([24; 3], [4.0; 3], [-46.0; 3]);
        let flat = Volume::filled(grid, 0f32);
        let ball = imaged(&grid, |p| if p.coords.norm() < 30.0 { 100.0 + p.x } else { 0.0 });
        let usual = DeformableSettings::default();
        assert_eq!(fit_atlas(&ball, &flat, &larger(), None, &usual).unwrap_err(), DeformableError::EmptyAtlas);
        let all = Volume::filled(grid, true);
        let blind = fit_atlas(&ball, &ball, &larger(), Some(&all), &usual).unwrap_err();
        assert!(matches!(blind, DeformableError::TooLittleKnown { .. }), "{blind}");
        let wrong = DeformableSettings { iterations: vec![1], ..usual };
        assert!(
            fit_atlas(&ball, &ball, &larger(), None, &wrong).unwrap_err().to_string().contains("`iterations` is 1")
        );
    }
}
