//! `hgm simulate MESH SCENARIO.toml -o OUT.vtu`: one deformation, or one motion.

use super::{Failure, Session};
use crate::artefact::check_writable;
use crate::workflow::{self, Simulation, SimulationFiles, shown};
use std::path::{Path, PathBuf};

/// Deform a tetrahedral mesh by the loads and materials of a scenario
///
/// MESH is a VTU (cell array `label`, point arrays of 0 and 1 as node sets; gmsh's and meshio's work too) or an MSH 4.1
/// with physical groups. The result has displacement (mm) and reactions (N) on the nodes, volume ratio and strain energy
/// density in the cells; a motion also gets a PVD series beside it.
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
    check_writable(&args.output)?;
    let (found, skipped) = workflow::simulate(&files, session.options.force, &mut session.listener())?;
    tracing::info!("{}: {}", shown(&args.output), if skipped { "already there, skipped" } else { "done" });
    for warning in &found.warnings {
        tracing::warn!("{warning}");
    }
    session.emit(&found, &in_words(&found, &args.output))
}

fn in_words(summary: &Simulation, output: &Path) -> String {
    let Simulation { convergence, motion, .. } = summary;
    let mut text = format!(
        "{}: largest displacement {:.3} mm, rms {:.3} mm\n",
        output.display(),
        summary.displacement_max_mm,
        summary.displacement_rms_mm
    );
    text += &match motion {
        None => format!(
            "{} Newton iterations in {} load steps, {} linear iterations, relative residual {:.1e}\n",
            convergence.iterations.len(),
            convergence.load_steps.len(),
            convergence.linear_iterations(),
            convergence.relative_residual
        ),
        Some(m) => format!(
            "{} time steps, {:.3} s, {} ({:.1e} mm/s)\n",
            m.steps,
            m.time_s,
            if m.rested { "at rest" } else { "still moving" },
            m.fastest_mm_per_s
        ),
    };
    text += &format!(
        "most squeezed: cell {} to {:.3} of its volume\n",
        convergence.worst_cell, convergence.worst_volume_ratio
    );
    for wall in &summary.contact {
        let force = wall.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        text += &format!(
            "wall before {}: {:.0} mm2 pressed with {force:.3} N, at most {:.3} mm deep\n",
            wall.set, wall.area_mm2, wall.depth_mm
        );
    }
    if let Some(rmse) = summary.rmse_mm {
        text += &format!("RMSE against the reference {rmse:.6} mm\n");
    }
    if let Some(series) = &summary.series {
        text += &format!("series in {}\n", output.with_file_name(shown(Path::new(series))).display());
    }
    text
}
