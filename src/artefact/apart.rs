//! What a job writes lies apart from what it is made of: a result that replaces its own input cannot be made again.

use std::path::{Component, Path, PathBuf};
use thiserror::Error;

/// Two files of a job are one.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum ApartError {
    #[error(
        "{}: the result is made of it, and {} would be written over it; give the result another name, or copy the input elsewhere",
        input.display(), output.display()
    )]
    OverInput { input: PathBuf, output: PathBuf },
    #[error("{} and {}: two results would be one file; give one of them another name", first.display(), second.display())]
    OneFile { first: PathBuf, second: PathBuf },
}

/// Refuses results that would replace what they are made of, or each other, by whatever path. Comes before anything is written.
///
/// # Errors
/// [`ApartError`] with the first two that are one file.
pub fn check_apart<O: AsRef<Path>, I: AsRef<Path>>(
    outputs: impl IntoIterator<Item = O>,
    inputs: impl IntoIterator<Item = I>,
) -> Result<(), ApartError> {
    let both = |path: &Path| [place(path), named(path)];
    let inputs: Vec<([PathBuf; 2], I)> = inputs.into_iter().map(|input| (both(input.as_ref()), input)).collect();
    let mut written: Vec<(PathBuf, O)> = Vec::new();
    for output in outputs {
        let (there, owned) = (both(output.as_ref()), output.as_ref().to_path_buf());
        if let Some((_, input)) = inputs.iter().find(|(input, _)| there.iter().any(|there| input.contains(there))) {
            return Err(ApartError::OverInput { input: input.as_ref().to_path_buf(), output: owned });
        }
        // A result replaces a link that has its name, and not what that leads to: two links to one object are two results.
        let [_, own_name] = there;
        if let Some((_, first)) = written.iter().find(|(first, _)| *first == own_name) {
            return Err(ApartError::OneFile { first: first.as_ref().to_path_buf(), second: owned });
        }
        written.push((own_name, output));
    }
    Ok(())
}

/// The moments of a series `NAME-0000.vtu`, `NAME-0001.vtu` ... beside `NAME.vtu` or `NAME.pvd` that are called as one of these files
/// is: how many moments there will be is not known before.
pub fn moments_called_as<'a>(output: &Path, files: impl IntoIterator<Item = &'a Path>) -> Vec<PathBuf> {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let is_moment = |name: &String| {
        let number = name.strip_prefix(&*stem).and_then(|rest| rest.strip_prefix('-')?.strip_suffix(".vtu"));
        number.is_some_and(|n| n.len() >= 4 && n.bytes().all(|b| b.is_ascii_digit()))
    };
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    // A link has two names.
    let names = files.into_iter().flat_map(|file| [name(file), name(&place(file))]).flatten();
    let mut moments: Vec<PathBuf> = names.filter(is_moment).map(|name| output.with_file_name(name)).collect();
    moments.sort();
    moments.dedup();
    moments
}

/// What a path names: links and `..` followed in its folders, its own name kept.
pub fn named(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    match (absolute.parent(), absolute.file_name()) {
        (Some(folder), Some(name)) => place(folder).join(name),
        _ => place(path),
    }
}

/// Where a path leads: links and `..` followed as far as there is something, then as it is named.
pub fn place(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut place = PathBuf::new();
    for part in absolute.components() {
        if part == Component::ParentDir {
            place.pop();
            continue;
        }
        place.push(part);
        place = place.canonicalize().unwrap_or(place);
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_over_an_input_or_over_another_result_is_refused_by_whatever_path() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("deep")).unwrap();
        std::fs::write(at("scan"), "").unwrap();
        for over in ["scan", "./scan", "deep/../scan", "not-there/../scan"] {
            let refused = check_apart([at(over)], [at("other"), at("scan")]).unwrap_err();
            assert_eq!(refused, ApartError::OverInput { input: at("scan"), output: at(over) });
            assert!(refused.to_string().contains("another name"), "{refused}");
        }
        for twice in ["new", "./new", "deep/../new"] {
            let refused = check_apart([at("new"), at(twice)], [at("scan")]).unwrap_err();
            assert_eq!(refused, ApartError::OneFile { first: at("new"), second: at(twice) });
        }
        let none: [&Path; 0] = [];
        assert_eq!(check_apart([at("new"), at("deep/new"), at("deep/scan")], [at("scan"), at("scan")]), Ok(()));
        assert_eq!(check_apart([at("scan")], none), Ok(()));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_what_it_leads_to_on_either_side_and_in_the_folders_above() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("deep")).unwrap();
        std::fs::write(at("scan"), "").unwrap();
        symlink(at("scan"), at("link")).unwrap();
        symlink(at("deep"), at("door")).unwrap();
        for (output, input) in [("link", "scan"), ("scan", "link"), ("door/../scan", "scan")] {
            assert!(check_apart([at(output)], [at(input)]).is_err(), "{output} {input}");
        }
        let none: [&Path; 0] = [];
        assert!(check_apart([at("door/new"), at("deep/new")], none).is_err());
        // As in a data set whose large files are links to where they are kept.
        symlink(at("scan"), at("other")).unwrap();
        assert_eq!(check_apart([at("link"), at("other")], none), Ok(()));
        assert!(check_apart([at("link")], [at("link")]).is_err());
    }

    #[test]
    fn a_file_is_a_moment_by_the_series_name_and_four_digits_or_more() {
        let files = ["a/m-0001.vtu", "b/m-00010.vtu", "m-1.vtu", "m.vtu", "n-0001.vtu", "m-000x.vtu"].map(Path::new);
        let moments = moments_called_as(Path::new("out/m.pvd"), files);
        assert_eq!(moments, ["out/m-0001.vtu", "out/m-00010.vtu"].map(PathBuf::from));
    }
}
