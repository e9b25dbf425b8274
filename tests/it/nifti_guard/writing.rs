//! What is written reads back, and holds no text.

use super::{File, NAME, read};
use hgm::geometry::{Mni, Native, Pre};
use hgm::image::nifti::{
    Orientation, ReadOptions, decode, decode_labels, decode_mask, encode_f32, encode_i16, encode_mask, encode_u8,
    encode_vectors,
};
use hgm::image::{Grid, Mask, Volume};
use nalgebra::{Matrix4, Rotation3, Vector3};

fn oblique() -> Grid<Pre> {
    let turn = Rotation3::new(Vector3::new(0.3, -0.2, 2.5)).to_homogeneous();
    let scale = Matrix4::new_nonuniform_scaling(&Vector3::new(0.9, 1.1, -2.5));
    let mut affine = turn * scale;
    affine.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::new(-1234.5, 67.8, 901.2));
    Grid::new([7, 6, 5], affine).unwrap()
}

#[test]
fn what_is_written_reads_back_with_both_forms_and_no_text() {
    let grid = oblique();
    let data: Vec<f32> = (0..grid.len()).map(|n| (n as f32).sin() * 1000.0).collect();
    let scan = Volume::from_data(grid, data);
    let bytes = encode_f32(&scan);
    assert_eq!(bytes, encode_f32(&scan));
    for prefer in [None, Some(Orientation::Sform), Some(Orientation::Qform)] {
        let options = ReadOptions { prefer, ..ReadOptions::default() };
        let image = decode(&bytes, NAME, &options).unwrap();
        assert!(image.warnings.is_empty(), "{:?}", image.warnings);
        assert_eq!(image.volume.data, scan.data);
        assert!(image.volume.grid.coincides(&grid.relabelled::<Native>(), 2e-4));
    }
    let labels = scan.map(|x| x as i32 as u8);
    assert_eq!(decode_labels(&encode_u8(&labels), NAME, &ReadOptions::default()).unwrap().0.data, labels.data);
    let whole = scan.map(|x| x as i16);
    let read_back: Vec<i16> = read(&encode_i16(&whole)).volume.data.iter().map(|&x| x as i16).collect();
    assert_eq!(read_back, whole.data);
    let mask: Mask<Pre> = scan.map(|x| x > 300.0);
    assert_eq!(decode_mask(&encode_mask(&mask), NAME, &ReadOptions::default()).unwrap().0.data, mask.data);
    let vectors = scan.map(|x| [x, 2.0 * x, -x]);
    for (component, factor) in [1.0, 2.0, -1.0].into_iter().enumerate() {
        let options = ReadOptions { volume: Some(component), ..ReadOptions::default() };
        let image = decode(&encode_vectors(&vectors), NAME, &options).unwrap();
        assert_eq!(image.volume.data, scan.map(|x| x * factor).data);
    }

    // Text of the input does not survive, and nothing else writes any: all text fields and the time are zero.
    let mut named = File::sound();
    named.text = true;
    let again = encode_f32(&read(&named.bytes()).volume);
    assert_eq!(again[3..9], [0; 6], "gzip flags, time and hint");
    let mut raw = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&again[..]), &mut raw).unwrap();
    assert!(raw[4..38].iter().chain(&raw[148..252]).chain(&raw[328..344]).chain(&raw[348..352]).all(|&b| b == 0));
}

#[test]
fn a_sheared_grid_is_written_without_the_quaternion_it_does_not_fit() {
    let mut affine = Matrix4::identity();
    affine[(0, 1)] = 0.3;
    let grid = Grid::<Mni>::new([3, 3, 3], affine).unwrap();
    let image = read(&encode_f32(&Volume::from_data(grid, (0..27u8).map(f32::from).collect())));
    assert!(image.volume.grid.coincides(&grid.relabelled::<Native>(), 1e-6));
    assert!(image.warnings.iter().any(|w| w.to_string().contains("perpendicular")), "{:?}", image.warnings);
}

#[test]
fn a_grid_too_long_for_the_first_version_is_written_in_the_second() {
    let grid = Grid::<Pre>::axis_aligned([40000, 2, 2], [0.1; 3], [0.0; 3]);
    let long = Volume::from_data(grid, (0..grid.len()).map(|n| (n % 251) as u8).collect());
    let image = read(&encode_u8(&long));
    assert_eq!(image.volume.grid.dims, grid.dims);
    assert!(image.warnings.is_empty() && image.volume.grid.coincides(&grid.relabelled::<Native>(), 1e-9));
}
