//! A recording done again, into files.

use super::body::LiveBody;
use super::colours::Colours;
use super::export::Export;
use super::recording::{Recording, RecordingError};
use super::series::Series;
use super::session::Session;
use crate::artefact::{ApartError, WriteError, check_apart, check_writable, moments_called_as, write_whole};
use crate::workflow::{Case, ErrorKind, InputError, Progress, read_text};
use serde::Serialize;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Steps from one file of a series to the next: two or three files a second of a body of five thousand nodes.
const EVERY: u64 = 30;

/// Why a recording has left no files.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum ReplayError {
    #[error("{}: a file every so many steps makes a series, whose name ends in .pvd", output.display())]
    NotASeries { output: PathBuf },
    #[error("{}: the name of a state ends in .vtu, that of a series in .pvd: end it in one of them", output.display())]
    Ending { output: PathBuf },
    #[error(transparent)]
    Apart(#[from] ApartError),
    #[error(transparent)]
    Input(#[from] InputError),
    #[error("{}: {source}", file.display())]
    Recording { file: PathBuf, source: RecordingError },
    #[error("{0}")]
    State(String),
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl ReplayError {
    /// Who is to do something about it.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::NotASeries { .. }
            | Self::Ending { .. }
            | Self::Apart(_)
            | Self::Input(_)
            | Self::Recording { .. } => ErrorKind::Rejected,
            Self::State(_) | Self::Write(_) => ErrorKind::Failed,
        }
    }
}

/// What a replay has left.
#[derive(Clone, Debug, Serialize)]
pub struct Replayed {
    /// The state at the end, or the list of a series.
    pub output: String,
    /// States written.
    pub files: usize,
    /// Steps done.
    pub steps: u64,
    /// Commands done.
    pub commands: usize,
    /// Largest displacement at the end, mm.
    pub displacement_max_mm: f64,
    /// Whether the body rests at the end.
    pub at_rest: bool,
}

/// Refuses a recording, a state or a series that would be written over what the session is made of: a mesh, a scenario, a recording,
/// or the folder of a case, whose files stand for it. Comes before the session.
///
/// # Errors
/// [`ReplayError::Apart`]; a place that takes no file.
pub fn check_output(output: &Path, made_of: &[&Path]) -> Result<(), ReplayError> {
    check_writable(output)?;
    let moments = if is_series(output) { moments_called_as(output, made_of.iter().copied()) } else { Vec::new() };
    let outputs: Vec<&Path> = moments.iter().map(PathBuf::as_path).chain([output]).collect();
    let (cases, files): (Vec<&Path>, Vec<&Path>) = made_of.iter().copied().partition(|path| path.is_dir());
    let of_cases = cases.into_iter().flat_map(|folder| Case::at(folder).own_of(outputs.iter().copied()));
    Ok(check_apart(&outputs, of_cases.chain(files.into_iter().map(Path::to_path_buf)))?)
}

fn is_series(output: &Path) -> bool {
    ends_in(output, "pvd")
}

fn ends_in(output: &Path, ending: &str) -> bool {
    output.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// Repeats the recording in a file and writes the state at its end, or, where the name ends in .pvd, a series with one every
/// so many steps.
///
/// # Errors
/// [`ReplayError`]: steps between files of one state, a name that is neither's or the recording's own, a file that is no recording or
/// one of another body or with a command that is refused, a state that cannot be written.
pub fn replay_to_files(
    file: &Path,
    body: &LiveBody,
    (output, every): (&Path, Option<u64>),
    progress: &mut dyn Progress,
) -> Result<Replayed, ReplayError> {
    check_output(output, &[file])?;
    let in_series = is_series(output);
    if every.is_some() && !in_series {
        return Err(ReplayError::NotASeries { output: output.to_path_buf() });
    }
    if !in_series && !ends_in(output, "vtu") {
        return Err(ReplayError::Ending { output: output.to_path_buf() });
    }
    let refused = |source| ReplayError::Recording { file: file.to_path_buf(), source };
    let recording = Recording::from_text(&read_text(file)?).map_err(refused)?;
    let stem = output.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let mut series = Series::new(&stem, every.unwrap_or(EVERY));
    let mut colours = None;
    let write = |(name, bytes): (String, Vec<u8>)| write_whole(&output.with_file_name(name), &bytes);
    // The first that cannot be made or written.
    let mut failed: Option<ReplayError> = None;
    let mut shown = 0;
    progress.begin("steps", recording.steps as usize);
    let replayed = recording.replay(body, &mut |seen: &Session| {
        (shown..seen.steps()).for_each(|_| progress.step());
        shown = seen.steps();
        let colours = &*colours.get_or_insert_with(|| Colours::of(body, seen.mesh()));
        if in_series && failed.is_none() {
            let due = series.due(seen, colours).map_err(ReplayError::State);
            failed = due.and_then(|due| Ok(due.map_or(Ok(()), write)?)).err();
        }
    });
    progress.end();
    let replayed = replayed.map_err(refused)?;
    if let Some(error) = failed {
        return Err(error);
    }
    let colours = colours.unwrap_or_else(|| Colours::of(body, replayed.mesh()));
    if in_series {
        write(series.last(&replayed, &colours).map_err(ReplayError::State)?)?;
        write_whole(output, &series.list())?;
    } else {
        let state = Export::of(&replayed).map(|state| state.coloured(&replayed, &colours));
        write_whole(output, &state.and_then(|state| state.vtu()).map_err(ReplayError::State)?)?;
    }
    let largest = replayed.displacement_mm().iter().map(|u| u.iter().map(|x| x * x).sum::<f64>()).fold(0.0, f64::max);
    Ok(Replayed {
        output: output.display().to_string(),
        files: if in_series { series.len() } else { 1 },
        steps: replayed.steps(),
        commands: recording.commands.len(),
        displacement_max_mm: largest.sqrt(),
        at_rest: replayed.is_at_rest(),
    })
}

impl Replayed {
    /// In a line.
    pub fn in_words(&self) -> String {
        let Self { output, steps, commands, displacement_max_mm: most, .. } = self;
        format!("{output}: {commands} commands, {steps} steps, moved by {most:.3} mm at most")
    }
}
