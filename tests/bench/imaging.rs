//! Bars of registration, segmentation and resection on the pairs with known truth.

use crate::bar::{Bar, contents, cpu_seconds, data, memory, run_hgm, wall};
use hgm::geometry::{Frame, Mni, Position, Post, Pre, RigidTransform};
use hgm::image::distance::distance_mm;
use hgm::image::morphology::erode;
use hgm::image::nifti::{ReadOptions, decode, decode_labels};
use hgm::image::resample::{Interpolation, resample};
use hgm::image::{Grid, LabelMap, Mask, Volume};
use hgm::material::random::CounterRng;
use hgm::register::{RigidMasks, RigidSettings, register_rigid};
use hgm::resect::{GivenMasks, PairSettings, take_pair_apart};
use hgm::segment::native::mask_on;
use hgm::segment::{PosedScan, SegmentOverrides, SegmentSettings, atlas, label, pose_of_head, segment_t1};
use nalgebra::{Matrix4, Point3, Vector3};
use std::path::Path;

/// Bars of one case: rigid mean and max (mm), cavity and resected tissue (Dice).
struct Wanted {
    case: &'static str,
    rigid_mm: [f64; 2],
    cavity: f64,
    cavity_with_true_masks: f64,
    resected: f64,
}

const WANTED: [Wanted; 3] = [
    Wanted {
        case: "A_colin_L_mild",
        rigid_mm: [0.08, 0.15],
        cavity: 0.88,
        cavity_with_true_masks: 0.90,
        resected: 0.90,
    },
    Wanted {
        case: "B_colin_R_hard",
        rigid_mm: [0.20, 0.35],
        cavity: 0.78,
        cavity_with_true_masks: 0.82,
        resected: 0.80,
    },
    Wanted {
        case: "F_colin_R_vent",
        rigid_mm: [0.20, 0.40],
        cavity: 0.80,
        cavity_with_true_masks: 0.84,
        resected: 0.84,
    },
];

pub fn bars() -> Vec<Bar> {
    let mut bars = template_bars();
    let Some(data) = data() else {
        println!("skipped: registration and masks of the three cases (cases/)");
        return bars;
    };
    for wanted in &WANTED {
        let folder = data.join("cases").join(wanted.case);
        if folder.exists() { case_bars(wanted, &folder, &mut bars) } else { println!("skipped: {}", wanted.case) }
    }
    bars.extend(prep_bars(&data.join("cases").join(WANTED[0].case)));
    bars
}

/// The program's own way from a pair to images and masks.
fn prep_bars(folder: &Path) -> Vec<Bar> {
    let cases = tempfile::tempdir().unwrap();
    let prepared = |threads: &str| {
        let scan = |name: &str| folder.join(name).display().to_string();
        // The page is titled by the folder's name.
        let case = cases.path().join(threads).join("case").display().to_string();
        let pair = [scan("pre.nii.gz"), scan("post.nii.gz")];
        run_hgm(&["prep", "-q", "--no-mesh", &pair[0], &pair[1], "-o", &case, "--threads", threads])
    };
    let (one, two) = (prepared("1"), prepared("2"));
    let name = "imaging prep without meshing";
    let (a, b) = (contents(&cases.path().join("1")), contents(&cases.path().join("2")));
    let equal = one.ok && two.ok && a == b;
    let said = if equal { format!("{} files equal", a.len()) } else { "files differ".to_owned() };
    vec![
        wall(name, 20.0, &two),
        memory(name, 2.0, &two),
        Bar::new(&format!("{name}, 1 and 2 threads"), "same bytes", said, equal),
    ]
}

/// The template against its own maps.
fn template_bars() -> Vec<Bar> {
    let template = atlas::template();
    let t1: Volume<f32, Pre> = template.t1_f32().relabelled();
    let found = segment_t1(
        &PosedScan::new(&t1, &RigidTransform::identity()),
        &SegmentOverrides::default(),
        &SegmentSettings::default(),
    );
    let Ok(found) = found else { return vec![Bar::new("imaging template", "segments", "refused", false)] };
    let dice = |l: u8| found.labels_mni.map(|x| x == l).dice(&template.labels.map(|x| x == l));
    let (grey, white) = (dice(label::GREY_MATTER), dice(label::WHITE_MATTER));
    vec![Bar::new(
        "imaging template grey / white Dice",
        ">= .93 / .96",
        format!("{grey:.3} / {white:.3}"),
        grey >= 0.93 && white >= 0.96,
    )]
}

fn case_bars(wanted: &Wanted, folder: &Path, bars: &mut Vec<Bar>) {
    let letter = &wanted.case[..1];
    let mut bar = |what: &str, bar: String, measured: String, met: bool| {
        bars.push(Bar::new(&format!("imaging {letter} {what}"), &bar, measured, met));
    };
    let pre: Volume<f32, Pre> = scan(&folder.join("pre.nii.gz"));
    let post: Volume<f32, Post> = scan(&folder.join("post.nii.gz"));
    let truth = |name: &str| folder.join("truth").join(format!("{name}.nii.gz"));
    let brain: Mask<Pre> = mask(&truth("brain_pre"));

    let settings = RigidSettings::default();
    let before = cpu_seconds();
    let pre_from_post = register_rigid(&post, &pre, RigidMasks::default(), &settings).unwrap().fixed_from_moving;
    let rigid_cpu = cpu_seconds() - before;
    let [mean, max] = rigid_error_mm(&pre_from_post, &brain, &folder.join("truth/T_pre2post.txt"));
    let [mean_bar, max_bar] = wanted.rigid_mm;
    bar(
        "rigid post to pre, mean / max",
        format!("<= {mean_bar} / {max_bar} mm"),
        format!("{mean:.3} / {max:.3} mm"),
        mean <= mean_bar && max <= max_bar,
    );
    bar("rigid post to pre, time", "<= 6 CPU-s".into(), format!("{rigid_cpu:.1} CPU-s"), rigid_cpu <= 6.0);

    let mni_from_pre = pose_of_head(&pre).unwrap().fixed_from_moving;
    for (seed, what) in [(1, "to MNI from two poses"), (2, "to MNI from two poses, again")] {
        let (moved, pre_from_moved) = in_another_pose(&pre, seed);
        let mni_from_moved = pose_of_head(&moved).unwrap().fixed_from_moving;
        let apart = disagreement_mm(&mni_from_pre, &mni_from_moved, &pre_from_moved, &brain);
        bar(what, "<= .2 mm".into(), format!("{apart:.3} mm"), apart <= 0.2);
    }
    let mni_from_post = pose_of_head(&post).unwrap().fixed_from_moving;
    let apart = disagreement_mm(&mni_from_pre, &mni_from_post, &pre_from_post, &brain);
    println!("{letter}: to MNI from pre and from the operated head through pre: {apart:.2} mm apart");

    let settings = PairSettings::default();
    let before = cpu_seconds();
    let none = GivenMasks::default();
    let mni_from_post = pre_from_post.then(&mni_from_pre);
    let scans = (PosedScan::new(&pre, &mni_from_pre), PosedScan::new(&post, &mni_from_post));
    let found = take_pair_apart(&scans.0, &scans.1, &none, &settings, |_| {});
    let masks_cpu = cpu_seconds() - before;
    let found = match found {
        Ok(found) => found,
        Err(error) => return bar("masks", "found".into(), error.to_string(), false),
    };
    println!("{letter}: masks in {masks_cpu:.1} CPU-s");
    let tissue: LabelMap<Pre> = labels(&truth("tissue_pre"));
    let ventricle: Mask<Pre> = mask(&truth("ventricles_clean_pre"));
    let my_ventricle = found.pre.labels.map(|l| l == label::VENTRICLE);
    if letter == "A" {
        let (dice, distance) = (found.pre.brain.dice(&brain), surface_distance_95_mm(&found.pre.brain, &brain));
        bar("brain Dice", ">= .955".into(), format!("{dice:.3}"), dice >= 0.955);
        bar("brain surface, 95 %", "<= 3 mm".into(), format!("{distance:.1} mm"), distance <= 3.0);
        let of = |l: u8| found.pre.labels.map(|x| x == l).dice(&tissue.map(|x| x == l));
        let (grey, white) = (of(label::GREY_MATTER), of(label::WHITE_MATTER));
        let met = grey >= 0.84 && white >= 0.92;
        bar("grey / white Dice", ">= .84 / .92".into(), format!("{grey:.3} / {white:.3}"), met);
    }
    if letter != "B" {
        let dice = my_ventricle.dice(&ventricle);
        bar("ventricle Dice", ">= .88".into(), format!("{dice:.3}"), dice >= 0.88);
    }
    if letter == "F" {
        let percent = 100.0 * (my_ventricle.volume_cc() / ventricle.volume_cc() - 1.0);
        bar("ventricle volume", "within 10 %".into(), format!("{percent:+.1} %"), percent.abs() <= 10.0);
    }
    let cavity: Mask<Post> = mask(&truth("cavity_post"));
    let dice = mask_on(&found.finding.cavity, &post.grid, &mni_from_post).dice(&cavity);
    bar("cavity Dice", format!(">= {}", wanted.cavity), format!("{dice:.3}"), dice >= wanted.cavity);
    let given = GivenMasks { brain: Some(brain), ventricle: Some(ventricle), ..none };
    let told = take_pair_apart(&scans.0, &scans.1, &given, &settings, |_| {});
    let dice = told.map_or(0.0, |t| mask_on(&t.finding.cavity, &post.grid, &mni_from_post).dice(&cavity));
    let wanted_told = wanted.cavity_with_true_masks;
    bar(
        "cavity Dice, true brain and ventricle",
        format!(">= {wanted_told}"),
        format!("{dice:.3}"),
        dice >= wanted_told,
    );
    let resected: Mask<Pre> = mask(&truth("resected_pre"));
    let dice = mask_on(&found.finding.resected, &pre.grid, &mni_from_pre).dice(&resected);
    bar("resected Dice", format!(">= {}", wanted.resected), format!("{dice:.3}"), dice >= wanted.resected);
}

fn scan<F: Frame>(path: &Path) -> Volume<f32, F> {
    let name = path.display().to_string();
    decode(&std::fs::read(path).unwrap(), &name, &ReadOptions::default()).unwrap().volume.relabelled()
}

fn labels<F: Frame>(path: &Path) -> LabelMap<F> {
    let name = path.display().to_string();
    decode_labels(&std::fs::read(path).unwrap(), &name, &ReadOptions::default()).unwrap().0.relabelled()
}

fn mask<F: Frame>(path: &Path) -> Mask<F> {
    labels(path).map(|l| l > 0)
}

/// Mean and largest distance over the brain between the fit and the truth, a 4x4 text that maps pre to post.
fn rigid_error_mm(pre_from_post: &RigidTransform<Post, Pre>, brain: &Mask<Pre>, truth: &Path) -> [f64; 2] {
    let numbers: Vec<f64> =
        std::fs::read_to_string(truth).unwrap().split_whitespace().map(|x| x.parse().unwrap()).collect();
    let truth = Matrix4::from_row_slice(&numbers);
    let mine = pre_from_post.inverse().to_matrix();
    let (mut sum, mut count, mut max) = (0.0, 0.0, 0.0f64);
    for p in points(brain) {
        let error = (mine.transform_point(&p) - truth.transform_point(&p)).norm();
        (sum, count, max) = (sum + error, count + 1.0, max.max(error));
    }
    [sum / count, max]
}

/// The same head lying otherwise: turned by 15 degrees about a random axis and moved by 20 mm in a random direction, seen
/// on a grid that is neither aligned with the first nor has its voxels.
fn in_another_pose(pre: &Volume<f32, Pre>, seed: u64) -> (Volume<f32, Post>, RigidTransform<Post, Pre>) {
    let direction = |stream: u64| {
        let rng = CounterRng::new(seed, stream);
        Vector3::from([0, 1, 2].map(|a| 2.0 * rng.uniform(a) - 1.0)).normalize()
    };
    let middle = pre.grid.position(Point3::from(pre.grid.dims.map(|n| n as f64 / 2.0))).mm;
    let pre_from_moved = RigidTransform::about(middle, direction(1) * 15f64.to_radians(), direction(2) * 20.0);
    let centre = pre_from_moved.inverse().apply(Position::from_point(middle)).mm;
    let (dims, spacing_mm) = ([250, 270, 260], 0.97);
    let origin = [0, 1, 2].map(|a| centre[a] - 0.5 * spacing_mm * dims[a] as f64);
    let grid = Grid::axis_aligned(dims, [spacing_mm; 3], origin);
    let seen = resample(pre, &grid, &pre_from_moved.to_affine(), Interpolation::CubicBSpline, 0.0);
    (seen.volume, pre_from_moved)
}

/// Mean distance over the brain between the way to MNI straight from pre and that through post.
fn disagreement_mm(
    mni_from_pre: &RigidTransform<Pre, Mni>,
    mni_from_post: &RigidTransform<Post, Mni>,
    pre_from_post: &RigidTransform<Post, Pre>,
    brain: &Mask<Pre>,
) -> f64 {
    let through = pre_from_post.inverse().then(mni_from_post).to_matrix();
    let straight = mni_from_pre.to_matrix();
    let all = points(brain);
    let sum: f64 = all.iter().map(|p| (through.transform_point(p) - straight.transform_point(p)).norm()).sum();
    sum / all.len() as f64
}

fn points(mask: &Mask<Pre>) -> Vec<Point3<f64>> {
    let inside = (0..mask.data.len()).filter(|&n| mask.data[n]).step_by(37);
    inside.map(|n| mask.grid.centre(mask.grid.voxel(n)).mm).collect()
}

/// The larger of the two 95th percentiles of the distances between the masks' outermost voxels.
fn surface_distance_95_mm<F: Frame>(a: &Mask<F>, b: &Mask<F>) -> f64 {
    let surface = |m: &Mask<F>| {
        let inner = erode(m, 1.0);
        Mask::from_data(m.grid, m.data.iter().zip(&inner.data).map(|(m, i)| *m && !*i).collect())
    };
    let (a, b) = (surface(a), surface(b));
    let one_way = |from: &Mask<F>, to: &Mask<F>| {
        let distance = distance_mm(to);
        let mut values: Vec<f32> =
            from.data.iter().zip(&distance.data).filter(|(inside, _)| **inside).map(|(_, d)| *d).collect();
        values.sort_unstable_by(f32::total_cmp);
        values.get((values.len().saturating_sub(1)) * 95 / 100).copied().unwrap_or(0.0)
    };
    f64::from(one_way(&a, &b).max(one_way(&b, &a)))
}
