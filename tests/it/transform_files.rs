//! Transform texts against ITK itself.

use crate::python::python;
use hgm::geometry::{Position, Post, Pre, RigidTransform};
use hgm::register::transform_text::{rigid_from_text, to_itk_text, to_matrix_text};
use nalgebra::{UnitQuaternion, Vector3};

/// A turn of about 25 degrees about a point off the origin, and a shift.
fn turned() -> RigidTransform<Post, Pre> {
    RigidTransform::about([3.0, -20.0, 14.0].into(), Vector3::new(0.2, -0.1, 0.35), Vector3::new(10.0, -4.0, 7.5))
}

#[test]
fn simple_itk_moves_an_image_ten_mm_to_the_right_with_our_transform() {
    let folder = tempfile::tempdir().unwrap();
    let right = RigidTransform::<Post, Pre>::new(UnitQuaternion::identity(), Vector3::new(10.0, 0.0, 0.0));
    std::fs::write(folder.path().join("right.tfm"), to_itk_text(&right)).unwrap();
    // ITK's x axis points left: a point that is at x = 0 must be found at LPS x = -10 after resampling.
    let found = python(
        folder.path(),
        "import SimpleITK as sitk, numpy as np
image = sitk.Image(41, 41, 41, sitk.sitkFloat32)
image.SetOrigin((-20, -20, -20))
image[20, 20, 20] = 1
moved = sitk.Resample(image, image, sitk.ReadTransform('right.tfm'), sitk.sitkLinear, 0.0)
k, j, i = np.argwhere(sitk.GetArrayFromImage(moved) > .5)[0].tolist()
print(*moved.TransformIndexToPhysicalPoint((i, j, k)))",
    );
    assert_eq!(found.trim(), "-10.0 0.0 0.0");
}

#[test]
fn simple_itk_and_this_program_map_a_point_alike_both_ways() {
    let folder = tempfile::tempdir().unwrap();
    let (map, x) = (turned(), Position::<Pre>::new(12.0, -34.0, 56.0));
    std::fs::write(folder.path().join("ours.tfm"), to_itk_text(&map)).unwrap();
    std::fs::write(folder.path().join("ours.txt"), to_matrix_text(&map)).unwrap();
    let found = python(
        folder.path(),
        "import SimpleITK as sitk, numpy as np
t = sitk.ReadTransform('ours.tfm')
x, y, z = t.TransformPoint((-12.0, 34.0, 56.0))
print(-x, -y, z)
print(*(np.linalg.inv(np.loadtxt('ours.txt')) @ [12, -34, 56, 1])[:3])
e = sitk.Euler3DTransform((4.0, 5.0, -6.0), .2, -.3, .1, (7.0, -8.0, 9.0))
sitk.WriteTransform(e, 'euler.tfm')
v = sitk.VersorRigid3DTransform(); v.SetCenter((4.0, 5.0, -6.0)); v.SetMatrix(e.GetMatrix()); v.SetTranslation((7.0, -8.0, 9.0))
sitk.WriteTransform(v, 'versor.tfm')
x, y, z = e.TransformPoint((-12.0, 34.0, 56.0))
print(-x, -y, z)",
    );
    let rows: Vec<Position<Post>> = found
        .lines()
        .map(|line| {
            let x: Vec<f64> = line.split_whitespace().map(|w| w.parse().unwrap()).collect();
            Position::new(x[0], x[1], x[2])
        })
        .collect();
    assert!(map.inverse().apply(x).distance_mm(&rows[0]) < 1e-9);
    assert!(map.inverse().apply(x).distance_mm(&rows[1]) < 1e-9);
    for file in ["euler.tfm", "versor.tfm"] {
        let text = std::fs::read_to_string(folder.path().join(file)).unwrap();
        let theirs: RigidTransform<Post, Pre> = rigid_from_text(&text, file).unwrap();
        assert!(theirs.inverse().apply(x).distance_mm(&rows[2]) < 1e-9, "{file}");
    }
}
