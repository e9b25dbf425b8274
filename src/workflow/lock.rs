//! One job at a time in a folder; the parts of a sweep may work side by side.

use super::error::{CaseError, WorkflowError};
use crate::artefact::WriteError;
use crate::layout;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Held while a job works on its folder. The system lets it go when the program ends, however it ends.
#[derive(Debug)]
pub(crate) struct Lock {
    file: File,
    alone: bool,
}

impl Lock {
    /// Takes the folder for one job alone, or together with the other parts of a sweep.
    pub fn take(folder: &Path, alone: bool) -> Result<Self, WorkflowError> {
        let path = folder.join(layout::LOCK);
        let refuse = |source| WriteError { path: path.clone(), source };
        std::fs::create_dir_all(folder).map_err(refuse)?;
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(refuse)?;
        let taken = if alone { file.try_lock() } else { file.try_lock_shared() };
        match taken {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut holder = String::new();
                file.read_to_string(&mut holder).ok();
                return Err(CaseError::Held { folder: folder.to_path_buf(), holder: holder.trim().to_owned() }.into());
            }
            Err(TryLockError::Error(source)) => return Err(refuse(source).into()),
        }
        if alone {
            write_holder(&mut file, &format!("process {}", std::process::id())).map_err(refuse)?;
        }
        Ok(Self { file, alone })
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // The file stays, empty: taking it away could part two jobs that wait for it.
        if self.alone {
            write_holder(&mut self.file, "").ok();
        }
    }
}

fn write_holder(file: &mut File, holder: &str) -> std::io::Result<()> {
    file.set_len(0)?;
    file.seek(SeekFrom::Start(0))?;
    file.write_all(holder.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_job_is_told_who_holds_the_folder_and_parts_work_side_by_side() {
        let folder = tempfile::tempdir().unwrap();
        let lock = Lock::take(folder.path(), true).unwrap();
        let said = Lock::take(folder.path(), false).unwrap_err().to_string();
        assert!(said.contains(&format!("process {}", std::process::id())), "{said}");
        drop(lock);
        assert_eq!(std::fs::read(folder.path().join(layout::LOCK)).unwrap(), b"");
        let parts = [Lock::take(folder.path(), false).unwrap(), Lock::take(folder.path(), false).unwrap()];
        assert!(Lock::take(folder.path(), true).is_err());
        drop(parts);
        assert!(Lock::take(folder.path(), true).is_ok());
    }
}
