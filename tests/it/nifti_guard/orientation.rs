//! Where voxels are: qform, sform and all the ways a grid can lie.

use super::{File, NAME, read};
use hgm::image::nifti::{Orientation, ReadOptions, decode};
use nalgebra::{Point3, Rotation3, Vector3};

#[test]
fn the_preferred_form_wins_and_a_small_difference_is_told() {
    let bytes = File::with(|f| f.srow[0][3] = 14.0);
    for (orientation, x) in [(Orientation::Sform, 14.0), (Orientation::Qform, 10.0)] {
        let options = ReadOptions { prefer: Some(orientation), ..ReadOptions::default() };
        let image = decode(&bytes, NAME, &options).unwrap();
        assert_eq!((image.volume.grid.mm_from_voxel[(0, 3)], image.orientation), (x, orientation));
        assert!(image.warnings[0].to_string().contains("4.000 mm"), "{:?}", image.warnings);
    }
    let near = read(&File::with(|f| f.srow[0][3] = 10.3));
    assert_eq!(near.orientation, Orientation::Sform);
    assert!(near.warnings[0].to_string().contains("0.300 mm"), "{:?}", near.warnings);
}

#[test]
fn a_file_with_one_form_leaves_nothing_to_choose() {
    let chosen =
        |prefer, file: &[u8]| decode(file, NAME, &ReadOptions { prefer: Some(prefer), ..ReadOptions::default() });
    let (sform, qform) = (File::with(|f| f.qform_code = 0), File::with(|f| f.sform_code = 0));
    for prefer in [Orientation::Sform, Orientation::Qform] {
        assert_eq!(chosen(prefer, &sform).unwrap().orientation, Orientation::Sform);
        assert_eq!(chosen(prefer, &qform).unwrap().orientation, Orientation::Qform);
    }
}

#[test]
fn a_qform_with_mirrored_axis_and_any_rotation_equals_its_sform() {
    for (n, turn) in [[0.1, 0.2, 0.3], [2.0, -1.0, 0.5], [0.0, 0.0, 3.1], [-2.5, 1.5, 0.7]].into_iter().enumerate() {
        for qfac in [1.0, -1.0] {
            let rotation = Rotation3::new(Vector3::from(turn));
            let q = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation).into_inner();
            let q = if q.w < 0.0 { -q } else { q };
            let linear = rotation.matrix() * nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0 * qfac));
            let make = |both: bool| {
                File::with(|f| {
                    f.sform_code = i16::from(both);
                    f.pixdim[0] = qfac;
                    f.quatern = [q.i, q.j, q.k];
                    for r in 0..3 {
                        f.srow[r] = [linear[(r, 0)], linear[(r, 1)], linear[(r, 2)], f.qoffset[r]];
                    }
                })
            };
            let (both, qform) = (read(&make(true)), read(&make(false)));
            assert!(both.warnings.is_empty() && qform.warnings.is_empty(), "{n} {:?}", both.warnings);
            assert_eq!(qform.orientation, Orientation::Qform);
            assert!(both.volume.grid.coincides(&qform.volume.grid, 1e-5));
        }
    }
}

#[test]
fn all_48_orientation_codes_put_every_voxel_where_it_is_by_either_form() {
    let base = read(&File::sound().bytes()).volume;
    let (sizes, spacing) = ([4usize, 3, 2], [1.0, 2.0, 3.0]);
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let codes = orders.into_iter().flat_map(|order| (0..8).map(move |flips| (order, flips)));
    for (order, flips) in codes {
        // Axis `a` of the file runs along axis order[a] of the patient, against it where flipped.
        let flipped = |a: usize| flips >> a & 1 == 1;
        let dims = order.map(|d| sizes[d]);
        let mut linear = nalgebra::Matrix3::zeros();
        let mut origin = Vector3::new(10.0, -20.0, 30.0);
        for (a, &d) in order.iter().enumerate() {
            linear[(d, a)] = if flipped(a) { -1.0 } else { 1.0 };
            if flipped(a) {
                origin[d] += spacing[d] * (sizes[d] as f64 - 1.0);
            }
        }
        let voxels: Vec<f64> = (0..24)
            .map(|n| {
                let v = [n % dims[0], n / dims[0] % dims[1], n / (dims[0] * dims[1])];
                let mut at = [0; 3];
                for a in 0..3 {
                    at[order[a]] = if flipped(a) { dims[a] - 1 - v[a] } else { v[a] };
                }
                f64::from(base.at(at[0], at[1], at[2]))
            })
            .collect();
        let qfac = linear.determinant();
        let mut proper = linear;
        proper.column_mut(2).scale_mut(qfac);
        let q = nalgebra::UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(proper)).into_inner();
        let q = if q.w < 0.0 { -q } else { q };
        for form in [Orientation::Sform, Orientation::Qform] {
            let image = read(&File::with(|f| {
                (f.sform_code, f.qform_code) =
                    (i16::from(form == Orientation::Sform), i16::from(form == Orientation::Qform));
                f.quatern = [q.i, q.j, q.k];
                f.pixdim[0] = qfac;
                f.qoffset = origin.into();
                for a in 0..3 {
                    f.dim[1 + a] = dims[a] as i64;
                    f.pixdim[1 + a] = spacing[order[a]];
                    f.srow[a] =
                        [0, 1, 2, 3].map(|c| if c < 3 { linear[(a, c)] * spacing[order[c]] } else { origin[a] });
                }
                f.voxels.clone_from(&voxels);
            }));
            assert_eq!((image.orientation, image.volume.grid.dims), (form, dims));
            for n in 0..24 {
                let voxel = Point3::from(base.grid.voxel(n).map(|v| v as f64));
                let found = image.volume.nearest(base.grid.position(voxel));
                assert_eq!(found, Some(base.data[n]), "{order:?} {flips:03b} {form:?}");
            }
        }
    }
}
