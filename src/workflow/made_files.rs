//! The files of a case as they were written: what has been changed since is refused where an answer is made of it.

use super::case::Case;
use super::error::{CaseError, WorkflowError};
use crate::artefact::{Manifest, Reason, sha256_hex};

/// A case's files with the manifests of the stages that made them.
#[derive(Debug)]
pub(crate) struct MadeFiles<'a> {
    case: &'a Case,
    made: Vec<Manifest>,
}

impl<'a> MadeFiles<'a> {
    /// Those of every stage that has finished.
    pub fn of(case: &'a Case) -> Self {
        Self { case, made: case.recorded() }
    }

    /// The bytes of a file, as its stage wrote them; of a file that no stage keeps a checksum of, as they are.
    ///
    /// # Errors
    /// A file that is missing or was changed.
    pub fn read(&self, file: &str) -> Result<Vec<u8>, WorkflowError> {
        let bytes = self.case.read(file)?;
        match self.made.iter().find_map(|manifest| manifest.outputs.get(file)) {
            Some(written) if sha256_hex(&bytes) != written.sha256 => Err(self.changed(file.to_owned())),
            _ => Ok(bytes),
        }
    }

    /// Refuses files that were changed; one that is no longer there is no answer, and so no wrong one.
    ///
    /// # Errors
    /// The first of them.
    pub fn check(&self) -> Result<(), WorkflowError> {
        let mut reasons = self.made.iter().flat_map(|manifest| manifest.changed_outputs(self.case.folder()));
        let changed = reasons.find_map(|reason| match reason {
            Reason::OutputChanged { file } => Some(self.changed(file)),
            _ => None,
        });
        changed.map_or(Ok(()), Err)
    }

    fn changed(&self, file: String) -> WorkflowError {
        let (folder, reasons) = (self.case.folder().to_path_buf(), vec![Reason::OutputChanged { file: file.clone() }]);
        CaseError::Stale { folder, what: file, reasons }.into()
    }
}

impl Case {
    /// [`MadeFiles::read`], of one file.
    ///
    /// # Errors
    /// A file that is missing or was changed.
    pub(crate) fn read_made(&self, file: &str) -> Result<Vec<u8>, WorkflowError> {
        MadeFiles::of(self).read(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artefact::{Produced, Stage};

    #[test]
    fn a_file_is_read_as_it_was_written_or_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let case = Case::at(folder.path());
        let files = vec![("sim/a.csv".to_owned(), b"1".to_vec()), ("sim/b.csv".to_owned(), b"2".to_vec())];
        let made = || Ok::<_, std::convert::Infallible>(Produced { files, ..Produced::default() });
        Stage::new("anat", 1, folder.path(), &()).run(false, made).unwrap();
        std::fs::write(case.path("sim/own.csv"), "3").unwrap();
        let read = |file: &str| MadeFiles::of(&case).read(file);
        assert_eq!((read("sim/a.csv").unwrap(), read("sim/own.csv").unwrap()), (b"1".to_vec(), b"3".to_vec()));
        assert!(MadeFiles::of(&case).check().is_ok());
        std::fs::write(case.path("sim/a.csv"), "5").unwrap();
        let refused = read("sim/a.csv").unwrap_err().to_string();
        assert!(refused.contains("sim/a.csv") && refused.contains("was changed"), "{refused}");
        assert!(read("sim/b.csv").is_ok() && MadeFiles::of(&case).check().is_err());
        std::fs::remove_file(case.path("sim/a.csv")).unwrap();
        assert!(MadeFiles::of(&case).check().is_ok());
    }
}
