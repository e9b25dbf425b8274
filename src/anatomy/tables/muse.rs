//! MUSE (University of Pennsylvania; DLMUSE), whose numbers are those of Neuromorphometrics with the white matter by lobes.
//!
//! Numbers: the ROI index of MUSE (`ROI_Indices.csv` of its model); 44 to 46, 49, 50, 63, 64 and 69 stand in maps of
//! Neuromorphometrics (MICCAI 2012, SPM, MALPEM), which are read with the same table.

use super::neuromorphometrics::gyri;
use crate::anatomy::table::{LabelTable, Tissue};
use Tissue::{Csf, Grey, Outside, Ventricle, White};

const DEEP: [(u32, &str, Tissue); 54] = [
    (0, "Background", Outside),
    (4, "3rd Ventricle", Ventricle),
    (11, "4th Ventricle", Csf),
    (23, "Right Accumbens Area", Grey),
    (30, "Left Accumbens Area", Grey),
    (31, "Right Amygdala", Grey),
    (32, "Left Amygdala", Grey),
    (35, "Brain Stem", White),
    (36, "Right Caudate", Grey),
    (37, "Left Caudate", Grey),
    (38, "Right Cerebellum Exterior", Grey),
    (39, "Left Cerebellum Exterior", Grey),
    (40, "Right Cerebellum White Matter", White),
    (41, "Left Cerebellum White Matter", White),
    (44, "Right Cerebral White Matter", White),
    (45, "Left Cerebral White Matter", White),
    (46, "CSF", Csf),
    (47, "Right Hippocampus", Grey),
    (48, "Left Hippocampus", Grey),
    (49, "Right Inf Lat Vent", Ventricle),
    (50, "Left Inf Lat Vent", Ventricle),
    (51, "Right Lateral Ventricle", Ventricle),
    (52, "Left Lateral Ventricle", Ventricle),
    (55, "Right Pallidum", Grey),
    (56, "Left Pallidum", Grey),
    (57, "Right Putamen", Grey),
    (58, "Left Putamen", Grey),
    (59, "Right Thalamus Proper", Grey),
    (60, "Left Thalamus Proper", Grey),
    (61, "Right Ventral DC", Grey),
    (62, "Left Ventral DC", Grey),
    (63, "Right vessel", Grey),
    (64, "Left vessel", Grey),
    (69, "Optic Chiasm", White),
    (71, "Cerebellar Vermal Lobules I-V", Grey),
    (72, "Cerebellar Vermal Lobules VI-VII", Grey),
    (73, "Cerebellar Vermal Lobules VIII-X", Grey),
    (75, "Left Basal Forebrain", Grey),
    (76, "Right Basal Forebrain", Grey),
    (81, "frontal lobe WM right", White),
    (82, "frontal lobe WM left", White),
    (83, "occipital lobe WM right", White),
    (84, "occipital lobe WM left", White),
    (85, "parietal lobe WM right", White),
    (86, "parietal lobe WM left", White),
    (87, "temporal lobe WM right", White),
    (88, "temporal lobe WM left", White),
    (89, "fornix right", White),
    (90, "fornix left", White),
    (91, "anterior limb of internal capsule right", White),
    (92, "anterior limb of internal capsule left", White),
    (93, "posterior limb of internal capsule inc. cerebral peduncle right", White),
    (94, "posterior limb of internal capsule inc. cerebral peduncle left", White),
    (95, "corpus callosum", White),
];

pub(super) fn table() -> LabelTable {
    let deep = DEEP.map(|(code, name, tissue)| (code, name.to_owned(), tissue));
    let cortex = gyri(100).map(|(code, name)| (code, name, Grey));
    LabelTable::new(
        "muse",
        "a segmentation of MUSE or DLMUSE, or a map in the numbers of Neuromorphometrics",
        "MUSE, ROI_Indices.csv",
        deep.into_iter().chain(cortex),
        &[&[44, 81], &[45, 82], &[142], &[143], &[59], &[60], &[38]],
    )
}
