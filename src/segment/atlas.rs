//! The MNI152 2009a symmetric template, embedded: T1, tissue probabilities, labels, and rough regions on it.
//!
//! V. Fonov et al., "Unbiased average age-appropriate atlases for pediatric studies", NeuroImage 54(1), 2011. Where each
//! file came from is written in `atlases/mni152/PROVENANCE.md`.

use super::atlas_labels::derive_labels;
use crate::geometry::{AffineTransform, Mni, Position};
use crate::image::resample::{Interpolation, resample, resample_nearest};
use crate::image::{Grid, LabelMap, Mask, Volume};
use nalgebra::{Matrix3, Matrix4, Vector3};
use std::io::Read;
use std::sync::OnceLock;

/// The template on its 1 mm grid of 197 x 233 x 189 voxels.
#[derive(Clone, Debug)]
pub struct Atlas {
    /// T1 intensity, 0 outside the brain (the template comes without the skull).
    pub t1: Volume<u8, Mni>,
    /// Probability of grey matter, 0 to 255.
    pub grey: Volume<u8, Mni>,
    /// Probability of white matter, 0 to 255.
    pub white: Volume<u8, Mni>,
    /// The labels of [`super::label`] derived from the maps: CSF, grey matter, white matter, ventricle.
    pub labels: LabelMap<Mni>,
}

/// A hemisphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The patient's left, x < 0.
    Left,
    /// The patient's right, x > 0.
    Right,
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

/// The embedded template, decoded once.
///
/// # Panics
/// Never for the embedded files; a test decodes them.
pub fn template() -> &'static Atlas {
    static ATLAS: OnceLock<Atlas> = OnceLock::new();
    ATLAS.get_or_init(|| Atlas {
        t1: decode(include_bytes!("../../atlases/mni152/mni_icbm152_t1_tal_nlin_sym_09a_converted.nii.gz")),
        grey: decode(include_bytes!("../../atlases/mni152/mni_icbm152_gm_tal_nlin_sym_09a_converted.nii.gz")),
        white: decode(include_bytes!("../../atlases/mni152/mni_icbm152_wm_tal_nlin_sym_09a_converted.nii.gz")),
        labels: decode(include_bytes!("../../atlases/mni152/labels.nii.gz")),
    })
}

/// The mean of many whole heads, in natural size, in the template's frame: scalp, skull, eyes and brain at 2 mm.
///
/// Where it came from is written in `atlases/head/PROVENANCE.md`.
///
/// # Panics
/// Never for the embedded file; a test decodes it.
pub fn mean_head() -> &'static MeanHead {
    static HEAD: OnceLock<MeanHead> = OnceLock::new();
    HEAD.get_or_init(|| {
        let t1 = decode(include_bytes!("../../atlases/head/head.nii.gz")).map(f32::from);
        let template_from_head = head_from_template().inverse().expect("a stretch can be inverted");
        let brain = resample_nearest(&template().t1, &t1.grid, &template_from_head, 0).map(|x| x > 0);
        let bare = resample(&template().t1_f32(), &t1.grid, &template_from_head, Interpolation::Linear, 0.0).volume;
        MeanHead { t1, brain, bare }
    })
}

/// The whole head that poses and sizes are measured against.
#[derive(Clone, Debug)]
pub struct MeanHead {
    /// T1 intensity, 0 to 255.
    pub t1: Volume<f32, Mni>,
    /// The template's brain on it.
    pub brain: Mask<Mni>,
    /// The template's T1 in this size: a brain without scalp and skull.
    pub bare: Volume<f32, Mni>,
}

/// From the template, which is larger than people are, to the mean head in its natural size.
pub fn head_from_template() -> AffineTransform<Mni, Mni> {
    let linear = Matrix3::new(0.8731, 0.0, 0.0, 0.0, 0.8968, -0.0195, 0.0, -0.0195, 0.8124);
    AffineTransform::from_parts(linear, Vector3::new(0.0, -2.0966, 1.3455))
}

impl Atlas {
    /// The grid all maps share.
    pub fn grid(&self) -> Grid<Mni> {
        self.t1.grid
    }

    /// The brain: everywhere the template has an intensity.
    pub fn brain(&self) -> Mask<Mni> {
        self.t1.map(|value| value > 0)
    }

    /// T1 intensity as floating point, for registration and resampling.
    pub fn t1_f32(&self) -> Volume<f32, Mni> {
        self.t1.map(f32::from)
    }

    /// The label map computed anew from the three maps: what `labels` was made by.
    pub fn derived_labels(&self) -> LabelMap<Mni> {
        derive_labels(&self.t1, &self.grey, &self.white)
    }
}

/// Thalamus, putamen and pallidum of the template: ellipsoids placed by eye, of which what is darker than the capsules.
///
/// Iron and fibres make these nuclei nearly as bright as white matter, in many scans quite as bright: only their place tells
/// them apart. The caudate nucleus, hippocampus and amygdala look like cortex and need no help.
///
/// In a head's size the nuclei lie between what two label maps of other programs give theirs. What is drawn too small here,
/// the mixture calls white matter.
pub fn deep_grey() -> Mask<Mni> {
    /// Centre and radii in mm of the right side's ellipsoid; how far its axis moves outwards for each mm backwards;
    /// the template's intensities in it.
    type Nucleus = ([f64; 3], [f64; 3], f64, std::ops::Range<u8>);
    const NUCLEI: [Nucleus; 3] = [
        ([11.5, -18.0, 8.0], [13.0, 17.5, 12.5], 0.3, 150..208),
        ([25.5, 2.0, 2.0], [8.5, 21.5, 14.0], 0.28, 160..202),
        ([19.5, -4.0, -1.0], [7.5, 12.5, 8.0], 0.3, 160..212),
    ];
    let t1 = &template().t1;
    let bright = |value: u8| NUCLEI.iter().any(|nucleus| nucleus.3.contains(&value));
    Mask::from_fn(t1.grid, |n| {
        if !bright(t1.data[n]) {
            return false;
        }
        let p = t1.grid.centre(t1.grid.voxel(n)).mm;
        NUCLEI.iter().any(|(centre, radii, outwards, range)| {
            let x = p.x.abs() - centre[0] + outwards * (p.y - centre[1]);
            let along = [x / radii[0], (p.y - centre[1]) / radii[1], (p.z - centre[2]) / radii[2]];
            along.iter().map(|a| a * a).sum::<f64>() < 1.0 && range.contains(&t1.data[n])
        })
    })
}

/// The temporal lobe that holds a point, by planes placed by eye on the template: below the Sylvian fissure, above the
/// tentorium, lateral of the brainstem. Rough: for naming and ranking, not for measuring.
pub fn temporal_lobe(p: Position<Mni>) -> Option<Side> {
    let [x, y, z] = [p.mm.x, p.mm.y, p.mm.z];
    let tentorium_mm = if y < -30.0 { -22.0 + 0.35 * (-30.0 - y) } else { -50.0 };
    let inside = x.abs() > 17.0 && (-64.0..26.0).contains(&y) && !above_sylvian(y, z) && z > tentorium_mm;
    inside.then_some(if x < 0.0 { Side::Left } else { Side::Right })
}

/// Whether a place lies above the plane of the Sylvian fissure.
pub fn above_sylvian(y: f64, z: f64) -> bool {
    z > -2.0 - 0.35 * (y - 10.0)
}

/// How far in front the central sulcus lies at a height: from the Sylvian fissure up and back to the vertex.
pub fn central_mm(z: f64) -> f64 {
    -5.0 - 0.45 * (z - 15.0).max(0.0)
}

/// One embedded map. All of them are little-endian unsigned bytes in NIfTI-1 with an sform and no scaling, which the
/// tests check; the general reader is `image::nifti`'s.
fn decode(gzip: &[u8]) -> Volume<u8, Mni> {
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(gzip).read_to_end(&mut bytes).expect("the embedded atlas is whole");
    let dims = [42, 44, 46].map(|at| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])));
    let row = |r: usize| {
        [0, 1, 2, 3].map(|c| {
            let at = 280 + 16 * r + 4 * c;
            f64::from(f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]))
        })
    };
    let mm_from_voxel = Matrix4::from_fn(|r, c| if r < 3 { row(r)[c] } else { f64::from(u8::from(c == 3)) });
    let grid = Grid::new(dims, mm_from_voxel).expect("the embedded affine can be inverted");
    Volume::from_data(grid, bytes[352..352 + grid.len()].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::label;

    #[test]
    fn the_maps_lie_on_one_grid_with_the_origin_inside_the_brain() {
        let atlas = template();
        assert_eq!(atlas.grid().dims, [197, 233, 189]);
        for grid in [atlas.grey.grid, atlas.white.grid, atlas.labels.grid] {
            assert_eq!(grid, atlas.grid());
        }
        assert_eq!(atlas.grid().spacing_mm(), [1.0; 3]);
        assert_eq!(atlas.t1.nearest(Position::new(0.0, -20.0, 0.0)).map(|v| v > 0), Some(true));
        assert!((1850.0..1920.0).contains(&atlas.brain().volume_cc()), "{}", atlas.brain().volume_cc());
    }

    #[test]
    fn the_mean_head_is_symmetric_of_natural_size_and_its_brain_lies_inside_its_scalp() {
        let head = mean_head();
        assert!((1100.0..1300.0).contains(&head.brain.volume_cc()), "{}", head.brain.volume_cc());
        let [nx, ny, nz] = head.t1.grid.dims;
        for (i, j, k) in (0..nx * ny * nz).step_by(997).map(|n| (n % nx, n / nx % ny, n / (nx * ny))) {
            assert!((head.t1.at(i, j, k) - head.t1.at(nx - 1 - i, j, k)).abs() <= 1.0, "{i} {j} {k}");
        }
        let at = |x, y, z| head.t1.nearest(Position::new(x, y, z)).unwrap_or(0.0);
        let along_the_vertex: Vec<f32> = (50..95).map(|z| at(0.0, -20.0, f64::from(z))).collect();
        let brightest = along_the_vertex.iter().copied().fold(0.0, f32::max);
        assert!(at(24.0, -20.0, 30.0) > 150.0 && brightest > 80.0, "white matter, scalp");
        assert!(at(0.0, -20.0, 99.0) < 20.0, "air above the scalp");
    }

    #[test]
    fn the_deep_nuclei_have_their_volumes_and_leave_the_internal_capsule_out() {
        let deep = deep_grey();
        let natural = deep.volume_cc() * head_from_template().linear.determinant();
        // Both sides: between a small and a large head of label maps of other programs.
        assert!((2.0 * 11.5..2.0 * 15.0).contains(&natural), "{natural}");
        let at = |x, y, z| deep.nearest(Position::new(x, y, z)).unwrap_or(false);
        for (x, y, z) in [(14.0, -18.0, 8.0), (27.0, 2.0, 2.0), (20.0, -6.0, -1.0)] {
            assert!(at(x, y, z) && at(-x, y, z), "{x} {y} {z}");
        }
        for (x, y, z) in [(18.0, 8.0, 8.0), (27.0, -25.0, 12.0), (13.0, 12.0, 10.0), (0.0, -20.0, 26.0)] {
            assert!(!at(x, y, z) && !at(-x, y, z), "{x} {y} {z}");
        }
    }

    #[test]
    fn the_committed_labels_are_the_derivation() {
        let atlas = template();
        let derived = atlas.derived_labels();
        let differing = derived.data.iter().zip(&atlas.labels.data).filter(|(a, b)| a != b).count();
        assert_eq!(
            differing, 0,
            "run `cargo run --release --example derive_atlas_labels -- --write` and commit the file"
        );
    }

    #[test]
    fn the_labels_have_the_volumes_of_a_brain_and_are_nearly_symmetric() {
        let labels = &template().labels;
        let cc = |l: u8| labels.map(|v| v == l).volume_cc();
        assert!((15.0..25.0).contains(&cc(label::VENTRICLE)), "{}", cc(label::VENTRICLE));
        assert!(cc(label::GREY_MATTER) > 1.3 * cc(label::WHITE_MATTER));
        assert!(cc(label::CSF) > 50.0);
        let ventricle_in = |sign: f64| {
            let grid = labels.grid;
            let side = |n: usize| {
                let [i, _, _] = grid.voxel(n);
                sign * (i as f64 + grid.mm_from_voxel[(0, 3)]) > 0.0
            };
            (0..grid.len()).filter(|&n| labels.data[n] == label::VENTRICLE && side(n)).count() as f64
        };
        assert!((ventricle_in(1.0) / ventricle_in(-1.0) - 1.0).abs() < 0.02);
    }

    #[test]
    fn anatomical_landmarks_have_their_labels() {
        let at = |x, y, z| template().labels.nearest(Position::new(x, y, z));
        assert_eq!(at(8.0, 20.0, 8.0), Some(label::VENTRICLE), "frontal horn");
        assert_eq!(at(-26.0, -45.0, 10.0), Some(label::VENTRICLE), "atrium");
        assert_eq!(at(0.0, -10.0, -4.0), Some(label::VENTRICLE), "third ventricle");
        assert_eq!(at(0.0, -38.0, 0.0), Some(label::CSF), "quadrigeminal cistern is no ventricle");
        assert_eq!(at(0.0, -45.0, -35.0), Some(label::CSF), "fourth ventricle is no part of the label");
        assert_eq!(at(25.0, -20.0, 30.0), Some(label::WHITE_MATTER), "corona radiata");
        assert_eq!(at(0.0, 0.0, 110.0), Some(label::BACKGROUND), "air");
        assert_eq!(temporal_lobe(Position::new(-55.0, -10.0, -20.0)), Some(Side::Left));
        assert_eq!(temporal_lobe(Position::new(45.0, 10.0, -30.0)), Some(Side::Right));
        assert_eq!(temporal_lobe(Position::new(45.0, 30.0, 20.0)), None);
    }
}
