//! Two scans in, a case folder with a page out, and its numbers read back.
//!
//! ```sh
//! cargo run --release --example pair_to_report -- sample-data/pre.nii.gz sample-data/post.nii.gz case
//! ```

use hgm::mesh::engine::MeshSize;
use hgm::workflow::{self, Case, Inputs, Place, Progress, Settings, StageEnded, WorkflowError};
use std::path::Path;

/// Tells every stage as it ends.
struct Told;

impl Progress for Told {
    fn stage(&mut self, ended: &StageEnded<'_>) {
        println!("{}: {}", ended.stage, if ended.skipped { "already there" } else { "done" });
    }
}

/// The whole job on a coarse mesh.
///
/// # Errors
/// Scans that cannot be used, a stage that fails, a disk that refuses.
pub fn run(pre: &Path, post: &Path, folder: &Path) -> Result<Case, WorkflowError> {
    let mut settings = Settings::default();
    settings.mesh.size = MeshSize::Cells(3000);
    settings.resection.sd_levels = vec![-1.0, 0.0, 1.0];
    let case = workflow::run(&Inputs::pair(pre, post), &Place::from(folder), &settings, &mut Told)?;

    let outcome = case.outcome()?;
    for sample in &outcome.samples {
        println!("{}: {:.0?} Pa, error {:.2?} mm", sample.id, sample.shear_modulus_pa, sample.rmse_mm);
    }
    let displacement_mm = case.field("displacement")?;
    println!("{} nodes; the page is {}", displacement_mm.values.len() / 3, case.page().display());
    Ok(case)
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<(), WorkflowError> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [pre, post, folder] = &given[..] else {
        eprintln!("say: pair_to_report PRE POST FOLDER");
        std::process::exit(2);
    };
    run(Path::new(pre), Path::new(post), Path::new(folder)).map(|_| ())
}
