//! GIFTI surfaces, by the format file of room `mesh`.

use super::drawing::{Carried, Drawing, Kept, NotCarried, OverlayError, damaged, places};
use crate::mesh::TriMesh;
use crate::mesh::format::gifti::{Space, decode_surface, encode_surface};

/// The triangles.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    triangles: Vec<[u32; 3]>,
    /// Arrays beside the nodes and the triangles.
    more: usize,
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    let prefix = format!("{name}: ");
    let said = |e: crate::mesh::format::ReadError| e.to_string().trim_start_matches(&prefix).to_owned();
    let surface = decode_surface(bytes, name).map_err(|e| damaged(name, "the surface", said(e)))?;
    const ARRAY: &[u8] = b"<DataArray ";
    let arrays = bytes.windows(ARRAY.len()).filter(|w| *w == ARRAY).count();
    let kept = Box::new(Surface { triangles: surface.triangles, more: arrays.saturating_sub(2) });
    Ok(Drawing { points_mm: surface.nodes_mm, names: Vec::new(), pairs_mm: Vec::new(), kept })
}

impl Kept for Surface {
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let surface = TriMesh { nodes_mm: places(carried), triangles: self.triangles.clone() };
        encode_surface(&surface, Space::Scanner, "carried")
    }

    fn not_carried(&self) -> Option<NotCarried> {
        (self.more > 0).then_some(NotCarried::Arrays(self.more))
    }

    fn triangles(&self, _: usize, _: &str) -> Option<Result<Vec<[u32; 3]>, OverlayError>> {
        Some(Ok(self.triangles.clone()))
    }
}
