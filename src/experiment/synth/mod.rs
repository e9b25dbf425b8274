//! A synthetic patient: a pre- and a post-operative scan and the truth behind them.
//!
//! The template's brain gets a head, a random anatomy and two poses; part of a lobe is taken out and the
//! brain sags. What is known exactly goes out beside the scans: the rigid transform, the masks, the displacement.

mod enhancement;
mod fault;
mod field;
mod files;
mod frame;
mod ghost;
mod head;
mod head_side;
mod landmarks;
#[cfg(test)]
mod laws;
mod lobe;
mod old_lesion;
mod pathology;
mod resection;
mod sag;
mod sag_fem;
mod scan;
mod scanned_head;
mod scans;
mod settings;
mod ventricles;

pub use fault::ScanFaults;
pub use files::FILES;
pub use frame::Patient;
pub use head::Head;
pub use head_side::HeadSide;
pub use lobe::Lobe;
pub use pathology::Pathology;
pub use scans::Scans;
pub use settings::{SagKind, SynthError, SynthSettings};

use crate::experiment::smooth_noise::SmoothNoise;
use crate::geometry::{Frame, Mni, Position, Post, Pre, RigidTransform};
use crate::image::{Grid, LabelMap, Mask, Volume, VoxelBox};
use crate::material::random::CounterRng;
use crate::segment::{atlas, label};
use enhancement::Enhancement;
use fault::Seen;
use field::{Field, in_template};
use frame::centre;
use head::FLUID;
use nalgebra::{Point3, Vector3};
use pathology::Oedema;
use rayon::prelude::*;
use resection::Resection;
use scan::{Bias, Storage};
use serde::Serialize;

/// The scans and the truth.
#[derive(Clone, Debug)]
pub struct SyntheticPatient {
    /// The pre-operative T1.
    pub pre: Volume<i16, Pre>,
    /// The post-operative T1.
    pub post: Volume<i16, Post>,
    /// Maps a point of the pre-operative scan to the post-operative one (without the sag).
    pub post_from_pre: RigidTransform<Pre, Post>,
    /// Brain before the operation.
    pub brain_pre: Mask<Pre>,
    /// Brain after the operation, without the cavity.
    pub brain_post: Mask<Post>,
    /// Labels of the brain before the operation.
    pub tissue_pre: LabelMap<Pre>,
    /// Lateral and third ventricles before the operation.
    pub ventricles_pre: Mask<Pre>,
    /// Lateral and third ventricles after the operation.
    pub ventricles_post: Mask<Post>,
    /// What was taken out.
    pub resected_pre: Mask<Pre>,
    /// Where it was, after the sag.
    pub cavity_post: Mask<Post>,
    /// The old lesion before the operation, where there is one.
    pub old_lesion_pre: Option<Mask<Pre>>,
    /// The old lesion after the operation.
    pub old_lesion_post: Option<Mask<Post>>,
    /// Displacement of the brain in mm along the axes of the pre-operative scan, without the pose; 0 outside.
    pub displacement_pre: Volume<[f32; 3], Pre>,
    /// The same in numbers.
    pub truth: Truth,
}

/// The numbers behind a synthetic patient.
#[derive(Clone, Debug, Serialize)]
pub struct Truth {
    /// Everything that decides the patient.
    pub settings: SynthSettings,
    /// Rows of the 4x4 matrix that maps a point of the pre-operative scan to the post-operative one.
    pub post_from_pre: [[f64; 4]; 4],
    /// Rows of the 4x4 matrix that maps a point of the pre-operative scan to the patient's frame, near the template's.
    pub patient_from_pre: [[f64; 4]; 4],
    /// Rotation of `post_from_pre` in degrees.
    pub rotation_deg: f64,
    /// Mean shift of the brain from pre to post by the poses in mm.
    pub brain_shift_mm: f64,
    /// Direction of gravity along the axes of the pre-operative scan.
    pub gravity_pre: [f64; 3],
    /// Volume of the brain before the operation.
    pub brain_cc: f64,
    /// Volume of the resected region before the operation.
    pub resected_cc: f64,
    /// Volume of the cavity after the operation.
    pub cavity_cc: f64,
    /// Volume of the old lesion before the operation; 0 without one.
    pub old_lesion_cc: f64,
    /// Volume of the ventricles before the operation.
    pub ventricles_pre_cc: f64,
    /// Volume of the ventricles after the operation.
    pub ventricles_post_cc: f64,
    /// Largest displacement of brain that stays, in mm.
    pub largest_displacement_mm: f64,
    /// Mean displacement of brain that stays, in mm.
    pub mean_displacement_mm: f64,
}

/// Everything in the patient's frame.
struct Anatomy {
    head: Head,
    warp: Field,
    resection: Resection,
    old_lesion: Option<Resection>,
    oedema: Option<Oedema>,
    sag: Option<Field>,
    content: Content,
    enhancement: Option<Enhancement>,
    contrast: Scans,
}

/// What fills the cavity, by height against gravity in mm.
struct Content {
    down: Vector3<f64>,
    blood_below_mm: f64,
    air_above_mm: f64,
    wall_blood: Option<SmoothNoise>,
}

/// A point of the patient, and the point of the head that looks like it.
#[derive(Clone, Copy)]
struct Place {
    p: Point3<f64>,
    q: Position<Mni>,
}

impl Anatomy {
    fn place(&self, p: Point3<f64>) -> Place {
        Place { p, q: in_template(&self.warp, p) }
    }

    fn label(&self, Place { p, q }: Place) -> u8 {
        let own = self.head.labels.nearest(q).unwrap_or(label::BACKGROUND);
        if own != label::BACKGROUND && own != label::VENTRICLE && self.in_old_lesion(p) { label::CSF } else { own }
    }

    fn in_old_lesion(&self, p: Point3<f64>) -> bool {
        self.old_lesion.as_ref().is_some_and(|lesion| lesion.distance_mm(p) < 0.0)
    }

    /// What the head shows, without an operation and what else is the matter.
    fn healthy(&self, place: Place) -> f64 {
        self.head.t1.trilinear(place.q).map_or(0.0, f64::from)
    }

    /// The intensity of tissue with old lesion and, in a scan that shows it, oedema.
    fn intensity(&self, place: Place, shows: fn(Scans) -> bool) -> f64 {
        let healthy = self.healthy(place);
        let tissue = match &self.oedema {
            Some(oedema) if shows(oedema.scans) && self.label(place) == label::WHITE_MATTER => {
                oedema.of_white_matter(healthy, place.p, self.resection.distance_mm(place.p))
            }
            _ => healthy,
        };
        match self.old_lesion.as_ref().map_or(0.0, |lesion| (0.5 - lesion.distance_mm(place.p)).clamp(0.0, 1.0)) {
            0.0 => tissue,
            part => part * f64::from(FLUID) + (1.0 - part) * tissue,
        }
    }

    fn intensity_before(&self, p: Point3<f64>) -> f64 {
        let place = self.place(p);
        let native = self.intensity(place, Scans::in_pre);
        let Some(enhancement) = self.enhancement.as_ref().filter(|_| self.contrast.in_pre()) else { return native };
        let tissue = match self.label(place) {
            label::GREY_MATTER | label::WHITE_MATTER => enhancement.rim(native, p, self.resection.distance_mm(p)),
            _ => native,
        };
        enhancement.at_skull(enhancement.in_brain(tissue, place.q), place.q)
    }

    fn in_skull(&self, place: Place) -> bool {
        self.head.skull_mm.trilinear(place.q).is_some_and(|d| d < 0.0)
    }

    /// Whether defacing takes what is here; the skull does not sag.
    fn is_face(&self, x: Point3<f64>) -> bool {
        let q = self.place(x).q;
        let skull_mm = self.head.skull_mm.trilinear(q).map_or(100.0, f64::from);
        fault::is_face(self.head.in_template(q).mm.into(), skull_mm)
    }

    /// Where the point of the operated patient was before.
    fn before(&self, x: Point3<f64>) -> Point3<f64> {
        self.sag.as_ref().map_or(x, |sag| sag.origin_of(x))
    }

    fn intensity_after(&self, x: Point3<f64>) -> f64 {
        let place = self.place(x);
        let enhancement = self.enhancement.as_ref().filter(|_| self.contrast.in_post());
        let native = if self.in_skull(place) { self.inside_skull_after(x, enhancement) } else { self.healthy(place) };
        enhancement.map_or(native, |e| e.at_skull(native, place.q))
    }

    fn inside_skull_after(&self, x: Point3<f64>, enhancement: Option<&Enhancement>) -> f64 {
        let p = self.before(x);
        let wall_mm = self.resection.distance_mm(p);
        let cavity = (0.5 - wall_mm).clamp(0.0, 1.0);
        // Where brain has left the skull's wall, fluid takes its place.
        let tissue = |()| {
            let place = self.place(p);
            let native = if self.in_skull(place) { self.intensity(place, Scans::in_post) } else { f64::from(FLUID) };
            let Some(enhancement) = enhancement else { return native };
            let tissue = match self.label(place) {
                label::GREY_MATTER | label::WHITE_MATTER => enhancement.bed(native, p, wall_mm),
                _ => native,
            };
            enhancement.in_brain(tissue, place.q)
        };
        match cavity {
            0.0 => tissue(()),
            1.0 => self.content.at(x, -wall_mm),
            part => part * self.content.at(x, -wall_mm) + (1.0 - part) * tissue(()),
        }
    }
}

impl Content {
    fn at(&self, x: Point3<f64>, depth_mm: f64) -> f64 {
        let fluid = f64::from(FLUID) + 3.0;
        let fall_mm = x.coords.dot(&self.down);
        if fall_mm < self.air_above_mm {
            return 3.0;
        }
        // Blood settles: brighter towards the bottom.
        if fall_mm > self.blood_below_mm {
            return fluid + (110.0 * (fall_mm - self.blood_below_mm + 2.0) / 8.0).clamp(0.0, 125.0);
        }
        match &self.wall_blood {
            Some(noise) if depth_mm < 2.5 + 2.0 * noise.at(x.into()) && noise.at((x * 1.7).into()) > -0.15 => 168.0,
            _ => fluid,
        }
    }
}

/// Makes the patient. The same settings give the same values on any number of threads.
///
/// # Errors
/// [`SynthError`] for settings out of range, a lobe too small for the resection, or a finite-element sag that fails.
pub fn synthesize(settings: &SynthSettings) -> Result<SyntheticPatient, SynthError> {
    settings.check()?;
    synthesize_on(head::head_around(atlas::template(), settings.seed), None, settings)
}

/// The same on another head; `taken`, in the head's frame, says what is taken out instead of part of a lobe.
///
/// # Errors
/// As [`synthesize`]; also a mask without brain.
pub fn synthesize_on(
    head: Head,
    taken: Option<&Mask<Mni>>,
    settings: &SynthSettings,
) -> Result<SyntheticPatient, SynthError> {
    settings.check()?;
    let anatomy = operate(head, taken, settings)?;
    let stream = |n| CounterRng::new(settings.seed, n);
    let (pre_rng, post_rng) = (stream(401), stream(402));
    let pre_from_patient = scan::pose::<Pre>(pre_rng, settings.rotation_deg, settings.translation_mm);
    let post_from_patient = scan::pose::<Post>(post_rng, settings.rotation_deg, settings.translation_mm);
    let (patient_from_pre, patient_from_post) = (pre_from_patient.inverse(), post_from_patient.inverse());
    let s = settings.spacing_mm;
    let pre_grid = scan::field_of_view(&pre_from_patient, [s; 3], 0.0, Storage::Sagittal, pre_rng);
    let post_spacing = [s, s, settings.post_slice_mm];
    let post_grid =
        scan::field_of_view(&post_from_patient, post_spacing, settings.post_oblique_deg, Storage::Axial, post_rng);

    let bias = |rng| Bias::new(rng, settings.bias_fraction);
    let noise = |n| (stream(n), settings.noise_fraction);
    let before = |p| settings.pre.weighted(anatomy.intensity_before(p));
    let after = |x| settings.post.weighted(anatomy.intensity_after(x));
    let pre = settings.pre.on_signal(scan::signal(pre_grid, &patient_from_pre, before, &bias(pre_rng)));
    let post = settings.post.on_signal(scan::signal(post_grid, &patient_from_post, after, &bias(post_rng)));
    let (mut pre, mut post) = (scan::stored(&pre, noise(403)), scan::stored(&post, noise(404)));

    // Label and displacement of what was at a voxel before the operation.
    let at_pre = |n: usize| patient_from_pre.apply(Position::from_point(centre(&pre_grid, n))).mm;
    let tissue_pre: LabelMap<Pre> = per_voxel(pre_grid, |n| anatomy.label(anatomy.place(at_pre(n))));
    let resected_pre: Mask<Pre> =
        per_voxel(pre_grid, |n| tissue_pre.data[n] > 0 && anatomy.resection.distance_mm(at_pre(n)) < 0.0);
    let stays = |n: usize| tissue_pre.data[n] > 0 && !resected_pre.data[n];
    let displacement_pre = per_voxel(pre_grid, |n| {
        let Some(sag) = anatomy.sag.as_ref().filter(|_| stays(n)) else { return [0.0; 3] };
        let d = pre_from_patient.rotation * sag.at(at_pre(n));
        // To a 1024th of a mm: exact in 32 bits, and it packs well.
        [d.x, d.y, d.z].map(|x| ((x * 1024.0).round() / 1024.0) as f32)
    });
    // What is at a voxel after it: 255 for the cavity.
    const CAVITY: u8 = 255;
    let at_post = |n: usize| patient_from_post.apply(Position::from_point(centre(&post_grid, n))).mm;
    let after: LabelMap<Post> = per_voxel(post_grid, |n| {
        let x = at_post(n);
        if !anatomy.in_skull(anatomy.place(x)) {
            return label::BACKGROUND;
        }
        let p = anatomy.before(x);
        if anatomy.resection.distance_mm(p) < 0.0 { CAVITY } else { anatomy.label(anatomy.place(p)) }
    });

    let post_from_pre = patient_from_pre.then(&post_from_patient);
    let brain_pre = tissue_pre.map(|l| l > 0);
    let ventricles_pre = tissue_pre.map(|l| l == label::VENTRICLE);
    let brain_post = after.map(|l| l > 0 && l != CAVITY);
    let ventricles_post = after.map(|l| l == label::VENTRICLE);
    let cavity_post = after.map(|l| l == CAVITY);
    let lesion = anatomy.old_lesion.is_some();
    let old_lesion_pre = lesion.then(|| {
        Mask::from_fn(pre_grid, |n| {
            tissue_pre.data[n] == label::CSF && !resected_pre.data[n] && anatomy.in_old_lesion(at_pre(n))
        })
    });
    let old_lesion_post = lesion.then(|| {
        Mask::from_fn(post_grid, |n| after.data[n] == label::CSF && anatomy.in_old_lesion(anatomy.before(at_post(n))))
    });
    let face = |defaced: bool, inside: bool, x: Point3<f64>| defaced && !inside && anatomy.is_face(x);
    let seen_pre = Seen {
        brain: brain_pre.clone(),
        white: tissue_pre.map(|l| l == label::WHITE_MATTER),
        face: Mask::from_fn(pre_grid, |n| face(settings.pre.defaced, brain_pre.data[n], at_pre(n))),
    };
    let seen_post = Seen {
        brain: after.map(|l| l > 0),
        white: after.map(|l| l == label::WHITE_MATTER),
        face: Mask::from_fn(post_grid, |n| face(settings.post.defaced, after.data[n] > 0, at_post(n))),
    };
    settings.pre.on_stored(&mut pre, &seen_pre, stream(721));
    settings.post.on_stored(&mut post, &seen_post, stream(722));
    let lengths = (0..pre_grid.len())
        .filter(|&n| stays(n))
        .map(|n| displacement_pre.data[n].iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt());
    let (largest, sum, count) = lengths.fold((0f64, 0.0, 0.0), |(l, s, c), d| (l.max(d), s + d, c + 1.0));
    let brain_points = (0..pre_grid.len()).filter(|&n| brain_pre.data[n]).map(|n| centre(&pre_grid, n));
    let (shift, points) = brain_points
        .fold((0.0, 0.0), |(s, c), p| (s + (post_from_pre.apply(Position::from_point(p)).mm - p).norm(), c + 1.0));
    let rows = |m: nalgebra::Matrix4<f64>| std::array::from_fn(|r| std::array::from_fn(|c| rounded(m[(r, c)])));
    let truth = Truth {
        settings: settings.clone(),
        post_from_pre: rows(post_from_pre.to_matrix()),
        patient_from_pre: rows(patient_from_pre.to_matrix()),
        rotation_deg: rounded(post_from_pre.rotation.angle().to_degrees()),
        brain_shift_mm: rounded(shift / f64::max(points, 1.0)),
        gravity_pre: <[f64; 3]>::from(pre_from_patient.rotation * sag::gravity(settings.seed)).map(rounded),
        brain_cc: rounded(brain_pre.volume_cc()),
        resected_cc: rounded(resected_pre.volume_cc()),
        cavity_cc: rounded(cavity_post.volume_cc()),
        old_lesion_cc: rounded(old_lesion_pre.as_ref().map_or(0.0, Mask::volume_cc)),
        ventricles_pre_cc: rounded(ventricles_pre.volume_cc()),
        ventricles_post_cc: rounded(ventricles_post.volume_cc()),
        largest_displacement_mm: rounded(largest),
        mean_displacement_mm: rounded(sum / f64::max(count, 1.0)),
    };
    let whole = SyntheticPatient {
        pre,
        post,
        post_from_pre,
        brain_pre,
        brain_post,
        tissue_pre,
        ventricles_pre,
        ventricles_post,
        resected_pre,
        cavity_post,
        old_lesion_pre,
        old_lesion_post,
        displacement_pre,
        truth,
    };
    Ok(whole.within_field_of_view())
}

impl SyntheticPatient {
    /// What the scans' fields of view hold; the truth's numbers stay those of the whole patient.
    fn within_field_of_view(self) -> Self {
        let (pre, post) = (&self.truth.settings.pre, &self.truth.settings.post);
        let (pre, post) = (pre.field_of_view(&self.pre.grid), post.field_of_view(&self.post.grid));
        fn cut<T: Copy, F: Frame>(whole: Volume<T, F>, to: Option<&VoxelBox>) -> Volume<T, F> {
            match to {
                Some(to) => whole.cropped(to),
                None => whole,
            }
        }
        let (pre, post) = (pre.as_ref(), post.as_ref());
        Self {
            pre: cut(self.pre, pre),
            brain_pre: cut(self.brain_pre, pre),
            tissue_pre: cut(self.tissue_pre, pre),
            ventricles_pre: cut(self.ventricles_pre, pre),
            resected_pre: cut(self.resected_pre, pre),
            old_lesion_pre: self.old_lesion_pre.map(|mask| cut(mask, pre)),
            displacement_pre: cut(self.displacement_pre, pre),
            post: cut(self.post, post),
            brain_post: cut(self.brain_post, post),
            ventricles_post: cut(self.ventricles_post, post),
            cavity_post: cut(self.cavity_post, post),
            old_lesion_post: self.old_lesion_post.map(|mask| cut(mask, post)),
            ..self
        }
    }
}

/// Nine decimals: more than any use needs, fewer than machines differ in.
fn rounded(x: f64) -> f64 {
    (x * 1e9).round() / 1e9
}

fn per_voxel<T: Copy + Send, F: Frame>(grid: Grid<F>, value: impl Fn(usize) -> T + Sync + Send) -> Volume<T, F> {
    Volume::from_data(grid, (0..grid.len()).into_par_iter().map(value).collect())
}

/// Head, anatomy, resection and sag.
fn operate(head: Head, taken: Option<&Mask<Mni>>, settings: &SynthSettings) -> Result<Anatomy, SynthError> {
    let wide = Grid::<Patient>::axis_aligned([64, 72, 68], [4.0; 3], [-126.0, -160.0, -140.0]);
    let warp = field::random_anatomy(wide, settings.seed, settings.anatomy_mm);
    let warp = match settings.pathology.ventricle_factor {
        1.0 => warp,
        factor => ventricles::widened(&warp, &head, factor),
    };
    let brain_grid = Grid::<Patient>::axis_aligned([186, 234, 192], [1.0; 3], [-92.5, -134.5, -88.5]);
    let mut labels: LabelMap<Patient> = per_voxel(brain_grid, |n| {
        head.labels.nearest(in_template(&warp, centre(&brain_grid, n))).unwrap_or(label::BACKGROUND)
    });
    let in_head = |p: Point3<f64>| in_template(&warp, p);
    let resection = match taken {
        Some(mask) => resection::resect_mask(&labels, in_head, mask)?,
        None => resection::resect(&labels, |p| head.in_template(in_head(p)), settings)?,
    };
    let old_lesion = match settings.pathology.old_lesion_cc {
        0.0 => None,
        _ => Some(old_lesion::old_lesion(&labels, |p| head.in_template(in_head(p)), &resection, settings)?),
    };
    if let Some(lesion) = &old_lesion {
        lesion.label(&mut labels, label::CSF);
    }
    let sag = match settings.sag {
        SagKind::None => None,
        SagKind::Smooth => Some(sag::smooth(&head, &warp, &resection, settings)),
        SagKind::Fem => {
            Some(sag_fem::by_finite_elements(&labels, |p| head.in_template(in_head(p)), &resection, settings)?)
        }
    };
    let content = content(&resection, sag.as_ref(), settings);
    let enhancement = (settings.contrast != Scans::None).then(|| Enhancement::new(&head, settings.seed));
    let oedema = settings.pathology.oedema(settings.seed);
    Ok(Anatomy { head, warp, resection, old_lesion, oedema, sag, content, enhancement, contrast: settings.contrast })
}

/// Levels of air and blood: a fifth of the cavity each.
fn content(resection: &Resection, sag: Option<&Field>, settings: &SynthSettings) -> Content {
    let down = sag::gravity(settings.seed);
    let grid = resection.wall_mm.grid;
    let mut falls: Vec<f64> = (0..grid.len())
        .filter(|&n| resection.wall_mm.data[n] < 0.0)
        .map(|n| {
            let p = centre(&grid, n);
            (p + sag.map_or(Vector3::zeros(), |sag| sag.at(p))).coords.dot(&down)
        })
        .collect();
    falls.sort_unstable_by(f64::total_cmp);
    let level = |part: f64| falls.get((part * falls.len() as f64) as usize).copied();
    Content {
        down,
        blood_below_mm: level(0.8).filter(|_| settings.blood).unwrap_or(f64::INFINITY),
        air_above_mm: level(0.2).filter(|_| settings.air).unwrap_or(f64::NEG_INFINITY),
        wall_blood: settings.blood.then(|| SmoothNoise::new(CounterRng::new(settings.seed, 302), 7.0)),
    }
}
