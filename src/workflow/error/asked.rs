//! Why what was asked for cannot be had, where a value or a choice is out of place.

use crate::anatomy::label;
use std::path::PathBuf;
use thiserror::Error;

/// Why what was asked for cannot be had.
#[derive(Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum AskedError {
    #[error("{level} is no level of a sample: give standard deviations from {low} to {high}")]
    Level { level: f64, low: f64, high: f64 },
    #[error("{count} random materials: give 1 to {most}")]
    Draws { count: u64, most: u64 },
    #[error("Poisson's ratio is {poisson_ratio}: it must be at least 0 and below 0.5")]
    PoissonRatio { poisson_ratio: f64 },
    #[error("{}: a case brings its own scenario", folder.display())]
    ScenarioOfCase { folder: PathBuf },
    #[error(
        "{}: only a case can have its resected tissue put back; a mesh has it where it has label {}",
        mesh.display(),
        label::RESECTED
    )]
    MeshBeforeResection { mesh: PathBuf },
    #[error("{}: label maps and masks are written as .nii.gz; end the name in .nii.gz", output.display())]
    PackedNifti { output: PathBuf },
    #[error(
        "{}: a transform is text, and this is the name of an image: end the name in .txt or .tfm",
        output.display()
    )]
    TransformNamedImage { output: PathBuf },
    #[error("masks do not go with the template: its own brain is what is compared")]
    MasksOfTemplate,
    #[error("a pose and a start for one were given: the pose is final, leave one of the two out")]
    PoseAndStart,
    #[error("a start for the pose was given beside a label map, which says the pose: leave one of the two out")]
    StartBesideLabels,
}
