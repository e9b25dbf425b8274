//! `hgm simulate MESH SCENARIO.toml -o OUT.vtu`: one deformation, or one motion.

use super::{Failure, Session, session::warn};
use crate::workflow::{self, SimulationFiles, results_in_words, shown};
use std::path::PathBuf;

/// Deform a tetrahedral mesh by the loads and materials of a scenario
///
/// MESH is a VTU (cell array `label`, point arrays of 0 and 1 as node sets; gmsh's and meshio's work too) or an MSH 4.1
/// with physical groups. Where a VTU says what lies within the cells (cell arrays `fraction:TISSUE` that sum to 1, as
/// `hgm mesh` writes them with `partial_volume = true` in the table [mesh]), a cell's energy is the sum of its tissues' by
/// their parts. The result has displacement (mm) and reactions (N) on the nodes, volume ratio and strain energy density in
/// the cells; a motion also gets a PVD series beside it.
///
/// Example: hgm simulate brain.vtu gravity.toml -o out.vtu
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Tetrahedral mesh with labels and sets (.vtu or .msh)
    mesh: PathBuf,
    /// Materials, loads, held sets and solver settings (TOML)
    scenario: PathBuf,
    /// Where to write the deformed state
    #[arg(short, long, value_name = "OUT.vtu")]
    output: PathBuf,
    /// Start from the displacement in this earlier result on the same mesh
    #[arg(long, value_name = "VTU")]
    start: Option<PathBuf>,
    /// Compare with the displacement in this file: adds the array `rmse_mm`
    #[arg(long, value_name = "VTU")]
    reference: Option<PathBuf>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let Args { mesh, scenario, output, start, reference } = args;
    let (mesh, scenario, output) = (mesh.clone(), scenario.clone(), output.clone());
    let files = SimulationFiles { mesh, scenario, output, start: start.clone(), reference: reference.clone() };
    let (found, skipped) = workflow::simulate(&files, session.options.force, &mut *session.listener())?;
    tracing::info!("{}: {}", shown(&args.output), if skipped { "already there, skipped" } else { "done" });
    warn(&found.warnings);
    session.emit(&found, &results_in_words::simulated(&found, &args.output))
}
