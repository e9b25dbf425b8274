//! What to do about an error, in words of the command line: the library's messages name no options.

use crate::layout;
use crate::mesh::engine::EngineError;
use crate::workflow::cohort::{CohortError, DatasetError};
use crate::workflow::{CaseError, InputError, MaskRole, Subject, WorkflowError};

/// What to add to the message; nothing where the message says it all.
pub fn remedy(error: &anyhow::Error) -> Option<String> {
    error.chain().find_map(|cause| {
        cause.downcast_ref().and_then(of_workflow).or_else(|| cause.downcast_ref().and_then(of_dataset)).or_else(|| {
            let lost = matches!(cause.downcast_ref()?, CohortError::Log { .. });
            lost.then(|| "`hgm bids BIDS_DIR OUT participant --participant-label` runs one subject".to_owned())
        })
    })
}

fn of_workflow(error: &WorkflowError) -> Option<String> {
    Some(match error {
        WorkflowError::Case(error) => return of_case(error),
        WorkflowError::Input(InputError::MaskGrid { role, .. }) => format!("the mask was given as {}", option(*role)),
        WorkflowError::EveryTaskOfTwo => "drop --every-task, or use --tissues 1".to_owned(),
        WorkflowError::NoTissue { .. } => "or give a brain mask (--brain-mask)".to_owned(),
        WorkflowError::Observed(_) => {
            "`hgm prep` takes masks of your own (--cavity-mask, --ventricle-mask)".to_owned()
        }
        WorkflowError::EstimateLaw { .. } => "or try samples of that law with `hgm sweep --law`".to_owned(),
        WorkflowError::SampleMissing { .. } => {
            "run `hgm sweep CASE` on the shard it belongs to with the settings of the other shards (`hgm why CASE` tells \
             what differs)"
                .to_owned()
        }
        WorkflowError::Settings(error) if error.file.is_none() && error.table.as_deref() == Some("mesh") => {
            "correct --cells, --edge-mm or the settings file".to_owned()
        }
        WorkflowError::Engine { source: EngineError::Setting { .. }, .. } => "see --cells and --edge-mm".to_owned(),
        _ => return None,
    })
}

fn of_case(error: &CaseError) -> Option<String> {
    Some(match error {
        CaseError::NotACase { .. } => "name a folder that `hgm prep`, `hgm run` or `hgm phantom` has made".to_owned(),
        CaseError::Missing { folder, subject, .. } | CaseError::Damaged { folder, subject, .. } => match subject {
            Some(Subject::Phantom { .. }) => format!("run `hgm phantom -o {} --force` again", folder.display()),
            _ => format!("run `hgm prep PRE POST -o {}` again", folder.display()),
        },
        CaseError::Grid { folder, .. } => format!(
            "run `hgm prep PRE POST -o {}` again (--cavity-mask and --resected-mask take masks of your own)",
            folder.display()
        ),
        CaseError::OtherMesh { folder, .. } => format!("run `hgm phantom -o {} --force` again", folder.display()),
        CaseError::Phantom { .. } => "`hgm estimate`, `hgm report` and `hgm why` take a phantom; give a folder that \
                                      `hgm prep` or `hgm run` has made"
            .to_owned(),
        CaseError::OtherTissues { asked, .. } => format!("make another with `hgm phantom --tissues {asked}`"),
        CaseError::NoField { .. } => {
            format!("`hgm report` shows what is there; {} names the best sample", layout::OUTCOME)
        }
        CaseError::Unreadable { .. } => return None,
    })
}

fn of_dataset(error: &DatasetError) -> Option<String> {
    Some(match error {
        DatasetError::Absent { .. } => "see --participant-label".to_owned(),
        DatasetError::NoScan { .. } => "--participant-label names those that are done".to_owned(),
        DatasetError::SeveralScans { entity, .. } => format!("choose one with --entity, such as --entity {entity}"),
        _ => return None,
    })
}

fn option(role: MaskRole) -> &'static str {
    match role {
        MaskRole::Brain => "--brain-mask",
        MaskRole::Ventricle => "--ventricle-mask",
        MaskRole::Cavity => "--cavity-mask",
        MaskRole::Resected => "--resected-mask",
        MaskRole::Labels => "--dseg",
    }
}
