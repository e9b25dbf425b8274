//! A label map in a file to a mesh in a file, with its boundary sets where it is in MNI space.

use super::error::{MeshFileError, WorkflowError};
use super::labels::any_labels;
use super::lost_label::lost_labels;
use super::programs::Programs;
use super::progress::Progress;
use super::settings::Settings;
use super::stages::{LARGE_ISLAND_MM3, WithReading, mesh_outcome};
use super::user_file::read_input;
use super::work::facts;
use crate::artefact::{Produced, Stage, StageError, check_apart, check_writable, write_whole};
use crate::experiment::outcome::MeshOutcome;
use crate::geometry::Native;
use crate::image::{LabelMap, nifti};
use crate::mesh::engine::{EnginePrograms, MeshSettings, mesh_labels};
use crate::mesh::format::{WriteError, feb, gifti, inp, msh, ply, stl, vtu};
use crate::mesh::{Island, TetMesh, TriMesh};
use crate::report::mesh_figure::preview;
use crate::segment::label;
use crate::tag::{SetReport, TagSettings, falx_sheet, tag_boundary_sets};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Raised when the code changes the mesh of the same labels and settings.
const VERSION: u32 = 8;
/// Width of the preview in pixels.
const PREVIEW_PIXELS: usize = 1600;
/// Of the label map as `hgm segment` writes it every label is meshed, its fluid too.
const FLUID_IS_MESHED: &str = "fluid (label 1) is meshed, and boundary sets take it for tissue: where it lies between brain and skull or in the \
     fissure, they lie on it; leave it out to have those of the brain";
const FORMATS: [&str; 4] = ["vtu", "msh", "inp", "feb"];
const SURFACES: [&str; 4] = ["pial", "white", "ventricle", "margin"];
const SURFACE_ENDINGS: [&str; 3] = [".surf.gii", ".stl", ".ply"];

/// The files of a mesh.
#[derive(Clone, Debug, Default)]
pub struct MeshFiles {
    /// Label map (NIfTI, .mgz or .mgh).
    pub labels: PathBuf,
    /// Whose numbers it holds: a built-in table or a .tsv file; `None` finds out.
    pub numbers: Option<String>,
    /// Where to write: .vtu, .msh (gmsh 4.1), .inp (Abaqus) or .feb (FEBio).
    pub output: PathBuf,
    /// Whether the labels are in MNI space, which boundary sets and the sheet of the falx need; what the file says where it
    /// is not known.
    pub in_mni: Option<bool>,
    /// Cut views as PNG.
    pub preview: Option<PathBuf>,
    /// Folder for the closed surfaces pial, white, ventricle and margin as GIFTI, STL and PLY.
    pub surfaces: Option<PathBuf>,
}

impl MeshFiles {
    /// What may be written.
    fn written(&self) -> Vec<PathBuf> {
        let surface = |folder: &PathBuf| {
            let of = |name: &&str| SURFACE_ENDINGS.map(|ending| folder.join(format!("{name}{ending}")));
            SURFACES.iter().flat_map(of).collect::<Vec<_>>()
        };
        let surfaces = self.surfaces.as_ref().map(surface).unwrap_or_default();
        std::iter::once(self.output.clone()).chain(self.preview.clone()).chain(surfaces).collect()
    }
}

/// What a mesh has turned out to be, as its manifest keeps it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeshedFile {
    /// Size and quality.
    #[serde(flatten)]
    pub mesh: MeshOutcome,
    /// Target edge that gave the mesh, mm.
    pub edge_mm: f64,
    /// Parts of the label map that were too small.
    pub islands: usize,
    /// How much of each label lay apart from the rest and is not in the mesh, mm3, where it is more than half a cc in all.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub left_out_mm3: BTreeMap<u8, f64>,
    /// The boundary sets.
    pub sets: Vec<SetReport>,
    /// Labels of which the mesh has nothing, where that was half a cc at most.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Why the quality gate refuses the mesh.
    pub refused: Vec<String>,
}

/// Meshes a label map, or skips what is there. A mesh whose sets are not to be believed is written all the same
/// ([`MeshedFile::refused`]).
///
/// # Errors
/// A label map or a name that cannot be used, an engine that fails, the disk's.
pub fn mesh_file(
    files: &MeshFiles,
    settings: &Settings,
    programs: &Programs,
    force: bool,
    progress: &mut dyn Progress,
) -> Result<MeshedFile, WorkflowError> {
    let extension = files.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !FORMATS.contains(&extension.as_str()) {
        return Err(MeshFileError::Output { output: files.output.clone() }.into());
    }
    if settings.mesh.partial_volume && extension != "vtu" {
        return Err(MeshFileError::Fractions { output: files.output.clone() }.into());
    }
    for file in [Some(&files.output), files.preview.as_ref()].into_iter().flatten() {
        check_writable(file)?;
    }
    check_apart(
        files.written(),
        std::iter::once(&files.labels).chain(files.numbers.as_ref().map(PathBuf::from).as_ref()),
    )?;
    let name = files.labels.display().to_string();
    let bytes = read_input(&files.labels)?;
    let (mut posed, tags, programs) = (settings.mesh.clone(), &settings.tag, programs.engines());
    let refused = |source| WorkflowError::Engine { labels: name.clone(), source };
    programs.check(posed.engine).map_err(refused)?;
    let labels = any_labels(&bytes, &name, files.numbers.as_deref(), &settings.image, progress)?;
    let in_mni = match files.in_mni {
        Some(said) => said,
        None => in_mni_by_itself(&files.labels, &bytes)?,
    };
    if in_mni && tags.falx && posed.split.is_none() {
        posed.split = Some(falx_sheet());
    }

    let folder = files.output.parent().map(Path::to_path_buf).unwrap_or_default();
    let file = files.output.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let frame = if in_mni { "MNI" } else { "native" };
    let read = WithReading { settings: &posed, image: settings.image };
    let stage = Stage::new(&format!("mesh-{file}"), VERSION, &folder, &(&read, in_mni.then_some(tags)));
    let mut stage = stage.input("labels", &bytes).frame(frame);
    if files.numbers.is_some() {
        // What a table of the user's own makes of the file.
        stage = stage.input("label numbers", &nifti::encode_u8(&labels));
    }
    // Pictures and surfaces are made from the mesh at hand, so asking for them is asking for the mesh.
    let force = force || files.preview.is_some() || files.surfaces.is_some();
    let outcome = stage.run(force, || {
        let (mesh, meshed) = make(&labels, &posed, in_mni.then_some(tags), (&name, &programs))?;
        if let Some(path) = &files.preview {
            write_whole(path, &preview(&mesh, None, PREVIEW_PIXELS))?;
        }
        if let Some(folder) = &files.surfaces {
            write_surfaces(&mesh, folder, space_of(in_mni, &bytes))?;
        }
        let bytes = encode(&mesh, &extension).map_err(|source| MeshFileError::Format { file: file.clone(), source })?;
        Ok(Produced {
            files: vec![(file.clone(), bytes)],
            facts: facts(&meshed),
            warnings: [meshed.warnings, meshed.refused].concat(),
        })
    });
    let outcome = outcome.map_err(|error| match error {
        StageError::Compute(error) => error,
        StageError::Write(error) => WorkflowError::Write(error),
    })?;
    Ok(outcome.manifest.figures().map_err(|_| MeshFileError::Noted { file })?)
}

/// Whether a file says that it is in MNI space. By its own name, not by a folder's, which may hold files of every space.
fn in_mni_by_itself(labels: &Path, bytes: &[u8]) -> Result<bool, MeshFileError> {
    let named = labels.file_name().is_some_and(|name| name.to_string_lossy().contains("space-MNI"));
    if named && nifti::says_scanner(bytes) {
        return Err(MeshFileError::NameOrHeader { labels: labels.to_path_buf() });
    }
    Ok(named || nifti::says_mni(bytes))
}

/// The frame that surfaces of these labels are in: the template's where the file or the user says so, else what the header says.
fn space_of(in_mni: bool, bytes: &[u8]) -> gifti::Space {
    if in_mni {
        return gifti::Space::Mni152;
    }
    nifti::code_of(bytes).map_or(gifti::Space::Scanner, gifti::Space::of_nifti_code)
}

/// How much of each label lay apart from the rest, mm3, where it is more than half a cc in all.
fn left_out_mm3(islands: &[Island]) -> BTreeMap<u8, f64> {
    let mut left_out = BTreeMap::new();
    for island in islands.iter().filter(|island| island.became == label::BACKGROUND) {
        *left_out.entry(island.label).or_default() += island.volume_mm3;
    }
    left_out.retain(|_, mm3| *mm3 > LARGE_ISLAND_MM3);
    left_out
}

/// What to say of cells that boundary sets take for tissue and that are none.
fn meshed_fluid(labels: &[u8]) -> Option<&'static str> {
    labels.contains(&label::CSF).then_some(FLUID_IS_MESHED)
}

/// Meshes and, with `tags`, tags.
fn make(
    labels: &LabelMap<Native>,
    settings: &MeshSettings,
    tags: Option<&TagSettings>,
    (name, programs): (&str, &EnginePrograms),
) -> Result<(TetMesh, MeshedFile), WorkflowError> {
    let (mut mesh, record) = mesh_labels(labels, settings, programs)
        .map_err(|source| WorkflowError::Engine { labels: name.to_owned(), source })?;
    let (mut sets, mut refused) = (Vec::new(), Vec::new());
    if let Some(tags) = tags {
        match tag_boundary_sets(&mut mesh, tags) {
            Ok(report) => (sets, refused) = (report.sets, report.warnings.iter().map(ToString::to_string).collect()),
            Err(error) => refused.push(error.to_string()),
        }
    }
    let lost = lost_labels(labels, &mesh, &settings.without, record.edge_mm);
    // A stray voxel is told; what is large enough to be seen is missed.
    let (much, little): (Vec<_>, Vec<_>) = lost.iter().partition(|lost| lost.mm3 > LARGE_ISLAND_MM3);
    refused.extend(much.into_iter().map(ToString::to_string));
    let mut warnings: Vec<String> = little.into_iter().map(ToString::to_string).collect();
    warnings.extend(meshed_fluid(mesh.labels()).filter(|_| tags.is_some()).map(str::to_owned));
    let figures = mesh_outcome(&mesh, &mesh, labels, settings);
    let meshed = MeshedFile {
        mesh: figures,
        edge_mm: record.edge_mm,
        islands: record.islands.len(),
        left_out_mm3: left_out_mm3(&record.islands),
        sets,
        warnings,
        refused,
    };
    Ok((mesh, meshed))
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
fn write_surfaces(mesh: &TetMesh, folder: &Path, space: gifti::Space) -> Result<(), WorkflowError> {
    let all = mesh.boundary_facets(|_| true);
    let of = |l: u8| mesh.boundary_facets(|own| own == l);
    let surfaces = [all, of(label::WHITE_MATTER), of(label::VENTRICLE), of(label::RESECTED)];
    for (name, facets) in SURFACES.into_iter().zip(surfaces).filter(|s| !s.1.is_empty()) {
        let (surface, _) = TriMesh::from_facets(mesh.nodes_mm(), &facets);
        let gii = gifti::encode_surface(&surface, space, name);
        let files = [gii, stl::encode(&surface), ply::encode(&surface, &[])?];
        for (ending, bytes) in SURFACE_ENDINGS.into_iter().zip(files) {
            write_whole(&folder.join(format!("{name}{ending}")), &bytes)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Frame, Mni};
    use crate::image::{Grid, Volume};

    #[test]
    fn the_name_of_the_file_and_its_header_say_the_space_and_where_they_differ_the_user_is_asked() {
        fn bytes<F: Frame>() -> Vec<u8> {
            nifti::encode_u8(&Volume::<u8, F>::from_fn(Grid::axis_aligned([4; 3], [1.0; 3], [0.0; 3]), |_| 2))
        }
        let (scanner, mni) = (bytes::<Native>(), bytes::<Mni>());
        let of = |name: &str, bytes: &[u8]| in_mni_by_itself(Path::new(name), bytes);
        // Our own files in the template's frame are no copies of the template (code 2): their name says the space.
        assert!(matches!(of("a/dseg.nii.gz", &mni), Ok(false)));
        assert!(matches!(of("a/space-MNI_dseg.nii.gz", &mni), Ok(true)));
        assert!(matches!(of("space-MNI/dseg.nii.gz", &scanner), Ok(false)), "a folder says nothing of a file");
        let asked = of("a/pre_space-MNI_dseg.nii.gz", &scanner).unwrap_err().to_string();
        assert!(asked.contains("a/pre_space-MNI_dseg.nii.gz") && asked.contains("code 1"), "{asked}");
    }

    #[test]
    fn tissue_in_many_small_islands_is_as_much_left_out_as_in_a_large_one() {
        let island = |label, volume_mm3, became| Island { label, volume_mm3, became };
        let speckled: Vec<Island> = (0..36)
            .map(|_| island(label::GREY_MATTER, 350.0, label::BACKGROUND))
            .chain([island(label::WHITE_MATTER, 400.0, label::BACKGROUND), island(label::VENTRICLE, 900.0, 3)])
            .collect();
        assert_eq!(left_out_mm3(&speckled), BTreeMap::from([(label::GREY_MATTER, 36.0 * 350.0)]));
    }

    #[test]
    fn sets_that_lie_on_fluid_are_told_of() {
        assert_eq!(meshed_fluid(&[label::GREY_MATTER, label::CSF]), Some(FLUID_IS_MESHED));
        assert_eq!(meshed_fluid(&[label::GREY_MATTER, label::WHITE_MATTER, label::VENTRICLE]), None);
    }

    #[test]
    fn surfaces_say_the_frame_that_the_header_of_the_labels_says() {
        use gifti::Space::{Aligned, Mni152, Scanner, Talairach};
        let grid = Grid::<Native>::axis_aligned([4; 3], [1.0; 3], [0.0; 3]);
        let plain = Volume::<u8, Native>::from_fn(grid, |_| 2);
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&nifti::encode_u8(&plain)[..]), &mut bytes)
            .unwrap();
        let of = |code: u8| {
            // qform_code and sform_code of NIfTI-1.
            for at in [252, 254] {
                bytes[at..at + 2].copy_from_slice(&[code, 0]);
            }
            [false, true].map(|in_mni| space_of(in_mni, &bytes))
        };
        let told = [1, 2, 3, 4].map(of);
        assert_eq!(told, [Scanner, Aligned, Talairach, Mni152].map(|space| [space, Mni152]));
        assert_eq!(space_of(false, b"a .mgz"), Scanner);
    }
}
