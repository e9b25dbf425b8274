//! A session as a list of commands with the step they came at, one line of JSON each.

use super::body::LiveBody;
use super::command::Command;
use super::session::Session;
use crate::fem::FemError;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Format of the file; raised when a reader of the old one would be wrong.
const VERSION: u32 = 1;
/// Most steps that are replayed: a day at 100 a second.
const MOST_STEPS: u64 = 8_640_000;

/// A command and the step it came before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timed {
    /// Steps taken before it.
    pub step: u64,
    /// The command.
    pub command: Command,
}

/// A session to be repeated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// The mesh it was recorded on.
    pub mesh_sha256: String,
    /// The scenario it began with, as TOML.
    pub scenario: String,
    /// What was done, in order.
    pub commands: Vec<Timed>,
    /// Steps of the whole session.
    pub steps: u64,
}

/// Why a recording cannot be replayed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum RecordingError {
    #[error("line {line}: {reason}; record the session again")]
    Line { line: usize, reason: String },
    #[error("the recording is of another mesh: open the one it was recorded on")]
    OtherMesh,
    #[error("the recording began with another scenario: open it with the one it was recorded with")]
    OtherScenario,
    #[error("step {step}: the command is refused ({reason}); record the session again")]
    Refused { step: u64, reason: String },
    #[error(transparent)]
    Fem(#[from] FemError),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    hgm_live: u32,
    mesh_sha256: String,
    scenario: String,
    steps: u64,
}

impl Recording {
    /// An empty one of a session on this body.
    pub fn new(body: &LiveBody) -> Self {
        let scenario = toml::to_string(&body.scenario).unwrap_or_default();
        Self { mesh_sha256: body.mesh_sha256.clone(), scenario, ..Self::default() }
    }

    /// The text of its file.
    pub fn to_text(&self) -> String {
        let head = Head {
            hgm_live: VERSION,
            mesh_sha256: self.mesh_sha256.clone(),
            scenario: self.scenario.clone(),
            steps: self.steps,
        };
        let mut text = serde_json::to_string(&head).unwrap_or_default() + "\n";
        for command in &self.commands {
            text += &serde_json::to_string(command).unwrap_or_default();
            text.push('\n');
        }
        text
    }

    /// Reads a file's text.
    ///
    /// # Errors
    /// [`RecordingError::Line`] with the line and what is wrong with it.
    pub fn from_text(text: &str) -> Result<Self, RecordingError> {
        let mut lines = text.lines().enumerate();
        let wrong = |line: usize, reason: String| RecordingError::Line { line: line + 1, reason };
        let (_, first) = lines.next().ok_or_else(|| wrong(0, "the file is empty".to_owned()))?;
        let head: Head = serde_json::from_str(first).map_err(|e| wrong(0, e.to_string()))?;
        if head.hgm_live != VERSION {
            return Err(wrong(0, format!("`hgm_live` is {}, this program reads {VERSION}", head.hgm_live)));
        }
        if head.steps > MOST_STEPS {
            return Err(wrong(0, format!("`steps` is {}: at most {MOST_STEPS} are replayed", head.steps)));
        }
        let mut commands: Vec<Timed> = Vec::new();
        for (n, line) in lines {
            let timed: Timed = serde_json::from_str(line).map_err(|e| wrong(n, e.to_string()))?;
            timed.command.check().map_err(|reason| wrong(n, reason))?;
            let before = commands.last().map_or(0, |timed| timed.step);
            if timed.step < before || timed.step > head.steps {
                return Err(wrong(n, format!("`step` is {}: steps go up, to {} at most", timed.step, head.steps)));
            }
            commands.push(timed);
        }
        Ok(Self { mesh_sha256: head.mesh_sha256, scenario: head.scenario, commands, steps: head.steps })
    }

    /// Repeats the session; `seen` sees it at its beginning and after every step.
    ///
    /// # Errors
    /// [`RecordingError`] for another body than the recording's, and for a command that is refused.
    pub fn replay(&self, body: &LiveBody, seen: &mut dyn FnMut(&Session)) -> Result<Session, RecordingError> {
        if body.mesh_sha256 != self.mesh_sha256 {
            return Err(RecordingError::OtherMesh);
        }
        if Self::new(body).scenario != self.scenario {
            return Err(RecordingError::OtherScenario);
        }
        let mut session = Session::open(body)?;
        seen(&session);
        let mut go_to = |session: &mut Session, step: u64| {
            while session.steps() < step {
                session.step();
                seen(session);
            }
        };
        for Timed { step, command } in &self.commands {
            go_to(&mut session, *step);
            session.apply(command).map_err(|reason| RecordingError::Refused { step: *step, reason })?;
        }
        go_to(&mut session, self.steps);
        Ok(session)
    }
}
