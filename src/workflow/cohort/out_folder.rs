//! Where a cohort's derivatives may go: not over a data set of scans.

use super::Dataset;
use crate::workflow::error::CohortError;
use serde_json::Value;
use std::path::Path;

const DESCRIPTION: &str = "dataset_description.json";

/// Refuses a folder whose description and README would be replaced by those of the derivatives. Comes before anything is written.
///
/// # Errors
/// [`CohortError::RawDataSet`] for the data set itself, by whatever path, and for any other that is not of derivatives.
pub(super) fn may_hold_derivatives(dataset: &Dataset, out: &Path) -> Result<(), CohortError> {
    let same = |a: &Path, b: &Path| a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b);
    if same(out, &dataset.folder) || describes_scans(out) {
        let instead = dataset.folder.join("derivatives/hgm");
        return Err(CohortError::RawDataSet { out: out.to_path_buf(), instead });
    }
    Ok(())
}

/// Whether a data set is described here as another thing than derivatives: where no type is named it is raw (BIDS 1.10), and what
/// cannot be read is not of this program.
fn describes_scans(folder: &Path) -> bool {
    let Ok(bytes) = std::fs::read(folder.join(DESCRIPTION)) else { return false };
    let kind = serde_json::from_slice(&bytes).ok().and_then(|said: Value| Some(said.get("DatasetType")?.clone()));
    kind != Some(Value::from("derivative"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::cohort::begin;
    use crate::workflow::error::{ErrorKind, WorkflowError};

    #[test]
    fn derivatives_replace_no_description_of_a_data_set_of_scans() {
        let all = tempfile::tempdir().unwrap();
        let raw = all.path().join("study");
        std::fs::create_dir_all(raw.join("sub-01")).unwrap();
        let dataset = Dataset::open(&raw, &[]).unwrap();
        let other = all.path().join("other");
        std::fs::create_dir(&other).unwrap();
        // The data set itself, also where nothing describes it, and another one.
        for out in [raw.clone(), raw.join("sub-01/.."), other.clone()] {
            for described in ["{}", r#"{"Name": "two", "DatasetType": "raw"}"#, "not JSON"] {
                std::fs::write(out.join(DESCRIPTION), described).unwrap();
                let refused = WorkflowError::from(begin(&dataset, &out).unwrap_err());
                assert!(refused.kind() == ErrorKind::Rejected && refused.to_string().contains("derivatives/hgm"));
                assert_eq!(std::fs::read_to_string(out.join(DESCRIPTION)).unwrap(), described);
                assert!(!out.join("README").exists());
            }
            std::fs::remove_file(out.join(DESCRIPTION)).unwrap();
        }
        assert!(begin(&dataset, &raw).is_err() && std::fs::read_dir(&raw).unwrap().count() == 1);
        // A folder of nobody's, one of derivatives, and a second run.
        for out in [other, raw.join("derivatives/hgm"), raw.join("derivatives/hgm")] {
            begin(&dataset, &out).unwrap();
            assert!(out.join("README").exists());
        }
    }
}
