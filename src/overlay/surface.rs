//! GIFTI surfaces, by the format file of room `mesh`.

use super::drawing::{Carried, Drawing, Kept, NotCarried, OverlayError, damaged, places};
use crate::mesh::TriMesh;
use crate::mesh::format::gifti::{Space, decode_surface_in, encode_surface};

/// The triangles.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    triangles: Vec<[u32; 3]>,
    /// Arrays beside the nodes and the triangles.
    more: usize,
    /// The frame that the file says.
    declared: Option<Space>,
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    let prefix = format!("{name}: ");
    let said = |e: crate::mesh::format::ReadError| e.to_string().trim_start_matches(&prefix).to_owned();
    let (surface, declared) = decode_surface_in(bytes, name).map_err(|e| damaged(name, "the surface", said(e)))?;
    const ARRAY: &[u8] = b"<DataArray ";
    let arrays = bytes.windows(ARRAY.len()).filter(|w| *w == ARRAY).count();
    let kept = Box::new(Surface { triangles: surface.triangles, more: arrays.saturating_sub(2), declared });
    Ok(Drawing { points_mm: surface.nodes_mm, names: Vec::new(), pairs_mm: Vec::new(), kept })
}

impl Kept for Surface {
    fn encode(&self, carried: &[Carried], names: &[String]) -> Vec<u8> {
        self.encode_in(carried, names, Space::Scanner)
    }

    fn encode_in(&self, carried: &[Carried], _: &[String], space: Space) -> Vec<u8> {
        let surface = TriMesh { nodes_mm: places(carried), triangles: self.triangles.clone() };
        encode_surface(&surface, space, "carried")
    }

    fn declared(&self) -> Option<Space> {
        self.declared
    }

    fn not_carried(&self) -> Option<NotCarried> {
        (self.more > 0).then_some(NotCarried::Arrays(self.more))
    }

    fn triangles(&self, _: usize, _: &str) -> Option<Result<Vec<[u32; 3]>, OverlayError>> {
        Some(Ok(self.triangles.clone()))
    }
}
