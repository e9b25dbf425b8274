//! The table itself.

use super::bids::{BidsName, Scan};
use super::family::Family;
use super::file::{Entry, Maker, Space};

/// The pre-operative scan to the template, 4x4, RAS, mm.
pub const MNI_FROM_PRE_TEXT: &str = "xfm/from-pre_to-MNI.txt";
/// The same for ITK.
pub const MNI_FROM_PRE_ITK: &str = "xfm/from-pre_to-MNI.tfm";
/// The post-operative scan to the pre-operative one, 4x4, RAS, mm.
pub const PRE_FROM_POST_TEXT: &str = "xfm/from-post_to-pre.txt";
/// The same for ITK.
pub const PRE_FROM_POST_ITK: &str = "xfm/from-post_to-pre.tfm";

/// The pre-operative scan.
pub const PRE_T1: &str = "anat/pre_space-MNI_T1w.nii.gz";
/// The post-operative scan.
pub const POST_T1: &str = "anat/post_space-MNI_T1w.nii.gz";
/// Tissue labels before surgery.
pub const PRE_LABELS: &str = "anat/pre_space-MNI_dseg.nii.gz";
/// The same in the scan's own grid.
pub const PRE_NATIVE_LABELS: &str = "anat/pre_space-native_dseg.nii.gz";
/// The brain before surgery.
pub const PRE_BRAIN: &str = "anat/pre_space-MNI_desc-brain_mask.nii.gz";
/// The same in the scan's own grid.
pub const PRE_NATIVE_BRAIN: &str = "anat/pre_space-native_desc-brain_mask.nii.gz";
/// The brain after surgery.
pub const POST_BRAIN: &str = "anat/post_space-MNI_desc-brain_mask.nii.gz";
/// The same in the scan's own grid.
pub const POST_NATIVE_BRAIN: &str = "anat/post_space-native_desc-brain_mask.nii.gz";
/// The cavity.
pub const CAVITY: &str = "anat/post_space-MNI_label-cavity_mask.nii.gz";
/// The same in the post-operative scan's own grid.
pub const NATIVE_CAVITY: &str = "anat/post_space-native_label-cavity_mask.nii.gz";
/// The resected tissue.
pub const RESECTED: &str = "anat/pre_space-MNI_label-resected_mask.nii.gz";
/// The same in the pre-operative scan's own grid.
pub const NATIVE_RESECTED: &str = "anat/pre_space-native_label-resected_mask.nii.gz";
/// The ventricles after surgery, apart from the cavity.
pub const POST_VENTRICLE: &str = "anat/post_space-MNI_label-ventricle_mask.nii.gz";
/// How far the brain has moved from one scan to the other, mm; read where it was before.
pub const SAG: &str = "anat/pre_space-MNI_desc-sag_displacement.nii.gz";
/// How far a point of the patient lies from its like in the template, mm.
pub const TEMPLATE_DISPLACEMENT: &str = "anat/pre_space-MNI_desc-template_displacement.nii.gz";
/// The same map to the last digit, in voxels of its own grid: what a later case takes from a prediction.
pub const TEMPLATE_FIT: &str = "anat/pre_space-MNI_desc-template_fit.nii.gz";
/// The pre-operative scan without its coil's gain, to the last digit: what a later case takes from a prediction.
pub const PRE_EVEN_T1: &str = "anat/pre_space-MNI_desc-even_T1w.nii.gz";
/// The labels as 3D Slicer takes them.
pub const LABELS_FOR_SLICER: &str = "anat/pre_space-MNI_dseg.seg.nrrd";
/// The cavity as 3D Slicer takes it.
pub const CAVITY_FOR_SLICER: &str = "anat/post_space-MNI_label-cavity.seg.nrrd";

/// The undeformed mesh: tissue without the resected part, with its sets.
pub const REST_MESH: &str = "mesh/rest.vtu";
/// The same for gmsh.
pub const REST_GMSH: &str = "mesh/rest.msh";
/// The surface of one boundary set of the undeformed mesh.
pub const REST_SURFACE: Family = Family("mesh/rest_{set}.surf.gii");
/// The surface that the post-operative scan shows for a set.
pub const REFERENCE_SURFACE: Family = Family("mesh/reference_{set}.surf.gii");

/// A phantom's known state.
pub const REFERENCE_STATE: &str = "sim/reference.vtu";
/// The state of one sample.
pub const SAMPLE_STATE: Family = Family("sim/{sample}.vtu");
/// The state that the estimate leads to.
pub const ESTIMATE_STATE: &str = "sim/estimate.vtu";
/// The estimate's numbers.
pub const ESTIMATE_JSON: &str = "sim/estimate.json";
/// Models beside each other, by their evidence.
pub const COMPARISON: &str = "sim/compare.json";
/// The experiment's numbers.
pub const OUTCOME: &str = "sim/outcome.json";
/// A line per sample.
pub const SAMPLES_TABLE: &str = "sim/samples.csv";
/// The samples as one series for ParaView.
pub const SAMPLES_SERIES: &str = "sim/samples.pvd";
/// A deformed surface of the best sample.
pub const BEST_SURFACE: Family = Family("sim/best_{set}.surf.gii");
/// Its error in mm.
pub const BEST_ERRORS: Family = Family("sim/best_{set}.shape.gii");

/// Brain shift alone, in the pre-operative scan's frame: where its points go.
pub const SHIFT: Family = Family("xfm/from-pre_to-deformed_desc-{state}_displacement.nii.gz");
/// The same back.
pub const SHIFT_BACK: Family = Family("xfm/from-deformed_to-pre_desc-{state}_displacement.nii.gz");
/// Brain shift with the rigid part: from the pre-operative scanner's frame to the post-operative one's.
pub const POST_FROM_PRE_FIELD: Family = Family("xfm/from-pre_to-post_desc-{state}_displacement.nii.gz");
/// The same back.
pub const PRE_FROM_POST_FIELD: Family = Family("xfm/from-post_to-pre_desc-{state}_displacement.nii.gz");
/// Standard deviation of the brain shift, mm.
pub const SHIFT_SD: Family = Family("xfm/from-pre_to-deformed_desc-{state}_sd.nii.gz");
/// Its 95 % reach, mm.
pub const SHIFT_REACH: Family = Family("xfm/from-pre_to-deformed_desc-{state}_reach95.nii.gz");
/// The reach that half of a prediction's draws do not exceed, mm.
pub const SHIFT_REACH_50: Family = Family("xfm/from-pre_to-deformed_desc-{state}_reach50.nii.gz");
/// Probability of a prediction that tissue moves by more than the threshold.
pub const SHIFT_PROBABILITY: Family = Family("xfm/from-pre_to-deformed_desc-{state}_probability.nii.gz");
/// The mean state of a prediction.
pub const PREDICTED_STATE: Family = Family("sim/{state}.vtu");
/// The draws of a prediction, a line each: their coordinates among the modes of its state.
pub const PREDICTED_DRAWS: Family = Family("sim/{state}_draws.csv");
/// A prediction's numbers.
pub const PREDICTION_JSON: &str = "sim/prediction.json";
/// A prediction against what was seen afterwards.
pub const EVALUATION_JSON: &str = "sim/evaluation.json";
/// Where it is believed.
pub const SHIFT_MASK: Family = Family("xfm/from-pre_to-deformed_desc-{state}_mask.nii.gz");
/// The numbers of the fields.
pub const SHIFT_JSON: &str = "sim/brain_shift.json";
/// Landmarks against the fields.
pub const LANDMARKS_JSON: &str = "sim/landmarks.json";
/// The pre-operative scan as it was given, header blanked.
pub const PRE_NATIVE_T1: &str = "anat/pre_space-native_T1w.nii.gz";
/// The pre-operative scan carried to the deformed state.
pub const WARPED_T1: &str = "anat/pre_space-native_desc-warped_T1w.nii.gz";
/// Its labels carried along.
pub const WARPED_LABELS: &str = "anat/pre_space-native_desc-warped_dseg.nii.gz";

/// Every setting that was used, by room.
pub const SETTINGS: &str = "settings.toml";
/// Program, stages, checksums of inputs and outputs.
pub const PROVENANCE: &str = "provenance.json";
/// The page.
pub const PAGE: &str = "report.html";
/// What a step saw when it gave up; absent where none did.
pub const REFUSED_PICTURE: &str = "refused.png";
/// Held by the program that works on the folder.
pub const LOCK: &str = ".lock";

const fn file(path: &'static str, what: &'static str, space: Space, maker: Maker) -> Entry {
    Entry { path, what, space, maker, bids: None }
}

const fn image(
    (path, what, space): (&'static str, &'static str, Space),
    (of, name, description): (Scan, &'static str, &'static str),
    mask: Option<&'static str>,
) -> Entry {
    Entry { path, what, space, maker: Maker::Anat, bids: Some(BidsName { of, name, description, mask }) }
}

const fn transform(
    (path, what): (&'static str, &'static str),
    (of, name, description): (Scan, &'static str, &'static str),
) -> Entry {
    let bids = Some(BidsName { of, name, description, mask: None });
    Entry { path, what, space: Space::Transform, maker: Maker::Registration, bids }
}

const fn field(
    (path, what, space): (&'static str, &'static str, Space),
    (of, name, description): (Scan, &'static str, &'static str),
    mask: Option<&'static str>,
) -> Entry {
    Entry { path, what, space, maker: Maker::Fields, bids: Some(BidsName { of, name, description, mask }) }
}

const BRAIN: Option<&str> = Some("Brain");
const ROI: Option<&str> = Some("ROI");
const ON_TEMPLATE: &str = "The scan on the template's grid, moved rigidly";
const MAPS_POINTS: &str = "4x4, RAS, mm: maps points of the scan";

/// Every file of a case, in the order of the stages.
pub const TABLE: &[Entry] = &[
    transform(
        (MNI_FROM_PRE_TEXT, "rigid motion from the pre-operative scan to the template, 4x4"),
        (Scan::Pre, "from-T1w_to-T_mode-points_xfm.txt", MAPS_POINTS),
    ),
    transform(
        (MNI_FROM_PRE_ITK, "the same as an ITK transform"),
        (Scan::Pre, "from-T1w_to-T_mode-image_xfm.tfm", "ITK: resamples the scan to the template"),
    ),
    transform(
        (PRE_FROM_POST_TEXT, "rigid motion from the post-operative scan to the pre-operative one, 4x4"),
        (Scan::Post, "from-T1w_to-preop_mode-points_xfm.txt", MAPS_POINTS),
    ),
    transform(
        (PRE_FROM_POST_ITK, "the same as an ITK transform"),
        (Scan::Post, "from-T1w_to-preop_mode-image_xfm.tfm", "ITK: resamples the scan to ses-preop"),
    ),
    image((PRE_T1, "pre-operative scan", Space::Mni), (Scan::Pre, "space-T_T1w.nii.gz", ON_TEMPLATE), None),
    image((POST_T1, "post-operative scan", Space::Mni), (Scan::Post, "space-T_T1w.nii.gz", ON_TEMPLATE), None),
    file(PRE_NATIVE_T1, "pre-operative scan, header blanked", Space::Pre, Maker::Anat),
    image((PRE_LABELS, "tissue labels", Space::Mni), (Scan::Pre, "space-T_dseg.nii.gz", "Tissue labels"), None),
    image((PRE_NATIVE_LABELS, "tissue labels", Space::Pre), (Scan::Pre, "dseg.nii.gz", "Tissue labels"), None),
    image(
        (PRE_BRAIN, "brain before surgery", Space::Mni),
        (Scan::Pre, "space-T_desc-brain_mask.nii.gz", "Brain"),
        BRAIN,
    ),
    image(
        (POST_BRAIN, "brain after surgery", Space::Mni),
        (Scan::Post, "space-T_desc-brain_mask.nii.gz", "Brain without the cavity"),
        BRAIN,
    ),
    image(
        (PRE_NATIVE_BRAIN, "brain before surgery", Space::Pre),
        (Scan::Pre, "desc-brain_mask.nii.gz", "Brain"),
        BRAIN,
    ),
    image(
        (POST_NATIVE_BRAIN, "brain after surgery", Space::Post),
        (Scan::Post, "desc-brain_mask.nii.gz", "Brain without the cavity"),
        BRAIN,
    ),
    image(
        (RESECTED, "resected tissue", Space::Mni),
        (Scan::Pre, "space-T_label-resected_mask.nii.gz", "Tissue that was taken"),
        ROI,
    ),
    image(
        (NATIVE_RESECTED, "resected tissue", Space::Pre),
        (Scan::Pre, "label-resected_mask.nii.gz", "Tissue that was taken"),
        ROI,
    ),
    image(
        (CAVITY, "resection cavity", Space::Mni),
        (Scan::Post, "space-T_label-cavity_mask.nii.gz", "Resection cavity"),
        ROI,
    ),
    image(
        (NATIVE_CAVITY, "resection cavity", Space::Post),
        (Scan::Post, "label-cavity_mask.nii.gz", "Resection cavity"),
        ROI,
    ),
    image(
        (POST_VENTRICLE, "ventricles after surgery", Space::Mni),
        (Scan::Post, "space-T_label-ventricle_mask.nii.gz", "Ventricles"),
        ROI,
    ),
    file(SAG, "displacement from the pre-operative to the post-operative scan, mm", Space::Mni, Maker::Anat),
    file(TEMPLATE_DISPLACEMENT, "displacement from the patient to the template, mm", Space::Mni, Maker::Anat),
    file(PRE_EVEN_T1, "pre-operative scan without its coil's gain, in units of its own", Space::Mni, Maker::Anat),
    file(TEMPLATE_FIT, "the template's fit, in voxels, of a prediction", Space::Mni, Maker::Anat),
    file(REST_MESH, "undeformed mesh of the tissue with its boundary sets", Space::Mni, Maker::Mesh),
    file(
        REST_GMSH,
        "the same for gmsh; none with `partial_volume`, whose parts of cells MSH cannot hold",
        Space::Mni,
        Maker::Mesh,
    ),
    file(REST_SURFACE.0, "surface of a boundary set", Space::Mni, Maker::Mesh),
    file(REFERENCE_SURFACE.0, "target surface of a set, from the post-operative scan", Space::Mni, Maker::Reference),
    file(REFERENCE_STATE, "a phantom's known state", Space::Mni, Maker::Reference),
    file(SAMPLE_STATE.0, "state of one sample", Space::Mni, Maker::Sample),
    file(ESTIMATE_STATE, "state that the estimate leads to", Space::Mni, Maker::Estimate),
    file(ESTIMATE_JSON, "the estimate's numbers", Space::None, Maker::Estimate),
    field(
        (SHIFT.0, "brain shift alone: moves points of the pre-operative scan, mm", Space::Transform),
        (Scan::Pre, "from-T1w_to-deformed_desc-{state}_mode-points_xfm.nii.gz", "Brain shift, mm, moves points"),
        None,
    ),
    field(
        (SHIFT_BACK.0, "its inverse", Space::Transform),
        (Scan::Pre, "from-deformed_to-T1w_desc-{state}_mode-points_xfm.nii.gz", "Brain shift undone, mm"),
        None,
    ),
    field(
        (
            POST_FROM_PRE_FIELD.0,
            "brain shift with the rigid part: pre-operative scanner to post-operative one",
            Space::Transform,
        ),
        (Scan::Pre, "from-T1w_to-postop_desc-{state}_mode-points_xfm.nii.gz", "Rigid motion and brain shift, mm"),
        None,
    ),
    field(
        (PRE_FROM_POST_FIELD.0, "its inverse", Space::Transform),
        (
            Scan::Post,
            "from-T1w_to-preop_desc-{state}_mode-points_xfm.nii.gz",
            "Rigid motion and brain shift undone, mm",
        ),
        None,
    ),
    file(SHIFT_SD.0, "standard deviation of the brain shift, mm", Space::Pre, Maker::Fields),
    file(
        SHIFT_REACH.0,
        "its 95 % reach, mm: the size that 95 % of the possible displacements do not exceed",
        Space::Pre,
        Maker::Fields,
    ),
    file(SHIFT_MASK.0, "where it is believed", Space::Pre, Maker::Fields),
    file(SHIFT_JSON, "the brain shift in numbers", Space::None, Maker::Fields),
    file(
        LANDMARKS_JSON,
        "landmarks against rigid motion, images and model, of `hgm evaluate`",
        Space::None,
        Maker::Report,
    ),
    field(
        (WARPED_T1, "pre-operative scan carried to the deformed state", Space::Pre),
        (Scan::Pre, "desc-warped_T1w.nii.gz", "The scan carried by the brain shift"),
        None,
    ),
    field(
        (WARPED_LABELS, "its labels carried along", Space::Pre),
        (Scan::Pre, "desc-warped_dseg.nii.gz", "Tissue labels carried by the brain shift"),
        None,
    ),
    file(SHIFT_REACH_50.0, "reach that half of a prediction's draws do not exceed, mm", Space::Pre, Maker::Predict),
    file(SHIFT_PROBABILITY.0, "probability of moving by more than the threshold", Space::Pre, Maker::Predict),
    file(PREDICTED_STATE.0, "mean state of a prediction with its spread", Space::Mni, Maker::Predict),
    file(PREDICTED_DRAWS.0, "its draws: coordinates among the modes of the state", Space::None, Maker::Predict),
    file(PREDICTION_JSON, "the prediction's numbers", Space::None, Maker::Predict),
    file(
        EVALUATION_JSON,
        "the prediction against what was seen afterwards, of `hgm evaluate`",
        Space::None,
        Maker::Report,
    ),
    file(COMPARISON, "models beside each other, by their evidence", Space::None, Maker::Compare),
    file(OUTCOME, "the experiment's numbers", Space::None, Maker::Outcome),
    file(SAMPLES_TABLE, "a line per sample", Space::None, Maker::Outcome),
    file(SETTINGS, "every setting that was used, by room", Space::None, Maker::Outcome),
    file(PROVENANCE, "program, stages, checksums of inputs and outputs", Space::None, Maker::Outcome),
    file(PAGE, "the page", Space::None, Maker::Report),
    file(REFUSED_PICTURE, "both scans when a step gave up; absent where none did", Space::None, Maker::Outcome),
    file(LABELS_FOR_SLICER, "labels for 3D Slicer", Space::Mni, Maker::Report),
    file(CAVITY_FOR_SLICER, "cavity for 3D Slicer", Space::Mni, Maker::Report),
    file(BEST_SURFACE.0, "deformed surface of the best sample, for Workbench", Space::Mni, Maker::Report),
    file(BEST_ERRORS.0, "its error in mm, NaN where no target is, for Workbench", Space::Mni, Maker::Report),
    file(SAMPLES_SERIES, "the samples as one series for ParaView", Space::Mni, Maker::Report),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_file_stands_twice_in_the_table_and_no_two_share_a_name_in_bids() {
        let paths: BTreeSet<&str> = TABLE.iter().map(|file| file.path).collect();
        assert_eq!(paths.len(), TABLE.len());
        let named: Vec<_> = TABLE.iter().filter_map(|file| file.bids).collect();
        let names: BTreeSet<(bool, &str)> = named.iter().map(|b| (b.of == Scan::Pre, b.name)).collect();
        assert_eq!(names.len(), named.len());
    }

    #[test]
    fn a_file_of_a_frame_says_so_in_its_name() {
        for file in TABLE.iter().filter(|file| file.path.contains("space-")) {
            let native = file.path.contains("space-native");
            assert_eq!(native, file.space != Space::Mni, "{}", file.path);
            assert_eq!(file.path.contains("/pre_") && native, file.space == Space::Pre, "{}", file.path);
        }
    }
}
