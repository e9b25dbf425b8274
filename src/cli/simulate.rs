//! `hgm simulate MESH SCENARIO.toml -o OUT.vtu`: one deformation, or one motion.

use super::{Failure, Reject, Session};
use crate::artefact::{Produced, Stage, StageError};
use crate::experiment::rmse::{node_errors_mm, root_mean_square};
use crate::fem::{ContactOutcome, ConvergenceRecord, ElementKind, Method, Motion, Outcome, Progress, Scenario};
use crate::fem::{simulate, simulate_from};
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, msh, pvd, vtu};
use crate::workflow;
use crate::workflow::{read_input, read_text, shown};
use anyhow::{Context, anyhow};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Raised when the solver's code changes its results.
const VERSION: u32 = 1;

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

/// What `--json` prints and the manifest keeps.
#[derive(Debug, Serialize, Deserialize)]
struct Summary {
    output: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    series: Option<String>,
    element: ElementKind,
    nodes: usize,
    tets: usize,
    displacement_max_mm: f64,
    displacement_rms_mm: f64,
    /// Sum of the supports' forces, N.
    reaction_n: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    rmse_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    contact: Vec<ContactOutcome>,
    convergence: ConvergenceRecord,
    #[serde(skip_serializing_if = "Option::is_none")]
    motion: Option<Motion>,
    warnings: Vec<String>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let (folder, file) = destination(&args.output)?;
    let mesh_bytes = read_input(&args.mesh)?;
    let mesh = mesh(&args.mesh, &mesh_bytes)?;
    let scenario = Scenario::from_toml(&read_text(&args.scenario)?)
        .map_err(|e| anyhow!("{}: {}", args.scenario.display(), workflow::in_words(&e.to_string())))
        .reject()?;
    // Cut open along sheets that slide: results are written on the mesh as it was computed.
    let mesh = scenario.body(&mesh).with_context(|| args.scenario.display().to_string()).reject()?.into_owned();
    let start = args.start.as_deref().map(|path| displacement(path, &mesh)).transpose()?;
    if start.is_some() && scenario.solver.method == Method::BackwardEuler {
        return Err(Failure::Rejected(anyhow!("--start does not go with `method = \"backward-euler\"`: leave it out")));
    }
    let reference = args.reference.as_deref().map(|path| displacement(path, &mesh)).transpose()?;

    let stem = file.trim_end_matches(".vtu").to_owned();
    let mut stage = Stage::new(&format!("simulate-{stem}"), VERSION, &folder, &scenario).input("mesh", &mesh_bytes);
    for (role, field) in [("start", &start), ("reference", &reference)] {
        if let Some(field) = field {
            let bytes: Vec<u8> = field.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
            stage = stage.input(role, &bytes);
        }
    }
    let names = || format!("{} on {}", args.scenario.display(), args.mesh.display());
    let compute = || -> Result<Produced, Failure> {
        let bar = session.progress(100, "simulation");
        let show = |p: &Progress| {
            // A static solve closes in on its residual by orders of magnitude; a motion goes through its time.
            let closed = p.relative_residual.max(p.goal).ln() / p.goal.ln();
            let done = if scenario.solver.method == Method::Static { closed } else { p.fraction };
            bar.set_position((100.0 * done.clamp(0.0, 1.0)) as u64);
            bar.set_message(format!("iteration {} residual {:.1e}", p.iteration, p.relative_residual));
        };
        let found = match &start {
            Some(start) => simulate_from(&mesh, &scenario, start, &show),
            None => simulate(&mesh, &scenario, &show),
        };
        bar.finish_and_clear();
        let outcome = match found {
            Ok(outcome) => outcome,
            Err(error) if error.is_input() => return Err(error).with_context(names).reject(),
            Err(error) => return Err(Failure::Failed(anyhow::Error::new(error).context(names()))),
        };
        produced(&mesh, &scenario, outcome, reference.as_deref(), &stem)
    };
    let outcome = stage.run(session.options.force, compute).map_err(|error| match error {
        StageError::Compute(failure) => failure,
        StageError::Write(error) => Failure::Failed(error.into()),
    })?;
    tracing::info!("{file}: {}", if outcome.skipped { "already there, skipped" } else { "done" });
    for warning in &outcome.manifest.warnings {
        tracing::warn!("{warning}");
    }
    let summary: Summary = serde_json::from_value(outcome.manifest.facts).map_err(|_| {
        anyhow!("{file}: what an earlier version of hgm noted about it cannot be read; run again with --force")
    })?;
    session.emit(&summary, &in_words(&summary, &args.output))
}

/// Folder and name of the output.
fn destination(output: &Path) -> Result<(PathBuf, String), Failure> {
    let named = output.file_name().map(|name| name.to_string_lossy().into_owned());
    match named {
        Some(name) if name.ends_with(".vtu") && !output.is_dir() => {
            let folder = output.parent().filter(|p| !p.as_os_str().is_empty());
            Ok((folder.map_or_else(|| PathBuf::from("."), Path::to_path_buf), name))
        }
        _ => Err(Failure::Rejected(anyhow!("-o {}: name a file that ends in .vtu", output.display()))),
    }
}

fn mesh(path: &Path, bytes: &[u8]) -> Result<TetMesh, Failure> {
    let name = path.display().to_string();
    match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
        Some("vtu") => Ok(vtu::decode(bytes, &name).reject()?.mesh),
        Some("msh") => msh::decode(bytes, &name).reject(),
        _ => Err(Failure::Rejected(anyhow!(
            "{name}: the name of a mesh ends in .vtu or .msh; convert the file first, for example with meshio"
        ))),
    }
}

/// The array `displacement` of a result.
fn displacement(path: &Path, mesh: &TetMesh) -> Result<Vec<[f64; 3]>, Failure> {
    let name = path.display().to_string();
    let found = vtu::decode(&read_input(path)?, &name).reject()?;
    let refuse = |why: String| Failure::Rejected(anyhow!("{name}: {why}"));
    let vectors = found.point_field("displacement").and_then(Field::vectors);
    let none = "no point array `displacement` of three components; give a result of `hgm simulate`";
    let vectors = vectors.ok_or_else(|| refuse(none.to_owned()))?;
    if vectors.len() != mesh.nodes_mm().len() {
        let (a, b) = (vectors.len(), mesh.nodes_mm().len());
        return Err(refuse(format!("has {a} nodes, the mesh {b}: give a result on the same mesh")));
    }
    Ok(vectors)
}

fn produced(
    mesh: &TetMesh,
    scenario: &Scenario,
    mut outcome: Outcome,
    reference: Option<&[[f64; 3]]>,
    stem: &str,
) -> Result<Produced, Failure> {
    let output = format!("{stem}.vtu");
    let mut files = Vec::new();
    let errors = reference.map(|reference| node_errors_mm(&outcome.displacement_mm, reference));
    let mut points =
        vec![Field::vector("displacement", &outcome.displacement_mm), Field::vector("reaction_n", &outcome.reaction_n)];
    if !outcome.contact.is_empty() {
        points.push(Field::scalar("contact_pressure_pa", outcome.contact_pressure_pa));
    }
    points.extend(errors.iter().map(|e| Field::scalar("rmse_mm", e.clone())));
    let cells = [
        Field::scalar("jacobian", outcome.jacobian),
        Field::scalar("strain_energy_density_pa", outcome.strain_energy_density_pa),
    ];
    if let Some(field) = points.iter().chain(&cells).find(|f| f.values.iter().any(|v| !v.is_finite())) {
        let name = &field.name;
        return Err(Failure::Failed(anyhow!("`{name}` is not a finite number everywhere: the result is not written")));
    }
    let mut series = Vec::new();
    if let Some(motion) = &mut outcome.motion {
        for (n, frame) in std::mem::take(&mut motion.frames).into_iter().enumerate() {
            let name = format!("{stem}-{:04}.vtu", n + 1);
            let field = [Field::vector("displacement", &frame.displacement_mm)];
            let bytes = vtu::encode(mesh, &field, &[]).with_context(|| name.clone()).reject()?;
            files.push((name.clone(), bytes));
            series.push((frame.time_s, name));
        }
    }
    let sizes: Vec<f64> = outcome.displacement_mm.iter().map(|u| u.iter().map(|x| x * x).sum::<f64>().sqrt()).collect();
    let summary = Summary {
        output: output.clone(),
        series: (!series.is_empty()).then(|| format!("{stem}.pvd")),
        element: scenario.solver.element,
        nodes: mesh.nodes_mm().len(),
        tets: mesh.tets().len(),
        displacement_max_mm: sizes.iter().copied().fold(0.0, f64::max),
        displacement_rms_mm: root_mean_square(&sizes).unwrap_or(0.0),
        reaction_n: [0, 1, 2].map(|i| outcome.reaction_n.iter().map(|r| r[i]).sum()),
        rmse_mm: errors.as_deref().and_then(root_mean_square),
        contact: outcome.contact,
        convergence: outcome.convergence,
        motion: outcome.motion,
        warnings: outcome.warnings.clone(),
    };
    let bytes = vtu::encode(mesh, &points, &cells).with_context(|| output.clone()).reject()?;
    files.push((output, bytes));
    if let Some(name) = &summary.series {
        let list: Vec<(f64, &str)> = series.iter().map(|(time, file)| (*time, file.as_str())).collect();
        files.push((name.clone(), pvd::encode(&list)));
    }
    Ok(Produced { files, warnings: outcome.warnings, facts: serde_json::to_value(&summary)? })
}

fn in_words(summary: &Summary, output: &Path) -> String {
    let Summary { convergence, motion, .. } = summary;
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
