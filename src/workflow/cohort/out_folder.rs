//! Where a cohort's derivatives and cases may go: not over a data set of scans, nor over another program's files.

use super::Dataset;
use crate::workflow::error::CohortError;
use serde_json::Value;
use std::path::Path;

const DESCRIPTION: &str = "dataset_description.json";

/// Refuses a folder whose description and README would be replaced by those of the derivatives. Comes before anything is written.
///
/// # Errors
/// [`CohortError::RawDataSet`] for the data set itself, by whatever path, and for any other that is not of derivatives;
/// [`CohortError::OthersDerivatives`] for those that hgm has not made.
pub(super) fn may_hold_derivatives(dataset: &Dataset, out: &Path) -> Result<(), CohortError> {
    let (out_folder, instead) = (out.to_path_buf(), dataset.folder.join("derivatives/hgm"));
    match holds(dataset, out) {
        Holds::Scans => Err(CohortError::RawDataSet { out: out_folder, instead }),
        Holds::Others => Err(CohortError::OthersDerivatives { out: out_folder, instead }),
        Holds::Ours => Ok(()),
    }
}

/// The same, and a folder of cases among another's files. The group level only reads cases, and does not ask this.
///
/// # Errors
/// As [`may_hold_derivatives`]; [`CohortError::OthersCases`] for a data set of scans or another program's files where the cases go.
pub(super) fn may_hold_cases(dataset: &Dataset, out: &Path, cases: &Path) -> Result<(), CohortError> {
    may_hold_derivatives(dataset, out)?;
    match holds(dataset, cases) {
        Holds::Scans | Holds::Others => Err(CohortError::OthersCases { cases: cases.to_path_buf() }),
        Holds::Ours => Ok(()),
    }
}

/// Whose files a folder holds.
#[derive(Debug, PartialEq, Eq)]
enum Holds {
    /// A data set of scans.
    Scans,
    /// Another program's derivatives.
    Others,
    /// Those of hgm, or nobody's.
    Ours,
}

/// By its description: where no type is named it is raw (BIDS 1.10), and what cannot be read is not of this program.
fn holds(dataset: &Dataset, folder: &Path) -> Holds {
    let same = |a: &Path, b: &Path| a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b);
    if same(folder, &dataset.folder) {
        return Holds::Scans;
    }
    let Ok(bytes) = std::fs::read(folder.join(DESCRIPTION)) else { return Holds::Ours };
    let said: Value = serde_json::from_slice(&bytes).unwrap_or_default();
    if said["DatasetType"] != "derivative" {
        return Holds::Scans;
    }
    let makers = said["GeneratedBy"].as_array();
    if makers.is_some_and(|makers| makers.iter().any(|maker| maker["Name"] == "hgm")) {
        Holds::Ours
    } else {
        Holds::Others
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::cohort::begin;
    use crate::workflow::error::{ErrorKind, WorkflowError};
    use std::path::PathBuf;

    /// A data set of scans without any.
    fn study() -> (tempfile::TempDir, PathBuf, Dataset) {
        let all = tempfile::tempdir().unwrap();
        let raw = all.path().join("study");
        std::fs::create_dir_all(raw.join("sub-01")).unwrap();
        let dataset = Dataset::open(&raw, &[]).unwrap();
        (all, raw, dataset)
    }

    #[test]
    fn derivatives_replace_no_description_of_a_data_set_of_scans() {
        let (all, raw, dataset) = study();
        let other = all.path().join("other");
        std::fs::create_dir(&other).unwrap();
        // The data set itself, also where nothing describes it, and another one.
        for out in [raw.clone(), raw.join("sub-01/.."), other.clone()] {
            for described in ["{}", r#"{"Name": "two", "DatasetType": "raw"}"#, "not JSON"] {
                std::fs::write(out.join(DESCRIPTION), described).unwrap();
                let refused = WorkflowError::from(begin(&dataset, &out, &out).unwrap_err());
                assert!(refused.kind() == ErrorKind::Rejected && refused.to_string().contains("derivatives/hgm"));
                assert_eq!(std::fs::read_to_string(out.join(DESCRIPTION)).unwrap(), described);
                assert!(!out.join("README").exists());
            }
            std::fs::remove_file(out.join(DESCRIPTION)).unwrap();
        }
        assert!(begin(&dataset, &raw, &raw).is_err() && std::fs::read_dir(&raw).unwrap().count() == 1);
        // A folder of nobody's, one of derivatives, and a second run.
        for out in [other, raw.join("derivatives/hgm"), raw.join("derivatives/hgm")] {
            begin(&dataset, &out, &out).unwrap();
            assert!(out.join("README").exists());
        }
    }

    #[test]
    fn another_programs_derivatives_are_left_alone_and_cases_go_into_nobody_elses_folder() {
        let (all, raw, dataset) = study();
        let [others, out] = ["derivatives/smriprep", "derivatives/hgm"].map(|name| raw.join(name));
        std::fs::create_dir_all(&others).unwrap();
        for makers in ["", r#", "GeneratedBy": [{"Name": "sMRIPrep"}]"#] {
            let described = format!(r#"{{"Name": "a", "DatasetType": "derivative"{makers}}}"#);
            std::fs::write(others.join(DESCRIPTION), &described).unwrap();
            let refused = begin(&dataset, &others, &others).unwrap_err();
            assert!(matches!(&refused, CohortError::OthersDerivatives { .. }), "{refused}");
            assert_eq!(std::fs::read_to_string(others.join(DESCRIPTION)).unwrap(), described);
            assert!(!others.join("README").exists());
        }
        for cases in [&raw, &others] {
            let refused = begin(&dataset, &out, cases).unwrap_err();
            assert!(matches!(&refused, CohortError::OthersCases { .. }) && !out.exists(), "{refused}");
        }
        begin(&dataset, &out, &all.path().join("work")).unwrap();
        // Its own of an earlier run are its own.
        begin(&dataset, &out, &out).unwrap();
    }
}
