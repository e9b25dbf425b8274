use super::*;
use crate::geometry::{Mni, Position, Post, Pre};
use crate::image::Grid;
use crate::register::register_two_scans;
use crate::register::synthetic_head::head_value;
use nalgebra::{Matrix4, Point3, Vector3};

/// The head as a scanner with this grid sees it at this pose, with noise.
fn scan<F: Frame>(grid: &Grid<F>, head_from_scanner: &RigidTransform<F, Mni>, gamma: f64, seed: u64) -> Volume<f32, F> {
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

/// Three times as bright at one end of the head as at the other.
fn through_a_coil<F: Frame>(scan: &Volume<f32, F>, towards: [f64; 3]) -> Volume<f32, F> {
    let gain = |n: usize| {
        let x = scan.grid.centre(scan.grid.voxel(n)).mm;
        ((0..3).map(|a| towards[a] * x[a]).sum::<f64>() * 3f64.ln() / 200.0).exp() as f32
    };
    Volume::from_fn(scan.grid, |n| scan.data[n] * gain(n))
}

#[test]
fn another_coils_gain_moves_no_pose_of_two_scans() {
    let (head_from_pre, head_from_post) = known_motion();
    let pre = scan(&ras(3.0, [99.0, 120.0, 105.0]), &head_from_pre, 1.0, 7);
    let post = scan(&ras(3.0, [102.0, 123.0, 108.0]), &head_from_post, 1.0, 8);
    let settings = RigidSettings { levels_mm: vec![4.0, 3.0], ..RigidSettings::default() };
    let truth = head_from_post.then(&head_from_pre.inverse());
    let (mut as_they_come, mut without) = (0.0f64, 0.0f64);
    for towards in [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.7, 0.0, 0.7]] {
        let post = through_a_coil(&post, towards);
        let error = |fit: RigidFit<Post, Pre>| largest_error_mm(&fit.fixed_from_moving, &truth);
        as_they_come = as_they_come.max(error(register_rigid(&post, &pre, RigidMasks::default(), &settings).unwrap()));
        without = without.max(error(register_two_scans(&post, &pre, &settings).unwrap()));
    }
    assert!(without < 0.5 * as_they_come && without < 0.1, "{without} mm, {as_they_come} mm as they come");
}

#[test]
fn two_scans_of_two_contrasts_have_no_common_gain_and_still_their_pose() {
    let (head_from_pre, head_from_post) = known_motion();
    let pre = scan(&ras(3.0, [99.0, 120.0, 105.0]), &head_from_pre, 1.0, 7);
    let post = scan(&ras(3.0, [102.0, 123.0, 108.0]), &head_from_post, 1.0, 8);
    // What is bright is dark, but for the air.
    let inverted = post.map(|x| if x > 60.0 { 1000.0 - 0.8 * x } else { x });
    let settings = RigidSettings { levels_mm: vec![4.0, 3.0], ..RigidSettings::default() };
    let truth = head_from_post.then(&head_from_pre.inverse());
    let error = |fit: RigidFit<Post, Pre>| largest_error_mm(&fit.fixed_from_moving, &truth);
    let as_they_come = error(register_rigid(&inverted, &pre, RigidMasks::default(), &settings).unwrap());
    let found = error(register_two_scans(&inverted, &pre, &settings).unwrap());
    assert!(found < as_they_come + 0.1, "{found} mm, {as_they_come} mm as they come");
}

#[test]
fn the_pose_of_two_scans_is_the_same_on_any_number_of_threads() {
    let (head_from_pre, _) = known_motion();
    let pre = scan(&ras(3.0, [99.0, 120.0, 105.0]), &head_from_pre, 1.0, 7);
    let post: Volume<f32, Post> = through_a_coil(&pre, [0.0, 0.0, 1.0]).relabelled();
    let settings = RigidSettings { levels_mm: vec![4.0, 3.0], ..RigidSettings::default() };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| register_two_scans(&post, &pre, &settings)).unwrap().fixed_from_moving
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn an_origin_a_metre_away_changes_nothing() {
    let (head_from_pre, head_from_post) = known_motion();
    let pre = scan(&ras(3.0, [105.0, 125.0, 112.0]), &head_from_pre, 1.0, 8);
    let post = scan(&ras::<Post>(3.0, [110.0, 128.0, 115.0]), &head_from_post, 1.0, 9);
    let settings = RigidSettings { levels_mm: vec![4.0, 3.0], ..RigidSettings::default() };
    let far = Matrix4::new_translation(&Vector3::new(900.0, -1200.0, 700.0));
    let away =
        Volume::from_data(Grid::<Post>::new(post.grid.dims, far * post.grid.mm_from_voxel).unwrap(), post.data.clone());
    let at = |post| register_rigid(post, &pre, RigidMasks::default(), &settings).unwrap().fixed_from_moving;
    let (near, found) = (at(&post), at(&away));
    for corner in [[-80.0, -90.0, -60.0], [80.0, 90.0, 60.0]] {
        let p = Point3::from(corner);
        let apart = found
            .apply(Position::from_point(far.transform_point(&p)))
            .distance_mm(&near.apply(Position::from_point(p)));
        assert!(apart < 0.01, "{apart} mm");
    }
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
fn an_image_of_something_else_is_warned_of() {
    let (head_from_pre, _) = known_motion();
    let pre = scan(&ras(3.0, [105.0, 125.0, 112.0]), &head_from_pre, 1.0, 10);
    let noise = |n: usize| super::super::sample::uniform(11, n as u64) as f32;
    let other = Volume::from_fn(ras::<Post>(3.0, [105.0, 125.0, 112.0]), noise);
    let settings = RigidSettings { levels_mm: vec![4.0, 3.0], ..RigidSettings::default() };
    let fit = register_rigid(&other, &pre, RigidMasks::default(), &settings).unwrap();
    assert!(
        fit.warnings.iter().any(|w| matches!(w, FitWarning::LowSimilarity { .. })),
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
    assert!(try_with(&ramp, Some(&Volume::filled(grid, false)), &usual).contains("mask of the moving image is empty"));
    let none = RigidSettings { levels_mm: vec![], ..usual.clone() };
    assert!(try_with(&ramp, None, &none).contains("levels_mm"));
    for levels_mm in [vec![1.0, 4.0], vec![4.0, 4.0]] {
        let rising = RigidSettings { levels_mm, ..usual.clone() };
        assert!(try_with(&ramp, None, &rising).contains("finer than the one before"));
    }
    let few = RigidSettings { histogram_bins: 2, ..usual };
    assert!(try_with(&ramp, None, &few).contains("histogram_bins"));
}

#[test]
fn a_wrong_slice_spacing_in_one_header_is_refused_with_axis_and_amount_and_a_right_one_is_not() {
    let (head_from_pre, head_from_post) = known_motion();
    let pre = scan(&ras(3.0, [105.0, 125.0, 112.0]), &head_from_pre, 1.0, 5);
    let post = scan(&ras::<Post>(3.0, [110.0, 128.0, 115.0]), &head_from_post, 0.8, 6);
    // The model head is nearly its own mirror image, which says nothing of whose it is.
    let settings = RigidSettings { levels_mm: vec![4.0, 3.0], try_mirror: false, ..RigidSettings::default() };
    let sizes = register_two_scans(&post, &pre, &settings).unwrap().quality.size.unwrap().longer_percent;
    assert!(sizes.iter().all(|percent| percent.abs() < 1.0), "{sizes:?}");
    for (axis, times) in [(2, 1.06), (0, 0.95)] {
        let mut affine = post.grid.mm_from_voxel;
        for row in 0..3 {
            affine[(row, axis)] *= times;
        }
        let wrong = Volume::from_data(Grid::<Post>::new(post.grid.dims, affine).unwrap(), post.data.clone());
        let Err(RegisterError::OtherSize { percent, longer, axis: told, .. }) =
            register_two_scans(&wrong, &pre, &settings)
        else {
            panic!("{axis} {times}")
        };
        let made = 100.0 * (1.0 / times - 1.0);
        assert_eq!((told, longer), (['i', 'j', 'k'][axis], made > 0.0));
        assert!((percent - f64::abs(made)).abs() < 1.0, "{percent} for {made}");
    }
}
