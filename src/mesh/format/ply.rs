//! PLY: a triangle surface with numbers on its nodes, what `MeshLab` and Blender open.

use super::{Field, WriteError, check_fields, plain_name};
use crate::mesh::TriMesh;

/// The bytes of a binary little-endian PLY file; every field of one component becomes a `float` property, one of
/// several components becomes several, `NAME_0` and so on. Coordinates are `double`, mm.
///
/// # Errors
/// [`WriteError`] for a field of the wrong length or a name that occurs twice.
pub fn encode(surface: &TriMesh, fields: &[Field]) -> Result<Vec<u8>, WriteError> {
    check_fields(fields, surface.nodes_mm.len(), &["x", "y", "z"])?;
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment mm, SPACE=RAS\nelement vertex {}\n\
         property double x\nproperty double y\nproperty double z\n",
        surface.nodes_mm.len()
    );
    for field in fields {
        let name = plain_name(&field.name);
        for component in 0..field.components {
            let name = if field.components == 1 { name.clone() } else { format!("{name}_{component}") };
            super::line(&mut header, format_args!("property float {name}"));
        }
    }
    super::line(&mut header, format_args!("element face {}", surface.triangles.len()));
    header += "property list uchar int vertex_indices\nend_header\n";
    let mut bytes = header.into_bytes();
    for (n, node) in surface.nodes_mm.iter().enumerate() {
        bytes.extend(node.iter().flat_map(|x| x.to_le_bytes()));
        for field in fields {
            let values = &field.values[n * field.components..(n + 1) * field.components];
            bytes.extend(values.iter().flat_map(|&v| (v as f32).to_le_bytes()));
        }
    }
    for triangle in &surface.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|&n| (n as i32).to_le_bytes()));
    }
    Ok(bytes)
}
