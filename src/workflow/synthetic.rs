//! A synthetic patient as files: on the template's head or on a scan's.

use super::error::WorkflowError;
use super::inputs::on_scan;
use super::labels::labels_of_tool;
use super::progress::Progress;
use super::settings::Settings;
use super::user_file::{read_input, shown};
use crate::artefact::{Produced, Stage, StageError, check_apart};
use crate::experiment::synth::{FILES, Head, SynthError, synthesize, synthesize_on};
use crate::geometry::{Mni, Pre};
use crate::image::nifti::{self, encode_u8};
use crate::image::{LabelMap, Mask, Volume};
use crate::resect::{GivenMasks, PairError, take_head_apart};
use crate::segment::native::mask_on;
use crate::segment::{PosedScan, atlas, pose_of_head, pose_of_labels};
use std::path::PathBuf;

/// Raised when the code changes the patient of the same settings.
const VERSION: u32 = 8;

/// The files of a synthetic patient.
#[derive(Clone, Debug, Default)]
pub struct SyntheticFiles {
    /// The folder: pre.nii.gz, post.nii.gz, truth/.
    pub output: PathBuf,
    /// A T1 whose head is operated; the template's without one.
    pub head: Option<PathBuf>,
    /// A label map of that scan.
    pub dseg: Option<PathBuf>,
    /// Whose numbers the label map holds.
    pub labels: Option<String>,
    /// What is taken out, in the grid of that scan; without it part of a lobe.
    pub resected_mask: Option<PathBuf>,
}

/// Makes the patient, or skips it; the figures of its truth come back.
///
/// # Errors
/// Settings out of range, a folder in which a file of the patient's would be written over the head, a lobe too small, a head that cannot be used, the disk's.
pub fn synthetic_patient(
    files: &SyntheticFiles,
    settings: &Settings,
    force: bool,
    progress: &mut dyn Progress,
) -> Result<serde_json::Value, WorkflowError> {
    let table = files.labels.as_ref().map(PathBuf::from);
    let made_of = [&files.head, &files.dseg, &table, &files.resected_mask].into_iter().flatten();
    check_apart(FILES.map(|file| files.output.join(file)), made_of)?;
    // How a head is read and taken apart is part of what comes of it.
    let of_head = files.head.as_ref().map(|_| (settings.image, &settings.anat));
    let stage = Stage::new("synth", VERSION, &files.output, &(&settings.synth, of_head));
    let mut stage = stage.frame("pre, post").seed(settings.synth.seed);
    let mut given = None;
    if let Some(path) = &files.head {
        let bytes = read_input(path)?;
        stage = stage.input("head", &bytes);
        let scan = nifti::decode_scan(&bytes, &shown(path), &settings.image)?.volume.relabelled();
        let labels = match &files.dseg {
            Some(dseg) => {
                let labels = labels_of_tool(dseg, files.labels.as_deref(), &settings.image, progress)?.relabelled();
                on_scan(&scan, &labels, dseg)?;
                Some(labels)
            }
            None => None,
        };
        if let Some(labels) = &labels {
            stage = stage.input("label map", &encode_u8(labels));
        }
        let mask = match &files.resected_mask {
            Some(path) => {
                let bytes = read_input(path)?;
                stage = stage.input("resected mask", &bytes);
                Some(nifti::decode_mask(&bytes, &shown(path), &settings.image)?.0.relabelled())
            }
            None => None,
        };
        given = Some((scan, labels, mask));
    }
    let outcome = stage.run(force, || {
        let patient = match &given {
            None => synthesize(&settings.synth)?,
            Some((scan, labels, mask)) => {
                let (head, taken) = posed_head(scan, labels.as_ref(), mask.as_ref(), settings)?;
                synthesize_on(head, taken.as_ref(), &settings.synth)?
            }
        };
        let facts = super::work::facts(&patient.truth);
        Ok(Produced { files: patient.files(), facts, ..Produced::default() })
    });
    let outcome = outcome.map_err(|error| match error {
        StageError::Compute(error) => error,
        StageError::Write(error) => WorkflowError::Write(error),
    })?;
    Ok(outcome.manifest.facts)
}

/// A scan's head in the template's frame, and what is to be taken out of it.
fn posed_head(
    scan: &Volume<f32, Pre>,
    labels: Option<&LabelMap<Pre>>,
    mask: Option<&Mask<Pre>>,
    settings: &Settings,
) -> Result<(Head, Option<Mask<Mni>>), WorkflowError> {
    let refused =
        |source| WorkflowError::Registration { what: "the head (moving) onto the MNI template (fixed)", source };
    let pose = match labels {
        Some(labels) => pose_of_labels(labels),
        None => pose_of_head(scan),
    };
    let pose = pose.map_err(refused)?.fixed_from_moving;
    let given = GivenMasks { labels: labels.cloned(), ..GivenMasks::default() };
    let (segmented, template, _) =
        take_head_apart(&PosedScan::new(scan, &pose), &given, &settings.anat).map_err(|error| match error {
            PairError::Head { source, .. } => SynthError::from(source).into(),
            error => WorkflowError::from(error),
        })?;
    let head = Head::of_scan(scan, &pose, &segmented, template.atlas_from_subject)?;
    Ok((head, mask.map(|mask| mask_on(mask, &atlas::template().grid(), &pose.inverse()))))
}
