//! Files that the user names.

use super::error::InputError;
use std::path::Path;

/// A file the user named, whole.
///
/// # Errors
/// [`InputError`] with the file's name and what to do.
pub fn read_input(path: &Path) -> Result<Vec<u8>, InputError> {
    if path.is_dir() {
        return Err(InputError::Folder { path: path.to_path_buf() });
    }
    std::fs::read(path).map_err(|source| InputError::Unreadable { path: path.to_path_buf(), source })
}

/// A text file the user named.
///
/// # Errors
/// As [`read_input`]; also when it is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, InputError> {
    String::from_utf8(read_input(path)?).map_err(|_| InputError::NotText { path: path.to_path_buf() })
}

/// The last part of a path: what messages and manifests may say of a patient's file.
pub fn shown(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}
