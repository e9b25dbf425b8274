//! What is read all the same, and as what.

use super::{File, NAME, gzip, read};
use hgm::geometry::{Native, Position};
use hgm::image::nifti::{
    NiftiProblem, NiftiWarning, ReadOptions, decode, decode_labels, decode_mask, decode_scan, encode_f32,
};
use hgm::image::{Grid, Volume};
use nalgebra::Point3;

#[test]
fn every_version_byte_order_and_packing_reads_the_same() {
    let base = read(&File::sound().bytes());
    assert!(base.warnings.is_empty(), "{:?}", base.warnings);
    assert_eq!(base.volume.grid.dims, [4, 3, 2]);
    let expected: Vec<f32> = (0..24u8).map(f32::from).collect();
    assert_eq!(base.volume.data, expected);
    let last = base.volume.grid.position(Point3::new(3.0, 2.0, 1.0));
    assert!(last.distance_mm(&Position::new(13.0, -16.0, 33.0)) < 1e-9);
    for version in [1, 2] {
        for big in [false, true] {
            let mut file = File::sound();
            if version == 2 {
                file = file.version_2();
            }
            file.big = big;
            for bytes in [file.bytes(), gzip(&file.bytes())] {
                let image = read(&bytes);
                assert_eq!((&image.volume, &image.warnings), (&base.volume, &base.warnings), "{version} {big}");
            }
        }
    }
}

#[test]
fn every_real_data_type_is_read_with_its_scaling() {
    for (datatype, bitpix, signed) in [
        (2, 8, false),
        (256, 8, true),
        (4, 16, true),
        (512, 16, false),
        (8, 32, true),
        (768, 32, false),
        (1024, 64, true),
        (1280, 64, false),
        (16, 32, true),
        (64, 64, true),
    ] {
        for big in [false, true] {
            let bytes = File::with(|f| {
                (f.datatype, f.bitpix, f.big) = (datatype, bitpix, big);
                (f.slope, f.inter) = (0.5, -3.0);
                f.voxels = (0..24).map(|n| f64::from(n - if signed { 12 } else { 0 })).collect();
            });
            let image = read(&bytes);
            for (n, &x) in image.volume.data.iter().enumerate() {
                let stored = n as f32 - if signed { 12.0 } else { 0.0 };
                assert_eq!(x, 0.5 * stored - 3.0, "datatype {datatype}");
            }
        }
    }
    // Slope 0 means: not scaled, whatever the intercept.
    // A slope of 0 asks for no scaling, whatever stands beside it.
    assert_eq!(
        read(&File::with(|f| (f.slope, f.inter) = (0.0, f64::NAN))).volume,
        read(&File::with(|f| f.slope = 0.0)).volume
    );
    let plain = read(&File::with(|f| (f.slope, f.inter) = (0.0, 55.0)));
    assert_eq!(plain.volume.data[5], 5.0);
}

#[test]
fn nan_voxels_become_zero_and_are_counted() {
    let image = read(&File::with(|f| {
        (f.datatype, f.bitpix) = (16, 32);
        f.voxels[3] = f64::NAN;
        f.voxels[4] = f64::INFINITY;
    }));
    assert_eq!((image.nonfinite_voxels, image.volume.data[3], image.volume.data[4]), (2, 0.0, 0.0));
    assert_eq!(image.warnings, [NiftiWarning::NotFinite { voxels: 2 }]);
}

#[test]
fn a_scan_with_a_hole_is_refused_and_one_without_numbers_around_is_read() {
    let scan = |from: usize| {
        let grid = Grid::axis_aligned([30; 3], [1.0; 3], [0.0; 3]);
        let within = |n: usize| grid.voxel(n).iter().all(|v| (from..from + 12).contains(v));
        encode_f32(&Volume::<f32, Native>::from_fn(grid, |n| if within(n) { f32::NAN } else { 100.0 + n as f32 }))
    };
    let read = |from: usize| decode_scan(&scan(from), NAME, &ReadOptions::default());
    let refused = read(9).unwrap_err().to_string();
    assert!(refused.contains("1.7 cc within the image are NaN"), "{refused}");
    assert_eq!(read(0).unwrap().nonfinite_voxels, 1728);
}

#[test]
fn a_scan_in_units_of_another_size_is_read_in_larger_ones_and_that_is_told() {
    let grid = Grid::axis_aligned([20; 3], [1.0; 3], [0.0; 3]);
    let scan = |unit: f32| encode_f32(&Volume::<f32, Native>::from_fn(grid, |n| unit * (n % 211) as f32));
    let read = |unit: f32| decode_scan(&scan(unit), NAME, &ReadOptions::default()).unwrap();
    let usual = read(1.0);
    assert!(usual.warnings.is_empty() && usual.volume.data[210] == 210.0);
    let tiny = read(f32::exp2(-30.0));
    assert_eq!(tiny.warnings, [NiftiWarning::UnusualUnit { factor: f64::exp2(32.0) }]);
    assert!(tiny.volume.data.iter().zip(&usual.volume.data).all(|(tiny, usual)| *tiny == 4.0 * usual));
    let said = read(f32::exp2(40.0)).warnings[0].to_string();
    assert!(said.contains("much larger than a scanner's") && said.contains("3.638e-12 times"), "{said}");
}

#[test]
fn singleton_dimensions_are_dropped_and_a_volume_can_be_chosen() {
    for dim in [[4, 4, 3, 2, 1, 1, 1, 1], [5, 4, 3, 2, 1, 1, 1, 1], [3, 4, 3, 2, 9, 9, 9, 9]] {
        assert_eq!(read(&File::with(|f| f.dim = dim)).volume.grid.dims, [4, 3, 2]);
    }
    let bytes = File::with(|f| f.dim = [4, 2, 3, 2, 2, 1, 1, 1]);
    for bytes in [bytes.clone(), gzip(&bytes)] {
        for volume in 0..2 {
            let options = ReadOptions { volume: Some(volume), ..ReadOptions::default() };
            let image = decode(&bytes, NAME, &options).unwrap();
            assert_eq!(image.volume.data[0], 12.0 * volume as f32);
        }
        let options = ReadOptions { volume: Some(2), ..ReadOptions::default() };
        assert_eq!(
            decode(&bytes, NAME, &options).unwrap_err().problem,
            NiftiProblem::NoSuchVolume { chosen: 2, volumes: 2 }
        );
    }
}

#[test]
fn labels_and_masks_hold_what_they_should() {
    let options = ReadOptions::default();
    let (labels, _) = decode_labels(&File::sound().bytes(), NAME, &options).unwrap();
    assert_eq!(labels.data[23], 23);
    let fractions = File::with(|f| f.slope = 0.3);
    let text = decode_labels(&fractions, NAME, &options).unwrap_err().to_string();
    assert!(text.contains("voxels") && text.contains("whole numbers") && text.contains("label map"), "{text}");
    let text = decode_mask(&File::sound().bytes(), NAME, &options).unwrap_err().to_string();
    assert!(text.contains("it is a label map and no mask"), "{text}");
    let ones = File::with(|f| f.voxels = f.voxels.iter().map(|x| x.min(1.0)).collect());
    let (mask, _) = decode_mask(&ones, NAME, &options).unwrap();
    assert_eq!((mask.count(), mask.data[0]), (23, false));
    let (soft, warnings) = decode_mask(&File::with(|f| f.slope = 1.0 / 24.0), NAME, &options).unwrap();
    assert!(soft.count() == 12 && warnings[0].to_string().contains("fractions"), "{} {warnings:?}", soft.count());
    let empty = File::with(|f| f.voxels = vec![0.0; 24]);
    let text = decode_mask(&empty, "mask.nii", &options).unwrap_err().to_string();
    assert!(text.starts_with("mask.nii: voxels: the mask is empty") && text.contains("leave the option out"), "{text}");
}
