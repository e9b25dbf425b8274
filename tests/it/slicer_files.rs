//! What is handed to 3D Slicer, read by pynrrd and by ITK.

use crate::python::python;
use hgm::geometry::Mni;
use hgm::image::seg_nrrd::{Segment, encode};
use hgm::image::{Grid, Volume};
use nalgebra::Matrix4;

#[test]
fn a_segmentation_lies_in_slicer_where_it_lies_here() {
    let folder = tempfile::tempdir().unwrap();
    // Oblique, and moved 10 mm to the right: a sign lost at the door would show.
    #[rustfmt::skip]
    let affine = Matrix4::new(
        0.9, -0.2, 0.0, 10.0,
        0.2, 0.9, 0.1, -20.0,
        0.0, -0.1, 1.5, 30.0,
        0.0, 0.0, 0.0, 1.0,
    );
    let mut labels = Volume::filled(Grid::<Mni>::new([7, 6, 5], affine).unwrap(), 0u8);
    for (i, j, k, label) in [(1, 2, 3, 2), (2, 2, 3, 2), (5, 4, 1, 3)] {
        let index = labels.grid.index(i, j, k);
        labels.data[index] = label;
    }
    let segment = |label, name: &str| Segment { label, name: name.into(), colour: [0.25, 0.5, 1.0] };
    let segments = [segment(2, "grey matter"), segment(3, "white matter"), segment(4, "ventricle")];
    let bytes = encode(&labels, &segments);
    assert_eq!(bytes, encode(&labels, &segments));
    std::fs::write(folder.path().join("x.seg.nrrd"), bytes).unwrap();
    python(
        folder.path(),
        r#"
import nrrd, numpy as np, SimpleITK as sitk
data, header = nrrd.read("x.seg.nrrd")
assert data.shape == (7, 6, 5) and data[1, 2, 3] == 2 and data[2, 2, 3] == 2 and data[5, 4, 1] == 3
assert data.astype(int).sum() == 7
assert [header[f"Segment{n}_Name"] for n in range(3)] == ["grey matter", "white matter", "ventricle"]
assert header["Segment0_LabelValue"] == "2" and header["Segment0_Extent"] == "1 2 2 2 3 3"
assert header["Segment2_Extent"] == "0 -1 0 -1 0 -1" and header["Segment1_Color"].split() == ["0.25", "0.5", "1"]
image = sitk.ReadImage("x.seg.nrrd")
assert image.GetPixel(5, 4, 1) == 3
lps = np.array(image.TransformContinuousIndexToPhysicalPoint((5, 4, 1)))
ras = np.array([[.9, -.2, 0], [.2, .9, .1], [0, -.1, 1.5]]) @ (5, 4, 1) + (10, -20, 30)
assert np.allclose(lps * (-1, -1, 1), ras, atol=1e-5), (lps, ras)
"#,
    );
}
