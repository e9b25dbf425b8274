//! The pose of a whole head: against the mean of many heads with their scalp and skull, never against a bare brain.
//!
//! A stripped template says nothing of what surrounds the brain, and mutual information then gains by sliding the bright
//! template over scalp and neck. Here bone is dark and scalp bright in both images. What is compared has its slow gain taken
//! out first (a surface coil makes the scalp ten times as bright as the thalamus), and the search itself compares every
//! neighbourhood with its like, since under such a coil no histogram of the whole head means anything. Sizes may differ
//! within what heads do. Of several starts the winner is the one whose anatomy agrees locally, not the one whose histogram
//! is best; only the last step, from there, is mutual information's.

use super::bfgs::Stopping;
use super::bspline::prefilter;
use super::deformable::force::local_correlation;
use super::gain::{not_air, without_gain};
use super::head;
use super::mutual_information::{Bins, Interpolated, Pose};
use super::normalised::{LARGEST, normalised};
use super::pyramid::{on_grid_of, reduced_to};
use super::rigid::{FitQuality, FitWarning, RegisterError, RigidFit, side};
use super::sample::{Draw, draw};
use super::search::{Freedom, Level, Measure, Reach, TETHER, coarse, optimise, rank, turns_about_axes};
use crate::geometry::{Frame, Native, Position, RigidTransform, nearest_rotation};
use crate::image::{Mask, Volume, morphology};
use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use rayon::prelude::*;

/// Resolutions: for the starts, for the judgement, for the result.
const LEVELS_MM: [f64; 3] = [8.0, 4.0, 2.0];
/// The head is compared over its brain widened by this much: scalp and skull, not the face (cut off in shared scans), not
/// the neck (which bends).
const AROUND_MM: f64 = 20.0;
const BINS: usize = 40;
/// The neighbourhood that a voxel is compared with, in voxels of its level (standard deviation).
const WINDOW_VOXELS: f64 = 1.5;
/// Contrast in a neighbourhood below this share of what the head shows is noise.
const NOISE: f32 = 0.03;
/// Levels at which poses are searched for.
const SEARCHED: usize = 2;
/// Sizes that starts have, over the mean head's: half way to a small child's and to a large man's.
const SCALES: [f64; 2] = [0.93, 1.08];
/// Local correlation with the mean head above which no other start is tried.
const CLEAR: f64 = 0.5;
/// Local correlation below which no head was found; from here to [`CLEAR`] it is said ([`FitWarning::HardlyAHead`]), since wrong
/// poses have been seen to reach it (docs/evidence/choices.md).
const LEAST: f64 = 0.35;

/// Loss of local correlation after which the last step is undone.
const DRIFT: f64 = 0.05;

/// The mean of many heads, on one grid with the brain inside it.
#[derive(Clone, Copy, Debug)]
pub struct MeanHead<'a, F: Frame> {
    /// T1 intensity.
    pub t1: &'a Volume<f32, F>,
    /// The brain.
    pub brain: &'a Mask<F>,
    /// A brain without scalp and skull in its place.
    pub bare: &'a Volume<f32, F>,
}

/// The mean head, ready to be compared with.
pub(super) struct Prepared {
    levels: Vec<Volume<f32, Native>>,
    normalised: Vec<Volume<f32, Native>>,
    region: Mask<Native>,
    /// Where the judge looks, on the grid of the second level.
    near_brain: Mask<Native>,
    pub centre_mm: Vector3<f64>,
}

impl<F: Frame> MeanHead<'_, F> {
    pub(super) fn centre_mm(&self) -> Vector3<f64> {
        head::centre_mm(&self.brain.clone().relabelled())
    }

    pub(super) fn prepared(&self) -> Prepared {
        self.prepared_as(&without_gain(&self.t1.clone().relabelled()))
    }

    /// As scans are shared whose scalp and skull have been taken away.
    pub(super) fn stripped(&self) -> Prepared {
        self.prepared_as(&self.bare.clone().relabelled())
    }

    fn prepared_as(&self, t1: &Volume<f32, Native>) -> Prepared {
        let brain: Mask<Native> = self.brain.clone().relabelled();
        let levels: Vec<_> = LEVELS_MM.iter().map(|&mm| reduced_to(t1, mm)).collect();
        let near_brain = on_grid_of(&morphology::dilate(&brain, 6.0), &levels[1]);
        let centre_mm = head::centre_mm(&brain);
        let region = morphology::dilate(&brain, AROUND_MM);
        let normalised = (0..SEARCHED).map(|n| over_neighbourhood(&levels[n], &region, None, n)).collect();
        Prepared { levels, normalised, region, near_brain, centre_mm }
    }
}

/// The scan, ready to be compared with.
pub(super) struct Subject {
    levels: Vec<Volume<f32, Native>>,
    normalised: Vec<Volume<f32, Native>>,
    coefficients: Vec<Volume<f32, Native>>,
    known: Vec<Option<Mask<Native>>>,
    pub foreground: Mask<Native>,
}

impl Subject {
    pub(super) fn new(image: &Volume<f32, Native>, known: Option<&Mask<Native>>) -> Self {
        let flat = without_gain(&reduced_to(image, LEVELS_MM[2]));
        let levels: Vec<_> = LEVELS_MM.iter().map(|&mm| reduced_to(&flat, mm)).collect();
        let known: Vec<_> = levels.iter().map(|l| known.map(|k| on_grid_of(k, l))).collect();
        let coefficients = levels.iter().map(along_thick_axes).collect();
        let foreground = not_air(&levels[1]);
        let normalised = (0..SEARCHED)
            .map(|n| along_thick_axes(&over_neighbourhood(&levels[n], &foreground, known[n].as_ref(), n)))
            .collect();
        Self { levels, normalised, coefficients, known, foreground }
    }
}

/// One level's image over its own neighbourhoods.
fn over_neighbourhood(
    image: &Volume<f32, Native>,
    head: &Mask<Native>,
    known: Option<&Mask<Native>>,
    level: usize,
) -> Volume<f32, Native> {
    let [low, high] = head::range_within(image, head, 0.02, 0.98);
    normalised(image, known, WINDOW_VOXELS * LEVELS_MM[level], NOISE * (high - low))
}

/// Spline coefficients along axes that are much coarser than the finest; along the others the smoothing spline is read.
fn along_thick_axes(image: &Volume<f32, Native>) -> Volume<f32, Native> {
    let mut coefficients = image.clone();
    let spacing = image.grid.spacing_mm();
    let thinnest = spacing.into_iter().fold(f64::INFINITY, f64::min);
    for axis in (0..3).filter(|&a| spacing[a] > 1.5 * thinnest) {
        prefilter(&mut coefficients, axis);
    }
    coefficients
}

/// One resolution of the comparison.
pub(super) fn level<'a>(head: &Prepared, subject: &'a Subject, n: usize, most: usize) -> Level<'a> {
    let (template, image) = (&head.levels[n], &subject.levels[n]);
    let bins = if n == 0 { 24 } else { BINS };
    let request = Draw {
        most,
        // The mean head is read at its own voxels, whatever the scan's.
        other_spacing_mm: LEVELS_MM[n],
        bins,
        range: head::range_inside(template, &head.region),
        centre_mm: head.centre_mm,
        seed: 1 + n as u64,
    };
    Level {
        measure: Measure::Information,
        samples: draw(template, &head.region, &request),
        other: Interpolated {
            image: &subject.coefficients[n],
            mask: subject.known[n].as_ref(),
            range: range_of_tissue(image, &subject.foreground),
        },
        bins: Bins { sampled: bins, interpolated: bins + 4 },
        spacing_mm: LEVELS_MM[n],
    }
}

/// One resolution of the search for poses.
pub(super) fn search_level<'a>(head: &Prepared, subject: &'a Subject, n: usize, most: usize) -> Level<'a> {
    let range = [-LARGEST, LARGEST];
    let request =
        Draw { most, other_spacing_mm: LEVELS_MM[n], bins: BINS, range, centre_mm: head.centre_mm, seed: 1 + n as u64 };
    Level {
        measure: Measure::Agreement,
        samples: draw(&head.normalised[n], &head.region, &request),
        other: Interpolated { image: &subject.normalised[n], mask: subject.known[n].as_ref(), range },
        bins: Bins { sampled: BINS, interpolated: BINS + 4 },
        spacing_mm: LEVELS_MM[n],
    }
}

/// From dark to the brightest tissue: fat is brighter than all else, by how much says nothing.
fn range_of_tissue(image: &Volume<f32, Native>, inside: &Mask<Native>) -> [f32; 2] {
    /// White matter is 1.2 to 1.6 times as bright as a head's middle value.
    const BRIGHTEST: f32 = 2.2;
    let [low, most] = head::range_within(image, inside, 0.002, 0.97);
    let [middle, _] = head::range_within(image, inside, 0.5, 0.97);
    let low = low.min(0.0);
    [low, most.min(BRIGHTEST * middle).max(low + 1e-3)]
}

/// Finds the rigid motion that takes a head onto the mean head.
///
/// Starts from aligned centres and from where the scan lies, turned by up to 30 degrees; when none of them is clearly a
/// head, as a brain without scalp and skull, turned by up to 75 degrees about any axis, turned as a header that has lost its
/// axes leaves it, and at last around the best of these. Each is refined with 12 parameters held to the sizes of heads, at
/// 4 mm; the best by local correlation over the brain is finished at 2 mm. The motion is the polar part of the affine map.
///
/// # Errors
/// [`RegisterError`]; [`RegisterError::NoHead`] when nothing at any start looks like a head.
pub fn register_to_mean_head<M: Frame, F: Frame>(
    moving: &Volume<f32, M>,
    head: &MeanHead<'_, F>,
) -> Result<RigidFit<M, F>, RegisterError> {
    let moving = side("moving", moving, None)?;
    let subject = Subject::new(&moving.image, None);
    let whole = head.prepared();
    let guesses = [aligned(&whole, &subject), as_it_lies(&whole)];
    let near = Reach {
        turns: turns_about_axes(20f64.to_radians()),
        shifts_mm: [vec![-15.0, 15.0], vec![-25.0, 0.0, 25.0], vec![-50.0, -25.0, 0.0, 25.0, 50.0]],
        scales: SCALES.to_vec(),
        freedom: Freedom::Affine(TETHER),
    };
    let mut found = searched(&whole, &subject, &guesses, &near, 4);
    let mut stripped = None;
    if found.likeness < CLEAR {
        let bare = stripped.insert(head.stripped());
        found = found.or(searched(bare, &subject, &guesses, &near, 4), true);
    }
    let mut wider = |found: Found, guesses: &[Pose], reach: &Reach| {
        if found.likeness >= CLEAR {
            return found;
        }
        let found = found.or(searched(&whole, &subject, guesses, reach, 6), false);
        let bare = stripped.get_or_insert_with(|| head.stripped());
        found.or(searched(bare, &subject, guesses, reach, 6), true)
    };
    let far = Reach { turns: turns_within(75f64.to_radians(), 25f64.to_radians()), ..near.clone() };
    found = wider(found, &guesses, &far);
    let anyhow = [-35.0, 0.0, 35.0];
    let lost =
        Reach { turns: turns_of_lost_axes(), shifts_mm: std::array::from_fn(|_| anyhow.to_vec()), ..near.clone() };
    found = wider(found, &guesses, &lost);
    let around = [found.pose];
    found = wider(found, &around, &near);
    let head = stripped.filter(|_| found.bare).unwrap_or(whole);
    finished(&head, &subject, found)
}

/// The same from one start instead of many: where a hand has laid the head, it is refined from there and judged as any.
///
/// # Errors
/// [`RegisterError`]; [`RegisterError::NoHead`] when what is found from there does not look like a head.
pub fn register_to_mean_head_from<M: Frame, F: Frame>(
    moving: &Volume<f32, M>,
    head: &MeanHead<'_, F>,
    start: &RigidTransform<M, F>,
) -> Result<RigidFit<M, F>, RegisterError> {
    let moving = side("moving", moving, None)?;
    let subject = Subject::new(&moving.image, None);
    let moving_from_head = start.inverse();
    let centre = head.centre_mm();
    let target = moving_from_head.apply(Position::from_point(Point3::from(centre))).mm.coords;
    let linear = moving_from_head.rotation.to_rotation_matrix().into_inner();
    let start = Pose { linear, centre, target };
    let [likelier, _] = likelier_first(head, &subject, &start);
    let pose = refined(&search_level(&likelier, &subject, 1, 15_000), &start);
    // There was no other start that it could stand out from.
    let distinctness = f64::INFINITY;
    let found = Found { likeness: likeness(&likelier, &subject, &pose), pose, distinctness, bare: false };
    finished(&likelier, &subject, found)
}

/// The last step from what a search found, at the finest level; its rotation and shift.
fn finished<M: Frame, F: Frame>(
    head: &Prepared,
    subject: &Subject,
    found: Found,
) -> Result<RigidFit<M, F>, RegisterError> {
    let Found { likeness: likeness_4mm, pose, distinctness, .. } = found;
    if likeness_4mm < LEAST {
        return Err(RegisterError::NoHead { likeness: likeness_4mm, least: LEAST });
    }
    let last = level(head, subject, 2, 80_000);
    let stopping = Stopping { longest_step_mm: 1.0, shortest_step_mm: 5e-3, evaluations: 60 };
    let optimum = optimise(&last, &pose, Freedom::Affine(TETHER), None, stopping);
    // The last step climbs another measure than the one that judges: where it ran away, it is not taken.
    let likeness_2mm = likeness(head, subject, &optimum.pose);
    let ran_away = likeness_2mm < likeness_4mm - DRIFT;
    let (finished, likeness) = if ran_away { (pose, likeness_4mm) } else { (optimum.pose, likeness_2mm) };
    let at = last.at(&finished);
    let quality = FitQuality {
        mutual_information: at.mutual_information,
        normalised_information: at.mutual_information / at.entropy.max(1e-12),
        overlap: at.overlap,
        distinctness,
        mirrored_ratio: None,
        evaluations: optimum.evaluations,
        size: None,
        likeness: Some(likeness),
    };
    let rotation = nearest_rotation(&finished.linear);
    let moving_from_head: RigidTransform<Native, Native> =
        RigidTransform::new(rotation, finished.target - rotation * finished.centre);
    let mut warnings = quality.warnings();
    if likeness < CLEAR {
        warnings.push(FitWarning::HardlyAHead { likeness });
    }
    Ok(RigidFit { fixed_from_moving: moving_from_head.inverse().relabelled(), quality, warnings })
}

/// The best pose of a search.
#[derive(Clone, Copy)]
struct Found {
    likeness: f64,
    pose: Pose,
    distinctness: f64,
    /// Found with the mean head without scalp and skull.
    bare: bool,
}

impl Found {
    fn or(self, other: Self, bare: bool) -> Self {
        if other.likeness > self.likeness { Self { bare, ..other } } else { self }
    }
}

/// Both centres in one place.
fn aligned(head: &Prepared, subject: &Subject) -> Pose {
    Pose { target: head::centre_mm(&subject.foreground), ..as_it_lies(head) }
}

/// The scan where its header puts it.
fn as_it_lies(head: &Prepared) -> Pose {
    Pose { linear: Matrix3::identity(), centre: head.centre_mm, target: head.centre_mm }
}

/// The most likely of the `keep` best poses within reach of the first of the guesses, or one of the others.
fn searched(head: &Prepared, subject: &Subject, guesses: &[Pose], reach: &Reach, keep: usize) -> Found {
    /// What an ordinary wrong pose agrees, at least: what more can be said is not a matter of the scan.
    const ORDINARY: f64 = 0.02;
    let start_level = search_level(head, subject, 0, 2500);
    let first = search_level(head, subject, 1, 15_000);
    let (starts, ordinary) = coarse(&start_level, guesses, reach, keep);
    let mut best = Found { likeness: 0.0, pose: guesses[0], distinctness: 0.0, bare: false };
    for start in &starts {
        let pose = refined(&first, start);
        let likeness = likeness(head, subject, &pose);
        if likeness > best.likeness {
            best = Found { likeness, pose, ..best };
        }
    }
    if let Some(start) = starts.first() {
        best.distinctness = rank(&start_level, vec![*start])[0].0 / ordinary.max(ORDINARY);
    }
    best
}

/// The mean head whole and stripped, the one more likely at a pose first.
pub(super) fn likelier_first<F: Frame>(head: &MeanHead<'_, F>, subject: &Subject, pose: &Pose) -> [Prepared; 2] {
    let (whole, bare) = (head.prepared(), head.stripped());
    let [likely, likely_bare] = [&whole, &bare].map(|look| likeness(look, subject, pose));
    if likely >= CLEAR || likely >= likely_bare { [whole, bare] } else { [bare, whole] }
}

fn refined(level: &Level<'_>, pose: &Pose) -> Pose {
    let stopping = |evaluations| Stopping { longest_step_mm: 4.0, shortest_step_mm: 0.08, evaluations };
    let rigid = optimise(level, pose, Freedom::Rigid, None, stopping(20)).pose;
    optimise(level, &rigid, Freedom::Affine(TETHER), None, stopping(30)).pose
}

/// Turns on a grid of rotation vectors, `step_rad` apart, up to `reach_rad`.
fn turns_within(reach_rad: f64, step_rad: f64) -> Vec<Rotation3<f64>> {
    let most = (reach_rad / step_rad).floor() as i32;
    let mut turns = Vec::new();
    for a in -most..=most {
        for b in -most..=most {
            for c in -most..=most {
                let w = Vector3::new(f64::from(a), f64::from(b), f64::from(c)) * step_rad;
                if w.norm() <= reach_rad * (1.0 + 1e-9) {
                    turns.push(Rotation3::from_scaled_axis(w));
                }
            }
        }
    }
    turns
}

/// The 24 turns that bring axes onto axes, each with the head level and nodding by 20 degrees either way.
fn turns_of_lost_axes() -> Vec<Rotation3<f64>> {
    let nods = [0.0, -20f64, 20.0].map(|nod| Rotation3::from_axis_angle(&Vector3::x_axis(), nod.to_radians()));
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let signed = || axes.into_iter().flat_map(|axis| [axis, -axis]);
    let pairs = signed().flat_map(|x| signed().map(move |y| (x, y))).filter(|(x, y)| x.dot(y) == 0.0);
    pairs
        .map(|(x, y)| Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)])))
        .flat_map(|turn| nods.map(|nod| turn * nod))
        .collect()
}

/// How much a scan seen through a pose looks like the mean head: the mean local correlation over the brain and its rim at
/// 4 mm, less where little of it is in the field of view.
pub(super) fn likeness(head: &Prepared, subject: &Subject, pose: &Pose) -> f64 {
    let (template, image) = (&head.levels[1], &subject.levels[1]);
    let grid = template.grid;
    let read = |n: usize| -> Option<f32> {
        if !head.near_brain.data[n] {
            return None;
        }
        let x = grid.position(Point3::from(grid.voxel(n).map(|i| i as f64))).mm.coords;
        let p = Position::from_point(Point3::from(pose.linear * (x - pose.centre) + pose.target));
        let known = subject.known[1].as_ref().is_none_or(|k| k.nearest(p).unwrap_or(false));
        if known { image.trilinear(p) } else { None }
    };
    let seen: Vec<Option<f32>> = (0..grid.len()).into_par_iter().map(read).collect();
    let weight: Vec<f32> = seen.iter().map(|x| f32::from(u8::from(x.is_some()))).collect();
    let moved: Vec<f32> = seen.iter().map(|x| x.unwrap_or(0.0)).collect();
    // Contrast below 2 % of what the brain and its rim show is noise.
    let noise = |values: &[f32]| {
        let inside: Vec<f32> = values.iter().zip(&weight).filter(|(_, w)| **w > 0.0).map(|(x, _)| *x).collect();
        let [low, high] = head::range_of(&inside, 0.02, 0.98);
        0.02 * (high - low)
    };
    let noises = [noise(&template.data), noise(&moved)];
    let known = f64::from(weight.iter().sum::<f32>()) / head.near_brain.count().max(1) as f64;
    local_correlation(&grid, &template.data, &moved, &weight, noises) * known.sqrt()
}
