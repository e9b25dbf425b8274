//! A subject of a cohort, as its folder holds it.

use crate::experiment::outcome::{Answer, ExperimentOutcome};
use schemars::JsonSchema;
use serde::Serialize;

/// How a subject of a cohort ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Every stage ran within its checks.
    Done,
    /// Computed, but a boundary set is not to be believed.
    QualityGate,
    /// One head twice, and nothing was taken out.
    NoOperation,
    /// The two scans show two heads.
    NotOnePerson,
    /// It ended with an error.
    Failed,
    /// It was begun, and what lies there is not of one state: an answer of other settings, or of a run that was broken off.
    Unfinished,
    /// It has not been run.
    Missing,
}

/// A subject as its folder holds it.
#[derive(Clone, Debug)]
pub struct Member {
    /// `sub-01`.
    pub participant_id: String,
    /// How it ended.
    pub status: Status,
    /// Why it did not end well.
    pub message: Option<String>,
    /// Whether its page lies beside that of all.
    pub has_page: bool,
    /// Its numbers, where its last run gave any.
    pub outcome: Option<ExperimentOutcome>,
    /// Checksum of its settings: subjects with different ones are not to be compared.
    pub settings_sha256: Option<String>,
}

impl Status {
    /// How a subject ended that a quality gate stopped, with the scans' answer where they gave one.
    pub fn of(answer: Option<Answer>) -> Self {
        match answer {
            None => Self::QualityGate,
            Some(Answer::NoOperation) => Self::NoOperation,
            Some(Answer::NotOnePerson) => Self::NotOnePerson,
        }
    }

    /// The word of tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::QualityGate => "quality-gate",
            Self::NoOperation => Answer::NoOperation.name(),
            Self::NotOnePerson => Answer::NotOnePerson.name(),
            Self::Failed => "failed",
            Self::Unfinished => "unfinished",
            Self::Missing => "missing",
        }
    }

    /// Whether a page of the subject, where there is one, is of how it ended.
    pub fn has_page(&self) -> bool {
        !matches!(self, Self::Failed | Self::Unfinished | Self::Missing)
    }
}
