//! Files for other people's viewers, made from a case: 3D Slicer, Connectome Workbench, ParaView.
//!
//! | file | for |
//! |---|---|
//! | `anat/pre_space-MNI_dseg.seg.nrrd` | 3D Slicer: tissue, ventricles and resected tissue with names and colours |
//! | `anat/post_space-MNI_label-cavity.seg.nrrd` | 3D Slicer: the cavity |
//! | `sim/best_SET.surf.gii`, `sim/best_SET.shape.gii` | Workbench, FreeSurfer: the deformed surface and its error in mm (NaN: no target there) |
//! | `sim/samples.pvd` | ParaView: the samples as one series |

use super::colour::{CAVITY, RESECTED, Rgb, VENTRICLE, of_label};
use super::figure::CaseImages;
use super::mesh_figure::set_facets;
use crate::experiment::outcome::ExperimentOutcome;
use crate::image::LabelMap;
use crate::image::seg_nrrd::{self, Segment};
use crate::layout;
use crate::mesh::format::{Field, WriteError, gifti, pvd};
use crate::mesh::{TetMesh, TriMesh};
use crate::segment::label;

/// A file by its path in the case directory.
pub type CaseFile = (String, Vec<u8>);

fn segment(label: u8, colour: Rgb) -> Segment {
    let name = label::name(label).unwrap_or("label").replace('_', " ");
    Segment { label, name, colour: fractions(colour) }
}

fn fractions(colour: Rgb) -> [f64; 3] {
    colour.map(|c| f64::from(c) / 255.0)
}

/// Segmentations of a case for 3D Slicer.
pub fn segmentations(images: &CaseImages) -> Vec<CaseFile> {
    let mut files = Vec::new();
    if let Some(labels) = &images.labels {
        let mut labels = labels.clone();
        if let Some(resected) = images.resected.as_ref().filter(|r| r.grid.coincides(&labels.grid, 1e-3)) {
            for (l, inside) in labels.data.iter_mut().zip(&resected.data) {
                // As what is meshed: nothing is taken outside the brain, and a ventricle stays one.
                if *inside && ![label::BACKGROUND, label::VENTRICLE].contains(l) {
                    *l = label::RESECTED;
                }
            }
        }
        let mut segments = vec![
            segment(label::CSF, of_label(label::CSF)),
            segment(label::GREY_MATTER, of_label(label::GREY_MATTER)),
            segment(label::WHITE_MATTER, of_label(label::WHITE_MATTER)),
            segment(label::VENTRICLE, VENTRICLE),
            segment(label::RESECTED, RESECTED),
        ];
        let lesions = [label::TUMOUR, label::OEDEMA].into_iter().filter(|l| labels.data.contains(l));
        segments.extend(lesions.map(|l| segment(l, of_label(l))));
        files.push((layout::LABELS_FOR_SLICER.to_owned(), seg_nrrd::encode(&labels, &segments)));
    }
    if let Some(cavity) = &images.cavity {
        let labels: LabelMap<_> = cavity.map(u8::from);
        let segments = [Segment { label: 1, name: "cavity".to_owned(), colour: fractions(CAVITY) }];
        files.push((layout::CAVITY_FOR_SLICER.to_owned(), seg_nrrd::encode(&labels, &segments)));
    }
    files
}

/// Deformed surfaces with their errors: the outer one as `pial`, then every set with facets. An error is NaN where a node has no
/// target: such a node is not without error.
///
/// # Errors
/// [`WriteError`] when there is not one error per node.
pub fn error_surfaces(
    mesh: &TetMesh,
    deformed_mm: &[[f64; 3]],
    errors_mm: &[f64],
    sets: &[String],
) -> Result<Vec<CaseFile>, WriteError> {
    let boundary = mesh.boundary_facets(|_| true);
    let mut files = Vec::new();
    let named = sets.iter().filter(|set| *set != "all");
    let parts = named.filter_map(|set| Some((set.as_str(), set_facets(mesh, set, &boundary)?)));
    for (name, facets) in std::iter::once(("pial", boundary.clone())).chain(parts) {
        let (surface, old) = TriMesh::from_facets(deformed_mm, &facets);
        let errors = old.iter().map(|&n| errors_mm.get(n as usize).copied().unwrap_or(f64::NAN)).collect();
        let shape = gifti::encode_shape(surface.nodes_mm.len(), &[Field::scalar("rmse_mm", errors)])?;
        files.push((layout::BEST_SURFACE.of(name), gifti::encode_surface(&surface, gifti::Space::Mni152, name)));
        files.push((layout::BEST_ERRORS.of(name), shape));
    }
    Ok(files)
}

/// The samples that have a file as one series; the time is the sample's number.
pub fn series(outcome: &ExperimentOutcome) -> Option<CaseFile> {
    let beside = |file: &String| std::path::Path::new(file).file_name().map(|name| name.to_string_lossy().into_owned());
    let files: Vec<(f64, String)> =
        outcome.samples.iter().enumerate().filter_map(|(n, s)| Some((n as f64, beside(s.file.as_ref()?)?))).collect();
    let named: Vec<(f64, &str)> = files.iter().map(|(n, f)| (*n, f.as_str())).collect();
    (!named.is_empty()).then(|| (layout::SAMPLES_SERIES.to_owned(), pvd::encode(&named)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::SampleOutcome;

    fn mesh() -> TetMesh {
        let nodes = vec![[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 50.0], [50.0, 50.0, 50.0]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![2, 3]).unwrap();
        mesh.set_nodes("margin", vec![1, 2, 4]).unwrap();
        mesh
    }

    #[test]
    fn errors_stay_with_their_nodes() {
        let mesh = mesh();
        let moved: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|p| [p[0] + 1.0, p[1], p[2]]).collect();
        let errors = [0.0, 1.5, 2.5, f64::NAN, 4.5];
        let files = error_surfaces(&mesh, &moved, &errors, &["all".to_owned(), "margin".to_owned()]).unwrap();
        let names: Vec<&str> = files.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(
            names,
            [
                &layout::BEST_SURFACE.of("pial"),
                &layout::BEST_ERRORS.of("pial"),
                &layout::BEST_SURFACE.of("margin"),
                &layout::BEST_ERRORS.of("margin")
            ]
        );
        let margin = gifti::decode_surface(&files[2].1, "x").unwrap();
        assert_eq!(margin.nodes_mm, [[51.0, 0.0, 0.0], [1.0, 50.0, 0.0], [51.0, 50.0, 50.0]]);
        assert_eq!(gifti::decode_shape(&files[3].1, "x").unwrap()[0].values, [1.5, 2.5, 4.5]);
    }

    #[test]
    fn the_series_names_files_beside_it() {
        let sample = |id: &str, file: Option<&str>| SampleOutcome {
            id: id.to_owned(),
            file: file.map(str::to_owned),
            ..SampleOutcome::default()
        };
        let [a, c] = ["a", "c"].map(|id| layout::SAMPLE_STATE.of(id));
        let samples = vec![sample("a", Some(&a)), sample("b", None), sample("c", Some(&c))];
        let outcome = ExperimentOutcome { samples, ..ExperimentOutcome::default() };
        let text = String::from_utf8(series(&outcome).unwrap().1).unwrap();
        assert!(text.contains(r#"timestep="2" part="0" file="c.vtu""#) && !text.contains("file=\"sim"));
        assert!(series(&ExperimentOutcome::default()).is_none());
    }
}
