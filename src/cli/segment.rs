//! `hgm segment`: one T1 to a label map.

use super::flags::Flags;
use super::{Failure, Reject, Session};
use crate::artefact::{check_writable, write_whole};
use crate::image::nifti::{self, encode_mask, encode_u8};
use crate::segment::{SegmentOverrides, TissueVolumes, pose_of_head, segment_head};
use crate::workflow::{read_input, read_mask_of};
use anyhow::{Context, anyhow};
use serde::Serialize;
use std::path::PathBuf;

/// A T1 to labels in its own grid: 1 CSF, 2 grey matter, 3 white matter, 4 ventricle
///
/// Example: hgm segment t1.nii.gz -o dseg.nii.gz
#[derive(Debug, clap::Args)]
pub struct Args {
    /// T1-weighted scan (.nii or .nii.gz)
    t1: PathBuf,
    /// Label map to write (.nii.gz)
    #[arg(short, long, value_name = "DSEG")]
    output: PathBuf,
    /// A brain mask of your own in the scan's grid (wins over the computed one)
    #[arg(long, value_name = "FILE")]
    brain_mask: Option<PathBuf>,
    /// Also write the brain mask here
    #[arg(long, value_name = "FILE")]
    write_brain_mask: Option<PathBuf>,
    /// Labels on the 1 mm MNI grid instead of the scan's own: what `hgm mesh` needs for its boundary sets
    #[arg(long)]
    mni: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Summary {
    labels: PathBuf,
    volumes: TissueVolumes,
    tissue_means: [f64; 3],
    warnings: Vec<String>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = session.settings(Flags::default())?;
    for path in [Some(&args.output), args.write_brain_mask.as_ref()].into_iter().flatten() {
        if !path.to_string_lossy().ends_with(".nii.gz") {
            return Err(Failure::Rejected(anyhow!(
                "{}: label maps and masks are written as .nii.gz; end the name (-o, --write-brain-mask) in .nii.gz",
                path.display()
            )));
        }
        check_writable(path)?;
    }
    let name = args.t1.display().to_string();
    let read = nifti::decode(&read_input(&args.t1)?, &name, &settings.image).reject()?;
    let t1 = read.volume;
    let mut warnings = read.warnings;
    let mut mask_of = |path: &PathBuf| read_mask_of(path, &t1.grid, &settings.image, &mut warnings);
    let brain = args.brain_mask.as_ref().map(&mut mask_of).transpose()?;

    let bar = session.progress(2, "segment");
    bar.set_message("to MNI");
    let fit = pose_of_head(&t1).with_context(|| name.clone()).reject()?;
    bar.inc(1);
    bar.set_message("labels");
    let overrides = SegmentOverrides { brain: brain.as_ref(), ..SegmentOverrides::default() };
    let (found, _) = segment_head(&t1, &fit.fixed_from_moving, &overrides, &settings.deformable, &settings.segment)
        .with_context(|| name.clone())
        .reject()?;
    bar.finish_and_clear();

    let (labels, mask) = if args.mni {
        (encode_u8(&found.labels_mni), encode_mask(&found.brain_mni))
    } else {
        (encode_u8(&found.labels), encode_mask(&found.brain))
    };
    write_whole(&args.output, &labels)?;
    if let Some(path) = &args.write_brain_mask {
        write_whole(path, &mask)?;
    }
    warnings.extend(fit.warnings.iter().map(ToString::to_string));
    warnings.extend(found.warnings.iter().map(ToString::to_string));
    for warning in &warnings {
        tracing::warn!("{warning}");
    }
    let v = found.volumes;
    let text = format!(
        "{}\nbrain {:.0} cc: grey matter {:.0}, white matter {:.0}, ventricles {:.1}, other CSF {:.0}",
        args.output.display(),
        v.brain_cc,
        v.grey_matter_cc,
        v.white_matter_cc,
        v.ventricle_cc,
        v.csf_cc
    );
    let labels = args.output.clone();
    session.emit(&Summary { labels, volumes: v, tissue_means: found.tissue_means, warnings }, &text)
}
