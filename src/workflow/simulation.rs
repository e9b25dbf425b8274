//! One deformation, or one motion, of a mesh in a file by the scenario in another.

use super::error::{SimulationError, WorkflowError};
use super::progress::Progress;
use super::settings::in_words;
use super::user_file::{read_input, read_text};
use super::work::facts;
use crate::artefact::{Produced, Stage, StageError, check_apart, check_writable, moments_called_as};
use crate::experiment::rmse::{node_errors_mm, root_mean_square};
use crate::fem::{
    self, ContactOutcome, ConvergenceRecord, ElementKind, FemError, FemWarning, Method, Motion, Outcome, Scenario,
    TetherOutcome, simulate_from,
};
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, msh, pvd, vtu};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Raised when the solver's code changes its results.
const VERSION: u32 = 8;

/// The files of a simulation.
#[derive(Clone, Debug, Default)]
pub struct SimulationFiles {
    /// Tetrahedral mesh with labels and sets (.vtu or .msh).
    pub mesh: PathBuf,
    /// Materials, loads, held sets and solver settings (TOML).
    pub scenario: PathBuf,
    /// Where to write the deformed state (.vtu).
    pub output: PathBuf,
    /// An earlier result on the same mesh to start from.
    pub start: Option<PathBuf>,
    /// A result to compare with.
    pub reference: Option<PathBuf>,
}

/// What a simulation has found, as its manifest keeps it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Simulation {
    /// The file of the deformed state.
    pub output: String,
    /// The series of a motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<String>,
    /// The element.
    pub element: ElementKind,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Tetrahedra of the mesh.
    pub tets: usize,
    /// Largest displacement, mm.
    pub displacement_max_mm: f64,
    /// Root mean square of the displacement over the nodes of tetrahedra, mm.
    pub displacement_rms_mm: f64,
    /// Force on the held and moved nodes together, N; those of walls and springs are theirs below.
    pub reaction_n: [f64; 3],
    /// Root mean square error against the reference over the nodes of tetrahedra, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_mm: Option<f64>,
    /// What presses against what.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contact: Vec<ContactOutcome>,
    /// What springs do.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tethers: Vec<TetherOutcome>,
    /// The solver's record.
    pub convergence: ConvergenceRecord,
    /// The record of a motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// What a reader must know, in sentences.
    pub warnings: Vec<String>,
}

/// Simulates, or skips what is there, and returns what was found with whether it was there already.
///
/// # Errors
/// [`WorkflowError::Simulation`] for files that do not fit and bodies without equilibrium; the disk's.
pub fn simulate(
    files: &SimulationFiles,
    force: bool,
    progress: &mut dyn Progress,
) -> Result<(Simulation, bool), WorkflowError> {
    let (folder, file) = destination(&files.output)?;
    check_writable(&files.output)?;
    let stem = file.strip_suffix(".vtu").unwrap_or(&file).to_owned();
    let made_of = [Some(&files.mesh), Some(&files.scenario), files.start.as_ref(), files.reference.as_ref()];
    let made_of: Vec<&Path> = made_of.into_iter().flatten().map(PathBuf::as_path).collect();
    let mut results = moments_called_as(&files.output, made_of.iter().copied());
    results.extend([files.output.clone(), files.output.with_extension("pvd")]);
    check_apart(results, made_of)?;
    let mesh_bytes = read_input(&files.mesh)?;
    let mesh = mesh_in(&files.mesh, &mesh_bytes)?;
    let scenario = Scenario::from_toml(&read_text(&files.scenario)?).map_err(|e| SimulationError::Scenario {
        name: files.scenario.display().to_string(),
        reason: in_words(&e.to_string()),
    })?;
    // Cut open along sheets that slide: results are written on the mesh as it was computed.
    let refused = |source| SimulationError::Fem { names: files.scenario.display().to_string(), source };
    let mesh = scenario.body(&mesh).map_err(refused)?.into_owned();
    let start = files.start.as_deref().map(|path| displacement(path, &mesh)).transpose()?;
    if start.is_some() && scenario.solver.method == Method::BackwardEuler {
        return Err(SimulationError::StartOfMotion.into());
    }
    let reference = files.reference.as_deref().map(|path| displacement(path, &mesh)).transpose()?;

    let mut stage = Stage::new(&format!("simulate-{stem}"), VERSION, &folder, &scenario).input("mesh", &mesh_bytes);
    for (role, field) in [("start", &start), ("reference", &reference)] {
        if let Some(field) = field {
            let bytes: Vec<u8> = field.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
            stage = stage.input(role, &bytes);
        }
    }
    let names = || format!("{} on {}", files.scenario.display(), files.mesh.display());
    let compute = || -> Result<Produced, SimulationError> {
        let found = simulate_mesh(&mesh, &scenario, start.as_deref(), progress);
        let mut outcome = found.map_err(|source| SimulationError::Fem { names: names(), source })?;
        outcome.warnings.extend(called_otherwise(&files.mesh, &mesh_bytes, &mesh, &scenario));
        produced(&mesh, &scenario, outcome, reference.as_deref(), &stem)
    };
    let outcome = stage.run(force, compute).map_err(|error| match error {
        StageError::Compute(error) => WorkflowError::from(error),
        StageError::Write(error) => error.into(),
    })?;
    let noted = |_| SimulationError::Noted { file: file.clone() };
    Ok((outcome.manifest.figures().map_err(noted)?, outcome.skipped))
}

/// One deformation, or one motion, of a mesh at hand, from rest or from a displacement (mm) near the answer.
///
/// # Errors
/// As [`fem::simulate`].
pub fn simulate_mesh(
    mesh: &TetMesh,
    scenario: &Scenario,
    start_mm: Option<&[[f64; 3]]>,
    progress: &mut dyn Progress,
) -> Result<Outcome, FemError> {
    let progress = RefCell::new(progress);
    progress.borrow_mut().begin("simulation", 100);
    let shown = RefCell::new(0);
    let show = |p: &fem::Progress| {
        // A static solve closes in on its residual by orders of magnitude; a motion goes through its time.
        let closed = p.relative_residual.max(p.goal).ln() / p.goal.ln();
        let done = if scenario.solver.method == Method::Static { closed } else { p.fraction };
        let percent = (100.0 * done.clamp(0.0, 1.0)) as usize;
        let mut progress = progress.borrow_mut();
        (shown.replace_with(|before| percent.max(*before))..percent).for_each(|_| progress.step());
        progress.doing(&format!("iteration {} residual {:.1e}", p.iteration, p.relative_residual));
    };
    let found = match start_mm {
        Some(start) => simulate_from(mesh, scenario, start, &show),
        None => fem::simulate(mesh, scenario, &show),
    };
    progress.borrow_mut().end();
    found
}

/// Folder and name of the output.
fn destination(output: &Path) -> Result<(PathBuf, String), SimulationError> {
    let named = output.file_name().map(|name| name.to_string_lossy().into_owned());
    match named {
        Some(name) if name.ends_with(".vtu") && !output.is_dir() => {
            let folder = output.parent().filter(|p| !p.as_os_str().is_empty());
            Ok((folder.map_or_else(|| PathBuf::from("."), Path::to_path_buf), name))
        }
        _ => Err(SimulationError::Output { output: output.to_path_buf() }),
    }
}

/// The mesh in a file's bytes, by the ending of its name.
pub(super) fn mesh_in(path: &Path, bytes: &[u8]) -> Result<TetMesh, SimulationError> {
    let name = path.display().to_string();
    let mesh = match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
        Some("vtu") => vtu::decode(bytes, &name)?.mesh,
        Some("msh") => msh::decode(bytes, &name)?,
        _ => return Err(SimulationError::MeshName { name }),
    };
    match same_cells(mesh.tets()) {
        Some([first, second]) => Err(SimulationError::TwiceTheSameCell { name, first, second }),
        None => Ok(mesh),
    }
}

/// Volumes of a gmsh file that are called otherwise than the tissue that the scenario takes their numbers for.
pub(super) fn called_otherwise(path: &Path, bytes: &[u8], mesh: &TetMesh, scenario: &Scenario) -> Vec<FemWarning> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("msh")) {
        return Vec::new();
    }
    let of_mesh = msh::volume_names(bytes).into_iter().filter(|(number, _)| mesh.labels().contains(number));
    let other = of_mesh.filter(|(number, name)| scenario.label_number(name).is_some_and(|known| known != *number));
    let taken = |number: u8| scenario.label_name(number).unwrap_or("nothing").to_owned();
    other.map(|(number, name)| FemWarning::CalledOtherwise { number, name, taken: taken(number) }).collect()
}

/// Nodes of two files nearer than this are one, mm: what six digits lose.
const SAME_PLACE_MM: f64 = 1e-2;

/// Two cells of the same nodes, where there are any.
fn same_cells(tets: &[[u32; 4]]) -> Option<[usize; 2]> {
    let mut seen: Vec<([u32; 4], usize)> = tets.iter().enumerate().map(|(cell, tet)| (*tet, cell)).collect();
    for (nodes, _) in &mut seen {
        nodes.sort_unstable();
    }
    seen.sort_unstable();
    seen.windows(2).find(|pair| pair[0].0 == pair[1].0).map(|pair| [pair[0].1, pair[1].1])
}

/// The array `displacement` of a result.
fn displacement(path: &Path, mesh: &TetMesh) -> Result<Vec<[f64; 3]>, SimulationError> {
    let name = path.display().to_string();
    let state = vtu::decode(&read_input(path)?, &name)?;
    let Some(vectors) = state.point_field("displacement").and_then(Field::vectors) else {
        return Err(SimulationError::NoDisplacement { name });
    };
    let (found, nodes) = (vectors.len(), mesh.nodes_mm().len());
    if found != nodes {
        return Err(SimulationError::OtherMesh { name, found, nodes });
    }
    let apart = |n: &usize| {
        let (a, b) = (state.mesh.nodes_mm()[*n], mesh.nodes_mm()[*n]);
        (0..3).any(|axis| (a[axis] - b[axis]).abs() > SAME_PLACE_MM)
    };
    match (0..nodes).find(apart) {
        Some(node) => Err(SimulationError::OtherNodes { name, node }),
        None => Ok(vectors),
    }
}

/// The nodes that a tetrahedron names, in order.
fn nodes_of_tets(mesh: &TetMesh) -> Vec<usize> {
    let mut named = vec![false; mesh.nodes_mm().len()];
    mesh.tets().as_flattened().iter().for_each(|&n| named[n as usize] = true);
    (0..named.len()).filter(|&n| named[n]).collect()
}

fn produced(
    mesh: &TetMesh,
    scenario: &Scenario,
    mut outcome: Outcome,
    reference: Option<&[[f64; 3]]>,
    stem: &str,
) -> Result<Produced, SimulationError> {
    let output = format!("{stem}.vtu");
    let refused = |name: &str| {
        let name = name.to_owned();
        move |source| SimulationError::Format { name, source }
    };
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
        return Err(SimulationError::NotFinite { field: field.name.clone() });
    }
    let mut series = Vec::new();
    if let Some(motion) = &mut outcome.motion {
        for (n, frame) in std::mem::take(&mut motion.frames).into_iter().enumerate() {
            let name = format!("{stem}-{:04}.vtu", n + 1);
            let field = [Field::vector("displacement", &frame.displacement_mm)];
            let bytes = vtu::encode(mesh, &field, &[]).map_err(refused(&name))?;
            files.push((name.clone(), bytes));
            series.push((frame.time_s, name));
        }
    }
    let sizes: Vec<f64> = outcome.displacement_mm.iter().map(|u| u.iter().map(|x| x * x).sum::<f64>().sqrt()).collect();
    let of_tets = nodes_of_tets(mesh);
    // Nodes of no tetrahedron stay where they are and would only thin the mean out.
    let over_tets = |of: &[f64]| root_mean_square(&of_tets.iter().map(|&n| of[n]).collect::<Vec<_>>());
    let summary = Simulation {
        output: output.clone(),
        series: (!series.is_empty()).then(|| format!("{stem}.pvd")),
        element: scenario.solver.element,
        nodes: mesh.nodes_mm().len(),
        tets: mesh.tets().len(),
        displacement_max_mm: sizes.iter().copied().fold(0.0, f64::max),
        displacement_rms_mm: over_tets(&sizes).unwrap_or(0.0),
        reaction_n: [0, 1, 2].map(|i| outcome.reaction_n.iter().map(|r| r[i]).sum()),
        rmse_mm: errors.as_deref().and_then(over_tets),
        contact: outcome.contact,
        tethers: outcome.tethers,
        convergence: outcome.convergence,
        motion: outcome.motion,
        warnings: outcome.warnings.iter().map(ToString::to_string).collect(),
    };
    let bytes = vtu::encode(mesh, &points, &cells).map_err(refused(&output))?;
    files.push((output, bytes));
    if let Some(name) = &summary.series {
        let list: Vec<(f64, &str)> = series.iter().map(|(time, file)| (*time, file.as_str())).collect();
        files.push((name.clone(), pvd::encode(&list)));
    }
    let facts = facts(&summary);
    Ok(Produced { files, warnings: summary.warnings, facts })
}
