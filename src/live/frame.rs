//! What goes to the page in binary: the mesh once, then frames. Little-endian; a header of 32-bit words, then arrays.

use super::command::Colour;
use super::session::Session;
use crate::fem::live::Readout;
use crate::mesh::TetMesh;

/// The first word of everything binary: `HGML`.
const MAGIC: u32 = u32::from_le_bytes(*b"HGML");
const MESH: u32 = 1;
const FRAME: u32 = 2;
/// Words of a frame's header.
pub const HEAD: usize = 20;

/// What the clock says, for the header.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// Steps a second.
    pub hz: f32,
    /// Messages of the page that have been taken up.
    pub taken: u32,
    /// No steps are taken.
    pub paused: bool,
}

/// The mesh: words (magic, 1, nodes, tetrahedra, facets), then nodes (f32, mm), facets, tetrahedra (u32), labels (u8).
pub fn mesh_bytes(mesh: &TetMesh) -> Vec<u8> {
    let facets = mesh.boundary_facets(|_| true);
    let mut bytes = Vec::new();
    for word in [MAGIC, MESH, mesh.nodes_mm().len() as u32, mesh.tets().len() as u32, facets.len() as u32] {
        bytes.extend(word.to_le_bytes());
    }
    mesh.nodes_mm().as_flattened().iter().for_each(|&x| bytes.extend((x as f32).to_le_bytes()));
    facets.as_flattened().iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    mesh.tets().as_flattened().iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    bytes.extend_from_slice(mesh.labels());
    bytes
}

/// Energy density around every node, by volume.
fn nodal_energy(session: &Session) -> Vec<f64> {
    let mesh = session.mesh();
    let (_, energy) = session.stepper().cells();
    let mut sums = vec![[0.0; 2]; mesh.nodes_mm().len()];
    for (cell, tet) in mesh.tets().iter().enumerate() {
        let volume = mesh.volume_mm3(cell);
        for &n in tet {
            sums[n as usize][0] += volume * energy[cell];
            sums[n as usize][1] += volume;
        }
    }
    sums.into_iter().map(|[sum, volume]| if volume > 0.0 { sum / volume } else { 0.0 }).collect()
}

/// A frame: the header, positions of all nodes (f32, mm), the number every node is coloured by (f32).
pub fn frame_bytes(session: &Session, readout: &Readout, pace: &Pace, colour: Colour) -> Vec<u8> {
    let moved = session.displacement_mm();
    let nodes = session.mesh().nodes_mm();
    let size = |u: &[f64; 3]| u.iter().map(|x| x * x).sum::<f64>().sqrt();
    let sizes: Vec<f64> = moved.iter().map(size).collect();
    let report = session.report().unwrap_or_default();
    let [grip, ball] = session.stepper().force_n();
    let flags = [pace.paused, session.is_at_rest(), session.is_quasi_static()];
    let flags = flags.iter().enumerate().map(|(n, &set)| u32::from(set) << n).sum::<u32>();
    let mut bytes = Vec::with_capacity(4 * HEAD + 16 * nodes.len());
    for word in [MAGIC, FRAME, nodes.len() as u32, session.steps() as u32, pace.taken, flags] {
        bytes.extend(word.to_le_bytes());
    }
    let numbers = [
        session.time_s(),
        f64::from(pace.hz),
        report.relative_residual,
        report.fastest_mm_per_s,
        sizes.iter().copied().fold(0.0, f64::max),
        readout.energy_j,
        readout.inverted as f64,
        readout.least_volume_ratio,
        size(&grip),
        size(&ball),
        session.time_step_s(),
        session.recovered() as f64,
        report.linear_iterations as f64,
        0.0,
    ];
    for x in numbers {
        bytes.extend((x as f32).to_le_bytes());
    }
    for (x, u) in nodes.iter().zip(&moved) {
        (0..3).for_each(|i| bytes.extend(((x[i] + u[i]) as f32).to_le_bytes()));
    }
    let scalar = if colour == Colour::Energy { nodal_energy(session) } else { sizes };
    for x in scalar {
        bytes.extend((x as f32).to_le_bytes());
    }
    bytes
}
