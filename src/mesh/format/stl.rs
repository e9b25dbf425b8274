//! STL: triangles without connection, single precision, what printers and CAD programs open.

use crate::mesh::TriMesh;

/// The bytes of a binary STL file, mm.
///
/// ```
/// use hgm::mesh::{TriMesh, format::stl};
/// let nodes_mm = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// assert_eq!(stl::encode(&TriMesh { nodes_mm, triangles: vec![[0, 1, 2]] }).len(), 84 + 50);
/// ```
pub fn encode(surface: &TriMesh) -> Vec<u8> {
    // The header must not start with `solid`, which marks the text flavour; 3D Slicer takes a file that names no space for LPS.
    let mut bytes = b"binary STL, mm, SPACE=RAS".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((surface.triangles.len() as u32).to_le_bytes());
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let area_vector = surface.area_vector_mm2(t);
        let normal = area_vector.try_normalize(0.0).unwrap_or_default();
        for x in normal.iter().chain(triangle.iter().flat_map(|&n| &surface.nodes_mm[n as usize])) {
            bytes.extend((*x as f32).to_le_bytes());
        }
        bytes.extend([0, 0]);
    }
    bytes
}
