//! Why the derivatives of a cohort cannot be made, or a subject not stand among all.

use crate::artefact::WriteError;
use crate::experiment::outcome::OutcomeError;
use std::path::PathBuf;
use thiserror::Error;

/// Why the derivatives of a cohort cannot be made, or a subject not stand among all.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum CohortError {
    #[error("{}: the folder for the derivatives cannot be made; name a folder that you may write to: {source}", out.display())]
    NoFolder { out: PathBuf, source: std::io::Error },
    #[error("{}: the folder cannot be found; check the path: {source}", folder.display())]
    Lost { folder: PathBuf, source: std::io::Error },
    #[error(
        "{}: is a data set of scans, whose dataset_description.json and README the derivatives would replace; name another folder \
         for them, usually {}",
        out.display(), instead.display()
    )]
    RawDataSet { out: PathBuf, instead: PathBuf },
    #[error(
        "{}: holds derivatives that another program has made, whose dataset_description.json and README those of hgm would replace; \
         name another folder, usually {}",
        out.display(), instead.display()
    )]
    OthersDerivatives { out: PathBuf, instead: PathBuf },
    #[error(
        "{}: is a data set of scans or another program's derivatives, where no case folders may lie; name another folder for them",
        cases.display()
    )]
    OthersCases { cases: PathBuf },
    #[error("{}: not a log of hgm; delete it and run this subject again", file.display())]
    Log { file: PathBuf },
    #[error("{}: none of {count} subjects can be done, for the reasons above", dataset.display())]
    NobodyToRun { dataset: PathBuf, count: usize },
    #[error("{}: no subject has been run to its end here", out.display())]
    NobodyRun { out: PathBuf },
    #[error(transparent)]
    Outcome(#[from] OutcomeError),
    #[error(transparent)]
    Write(#[from] WriteError),
}
