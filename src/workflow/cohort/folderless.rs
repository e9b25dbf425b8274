//! Messages without the folders of this machine: derivatives are handed on.

use crate::workflow::user_file::shown;
use std::path::{Path, PathBuf};

/// A message in which what lies in one of these folders is named from there, and the folder itself by its last name alone. Each
/// is looked for as it was given, as it is written plainly and as it is from the root, the longest first: one may lie in another.
pub(super) fn without_folders(message: &str, folders: &[&Path]) -> String {
    let written = |folder: &&Path| {
        let plain: PathBuf = folder.components().collect();
        let ways = [Some(folder.to_path_buf()), Some(plain), folder.canonicalize().ok()];
        // A name of its own has every folder that is worth hiding.
        ways.into_iter().flatten().filter(|way| way.file_name().is_some()).collect::<Vec<_>>()
    };
    let mut ways: Vec<PathBuf> = folders.iter().flat_map(written).collect();
    ways.sort_by_key(|way| std::cmp::Reverse(way.as_os_str().len()));
    // A full stop ends a sentence, or a name goes on behind it.
    let ends = |after: &str| !after.trim_start_matches('.').starts_with(is_of_name);
    ways.iter().fold(message.to_owned(), |said, way| {
        let below = replaced(&said, &way.join("").display().to_string(), "", |after| after.starts_with(is_of_name));
        replaced(&below, way.display().to_string().trim_end_matches('/'), &shown(way), ends)
    })
}

/// A text with `by` for `name` wherever that begins a path and `ends` takes what is after it.
fn replaced(text: &str, name: &str, by: &str, ends: impl Fn(&str) -> bool) -> String {
    let (mut said, mut rest) = (String::new(), text);
    while let Some(at) = rest.find(name) {
        let (before, after) = (&rest[..at], &rest[at + name.len()..]);
        let begins =
            !before.chars().next_back().or(said.chars().next_back()).is_some_and(|c| is_of_name(c) || c == '/');
        said += before;
        said += if begins && ends(after) { by } else { name };
        rest = after;
    }
    said + rest
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || ['.', '-', '_'].contains(&c)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn without(message: &str, folders: &[&str]) -> String {
        without_folders(message, &folders.iter().map(Path::new).collect::<Vec<_>>())
    }

    #[test]
    fn a_message_names_files_from_the_folder_they_lie_in_however_that_was_written() {
        for (file, folder) in [
            ("/home/ann/study/sub-01/anat/x.nii", "/home/ann/study"),
            ("/home/ann/study/sub-01/anat/x.nii", "/home/ann/study/"),
            ("/home/ann/study//sub-01/anat/x.nii", "/home/ann/study//"),
            ("/home/ann/study/sub-01/anat/x.nii", "/home/ann/./study"),
            ("study/sub-01/anat/x.nii", "study"),
            ("./study/sub-01/anat/x.nii", "./study/"),
        ] {
            assert_eq!(
                without(&format!("{file}: is a folder"), &[folder]),
                "sub-01/anat/x.nii: is a folder",
                "{folder}"
            );
        }
    }

    #[test]
    fn of_folders_in_one_another_the_nearest_counts_and_the_folder_itself_keeps_its_last_name() {
        let folders = ["/home/ann/study/", "/home/ann/study/derivatives/plans", "/scratch/cases/"];
        let said = "/home/ann/study/derivatives/plans: none; see `/scratch/cases/sub-01/hgm`, /home/ann/study/sub-01/x.nii, /scratch/cases.";
        assert_eq!(without(said, &folders), "plans: none; see `sub-01/hgm`, sub-01/x.nii, cases.");
        assert_eq!(without("/scratch/cases.old", &folders), "/scratch/cases.old");
    }

    #[test]
    fn names_that_only_hold_a_folders_name_stay() {
        assert_eq!(without("data/x.nii in beta/a/y, a-b", &["a", ".", "/"]), "data/x.nii in beta/a/y, a-b");
        assert_eq!(without("a/x.nii and ../a/y", &["a"]), "x.nii and ../a/y");
    }

    #[test]
    fn a_folder_is_known_from_the_root_as_well() {
        let all = tempfile::tempdir().unwrap();
        let root = all.path().canonicalize().unwrap();
        std::fs::create_dir_all(root.join("a/b")).unwrap();
        for way in ["a", "a/b/..", "a/b/../../a"] {
            assert_eq!(without_folders(&format!("{}/a/x", root.display()), &[&root.join(way)]), "x", "{way}");
        }
    }
}
