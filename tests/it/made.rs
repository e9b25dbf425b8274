//! Cases that several tests start from: made once per program under test, kept below `target/tmp`, copied by each test.
//! Each is what the program itself writes; a test that is about making a case makes its own.

use crate::job::{CHEAP, contents, output, program, sample};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Output;

/// The folder of what was made under this name by this program; `make` fills it the first time. Tests run in processes
/// of their own: whoever holds the lock makes it, the others wait.
fn made(name: &str, make: impl FnOnce(&Path)) -> PathBuf {
    let mut sum = Sha256::new();
    sum.update(std::fs::read(program()).unwrap());
    sum.update(std::fs::read(CHEAP[1]).unwrap());
    let key = sum.finalize().iter().take(8).fold(String::new(), |key, byte| key + &format!("{byte:02x}"));
    let all = Path::new(env!("CARGO_TARGET_TMPDIR")).join("made");
    std::fs::create_dir_all(&all).unwrap();
    let lock = File::create(all.join(format!("{name}.lock"))).unwrap();
    lock.lock().unwrap();
    // What an earlier program made.
    for old in std::fs::read_dir(&all).unwrap().flatten() {
        let its_name = old.file_name().into_string().unwrap();
        if its_name.starts_with(&format!("{name}-")) && !its_name.ends_with(&key) {
            std::fs::remove_dir_all(old.path()).unwrap();
        }
    }
    let folder = all.join(format!("{name}-{key}"));
    if !folder.exists() {
        let unfinished = all.join(format!("{name}-unfinished"));
        // Left where a test broke off.
        std::fs::remove_dir_all(&unfinished).ok();
        std::fs::create_dir_all(&unfinished).unwrap();
        make(&unfinished);
        std::fs::rename(unfinished, &folder).unwrap();
    }
    folder
}

fn must(ended: &Output) {
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
}

fn prep(scans: &[PathBuf; 2], case: &Path) {
    let [pre, post] = scans.each_ref().map(|path| path.to_str().unwrap());
    must(&output(&[&["prep", "-q", pre, post, "-o", case.to_str().unwrap()], &CHEAP[..]].concat()));
}

/// Copies a folder with everything in it.
pub fn copy(from: &Path, to: &Path) {
    for (name, bytes) in contents(from) {
        let path = to.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
}

/// The sample pair after `hgm run` on two threads, undisturbed.
pub fn finished_pair() -> PathBuf {
    made("finished-pair", |folder| {
        let [pre, post] = ["pre.nii.gz", "post.nii.gz"].map(|scan| sample(scan).display().to_string());
        let case = folder.join("case").display().to_string();
        must(&output(&[&["run", "-q", &pre, &post, "-o", &case, "--threads", "2"], &CHEAP[..]].concat()));
    })
    .join("case")
}

/// A copy of the sample pair after `hgm prep`, in `case`. Its images are those of [`finished_pair`].
pub fn prepared_pair(case: &Path) {
    let prepared = made("prepared-pair", |folder| {
        let done = folder.join("case");
        for part in ["anat", "xfm"] {
            copy(&finished_pair().join(part), &done.join(part));
        }
        for stage in ["registration", "anat"] {
            let manifest = format!(".stages/{stage}.manifest.json");
            std::fs::create_dir_all(done.join(".stages")).unwrap();
            std::fs::copy(finished_pair().join(&manifest), done.join(&manifest)).unwrap();
        }
        prep(&["pre.nii.gz", "post.nii.gz"].map(sample), &done);
    });
    copy(&prepared.join("case"), case);
}

/// The template phantom after `hgm phantom --include-reference`, and the JSON it printed beside it.
pub fn finished_phantom() -> [PathBuf; 2] {
    let folder = made("phantom", |folder| {
        let out = folder.join("phantom").display().to_string();
        let arguments = ["phantom", "--include-reference", "--mesher", "lattice", "--cells", "8000", "--json", "-o"];
        let ended = output(&[arguments.as_slice(), &[&out]].concat());
        must(&ended);
        std::fs::write(folder.join("printed.json"), ended.stdout).unwrap();
    });
    [folder.join("phantom"), folder.join("printed.json")]
}

/// A synthetic patient of 3 mm voxels: its scans before and after.
pub fn synthetic_patient() -> [PathBuf; 2] {
    let folder = made("patient", |folder| {
        let scans = folder.join("scans").display().to_string();
        must(&output(&["synth", "-q", "--seed", "5", "--spacing-mm", "3", "-o", &scans]));
    });
    ["pre", "post"].map(|scan| folder.join(format!("scans/{scan}.nii.gz")))
}

/// A copy of that patient after `hgm prep`, in `case`.
pub fn prepared_patient(case: &Path) {
    let prepared = made("prepared-patient", |folder| prep(&synthetic_patient(), &folder.join("case")));
    copy(&prepared.join("case"), case);
}
