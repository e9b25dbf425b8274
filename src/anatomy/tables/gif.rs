//! GIF, the parcellation of NiftySeg and NiftyWeb (version 3).
//!
//! Numbers: `BrainParcellationAreas-GIF_v3` and `labels_v3.xml` of NiftyWeb (University College London). The lining of the
//! ventricles is counted to them: it is the voxels half in fluid at their wall.

use super::neuromorphometrics::gyri;
use crate::anatomy::table::{LabelTable, Tissue};
use Tissue::{Csf, Grey, Outside, Ventricle, White};

const DEEP: [(u32, &str, Tissue); 58] = [
    (0, "Non-Brain Outer Tissue", Outside),
    (1, "NonBrain Low", Outside),
    (2, "NonBrain Mid", Outside),
    (3, "NonBrain High", Outside),
    (4, "Non-ventricular CSF", Csf),
    (5, "3rd Ventricle", Ventricle),
    (12, "4th Ventricle", Csf),
    (16, "5th Ventricle", Ventricle),
    (24, "Right Accumbens Area", Grey),
    (31, "Left Accumbens Area", Grey),
    (32, "Right Amygdala", Grey),
    (33, "Left Amygdala", Grey),
    (35, "Pons", White),
    (36, "Brain Stem", White),
    (37, "Right Caudate", Grey),
    (38, "Left Caudate", Grey),
    (39, "Right Cerebellum Exterior", Grey),
    (40, "Left Cerebellum Exterior", Grey),
    (41, "Right Cerebellum White Matter", White),
    (42, "Left Cerebellum White Matter", White),
    (43, "Right Cerebral Exterior", Csf),
    (44, "Left Cerebral Exterior", Csf),
    (47, "3rd Ventricle (Posterior part)", Ventricle),
    (48, "Right Hippocampus", Grey),
    (49, "Left Hippocampus", Grey),
    (50, "Right Inf Lat Vent", Ventricle),
    (51, "Left Inf Lat Vent", Ventricle),
    (52, "Right Lateral Ventricle", Ventricle),
    (53, "Left Lateral Ventricle", Ventricle),
    (54, "Right Lesion", White),
    (55, "Left Lesion", White),
    (56, "Right Pallidum", Grey),
    (57, "Left Pallidum", Grey),
    (58, "Right Putamen", Grey),
    (59, "Left Putamen", Grey),
    (60, "Right Thalamus Proper", Grey),
    (61, "Left Thalamus Proper", Grey),
    (62, "Right Ventral DC", Grey),
    (63, "Left Ventral DC", Grey),
    (64, "Right vessel", Grey),
    (65, "Left vessel", Grey),
    (66, "Right Ventricular Lining", Ventricle),
    (67, "Left Ventricular Lining", Ventricle),
    (70, "Optic Chiasm", White),
    (72, "Cerebellar Vermal Lobules I-V", Grey),
    (73, "Cerebellar Vermal Lobules VI-VII", Grey),
    (74, "Cerebellar Vermal Lobules VIII-X", Grey),
    (76, "Left Basal Forebrain", Grey),
    (77, "Right Basal Forebrain", Grey),
    (81, "Right Temporal White Matter", White),
    (82, "Right Insula White Matter", White),
    (83, "Right Cingulate White Matter", White),
    (84, "Right Frontal White Matter", White),
    (85, "Right Occipital White Matter", White),
    (86, "Right Parietal White Matter", White),
    (87, "Corpus Callosum", White),
    (96, "Right Claustrum", Grey),
    (97, "Left Claustrum", Grey),
];

const LEFT_WHITE: [(u32, &str); 6] = [
    (89, "Left Temporal White Matter"),
    (90, "Left Insula White Matter"),
    (91, "Left Cingulate White Matter"),
    (92, "Left Frontal White Matter"),
    (93, "Left Occipital White Matter"),
    (94, "Left Parietal White Matter"),
];

pub(super) fn table() -> LabelTable {
    let deep = DEEP.map(|(code, name, tissue)| (code, name.to_owned(), tissue));
    let white = LEFT_WHITE.map(|(code, name)| (code, name.to_owned(), White));
    let cortex = gyri(101).map(|(code, name)| (code, name, Grey));
    LabelTable::new(
        "gif",
        "a parcellation of GIF version 3 (NiftySeg, NiftyWeb)",
        "NiftyWeb, BrainParcellationAreas-GIF_v3",
        deep.into_iter().chain(white).chain(cortex),
        &[&[84], &[92], &[143], &[144], &[60], &[61], &[39]],
    )
}
