//! How a subcommand ends when it does not end well.

use super::output::print_line;
use super::remedy::remedy;
use crate::experiment::outcome::Answer;
use crate::live::{ReplayError, ServeError};
use crate::workflow::cohort::DatasetError;
use crate::workflow::{ErrorKind, InputError, SettingsError, WorkflowError};
use anyhow::anyhow;

/// The three ways to end without success; usage errors (exit code 2) are clap's.
#[derive(Debug)]
pub enum Failure {
    /// Exit code 1: the computation failed.
    Failed(anyhow::Error),
    /// Exit code 3: the input was rejected; no result was written.
    Rejected(anyhow::Error),
    /// Exit code 4: computed, outputs kept, but a quality gate refused the result.
    QualityGate(anyhow::Error),
}

impl Failure {
    /// An error by whose fault it is.
    pub fn of(kind: ErrorKind, error: anyhow::Error) -> Self {
        match kind {
            ErrorKind::Rejected => Self::Rejected(error),
            ErrorKind::Failed => Self::Failed(error),
            ErrorKind::QualityGate => Self::QualityGate(error),
        }
    }

    /// The input's fault (exit code 3), with what to do about it.
    pub fn of_input(error: impl Into<anyhow::Error>) -> Self {
        Self::Rejected(with_remedy(error.into()))
    }

    /// The number a script sees.
    pub fn code(&self) -> u8 {
        match self {
            Self::Failed(_) => 1,
            Self::Rejected(_) => 3,
            Self::QualityGate(_) => 4,
        }
    }

    /// What kind it is, and the error.
    pub fn parts(&self) -> (&'static str, &anyhow::Error) {
        match self {
            Self::Failed(error) => ("failed", error),
            Self::Rejected(error) => ("input rejected", error),
            Self::QualityGate(error) => ("quality gate", error),
        }
    }

    /// The message, in one line.
    pub fn message(&self) -> String {
        in_one_line(self.parts().1)
    }

    /// The name of the answer that the scans gave, where they gave one of their own.
    pub fn answer(&self) -> Option<&'static str> {
        self.parts().1.downcast_ref::<Answered>().map(|answered| answered.answer.name())
    }

    /// One message on stderr; `on_stdout` also as an object there, which is for `--json` without a result.
    pub fn report(&self, on_stdout: bool) {
        let (kind, error) = self.parts();
        let message = in_one_line(error);
        eprintln!("hgm: {kind}: {message}");
        if on_stdout {
            let mut told = serde_json::json!({"kind": kind, "message": message, "exit_code": self.code()});
            if let Some(answer) = error.downcast_ref::<Answered>() {
                told["answer"] = answer.answer.name().into();
                told["verdict"] = serde_json::json!(answer.answer.verdict());
            }
            print_line(&serde_json::json!({ "error": told }).to_string()).ok();
        }
    }
}

/// The scans were compared and gave an answer that ends the job.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
struct Answered {
    answer: Answer,
    message: String,
}

/// An error and its causes, each said once: some texts hold their cause already.
fn in_one_line(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |said, cause| {
        let cause = cause.trim_end();
        if said.contains(cause) {
            said
        } else if said.is_empty() {
            cause.to_owned()
        } else {
            format!("{said}: {cause}")
        }
    })
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    /// Whose fault it is the library says; what to do about it on the command line is added here.
    fn from(error: E) -> Self {
        let error: anyhow::Error = error.into();
        let kind = kind(&error);
        if let Some(answer) = error.downcast_ref().and_then(WorkflowError::answer) {
            let message = format!("{} {}", answer.verdict().sentence, in_one_line(&with_remedy(error)));
            return Self::QualityGate(Answered { answer, message }.into());
        }
        let error = match (with_remedy(error), kind) {
            (error, ErrorKind::QualityGate) => anyhow!("{} (outputs kept)", in_one_line(&error)),
            (error, _) => error,
        };
        Self::of(kind, error)
    }
}

fn with_remedy(error: anyhow::Error) -> anyhow::Error {
    match remedy(&error) {
        Some(remedy) => anyhow!("{}; {remedy}", in_one_line(&error)),
        None => error,
    }
}

fn kind(error: &anyhow::Error) -> ErrorKind {
    let given = error.is::<InputError>() || error.is::<SettingsError>() || error.is::<DatasetError>();
    let of_job = error.downcast_ref().map(WorkflowError::kind);
    let of_body = || error.downcast_ref().map(ReplayError::kind).or_else(|| error.downcast_ref().map(ServeError::kind));
    of_job.or_else(of_body).unwrap_or(if given { ErrorKind::Rejected } else { ErrorKind::Failed })
}
