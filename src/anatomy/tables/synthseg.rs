//! SynthSeg: its segmentations with or without parcels, and the label maps it was trained on.
//!
//! Numbers: `data/labels table.txt` of the SynthSeg sources (those of FreeSurfer's `aseg`; 24 since version 2). The training
//! maps add lesions of the white matter (25, 57), the plexus within each ventricle (136, 137, 163, 164) and the head's other
//! structures with the numbers of SimNIBS' atlas; the plexus is known by where it lies, no list of the project names it.

use super::{freesurfer, simnibs};
use crate::anatomy::table::{LabelTable, Tissue};

const SEGMENTED: [u32; 33] = [
    0, 2, 3, 4, 5, 7, 8, 10, 11, 12, 13, 14, 15, 16, 17, 18, 24, 26, 28, 41, 42, 43, 44, 46, 47, 49, 50, 51, 52, 53,
    54, 58, 60,
];

/// Further numbers of FreeSurfer's in the training maps.
const TRAINED_ON: [u32; 6] = [30, 62, 72, 77, 80, 85];

const OWN: [(u32, &str, Tissue); 6] = [
    (25, "left white matter lesion", Tissue::White),
    (57, "right white matter lesion", Tissue::White),
    (136, "left lateral ventricle, plexus", Tissue::Ventricle),
    (137, "left inferior lateral ventricle, plexus", Tissue::Ventricle),
    (163, "right lateral ventricle, plexus", Tissue::Ventricle),
    (164, "right inferior lateral ventricle, plexus", Tissue::Ventricle),
];

pub(super) fn table() -> LabelTable {
    let shared = freesurfer::SUBCORTICAL.iter().filter(|s| SEGMENTED.contains(&s.0) || TRAINED_ON.contains(&s.0));
    let structures = shared.chain(&OWN).chain(&simnibs::HEAD);
    let structures = structures.map(|&(code, name, tissue)| (code, name.to_owned(), tissue));
    let left: Vec<u32> = [3].into_iter().chain(1001..1036).collect();
    let right: Vec<u32> = [42].into_iter().chain(2001..2036).collect();
    LabelTable::new(
        "synthseg",
        "a segmentation of SynthSeg (`mri_synthseg`), or one of its training label maps",
        "SynthSeg, data/labels table.txt; SimNIBS, compressionLookupTable.txt",
        structures.chain(freesurfer::desikan_cortex()),
        &[&[2], &[41], &left, &right, &[8], &[47]],
    )
}
