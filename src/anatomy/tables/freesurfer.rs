//! FreeSurfer: `aseg`, `aparc+aseg`, `aparc.a2009s+aseg`, `wmparc`.
//!
//! Numbers and names: `distribution/FreeSurferColorLUT.txt` of the FreeSurfer sources. The fourth ventricle is CSF here,
//! because hgm's ventricle is the lateral and third ones. Cavum septi (5th) lies between the lateral ones and belongs to
//! them. The ventral diencephalon is mixed; FreeSurfer itself counts it as subcortical grey. Not here: 6 and 45, the
//! cerebellum's exterior on either side; a 6 in a map of FreeSurfer's is likely somebody's tumour in hgm's number.

use crate::anatomy::table::{LabelTable, Tissue};
use Tissue::{Csf, Grey, Outside, Ventricle, White};

/// All but the parcels of the cortex.
pub(super) const SUBCORTICAL: &[(u32, &str, Tissue)] = &[
    (0, "Unknown", Outside),
    (2, "Left-Cerebral-White-Matter", White),
    (3, "Left-Cerebral-Cortex", Grey),
    (4, "Left-Lateral-Ventricle", Ventricle),
    (5, "Left-Inf-Lat-Vent", Ventricle),
    (7, "Left-Cerebellum-White-Matter", White),
    (8, "Left-Cerebellum-Cortex", Grey),
    (9, "Left-Thalamus", Grey),
    (10, "Left-Thalamus-Proper", Grey),
    (11, "Left-Caudate", Grey),
    (12, "Left-Putamen", Grey),
    (13, "Left-Pallidum", Grey),
    (14, "3rd-Ventricle", Ventricle),
    (15, "4th-Ventricle", Csf),
    (16, "Brain-Stem", White),
    (17, "Left-Hippocampus", Grey),
    (18, "Left-Amygdala", Grey),
    (19, "Left-Insula", Grey),
    (20, "Left-Operculum", Grey),
    (24, "CSF", Csf),
    (26, "Left-Accumbens-area", Grey),
    (27, "Left-Substancia-Nigra", Grey),
    (28, "Left-VentralDC", Grey),
    (29, "Left-undetermined", Grey),
    (30, "Left-vessel", Grey),
    (31, "Left-choroid-plexus", Ventricle),
    (41, "Right-Cerebral-White-Matter", White),
    (42, "Right-Cerebral-Cortex", Grey),
    (43, "Right-Lateral-Ventricle", Ventricle),
    (44, "Right-Inf-Lat-Vent", Ventricle),
    (46, "Right-Cerebellum-White-Matter", White),
    (47, "Right-Cerebellum-Cortex", Grey),
    (48, "Right-Thalamus", Grey),
    (49, "Right-Thalamus-Proper", Grey),
    (50, "Right-Caudate", Grey),
    (51, "Right-Putamen", Grey),
    (52, "Right-Pallidum", Grey),
    (53, "Right-Hippocampus", Grey),
    (54, "Right-Amygdala", Grey),
    (55, "Right-Insula", Grey),
    (56, "Right-Operculum", Grey),
    (58, "Right-Accumbens-area", Grey),
    (59, "Right-Substancia-Nigra", Grey),
    (60, "Right-VentralDC", Grey),
    (61, "Right-undetermined", Grey),
    (62, "Right-vessel", Grey),
    (63, "Right-choroid-plexus", Ventricle),
    (72, "5th-Ventricle", Ventricle),
    (77, "WM-hypointensities", White),
    (78, "Left-WM-hypointensities", White),
    (79, "Right-WM-hypointensities", White),
    (80, "non-WM-hypointensities", Grey),
    (81, "Left-non-WM-hypointensities", Grey),
    (82, "Right-non-WM-hypointensities", Grey),
    (85, "Optic-Chiasm", White),
    (86, "Corpus_Callosum", White),
    (122, "CSF-SA", Csf),
    (165, "Skull", Outside),
    (192, "Corpus_Callosum", White),
    (250, "Fornix", White),
    (251, "CC_Posterior", White),
    (252, "CC_Mid_Posterior", White),
    (253, "CC_Central", White),
    (254, "CC_Mid_Anterior", White),
    (255, "CC_Anterior", White),
    (257, "CSF-ExtraCerebral", Csf),
    (258, "Head-ExtraCerebral", Outside),
    (259, "Eye-Fluid", Outside),
    (260, "BoneOrAir", Outside),
];

/// Parcels of the Desikan-Killiany atlas: 1000 plus the place on the left, 2000 on the right; the white matter under each
/// (`wmparc`) 3000 and 4000.
const DESIKAN: [&str; 36] = [
    "unknown",
    "bankssts",
    "caudalanteriorcingulate",
    "caudalmiddlefrontal",
    "corpuscallosum",
    "cuneus",
    "entorhinal",
    "fusiform",
    "inferiorparietal",
    "inferiortemporal",
    "isthmuscingulate",
    "lateraloccipital",
    "lateralorbitofrontal",
    "lingual",
    "medialorbitofrontal",
    "middletemporal",
    "parahippocampal",
    "paracentral",
    "parsopercularis",
    "parsorbitalis",
    "parstriangularis",
    "pericalcarine",
    "postcentral",
    "posteriorcingulate",
    "precentral",
    "precuneus",
    "rostralanteriorcingulate",
    "rostralmiddlefrontal",
    "superiorfrontal",
    "superiorparietal",
    "superiortemporal",
    "supramarginal",
    "frontalpole",
    "temporalpole",
    "transversetemporal",
    "insula",
];

/// Parcels of the Destrieux atlas (`a2009s`), numbered 0 to 75 after 11100 (left) and 12100 (right).
const DESTRIEUX: u32 = 76;

/// The cortex of both hemispheres by Desikan and Killiany: what SynthSeg's parcellation holds as well.
pub(super) fn desikan_cortex() -> impl Iterator<Item = (u32, String, Tissue)> {
    let parcels = [("lh", 1000), ("rh", 2000)];
    parcels.into_iter().flat_map(|(side, base)| {
        (base..).zip(DESIKAN).map(move |(code, name)| (code, format!("ctx-{side}-{name}"), Grey))
    })
}

pub(super) fn table() -> LabelTable {
    let subcortical = SUBCORTICAL.iter().map(|&(code, name, tissue)| (code, name.to_owned(), tissue));
    let under = [("lh", 3000), ("rh", 4000)].into_iter().flat_map(|(side, base)| {
        (base..).zip(DESIKAN).map(move |(code, name)| (code, format!("wm-{side}-{name}"), White))
    });
    let unsegmented =
        [(5001, "Left"), (5002, "Right")].map(|(code, side)| (code, format!("{side}-UnsegmentedWhiteMatter"), White));
    let destrieux = [("lh", 11_100), ("rh", 12_100)]
        .into_iter()
        .flat_map(|(side, base)| (0..DESTRIEUX).map(move |n| (base + n, format!("ctx_{side}_a2009s_{n}"), Grey)));
    let structures = subcortical.chain(desikan_cortex()).chain(under).chain(unsegmented).chain(destrieux);
    let left: Vec<u32> = [3].into_iter().chain(1001..1036).chain(11_101..11_100 + DESTRIEUX).collect();
    let right: Vec<u32> = [42].into_iter().chain(2001..2036).chain(12_101..12_100 + DESTRIEUX).collect();
    let [left_white, right_white]: [Vec<u32>; 2] =
        [[2].into_iter().chain(3001..3036).collect(), [41].into_iter().chain(4001..4036).collect()];
    LabelTable::new(
        "freesurfer",
        "`aseg`, `aparc+aseg`, `aparc.a2009s+aseg` or `wmparc` of FreeSurfer or FastSurfer",
        "FreeSurfer, FreeSurferColorLUT.txt",
        structures,
        &[&left, &right, &left_white, &right_white],
    )
}
