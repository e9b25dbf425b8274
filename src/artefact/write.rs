//! Whole-file writes and checksums.

use sha2::{Digest, Sha256};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock, RwLockWriteGuard};
use thiserror::Error;

/// A file could not be written; nothing is left under its name.
#[derive(Debug, Error)]
#[error("{}: cannot be written; check that the folder exists, is writable and has space", path.display())]
pub struct WriteError {
    /// The file meant.
    pub path: PathBuf,
    /// What the system said.
    pub source: std::io::Error,
}

/// Held by readers while a file is being written.
static WRITING: RwLock<()> = RwLock::new(());

/// Waits for the files that are being written and lets no other begin while the answer is kept: a program that ends now
/// leaves nothing half-written.
pub fn no_more_writes() -> RwLockWriteGuard<'static, ()> {
    WRITING.write().unwrap_or_else(PoisonError::into_inner)
}

/// Whether a file could be written at `path`, before the work that it is to hold: the folders that are there take a file. What
/// is not there yet is not made.
///
/// # Errors
/// [`WriteError`] when the system would refuse.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let refuse = |source| WriteError { path: path.to_path_buf(), source };
    if path.is_dir() {
        return Err(refuse(std::io::ErrorKind::IsADirectory.into()));
    }
    let folder = |path: &Path| {
        let parent = path.parent().unwrap_or(Path::new(""));
        if parent.as_os_str().is_empty() { PathBuf::from(".") } else { parent.to_path_buf() }
    };
    let mut there = folder(path);
    while !there.exists() && there != Path::new(".") {
        there = folder(&there);
    }
    if !there.is_dir() {
        return Err(refuse(std::io::ErrorKind::NotADirectory.into()));
    }
    let trial = there.join(format!(".hgm-{}.part", std::process::id()));
    std::fs::File::create(&trial).map_err(refuse)?;
    std::fs::remove_file(&trial).map_err(refuse)
}

/// Writes `bytes` so that `path` holds either all of them or what it held before: to `NAME.part`, flushed, renamed.
/// Folders are made as needed.
///
/// # Errors
/// [`WriteError`] when the system refuses.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let refuse = |source| WriteError { path: path.to_path_buf(), source };
    let _writing = WRITING.read().unwrap_or_else(PoisonError::into_inner);
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(refuse)?;
    }
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let written = || {
        let mut file = std::fs::File::create(&part)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        std::fs::rename(&part, path)
    };
    written().map_err(|source| {
        // A full disk stays full, and half a file is nobody's.
        std::fs::remove_file(&part).ok();
        refuse(source)
    })
}

/// SHA-256 in lower-case hexadecimal.
pub fn sha256_hex(bytes: &[u8]) -> String {
    let digits = b"0123456789abcdef";
    let hex = |byte: &u8| [digits[usize::from(byte >> 4)], digits[usize::from(byte & 15)]].map(char::from);
    Sha256::digest(bytes).iter().flat_map(hex).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_whole_and_leaves_no_part() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/down/x.bin");
        write_whole(&path, b"first").unwrap();
        write_whole(&path, b"second").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn what_cannot_be_written_leaves_no_part() {
        let folder = tempfile::tempdir().unwrap();
        let taken = folder.path().join("a-folder");
        std::fs::create_dir(&taken).unwrap();
        let error = write_whole(&taken, b"bytes").unwrap_err();
        assert!(error.to_string().contains("a-folder: cannot be written"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_place_that_takes_no_file_is_known_before_there_is_one_and_nothing_is_left_there() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("file"), "").unwrap();
        assert!(check_writable(&at("deep/down/x.bin")).is_ok() && check_writable(&at("file")).is_ok());
        for wrong in ["file/x.bin", "file/deep/x.bin", ""] {
            assert!(check_writable(&at(wrong)).unwrap_err().to_string().contains("cannot be written"), "{wrong}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn who_holds_the_writes_sees_no_file_half_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bin");
        let bytes = vec![7u8; 1 << 20];
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| (0..20).for_each(|_| write_whole(&path, &bytes).unwrap()));
            while !writer.is_finished() {
                let held = no_more_writes();
                assert!(!folder.path().join("x.bin.part").exists());
                drop(held);
                std::thread::yield_now();
            }
        });
        assert_eq!(std::fs::metadata(&path).unwrap().len(), bytes.len() as u64);
    }

    #[test]
    fn sha256_is_the_standard_one() {
        // FIPS 180-2, appendix B.1.
        assert_eq!(sha256_hex(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }
}
