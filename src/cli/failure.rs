//! How a subcommand ends when it does not end well.

use super::session::has_emitted;
use std::process::ExitCode;

/// The three ways to end without success; usage errors (exit code 2) are clap's.
#[derive(Debug)]
pub enum Failure {
    /// Exit code 1: the computation failed.
    Failed(anyhow::Error),
    /// Exit code 3: the input was rejected; nothing was written.
    Rejected(anyhow::Error),
    /// Exit code 4: computed, outputs kept, but a quality gate refused the result.
    QualityGate(anyhow::Error),
}

impl Failure {
    /// The number a script sees.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code())
    }

    /// The same as a number.
    pub fn code(&self) -> u8 {
        match self {
            Self::Failed(_) => 1,
            Self::Rejected(_) => 3,
            Self::QualityGate(_) => 4,
        }
    }

    /// The same failure, with what it is about before its text.
    #[must_use]
    pub fn about(self, what: &str) -> Self {
        let what = what.to_owned();
        match self {
            Self::Failed(error) => Self::Failed(error.context(what)),
            Self::Rejected(error) => Self::Rejected(error.context(what)),
            Self::QualityGate(error) => Self::QualityGate(error.context(what)),
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

    /// One message on stderr; with `--json` also an object on stdout, unless the result is there already.
    pub fn report(&self, json: bool) {
        let (kind, error) = self.parts();
        let message = in_one_line(error);
        eprintln!("hgm: {kind}: {message}");
        if json && !has_emitted() {
            println!("{}", serde_json::json!({"error": {"kind": kind, "message": message, "exit_code": self.code()}}));
        }
    }
}

/// An error and its causes, each said once: some texts hold their cause already.
pub fn in_one_line(error: &anyhow::Error) -> String {
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
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

/// Marks an error as the input's fault (exit code 3).
pub trait Reject<T> {
    /// `Err(e)` becomes [`Failure::Rejected`].
    ///
    /// # Errors
    /// The error it was called on.
    fn reject(self) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> Reject<T> for Result<T, E> {
    fn reject(self) -> Result<T, Failure> {
        self.map_err(|error| Failure::Rejected(error.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::{Context, anyhow};

    #[test]
    fn a_cause_is_said_once() {
        let error = Err::<(), _>(anyhow!("no space left")).context("x.bin: cannot be written (no space left)");
        let error = error.context("report").unwrap_err();
        assert_eq!(in_one_line(&error), "report: x.bin: cannot be written (no space left)");
    }
}
