use super::*;
use crate::geometry::{Pre, RigidTransform};
use crate::image::{Grid, Volume, VoxelBox};
use crate::register::deformable::DisplacementField;
use crate::segment::atlas;

/// The template's brain within a scalp, in air with noise: 112 x 128 x 112 voxels of 2 mm, and its labels.
struct Phantom {
    t1: Volume<f32, Pre>,
    labels: LabelMap<Pre>,
}

const DIMS: [usize; 3] = [112, 128, 112];
/// Standard deviation of the noise in both channels; white matter is about 200.
const NOISE: f32 = 2.0;

/// Two numbers with a standard deviation of 1 for a voxel.
fn noise(n: usize, seed: u64) -> [f32; 2] {
    let mut state = (n as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mut uniform = || {
        state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        state ^= state >> 31;
        (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
    };
    let mut normal = || (uniform() + uniform() + uniform() + uniform()) * 3f32.sqrt();
    [normal(), normal()]
}

/// The magnitude of a signal with noise in both channels.
fn noisy(clean: &Volume<f32, Pre>, sigma: f32, seed: u64) -> Volume<f32, Pre> {
    Volume::from_fn(clean.grid, |n| {
        let [real, imaginary] = noise(n, seed);
        (clean.data[n] + sigma * real).hypot(sigma * imaginary)
    })
}

fn clean() -> Phantom {
    let template = atlas::template();
    let grid = Grid::<Pre>::axis_aligned(DIMS, [2.0; 3], [-111.0, -146.0, -96.0]);
    let place = |n: usize| grid.centre(grid.voxel(n));
    let on_template = |n: usize| crate::geometry::Position::<Mni>::from_point(place(n).mm);
    let labels = Volume::from_fn(grid, |n| template.labels.nearest(on_template(n)).unwrap_or(0));
    let t1 = Volume::from_fn(grid, |n| {
        let (p, own) = (place(n).mm, template.t1.nearest(on_template(n)).unwrap_or(0));
        let out = ((p.x / 88.0).powi(2) + ((p.y + 18.0) / 106.0).powi(2) + ((p.z - 2.0) / 96.0).powi(2)).sqrt();
        if own > 0 {
            f32::from(own)
        } else if (0.93..1.0).contains(&out) {
            220.0
        } else {
            0.0
        }
    });
    Phantom { t1, labels }
}

fn measured(t1: &Volume<f32, Pre>, labels: &LabelMap<Pre>) -> ScanQuality {
    measured_on(t1, labels, &RigidTransform::identity())
}

fn measured_on(t1: &Volume<f32, Pre>, labels: &LabelMap<Pre>, pose: &RigidTransform<Pre, Mni>) -> ScanQuality {
    let coarse = Grid::<Mni>::axis_aligned([8; 3], [30.0; 3], [-105.0; 3]);
    let same = DisplacementField::from_displacement(&Volume::filled(coarse, [0f32; 3]));
    scan_quality(&PosedScan::new(t1, pose), (labels, &[]), &same, None)
}

/// What can be told of a scan with air, as numbers, the bad sides upwards.
fn badness(scan: &ScanQuality) -> [f64; 6] {
    let told = |measure: Option<f64>| measure.expect("told");
    [
        -told(scan.contrast_to_noise),
        -told(scan.white_signal_to_noise),
        told(scan.entropy_focus),
        told(scan.air_artefact_percent),
        -scan.coverage_percent,
        told(scan.gain_times),
    ]
}

fn alike(a: &ScanQuality, b: &ScanQuality, tolerance: f64) {
    for (a, b) in badness(a).into_iter().zip(badness(b)) {
        assert!((a - b).abs() <= tolerance * a.abs().max(0.05), "{a} {b}");
    }
}

#[test]
fn noise_lowers_contrast_to_noise_and_makes_nothing_better() {
    let Phantom { t1, labels } = clean();
    let [quiet, loud] = [NOISE, 10.0].map(|sigma| measured(&noisy(&t1, sigma, 1), &labels));
    let [good, bad] = [&quiet, &loud].map(badness);
    assert!(quiet.air == Air::Seen && loud.contrast_to_noise < quiet.contrast_to_noise, "{quiet:?} {loud:?}");
    assert!(loud.white_signal_to_noise.unwrap() < 0.9 * quiet.white_signal_to_noise.unwrap(), "{quiet:?} {loud:?}");
    for (good, bad) in good.into_iter().zip(bad) {
        // What is about as good as before may differ in the third digit.
        assert!(bad >= good - 2e-3 * good.abs(), "{quiet:?} {loud:?}");
    }
}

#[test]
fn a_ghost_of_shifted_phase_lines_raises_the_measures_of_motion() {
    let Phantom { t1, labels } = clean();
    // Every other phase line a little off: a faint copy of the head half a field of view away.
    let half = DIMS[1] / 2;
    let ghost = Volume::from_fn(t1.grid, |n| {
        let [i, j, k] = t1.grid.voxel(n);
        0.95 * t1.data[n] + 0.15 * t1.at(i, (j + half) % DIMS[1], k)
    });
    let [still, moved] = [&t1, &ghost].map(|scan| measured(&noisy(scan, NOISE, 2), &labels));
    assert!(moved.entropy_focus.unwrap() > still.entropy_focus.unwrap() + 0.02, "{still:?} {moved:?}");
    assert!(still.air_artefact_percent.unwrap() < 0.1, "{still:?}");
    assert!(moved.air_artefact_percent.unwrap() > 5.0, "{moved:?}");
}

#[test]
fn what_is_cut_off_is_missing_from_the_coverage_and_lost_slices_are_too() {
    let Phantom { t1, labels } = clean();
    let whole = measured(&t1, &labels).coverage_percent;
    let upper = VoxelBox { first: [0, 0, 48], end: DIMS };
    let cropped = measured(&t1.cropped(&upper), &labels.cropped(&upper)).coverage_percent;
    assert!(whole > 99.5 && (30.0..90.0).contains(&cropped), "{whole} {cropped}");
    let mut gap = t1.clone();
    for n in (0..t1.data.len()).filter(|&n| (50..54).contains(&t1.grid.voxel(n)[2])) {
        gap.data[n] = 0.0;
    }
    let lost = measured(&noisy_but_blank(&gap), &labels).coverage_percent;
    assert!(lost < 97.0 && lost > 85.0, "{lost}");
}

/// With noise where there is something at all in the slice.
fn noisy_but_blank(t1: &Volume<f32, Pre>) -> Volume<f32, Pre> {
    let noise = noisy(t1, NOISE, 3);
    Volume::from_fn(t1.grid, |n| if (50..54).contains(&t1.grid.voxel(n)[2]) { 0.0 } else { noise.data[n] })
}

#[test]
fn shading_is_told_as_gain_and_not_as_noise() {
    let Phantom { t1, labels } = clean();
    let scan = noisy(&t1, NOISE, 4);
    let shaded =
        Volume::from_fn(t1.grid, |n| scan.data[n] * (t1.grid.centre(t1.grid.voxel(n)).mm.z / 100.0).exp() as f32);
    let [even, shaded] = [&scan, &shaded].map(|scan| measured(scan, &labels));
    assert!(even.gain_times.unwrap() < 1.3 && shaded.gain_times.unwrap() > 1.8, "{even:?} {shaded:?}");
    let kept = shaded.contrast_to_noise.unwrap() / even.contrast_to_noise.unwrap();
    assert!((kept - 1.0).abs() < 0.08, "{kept}");
}

#[test]
fn a_larger_unit_and_another_order_of_storage_change_nothing() {
    let Phantom { t1, labels } = clean();
    let scan = noisy(&t1, NOISE, 5);
    let one = measured(&scan, &labels);
    alike(&one, &measured(&scan.map(|x| 7.3 * x), &labels), 1e-4);
    // Stored from right to left, the same head in the same place.
    let mut affine = t1.grid.mm_from_voxel;
    let last = affine * nalgebra::Vector4::new(DIMS[0] as f64 - 1.0, 0.0, 0.0, 1.0);
    affine.set_column(3, &last);
    affine[(0, 0)] = -affine[(0, 0)];
    let grid = Grid::<Pre>::new(DIMS, affine).unwrap();
    let back = |n: usize| {
        let [i, j, k] = grid.voxel(n);
        t1.grid.index(DIMS[0] - 1 - i, j, k)
    };
    let turned = Volume::from_fn(grid, |n| scan.data[back(n)]);
    alike(&one, &measured(&turned, &Volume::from_fn(grid, |n| labels.data[back(n)])), 1e-4);
}

#[test]
fn a_mirrored_head_is_as_good() {
    let Phantom { t1, labels } = clean();
    let scan = noisy(&t1, NOISE, 6);
    let mirrored = |n: usize| {
        let [i, j, k] = t1.grid.voxel(n);
        t1.grid.index(DIMS[0] - 1 - i, j, k)
    };
    let turned = measured(
        &Volume::from_fn(t1.grid, |n| scan.data[mirrored(n)]),
        &Volume::from_fn(t1.grid, |n| labels.data[mirrored(n)]),
    );
    alike(&measured(&scan, &labels), &turned, 1e-3);
}

#[test]
fn of_an_air_that_was_cut_out_nothing_is_told() {
    let Phantom { t1, labels } = clean();
    let noise = noisy(&t1, NOISE, 7);
    let stripped = Volume::from_fn(t1.grid, |n| if labels.data[n] > 0 { noise.data[n] } else { 0.0 });
    let found = measured(&stripped, &labels);
    assert_eq!((found.air, found.entropy_focus, found.air_artefact_percent), (Air::Blank, None, None));
    assert!(found.contrast_to_noise.is_some());
    // A field of view that ends within the head.
    let tight = VoxelBox { first: [26, 28, 20], end: [86, 100, 90] };
    let found = measured(&noise.cropped(&tight), &labels.cropped(&tight));
    assert_eq!((found.air, found.air_artefact_percent), (Air::Outside, None));
}

#[test]
fn voxels_are_told_and_a_scan_without_tissue_has_no_contrast() {
    let grid = Grid::<Pre>::axis_aligned([40, 40, 10], [1.0, 1.0, 5.0], [-20.0, -20.0, -25.0]);
    let (t1, labels) = (Volume::filled(grid, 100f32), Volume::filled(grid, 0u8));
    let found = measured(&t1, &labels);
    assert_eq!((found.voxel_mm, found.anisotropy), ([1.0, 1.0, 5.0], 5.0));
    assert_eq!((found.contrast_to_noise, found.white_signal_to_noise, found.gain_times), (None, None, None));
}

#[test]
fn a_field_of_view_that_ends_in_a_lobe_names_it_with_its_side() {
    let Phantom { t1, labels } = clean();
    let whole = measured(&t1, &labels);
    assert!(whole.regions.iter().all(|part| part.outside_percent < 0.5), "{:?}", whole.regions);
    assert_eq!(whole.of_regions(), []);
    // The patient's left is low x.
    let cut = VoxelBox { first: [28, 0, 0], end: t1.grid.dims };
    let cut = measured(&t1.cropped(&cut), &labels.cropped(&cut));
    let outside = |region: Region| cut.regions.iter().find(|part| part.region == region).unwrap().outside_percent;
    assert!(outside(Region::LeftTemporal) > 20.0 && outside(Region::RightTemporal) < 0.5, "{:?}", cut.regions);
    let said = cut.of_regions()[0].to_string();
    assert!(said.contains("left temporal lobe: ") && said.contains("lies outside the scan"), "{said}");
    assert!(!said.contains("right"), "{said}");
    let labels_alone = cut.regions.iter().all(|part| part.confidence_percent.is_none());
    assert!(labels_alone, "nothing was fitted: nothing is stated");
}
