//! The pre-operative scan without its coil's gain: what the shift was seen on, and what the registration is shown again.

use crate::made::finished_pair;
use hgm::geometry::Mni;
use hgm::image::nifti::{ReadOptions, decode, decode_labels};
use hgm::image::{LabelMap, Volume};
use hgm::segment::label;
use nalgebra::{DMatrix, DVector};

/// How much the logarithm of an image changes along a line over these voxels: the standard deviation of its linear part.
fn linear_change(image: &Volume<f32, Mni>, voxels: &[usize]) -> f64 {
    let place = |n: usize| image.grid.voxel(n).map(|v| v as f64);
    let mean = |a: usize| voxels.iter().map(|&n| place(n)[a]).sum::<f64>() / voxels.len() as f64;
    let middle = [0, 1, 2].map(mean);
    let terms =
        DMatrix::from_fn(voxels.len(), 4, |row, a| if a == 3 { 1.0 } else { place(voxels[row])[a] - middle[a] });
    let seen = DVector::from_fn(voxels.len(), |row, _| f64::from(image.data[voxels[row]].max(1.0)).ln());
    let mut found = (terms.transpose() * &terms).cholesky().unwrap().solve(&(terms.transpose() * seen));
    found[3] = 0.0;
    (terms * found).norm() / (voxels.len() as f64).sqrt()
}

const LABELS: &str = "pre_space-MNI_dseg.nii.gz";

/// The sample pair's scans were given a gain; of what changes along a line within white matter, its own part stays.
#[test]
fn slow_the_scan_that_is_registered_again_has_lost_gain() {
    let read = |name: &str| std::fs::read(finished_pair().join("anat").join(name)).unwrap();
    let image = |name: &str| -> Volume<f32, Mni> {
        decode(&read(name), name, &ReadOptions::default()).unwrap().volume.relabelled()
    };
    let (labels, _) = decode_labels(&read(LABELS), LABELS, &ReadOptions::default()).unwrap();
    let labels: LabelMap<Mni> = labels.relabelled();
    let white: Vec<usize> =
        (0..labels.data.len()).filter(|&n| labels.data[n] == label::WHITE_MATTER).step_by(7).collect();
    let [seen, even] = ["pre_space-MNI_T1w.nii.gz", "pre_space-MNI_desc-even_T1w.nii.gz"]
        .map(|name| linear_change(&image(name), &white));
    assert!(seen > 0.012, "nothing to take out: {seen}");
    assert!(even < 0.75 * seen, "{even} of {seen}");
    // Sixteen bits are used: rounding is no noise of its own.
    let brightest = image("pre_space-MNI_desc-even_T1w.nii.gz").data.iter().copied().fold(0.0f32, f32::max);
    assert!(brightest >= 31_999.0, "{brightest}");
}
