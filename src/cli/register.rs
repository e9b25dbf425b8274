//! `hgm register MOVING FIXED -o XFM`: the rigid motion from one T1 image to another, or to the template.

use super::flags::Flags;
use super::{Failure, Reject, Session};
use crate::artefact::{check_writable, write_whole};
use crate::geometry::{Frame, Native, RigidTransform};
use crate::image::Volume;
use crate::image::nifti::{self, NiftiImage};
use crate::register::transform_text::{to_itk_text, to_matrix_text};
use crate::register::{FitQuality, FitWarning, RigidFit, RigidMasks, register_rigid};
use crate::segment::pose_of_head;
use crate::workflow::{Settings, read_input, read_mask_of};
use anyhow::{Context, anyhow};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Find the rigid motion that takes the MOVING image onto the FIXED one
///
/// Writes the motion twice: as a 4x4 text (RAS mm, maps a MOVING point to FIXED) and, beside it, as an ITK transform (.tfm)
/// that other programs read.
///
/// Example: hgm register post.nii.gz pre.nii.gz -o from-post_to-pre.txt
#[derive(Debug, clap::Args)]
pub struct Args {
    /// T1 image to be moved (NIfTI)
    pub moving: PathBuf,
    /// T1 image that stays (NIfTI), or the word MNI for the built-in template
    pub fixed: PathBuf,
    /// Where to write the 4x4 text; the ITK transform gets the same name with .tfm
    #[arg(short, long, value_name = "XFM")]
    pub output: PathBuf,
    /// Compare only inside this mask of the MOVING image
    #[arg(long, value_name = "FILE")]
    pub moving_mask: Option<PathBuf>,
    /// Compare only inside this mask of the FIXED image
    #[arg(long, value_name = "FILE")]
    pub fixed_mask: Option<PathBuf>,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Summary {
    transform: PathBuf,
    itk_transform: PathBuf,
    quality: FitQuality,
    warnings: Vec<String>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let whole = session.settings(Flags::default())?;
    let settings = &whole.register;
    let text_path = match args.output.extension() {
        Some(e) if e == "tfm" => args.output.with_extension("txt"),
        Some(_) => args.output.clone(),
        None => args.output.with_extension("txt"),
    };
    let itk_path = text_path.with_extension("tfm");
    if args.output.is_dir() {
        return Err(Failure::Rejected(anyhow!("{}: is a folder; name a file", args.output.display())));
    }
    check_writable(&text_path)?;
    let mut warnings = Vec::new();
    let (moving, moving_bytes) = image(&args.moving, &whole, &mut warnings)?;
    let moving_mask = args.moving_mask.as_deref();
    let moving_mask =
        moving_mask.map(|path| read_mask_of(path, &moving.grid, &whole.image, &mut warnings)).transpose()?;
    let names = || format!("{} onto {}", args.moving.display(), args.fixed.display());

    let to_template = args.fixed.as_os_str().eq_ignore_ascii_case("mni") && !args.fixed.exists();
    let (found, quality, doubts) = if to_template {
        if args.fixed_mask.is_some() || args.moving_mask.is_some() {
            return Err(Failure::Rejected(anyhow!(
                "--moving-mask and --fixed-mask do not go with MNI: the template's own brain is used; leave them out"
            )));
        }
        parts(pose_of_head(&moving).with_context(names).reject()?)
    } else {
        let (fixed, fixed_bytes) = image(&args.fixed, &whole, &mut warnings)?;
        if fixed_bytes == moving_bytes {
            warnings.push("both files hold the same bytes: was one image given twice?".to_owned());
        }
        let fixed_mask = args.fixed_mask.as_deref();
        let fixed_mask =
            fixed_mask.map(|path| read_mask_of(path, &fixed.grid, &whole.image, &mut warnings)).transpose()?;
        let masks = RigidMasks { moving: moving_mask.as_ref(), fixed: fixed_mask.as_ref() };
        parts(register_rigid(&moving, &fixed, masks, settings).with_context(names).reject()?)
    };

    let refused = doubts.iter().find(|w| matches!(w, FitWarning::LowSimilarity { .. })).cloned();
    warnings.extend(doubts.iter().map(ToString::to_string));
    write_whole(&text_path, to_matrix_text(&found).as_bytes())?;
    write_whole(&itk_path, to_itk_text(&found).as_bytes()).inspect_err(|_| {
        // Both or neither.
        std::fs::remove_file(&text_path).ok();
    })?;
    for warning in &warnings {
        tracing::warn!("{warning}");
    }
    let shown = format!("{}\n{}", text_path.display(), itk_path.display());
    session.emit(&Summary { transform: text_path, itk_transform: itk_path, quality, warnings }, &shown)?;
    refused.map_or(Ok(()), |doubt| Err(Failure::QualityGate(anyhow!("{}: {doubt} (outputs kept)", names()))))
}

/// The fit without its frames: on the command line an image is what it is.
fn parts<M: Frame, F: Frame>(fit: RigidFit<M, F>) -> (RigidTransform<Native, Native>, FitQuality, Vec<FitWarning>) {
    (fit.fixed_from_moving.relabelled(), fit.quality, fit.warnings)
}

fn image(
    path: &Path,
    settings: &Settings,
    warnings: &mut Vec<String>,
) -> Result<(Volume<f32, Native>, Vec<u8>), Failure> {
    let bytes = read_input(path)?;
    let name = path.display().to_string();
    let NiftiImage { volume, warnings: odd, .. } = nifti::decode(&bytes, &name, &settings.image).reject()?;
    warnings.extend(odd.into_iter().map(|w| format!("{name}: {w}")));
    Ok((volume, bytes))
}
