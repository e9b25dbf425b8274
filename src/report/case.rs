//! A case directory to a page: reads what is there, says what is not.

pub use super::case_files::ReportError;

use super::case_files::{Case, best_sample, displaced};
use super::case_views::{add_results, observed_errors};
use super::figure::CaseImages;
use super::glance_figure::glance_figure;
use super::hand_off::{self, CaseFile};
use super::left_behind::left_behind;
use super::listing::listing;
use super::mesh_figure::{PICTURE, cut_views, legend, middle_mm};
use super::page::{CaptionedPicture, CasePage, PredictionFigure, ShiftFigure, title_of};
use super::residual_figure::residual_figure;
use super::shift_figure::{prediction_figure, shift_figure};
use crate::artefact::{sha256_hex, write_whole};
use crate::experiment::estimate::{SEEN_AT, SEEN_DISPLACEMENT};
use crate::experiment::field::BrainShift;
use crate::experiment::landmarks::Evaluation;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome};
use crate::experiment::predict::{Prediction, PredictionEvaluation};
use crate::geometry::Mni;
use crate::image::Volume;
use crate::image::nifti::{self, ReadOptions};
use crate::layout;
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, MeshWithFields};
use std::path::{Path, PathBuf};

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

/// The sections that show the scans alone.
fn scans_of(case: &Case<'_>, images: Option<&CaseImages>) -> Result<CasePage, ReportError> {
    let Some(images) = images else { return Ok(CasePage::default()) };
    let seen = case.bytes(layout::SAG)?.map(|bytes| nifti::decode_displacement(&bytes, layout::SAG)).transpose()?;
    let (glance, (registration, mosaics)) = rayon::join(
        || glance_figure(images, seen.map(Volume::relabelled).as_ref()),
        || rayon::join(|| images.registration(), || images.mosaics()),
    );
    Ok(CasePage { glance, registration, mosaics, ..CasePage::default() })
}

/// The sections of the samples or the estimate; what of them is not there is named.
fn results_of(
    case: &Case<'_>,
    outcome: Option<&ExperimentOutcome>,
    rest: Option<&MeshWithFields>,
    images: Option<&CaseImages>,
) -> Result<CasePage, ReportError> {
    let mut page = CasePage::default();
    match outcome {
        Some(outcome) if outcome.kind == ExperimentKind::Prediction => {}
        Some(outcome) => add_results(case, outcome, rest, images, &mut page)?,
        None => page.absent.push(format!("samples and errors ({} is not there; run `hgm sweep`)", layout::OUTCOME)),
    }
    Ok(page)
}

/// What the estimate leaves of the displacement of the nodes that it was held against; nothing where those were surfaces.
fn residuals_of(case: &Case<'_>) -> Result<Option<ShiftFigure>, ReportError> {
    let Some(state) = case.mesh(layout::ESTIMATE_STATE)? else { return Ok(None) };
    let vectors = |name: &str| state.point_field(name).and_then(Field::vectors);
    let (Some(model), Some(seen), Some(at)) =
        (vectors("displacement"), vectors(SEEN_DISPLACEMENT), state.point_field(SEEN_AT))
    else {
        return Ok(None);
    };
    let held = at.values.iter().enumerate().filter(|(_, held)| **held > 0.5);
    let left = held.map(|(n, _)| (n, [0, 1, 2].map(|a| seen[n][a] - model[n][a])));
    Ok(residual_figure(state.mesh.nodes_mm(), &left.collect::<Vec<_>>()))
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
/// [`ReportError`] for a file that is there but cannot be used; what is not there is named on the page, and so are numbers that
/// another version wrote.
pub fn read_case(folder: &Path) -> Result<CasePage, ReportError> {
    Ok(read_with_images(folder)?.0)
}

/// The same with the scans that it shows, where they are there.
fn read_with_images(folder: &Path) -> Result<(CasePage, Option<CaseImages>), ReportError> {
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
    let absent = &mut page.absent;
    page.prediction = case.numbers(layout::PREDICTION_JSON, ["the brain shift expected", "hgm predict"], absent)?;
    page.evaluation = evaluation_of(&case, absent)?;
    if !left_behind(folder).contains(layout::SHIFT_JSON) {
        page.brain_shift = case.numbers(layout::SHIFT_JSON, ["the brain shift", "hgm run"], absent)?;
    }
    page.landmarks = landmarks_in(&case, absent)?.filter(|_| page.brain_shift.is_some());
    let estimated = outcome.as_ref().is_some_and(|outcome| outcome.estimate.is_some());
    // Sections that need nothing of each other are drawn side by side.
    let ((scans, cuts), (results, (shift, (expected, residuals)))) = rayon::join(
        || {
            let cuts = || rest.as_ref().map(|rest| cut_views(&rest.mesh, focus_mm(&rest.mesh), PICTURE));
            rayon::join(|| scans_of(&case, images.as_ref()), cuts)
        },
        || {
            let predicted = || expected_of(&case, page.prediction.as_ref());
            let left = || if estimated { residuals_of(&case) } else { Ok(None) };
            rayon::join(
                || results_of(&case, outcome.as_ref(), rest.as_ref(), images.as_ref()),
                || rayon::join(|| shift_of(&case, page.brain_shift.as_ref()), || rayon::join(predicted, left)),
            )
        },
    );
    let (scans, results) = (scans?, results?);
    (page.glance, page.registration, page.mosaics) = (scans.glance, scans.registration, scans.mosaics);
    if let (Some(rest), Some(cuts)) = (&rest, cuts) {
        page.mesh_pictures = cuts;
        page.mesh_legend = legend(&rest.mesh);
    } else {
        page.absent.push(format!("the mesh ({} is not there)", layout::REST_MESH));
    }
    (page.error_map, page.viewer) = (results.error_map, results.viewer);
    page.absent.extend(results.absent);
    (page.prediction_figure, page.shift_figure, page.residual_figure) = (expected?, shift?, residuals?);
    page.outcome = outcome;
    Ok((page, images))
}

/// The prediction against what was seen: nothing where another prediction was evaluated.
fn evaluation_of(case: &Case<'_>, absent: &mut Vec<String>) -> Result<Option<PredictionEvaluation>, ReportError> {
    let sum = case.bytes(layout::PREDICTION_JSON)?.map(|bytes| sha256_hex(&bytes));
    let what = ["the prediction against what was seen", "hgm evaluate"];
    let found: Option<PredictionEvaluation> = case.numbers(layout::EVALUATION_JSON, what, absent)?;
    Ok(found.filter(|found| sum.as_ref() == Some(&found.prediction_sha256)))
}

/// Landmarks that were held against the results that are there now.
fn landmarks_in(case: &Case<'_>, absent: &mut Vec<String>) -> Result<Option<Evaluation>, ReportError> {
    let what = ["landmarks against the brain shift", "hgm evaluate"];
    let found: Option<Evaluation> = case.numbers(layout::LANDMARKS_JSON, what, absent)?;
    let now = found.is_some().then(|| results_sha256(case.folder)).transpose()?;
    Ok(found.filter(|found| now.as_ref() == Some(&found.of_sha256)))
}

/// Checksum of the results that landmarks in a case are carried by.
///
/// # Errors
/// [`ReportError`] for a file that cannot be read.
pub fn results_sha256(folder: &Path) -> Result<String, ReportError> {
    let case = Case { folder };
    let results = [layout::SHIFT_JSON, layout::OUTCOME].map(|file| case.bytes(file));
    let mut all = Vec::new();
    for bytes in results {
        all.extend(bytes?.unwrap_or_default());
    }
    Ok(sha256_hex(&all))
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
    let (mut page, images) = read_with_images(folder)?;
    let mut files = Vec::new();
    let case = Case { folder };
    if let Some(images) = &images {
        files.extend(hand_off::segmentations(images));
    }
    if let Some(outcome) = &page.outcome {
        files.extend(hand_off::series(outcome));
        if let Some((file, sample)) = best_sample(&case, outcome)?
            && let Some(errors) = observed_errors(&sample)
        {
            let deformed = displaced(&file, &sample)?;
            let sets = outcome.rmse_sets();
            let surfaces = hand_off::error_surfaces(&sample.mesh, &deformed, &errors, &sets);
            files.extend(surfaces.map_err(ReportError::HandOff)?);
        }
    }
    // Answers that no stage has made may be of an earlier state, too.
    let mut left = left_behind(folder);
    let landmarks = landmarks_in(&case, &mut Vec::new())?;
    let answers = [(layout::LANDMARKS_JSON, landmarks.is_none()), (layout::EVALUATION_JSON, page.evaluation.is_none())];
    left.extend(answers.into_iter().filter(|(_, earlier)| *earlier).map(|(file, _)| file.to_owned()));
    page.files = listing(folder, &files.iter().map(|(file, _)| file.as_str()).collect(), &left);
    files.insert(0, (layout::PAGE.to_owned(), page.to_html().into_bytes()));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::SampleOutcome;
    use crate::geometry::Position;
    use crate::image::{Grid, Mask};
    use crate::mesh::format::{gifti, vtu};

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

    #[test]
    fn a_node_without_a_target_is_without_an_error_in_the_files_for_other_viewers_too() {
        let folder = tempfile::tempdir().unwrap();
        case(folder.path());
        let files = report_files(folder.path()).unwrap();
        let errors = |set: &str| {
            let (name, bytes) = files.iter().find(|(name, _)| *name == layout::BEST_ERRORS.of(set)).unwrap();
            gifti::decode_shape(bytes, name).unwrap().swap_remove(0).values
        };
        // Not 0 mm: the file's zero stands for nothing there.
        assert!(errors("pial")[0].is_nan() && errors("pial")[1..] == [1.0, 2.0, 0.5, 3.75], "{:?}", errors("pial"));
        assert_eq!(errors("margin"), [1.0, 2.0, 3.75]);
    }

    #[test]
    fn numbers_that_are_there_but_cannot_be_read_are_named() {
        let folder = tempfile::tempdir().unwrap();
        case(folder.path());
        let before = read_case(folder.path()).unwrap().absent.len();
        let all = [layout::PREDICTION_JSON, layout::EVALUATION_JSON, layout::SHIFT_JSON, layout::LANDMARKS_JSON];
        for file in all {
            write(folder.path(), file, b"{\"of_a_later_version\": 1}");
        }
        let page = read_case(folder.path()).unwrap();
        assert_eq!(page.absent.len(), before + all.len(), "{:?}", page.absent);
        for file in all {
            let named =
                |what: &String| what.contains(file) && what.contains("cannot be read") && what.contains("`hgm ");
            assert!(page.absent.iter().any(named), "{file}: {:?}", page.absent);
        }
        assert!(page.prediction.is_none() && page.brain_shift.is_none());
    }

    #[test]
    fn what_another_job_has_left_in_the_folder_is_neither_shown_nor_linked() {
        use crate::artefact::{Produced, Stage};

        let folder = tempfile::tempdir().unwrap();
        case(folder.path());
        let files = vec![(layout::SHIFT_JSON.to_owned(), serde_json::to_vec(&BrainShift::default()).unwrap())];
        let made = || Ok::<_, std::convert::Infallible>(Produced { files, ..Produced::default() });
        let key = Stage::new("fields", 1, folder.path(), &()).run(false, made).unwrap().manifest.key;
        let of_outcome = |stages: serde_json::Value| {
            let provenance = serde_json::json!({ "program": "hgm", "stages": stages });
            write(folder.path(), layout::PROVENANCE, provenance.to_string().as_bytes());
        };
        let links = |file: &str| {
            let (_, page) = report_files(folder.path()).unwrap().swap_remove(0);
            String::from_utf8(page).unwrap().contains(&format!("href=\"{file}\""))
        };
        let of_sha256 = results_sha256(folder.path()).unwrap();
        let landmarks = Evaluation { of_sha256, ..Evaluation::default() };
        write(folder.path(), layout::LANDMARKS_JSON, &serde_json::to_vec(&landmarks).unwrap());
        of_outcome(serde_json::json!([{ "stage": "fields", "key": key }]));
        assert!(links(layout::SHIFT_JSON) && links(layout::LANDMARKS_JSON) && links(layout::OUTCOME));
        assert!(read_case(folder.path()).unwrap().brain_shift.is_some());
        of_outcome(serde_json::json!([]));
        assert!(!links(layout::SHIFT_JSON) && links(layout::OUTCOME));
        assert!(read_case(folder.path()).unwrap().brain_shift.is_none());
        let landmarks = Evaluation { of_sha256: "another".to_owned(), ..landmarks };
        write(folder.path(), layout::LANDMARKS_JSON, &serde_json::to_vec(&landmarks).unwrap());
        assert!(!links(layout::LANDMARKS_JSON));
    }

    #[test]
    fn landmarks_of_results_that_are_no_longer_there_are_not_shown() {
        let folder = tempfile::tempdir().unwrap();
        let write = |file: &str, text: &str| write_whole(&folder.path().join(file), text.as_bytes()).unwrap();
        write(layout::OUTCOME, "{}");
        let kept = Evaluation { of_sha256: results_sha256(folder.path()).unwrap(), ..Evaluation::default() };
        write(layout::LANDMARKS_JSON, &serde_json::to_string(&kept).unwrap());
        let shown = || landmarks_in(&Case { folder: folder.path() }, &mut Vec::new()).unwrap();
        assert_eq!(shown(), Some(kept));
        write(layout::OUTCOME, "{\"made\": \"again\"}");
        assert_eq!(shown(), None);
    }
}
