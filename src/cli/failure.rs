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
        eprintln!("hgm: {kind}: {error:#}");
        if json && !has_emitted() {
            let message = format!("{error:#}");
            println!("{}", serde_json::json!({"error": {"kind": kind, "message": message, "exit_code": self.code()}}));
        }
    }
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
