//! A replay as a series for ParaView: a VTU every so many steps and one at the end, and a PVD that lists them.

use super::colours::Colours;
use super::export::Export;
use super::session::Session;
use crate::mesh::format::pvd;

/// Files of a series that is being made. Their times in the PVD are the steps they were taken at: a body without time has
/// steps alone.
pub struct Series {
    stem: String,
    every: u64,
    files: Vec<(u64, String)>,
}

impl Series {
    /// A series whose files are called `STEM-0000.vtu` and on, one every so many steps.
    pub fn new(stem: &str, every: u64) -> Self {
        Self { stem: stem.to_owned(), every: every.max(1), files: Vec::new() }
    }

    /// The name and bytes of a file, where the session's step is one of the series.
    ///
    /// # Errors
    /// As [`Export::vtu`].
    pub fn due(&mut self, session: &Session, colours: &Colours) -> Result<Option<(String, Vec<u8>)>, String> {
        if session.steps().is_multiple_of(self.every) { self.file(session, colours).map(Some) } else { Ok(None) }
    }

    /// The last file: what was done after the last step is in it.
    ///
    /// # Errors
    /// As [`Export::vtu`].
    pub fn last(&mut self, session: &Session, colours: &Colours) -> Result<(String, Vec<u8>), String> {
        self.file(session, colours)
    }

    fn file(&mut self, session: &Session, colours: &Colours) -> Result<(String, Vec<u8>), String> {
        self.files.pop_if(|(step, _)| *step == session.steps());
        let name = format!("{}-{:04}.vtu", self.stem, self.files.len());
        let bytes = Export::of(session)?.coloured(session, colours).vtu()?;
        self.files.push((session.steps(), name.clone()));
        Ok((name, bytes))
    }

    /// Files so far.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The bytes of the PVD.
    pub fn list(&self) -> Vec<u8> {
        let list: Vec<(f64, &str)> = self.files.iter().map(|(step, name)| (*step as f64, name.as_str())).collect();
        pvd::encode(&list)
    }
}
