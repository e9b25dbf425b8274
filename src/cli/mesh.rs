//! `hgm mesh DSEG -o MESH`: conforming tetrahedra of a label map.

use super::flags::MeshOptions;
use super::{Failure, Session};
use crate::workflow::{Layer, MeshFiles, WorkflowError, mesh_file, results_in_words};
use std::path::PathBuf;

/// Mesh a label map: conforming tetrahedra of every nonzero label, with boundary sets where the map is in MNI space
///
/// Labels: 1 CSF, 2 grey matter, 3 white matter, 4 ventricle, 5 resected tissue, 6 tumour, 7 oedema. A map of FreeSurfer,
/// SynthSeg, SimNIBS, GIF or MUSE is known by its numbers and carried to these. Numbers of no tool are meshed as they are.
///
/// Example: hgm mesh pre_dseg.nii.gz -o brain.vtu --cells 60000 --preview brain.png
/// Example: hgm mesh aseg.mgz --labels freesurfer -o brain.vtu
#[derive(Clone, Debug, clap::Args)]
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

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Layer::default();
    args.mesh.over(&mut flags);
    flags.list("mesh.without", &args.without);
    flags.switch("tag.tentorium", args.tentorium);
    let in_mni = (args.sets != "auto").then_some(args.sets == "mni");
    let Args { dseg: labels, labels: numbers, output, preview, surfaces, .. } = args.clone();
    let files = MeshFiles { labels, numbers, output, in_mni, preview, surfaces };
    let (force, settings) = (session.options.force, session.settings(flags)?);
    let meshed = mesh_file(&files, &settings, &session.programs, force, &mut *session.listener())?;
    session.emit(&meshed, &results_in_words::meshed(&meshed, &args.output))?;
    if meshed.refused.is_empty() { Ok(()) } else { Err(WorkflowError::QualityGate(meshed.refused).into()) }
}
