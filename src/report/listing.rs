//! What a case folder holds, for the page to link to: the table of [`layout`], with the files that are there.

use crate::layout::{self, Entry, Family, Maker, Space};
use std::collections::BTreeSet;
use std::path::Path;

/// A row of the layout's table with its files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listed {
    /// What it is.
    pub what: &'static str,
    /// The frame its coordinates are in: mm, RAS+.
    pub space: Space,
    /// Below the case folder, in order: one, or the members of a family.
    pub files: Vec<String>,
}

/// The files of a case in the table's order, `made` among them: those that are written with the page. What an earlier page
/// left and this one does not make is not listed, nor is what another job has left, `left_behind`, nor the page itself.
pub fn listing(folder: &Path, made: &BTreeSet<&str>, left_behind: &BTreeSet<String>) -> Vec<Listed> {
    let mut listed: BTreeSet<String> = BTreeSet::new();
    let rows = layout::TABLE.iter().filter(|entry| ![layout::PAGE, layout::LOCK].contains(&entry.path)).map(|entry| {
        let there = |file: &str| match entry.maker {
            Maker::Report if !by_another_command(entry) => made.contains(file),
            _ => !left_behind.contains(file) && folder.join(file).is_file(),
        };
        let mut files = if entry.path.contains('{') {
            members(folder, Family(entry.path), made)
        } else {
            vec![entry.path.to_owned()]
        };
        files.retain(|file| {
            there(file) && is_of(folder, entry, file) && !has_a_row(entry, file) && !listed.contains(file)
        });
        listed.extend(files.iter().cloned());
        Listed { what: entry.what, space: entry.space, files }
    });
    rows.filter(|row| !row.files.is_empty()).collect()
}

/// Written after the page, by `hgm evaluate`.
fn by_another_command(entry: &Entry) -> bool {
    [layout::LANDMARKS_JSON, layout::EVALUATION_JSON].contains(&entry.path)
}

/// The members of a family that are there, or will be.
fn members(folder: &Path, family: Family, made: &BTreeSet<&str>) -> Vec<String> {
    let within = std::fs::read_dir(folder.join(family.folder())).into_iter().flatten().flatten();
    let there = within.map(|entry| format!("{}/{}", family.folder(), entry.file_name().to_string_lossy()));
    let all: BTreeSet<String> = there.chain(made.iter().map(|file| (*file).to_owned())).collect();
    all.into_iter().filter(|file| family.member(file).is_some()).collect()
}

/// Whether a file that a family's pattern fits has a row of its own.
fn has_a_row(entry: &Entry, file: &str) -> bool {
    entry.path != file && layout::TABLE.iter().any(|other| other.path == file)
}

/// States of samples and of predictions are spelt alike: a prediction's has draws beside it.
fn is_of(folder: &Path, entry: &Entry, file: &str) -> bool {
    let predicted = || {
        let state = layout::PREDICTED_STATE.member(file);
        state.is_some_and(|state| folder.join(layout::PREDICTED_DRAWS.of(state)).is_file())
    };
    match entry.maker {
        Maker::Sample => !predicted(),
        Maker::Predict if entry.path == layout::PREDICTED_STATE.0 => predicted(),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artefact::write_whole;

    #[test]
    fn every_file_is_listed_once_under_what_it_is_and_nothing_that_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let sample = layout::SAMPLE_STATE.of("sample-00");
        let head_up = layout::PREDICTED_STATE.of("head-up");
        let stale = layout::BEST_SURFACE.of("margin");
        let draws = layout::PREDICTED_DRAWS.of("head-up");
        for file in [layout::OUTCOME, layout::ESTIMATE_STATE, layout::PAGE, &sample, &head_up, &draws, &stale] {
            write_whole(&folder.path().join(file), b"x").unwrap();
        }
        let pial = layout::BEST_SURFACE.of("pial");
        let made = BTreeSet::from([pial.as_str(), layout::PAGE]);
        let rows = listing(folder.path(), &made, &BTreeSet::new());
        let of = |file: &str| rows.iter().filter(|row| row.files.iter().any(|f| f == file)).collect::<Vec<_>>();
        for file in [layout::OUTCOME, layout::ESTIMATE_STATE, &sample, &head_up, &draws, &pial] {
            assert_eq!(of(file).len(), 1, "{file}");
        }
        for file in [layout::PAGE, layout::REST_MESH, &stale] {
            assert!(of(file).is_empty(), "{file}");
        }
        assert!(of(&sample)[0].what.contains("one sample") && of(&head_up)[0].what.contains("prediction"));
        let left = BTreeSet::from([layout::ESTIMATE_STATE.to_owned()]);
        let fewer: usize = listing(folder.path(), &made, &left).iter().map(|row| row.files.len()).sum();
        assert_eq!(
            fewer + 1,
            rows.iter().map(|row| row.files.len()).sum::<usize>(),
            "what another job has left is not"
        );
    }
}
