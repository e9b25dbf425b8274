//! One image in a file registered rigidly to another, or to the template.

use super::error::{AskedError, InputError, WorkflowError};
use super::inputs::read_mask_of;
use super::progress::Progress;
use super::refusal::show;
use super::settings::Settings;
use super::user_file::read_input;
use super::warning::{Warning, all_of};
use crate::artefact::{check_apart, check_writable, write_whole};
use crate::geometry::{Frame, Native, RigidTransform};
use crate::image::Volume;
use crate::image::nifti::{self, NiftiImage};
use crate::register::transform_text::{to_itk_text, to_matrix_text};
use crate::register::{FitQuality, FitWarning, RigidFit, RigidMasks, register_rigid, register_two_scans};
use crate::report::refusal::{Row, as_scanned};
use crate::segment::pose_of_head;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What an image is registered to.
#[derive(Clone, Debug)]
pub enum Onto {
    /// The template; its own brain is what is compared.
    Template,
    /// Another image.
    Image {
        /// Its file.
        fixed: PathBuf,
        /// Compare only inside this mask of the image that is moved.
        moving_mask: Option<PathBuf>,
        /// Compare only inside this mask of the image that stays.
        fixed_mask: Option<PathBuf>,
    },
}

impl Onto {
    /// What a word names: the template for `MNI`, unless a file is called so; an image for any other.
    ///
    /// # Errors
    /// Masks beside the template.
    pub fn named(
        fixed: PathBuf,
        moving_mask: Option<PathBuf>,
        fixed_mask: Option<PathBuf>,
    ) -> Result<Self, WorkflowError> {
        if !fixed.as_os_str().eq_ignore_ascii_case("mni") || fixed.exists() {
            return Ok(Self::Image { fixed, moving_mask, fixed_mask });
        }
        if moving_mask.is_some() || fixed_mask.is_some() {
            return Err(AskedError::MasksOfTemplate.into());
        }
        Ok(Self::Template)
    }
}

/// The files of a registration.
#[derive(Clone, Debug)]
pub struct RegisterFiles {
    /// The image that is moved.
    pub moving: PathBuf,
    /// What it is moved onto.
    pub onto: Onto,
    /// Where the 4x4 text goes; the ITK transform gets the same name with .tfm.
    pub output: PathBuf,
}

/// The motion that was found.
#[derive(Debug, Serialize)]
pub struct Registered {
    /// 4x4 text (RAS mm, maps a point of the moving image to the fixed one).
    pub transform: PathBuf,
    /// The same as an ITK transform.
    pub itk_transform: PathBuf,
    /// How well the images agree.
    pub quality: FitQuality,
    /// What a reader must know.
    pub warnings: Vec<Warning>,
    /// Why the quality gate refuses it.
    #[serde(skip)]
    pub refused: Vec<String>,
}

/// Finds the motion and writes it twice. One that is not to be believed is written all the same ([`Registered::refused`]).
///
/// # Errors
/// An image or mask that cannot be used, images that cannot be registered, the disk's.
pub fn register_files(
    files: &RegisterFiles,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Registered, WorkflowError> {
    if files.output.is_dir() {
        return Err(InputError::Folder { path: files.output.clone() }.into());
    }
    let [transform, itk_transform] = outputs(files)?;
    check_writable(&transform)?;
    let mut warnings = Vec::new();
    let (moving, moving_bytes) = image(&files.moving, settings, &mut warnings)?;
    let onto = match &files.onto {
        Onto::Template => "MNI".to_owned(),
        Onto::Image { fixed, .. } => fixed.display().to_string(),
    };
    let images = format!("{} onto {onto}", files.moving.display());
    let look = |seen: &[&Volume<f32, Native>], progress: &mut dyn Progress| {
        let rows: Vec<Row> = seen.iter().map(|image| as_scanned(image)).collect();
        show(&rows, &transform, "what was to be registered, as it was given (above what was to be moved)", progress);
    };
    let refused = |seen: &[&Volume<f32, Native>], progress: &mut dyn Progress, source| {
        look(seen, progress);
        WorkflowError::Rigid { images: images.clone(), source }
    };
    let fixed_image;
    let mut seen = vec![&moving];
    let (found, quality, doubts) = match &files.onto {
        Onto::Template => parts(pose_of_head(&moving).map_err(|source| refused(&seen, progress, source))?),
        Onto::Image { fixed, moving_mask, fixed_mask } => {
            let mask = |path: &Option<PathBuf>, of: &Volume<f32, Native>, warnings: &mut Vec<Warning>| {
                path.as_deref().map(|path| read_mask_of(path, &of.grid, &settings.image, warnings)).transpose()
            };
            let moving_mask = mask(moving_mask, &moving, &mut warnings)?;
            let (fixed, fixed_bytes) = image(fixed, settings, &mut warnings)?;
            if fixed_bytes == moving_bytes {
                warnings.push(Warning::SameBytes);
            }
            let fixed_mask = mask(fixed_mask, &fixed, &mut warnings)?;
            let masks = RigidMasks { moving: moving_mask.as_ref(), fixed: fixed_mask.as_ref() };
            let found = if masks.moving.is_none() && masks.fixed.is_none() {
                register_two_scans(&moving, &fixed, &settings.register)
            } else {
                register_rigid(&moving, &fixed, masks, &settings.register)
            };
            fixed_image = fixed;
            seen.push(&fixed_image);
            parts(found.map_err(|source| refused(&seen, progress, source))?)
        }
    };
    warnings.extend(doubts.iter().cloned().map(Warning::from));
    write_whole(&transform, to_matrix_text(&found).as_bytes())?;
    write_whole(&itk_transform, to_itk_text(&found).as_bytes()).inspect_err(|_| {
        // Both or neither.
        std::fs::remove_file(&transform).ok();
    })?;
    let doubtful = doubts.iter().find(|doubt| doubt.denies_the_fit());
    if doubtful.is_some() {
        look(&seen, progress);
    }
    let refused = doubtful.map(|doubt| format!("{images}: {doubt}")).into_iter().collect();
    Ok(Registered { transform, itk_transform, quality, warnings, refused })
}

/// The two files of the transform. Refuses to write one where an image is, or where its name says that one would be.
fn outputs(files: &RegisterFiles) -> Result<[PathBuf; 2], WorkflowError> {
    const IMAGES: [&str; 14] = [
        ".nii", ".nii.gz", ".mgz", ".mgh", ".img", ".img.gz", ".hdr", ".hdr.gz", ".nrrd", ".nhdr", ".mha", ".mhd",
        ".dcm", ".ima",
    ];
    let name = files.output.to_string_lossy().to_ascii_lowercase();
    if IMAGES.iter().any(|ending| name.ends_with(ending)) {
        return Err(AskedError::TransformNamedImage { output: files.output.clone() }.into());
    }
    let mut inputs = vec![&files.moving];
    if let Onto::Image { fixed, moving_mask, fixed_mask } = &files.onto {
        inputs.extend([Some(fixed), moving_mask.as_ref(), fixed_mask.as_ref()].into_iter().flatten());
    }
    let text = match files.output.extension() {
        Some(e) if e != "tfm" => files.output.clone(),
        _ => files.output.with_extension("txt"),
    };
    let both = [text.clone(), text.with_extension("tfm")];
    // What was named as well: an ending is added to it, and an image was meant.
    check_apart([&files.output], &inputs)?;
    check_apart(&both, &inputs)?;
    Ok(both)
}

/// The fit without its frames: of files an image is what it is.
fn parts<M: Frame, F: Frame>(fit: RigidFit<M, F>) -> (RigidTransform<Native, Native>, FitQuality, Vec<FitWarning>) {
    (fit.fixed_from_moving.relabelled(), fit.quality, fit.warnings)
}

fn image(
    path: &Path,
    settings: &Settings,
    warnings: &mut Vec<Warning>,
) -> Result<(Volume<f32, Native>, Vec<u8>), WorkflowError> {
    let bytes = read_input(path)?;
    let name = path.display().to_string();
    let NiftiImage { volume, warnings: odd, .. } = nifti::decode_scan(&bytes, &name, &settings.image)?;
    warnings.extend(all_of(&name, &odd));
    Ok((volume, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_word_mni_is_the_template_which_takes_no_masks_and_any_other_an_image() {
        for word in ["MNI", "mni"] {
            assert!(matches!(Onto::named(word.into(), None, None), Ok(Onto::Template)));
            for masks in [(Some("m.nii".into()), None), (None, Some("m.nii".into()))] {
                let refused = Onto::named(word.into(), masks.0, masks.1).unwrap_err();
                assert!(matches!(refused, WorkflowError::Asked(AskedError::MasksOfTemplate)), "{refused}");
            }
        }
        let masked = Onto::named("pre.nii".into(), None, Some("m.nii".into()));
        assert!(matches!(masked, Ok(Onto::Image { fixed_mask: Some(_), .. })));
    }

    #[test]
    fn a_transform_is_never_written_over_an_image_nor_called_one() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("scan"), b"a scan").unwrap();
        let to =
            |output: &str| outputs(&RegisterFiles { moving: at("scan"), onto: Onto::Template, output: at(output) });
        for name in ["new.nii.gz", "new.NII", "new.mgz", "new.hdr"] {
            let named = AskedError::TransformNamedImage { output: at(name) };
            assert!(matches!(to(name), Err(WorkflowError::Asked(error)) if error == named), "{name}");
        }
        assert!(matches!(to("scan"), Err(WorkflowError::Apart(_))));
        assert_eq!(to("new.tfm").unwrap(), [at("new.txt"), at("new.tfm")]);
    }
}
