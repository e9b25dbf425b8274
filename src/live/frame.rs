//! What goes to the page in binary: the mesh and what is seen beside it once, then frames. Little-endian; a header of 32-bit words, then arrays.

use super::session::Session;
use crate::fem::live::Readout;
use crate::mesh::TriMesh;
use crate::workflow::Scan;

/// The first word of everything binary: `HGML`.
const MAGIC: u32 = u32::from_le_bytes(*b"HGML");
const MESH: u32 = 1;
const FRAME: u32 = 2;
const TARGET: u32 = 3;
const SCAN: u32 = 4;
/// Words of a frame's header.
pub const HEAD: usize = 20;

/// What the header says besides the session.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// Steps a second.
    pub hz: f32,
    /// Messages of the page that have been taken up.
    pub taken: u32,
    /// No steps are taken.
    pub paused: bool,
    /// What the numbers are, as its place among what the body can be coloured by: the page names what it shows after this, not
    /// after what was asked for.
    pub colour: u32,
}

/// The mesh: words (magic, 1, nodes, tetrahedra, facets, facets without the resected tissue, label of that or 255), then nodes
/// (f32, mm), facets, facets without, tetrahedra (u32), labels (u8).
pub(super) fn mesh_bytes(session: &Session) -> Vec<u8> {
    let (mesh, parts) = (session.mesh(), session.parts());
    let facets = mesh.boundary_facets(|_| true);
    let mut without = parts.mesh(true).map_or_else(Vec::new, |rest| rest.boundary_facets(|_| true));
    without.iter_mut().flatten().for_each(|n| *n = parts.whole_of(true, *n));
    let counts = [mesh.nodes_mm().len(), mesh.tets().len(), facets.len(), without.len()];
    let mut bytes = Vec::new();
    for word in [MAGIC, MESH].into_iter().chain(counts.map(|n| n as u32)) {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(u32::from(parts.label().unwrap_or(u8::MAX)).to_le_bytes());
    mesh.nodes_mm().as_flattened().iter().for_each(|&x| bytes.extend((x as f32).to_le_bytes()));
    facets.iter().chain(&without).flatten().for_each(|n| bytes.extend(n.to_le_bytes()));
    mesh.tets().as_flattened().iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    bytes.extend_from_slice(mesh.labels());
    bytes
}

/// A target surface: words (magic, 3, nodes, triangles, bytes of its name), nodes (f32, mm), triangles (u32), its name.
pub(super) fn target_bytes(name: &str, surface: &TriMesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    for word in [MAGIC, TARGET, surface.nodes_mm.len() as u32, surface.triangles.len() as u32, name.len() as u32] {
        bytes.extend(word.to_le_bytes());
    }
    surface.nodes_mm.as_flattened().iter().for_each(|&x| bytes.extend((x as f32).to_le_bytes()));
    surface.triangles.as_flattened().iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    bytes.extend_from_slice(name.as_bytes());
    bytes
}

/// The scan: words (magic, 4, voxels along x, y, z), middle of the first voxel and edge of a voxel (f32, mm), values (u8).
pub(super) fn scan_bytes(scan: &Scan) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(36 + scan.values.len());
    for word in [MAGIC, SCAN].into_iter().chain(scan.dims.map(|n| n as u32)) {
        bytes.extend(word.to_le_bytes());
    }
    for x in scan.origin_mm.into_iter().chain([scan.voxel_mm]) {
        bytes.extend((x as f32).to_le_bytes());
    }
    bytes.extend_from_slice(&scan.values);
    bytes
}

/// A frame: the header, positions of all nodes (f32, mm), the `numbers` that nodes are coloured by (f32).
pub fn frame_bytes(session: &Session, readout: &Readout, pace: &Pace, numbers: &[f64]) -> Vec<u8> {
    let moved = session.displacement_mm();
    let nodes = session.mesh().nodes_mm();
    let size = |u: &[f64; 3]| u.iter().map(|x| x * x).sum::<f64>().sqrt();
    let furthest = moved.iter().map(size).fold(0.0, f64::max);
    let report = session.report().unwrap_or_default();
    let [grip, ball] = session.stepper().force_n();
    let flags = [pace.paused, session.is_at_rest(), session.is_quasi_static(), session.resection() == Some(true)];
    let flags = flags.iter().enumerate().map(|(n, &set)| u32::from(set) << n).sum::<u32>();
    let mut bytes = Vec::with_capacity(4 * HEAD + 16 * nodes.len());
    for word in [MAGIC, FRAME, nodes.len() as u32, session.steps() as u32, pace.taken, flags] {
        bytes.extend(word.to_le_bytes());
    }
    let figures = [
        session.time_s(),
        f64::from(pace.hz),
        report.relative_residual,
        report.fastest_mm_per_s,
        furthest,
        readout.energy_j,
        readout.inverted as f64,
        readout.least_volume_ratio,
        size(&grip),
        size(&ball),
        session.time_step_s(),
        session.recovered() as f64,
        report.linear_iterations as f64,
        f64::from(pace.colour),
    ];
    for x in figures {
        bytes.extend((x as f32).to_le_bytes());
    }
    for (x, u) in nodes.iter().zip(&moved) {
        (0..3).for_each(|i| bytes.extend(((x[i] + u[i]) as f32).to_le_bytes()));
    }
    for x in numbers {
        bytes.extend((*x as f32).to_le_bytes());
    }
    bytes
}
