//! What holds of a whole synthetic patient whatever is the matter with it or its scans.

use super::{HeadSide, Pathology, ScanFaults, Scans, SynthSettings, SyntheticPatient, synthesize};
use crate::geometry::Frame;
use crate::image::{Mask, Volume};
use crate::segment::label;

fn made(change: impl FnOnce(&mut SynthSettings)) -> SyntheticPatient {
    let mut settings = SynthSettings { seed: 5, spacing_mm: 3.0, post_slice_mm: 3.0, ..SynthSettings::default() };
    change(&mut settings);
    synthesize(&settings).unwrap()
}

fn every_fault() -> ScanFaults {
    ScanFaults {
        ghost_fraction: 0.1,
        coil_gain: 2.0,
        coil_side: HeadSide::Back,
        saturated_fraction: 0.3,
        missing_slices: 2,
        defaced: true,
        ..ScanFaults::default()
    }
}

/// Mean of a scan in a mask.
fn mean<F: Frame>(scan: &Volume<i16, F>, mask: &Mask<F>) -> f64 {
    let inside = (0..mask.data.len()).filter(|&n| mask.data[n]);
    let (sum, count) = inside.fold((0.0, 0.0), |(sum, count), n| (sum + f64::from(scan.data[n]), count + 1.0));
    sum / count
}

#[test]
fn slow_faults_of_one_scan_leave_the_other_and_the_truth_and_give_the_same_bytes_again() {
    let (sound, faulty) = (made(|_| ()), made(|s| s.post = every_fault()));
    assert!(sound.pre == faulty.pre && sound.post != faulty.post);
    assert!(sound.cavity_post == faulty.cavity_post && sound.resected_pre == faulty.resected_pre);
    assert!(sound.brain_post == faulty.brain_post && sound.tissue_pre == faulty.tissue_pre);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = alone.install(|| made(|s| s.post = every_fault()));
    assert!(again.post == faulty.post);
}

#[test]
fn slow_defacing_takes_the_face_and_stripping_the_head_but_every_brain_voxel_stays_as_it_was() {
    let sound = made(|_| ());
    for (defaced, stripped) in [(true, false), (false, true)] {
        let faults = ScanFaults { defaced, stripped, ..ScanFaults::default() };
        let shorn = made(|s| (s.pre, s.post) = (faults.clone(), faults));
        let brain = |n: usize| sound.brain_pre.data[n];
        let gone = (0..sound.pre.data.len()).filter(|&n| sound.pre.data[n] != shorn.pre.data[n]).count();
        assert!((0..sound.pre.data.len()).all(|n| !brain(n) || sound.pre.data[n] == shorn.pre.data[n]));
        let inside = |n: usize| sound.brain_post.data[n] || sound.cavity_post.data[n];
        assert!((0..sound.post.data.len()).all(|n| !inside(n) || sound.post.data[n] == shorn.post.data[n]));
        // A face is some hundreds of cubic centimetres, the head besides its brain some thousands with the air around it.
        let gone_cc = gone as f64 * 0.027;
        assert!(if stripped { gone_cc > 2000.0 } else { (200.0..2500.0).contains(&gone_cc) }, "{gone_cc} cc");
    }
}

#[test]
fn slow_a_cut_scan_and_its_truth_are_parts_of_the_whole_ones() {
    let cut = ScanFaults { cut_mm: 45.0, cut_side: HeadSide::Top, ..ScanFaults::default() };
    let (whole, part) = (made(|_| ()), made(|s| s.pre = cut));
    let held = whole.pre.grid.box_of(&part.pre.grid);
    assert!(whole.pre.cropped(&held) == part.pre && whole.tissue_pre.cropped(&held) == part.tissue_pre);
    assert!(whole.resected_pre.cropped(&held) == part.resected_pre && whole.post == part.post);
    assert_eq!(whole.pre.grid.dims[1] - 15, part.pre.grid.dims[1], "45 mm of 3 mm voxels: sagittal slices have j up");
}

#[test]
fn slow_an_old_lesion_is_fluid_in_both_scans_and_neither_resected_nor_cavity() {
    let (sound, lesioned) = (made(|_| ()), made(|s| s.pathology.old_lesion_cc = 20.0));
    let (before, after) = (lesioned.old_lesion_pre.as_ref().unwrap(), lesioned.old_lesion_post.as_ref().unwrap());
    assert!((before.volume_cc() - 20.0).abs() < 4.0, "{} cc", before.volume_cc());
    assert!((after.volume_cc() / before.volume_cc() - 1.0).abs() < 0.1, "{} cc", after.volume_cc());
    assert!(sound.old_lesion_pre.is_none() && sound.cavity_post == lesioned.cavity_post);
    assert!(sound.resected_pre == lesioned.resected_pre, "the operation is the same");
    let both = |a: &Mask<_>, b: &Mask<_>| a.data.iter().zip(&b.data).any(|(&a, &b)| a && b);
    assert!(!both(before, &lesioned.resected_pre));
    assert!(!after.data.iter().zip(&lesioned.cavity_post.data).any(|(&a, &b)| a && b));
    assert!((0..before.data.len()).all(|n| !before.data[n] || lesioned.tissue_pre.data[n] == label::CSF));
    let fluid = mean(&lesioned.pre, &lesioned.ventricles_pre);
    for (dark, healthy) in [
        (mean(&lesioned.pre, before), mean(&sound.pre, before)),
        (mean(&lesioned.post, after), mean(&sound.post, after)),
    ] {
        assert!(dark < 0.6 * healthy && dark < 1.4 * fluid, "{dark} instead of {healthy}, fluid {fluid}");
    }
}

#[test]
fn slow_oedema_darkens_white_matter_at_the_resection_in_the_scan_that_was_asked_for() {
    let sound = made(|s| s.noise_fraction = 0.0);
    let swollen = made(|s| {
        s.noise_fraction = 0.0;
        s.pathology = Pathology { oedema: Scans::Post, ..Pathology::default() };
    });
    assert!(
        sound.pre == swollen.pre && sound.cavity_post == swollen.cavity_post && sound.tissue_pre == swollen.tissue_pre
    );
    let near = crate::image::morphology::dilate(&sound.cavity_post, 6.0);
    let far = crate::image::morphology::dilate(&sound.cavity_post, 25.0);
    let changed = |inside: &dyn Fn(usize) -> bool| {
        let at = (0..sound.post.data.len()).filter(|&n| sound.brain_post.data[n] && inside(n));
        at.filter(|&n| sound.post.data[n] > swollen.post.data[n] + 15).count()
    };
    assert!(changed(&|n| near.data[n]) > 100, "{}", changed(&|n| near.data[n]));
    assert_eq!(changed(&|n| !far.data[n]), 0);
    assert!((0..sound.post.data.len()).all(|n| swollen.post.data[n] <= sound.post.data[n]));
}

#[test]
fn slow_ventricles_of_a_patient_are_larger_by_about_the_factor_and_so_are_their_labels_after_the_operation() {
    let (own, wide) = (made(|_| ()), made(|s| s.pathology.ventricle_factor = 2.5));
    for (before, after) in [
        (own.truth.ventricles_pre_cc, wide.truth.ventricles_pre_cc),
        (own.truth.ventricles_post_cc, wide.truth.ventricles_post_cc),
    ] {
        assert!((after / before / 2.5 - 1.0).abs() < 0.15, "{before} cc became {after}");
    }
    assert!((wide.truth.brain_cc / own.truth.brain_cc - 1.0).abs() < 0.02, "the brain's outline stays");
    assert!(mean(&wide.pre, &wide.ventricles_pre) < 0.6 * mean(&wide.pre, &wide.brain_pre));
}
