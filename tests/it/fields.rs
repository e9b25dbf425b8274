//! Displacement fields and what they carry, against other people's tools.

use crate::job::output;
use crate::python::python;
use hgm::experiment::field::{FieldSettings, Moved, ShiftField, Surroundings, carried, shift_field};
use hgm::geometry::{Mni, Native, Position, Post, Pre, RigidTransform};
use hgm::image::morphology::erode;
use hgm::image::nifti::{decode_displacement, encode_displacement, encode_i16};
use hgm::image::{Grid, Mask, Volume};
use hgm::material::random::CounterRng;
use nalgebra::{Matrix4, Point3, UnitQuaternion, Vector3};
use std::path::Path;

/// Cubes of 12 mm, each cut into six tetrahedra.
fn block(n: usize) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let m = n + 1;
    let at = |c: usize| [c % m, c / m % m, c / (m * m)].map(|x| 12.0 * x as f64 - 6.0 * n as f64);
    let node = |i: usize, j: usize, k: usize| (i + m * (j + m * k)) as u32;
    let mut tets = Vec::new();
    for c in 0..n * n * n {
        let corner = |b: usize| node(c % n + (b & 1), c / n % n + (b >> 1 & 1), c / (n * n) + (b >> 2));
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            tets.push([corner(0), corner(a), corner(b), corner(7)]);
        }
    }
    ((0..m * m * m).map(at).collect(), tets)
}

/// Oblique, left-handed, voxels of 3 mm.
fn grid() -> Grid<Pre> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.25, -0.15, 0.4)).to_homogeneous();
    let size = Matrix4::new_nonuniform_scaling(&Vector3::new(-3.0, 3.0, 3.0));
    let middle = Matrix4::new_translation(&Vector3::new(-34.0, -34.0, -34.0));
    Grid::new([69, 69, 69], Matrix4::new_translation(&Vector3::new(12.0, -7.0, 20.0)) * turn * size * middle).unwrap()
}

fn post_from_pre() -> RigidTransform<Pre, Post> {
    RigidTransform::about([3.0, -20.0, 14.0].into(), Vector3::new(0.2, -0.1, 0.15), Vector3::new(8.0, -4.0, 5.5))
}

/// The field of a block of tissue in a head of fluid that moves as `u` says.
fn field(u: impl Fn([f64; 3]) -> [f64; 3]) -> ShiftField {
    let (nodes, tets) = block(8);
    let pre_from_mni = RigidTransform::<Mni, Pre>::about(
        Point3::origin(),
        Vector3::new(0.1, 0.1, -0.2),
        Vector3::new(12.0, -7.0, 20.0),
    );
    let displacement: Vec<[f64; 3]> = nodes.iter().map(|x| u(*x)).collect();
    let mni_from_pre = pre_from_mni.inverse();
    let grid = grid();
    let at = |n: usize| mni_from_pre.apply(grid.centre(grid.voxel(n))).mm;
    let around = Surroundings {
        brain: Mask::from_fn(grid, |n| at(n).iter().all(|x| x.abs() < 56.0)),
        resected: Mask::from_fn(grid, |n| (at(n) - Point3::new(40.0, 40.0, 40.0)).norm() < 15.0),
    };
    let (sd, reach) = (vec![0.4; nodes.len()], vec![9.0; nodes.len()]);
    let state = Moved { tets: &tets, nodes_mm: &nodes, displacement_mm: &displacement, sd_mm: &sd, reach95_mm: &reach };
    shift_field(&state, None, &pre_from_mni, &around, &FieldSettings::default())
}

/// Four fields as files: brain shift, its inverse, and both with the rigid part.
fn written(folder: &Path, field: &ShiftField) -> Vec<(&'static str, Volume<[f32; 3], Native>)> {
    let pre_from_post = post_from_pre().inverse();
    let post_grid = Grid::<Post>::new([69; 3], post_from_pre().to_matrix() * grid().mm_from_voxel).unwrap();
    [
        ("forward", encode_displacement(&field.whole, |v| field.forward_at(v))),
        ("back", encode_displacement(&field.whole, |v| field.inverse_at(v))),
        ("to_post", encode_displacement(&field.whole, field.to_post(&post_from_pre()))),
        ("to_pre", encode_displacement(&post_grid, field.to_pre(&post_grid, &pre_from_post))),
    ]
    .into_iter()
    .map(|(name, bytes)| {
        std::fs::write(folder.join(format!("{name}.nii.gz")), &bytes).unwrap();
        (name, decode_displacement(&bytes, "field.nii.gz").unwrap())
    })
    .collect()
}

/// A thousand points of the tissue.
fn points(field: &ShiftField) -> Vec<[f64; 3]> {
    let grid = &field.forward.grid;
    let inside: Vec<usize> = (0..grid.len()).filter(|&n| field.believed[n]).collect();
    let point = |n: u64| {
        let rng = CounterRng::new(11, n);
        let v = grid.voxel(inside[(rng.uniform(0) * inside.len() as f64) as usize]);
        let off = |a: usize| v[a] as f64 + rng.uniform(1 + a as u64) - 0.5;
        grid.position(Point3::new(off(0), off(1), off(2))).mm.into()
    };
    (0..1000).map(point).collect()
}

fn text(points: &[[f64; 3]]) -> String {
    let row = |p: &[f64; 3]| format!("{:.6} {:.6} {:.6}", p[0], p[1], p[2]);
    points.iter().map(row).collect::<Vec<_>>().join("\n")
}

/// What each tool makes of the points, largest distance from ours in mm, a line for each field and tool.
const TOOLS: &str = "
import sys, numpy as np, nibabel as nib, SimpleITK as sitk, ants, pandas as pd
from scipy.ndimage import map_coordinates
from dipy.tracking.streamline import deform_streamlines
lps = np.array([-1., -1, 1])
for name in sys.stdin.read().split():
    x = np.loadtxt(f'{name}.in'); ours = np.loadtxt(f'{name}.out'); file = f'{name}.nii.gz'
    found = {}
    t = sitk.DisplacementFieldTransform(sitk.ReadImage(file, sitk.sitkVectorFloat64))
    found['itk'] = np.array([t.TransformPoint(tuple(p)) for p in x * lps]) * lps
    frame = pd.DataFrame((x * lps), columns=list('xyz')); frame['t'] = 0.
    found['ants'] = ants.apply_transforms_to_points(3, frame, [file])[['x', 'y', 'z']].values * lps
    image = nib.load(file); assert image.header['intent_code'] == 1007 and image.shape[3:] == (1, 3)
    d = np.asanyarray(image.dataobj)[:, :, :, 0].astype(float) * lps
    v = np.linalg.inv(image.affine) @ np.c_[x, np.ones(len(x))].T
    found['nibabel'] = x + np.stack([map_coordinates(d[..., a], v[:3], order=1) for a in range(3)], 1)
    lines = [x[n:n + 50].astype(np.float32) for n in range(0, len(x), 50)]
    found['dipy'] = np.concatenate(list(deform_streamlines(lines, d.astype(np.float32), np.linalg.inv(image.affine), image.affine, np.eye(4), np.eye(4))))
    for tool, y in found.items():
        print(name, tool, np.abs(y - ours).max())
";

#[test]
fn itk_ants_nibabel_and_dipy_carry_points_as_this_program_does_on_an_oblique_left_handed_scan() {
    let folder = tempfile::tempdir().unwrap();
    let field = field(|x| [2.0 - 0.015 * x[2], 0.01 * x[0] * (x[1] / 50.0), -2.5 + 0.02 * x[1]]);
    assert!(field.jacobian_min > 0.0);
    let at_rest = points(&field);
    let moved = |v: &Volume<[f32; 3], Native>, x: &[[f64; 3]]| -> Vec<[f64; 3]> {
        x.iter().map(|x| carried(v, *x).unwrap()).collect()
    };
    let fields = written(folder.path(), &field);
    let deformed = moved(&fields[0].1, &at_rest);
    let in_post = moved(&fields[2].1, &at_rest);
    let rigid = |x: &[f64; 3]| -> [f64; 3] { post_from_pre().apply(Position::new(x[0], x[1], x[2])).mm.into() };
    for (shifted, both) in deformed.iter().map(rigid).zip(&in_post) {
        assert!((0..3).all(|a| (shifted[a] - both[a]).abs() < 0.01), "the rigid part comes after the brain shift");
    }
    for ((name, v), x) in fields.iter().zip([&at_rest, &deformed, &at_rest, &in_post]) {
        std::fs::write(folder.path().join(format!("{name}.in")), text(x)).unwrap();
        std::fs::write(folder.path().join(format!("{name}.out")), text(&moved(v, x))).unwrap();
    }
    let script = TOOLS.replace("sys.stdin.read()", "'forward back to_post to_pre'");
    let found = python(folder.path(), &script);
    let rows: Vec<(&str, f64)> =
        found.lines().filter_map(|l| l.rsplit_once(' ')).map(|(who, mm)| (who, mm.parse().unwrap())).collect();
    assert_eq!(rows.len(), 16, "{found}");
    assert!(rows.iter().all(|(_, mm)| *mm < 0.01), "{found}");
    // At the rim of the tissue the field bends between two voxels of 3 mm, and the map back bends elsewhere.
    let inner = erode(&Mask::from_data(field.forward.grid, field.believed.clone()), 7.0);
    let is_inner = |x: &[f64; 3]| inner.nearest(Position::new(x[0], x[1], x[2])).unwrap_or(false);
    for back in [moved(&fields[1].1, &deformed), moved(&fields[3].1, &in_post)] {
        let off = |(a, b): (&[f64; 3], &[f64; 3])| (Vector3::from(*a) - Vector3::from(*b)).norm();
        let pairs = || back.iter().zip(&at_rest);
        let mut inside: Vec<f64> = pairs().filter(|(_, x)| is_inner(x)).map(off).collect();
        inside.sort_by(f64::total_cmp);
        assert!(inside.len() > 500, "{}", inside.len());
        let (most, worst) = (inside[inside.len() * 99 / 100], inside[inside.len() - 1]);
        assert!(most < 0.05 && worst < 0.2, "{most} {worst}");
        assert!(pairs().map(off).fold(0.0, f64::max) < 0.5);
    }
}

#[test]
fn ten_mm_to_the_right_keep_their_sign_in_every_tool() {
    let folder = tempfile::tempdir().unwrap();
    let grid = grid();
    let bytes = encode_displacement(&grid, |_| [10.0, 0.0, 0.0]);
    std::fs::write(folder.path().join("right.nii.gz"), bytes).unwrap();
    let x = vec![[12.0, -7.0, 20.0], [20.0, 3.0, 10.0], [0.0, -12.0, 32.0]];
    let right: Vec<[f64; 3]> = x.iter().map(|p: &[f64; 3]| [p[0] + 10.0, p[1], p[2]]).collect();
    std::fs::write(folder.path().join("right.in"), text(&x)).unwrap();
    std::fs::write(folder.path().join("right.out"), text(&right)).unwrap();
    let found = python(folder.path(), &TOOLS.replace("sys.stdin.read()", "'right'"));
    assert_eq!(found.lines().count(), 4);
    assert!(found.lines().all(|l| l.rsplit_once(' ').unwrap().1.parse::<f64>().unwrap() < 1e-3), "{found}");
}

/// Through the program: a table, tracks as dipy and nibabel write them, and an image.
#[test]
fn the_program_carries_tables_tracks_and_images_through_a_field_of_the_users_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let grid = grid();
    let image = Volume::from_fn(grid, |n| if grid.voxel(n) == [30, 34, 34] { 1000i16 } else { 0 });
    std::fs::write(path("t1.nii.gz"), encode_i16(&image)).unwrap();
    // Nine millimetres along the first axis of the grid: three voxels.
    let along: [f64; 3] = (grid.position(Point3::new(3.0, 0.0, 0.0)).mm - grid.position(Point3::origin()).mm).into();
    std::fs::write(path("field.nii.gz"), encode_displacement(&grid, |_| along.map(|x| x as f32))).unwrap();
    python(
        folder.path(),
        "import nibabel as nib, numpy as np
from nibabel.streamlines import Tractogram, TrkFile, TckFile
rng = np.random.default_rng(1); image = nib.load('t1.nii.gz')
lines = [rng.uniform(-30, 30, (n, 3)).astype(np.float32) + np.float32([12, -7, 20]) for n in (2, 40, 7)]
t = Tractogram(lines, affine_to_rasmm=np.eye(4), data_per_point={'fa': [rng.random((len(l), 1)) for l in lines]})
header = {'voxel_to_rasmm': image.affine, 'voxel_sizes': image.header.get_zooms(), 'dimensions': image.shape, 'voxel_order': ''.join(nib.aff2axcodes(image.affine))}
TrkFile(t, header).save('a.trk')
TckFile(Tractogram(lines, affine_to_rasmm=np.eye(4))).save('a.tck')
np.savetxt('a.csv', lines[1], delimiter=',', header='x,y,z', comments='')
hole = image.get_fdata(dtype=np.float32).copy(); hole[30, 30, 30] = np.nan
nib.save(nib.Nifti1Image(hole, image.affine), 'hole.nii.gz')",
    );
    for (from, to) in [("a.trk", "b.trk"), ("a.tck", "b.tck"), ("a.csv", "b.csv"), ("t1.nii.gz", "moved.nii.gz")] {
        let ended = output(&["warp", "--field", &path("field.nii.gz"), &path(from), "-o", &path(to)]);
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    }
    let found = python(
        folder.path(),
        &format!(
            "import nibabel as nib, numpy as np
by = np.array({along:?})
for end in ('trk', 'tck'):
    a, b = (nib.streamlines.load(f'{{n}}.{{end}}') for n in 'ab')
    print(max(np.abs(p + by - q).max() for p, q in zip(a.streamlines, b.streamlines)), len(b.streamlines))
a, b = (nib.streamlines.load(f'{{n}}.trk').tractogram.data_per_point['fa'] for n in 'ab')
print(max(np.abs(p - q).max() for p, q in zip(a, b)), 3)
print(np.abs(np.genfromtxt('b.csv', delimiter=',', skip_header=1)[:, :3] - np.loadtxt('a.csv', delimiter=',', skiprows=1) - by).max(), 3)
d = nib.load('moved.nii.gz').get_fdata()
print(np.abs(np.array(np.unravel_index(d.argmax(), d.shape)) - [33, 34, 34]).max(), 3)"
        ),
    );
    assert_eq!(found.lines().count(), 5, "{found}");
    for line in found.lines() {
        let (off, count) = line.split_once(' ').unwrap();
        assert!(off.parse::<f64>().unwrap() < 1e-3 && count == "3", "{found}");
    }
    let ended = output(&["warp", "--field", &path("field.nii.gz"), &path("hole.nii.gz"), "-o", &path("filled.nii.gz")]);
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.success() && said.contains("hole.nii.gz: 1 voxels are NaN"), "{said}");
    let refused = output(&["warp", "--field", &path("field.nii.gz"), &path("a.trk"), "-o", &path("b.tck")]);
    assert_eq!(refused.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("end the name in .trk"));
}
