//! What to do about an error, in words of the command line: the library's messages name no options.

use crate::anatomy::LabelError;
use crate::experiment::predict::{LevelError, TaughtError};
use crate::experiment::synth::SynthError;
use crate::image::nifti::{NiftiError, NiftiProblem};
use crate::layout;
use crate::live::ReplayError;
use crate::mesh::engine::EngineError;
use crate::register::RegisterError;
use crate::resect::PairError;
use crate::segment::{HeadError, ImportError};
use crate::tag::TagError;
use crate::workflow::cohort::DatasetError;
use crate::workflow::{
    AskedError, Case, CaseError, CohortError, EvaluateError, InputError, LabelMapError, MaskRole, MeshFileError,
    PredictError, SettingsError, SimulationError, Subject, TakenUpError, WorkflowError,
};

/// What to add to the message; nothing where the message says it all.
pub fn remedy(error: &anyhow::Error) -> Option<String> {
    error.chain().find_map(|cause| {
        let of_case = cause.downcast_ref().and_then(of_workflow).or_else(|| cause.downcast_ref().and_then(of_dataset));
        of_case.or_else(|| cause.downcast_ref().and_then(of_settings)).or_else(|| of_rooms(cause).map(str::to_owned))
    })
}

fn of_rooms(cause: &(dyn std::error::Error + 'static)) -> Option<&'static str> {
    if let Some(NiftiError { problem, .. }) = cause.downcast_ref() {
        return of_image(problem);
    }
    if let Some(ReplayError::NotASeries { .. }) = cause.downcast_ref() {
        return Some("name it so (-o), or leave --every out");
    }
    match cause.downcast_ref()? {
        HeadError::PoorFit { .. } | HeadError::UnlikeTemplate { .. } | HeadError::Segment(_) => {
            Some("--brain-mask takes one")
        }
        HeadError::Fit(_) => None,
    }
}

fn of_image(problem: &NiftiProblem) -> Option<&'static str> {
    match problem {
        NiftiProblem::SeveralVolumes { .. } | NiftiProblem::NoSuchVolume { .. } => Some("--volume N chooses"),
        NiftiProblem::NotMask { .. } => Some("see --dseg"),
        NiftiProblem::OrientationsDisagree { .. } => Some("--prefer sform or --prefer qform chooses"),
        _ => None,
    }
}

fn of_engine(error: &EngineError) -> &'static str {
    match error {
        EngineError::TooManyLabels { .. } => "see --labels and --without",
        EngineError::NoSuchLabel { .. } | EngineError::Factor { .. } => "see --edge-in and --edge-near",
        EngineError::Missing { .. } => "`hgm doctor` tells how to install it, --mesher lattice is always there",
        EngineError::Program { .. } | EngineError::Invalid { .. } => "--mesher lattice is always there",
        _ => "see --cells and --edge-mm",
    }
}

fn of_workflow(error: &WorkflowError) -> Option<String> {
    use WorkflowError as Job;
    let said = match error {
        Job::Asked(error) => of_asking(error),
        Job::Case(error) => return of_case(error),
        Job::Dataset(error) => return of_dataset(error),
        Job::Cohort(CohortError::OthersCases { .. }) => "see --work-dir",
        Job::Cohort(CohortError::NobodyRun { .. }) => "run `hgm bids BIDS_DIR OUT participant` first",
        Job::Image(NiftiError { problem, .. }) => return of_image(problem).map(str::to_owned),
        Job::Engine { source, .. } => of_engine(source),
        Job::Labels(LabelMapError::Import { source: ImportError::Numbers(LabelError::Mask { .. }), .. }) => {
            "see --brain-mask"
        }
        Job::Registration { source: RegisterError::OtherSize { .. }, .. }
        | Job::Rigid { source: RegisterError::OtherSize { .. }, .. } => {
            "where both are right `[register] largest_size_difference_percent` in a settings file (--config) takes more"
        }
        Job::Registration { .. } => {
            "--pose-start FILE says where to look for it, --pose FILE gives it by hand, --dseg FILE a label map that says it"
        }
        Job::Rigid { .. } | Job::Head { .. } => {
            "`hgm prep` takes a pose (--pose), a label map (--dseg) and masks of your own"
        }
        Job::Synth(SynthError::LobeTooSmall { .. }) => "see --resection-cc",
        Job::Synth(SynthError::NoRoomForLesion { .. }) => "see --old-lesion-cc, --resection-cc and --lobe",
        Job::Labels(_) => "see --labels",
        // A scan alone may have been given.
        Job::Pair(PairError::Head { .. }) => "--brain-mask takes a mask of your own, --dseg a label map, --pose a pose",
        Job::Pair(_) => {
            "--cavity-mask, --resected-mask and --brain-mask take masks of your own, --dseg a label map, --pose a pose"
        }
        Job::OtherCohort { .. } => TISSUES_OF_POPULATION,
        Job::Predict(error) => of_predicting(error)?,
        Job::Evaluate(error) => of_evaluation(error)?,
        Job::TakenUp(error) => return Some(of_taking_up(error)),
        Job::Tag(TagError::Empty { .. }) => "`hgm mesh --sets none` does without",
        Job::Input(InputError::MaskGrid { role, .. }) => option(*role),
        Job::NoSuchModel { .. } => "`hgm gp studies` lists them",
        Job::StudyLevelFile { .. } => "make it with `hgm gp fit --model study-level`",
        Job::EveryTaskOfTwo => "drop --every-task, or use --tissues 1",
        Job::Lost { .. } => "see --cells and --edge-mm",
        Job::NoTissue { .. } => "--brain-mask takes a brain mask of your own",
        Job::Observed(_) => "`hgm prep` takes masks of your own (--cavity-mask, --ventricle-mask)",
        Job::SampleMissing { .. } => {
            "run `hgm sweep CASE` on the shard it belongs to with the settings of the other shards (`hgm why CASE` tells \
             what differs)"
        }
        Job::Mesh(MeshFileError::Output { .. } | MeshFileError::Fractions { .. })
        | Job::Simulation(SimulationError::Output { .. }) => "correct -o",
        Job::Simulation(SimulationError::StartOfMotion) => "leave --start out",
        Job::Mesh(MeshFileError::NameOrHeader { .. }) => "--sets mni or --sets none says it",
        Job::Mesh(MeshFileError::Noted { .. }) | Job::Simulation(SimulationError::Noted { .. }) => {
            "run again with --force"
        }
        Job::Settings(error) => return of_settings(error),
        _ => return None,
    };
    Some(said.to_owned())
}

fn of_asking(error: &AskedError) -> &'static str {
    match error {
        AskedError::Level { .. } => "see --levels",
        AskedError::Draws { .. } => "see --draws",
        AskedError::PoissonRatio { .. } => "see --poisson-ratio",
        AskedError::ScenarioOfCase { .. } => "leave SCENARIO out",
        AskedError::MeshBeforeResection { .. } => "leave --before-resection out",
        AskedError::PackedNifti { .. } => "see -o and --write-brain-mask",
        AskedError::TransformNamedImage { .. } => "correct -o",
        AskedError::MasksOfTemplate => "leave --moving-mask and --fixed-mask out",
        AskedError::PoseAndStart | AskedError::StartBesideLabels => "leave --pose-start out",
    }
}

const TISSUES_OF_POPULATION: &str = "see --tissues and --population";

fn of_predicting(error: &PredictError) -> Option<&'static str> {
    use PredictError::{BesideScan, Ellipsoid, NoPlan, NoSurface, NoVoxel, OpenSurface, OtherSurface, Plan};
    use PredictError::{Label, Level, NoSuchLabel, NoTarget, OnePlan, SeveralPlans, TargetOutside, Taught};
    Some(match error {
        Plan(_)
        | NoPlan
        | Ellipsoid { .. }
        | NoSurface { .. }
        | OtherSurface { .. }
        | OpenSurface { .. }
        | NoVoxel { .. }
        | BesideScan { .. } => "see --resection and --resection-ellipsoid",
        Taught(TaughtError::OtherTissues { .. }) => TISSUES_OF_POPULATION,
        Taught(_) => "see --population, --drained and --fluid-below",
        Level(LevelError::BelowBrain { .. }) => "see --fluid-below and --drained",
        Level(LevelError::NoBrain) => "--dseg takes labels of your own",
        PredictError::OneHead { .. } => "see --head",
        OnePlan { .. } | SeveralPlans { .. } => "name another folder (-o)",
        PredictError::Twice { .. } => "give it once, and another beside it",
        PredictError::NoLabelMap { .. } => "see --dseg",
        Label { .. } | NoSuchLabel { .. } => "see --resection-label",
        NoTarget { .. } | TargetOutside { .. } => "see --targets",
        PredictError::NoDraws { .. } => "run `hgm predict` on it again",
        _ => return None,
    })
}

fn of_evaluation(error: &EvaluateError) -> Option<&'static str> {
    use EvaluateError as Seen;
    Some(match error {
        Seen::NothingSeen { .. } => {
            "--against CASE names the case that `hgm run` has made of both scans, --landmarks points on both"
        }
        Seen::NotAPrediction { .. } => {
            "give the folder of `hgm predict` first and the other after --against; landmarks go without --against"
        }
        Seen::NoLandmarks { .. } => "--landmarks takes points on both scans",
        Seen::NothingAfter { .. } => "--against takes a folder that `hgm run` has made",
        Seen::NowhereSeen { .. } => "--seen chooses the other state",
        Seen::NoPose { .. } => {
            "--against CASE says it, or --post-to-pre FILE, as `hgm register POST PRE -o FILE` writes it"
        }
        Seen::OtherScan { .. } | Seen::OtherGrid { .. } | Seen::NoLandmark { .. } => None?,
    })
}

fn of_taking_up(error: &TakenUpError) -> String {
    match error {
        TakenUpError::NoPrediction { .. } => "--prediction takes a folder that `hgm predict` has made".to_owned(),
        TakenUpError::OtherScan { .. } => {
            "give the scan that the prediction was made from, or leave --prediction out".to_owned()
        }
        TakenUpError::MadeOtherwise { folder, .. } => format!(
            "give the settings (--config {}) and the masks that the prediction was made with, make it again, or leave --prediction out",
            folder.join(layout::SETTINGS).display()
        ),
    }
}

fn of_settings(error: &SettingsError) -> Option<String> {
    let of_mesh = error.file.is_none() && error.table.as_deref() == Some("mesh");
    of_mesh.then(|| "correct --cells, --edge-mm or the settings file".to_owned())
}

fn of_case(error: &CaseError) -> Option<String> {
    let again = |folder: &std::path::Path, subject: &Option<Subject>| match subject {
        Some(Subject::Phantom { .. }) => format!("run `hgm phantom -o {} --force` again", folder.display()),
        Some(Subject::Plan) => format!("run `hgm predict PRE -o {} --force` again", folder.display()),
        _ => format!("run `hgm prep PRE POST -o {}` again (it takes masks of your own)", folder.display()),
    };
    Some(match error {
        CaseError::NotACase { .. } => "name a folder that `hgm prep`, `hgm run` or `hgm phantom` has made".to_owned(),
        CaseError::Missing { folder, subject, .. } | CaseError::Damaged { folder, subject, .. } => {
            again(folder, subject)
        }
        CaseError::Grid { folder, .. } => again(folder, &Some(Subject::Patient)),
        CaseError::OtherMesh { folder, .. } => again(folder, &Some(Subject::Phantom { every_task: false })),
        CaseError::Phantom { .. } => "`hgm estimate`, `hgm report` and `hgm why` take a phantom; give a folder that \
                                      `hgm prep` or `hgm run` has made"
            .to_owned(),
        CaseError::OtherTissues { asked, .. } => format!("make another with `hgm phantom --tissues {asked}`"),
        CaseError::Planned { .. } => {
            "run `hgm run PRE POST -o CASE` on another folder once there is a second scan".to_owned()
        }
        CaseError::Patient { .. } | CaseError::NotPlanned { .. } => "name another folder (-o)".to_owned(),
        CaseError::OtherScan { .. } => {
            "name another folder (-o), or say --force to make this one again from these scans".to_owned()
        }
        CaseError::Stale { folder, .. } => format!(
            "run {} on {} again with the settings that are meant (`hgm why` tells what differs)",
            if is_plan(folder) { "`hgm predict`" } else { "`hgm prep`, `hgm run`, `hgm sweep` or `hgm estimate`" },
            folder.display()
        ),
        CaseError::Held { .. } => "wait until it has ended".to_owned(),
        CaseError::NothingResected { .. } => "leave --before-resection out".to_owned(),
        CaseError::NoField { .. }
        | CaseError::NoState { .. }
        | CaseError::NoStage { .. }
        | CaseError::Unreadable { .. } => return None,
    })
}

fn is_plan(folder: &std::path::Path) -> bool {
    Case::open(folder).is_ok_and(|case| case.subject() == Some(Subject::Plan))
}

fn of_dataset(error: &DatasetError) -> Option<String> {
    Some(match error {
        DatasetError::Absent { .. } => "see --participant-label".to_owned(),
        DatasetError::NoScan { .. } => {
            "--participant-label names those that are done, --entity the scan of a session".to_owned()
        }
        DatasetError::NoPlan { .. } => {
            "--plans names another folder, --participant-label those that are planned".to_owned()
        }
        DatasetError::SeveralPlans { entity, .. } => format!("choose one with --plan, such as --plan {entity}"),
        DatasetError::SeveralScans { entity, .. } => format!("choose one with --entity, such as --entity {entity}"),
        _ => return None,
    })
}

fn option(role: MaskRole) -> &'static str {
    match role {
        MaskRole::Brain => "see --brain-mask",
        MaskRole::Ventricle => "see --ventricle-mask",
        MaskRole::Cavity => "see --cavity-mask",
        MaskRole::Resected => "see --resected-mask",
        MaskRole::Labels => "see --dseg",
        MaskRole::Pose => "see --pose",
        MaskRole::PoseStart => "see --pose-start",
    }
}
