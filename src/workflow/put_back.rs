//! What a refused job leaves: the settings that the folder had, as long as nothing in it is of others, and nothing of its own where the
//! folder was no case.

use super::case::Case;
use super::error::{ErrorKind, WorkflowError};
use crate::artefact::{Manifest, write_whole};
use crate::layout;

/// How a folder was before a job.
#[derive(Debug)]
pub(crate) struct Before {
    case: Case,
    /// The bytes of its settings.
    settings: Option<Vec<u8>>,
    /// What had been finished in it.
    stages: Vec<Manifest>,
    /// What had been gathered from that.
    gathered: [Option<Vec<u8>>; 2],
}

fn gathered(case: &Case) -> [Option<Vec<u8>>; 2] {
    [layout::OUTCOME, layout::PROVENANCE].map(|file| std::fs::read(case.path(file)).ok())
}

impl Before {
    /// Remembers a folder.
    pub fn of(case: &Case) -> Self {
        let settings = std::fs::read(case.path(layout::SETTINGS)).ok();
        Self { case: case.clone(), settings, stages: case.recorded(), gathered: gathered(case) }
    }

    /// After an error: the settings as they were, where nothing was finished and nothing gathered since. What has been is of the
    /// job's own settings, and those stay with it.
    pub fn put_back_where_nothing_is_new(&self) {
        if self.case.recorded() != self.stages || gathered(&self.case) != self.gathered {
            return;
        }
        let settings = self.case.path(layout::SETTINGS);
        // The job's own error is told, not the disk's.
        match &self.settings {
            Some(bytes) => write_whole(&settings, bytes).unwrap_or_default(),
            None => std::fs::remove_file(settings).unwrap_or_default(),
        }
    }

    /// After an error: the settings as they were, so that what is there is still of its settings; and where an input was refused
    /// in a folder that was no case, what the job has made there is taken away.
    pub fn put_back(&self, error: &WorkflowError) {
        let settings = self.case.path(layout::SETTINGS);
        // The job's own error is told, not the disk's.
        match &self.settings {
            Some(bytes) => write_whole(&settings, bytes).unwrap_or_default(),
            None if error.kind() == ErrorKind::Rejected => {
                std::fs::remove_file(settings).unwrap_or_default();
                // A patient made by `synth` is no case, and nobody's to clear away.
                if self.stages.is_empty() {
                    self.clear();
                }
            }
            // What was computed before the job failed is of these settings.
            None => {}
        }
    }

    /// Files of the stages that have finished, then folders that are empty without them.
    fn clear(&self) {
        for manifest in self.case.recorded() {
            manifest.remove(self.case.folder());
            for file in manifest.outputs.keys() {
                let folders = std::path::Path::new(file).ancestors().skip(1).filter(|f| !f.as_os_str().is_empty());
                folders.for_each(|folder| std::fs::remove_dir(self.case.folder().join(folder)).unwrap_or_default());
            }
        }
        std::fs::remove_dir(self.case.path(".stages")).ok();
        std::fs::remove_file(self.case.path(layout::LOCK)).ok();
        std::fs::remove_dir(self.case.folder()).ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artefact::{Produced, Stage};
    use crate::workflow::error::PredictError;

    /// A job that writes settings, finishes its first stage and is then refused.
    fn refused_in(folder: &std::path::Path) {
        let case = Case::at(folder);
        let before = Before::of(&case);
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(case.path(layout::SETTINGS), "new").unwrap();
        let made = Produced { files: vec![(layout::MNI_FROM_PRE_TEXT.to_owned(), vec![1])], ..Produced::default() };
        Stage::new("pose", 1, folder, &"new").run(false, || Ok::<_, PredictError>(made)).unwrap();
        before.put_back(&PredictError::NoPlan.into());
    }

    #[test]
    fn a_refused_job_leaves_the_settings_of_a_case_until_a_stage_is_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let case = Case::at(folder.path());
        let read = |case: &Case| std::fs::read_to_string(case.path(layout::SETTINGS)).ok();
        let stage = |settings: &'static str| {
            let made = || Ok::<_, PredictError>(Produced::default());
            Stage::new("mesh", 1, folder.path(), &settings).run(false, made).unwrap();
        };
        let refused = |job: &dyn Fn()| {
            let before = Before::of(&case);
            std::fs::write(case.path(layout::SETTINGS), "new").unwrap();
            job();
            before.put_back_where_nothing_is_new();
            read(&case)
        };
        assert_eq!(refused(&|| ()), None, "there were none");
        stage("old");
        std::fs::write(case.path(layout::SETTINGS), "old").unwrap();
        // A stage that is skipped is of the old settings, too.
        assert_eq!(refused(&|| stage("old")).unwrap(), "old");
        assert_eq!(refused(&|| stage("new")).unwrap(), "new");
        std::fs::write(case.path(layout::SETTINGS), "old").unwrap();
        let answer = || write_whole(&case.path(layout::OUTCOME), b"{}").unwrap();
        assert_eq!(refused(&answer).unwrap(), "new", "an answer is of the settings that it was given with");
    }

    #[test]
    fn a_refused_job_leaves_no_folder_of_its_own_and_no_settings_of_its_own() {
        let all = tempfile::tempdir().unwrap();
        let fresh = all.path().join("fresh");
        refused_in(&fresh);
        assert!(!fresh.exists());
        let users = all.path().join("users");
        std::fs::create_dir(&users).unwrap();
        std::fs::write(users.join("notes.txt"), "mine").unwrap();
        refused_in(&users);
        let left: Vec<_> = std::fs::read_dir(&users).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left, ["notes.txt"]);
        let made = all.path().join("made");
        let patient = Produced { files: vec![("post.nii.gz".to_owned(), vec![1])], ..Produced::default() };
        Stage::new("synth", 1, &made, &"own").run(false, || Ok::<_, PredictError>(patient)).unwrap();
        refused_in(&made);
        assert!(made.join("post.nii.gz").exists(), "what another command made is not the job's");
        let used = all.path().join("used");
        std::fs::create_dir_all(used.join(".stages")).unwrap();
        std::fs::write(used.join(".stages/pose.manifest.json"), "{}").unwrap();
        std::fs::write(used.join(layout::SETTINGS), "old").unwrap();
        refused_in(&used);
        assert_eq!(std::fs::read(used.join(layout::SETTINGS)).unwrap(), b"old");
        assert!(used.join(layout::MNI_FROM_PRE_TEXT).exists(), "a case keeps what is finished");
    }
}
