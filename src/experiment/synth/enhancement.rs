//! What gadolinium makes bright: the venous sinuses and dura at the skull, arteries and veins in the fluid around the
//! brain, the choroid plexus, a lesion's rim before the operation and the wall of its bed after it.
//!
//! Grey and white matter keep their intensity: the contrast agent does not pass an intact blood-brain barrier. Places and
//! calibres are those of an anatomy book in the template's frame, rounded to mm.

use super::head::Head;
use crate::experiment::smooth_noise::SmoothNoise;
use crate::geometry::{Mni, Position};
use crate::image::gaussian::gaussian;
use crate::image::{Grid, Volume};
use crate::material::random::CounterRng;
use crate::segment::label;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Blood with contrast agent in the head's units (white matter is 210).
const BLOOD: f64 = 300.0;
/// Dura and plexus: tissue that takes up less than blood holds.
const DURA: f64 = 230.0;
const PLEXUS: f64 = 245.0;
/// Tumour rim and the bed of a resection.
const RIM: f64 = 265.0;

/// A chain of round pieces: points in mm with the radius there. Both sides have one unless it is at the midline.
type Vessel = &'static [([f64; 3], f64)];

/// Arteries and inner veins, on the right: carotid to middle cerebral and its branches on the insula, anterior cerebral
/// around the corpus callosum, basilar, internal cerebral vein to the straight sinus.
const VESSELS: [Vessel; 4] = [
    &[
        ([11.0, 4.0, -24.0], 2.2),
        ([12.0, 5.0, -17.0], 2.2),
        ([30.0, 4.0, -17.0], 1.6),
        ([41.0, 4.0, -10.0], 1.4),
        ([42.0, -8.0, 4.0], 1.2),
        ([46.0, -24.0, 12.0], 1.0),
    ],
    &[
        ([12.0, 5.0, -17.0], 1.5),
        ([3.0, 12.0, -15.0], 1.3),
        ([2.0, 34.0, -4.0], 1.2),
        ([2.0, 38.0, 8.0], 1.2),
        ([2.0, 20.0, 28.0], 1.0),
        ([2.0, -10.0, 36.0], 1.0),
    ],
    &[([0.0, -22.0, -54.0], 1.8), ([0.0, -16.0, -36.0], 1.8), ([0.0, -14.0, -24.0], 1.6), ([14.0, -22.0, -18.0], 1.2)],
    &[([2.0, -2.0, 10.0], 1.0), ([3.0, -30.0, 10.0], 1.2), ([0.0, -44.0, 6.0], 2.0), ([0.0, -84.0, -8.0], 2.4)],
];

/// The plexus from the foramen of Monro along the body's floor to its thick part in the atrium and into the temporal horn.
const PLEXUS_COURSE: Vessel = &[
    ([5.0, -3.0, 11.0], 1.2),
    ([11.0, -18.0, 17.0], 1.6),
    ([20.0, -36.0, 14.0], 2.4),
    ([25.0, -43.0, 6.0], 4.0),
    ([32.0, -34.0, -6.0], 2.2),
    ([34.0, -18.0, -18.0], 1.4),
];

/// How deep a point lies in the vessel, in mm; negative outside.
fn depth_mm(p: [f64; 3], vessel: Vessel) -> f64 {
    let folded = Vector3::new(p[0].abs(), p[1], p[2]);
    let depth = |ends: &[([f64; 3], f64)]| {
        let (a, b) = (Vector3::from(ends[0].0), Vector3::from(ends[1].0));
        let t = ((folded - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
        ends[0].1 + t * (ends[1].1 - ends[0].1) - (folded - a - t * (b - a)).norm()
    };
    vessel.windows(2).map(depth).fold(f64::NEG_INFINITY, f64::max)
}

/// How deep a point at `skull_mm` (negative inside the skull) lies in a sinus of the dura, in mm; negative outside.
///
/// The superior sagittal sinus follows the vault along the midline, wider and deeper towards the back; the transverse
/// sinuses go from its end to both sides. They lie in grooves of the bone.
fn sinus_depth_mm([x, y, z]: [f64; 3], skull_mm: f64) -> f64 {
    let back = ((40.0 - y) / 130.0).clamp(0.0, 1.0);
    // Three sides: wide at the bone, narrow at the lower edge.
    let sagittal = (2.5 + 2.5 * back + 0.5 * skull_mm.min(0.0) - x.abs()).min(z + 14.0);
    let transverse = (3.5 - (z + 16.0 + 0.25 * x.abs()).abs()).min(-45.0 - y).min(60.0 - x.abs());
    sagittal.max(transverse).min(1.5 - skull_mm).min(skull_mm + 3.0 + 3.0 * back)
}

/// How deep a point lies in the dura, in mm: 1 mm under the bone, and the falx in the cleft above the corpus callosum.
fn dura_depth_mm([x, _, z]: [f64; 3], skull_mm: f64) -> f64 {
    let falx = (0.6 - x.abs()).min(-skull_mm).min(z - 25.0);
    falx.max(0.5 - (skull_mm + 0.5).abs())
}

/// Veins on the convexity that end in the sagittal sinus: how deep in one a point lies, in mm.
fn cortical_vein_depth_mm([x, y, z]: [f64; 3], skull_mm: f64, course: SmoothNoise) -> f64 {
    const APART_MM: f64 = 28.0;
    let side = 11.0 * x.signum();
    let along = (y + side + 12.0 * course.at([x, 0.0, z])).rem_euclid(APART_MM) - 0.5 * APART_MM;
    if z < 15.0 { f64::NEG_INFINITY } else { 1.1 - along.hypot(skull_mm + 1.8) }
}

/// Structures that enhance, as images: the share of a voxel they fill and that share times their intensity.
#[derive(Clone, Debug)]
struct Layer {
    share: Volume<f32, Mni>,
    light: Volume<f32, Mni>,
}

impl Layer {
    /// `structure` gives depth (mm) and intensity of the one that voxel `n` lies deepest in.
    fn new(grid: Grid<Mni>, structure: impl Fn(usize) -> (f64, f64) + Sync + Send) -> Self {
        let found = (0..grid.len()).into_par_iter().map(|n| {
            let (depth_mm, intensity) = structure(n);
            let share = (0.5 + depth_mm).clamp(0.0, 1.0);
            (share as f32, (share * intensity) as f32)
        });
        let (share, light): (Vec<f32>, Vec<f32>) = found.unzip();
        // The blur of the head's own layers.
        let [share, light] = [share, light].map(|part| gaussian(&Volume::from_data(grid, part), 0.55));
        Self { share, light }
    }

    fn over(&self, intensity: f64, q: Position<Mni>) -> f64 {
        let at = |image: &Volume<f32, Mni>| image.trilinear(q).map_or(0.0, f64::from);
        intensity * (1.0 - at(&self.share)) + at(&self.light)
    }
}

/// What enhances in one patient.
#[derive(Clone, Debug)]
pub struct Enhancement {
    /// At the skull: stays when the brain sags.
    dural: Layer,
    /// Vessels and plexus: move with the brain.
    cerebral: Layer,
    uneven: SmoothNoise,
}

impl Enhancement {
    /// The enhancement of a head; the veins' course and the rim's thickness follow the seed.
    pub fn new(head: &Head, seed: u64) -> Self {
        let grid = head.t1.grid;
        let course = SmoothNoise::new(CounterRng::new(seed, 501), 30.0);
        let point = |n: usize| -> [f64; 3] { grid.centre(grid.voxel(n)).mm.into() };
        let nothing = (f64::NEG_INFINITY, 0.0);
        let deepest = |a: (f64, f64), b: (f64, f64)| if b.0 > a.0 { b } else { a };
        let dural = Layer::new(grid, |n| {
            let (p, skull_mm) = (point(n), f64::from(head.skull_mm.data[n]));
            match head.labels.data[n] {
                label::BACKGROUND => deepest((sinus_depth_mm(p, skull_mm), BLOOD), (dura_depth_mm(p, skull_mm), DURA)),
                label::CSF => (dura_depth_mm(p, skull_mm), DURA),
                _ => nothing,
            }
        });
        let cerebral = Layer::new(grid, |n| {
            let (p, skull_mm) = (point(n), f64::from(head.skull_mm.data[n]));
            match head.labels.data[n] {
                label::VENTRICLE => (depth_mm(p, PLEXUS_COURSE), PLEXUS),
                label::BACKGROUND | label::CSF if skull_mm < 0.0 => {
                    let vein = cortical_vein_depth_mm(p, skull_mm, course);
                    (VESSELS.iter().map(|vessel| depth_mm(p, vessel)).fold(vein, f64::max), BLOOD)
                }
                _ => nothing,
            }
        });
        Self { dural, cerebral, uneven: SmoothNoise::new(CounterRng::new(seed, 502), 9.0) }
    }

    /// The intensity at a point of the template once dura and sinuses enhance.
    pub fn at_skull(&self, intensity: f64, q: Position<Mni>) -> f64 {
        self.dural.over(intensity, q)
    }

    /// The intensity at a point of the template once vessels and plexus enhance.
    pub fn in_brain(&self, intensity: f64, q: Position<Mni>) -> f64 {
        self.cerebral.over(intensity, q)
    }

    /// The intensity of tissue `wall_mm` from the margin of the later resection (negative inside) once the lesion's rim
    /// enhances: 1 to 3 mm thick, about 5 mm inside the margin.
    pub fn rim(&self, intensity: f64, p: Point3<f64>, wall_mm: f64) -> f64 {
        let uneven = self.uneven.at(p.into());
        mixed(intensity, RIM, 0.5 * (2.0 + uneven) - (wall_mm + 5.0 + 1.5 * uneven).abs())
    }

    /// The intensity of tissue `wall_mm` outside the cavity once its bed enhances: a broken line of up to 2 mm.
    pub fn bed(&self, intensity: f64, p: Point3<f64>, wall_mm: f64) -> f64 {
        let half_mm = 0.5 * (0.8 + 1.2 * self.uneven.at(p.into()));
        mixed(intensity, RIM, half_mm - (wall_mm - half_mm).abs())
    }
}

/// The intensity of a voxel `depth_mm` inside something of intensity `other`.
fn mixed(intensity: f64, other: f64, depth_mm: f64) -> f64 {
    intensity + (0.5 + depth_mm).clamp(0.0, 1.0) * (other - intensity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::synth::{Scans, SynthSettings, SyntheticPatient, synthesize};
    use crate::geometry::{Post, Pre, RigidTransform};
    use crate::register::{RigidMasks, RigidSettings, register_rigid};
    use crate::resect::{GivenMasks, PairSettings, take_pair_apart};
    use crate::segment::native::mask_on;
    use crate::segment::{PosedScan, SegmentWarning, pose_of_head};

    /// Mean distance over the brain between a fit and the truth.
    fn rigid_error_mm(pre_from_post: &RigidTransform<Post, Pre>, patient: &SyntheticPatient) -> f64 {
        let brain = &patient.brain_pre;
        let errors = (0..brain.data.len()).filter(|&n| brain.data[n]).step_by(37).map(|n| {
            let p = brain.grid.centre(brain.grid.voxel(n));
            pre_from_post.apply(patient.post_from_pre.apply(p)).distance_mm(&p)
        });
        let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), e| (sum + e, count + 1.0));
        sum / count
    }

    /// Error of the rigid fit in mm, Dice of brain, ventricles and cavity, and whether something beside the cavity was left in doubt.
    fn figures(contrast: Scans) -> (f64, [f64; 3], bool) {
        let patient = synthesize(&SynthSettings {
            seed: 31,
            spacing_mm: 2.0,
            post_slice_mm: 2.0,
            contrast,
            ..SynthSettings::default()
        })
        .unwrap();
        let (pre, post) = (patient.pre.map(f32::from), patient.post.map(f32::from));
        let settings = RigidSettings::default();
        let pre_from_post = register_rigid(&post, &pre, RigidMasks::default(), &settings).unwrap().fixed_from_moving;
        let mni_from_pre = pose_of_head(&pre).unwrap().fixed_from_moving;
        let (none, settings) = (GivenMasks::default(), PairSettings::default());
        let mni_from_post = pre_from_post.then(&mni_from_pre);
        let scans = (PosedScan::new(&pre, &mni_from_pre), PosedScan::new(&post, &mni_from_post));
        let found = take_pair_apart(&scans.0, &scans.1, &none, &settings, |_| {}).unwrap();
        let cavity = mask_on(&found.finding.cavity, &post.grid, &mni_from_post);
        let dice = [
            found.pre.brain.dice(&patient.brain_pre),
            found.pre.labels.map(|l| l == label::VENTRICLE).dice(&patient.ventricles_pre),
            cavity.dice(&patient.cavity_post),
        ];
        let in_doubt = found.post.warnings.iter().any(|w| matches!(w, SegmentWarning::ChangedBeside { .. }));
        (rigid_error_mm(&pre_from_post, &patient), dice, in_doubt)
    }

    #[test]
    fn slow_contrast_in_either_scan_or_both_costs_neither_pose_nor_masks() {
        let (_, native, in_doubt) = figures(Scans::None);
        assert!(!in_doubt);
        for contrast in [Scans::Pre, Scans::Post, Scans::Both] {
            let (error_mm, dice, in_doubt) = figures(contrast);
            assert!(error_mm <= 0.1, "{contrast:?}: {error_mm} mm");
            assert!(in_doubt || contrast != Scans::Post, "a bed that only the second scan shows brighter is told");
            for (what, (with, without)) in ["brain", "ventricles", "cavity"].iter().zip(dice.iter().zip(&native)) {
                assert!(with >= &(without - 0.02), "{contrast:?}: Dice of the {what} {with} instead of {without}");
            }
        }
    }

    #[test]
    fn slow_gadolinium_brightens_the_scan_it_was_given_for_and_leaves_tissue_away_from_the_lesion_as_it_was() {
        let at = |contrast| {
            let settings = SynthSettings {
                spacing_mm: 2.0,
                post_slice_mm: 2.0,
                noise_fraction: 0.0,
                contrast,
                ..SynthSettings::default()
            };
            synthesize(&settings).unwrap()
        };
        let (native, pre) = (at(Scans::None), at(Scans::Pre));
        assert!(pre.post == native.post, "only the scan that was asked for");
        let near = crate::image::morphology::dilate(&native.resected_pre, 4.0);
        let (mut tissue, mut changed, mut brighter) = (0.0, 0.0, 0.0);
        for n in 0..native.pre.data.len() {
            let (a, b) = (native.pre.data[n], pre.pre.data[n]);
            brighter += f64::from(u8::from(b > a + 30)) * 0.008;
            if matches!(native.tissue_pre.data[n], label::GREY_MATTER | label::WHITE_MATTER) && !near.data[n] {
                tissue += 1.0;
                changed += f64::from(u8::from((b - a).abs() > 20));
            }
        }
        // Dura of 1 mm alone is some 200 cc; of the tissue only what shares a voxel with an enhancing structure changes.
        assert!(brighter > 100.0, "{brighter} cc");
        assert!(changed < 0.05 * tissue, "{changed} of {tissue} voxels");
    }
}
