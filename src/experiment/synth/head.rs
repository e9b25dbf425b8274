//! A head around the template's brain.
//!
//! The template comes stripped. Around it go what a T1 scan shows: fluid under the dura (dark), skull (black) with marrow
//! (grey), scalp fat (bright), skin, and below them eyes, sinuses, muscle and neck. The layers follow the distance from
//! the brain's closed hull, with thickness that varies smoothly; the face is built from a few ellipsoids. It has to look
//! like a head to a registration and to a skull stripping, not to an anatomist.

use crate::experiment::smooth_noise::SmoothNoise;
use crate::geometry::{AffineTransform, Mni, Position};
use crate::image::components::fill_holes;
use crate::image::distance::{distance_mm, signed_distance_mm};
use crate::image::gaussian::gaussian;
use crate::image::morphology::close;
use crate::image::resample::resample_nearest;
use crate::image::{Grid, LabelMap, Mask, Volume};
use crate::material::random::CounterRng;
use crate::register::deformable::DisplacementField;
use crate::segment::atlas::Atlas;
use rayon::prelude::*;

/// White matter in the head's units.
pub const WHITE: f32 = 210.0;
/// Grey matter in the head's units.
pub const GREY: f32 = 146.0;
/// Ventricular fluid in the head's units.
pub const FLUID: f32 = 48.0;
const MUSCLE: f64 = 92.0;
const FAT: f64 = 232.0;
const SKIN: f64 = 135.0;
const MARROW: f64 = 165.0;
const BONE: f64 = 14.0;
const AIR: f64 = 3.0;

/// The head in the template's frame, on a grid larger than the template's.
#[derive(Clone, Debug)]
pub struct Head {
    /// T1 intensity without bias and noise; white matter is 210.
    pub t1: Volume<f32, Mni>,
    /// Labels of the brain.
    pub labels: LabelMap<Mni>,
    /// Signed distance in mm from the inner surface of the skull, negative inside.
    pub skull_mm: Volume<f32, Mni>,
    /// Where a point of the head lies in the template; `None` where the head is the template's own.
    pub template_from_head: Option<DisplacementField<Mni>>,
}

impl Head {
    /// Where a point of the head lies in the template.
    pub fn in_template(&self, p: Position<Mni>) -> Position<Mni> {
        self.template_from_head.as_ref().map_or(p, |field| field.apply(p))
    }
}

/// Room for scalp, nose and neck.
pub fn grid() -> Grid<Mni> {
    Grid::axis_aligned([206, 262, 228], [1.0; 3], [-103.0, -146.0, -120.0])
}

/// The template's intensity made more like a scan's: an average of 152 heads has too bright fluid.
fn contrast(template: f32) -> f32 {
    const CURVE: [(f32, f32); 6] =
        [(0.0, 10.0), (55.0, 34.0), (82.0, FLUID), (169.0, GREY), (215.0, WHITE), (255.0, 250.0)];
    let upper = CURVE.iter().position(|&(x, _)| template < x).unwrap_or(CURVE.len() - 1).max(1);
    let ((x0, y0), (x1, y1)) = (CURVE[upper - 1], CURVE[upper]);
    y0 + (y1 - y0) * (template - x0) / (x1 - x0)
}

/// Depth in mm below the surface of an ellipsoid, roughly (exact for a sphere); positive inside.
fn inside_ellipsoid(p: [f64; 3], centre: [f64; 3], radii: [f64; 3]) -> f64 {
    let scaled: f64 = (0..3).map(|a| ((p[a] - centre[a]) / radii[a]).powi(2)).sum::<f64>().sqrt();
    (1.0 - scaled) * radii[0].min(radii[1]).min(radii[2])
}

/// Both sides at once: the point with x made positive.
fn folded(p: [f64; 3]) -> [f64; 3] {
    [p[0].abs(), p[1], p[2]]
}

struct Noises {
    thickness: SmoothNoise,
    marrow: SmoothNoise,
    fine: SmoothNoise,
    strand: SmoothNoise,
}

impl Noises {
    /// Intensity of everything that is neither brain nor inside the skull. `out` is the distance from the skull's inner
    /// surface in mm, `below` how deep the point lies under the skin of face and neck (negative outside of them).
    fn outside_brain(&self, p: [f64; 3], out: f64, below: f64) -> f64 {
        // Farther out than bone, scalp and muscle at their thickest: 8.7, 6.8 and 6 mm below.
        if out > 22.0 && below <= 0.0 {
            return AIR;
        }
        let vary = self.thickness.at(p);
        // Low on the head the layers are thin and muscle lies over them.
        let low = ((-20.0 - p[2]) / 30.0).clamp(0.0, 1.0);
        let inner = 1.6;
        let marrow = ((3.2 + 2.2 * vary) * (1.0 - 0.7 * low)).max(0.3);
        let outer = 1.7;
        let skull = inner + marrow + outer;
        let scalp = 5.2 + 1.6 * self.thickness.at([p[0] + 300.0, p[1], p[2]]);
        let temporalis = if p[0].abs() > 45.0 { 6.0 * bump(p[1], 15.0, 45.0) * bump(p[2], -15.0, 45.0) } else { 0.0 };
        let head_depth = skull + temporalis + scalp - out;
        let depth = head_depth.max(below);
        if depth <= 0.0 {
            return AIR;
        }
        let fine = self.fine.at(p);
        if depth < 1.9 {
            return SKIN + 14.0 * fine;
        }
        if out < inner {
            return BONE;
        }
        if out < inner + marrow {
            let filled = MARROW + 30.0 * self.marrow.at(p) + 14.0 * fine - 60.0 * low;
            // Marrow thins out into the plates.
            let edge = ((out - inner).min(inner + marrow - out) / 0.9).clamp(0.0, 1.0);
            return BONE + (filled - BONE) * edge;
        }
        if out < skull {
            return BONE;
        }
        if let Some(value) = self.face(p, fine) {
            return value;
        }
        if depth < 1.9 + 2.6 + 1.2 * vary {
            return FAT + 16.0 * fine;
        }
        // Muscle with strands of fat between its bellies.
        let strand = self.strand.at(p);
        if strand.abs() < 0.07 { FAT - 45.0 } else { MUSCLE + 26.0 * strand + 9.0 * fine }
    }

    /// Eyes, sinuses, nose, mouth, spine: the landmarks of the lower half.
    fn face(&self, p: [f64; 3], fine: f64) -> Option<f64> {
        let f = folded(p);
        let eye = inside_ellipsoid(f, [33.0, 66.0, -38.0], [12.0, 12.0, 12.0]);
        if eye > 0.0 {
            let lens = inside_ellipsoid(f, [33.0, 75.5, -38.0], [4.5, 2.2, 4.5]);
            return Some(if lens > 0.0 {
                120.0
            } else if eye < 1.0 {
                105.0
            } else {
                38.0
            });
        }
        let orbit = inside_ellipsoid(f, [29.0, 54.0, -38.0], [16.0, 27.0, 15.0]);
        if orbit > 0.0 {
            let nerve = ((f[0] - 33.0 + 0.45 * (66.0 - p[1])).powi(2) + (p[2] + 38.0).powi(2)).sqrt();
            return Some(if nerve < 2.2 && p[1] < 56.0 { 110.0 } else { FAT - 8.0 + 10.0 * fine });
        }
        let nose = inside_ellipsoid(p, [0.0, 62.0, -58.0], [14.0, 32.0, 18.0]);
        if nose > 0.0 {
            // Septum and turbinates.
            let wall = p[0].abs() < 1.2 || (self.marrow.at([3.0 * p[0], 0.4 * p[1], 3.0 * p[2]]) > 0.15);
            return Some(if wall { 120.0 + 12.0 * fine } else { AIR });
        }
        let maxillary = inside_ellipsoid(f, [30.0, 56.0, -64.0], [12.0, 15.0, 13.0]);
        let sphenoid = inside_ellipsoid(p, [0.0, 18.0, -44.0], [11.0, 10.0, 8.0]);
        let pharynx = inside_ellipsoid(p, [0.0, 8.0, -82.0], [9.0, 5.0, 26.0]);
        let ear = inside_ellipsoid(f, [62.0, -22.0, -42.0], [12.0, 3.0, 3.0]);
        if maxillary.max(sphenoid).max(pharynx).max(ear) > 0.0 {
            return Some(AIR);
        }
        let mastoid = inside_ellipsoid(f, [54.0, -34.0, -48.0], [11.0, 12.0, 14.0]);
        if mastoid > 0.0 {
            return Some(BONE + 40.0 * self.strand.at(p).max(0.0));
        }
        let jaw = inside_ellipsoid(f, [44.0, 40.0, -100.0], [6.0, 34.0, 9.0]);
        if jaw > 0.0 {
            return Some(if jaw < 1.6 { BONE } else { MARROW + 10.0 * fine });
        }
        let tongue = inside_ellipsoid(p, [0.0, 48.0, -92.0], [24.0, 28.0, 16.0]);
        if tongue > 0.0 {
            return Some(125.0 + 22.0 * fine);
        }
        // The spinal canal goes on where the template's brainstem ends, in the vertebrae.
        let along = -72.0 - p[2];
        let canal = ((p[0] / 1.25).powi(2) + (p[1] + 46.0 + 0.12 * along).powi(2)).sqrt();
        if along > -4.0 && canal < 13.0 {
            return Some(match canal {
                c if c < 5.6 => 178.0,
                c if c < 10.0 => f64::from(FLUID),
                _ => BONE,
            });
        }
        let vertebra = inside_ellipsoid([p[0], p[1] + 0.12 * along, p[2]], [0.0, -24.0, p[2]], [13.0, 9.5, 10.0]);
        if along > -2.0 && vertebra > 0.0 {
            let disc = (along / 17.0).rem_euclid(1.0) < 0.22;
            return Some(if disc {
                75.0
            } else if vertebra < 1.3 {
                BONE
            } else {
                MARROW - 15.0 + 12.0 * fine
            });
        }
        None
    }
}

/// 1 at the centre, 0 at `width` from it, smooth.
fn bump(x: f64, centre: f64, width: f64) -> f64 {
    let t = (1.0 - ((x - centre) / width).powi(2)).max(0.0);
    t * t
}

/// How deep a point lies under the skin of face and neck, in mm; negative outside.
fn below_skin(p: [f64; 3]) -> f64 {
    let f = folded(p);
    let face = inside_ellipsoid(p, [0.0, 40.0, -58.0], [66.0, 56.0, 62.0]);
    let jaw = inside_ellipsoid(p, [0.0, 46.0, -92.0], [52.0, 46.0, 40.0]);
    let nose = inside_ellipsoid(p, [0.0, 92.0, -56.0], [15.0, 22.0, 22.0]);
    let brow = inside_ellipsoid(p, [0.0, 62.0, -24.0], [58.0, 28.0, 24.0]);
    let ear = inside_ellipsoid(f, [80.0, -26.0, -38.0], [8.0, 16.0, 26.0]);
    let (nx, ny) = (p[0] / 60.0, (p[1] + 24.0) / 58.0);
    let neck = if p[2] < -40.0 { (1.0 - (nx * nx + ny * ny).sqrt()) * 58.0 } else { -100.0 };
    let neck = neck.min((-40.0 - p[2]) * 1.5);
    // Smooth union over 8 mm: no creases where the parts meet.
    [jaw, nose, brow, ear, neck].into_iter().fold(face, |a, b| {
        let h = (8.0 - (a - b).abs()).max(0.0) / 8.0;
        a.max(b) + h * h * 2.0
    })
}

/// Builds the head of one patient: layer thickness and texture follow the seed.
pub fn head_around(atlas: &Atlas, seed: u64) -> Head {
    let grid = grid();
    let same = AffineTransform::identity();
    let labels = resample_nearest(&atlas.labels, &grid, &same, 0);
    let template = resample_nearest(&atlas.t1, &grid, &same, 0);
    let brain = template.map(|value| value > 0);
    // The dura spans fissures and the tentorial notch; the skull follows it.
    let hull = fill_holes(&close(&brain, 12.0));
    let from_hull = distance_mm(&hull);
    let noise = |stream, size_mm| SmoothNoise::new(CounterRng::new(seed, stream), size_mm);
    let noises = Noises {
        thickness: noise(101, 38.0),
        marrow: noise(102, 7.0),
        fine: noise(103, 2.6),
        strand: noise(104, 13.0),
    };
    let fluid_layer = |p: [f64; 3]| 2.3 + 0.9 * noises.thickness.at([p[0], p[1] - 500.0, p[2]]);
    let point = |n: usize| -> [f64; 3] { grid.centre(grid.voxel(n)).mm.into() };

    let intracranial = Mask::from_data(
        grid,
        from_hull.data.par_iter().enumerate().map(|(n, &d)| d < 4.0 && f64::from(d) <= fluid_layer(point(n))).collect(),
    );
    let skull_mm = gaussian(&signed_distance_mm(&intracranial), 1.0);
    let raw = (0..grid.len())
        .into_par_iter()
        .map(|n| {
            if brain.data[n] {
                return contrast(f32::from(template.data[n]));
            }
            if intracranial.data[n] {
                return FLUID - 6.0;
            }
            let p = point(n);
            // Where the template's brainstem leaves the template, the neck begins.
            let (out, below) = (f64::from(skull_mm.data[n]).max(0.0), below_skin(p));
            let open_below = p[2] < -71.0 && (p[0] / 22.0).powi(2) + ((p[1] + 46.0) / 20.0).powi(2) < 1.0;
            noises.outside_brain(p, if open_below { 30.0 } else { out }, below) as f32
        })
        .collect();
    let sharp = Volume::from_data(grid, raw);
    // A scanner's own blur, which also smooths the staircase of the layers; the template's brain has its blur already.
    let soft = gaussian(&sharp, 0.55);
    let data = sharp.data.iter().zip(&soft.data).zip(&brain.data);
    let t1 = data.map(|((&sharp, &soft), &brain)| if brain { sharp } else { soft }).collect();
    Head { t1: Volume::from_data(grid, t1), labels, skull_mm, template_from_head: None }
}
