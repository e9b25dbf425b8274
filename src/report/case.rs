//! A case directory to a page: reads what is there, says what is not.

use super::colour::ColourScale;
use super::figure::CaseImages;
use super::glance_figure::glance_figure;
use super::hand_off::{self, CaseFile};
use super::mesh_figure::{cut_views, legend, middle_mm, value_views};
use super::page::{CaptionedPicture, CasePage, ErrorMap, PredictionFigure, ShiftFigure, title_of};
use super::shift_figure::{prediction_figure, shift_figure};
use super::viewer::{ViewedSurface, Viewer};
use crate::artefact::{WriteError, sha256_hex, write_whole};
use crate::experiment::field::BrainShift;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome, OutcomeError};
use crate::experiment::predict::{Prediction, PredictionEvaluation};
use crate::geometry::{Frame, Mni, Post, Pre, RigidTransform};
use crate::image::nifti::{self, NiftiError, ReadOptions};
use crate::image::{LabelMap, Mask, Volume};
use crate::layout;
use crate::mesh::format::{Field, MeshWithFields, ReadError, WriteError as FieldError, gifti, vtu};
use crate::mesh::{TetMesh, TriMesh};
use crate::register::transform_text::{self, TransformTextError};
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Pixels of the mesh pictures on the page.
const PICTURE: [usize; 2] = [560, 460];

/// Why a report could not be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum ReportError {
    #[error(
        "{}: not a case folder: none of its files is there; name a folder made by `hgm run`, `hgm prep` or \
         `hgm phantom`",
        folder.display()
    )]
    NoCase { folder: PathBuf },
    #[error(
        "{}: cannot be read; check that the case folder is a folder and that its files may be read", path.display()
    )]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{file}: not text, so the file is damaged; run `hgm run` or `hgm phantom` again")]
    Text { file: String },
    #[error(
        "{file}: point array `{array}` has {found} numbers for {nodes} nodes: the file is not this case's; make it \
         again with `hgm run` or `hgm phantom`"
    )]
    Array { file: String, array: String, found: usize, nodes: usize },
    #[error(
        "{file}: its grid is not that of {other}: one of the two is not this case's; make them again with \
         `hgm prep PRE POST -o CASE`"
    )]
    Grid { file: String, other: String },
    #[error(transparent)]
    Image(#[from] NiftiError),
    #[error(transparent)]
    Transform(#[from] TransformTextError),
    #[error(transparent)]
    Mesh(#[from] ReadError),
    #[error(transparent)]
    Outcome(#[from] OutcomeError),
    #[error("a surface for other viewers: {0}")]
    HandOff(FieldError),
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// A case directory; files are named relative to it.
struct Case<'a> {
    folder: &'a Path,
}

/// An image and where it is shown.
type MaskedImage = (Volume<f32, Mni>, Mask<Mni>);

impl Case<'_> {
    /// The bytes of a file, or `None` when it is not there.
    fn bytes(&self, file: &str) -> Result<Option<Vec<u8>>, ReportError> {
        let path = self.folder.join(file);
        match std::fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(ReportError::Read { path, source }),
        }
    }

    fn text(&self, file: &str) -> Result<Option<String>, ReportError> {
        let Some(bytes) = self.bytes(file)? else { return Ok(None) };
        String::from_utf8(bytes).map(Some).map_err(|_| ReportError::Text { file: file.to_owned() })
    }

    /// Numbers of ours; `None` when they are not there or another version's.
    fn numbers<T: DeserializeOwned>(&self, file: &str) -> Result<Option<T>, ReportError> {
        Ok(self.text(file)?.and_then(|text| serde_json::from_str(&text).ok()))
    }

    fn mesh(&self, file: &str) -> Result<Option<MeshWithFields>, ReportError> {
        Ok(self.bytes(file)?.map(|bytes| vtu::decode(&bytes, file)).transpose()?)
    }

    /// The target surfaces, by name.
    fn reference_surfaces(&self) -> Result<Vec<(String, TriMesh)>, ReportError> {
        let family = layout::REFERENCE_SURFACE;
        let mut sets = Vec::new();
        for entry in std::fs::read_dir(self.folder.join(family.folder())).into_iter().flatten().flatten() {
            let file = format!("{}/{}", family.folder(), entry.file_name().to_string_lossy());
            sets.extend(family.member(&file).map(str::to_owned));
        }
        sets.sort();
        let mut surfaces = Vec::new();
        for set in sets {
            let file = family.of(&set);
            if let Some(bytes) = self.bytes(&file)? {
                surfaces.push((set.replace('_', " "), gifti::decode_surface(&bytes, &file)?));
            }
        }
        Ok(surfaces)
    }
}

/// The brain shift of the model's state on a slice.
fn shift_of(case: &Case<'_>, shift: Option<&BrainShift>) -> Result<Option<ShiftFigure>, ReportError> {
    let Some(model) = shift.and_then(|shift| shift.model.as_deref()) else { return Ok(None) };
    let file = layout::SAMPLE_STATE.of(model);
    let (Some(state), Some(t1), Some(seen)) =
        (case.mesh(&file)?, case.bytes(layout::PRE_T1)?, case.bytes(layout::SAG)?)
    else {
        return Ok(None);
    };
    let t1: Volume<f32, Mni> = nifti::decode(&t1, layout::PRE_T1, &ReadOptions::default())?.volume.relabelled();
    let seen: Volume<[f32; 3], Mni> = nifti::decode_displacement(&seen, layout::SAG)?.relabelled();
    let displacement = state.point_field("displacement").and_then(Field::vectors);
    Ok(displacement.and_then(|u| shift_figure(&t1, &seen, &state.mesh, &u)))
}

/// The first head of a prediction on a slice.
fn expected_of(case: &Case<'_>, prediction: Option<&Prediction>) -> Result<Option<PredictionFigure>, ReportError> {
    let Some(head) = prediction.and_then(|prediction| prediction.heads.first()) else { return Ok(None) };
    let file = layout::PREDICTED_STATE.of(&head.state);
    let (Some(state), Some(t1)) = (case.mesh(&file)?, case.bytes(layout::PRE_T1)?) else { return Ok(None) };
    let t1: Volume<f32, Mni> = nifti::decode(&t1, layout::PRE_T1, &ReadOptions::default())?.volume.relabelled();
    let scalar = |name: &str| state.point_field(name).map(|field| field.values.clone());
    let mean = state.point_field("displacement").and_then(Field::vectors);
    let (Some(mean), Some(reach), Some(sd)) = (mean, scalar("displacement_95"), scalar("displacement_sd")) else {
        return Ok(None);
    };
    Ok(prediction_figure(&t1, &state.mesh, &mean, &reach, &sd))
}

/// The page of a case directory.
///
/// # Errors
/// [`ReportError`] for a file that is there but cannot be used; what is not there is named on the page.
pub fn read_case(folder: &Path) -> Result<CasePage, ReportError> {
    let case = Case { folder };
    let outcome = match case.text(layout::OUTCOME)? {
        // A file of an earlier version holds no verdict.
        Some(text) => Some(ExperimentOutcome::from_json(&text, layout::OUTCOME)?.with_verdict()),
        None => None,
    };
    let settings_toml = case.text(layout::SETTINGS)?;
    let provenance_json = case.text(layout::PROVENANCE)?;
    let rest = case.mesh(layout::REST_MESH)?;
    let images = case.images()?;
    if outcome.is_none() && rest.is_none() && images.is_none() {
        return Err(ReportError::NoCase { folder: folder.to_path_buf() });
    }
    let mut page = CasePage {
        subject: subject_of(folder),
        title: title_of(outcome.as_ref()).to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        settings_toml,
        provenance_json,
        ..CasePage::default()
    };
    if let Some(png) = case.bytes(layout::REFUSED_PICTURE)? {
        page.refused = Some(refused(png));
    }
    if let Some(images) = &images {
        let seen = case.bytes(layout::SAG)?.map(|bytes| nifti::decode_displacement(&bytes, layout::SAG)).transpose()?;
        page.glance = glance_figure(images, seen.map(Volume::relabelled).as_ref());
        page.registration = images.registration();
        page.mosaics = images.mosaics();
    }
    if let Some(rest) = &rest {
        page.mesh_pictures = cut_views(&rest.mesh, focus_mm(&rest.mesh), PICTURE);
        page.mesh_legend = legend(&rest.mesh);
    } else {
        page.absent.push(format!("the mesh ({} is not there)", layout::REST_MESH));
    }
    match &outcome {
        Some(outcome) if outcome.kind == ExperimentKind::Prediction => {}
        Some(outcome) => add_results(&case, outcome, rest.as_ref(), &mut page)?,
        None => page.absent.push(format!("samples and errors ({} is not there; run `hgm sweep`)", layout::OUTCOME)),
    }
    page.prediction = case.numbers(layout::PREDICTION_JSON)?;
    page.evaluation = evaluation_of(&case)?;
    page.prediction_figure = expected_of(&case, page.prediction.as_ref())?;
    page.brain_shift = case.numbers(layout::SHIFT_JSON)?;
    page.landmarks = case.numbers(layout::LANDMARKS_JSON)?.filter(|_| page.brain_shift.is_some());
    page.shift_figure = shift_of(&case, page.brain_shift.as_ref())?;
    page.outcome = outcome;
    Ok(page)
}

/// The prediction against what was seen: nothing where another prediction was evaluated.
fn evaluation_of(case: &Case<'_>) -> Result<Option<PredictionEvaluation>, ReportError> {
    let sum = case.bytes(layout::PREDICTION_JSON)?.map(|bytes| sha256_hex(&bytes));
    let found: Option<PredictionEvaluation> = case.numbers(layout::EVALUATION_JSON)?;
    Ok(found.filter(|found| sum.as_ref() == Some(&found.prediction_sha256)))
}

/// Whose case it is: `sub-01` of `sub-01/hgm`, else the folder's name.
fn subject_of(folder: &Path) -> String {
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let above = folder.parent().map(name).filter(|above| above.starts_with("sub-") && name(&folder) == "hgm");
    above.unwrap_or_else(|| name(&folder))
}

/// The picture of a refusal on the page.
fn refused(png: Vec<u8>) -> CaptionedPicture {
    // Width and height stand at the same place in every PNG.
    let pixels = |at: usize| png.get(at..at + 4).map_or(0, |b| b.iter().fold(0, |n, &byte| n << 8 | usize::from(byte)));
    CaptionedPicture {
        size: [pixels(16), pixels(20)],
        caption: "Both scans in the template's frame: above before, below after surgery".to_owned(),
        description: "Axial, coronal and sagittal slices of both scans at the same places".to_owned(),
        sides: None,
        png,
    }
}

/// `report.html` and the files for other viewers (see [`hand_off`]), by their paths in the case directory.
///
/// # Errors
/// [`ReportError`] as [`read_case`].
pub fn report_files(folder: &Path) -> Result<Vec<CaseFile>, ReportError> {
    let page = read_case(folder)?;
    let mut files = vec![(layout::PAGE.to_owned(), page.to_html().into_bytes())];
    let case = Case { folder };
    if let Some(images) = case.images()? {
        files.extend(hand_off::segmentations(&images));
    }
    if let Some(outcome) = &page.outcome {
        files.extend(hand_off::series(outcome));
        if let Some((file, sample)) = best_sample(&case, outcome)?
            && let Some(errors) = sample.point_field("rmse_mm")
        {
            let deformed = displaced(&file, &sample)?;
            let sets = outcome.rmse_sets();
            let surfaces = hand_off::error_surfaces(&sample.mesh, &deformed, &errors.values, &sets);
            files.extend(surfaces.map_err(ReportError::HandOff)?);
        }
    }
    Ok(files)
}

/// Makes `report.html` of a case directory, and the files for other viewers, again. Returns the page's path.
///
/// # Errors
/// [`ReportError`]; nothing is written unless everything could be made.
pub fn write_report(folder: &Path) -> Result<PathBuf, ReportError> {
    for (file, bytes) in report_files(folder)? {
        write_whole(&folder.join(file), &bytes)?;
    }
    Ok(folder.join(layout::PAGE))
}

/// The best sample's file and its name, when both are there.
fn best_sample(case: &Case<'_>, outcome: &ExperimentOutcome) -> Result<Option<(String, MeshWithFields)>, ReportError> {
    let Some(best) = outcome.best() else { return Ok(None) };
    let file = best.file.clone().unwrap_or_else(|| layout::SAMPLE_STATE.of(&best.id));
    Ok(case.mesh(&file)?.map(|sample| (file, sample)))
}

/// Where the mesh is cut: through the resection margin when there is one, else near the middle.
fn focus_mm(mesh: &TetMesh) -> [f64; 3] {
    let margin = mesh.node_sets.get("margin").filter(|nodes| !nodes.is_empty());
    margin.map_or_else(
        || middle_mm(mesh),
        |nodes| {
            let sum = |a: usize| nodes.iter().map(|&n| mesh.nodes_mm()[n as usize][a]).sum::<f64>();
            [0, 1, 2].map(|a| sum(a) / nodes.len() as f64)
        },
    )
}

/// Nodes moved by the point array `displacement`; the nodes themselves when it is absent.
fn displaced(file: &str, sample: &MeshWithFields) -> Result<Vec<[f64; 3]>, ReportError> {
    let nodes = sample.mesh.nodes_mm();
    let Some(field) = sample.point_field("displacement") else { return Ok(nodes.to_vec()) };
    if field.values.len() != 3 * nodes.len() {
        let (array, found) = (field.name.clone(), field.values.len());
        return Err(ReportError::Array { file: file.to_owned(), array, found, nodes: nodes.len() });
    }
    let moved = |(p, u): (&[f64; 3], &[f64])| [p[0] + u[0], p[1] + u[1], p[2] + u[2]];
    Ok(nodes.iter().zip(field.values.chunks_exact(3)).map(moved).collect())
}

/// The error of every node, NaN where the reference says nothing of it: such a node is not without error.
fn observed_errors(sample: &MeshWithFields) -> Option<Vec<f64>> {
    let errors = sample.point_field("rmse_mm").filter(|f| f.values.len() == sample.mesh.nodes_mm().len())?;
    let mut seen = vec![f64::NAN; errors.values.len()];
    // In a file from before node sets were marked, or written again by another program, the array is read as a set.
    match (sample.point_field("rmse_observed"), sample.mesh.node_sets.get("rmse_observed")) {
        (Some(observed), _) => {
            for (n, _) in observed.values.iter().enumerate().filter(|(_, v)| **v == 1.0) {
                seen[n] = errors.values[n];
            }
        }
        (None, Some(observed)) => observed.iter().for_each(|&n| seen[n as usize] = errors.values[n as usize]),
        (None, None) => return Some(errors.values.clone()),
    }
    Some(seen)
}

/// Error map and 3-D view from the best sample and the reference.
fn add_results(
    case: &Case<'_>,
    outcome: &ExperimentOutcome,
    rest: Option<&MeshWithFields>,
    page: &mut CasePage,
) -> Result<(), ReportError> {
    let Some(best) = outcome.best() else {
        page.absent.push("the error per node (no sample is the best one)".to_owned());
        return Ok(());
    };
    let Some((file, sample)) = best_sample(case, outcome)? else {
        page.absent.push(format!("the error per node and the 3-D view (the file of {} is not there)", best.id));
        return Ok(());
    };
    let mesh = &sample.mesh;
    let deformed = displaced(&file, &sample)?;
    let errors = observed_errors(&sample);
    let scale = errors.as_ref().and_then(|e| ColourScale::to_95(e.iter().copied(), "error per node (mm)"));
    if let (Some(errors), Some(scale)) = (&errors, &scale) {
        let sets = outcome.rmse_sets();
        let named: Vec<&str> = sets.iter().map(String::as_str).filter(|s| *s != "all").collect();
        let of_set = |set: &String| {
            let values = match mesh.node_sets.get(set) {
                Some(nodes) => nodes.iter().map(|&n| errors[n as usize]).collect(),
                None if set == "all" => errors.clone(),
                None => Vec::new(),
            };
            let values: Vec<f64> = values.into_iter().filter(|v: &f64| v.is_finite()).collect();
            (!values.is_empty()).then(|| (set.clone(), values))
        };
        page.error_map = Some(ErrorMap {
            scale: scale.clone(),
            pictures: value_views(mesh, &deformed, errors, scale, &named, PICTURE),
            errors_mm: sets.iter().filter_map(of_set).collect(),
        });
    } else {
        page.absent.push(format!("the error per node ({file} has no point array `rmse_mm`)"));
    }
    page.viewer = Some(viewer(case, rest, mesh, &deformed, errors, scale)?);
    Ok(())
}

fn viewer(
    case: &Case<'_>,
    rest: Option<&MeshWithFields>,
    mesh: &TetMesh,
    deformed: &[[f64; 3]],
    errors: Option<Vec<f64>>,
    scale: Option<ColourScale>,
) -> Result<Viewer, ReportError> {
    let facets = mesh.boundary_facets(|_| true);
    let (surface, old) = TriMesh::from_facets(deformed, &facets);
    let values = errors.filter(|_| scale.is_some()).map(|e| old.iter().map(|&n| e[n as usize]).collect());
    let undeformed = rest.map_or(mesh, |r| &r.mesh);
    let rest_surface = TriMesh::from_facets(undeformed.nodes_mm(), &undeformed.boundary_facets(|_| true)).0;
    let plain = |name: &str, surface| ViewedSurface { name: name.to_owned(), surface, values: Vec::new() };
    let mut surfaces = vec![
        plain("undeformed", rest_surface),
        ViewedSurface { name: "deformed, with error".to_owned(), surface, values: values.unwrap_or_default() },
    ];
    if let Some(reference) = case.mesh(layout::REFERENCE_STATE)? {
        let nodes = displaced(layout::REFERENCE_STATE, &reference)?;
        surfaces.push(plain("reference", TriMesh::from_facets(&nodes, &reference.mesh.boundary_facets(|_| true)).0));
    }
    for (what, surface) in case.reference_surfaces()? {
        surfaces.push(plain(&format!("reference: {what}"), surface));
    }
    Ok(Viewer { surfaces, scale })
}

impl Case<'_> {
    fn mask(&self, file: &str) -> Result<Option<Mask<Mni>>, ReportError> {
        // Read as labels: a cavity that is empty is a result, not a fault.
        Ok(self.labels(file)?.map(|labels| labels.map(|l| l != 0)))
    }

    fn labels(&self, file: &str) -> Result<Option<LabelMap<Mni>>, ReportError> {
        let Some(bytes) = self.bytes(file)? else { return Ok(None) };
        Ok(Some(nifti::decode_labels(&bytes, file, &ReadOptions::default())?.0.relabelled()))
    }

    fn intensities(&self, file: &str) -> Result<Option<Volume<f32, Mni>>, ReportError> {
        let Some(bytes) = self.bytes(file)? else { return Ok(None) };
        Ok(Some(nifti::decode(&bytes, file, &ReadOptions::default())?.volume.relabelled()))
    }

    fn transform<M: Frame, F: Frame>(&self, file: &str) -> Result<Option<RigidTransform<M, F>>, ReportError> {
        let Some(text) = self.text(file)? else { return Ok(None) };
        Ok(Some(transform_text::rigid_from_text(&text, file)?))
    }

    /// An image and its brain mask, which must share a grid; `None` when either is absent.
    fn masked_image(&self, image: &str, mask: &str) -> Result<Option<MaskedImage>, ReportError> {
        let (Some(volume), Some(brain)) = (self.intensities(image)?, self.mask(mask)?) else { return Ok(None) };
        if !volume.grid.coincides(&brain.grid, 1e-3) {
            return Err(ReportError::Grid { file: mask.to_owned(), other: image.to_owned() });
        }
        Ok(Some((volume, brain)))
    }

    /// The images in the MNI frame; `None` without the pre-operative image and its brain.
    fn images(&self) -> Result<Option<CaseImages>, ReportError> {
        let pre = self.masked_image(layout::PRE_T1, layout::PRE_BRAIN)?;
        let Some((pre, pre_brain)) = pre else { return Ok(None) };
        let pre_from_post = self.transform::<Post, Pre>(layout::PRE_FROM_POST_TEXT)?;
        let mni_from_pre = self.transform::<Pre, Mni>(layout::MNI_FROM_PRE_TEXT)?;
        // As scanned: the coordinates of the one scan are taken for those of the other.
        let registered_from_scanned = pre_from_post.zip(mni_from_pre).map(|(pre_from_post, mni_from_pre)| {
            mni_from_pre.inverse().relabelled::<Mni, Post>().then(&pre_from_post).then(&mni_from_pre)
        });
        Ok(Some(CaseImages {
            pre,
            pre_brain,
            post: self.masked_image(layout::POST_T1, layout::POST_BRAIN)?,
            labels: self.labels(layout::PRE_LABELS)?,
            resected: self.mask(layout::RESECTED)?,
            cavity: self.mask(layout::CAVITY)?,
            registered_from_scanned,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::SampleOutcome;
    use crate::geometry::Position;
    use crate::image::Grid;
    use crate::mesh::format::Field;

    fn mesh() -> TetMesh {
        let nodes = vec![[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 50.0], [50.0, 50.0, 50.0]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![2, 3]).unwrap();
        mesh.set_nodes("margin", vec![1, 2, 4]).unwrap();
        mesh
    }

    fn write(folder: &Path, file: &str, bytes: &[u8]) {
        write_whole(&folder.join(file), bytes).unwrap();
    }

    fn case(folder: &Path) {
        let mesh = mesh();
        write(folder, layout::REST_MESH, &vtu::encode(&mesh, &[], &[]).unwrap());
        let fields = [
            Field { name: "displacement".to_owned(), components: 3, values: vec![0.5; 15] },
            Field::scalar("rmse_mm", vec![0.0, 1.0, 2.0, 0.5, 3.75]),
            Field::scalar("rmse_observed", vec![0.0, 1.0, 1.0, 1.0, 1.0]),
        ];
        write(folder, &layout::SAMPLE_STATE.of("sample-00"), &vtu::encode(&mesh, &fields, &[]).unwrap());
        let sample = SampleOutcome {
            id: "sample-00".to_owned(),
            converged: true,
            rmse_mm: [("margin".to_owned(), 2.5)].into(),
            ..SampleOutcome::default()
        };
        let outcome = ExperimentOutcome {
            samples: vec![sample],
            best_sample: Some("sample-00".to_owned()),
            ..ExperimentOutcome::default()
        };
        write(folder, layout::OUTCOME, outcome.to_json("x").unwrap().as_bytes());
    }

    #[test]
    fn a_case_becomes_a_page_whose_colours_span_its_errors() {
        let folder = tempfile::tempdir().unwrap();
        case(folder.path());
        let page = read_case(folder.path()).unwrap();
        assert_eq!(page.mesh_pictures.len(), 3);
        let map = page.error_map.as_ref().unwrap();
        // The node that no reference is there for is grey, not without error.
        assert_eq!((map.scale.low, map.scale.high), (0.0, 3.75));
        assert_eq!(map.errors_mm, [("margin".to_owned(), vec![1.0, 2.0, 3.75])]);
        let deformed = &page.viewer.as_ref().unwrap().surfaces[1];
        assert_eq!(deformed.surface.nodes_mm[0], [0.5; 3]);
        let path = write_report(folder.path()).unwrap();
        let html = std::fs::read_to_string(path).unwrap();
        assert!(folder.path().join(layout::BEST_ERRORS.of("margin")).is_file());
        assert!(html.contains("id=\"view\"") && !html.contains(&folder.path().display().to_string()));
    }

    #[test]
    fn images_are_masked_and_a_known_pose_is_undone() {
        let folder = tempfile::tempdir().unwrap();
        case(folder.path());
        let grid = Grid::<Mni>::axis_aligned([30, 30, 30], [2.0; 3], [-30.0; 3]);
        let radius = |n: usize| {
            let [i, j, k] = grid.voxel(n).map(|x| x as f64);
            grid.position([i, j, k].into()).mm.coords.norm()
        };
        let brain = Mask::from_data(grid, (0..grid.len()).map(|n| radius(n) < 24.0).collect());
        let image = Volume::from_data(grid, (0..grid.len()).map(|n| 100.0 + radius(n) as f32).collect());
        for (scan, mask) in [(layout::PRE_T1, layout::PRE_BRAIN), (layout::POST_T1, layout::POST_BRAIN)] {
            write(folder.path(), scan, &nifti::encode_f32(&image));
            write(folder.path(), mask, &nifti::encode_mask(&brain));
        }
        let none = brain.map(|_| false);
        write(folder.path(), layout::CAVITY, &nifti::encode_mask(&none));
        write(folder.path(), layout::PRE_FROM_POST_TEXT, b"1 0 0 10\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        write(folder.path(), layout::MNI_FROM_PRE_TEXT, b"0 -1 0 0\n1 0 0 0\n0 0 1 0\n0 0 0 1\n");
        let images = Case { folder: folder.path() }.images().unwrap().unwrap();
        // A point of the post-operative scan moves by +10 mm along the scanner's x, which is the frame's y.
        let moved = images.registered_from_scanned.unwrap().apply(Position::new(1.0, 2.0, 3.0));
        assert!((moved.mm - nalgebra::Point3::new(1.0, 12.0, 3.0)).norm() < 1e-12, "{moved:?}");
        let page = read_case(folder.path()).unwrap();
        assert_eq!((page.registration.as_ref().unwrap().has_before, page.mosaics.len()), (true, 2));
        write(folder.path(), layout::PRE_BRAIN, b"no");
        let message = read_case(folder.path()).unwrap_err().to_string();
        assert!(message.contains(layout::PRE_BRAIN), "{message}");
    }

    #[test]
    fn what_is_not_there_is_named_and_what_is_damaged_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(read_case(folder.path()), Err(ReportError::NoCase { .. })));
        case(folder.path());
        std::fs::remove_file(folder.path().join(layout::SAMPLE_STATE.of("sample-00"))).unwrap();
        let page = read_case(folder.path()).unwrap();
        assert!(page.absent.iter().any(|a| a.contains("the file of sample-00")), "{:?}", page.absent);
        write(folder.path(), layout::OUTCOME, b"{\"kind\": 3}");
        let message = read_case(folder.path()).unwrap_err().to_string();
        assert!(message.contains(layout::OUTCOME), "{message}");
        write(folder.path(), layout::REST_MESH, b"<VTKFile");
        assert!(read_case(folder.path()).is_err());
    }
}
