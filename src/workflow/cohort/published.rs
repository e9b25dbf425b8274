//! A subject's files under BIDS names: those of its present case, and none that an earlier one has left.

use crate::artefact::write_whole;
use crate::layout;
use crate::report::cohort::Status;
use crate::report::derivatives::{RawScan, published};
use crate::report::hand_off::CaseFile;
use crate::workflow::error::{CaseError, WorkflowError};
use crate::workflow::{Case, Subject};
use std::path::{Path, PathBuf};

/// Where a subject's files lie in the derivatives.
#[derive(Debug)]
pub(super) struct Published<'a> {
    /// Top of the derivatives.
    pub out: &'a Path,
    /// The subject's page there.
    pub page: String,
    /// The scans that they are made from.
    pub scans: &'a [&'a RawScan],
}

impl Published<'_> {
    /// Writes what there is now and takes away what was there before and is no more.
    pub fn replace(&self, files: &[CaseFile]) -> Result<(), WorkflowError> {
        for (file, bytes) in files {
            write_whole(&self.out.join(file), bytes)?;
        }
        let before = self.scans.iter().flat_map(|scan| published(self.out, scan, self.scans.len()));
        for left in before.chain([self.page.clone()]).filter(|left| files.iter().all(|(file, _)| file != left)) {
            let path = self.out.join(left);
            std::fs::remove_file(&path).ok();
            // Folders that nothing else is in.
            path.ancestors().skip(1).take_while(|folder| *folder != self.out).for_each(|folder| {
                std::fs::remove_dir(folder).ok();
            });
        }
        Ok(())
    }

    /// After a job that did not end well: where the scans gave an answer of their own, that has its page and nothing else; where the
    /// case that was published still stands, so do its files; of a case that stands no more there are none.
    pub fn after(&self, case: &Case, error: &WorkflowError) -> Result<(), WorkflowError> {
        if error.answer().is_some() {
            return self.replace(&[(self.page.clone(), case.read(layout::PAGE)?)]);
        }
        // Another job's, or none that was ever here.
        let not_ours =
            matches!(error, WorkflowError::Case(CaseError::Held { .. })) || case.subject() != Some(self.subject());
        if not_ours || case.check_outcome().is_ok() { Ok(()) } else { self.replace(&[]) }
    }

    fn subject(&self) -> Subject {
        if self.scans.len() == 1 { Subject::Plan } else { Subject::Patient }
    }
}

/// A subject's page: one that failed shows none, and a gate may have stopped it before there was one.
pub(super) fn page_of(out: &Path, called: &str, status: &Status) -> Option<PathBuf> {
    Some(out.join(format!("{called}.html"))).filter(|page| status.has_page() && page.exists())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::derivatives::generated_by;
    use crate::resect::PairError;
    use crate::workflow::error::PredictError;
    use crate::workflow::fresh::tests::answered;
    use serde_json::json;

    const ANAT: &str = "sub-01/ses-preop/anat/sub-01_ses-preop_";

    fn scans() -> [RawScan; 2] {
        ["preop", "postop"].map(|s| RawScan(format!("sub-01/ses-{s}/anat/sub-01_ses-{s}_run-2_T1w.nii.gz")))
    }

    /// An image with a sidecar that says who made it from how many scans.
    fn image(name: &str, sources: usize) -> [CaseFile; 2] {
        let sidecar = json!({ "GeneratedBy": generated_by(), "RawSources": vec!["bids:raw:scan"; sources] });
        let file = |end: &str, text: String| (format!("{ANAT}{name}.{end}"), text.into_bytes());
        [file("nii.gz", "voxels".to_owned()), file("json", sidecar.to_string())]
    }

    #[test]
    fn what_a_case_has_no_more_goes_and_what_is_anothers_stays() {
        let out = tempfile::tempdir().unwrap();
        let [pre, post] = scans();
        let page = "sub-01.html".to_owned();
        let there = Published { out: out.path(), page, scans: &[&pre, &post] };
        let swept = image("run-2_from-T1w_to-deformed_desc-sample03_mode-points_xfm", 2);
        let other_scan = image("run-1_space-MNI152NLin2009aSym_desc-brain_mask", 2);
        let dseg = image("run-2_dseg", 2);
        there.replace(&[swept.clone(), other_scan.clone(), dseg.clone()].concat()).unwrap();
        // A prediction's, another tool's, a name that the layout does not have, and an image without a sidecar.
        let predicted = image("run-2_from-T1w_to-deformed_desc-predicted_mode-points_xfm", 1);
        let mut foreign = image("run-2_space-MNI152NLin2009aSym_dseg", 2);
        foreign[1].1 = br#"{"GeneratedBy": [{"Name": "another"}], "RawSources": ["a", "b"]}"#.to_vec();
        let [own, bare] = [image("run-2_desc-mine_roi", 2), image("run-3_dseg", 2)];
        let kept = [&predicted[..], &foreign, &own, &bare[..1]].concat();
        for (file, bytes) in &kept {
            write_whole(&out.path().join(file), bytes).unwrap();
        }
        there.replace(&dseg).unwrap();
        let is = |(file, _): &CaseFile| out.path().join(file).exists();
        assert!(dseg.iter().all(is) && kept.iter().all(is));
        assert!(!swept.iter().chain(&other_scan).any(is));
    }

    #[test]
    fn an_answer_of_the_scans_and_a_case_that_stands_no_more_leave_nothing_published() {
        let out = tempfile::tempdir().unwrap();
        let [pre, post] = scans();
        let page = "sub-01.html".to_owned();
        let there = Published { out: out.path(), page: page.clone(), scans: &[&pre, &post] };
        let case = answered(&out.path().join("sub-01/hgm"), &["sample-03"]);
        let files = [image("run-2_dseg", 2).to_vec(), vec![(page, b"page".to_vec())]].concat();
        let there_are = || files.iter().filter(|(file, _)| out.path().join(file).exists()).count();
        there.replace(&files).unwrap();
        let refused = WorkflowError::from(PredictError::NoPlan);
        there.after(&case, &refused).unwrap();
        assert_eq!(there_are(), 3, "the case was left as it was");
        write_whole(&case.path(layout::PAGE), b"answer").unwrap();
        there.after(&case, &WorkflowError::Pair(PairError::NotOnePerson { folds: 0.4 })).unwrap();
        assert_eq!((there_are(), std::fs::read(out.path().join("sub-01.html")).unwrap()), (1, b"answer".to_vec()));
        there.replace(&files).unwrap();
        write_whole(&case.path(layout::SETTINGS), b"seed = 1").unwrap();
        let held = CaseError::Held { folder: case.folder().to_path_buf(), holder: String::new() };
        there.after(&case, &held.into()).unwrap();
        assert_eq!(there_are(), 3, "another job is at work");
        there.after(&case, &refused).unwrap();
        assert_eq!(there_are(), 0);
        assert!(!out.path().join("sub-01/ses-preop").exists() && case.path(layout::OUTCOME).exists());
    }
}
