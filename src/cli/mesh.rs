//! `hgm mesh DSEG -o MESH`: conforming tetrahedra of a label map.

use super::flags::{Flags, MeshOptions};
use super::{Failure, Reject, Session};
use crate::artefact::{Produced, Stage, StageError, write_whole};
use crate::geometry::Native;
use crate::image::LabelMap;
use crate::image::nifti::{self, encode_u8};
use crate::mesh::engine::{EnginePrograms, MeshSettings, mesh_labels};
use crate::mesh::format::{WriteError, feb, gifti, inp, msh, ply, stl, vtu};
use crate::mesh::{TetMesh, TriMesh};
use crate::report::mesh_figure::preview;
use crate::segment::label;
use crate::tag::{SetReport, TagSettings, falx_sheet, tag_boundary_sets};
use crate::workflow::{WorkflowError, any_labels, mesh_outcome, read_input};
use anyhow::{Context, anyhow};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Raised when the code changes the mesh of the same labels and settings.
const VERSION: u32 = 5;
/// Width of the preview in pixels.
const PREVIEW_PIXELS: usize = 1600;
const FORMATS: [&str; 4] = ["vtu", "msh", "inp", "feb"];

/// Mesh a label map: conforming tetrahedra of every nonzero label, with boundary sets where the map is in MNI space
///
/// Labels: 1 CSF, 2 grey matter, 3 white matter, 4 ventricle, 5 resected tissue, 6 tumour, 7 oedema. A map of FreeSurfer,
/// SynthSeg, SimNIBS, GIF or MUSE is known by its numbers and carried to these. Numbers of no tool are meshed as they are.
///
/// Example: hgm mesh pre_dseg.nii.gz -o brain.vtu --cells 60000 --preview brain.png
/// Example: hgm mesh aseg.mgz --labels freesurfer -o brain.vtu
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Label map (NIfTI, .mgz or .mgh)
    #[arg(value_name = "DSEG")]
    pub dseg: PathBuf,
    /// Whose numbers the map holds [default: found out from the numbers]
    #[arg(long, value_name = "freesurfer|synthseg|charm|gif|muse|hgm|FILE.tsv")]
    pub labels: Option<String>,
    /// Where to write: .vtu, .msh (gmsh 4.1), .inp (Abaqus) or .feb (FEBio)
    #[arg(short, long, value_name = "MESH")]
    pub output: PathBuf,
    #[command(flatten)]
    pub mesh: MeshOptions,
    /// Labels to leave out, as 1,4
    #[arg(long, value_name = "LABELS", value_delimiter = ',')]
    pub without: Vec<u8>,
    /// Boundary sets and the sheet of the falx: auto (when the file says that it is in MNI space), mni, none
    #[arg(long, value_name = "auto|mni|none", default_value = "auto", value_parser = ["auto", "mni", "none"])]
    pub sets: String,
    /// Also tag the tentorium
    #[arg(long)]
    pub tentorium: bool,
    /// Cut views as PNG
    #[arg(long, value_name = "PNG")]
    pub preview: Option<PathBuf>,
    /// Folder for the closed surfaces pial, white, ventricle and margin as GIFTI, STL and PLY
    #[arg(long, value_name = "DIR")]
    pub surfaces: Option<PathBuf>,
}

/// What `--json` prints and the manifest keeps.
#[derive(Debug, Serialize, Deserialize)]
struct Summary {
    #[serde(flatten)]
    mesh: crate::experiment::outcome::MeshOutcome,
    /// Target edge that gave the mesh, mm.
    edge_mm: f64,
    /// Parts of the label map that were too small.
    islands: usize,
    sets: Vec<SetReport>,
    /// Why the quality gate refuses the mesh.
    refused: Vec<String>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let extension = args.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !FORMATS.contains(&extension.as_str()) {
        let name = args.output.display();
        return Err(Failure::Rejected(anyhow!("-o {name}: the name must end in .vtu, .msh, .inp or .feb")));
    }
    let name = args.dseg.display().to_string();
    let bytes = read_input(&args.dseg)?;
    let mut flags = Flags::default();
    args.mesh.over(&mut flags);
    flags.list("mesh.without", &args.without);
    flags.switch("tag.tentorium", args.tentorium);
    let whole = session.settings(flags)?;
    let (mut settings, tags) = (whole.mesh, whole.tag);
    let programs = session.programs.engines();
    programs.check(settings.engine).reject()?;
    let told = |text: &str| tracing::info!("{text}");
    let labels = any_labels(&bytes, &name, args.labels.as_deref(), &whole.image, &told)?;

    let in_mni = match args.sets.as_str() {
        "auto" => name.contains("space-MNI") || nifti::says_mni(&bytes),
        choice => choice == "mni",
    };
    if in_mni && tags.falx && settings.split.is_none() {
        settings.split = Some(falx_sheet());
    }

    let folder = args.output.parent().map(Path::to_path_buf).unwrap_or_default();
    let file = args.output.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let frame = if in_mni { "MNI" } else { "native" };
    let stage = Stage::new(&format!("mesh-{file}"), VERSION, &folder, &(&settings, in_mni.then_some(&tags)));
    let mut stage = stage.input("labels", &bytes).frame(frame);
    if args.labels.is_some() {
        // What a table of the user's own makes of the file.
        stage = stage.input("label numbers", &encode_u8(&labels));
    }
    // Pictures and surfaces are made from the mesh at hand, so asking for them is asking for the mesh.
    let force = session.options.force || args.preview.is_some() || args.surfaces.is_some();
    let outcome = stage.run(force, || {
        let (mesh, summary) = make(&labels, &settings, in_mni.then_some(&tags), (&name, &programs))?;
        if let Some(path) = &args.preview {
            write_whole(path, &preview(&mesh, None, PREVIEW_PIXELS))?;
        }
        if let Some(folder) = &args.surfaces {
            write_surfaces(&mesh, folder)?;
        }
        let facts = serde_json::to_value(&summary)?;
        let bytes = encode(&mesh, &extension).with_context(|| file.clone())?;
        Ok(Produced { files: vec![(file.clone(), bytes)], warnings: summary.refused, facts })
    });
    let outcome = outcome.map_err(|error| match error {
        StageError::Compute(failure) => failure,
        StageError::Write(error) => Failure::Failed(error.into()),
    })?;
    let summary: Summary = serde_json::from_value(outcome.manifest.facts).map_err(|_| {
        anyhow!("{file}: what an earlier version of hgm noted about it cannot be read; run again with --force")
    })?;
    session.emit(&summary, &text(&args.output, &summary))?;
    if summary.refused.is_empty() {
        return Ok(());
    }
    Err(Failure::QualityGate(anyhow!("{} (outputs kept)", summary.refused.join("; "))))
}

/// Meshes and, with `tags`, tags.
fn make(
    labels: &LabelMap<Native>,
    settings: &MeshSettings,
    tags: Option<&TagSettings>,
    (name, programs): (&str, &EnginePrograms),
) -> Result<(TetMesh, Summary), WorkflowError> {
    let (mut mesh, record) = mesh_labels(labels, settings, programs)
        .map_err(|source| WorkflowError::Engine { labels: name.to_owned(), source })?;
    let (mut sets, mut refused) = (Vec::new(), Vec::new());
    if let Some(tags) = tags {
        match tag_boundary_sets(&mut mesh, tags) {
            Ok(report) => (sets, refused) = (report.sets, report.warnings),
            Err(error) => refused.push(error.to_string()),
        }
    }
    let figures = mesh_outcome(&mesh, &mesh, labels, settings);
    let islands = record.islands.len();
    Ok((mesh, Summary { mesh: figures, edge_mm: record.edge_mm, islands, sets, refused }))
}

fn encode(mesh: &TetMesh, extension: &str) -> Result<Vec<u8>, WriteError> {
    Ok(match extension {
        "msh" => msh::encode(mesh)?,
        "inp" => inp::encode(mesh)?,
        "feb" => feb::encode(mesh, &BTreeMap::new())?,
        _ => vtu::encode(mesh, &[], &[])?,
    })
}

/// The closed, outward surfaces that the mesh has, each in three formats.
fn write_surfaces(mesh: &TetMesh, folder: &Path) -> Result<(), Failure> {
    let all = mesh.boundary_facets(|_| true);
    let of = |l: u8| mesh.boundary_facets(|own| own == l);
    let surfaces = [
        ("pial", all),
        ("white", of(label::WHITE_MATTER)),
        ("ventricle", of(label::VENTRICLE)),
        ("margin", of(label::RESECTED)),
    ];
    for (name, facets) in surfaces.into_iter().filter(|s| !s.1.is_empty()) {
        let (surface, _) = TriMesh::from_facets(mesh.nodes_mm(), &facets);
        let gii = gifti::encode_surface(&surface, gifti::Space::Mni152, name);
        write_whole(&folder.join(format!("{name}.surf.gii")), &gii)?;
        write_whole(&folder.join(format!("{name}.stl")), &stl::encode(&surface))?;
        write_whole(&folder.join(format!("{name}.ply")), &ply::encode(&surface, &[])?)?;
    }
    Ok(())
}

fn text(output: &Path, summary: &Summary) -> String {
    let m = &summary.mesh;
    let mut text = format!("{}: {} nodes, {} tetrahedra ({})\n", output.display(), m.nodes, m.tets, m.engine);
    let figure = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let _ = writeln!(
        text,
        "  dihedral angles from {:.1} degrees, radius ratio {:.2} on average and {:.2} at least, scaled Jacobian from {:.2}",
        figure(m.dihedral_min_deg),
        figure(m.radius_ratio_mean),
        figure(m.radius_ratio_min),
        figure(m.scaled_jacobian_min),
    );
    for (name, percent) in &m.volume_error_percent {
        let _ = writeln!(text, "  {name}: volume {percent:+.2} %, Dice {:.3}", figure(m.dice.get(name).copied()));
    }
    for set in &summary.sets {
        let [x, y, z] = set.centroid_mm;
        let _ = writeln!(
            text,
            "  set {}: {} nodes, {:.0} mm2 around ({x:.0}, {y:.0}, {z:.0})",
            set.name, set.nodes, set.area_mm2
        );
    }
    text
}
