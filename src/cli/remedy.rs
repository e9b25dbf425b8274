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
    let said = match error {
        WorkflowError::Asked(error) => of_asking(error),
        WorkflowError::Case(error) => return of_case(error),
        WorkflowError::Dataset(error) => return of_dataset(error),
        WorkflowError::Cohort(CohortError::OthersCases { .. }) => "see --work-dir",
        WorkflowError::Cohort(CohortError::NobodyRun { .. }) => "run `hgm bids BIDS_DIR OUT participant` first",
        WorkflowError::Image(NiftiError { problem, .. }) => return of_image(problem).map(str::to_owned),
        WorkflowError::Engine { source, .. } => of_engine(source),
        WorkflowError::Labels(LabelMapError::Import {
            source: ImportError::Numbers(LabelError::Mask { .. }), ..
        }) => "see --brain-mask",
        WorkflowError::Registration { source: RegisterError::OtherSize { .. }, .. }
        | WorkflowError::Rigid { source: RegisterError::OtherSize { .. }, .. } => {
            "where both are right `[register] largest_size_difference_percent` in a settings file (--config) takes more"
        }
        WorkflowError::Registration { .. } => {
            "--pose-start FILE says where to look for it, --pose FILE gives it by hand, --dseg FILE a label map that says it"
        }
        WorkflowError::Rigid { .. } | WorkflowError::Head { .. } => {
            "`hgm prep` takes a pose (--pose), a label map (--dseg) and masks of your own"
        }
        WorkflowError::Synth(SynthError::LobeTooSmall { .. }) => "see --resection-cc",
        WorkflowError::Synth(SynthError::NoRoomForLesion { .. }) => "see --old-lesion-cc, --resection-cc and --lobe",
        WorkflowError::Labels(_) => "see --labels",
        // A scan alone may have been given.
        WorkflowError::Pair(PairError::Head { .. }) => {
            "--brain-mask takes a mask of your own, --dseg a label map, --pose a pose"
        }
        WorkflowError::Pair(_) => {
            "--cavity-mask, --resected-mask and --brain-mask take masks of your own, --dseg a label map, --pose a pose"
        }
        WorkflowError::Predict(
            PredictError::Plan(_)
            | PredictError::NoPlan
            | PredictError::Ellipsoid { .. }
            | PredictError::NoSurface { .. }
            | PredictError::OtherSurface { .. }
            | PredictError::OpenSurface { .. }
            | PredictError::NoVoxel { .. }
            | PredictError::BesideScan { .. },
        ) => "see --resection and --resection-ellipsoid",
        WorkflowError::OtherCohort { .. }
        | WorkflowError::Predict(PredictError::Taught(TaughtError::OtherTissues { .. })) => {
            "see --tissues and --population"
        }
        WorkflowError::Predict(PredictError::Taught(_)) => "see --population, --drained and --fluid-below",
        WorkflowError::Predict(PredictError::Level(LevelError::BelowBrain { .. })) => "see --fluid-below and --drained",
        WorkflowError::Predict(PredictError::Level(LevelError::NoBrain)) => "--dseg takes labels of your own",
        WorkflowError::Predict(PredictError::OneHead { .. }) => "see --head",
        WorkflowError::Predict(PredictError::OnePlan { .. } | PredictError::SeveralPlans { .. }) => {
            "name another folder (-o)"
        }
        WorkflowError::Predict(PredictError::Twice { .. }) => "give it once, and another beside it",
        WorkflowError::Predict(PredictError::NoLabelMap { .. }) => "see --dseg",
        WorkflowError::Predict(PredictError::Label { .. } | PredictError::NoSuchLabel { .. }) => {
            "see --resection-label"
        }
        WorkflowError::Predict(PredictError::NoTarget { .. } | PredictError::TargetOutside { .. }) => "see --targets",
        WorkflowError::Predict(PredictError::NoDraws { .. }) => "run `hgm predict` on it again",
        WorkflowError::Evaluate(error) => of_evaluation(error)?,
        WorkflowError::TakenUp(error) => return Some(of_taking_up(error)),
        WorkflowError::Tag(TagError::Empty { .. }) => "`hgm mesh --sets none` does without",
        WorkflowError::Input(InputError::MaskGrid { role, .. }) => option(*role),
        WorkflowError::NoSuchModel { .. } => "`hgm gp studies` lists them",
        WorkflowError::StudyLevelFile { .. } => "make it with `hgm gp fit --model study-level`",
        WorkflowError::EveryTaskOfTwo => "drop --every-task, or use --tissues 1",
        WorkflowError::Lost { .. } => "see --cells and --edge-mm",
        WorkflowError::NoTissue { .. } => "--brain-mask takes a brain mask of your own",
        WorkflowError::Observed(_) => "`hgm prep` takes masks of your own (--cavity-mask, --ventricle-mask)",
        WorkflowError::SampleMissing { .. } => {
            "run `hgm sweep CASE` on the shard it belongs to with the settings of the other shards (`hgm why CASE` tells \
             what differs)"
        }
        WorkflowError::Mesh(MeshFileError::Output { .. } | MeshFileError::Fractions { .. })
        | WorkflowError::Simulation(SimulationError::Output { .. }) => "correct -o",
        WorkflowError::Simulation(SimulationError::StartOfMotion) => "leave --start out",
        WorkflowError::Mesh(MeshFileError::NameOrHeader { .. }) => "--sets mni or --sets none says it",
        WorkflowError::Mesh(MeshFileError::Noted { .. }) | WorkflowError::Simulation(SimulationError::Noted { .. }) => {
            "run again with --force"
        }
        WorkflowError::Settings(error) => return of_settings(error),
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
        AskedError::TransformNamedImage { .. } | AskedError::TransformOverInput { .. } => "correct -o",
        AskedError::MasksOfTemplate => "leave --moving-mask and --fixed-mask out",
        AskedError::PoseAndStart | AskedError::StartBesideLabels => "leave --pose-start out",
    }
}

fn of_evaluation(error: &EvaluateError) -> Option<&'static str> {
    Some(match error {
        EvaluateError::NothingSeen { .. } => {
            "--against CASE names the case that `hgm run` has made of both scans, --landmarks points on both"
        }
        EvaluateError::NotAPrediction { .. } => {
            "give the folder of `hgm predict` first and the other after --against; landmarks go without --against"
        }
        EvaluateError::NoLandmarks { .. } => "--landmarks takes points on both scans",
        EvaluateError::NothingAfter { .. } => "--against takes a folder that `hgm run` has made",
        EvaluateError::NowhereSeen { .. } => "--seen chooses the other state",
        EvaluateError::NoPose { .. } => {
            "--against CASE says it, or --post-to-pre FILE, as `hgm register POST PRE -o FILE` writes it"
        }
        EvaluateError::OtherScan { .. } | EvaluateError::OtherGrid { .. } | EvaluateError::NoLandmark { .. } => None?,
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
        CaseError::NoField { .. } | CaseError::NoStage { .. } | CaseError::Unreadable { .. } => return None,
    })
}

fn is_plan(folder: &std::path::Path) -> bool {
    Case::open(folder).is_ok_and(|case| case.subject() == Some(Subject::Plan))
}

fn of_dataset(error: &DatasetError) -> Option<String> {
    Some(match error {
        DatasetError::Absent { .. } => "see --participant-label".to_owned(),
        DatasetError::NoScan { .. } => "--participant-label names those that are done".to_owned(),
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
