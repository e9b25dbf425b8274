//! One T1 in a file to a label map.

use super::error::{AskedError, WorkflowError};
use super::inputs::read_mask_of;
use super::progress::Progress;
use super::refusal::show;
use super::settings::Settings;
use super::user_file::read_input;
use super::warning::Warning;
use crate::artefact::{check_apart, check_writable, write_whole};
use crate::image::nifti::{self, encode_mask, encode_u8};
use crate::report::refusal::{as_scanned, posed};
use crate::segment::{
    PosedScan, ScanQuality, SegmentOverrides, TissueVolumes, pose_of_head, scan_quality, segment_head,
};
use serde::Serialize;
use std::path::PathBuf;

/// The files of a segmentation.
#[derive(Clone, Debug, Default)]
pub struct SegmentFiles {
    /// T1-weighted scan.
    pub t1: PathBuf,
    /// Label map to write (.nii.gz).
    pub output: PathBuf,
    /// A brain mask in the scan's grid that wins over the computed one.
    pub brain_mask: Option<PathBuf>,
    /// Where the brain mask goes, too.
    pub write_brain_mask: Option<PathBuf>,
    /// On the 1 mm MNI grid instead of the scan's own.
    pub in_mni: bool,
}

/// What was found.
#[derive(Debug, Serialize)]
pub struct Segmented {
    /// The label map.
    pub labels: PathBuf,
    /// Volumes of the tissues.
    pub volumes: TissueVolumes,
    /// Mean brightness of CSF, grey and white matter.
    pub tissue_means: [f64; 3],
    /// How good the scan is.
    pub quality: ScanQuality,
    /// What a reader must know.
    pub warnings: Vec<Warning>,
    /// Why the quality gate refuses them.
    #[serde(skip)]
    pub refused: Vec<String>,
}

/// Labels a scan. Labels that are not to be believed are written all the same ([`Segmented::refused`]).
///
/// # Errors
/// A name for the labels that does not end in .nii.gz or is that of another file of the job, a scan or mask that cannot be used, a head that cannot be labelled, the disk's.
pub fn segment_file(
    files: &SegmentFiles,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Segmented, WorkflowError> {
    let outputs = || [Some(&files.output), files.write_brain_mask.as_ref()].into_iter().flatten();
    for path in outputs() {
        if !path.to_string_lossy().ends_with(".nii.gz") {
            return Err(AskedError::PackedNifti { output: path.clone() }.into());
        }
        check_writable(path)?;
    }
    check_apart(outputs(), std::iter::once(&files.t1).chain(&files.brain_mask))?;
    let name = files.t1.display().to_string();
    let read = nifti::decode_scan(&read_input(&files.t1)?, &name, &settings.image)?;
    let t1 = read.volume;
    let mut warnings: Vec<Warning> = read.warnings.into_iter().map(Warning::from).collect();
    let own = files.brain_mask.as_deref();
    let own = own.map(|path| read_mask_of(path, &t1.grid, &settings.image, &mut warnings)).transpose()?;

    progress.begin("segment", 2);
    progress.doing("to MNI");
    let unposed = |source| {
        let what = "the scan as it was given, when the step `to MNI` ended";
        show(&[as_scanned(&t1)], &files.output, what, progress);
        WorkflowError::Rigid { images: name.clone(), source }
    };
    let fit = pose_of_head(&t1).map_err(unposed)?;
    progress.step();
    progress.doing("labels");
    let overrides = SegmentOverrides { brain: own.as_ref(), ..SegmentOverrides::default() };
    let scan = PosedScan::new(&t1, &fit.fixed_from_moving);
    let unlabelled = |source| {
        let what = "the scan in the pose that was found, when the step `labels` ended";
        show(&[posed(&t1, &fit.fixed_from_moving)], &files.output, what, progress);
        WorkflowError::Head { scan: name, source }
    };
    let (found, template) =
        segment_head(&scan, &overrides, &settings.deformable, &settings.segment).map_err(unlabelled)?;
    let correlation = Some(template.quality.correlation[1]);
    let quality = scan_quality(&scan, (&found.labels, &found.regions), &template.atlas_from_subject, correlation);
    progress.end();

    let (labels, brain) = if files.in_mni {
        (encode_u8(&found.labels_mni), encode_mask(&found.brain_mni))
    } else {
        (encode_u8(&found.labels), encode_mask(&found.brain))
    };
    write_whole(&files.output, &labels)?;
    if let Some(path) = &files.write_brain_mask {
        write_whole(path, &brain)?;
    }
    let belied = found.warnings.iter().filter(|warning| warning.belies_the_masks());
    let refused = belied.map(|warning| format!("{}: {warning}", files.t1.display())).collect();
    warnings.extend(fit.warnings.into_iter().map(Warning::from));
    warnings.extend(found.warnings.into_iter().chain(quality.of_regions()).map(Warning::from));
    let labels = files.output.clone();
    Ok(Segmented { labels, volumes: found.volumes, tissue_means: found.tissue_means, quality, warnings, refused })
}
