//! A case directory, file by file: what is not there is no error, what is damaged is.

use super::figure::CaseImages;
use crate::artefact::WriteError;
use crate::experiment::outcome::{ExperimentOutcome, OutcomeError, SampleOutcome};
use crate::geometry::{Frame, Mni, Post, Pre, RigidTransform};
use crate::image::nifti::{self, NiftiError, ReadOptions};
use crate::image::{LabelMap, Mask, Volume};
use crate::layout;
use crate::mesh::TriMesh;
use crate::mesh::format::{MeshWithFields, ReadError, WriteError as FieldError, gifti, vtu};
use crate::register::transform_text::{self, TransformTextError};
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use thiserror::Error;

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
pub(super) struct Case<'a> {
    pub(super) folder: &'a Path,
}

/// An image and where it is shown.
type MaskedImage = (Volume<f32, Mni>, Mask<Mni>);

impl Case<'_> {
    /// The bytes of a file, or `None` when it is not there.
    pub(super) fn bytes(&self, file: &str) -> Result<Option<Vec<u8>>, ReportError> {
        let path = self.folder.join(file);
        match std::fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(ReportError::Read { path, source }),
        }
    }

    pub(super) fn text(&self, file: &str) -> Result<Option<String>, ReportError> {
        let Some(bytes) = self.bytes(file)? else { return Ok(None) };
        String::from_utf8(bytes).map(Some).map_err(|_| ReportError::Text { file: file.to_owned() })
    }

    /// Numbers of ours; `None` when they are not there. Those that are there and cannot be read, as another version's, are named
    /// in `absent`: what they are, and what makes them again.
    pub(super) fn numbers<T: DeserializeOwned>(
        &self,
        file: &str,
        [what, command]: [&str; 2],
        absent: &mut Vec<String>,
    ) -> Result<Option<T>, ReportError> {
        let Some(text) = self.text(file)? else { return Ok(None) };
        let unread = |why: &serde_json::Error| {
            format!(
                "{what} ({file} cannot be read, as another version's or a damaged file: {why}; run `{command}` again)"
            )
        };
        let read = serde_json::from_str::<T>(&text);
        absent.extend(read.as_ref().err().map(unread));
        Ok(read.ok())
    }

    pub(super) fn mesh(&self, file: &str) -> Result<Option<MeshWithFields>, ReportError> {
        Ok(self.bytes(file)?.map(|bytes| vtu::decode(&bytes, file)).transpose()?)
    }

    /// The target surfaces, by name.
    pub(super) fn reference_surfaces(&self) -> Result<Vec<(String, TriMesh)>, ReportError> {
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

    pub(super) fn transform<M: Frame, F: Frame>(
        &self,
        file: &str,
    ) -> Result<Option<RigidTransform<M, F>>, ReportError> {
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
    pub(super) fn images(&self) -> Result<Option<CaseImages>, ReportError> {
        let ((pre, labels), (post, (resected, cavity))) = rayon::join(
            || (self.masked_image(layout::PRE_T1, layout::PRE_BRAIN), self.labels(layout::PRE_LABELS)),
            || {
                let masks = || (self.mask(layout::RESECTED), self.mask(layout::CAVITY));
                (self.masked_image(layout::POST_T1, layout::POST_BRAIN), masks())
            },
        );
        let Some((pre, pre_brain)) = pre? else { return Ok(None) };
        let pre_from_post = self.transform::<Post, Pre>(layout::PRE_FROM_POST_TEXT)?;
        let mni_from_pre = self.transform::<Pre, Mni>(layout::MNI_FROM_PRE_TEXT)?;
        // As scanned: the coordinates of the one scan are taken for those of the other.
        let registered_from_scanned = pre_from_post.zip(mni_from_pre).map(|(pre_from_post, mni_from_pre)| {
            mni_from_pre.inverse().relabelled::<Mni, Post>().then(&pre_from_post).then(&mni_from_pre)
        });
        Ok(Some(CaseImages {
            pre,
            pre_brain,
            post: post?,
            labels: labels?,
            resected: resected?,
            cavity: cavity?,
            registered_from_scanned,
        }))
    }
}

/// The best sample's file and its name, when both are there.
pub(super) fn best_sample(
    case: &Case<'_>,
    outcome: &ExperimentOutcome,
) -> Result<Option<(String, MeshWithFields)>, ReportError> {
    let Some(best) = outcome.best() else { return Ok(None) };
    let file = file_of(best);
    Ok(case.mesh(&file)?.map(|sample| (file, sample)))
}

/// Nodes moved by the point array `displacement`; the nodes themselves when it is absent.
pub(super) fn displaced(file: &str, sample: &MeshWithFields) -> Result<Vec<[f64; 3]>, ReportError> {
    let nodes = sample.mesh.nodes_mm();
    let Some(field) = sample.point_field("displacement") else { return Ok(nodes.to_vec()) };
    if field.values.len() != 3 * nodes.len() {
        let (array, found) = (field.name.clone(), field.values.len());
        return Err(ReportError::Array { file: file.to_owned(), array, found, nodes: nodes.len() });
    }
    let moved = |(p, u): (&[f64; 3], &[f64])| [p[0] + u[0], p[1] + u[1], p[2] + u[2]];
    Ok(nodes.iter().zip(field.values.chunks_exact(3)).map(moved).collect())
}

/// A sample's mesh file, relative to the case directory.
pub(super) fn file_of(sample: &SampleOutcome) -> String {
    sample.file.clone().unwrap_or_else(|| layout::SAMPLE_STATE.of(&sample.id))
}
