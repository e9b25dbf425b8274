//! What a BIDS data set holds: subjects, and of each the scan before and the scan after surgery.

use crate::report::derivatives::RawScan;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What a plan's `label` is called.
const PLANNED: &str = "resection";
/// What stands for no entity at all where one of several scans is chosen.
const NONE: &str = "none";
/// Sessions of the two scans.
const SESSIONS: [&str; 2] = ["ses-preop", "ses-postop"];

/// A data set on disk.
#[derive(Debug)]
pub struct Dataset {
    /// Where it lies.
    pub folder: PathBuf,
    /// `sub-01`, ..., in order.
    pub subjects: Vec<String>,
}

/// A subject's two scans.
#[derive(Clone, Debug)]
pub struct ScanPair {
    /// Before surgery.
    pub pre: RawScan,
    /// After surgery.
    pub post: RawScan,
}

/// A subject's scan before surgery, and what is to be taken.
#[derive(Clone, Debug)]
pub struct ScanAndPlan {
    /// Before surgery.
    pub pre: RawScan,
    /// A mask in its grid.
    pub plan: PathBuf,
}

/// Why a data set cannot be used, or one of its subjects.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum DatasetError {
    #[error("{}: cannot be listed; name the folder of a BIDS data set: {source}", folder.display())]
    Unlistable { folder: PathBuf, source: std::io::Error },
    #[error(
        "{}: no folder sub-*; name the folder of a BIDS data set (the one with dataset_description.json)", folder.display()
    )]
    NoSubjects { folder: PathBuf },
    #[error("{absent} is not in {}; it has {}", folder.display(), subjects.join(", "))]
    Absent { absent: String, folder: PathBuf, subjects: Vec<String> },
    #[error("{folder}: no {stem}_T1w.nii.gz{}{}; add the scan, or leave the subject out", with(entities), but(there))]
    NoScan { folder: String, stem: String, entities: Vec<String>, there: Vec<String> },
    #[error("{folder}: {} scans fit ({}){}", found.len(), found.join(", "), or_none(found))]
    SeveralScans { folder: String, found: Vec<String>, entity: String },
    #[error(
        "{}: no {stem}_label-{PLANNED}_mask.nii.gz{}; draw what is to be taken in the scan's grid, or leave the subject out",
        folder.display(), with(entities)
    )]
    NoPlan { folder: PathBuf, stem: String, entities: Vec<String> },
    #[error("{}: {} plans fit ({})", folder.display(), found.len(), found.join(", "))]
    SeveralPlans { folder: PathBuf, found: Vec<String>, entity: String },
}

fn with(entities: &[String]) -> String {
    if entities.is_empty() { String::new() } else { format!(" with {}", entities.join(", ")) }
}

/// What is there instead.
fn but(there: &[String]) -> String {
    if there.is_empty() { String::new() } else { format!(", only {}", there.join(", ")) }
}

impl Dataset {
    /// Lists the subjects, all of them or those with these labels (with or without `sub-`).
    ///
    /// # Errors
    /// [`DatasetError`] when the folder has no subjects or not one of those asked for.
    pub fn open(folder: &Path, labels: &[String]) -> Result<Self, DatasetError> {
        let here = || folder.to_path_buf();
        let mut subjects = names(folder).map_err(|source| DatasetError::Unlistable { folder: here(), source })?;
        subjects.retain(|name| name.starts_with("sub-") && folder.join(name).is_dir());
        if subjects.is_empty() {
            return Err(DatasetError::NoSubjects { folder: here() });
        }
        let wanted: Vec<String> =
            labels.iter().map(|label| format!("sub-{}", label.strip_prefix("sub-").unwrap_or(label))).collect();
        if let Some(absent) = wanted.iter().find(|name| !subjects.contains(name)) {
            return Err(DatasetError::Absent { absent: absent.clone(), folder: here(), subjects });
        }
        subjects.retain(|name| wanted.is_empty() || wanted.contains(name));
        Ok(Self { folder: folder.to_path_buf(), subjects })
    }

    /// The two scans of a subject; `entities` (such as `run-2`, or `none` for the scan without any) choose where a session has several,
    /// and a session's only scan is taken unless its name says otherwise (`run-1`).
    ///
    /// # Errors
    /// [`DatasetError::NoScan`] or [`DatasetError::SeveralScans`].
    pub fn pair(&self, subject: &str, entities: &[String]) -> Result<ScanPair, DatasetError> {
        let [pre, post] = SESSIONS.map(|session| self.scan(subject, session, entities));
        Ok(ScanPair { pre: pre?, post: post? })
    }

    /// The scan before surgery, and the mask of what is to be taken in the data set `plans`: by BIDS derivatives' names the scan's
    /// own entities, then `label-resection`, then `_mask`. `chosen` are entities that choose where there are several.
    ///
    /// # Errors
    /// As [`Dataset::pair`]; also [`DatasetError::NoPlan`] and [`DatasetError::SeveralPlans`].
    pub fn planned(
        &self,
        subject: &str,
        entities: &[String],
        (plans, chosen): (&Path, &[String]),
    ) -> Result<ScanAndPlan, DatasetError> {
        let pre = self.scan(subject, SESSIONS[0], entities)?;
        let (inside, scan) = pre.0.rsplit_once('/').unwrap_or(("", &pre.0));
        let (folder, stem) = (plans.join(inside), scan.split("_T1w.nii").next().unwrap_or(scan));
        let (begin, label) = (format!("{stem}_"), format!("label-{PLANNED}"));
        let mut found = names(&folder).unwrap_or_default();
        found.retain(|name| {
            let own = name.strip_prefix(&begin).map(|own| own.strip_suffix(".gz").unwrap_or(own));
            let parts: Vec<&str> =
                own.and_then(|own| own.strip_suffix("_mask.nii")).unwrap_or_default().split('_').collect();
            parts.contains(&label.as_str()) && chosen.iter().all(|entity| parts.contains(&entity.as_str()))
        });
        match &found[..] {
            [one] => Ok(ScanAndPlan { plan: folder.join(one), pre }),
            [] => Err(DatasetError::NoPlan { folder, stem: stem.to_owned(), entities: chosen.to_vec() }),
            several => {
                let entity = distinguishing(several).trim_end_matches(".nii.gz").to_owned();
                Err(DatasetError::SeveralPlans { folder, found: found.clone(), entity })
            }
        }
    }

    /// The scan of a session; `entities` choose among several, and of the only one it is asked that it does not contradict them.
    fn scan(&self, subject: &str, session: &str, entities: &[String]) -> Result<RawScan, DatasetError> {
        let folder = format!("{subject}/{session}/anat");
        let mut found = names(&self.folder.join(&folder)).unwrap_or_default();
        let begin = format!("{subject}_{session}_");
        let stem = |name: &str| name.strip_suffix(".gz").unwrap_or(name).strip_suffix("_T1w.nii").map(str::to_owned);
        found.retain(|name| name.starts_with(&begin) && stem(name).is_some());
        let (there, alone) = (found.clone(), found.len() == 1);
        found.retain(|name| {
            let stem = stem(name).unwrap_or_default();
            let parts = || stem.split('_');
            // `run-2` must not choose `run-21`.
            let has = |entity: &String| {
                if entity == NONE { is_plain(name) } else { parts().any(|part| part == entity) }
            };
            // A session of one scan need not number it, but `run-1` is not the second run.
            let says_nothing = |entity: &String| {
                let key = entity.split_once('-').map(|(key, _)| key);
                key.is_none_or(|key| parts().all(|part| part.split_once('-').is_none_or(|(own, _)| own != key)))
            };
            entities.iter().all(|entity| has(entity) || alone && says_nothing(entity))
        });
        match &found[..] {
            [one] => Ok(RawScan(format!("{folder}/{one}"))),
            [] => {
                let stem = format!("{subject}_{session}");
                Err(DatasetError::NoScan { folder, stem, entities: entities.to_vec(), there })
            }
            several => {
                let entity = distinguishing(several).to_owned();
                Err(DatasetError::SeveralScans { folder, found: found.clone(), entity })
            }
        }
    }
}

/// An entity that one of the names has and no other, else one that not all have.
fn distinguishing(names: &[String]) -> &str {
    let has = |name: &String, part: &str| name.split('_').any(|own| own == part);
    let with = |part: &str| names.iter().filter(|name| has(name, part)).count();
    let parts = || names.iter().flat_map(|name| name.split('_').skip(2)).filter(|part| part.contains('-'));
    let one = parts().find(|part| with(part) == 1);
    one.or_else(|| parts().find(|part| with(part) < names.len())).unwrap_or(NONE)
}

/// Whether a scan's name has nothing but subject and session before its suffix.
fn is_plain(name: &str) -> bool {
    name.split('_').count() == 3
}

/// What chooses the scan without entities, where it is one of several.
fn or_none(found: &[String]) -> String {
    if found.iter().any(|name| is_plain(name)) {
        format!("; `{NONE}` is the one without an entity")
    } else {
        String::new()
    }
}

/// Names in a folder, in order.
fn names(folder: &Path) -> std::io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dataset(files: &[&str]) -> (tempfile::TempDir, Dataset) {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let dataset = Dataset::open(folder.path(), &[]).unwrap();
        (folder, dataset)
    }

    #[test]
    fn a_pair_is_found_packed_or_not_and_among_other_contrasts() {
        let (_folder, dataset) = dataset(&[
            "sub-01/ses-preop/anat/sub-01_ses-preop_T1w.nii",
            "sub-01/ses-preop/anat/sub-01_ses-preop_T1w.json",
            "sub-01/ses-preop/anat/sub-01_ses-preop_T2w.nii.gz",
            "sub-01/ses-postop/anat/sub-01_ses-postop_ce-gd_T1w.nii.gz",
        ]);
        let pair = dataset.pair("sub-01", &[]).unwrap();
        assert_eq!(pair.pre.0, "sub-01/ses-preop/anat/sub-01_ses-preop_T1w.nii");
        assert_eq!(pair.post.0, "sub-01/ses-postop/anat/sub-01_ses-postop_ce-gd_T1w.nii.gz");
    }

    #[test]
    fn a_missing_or_doubtful_scan_is_named_with_its_remedy() {
        let (_folder, dataset) = dataset(&[
            "sub-01/ses-preop/anat/sub-01_ses-preop_run-2_T1w.nii.gz",
            "sub-01/ses-preop/anat/sub-01_ses-preop_run-21_T1w.nii.gz",
            "sub-01/ses-postop/anat/sub-01_ses-postop_run-2_T1w.nii.gz",
            "sub-02/ses-preop/anat/sub-02_ses-preop_T1w.nii.gz",
        ]);
        let doubtful = dataset.pair("sub-01", &[]).unwrap_err();
        assert!(matches!(&doubtful, DatasetError::SeveralScans { entity, .. } if entity == "run-21"), "{doubtful}");
        assert!(doubtful.to_string().contains("2 scans fit"));
        let chosen = dataset.pair("sub-01", &["run-2".to_owned()]).unwrap();
        assert!(chosen.pre.0.ends_with("run-2_T1w.nii.gz"));
        let missing = dataset.pair("sub-02", &[]).unwrap_err().to_string();
        assert!(missing.contains("sub-02/ses-postop/anat") && missing.contains("leave the subject out"), "{missing}");
    }

    #[test]
    fn what_chooses_among_scans_is_there_and_the_plain_one_can_be_chosen() {
        let (_folder, dataset) = dataset(&[
            "sub-01/ses-preop/anat/sub-01_ses-preop_T1w.nii.gz",
            "sub-01/ses-preop/anat/sub-01_ses-preop_ce-gd_T1w.nii.gz",
            "sub-01/ses-postop/anat/sub-01_ses-postop_T1w.nii.gz",
            "sub-01/ses-postop/anat/sub-01_ses-postop_ce-gd_T1w.nii.gz",
        ]);
        let doubtful = dataset.pair("sub-01", &[]).unwrap_err();
        assert!(matches!(&doubtful, DatasetError::SeveralScans { entity, .. } if entity == "ce-gd"), "{doubtful:?}");
        assert!(doubtful.to_string().contains("`none` is the one without"), "{doubtful}");
        for (chosen, end) in [("ce-gd", "preop_ce-gd_T1w.nii.gz"), ("none", "preop_T1w.nii.gz")] {
            assert!(dataset.pair("sub-01", &[chosen.to_owned()]).unwrap().pre.0.ends_with(end), "{chosen}");
        }
        let crossed = ["a_b_acq-x_run-1_T1w.nii", "a_b_acq-x_run-2_T1w.nii", "a_b_acq-y_run-1_T1w.nii"];
        let crossed = crossed.map(str::to_owned);
        assert_eq!(distinguishing(&crossed), "run-2");
        assert_eq!(distinguishing(&crossed[..2]), "run-1");
    }

    #[test]
    fn an_entity_chooses_among_several_scans_and_the_only_one_is_taken_unless_it_contradicts_it() {
        let (_folder, dataset) = dataset(&[
            "sub-01/ses-preop/anat/sub-01_ses-preop_run-1_T1w.nii.gz",
            "sub-01/ses-preop/anat/sub-01_ses-preop_run-2_T1w.nii.gz",
            "sub-01/ses-postop/anat/sub-01_ses-postop_T1w.nii.gz",
            "sub-02/ses-preop/anat/sub-02_ses-preop_T1w.nii.gz",
            "sub-02/ses-postop/anat/sub-02_ses-postop_acq-mprage_T1w.nii.gz",
            "sub-03/ses-preop/anat/sub-03_ses-preop_run-2_T1w.nii.gz",
            "sub-03/ses-postop/anat/sub-03_ses-postop_run-1_T1w.nii.gz",
        ]);
        let chosen = |subject: &str, entity: &str| dataset.pair(subject, &[entity.to_owned()]);
        let pair = chosen("sub-01", "run-2").unwrap();
        assert!(pair.pre.0.ends_with("preop_run-2_T1w.nii.gz") && pair.post.0.ends_with("postop_T1w.nii.gz"));
        let alone = chosen("sub-02", "run-2").unwrap();
        assert!(alone.pre.0.ends_with("preop_T1w.nii.gz") && alone.post.0.ends_with("postop_acq-mprage_T1w.nii.gz"));
        assert!(chosen("sub-02", "none").is_ok() && dataset.pair("sub-03", &[]).is_ok());
        let other = chosen("sub-03", "run-2").unwrap_err().to_string();
        assert!(other.contains("with run-2, only sub-03_ses-postop_run-1_T1w.nii.gz; add the scan"), "{other}");
        let absent = chosen("sub-01", "run-3").unwrap_err().to_string();
        assert!(absent.contains("with run-3"), "{absent}");
    }

    #[test]
    fn a_plan_has_the_entities_of_its_scan_and_one_of_several_is_chosen() {
        let (folder, dataset) = dataset(&[
            "sub-01/ses-preop/anat/sub-01_ses-preop_run-2_T1w.nii.gz",
            "derivatives/plans/sub-01/ses-preop/anat/sub-01_ses-preop_run-1_label-resection_mask.nii.gz",
            "derivatives/plans/sub-01/ses-preop/anat/sub-01_ses-preop_run-2_label-lesion_mask.nii.gz",
            "derivatives/plans/sub-01/ses-preop/anat/sub-01_ses-preop_run-2_label-resection_desc-wide_mask.nii.gz",
            "sub-02/ses-preop/anat/sub-02_ses-preop_T1w.nii",
            "derivatives/plans/sub-02/ses-preop/anat/sub-02_ses-preop_label-resection_desc-wide_mask.nii",
            "derivatives/plans/sub-02/ses-preop/anat/sub-02_ses-preop_label-resection_mask.nii.gz",
            "sub-03/ses-preop/anat/sub-03_ses-preop_T1w.nii.gz",
        ]);
        let plans = folder.path().join("derivatives/plans");
        let planned = |subject: &str, chosen: &[&str]| {
            let chosen: Vec<String> = chosen.iter().map(|&entity| entity.to_owned()).collect();
            dataset.planned(subject, &[], (&plans, &chosen))
        };
        let found = planned("sub-01", &[]).unwrap();
        assert!(found.plan.ends_with("sub-01_ses-preop_run-2_label-resection_desc-wide_mask.nii.gz"), "{found:?}");
        let doubtful = planned("sub-02", &[]).unwrap_err();
        assert!(matches!(&doubtful, DatasetError::SeveralPlans { entity, .. } if entity == "desc-wide"), "{doubtful}");
        let chosen = planned("sub-02", &["desc-wide"]).unwrap().plan;
        assert!(chosen.ends_with("sub-02_ses-preop_label-resection_desc-wide_mask.nii"), "{chosen:?}");
        let missing = planned("sub-03", &[]).unwrap_err().to_string();
        assert!(
            missing.contains("sub-03_ses-preop_label-resection_mask.nii.gz")
                && missing.contains("leave the subject out")
        );
    }

    #[test]
    fn subjects_are_chosen_by_label_and_an_absent_one_is_refused() {
        let (folder, dataset) = dataset(&["sub-b/x", "sub-a/x", "code/x"]);
        assert_eq!(dataset.subjects, ["sub-a", "sub-b"]);
        let labels = |label: &str| Dataset::open(folder.path(), &[label.to_owned()]);
        assert_eq!(labels("sub-b").unwrap().subjects, ["sub-b"]);
        assert_eq!(labels("b").unwrap().subjects, ["sub-b"]);
        assert!(labels("c").unwrap_err().to_string().contains("sub-c is not in"));
    }
}
