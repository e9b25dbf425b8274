//! Whole-file writes and checksums.

use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
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
        return Err(refuse(ErrorKind::IsADirectory.into()));
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
        return Err(refuse(ErrorKind::NotADirectory.into()));
    }
    let (_, trial) = new_part(&there.join(".hgm")).map_err(refuse)?;
    std::fs::remove_file(&trial).map_err(refuse)
}

/// A file of this call's own beside `path`, `NAME.PROCESS-CALL.part`, held by a lock as long as it is open: several processes may write
/// one name at once, and whoever finds such a file can tell whether somebody is still at it.
fn new_part(path: &Path) -> std::io::Result<(File, PathBuf)> {
    static CALLS: AtomicU64 = AtomicU64::new(0);
    loop {
        let call = CALLS.fetch_add(1, Ordering::Relaxed);
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".{}-{call}.part", std::process::id()));
        match File::create_new(&name) {
            Ok(file) => {
                // Where the disk knows no locks, nobody takes the file away either.
                file.try_lock().ok();
                return Ok((file, name.into()));
            }
            // A process of the same number on another machine, or one that was killed.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

/// Takes away what a process that was killed has left of this name: such files are held by nobody.
fn clear_left_parts(path: &Path) {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else { return };
    let name = name.to_string_lossy();
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let is_part = |found: &str| {
        let own = found.strip_prefix(&*name).and_then(|own| own.strip_suffix(".part"));
        let number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        let numbers = own.and_then(|own| own.strip_prefix('.')).and_then(|own| own.split_once('-'));
        own == Some("") || numbers.is_some_and(|(process, call)| number(process) && number(call))
    };
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let left = || File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok());
        if is_part(&entry.file_name().to_string_lossy()) && left() {
            std::fs::remove_file(entry.path()).ok();
        }
    }
}

/// Writes `bytes` so that `path` holds either all of them or what it held before, whoever else writes it: to a file of its own beside
/// it, flushed, renamed. Folders are made as needed.
///
/// # Errors
/// [`WriteError`] when the system refuses.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    /// Another process may take a file away before it is held; not again and again.
    const TRIES: usize = 5;
    let refuse = |source| WriteError { path: path.to_path_buf(), source };
    let _writing = WRITING.read().unwrap_or_else(PoisonError::into_inner);
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(refuse)?;
    }
    clear_left_parts(path);
    let written = || {
        let (file, part) = new_part(path)?;
        let whole = (&file).write_all(bytes).and_then(|()| file.sync_all()).and_then(|()| std::fs::rename(&part, path));
        whole.inspect_err(|_| {
            // A full disk stays full, and half a file is nobody's.
            std::fs::remove_file(&part).ok();
        })
    };
    let mut ended = written();
    for _ in 1..TRIES {
        if !ended.as_ref().is_err_and(|error| error.kind() == ErrorKind::NotFound) {
            break;
        }
        ended = written();
    }
    ended.map_err(refuse)
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
    fn many_may_write_one_name_at_once_and_each_file_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bin");
        std::thread::scope(|scope| {
            for byte in 0..8u8 {
                let bytes = vec![byte; 1 << 16];
                let path = &path;
                scope.spawn(move || (0..20).for_each(|_| write_whole(path, &bytes).unwrap()));
            }
        });
        let bytes = std::fs::read(&path).unwrap();
        assert!(bytes.len() == 1 << 16 && bytes.iter().all(|byte| *byte == bytes[0]));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_a_killed_process_has_left_of_a_name_goes_with_the_next_write_of_it_and_what_is_held_stays() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["x.bin.part", "x.bin.17-3.part", "x.bin.vtu.17-3.part", "x.bin.mine.part", "y.bin.17-3.part"] {
            std::fs::write(at(name), "half").unwrap();
        }
        let (_held, part) = new_part(&at("x.bin")).unwrap();
        write_whole(&at("x.bin"), b"whole").unwrap();
        let left = |name: &str| at(name).exists();
        assert!(part.exists() && !left("x.bin.part") && !left("x.bin.17-3.part"));
        assert!(left("x.bin.vtu.17-3.part") && left("x.bin.mine.part") && left("y.bin.17-3.part"));
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
                assert!(std::fs::read_dir(folder.path()).unwrap().all(|file| file.unwrap().file_name() == "x.bin"));
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
