//! Why a job did not end well.

mod asked;
mod case;
mod cohort;
mod evaluate;
mod input;
mod label_map;
mod landmarks;
mod mesh_file;
mod predict;
mod simulation;
mod taken_up;
mod warp;

pub use asked::AskedError;
pub use case::CaseError;
pub use cohort::CohortError;
pub use evaluate::EvaluateError;
pub use input::{InputError, MaskRole};
pub use label_map::LabelMapError;
pub use landmarks::LandmarkError;
pub use mesh_file::MeshFileError;
pub use predict::PredictError;
pub use simulation::SimulationError;
pub use taken_up::TakenUpError;
pub use warp::{SaysMni, WarpError};

use super::cohort::DatasetError;
use super::lost_label::LostLabel;
use super::settings::SettingsError;
use crate::artefact::{ApartError, WriteError};
use crate::experiment::estimate::{BodyError, EstimateError, ProblemError};
use crate::experiment::observed::ObservedError;
use crate::experiment::outcome::{Answer, OutcomeError};
use crate::experiment::population::{MergeError, PopulationFileError, TooMany};
use crate::experiment::prior::PriorError;
use crate::experiment::supports::SupportsError;
use crate::experiment::sweep::SweepError;
use crate::experiment::synth::SynthError;
use crate::fem::FemError;
use crate::image::nifti::NiftiError;
use crate::layout;
use crate::material::gp::{FitRefusal, HyperparametersError};
use crate::material::literature::StudyError;
use crate::material::meta_model::FitError;
use crate::material::rheometry::RheometryError;
use crate::material::study_level;
use crate::mesh::engine::EngineError;
use crate::mesh::format::{ReadError, WriteError as FormatError};
use crate::overlay::OverlayError;
use crate::register::RegisterError;
use crate::register::transform_text::TransformTextError;
use crate::report::case::ReportError;
use crate::report::derivatives::DerivativesError;
use crate::resect::{PairError, ResectError};
use crate::segment::HeadError;
use crate::tag::{MARGIN, TagError};
use thiserror::Error;

/// Who is to do something about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The input or a setting cannot be used; a computation was not begun.
    Rejected,
    /// The computation or the machine failed.
    Failed,
    /// Computed, and not to be believed.
    QualityGate,
}

/// Why a job did not end well.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum WorkflowError {
    #[error(transparent)]
    Settings(#[from] SettingsError),
    #[error(transparent)]
    Asked(#[from] AskedError),
    #[error(transparent)]
    Input(#[from] InputError),
    #[error(transparent)]
    Apart(#[from] ApartError),
    #[error(transparent)]
    Labels(#[from] LabelMapError),
    #[error(transparent)]
    Case(#[from] CaseError),
    #[error(transparent)]
    Image(#[from] NiftiError),
    #[error(transparent)]
    Transform(#[from] TransformTextError),
    #[error("registering {what}: {source}")]
    Registration { what: &'static str, source: RegisterError },
    #[error("{images}: {source}")]
    Rigid { images: String, source: RegisterError },
    #[error("{scan}: {source}")]
    Head { scan: String, source: HeadError },
    #[error(transparent)]
    Pair(#[from] PairError),
    #[error("{labels}: {source}")]
    Engine { labels: String, source: EngineError },
    #[error("{labels}: the mesh of these labels holds no grey or white matter; look at the labels")]
    NoTissue { labels: &'static str },
    #[error("{labels}: {lost}")]
    Lost { labels: &'static str, lost: LostLabel },
    #[error(transparent)]
    Tag(#[from] TagError),
    #[error(transparent)]
    MeshFile(#[from] ReadError),
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error("{file}: {0}", file = file_of(.0))]
    Observed(#[from] ObservedError),
    #[error(transparent)]
    Prior(#[from] PriorError),
    #[error("{file}: {source}")]
    Studies { file: String, source: StudyError },
    #[error("{file}: {source}")]
    Hyperparameters { file: String, source: HyperparametersError },
    #[error("{file}: {reason}")]
    StudyLevelFile { file: String, reason: String },
    #[error(transparent)]
    StudyLevel(#[from] study_level::FitError),
    #[error("there is no literature model {id}; ids go from 0 to {last}")]
    NoSuchModel { id: u32, last: u32 },
    #[error(transparent)]
    Gp(#[from] FitRefusal),
    #[error(transparent)]
    Law(#[from] FitError),
    #[error("{file}: {source}")]
    Rheometry { file: String, source: RheometryError },
    #[error("{test}: {source}")]
    LawOfTest { test: String, source: FitError },
    #[error("samples of every task compare materials of the whole brain: they do not go with two tissues")]
    EveryTaskOfTwo,
    #[error("the table [{table}] asks for a simulation that cannot be done: {source}")]
    Sample { table: &'static str, source: SweepError },
    #[error("{sample} is not done with these settings ({reason})")]
    SampleMissing { sample: String, reason: String },
    #[error(
        "the phantom's reference state has no equilibrium ({reason}); lower `one_tissue_force_n` or \
         `two_tissue_force_n`, or raise the shear modulus, in the table [phantom] of the settings"
    )]
    NoReferenceState { reason: FemError },
    #[error("table [resection]: {0}")]
    Supports(#[from] SupportsError),
    #[error(
        "no model could be compared: evidence is found for `observed = \"displacement\"` in the table [estimate], and at least \
         one model must have an equilibrium"
    )]
    NoEvidence,
    #[error(
        "there is no load: `gravity_m_per_s2` is [0, 0, 0] (or the density 0) and no pressure is given, so that nothing can be \
         estimated from what has moved; give one of them in the table [resection]"
    )]
    NoLoad,
    #[error(
        "`method` of the table [{table}.solver] asks for a motion, and {of} is of equilibria: give `method = \"static\"` there, or \
         leave it out; samples alone may move"
    )]
    Moving { table: &'static str, of: &'static str },
    #[error(
        "`population` of the table [prior] teaches {taught}, and the estimate has {drawn}: set `tissues` of the table [resection] to \
         what the cohort was estimated with, or leave the population out"
    )]
    OtherCohort { taught: String, drawn: String },
    #[error("table [estimate]: {0}")]
    EstimateLoads(&'static str),
    #[error(transparent)]
    Estimate(#[from] ProblemError),
    #[error(transparent)]
    Synth(#[from] SynthError),
    #[error(transparent)]
    Mesh(#[from] MeshFileError),
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    #[error(transparent)]
    Overlay(#[from] OverlayError),
    #[error(transparent)]
    Warp(#[from] WarpError),
    #[error(transparent)]
    Predict(#[from] PredictError),
    #[error(transparent)]
    TakenUp(#[from] TakenUpError),
    #[error(transparent)]
    Landmark(#[from] LandmarkError),
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    #[error(transparent)]
    Population(#[from] PopulationFileError),
    #[error(transparent)]
    Merge(#[from] MergeError),
    #[error("population: {0}")]
    TooMany(#[from] TooMany),
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    #[error(transparent)]
    Cohort(#[from] CohortError),
    #[error(transparent)]
    Outcome(#[from] OutcomeError),
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    Derivatives(#[from] DerivativesError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("{}", .0.join("; "))]
    QualityGate(Vec<String>),
}

/// The file of a case whose fault it is.
fn file_of(error: &ObservedError) -> &'static str {
    match error {
        ObservedError::EmptySurface { set } if set == MARGIN => layout::CAVITY,
        ObservedError::EmptySurface { .. } => layout::POST_VENTRICLE,
        ObservedError::EmptySet { .. } => layout::REST_MESH,
    }
}

impl WorkflowError {
    /// What the two scans say, where that ends the job.
    pub fn answer(&self) -> Option<Answer> {
        match self {
            Self::Pair(PairError::NotOnePerson { .. }) => Some(Answer::NotOnePerson),
            Self::Pair(PairError::Resect(ResectError::NoOperation { .. })) => Some(Answer::NoOperation),
            _ => None,
        }
    }

    /// Who is to do something about it.
    pub fn kind(&self) -> ErrorKind {
        if self.answer().is_some() {
            // The scans were compared: no fault of a file.
            return ErrorKind::QualityGate;
        }
        match self {
            Self::QualityGate(_) | Self::Tag(TagError::Empty { .. }) => ErrorKind::QualityGate,
            // Another job's hold and a disk that does not read are no fault of a scan: the same command may go on later.
            Self::Case(CaseError::Held { .. } | CaseError::Unreadable { .. })
            | Self::Write(_)
            | Self::Cohort(CohortError::Write(_))
            | Self::Format(_)
            | Self::Outcome(OutcomeError { .. })
            | Self::Derivatives(_)
            | Self::NoReferenceState { .. }
            | Self::Predict(PredictError::NoEquilibrium { .. })
            | Self::Synth(SynthError::Sag(_))
            | Self::Mesh(MeshFileError::Noted { .. } | MeshFileError::Format { .. })
            | Self::Simulation(SimulationError::NotFinite { .. } | SimulationError::Noted { .. })
            | Self::Report(ReportError::Write(_))
            | Self::Engine { source: EngineError::Program { .. } | EngineError::Invalid { .. }, .. }
            | Self::Estimate(ProblemError::Instrument(_) | ProblemError::Estimate(EstimateError::Start(_))) => {
                ErrorKind::Failed
            }
            Self::Simulation(SimulationError::Fem { source, .. }) if !source.is_input() => ErrorKind::Failed,
            Self::Estimate(ProblemError::Body(BodyError::Fem(fem))) if !fem.is_input() => ErrorKind::Failed,
            _ => ErrorKind::Rejected,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_another_job_holds_is_no_fault_of_the_input() {
        let folder = std::path::PathBuf::from("case");
        let held = CaseError::Held { folder: folder.clone(), holder: String::new() };
        assert_eq!(WorkflowError::from(held).kind(), ErrorKind::Failed);
        assert_eq!(WorkflowError::from(CaseError::NotACase { folder }).kind(), ErrorKind::Rejected);
    }
}
