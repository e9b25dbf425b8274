//! SimNIBS 4, `charm`: nine tissues in `final_tissues.nii.gz`, and in `labeling.nii.gz` FreeSurfer's numbers with those of
//! the whole head's other structures.
//!
//! Numbers: `simnibs_tissues` of `charm_atlas_mni.ini` and `compressionLookupTable.txt`, both in
//! `simnibs/segmentation/atlases/charm_atlas_mni` of the SimNIBS sources; 4 is the skull of SimNIBS 3 (`headreco`).

use super::freesurfer;
use crate::anatomy::table::{LabelTable, Tissue};

/// The head outside the brain, in `labeling.nii.gz` and in the label maps that SynthSeg was trained on.
pub(super) const HEAD: [(u32, &str, Tissue); 14] = [
    (501, "Air-Internal", Tissue::Outside),
    (502, "Artery", Tissue::Outside),
    (506, "Eyes", Tissue::Outside),
    (507, "Other-Tissues", Tissue::Outside),
    (508, "Rectus-Muscles", Tissue::Outside),
    (509, "Mucosa", Tissue::Outside),
    (511, "Skin", Tissue::Outside),
    (512, "Spinal-Cord", Tissue::Outside),
    (514, "Vein", Tissue::Outside),
    (515, "Bone-Cortical", Tissue::Outside),
    (516, "Bone-Cancellous", Tissue::Outside),
    (517, "Background", Tissue::Outside),
    (520, "CorticalCSF", Tissue::Csf),
    (530, "Optic-Nerve", Tissue::Outside),
];

pub(super) fn tissues() -> LabelTable {
    let names = [
        (0, "Background", Tissue::Outside),
        (1, "WM", Tissue::White),
        (2, "GM", Tissue::Grey),
        (3, "CSF", Tissue::Csf),
        (4, "Bone", Tissue::Outside),
        (5, "Scalp", Tissue::Outside),
        (6, "Eyes", Tissue::Outside),
        (7, "Compact_bone", Tissue::Outside),
        (8, "Spongy_bone", Tissue::Outside),
        (9, "Blood", Tissue::Outside),
        (10, "Muscle", Tissue::Outside),
        (100, "Electrode", Tissue::Outside),
        (500, "Saline_or_gel", Tissue::Outside),
    ];
    // A map of the brain alone in these numbers cannot be told from hgm's own by its numbers.
    let needed: [&[u32]; 5] = [&[1], &[2], &[3], &[5], &[4, 7, 8]];
    let structures = names.map(|(code, name, tissue)| (code, name.to_owned(), tissue));
    LabelTable::new(
        "charm",
        "`final_tissues.nii.gz` of SimNIBS' charm",
        "SimNIBS 4, simnibs_tissues of charm_atlas_mni.ini",
        structures,
        &needed,
    )
}

pub(super) fn labeling() -> LabelTable {
    let brain = freesurfer::SUBCORTICAL.iter().filter(|s| s.0 < 100).chain(&HEAD);
    let structures = brain.map(|&(code, name, tissue)| (code, name.to_owned(), tissue));
    let needed: [&[u32]; 5] = [&[2], &[3], &[41], &[42], &[507, 511, 515, 517, 520]];
    LabelTable::new(
        "charm-labeling",
        "`labeling.nii.gz` of SimNIBS' charm",
        "SimNIBS 4, compressionLookupTable.txt of charm_atlas_mni",
        structures,
        &needed,
    )
}
