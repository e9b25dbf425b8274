//! Readers of mesh files on bytes nobody meant to write: an answer or an error, never a panic.

use crate::mesh_files::box_mesh;
use hgm::mesh::TriMesh;
use hgm::mesh::format::{Field, gifti, msh, vtu};
use proptest::prelude::*;
use std::sync::LazyLock;

/// One valid file per format, and one of VTU as text, whose numbers a mutation can reach.
fn valid() -> Vec<Vec<u8>> {
    let mesh = box_mesh(2, 10.0);
    let (surface, _) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true));
    let field = Field::scalar("w", vec![0.25; mesh.nodes_mm().len()]);
    let text = br#"<VTKFile type="UnstructuredGrid" byte_order="LittleEndian"><UnstructuredGrid>
<Piece NumberOfPoints="4" NumberOfCells="1"><Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">
0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points><Cells><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3
</DataArray><DataArray type="Int32" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="appended" offset="0"/></Cells>
<CellData><DataArray type="Int32" Name="label" format="ascii">3</DataArray></CellData>
</Piece></UnstructuredGrid><AppendedData encoding="raw">_"#;
    let mut appended = text.to_vec();
    appended.extend([1, 0, 0, 0, 10]);
    appended.extend(b"</AppendedData></VTKFile>");
    assert!(vtu::decode(&appended, "valid.vtu").is_ok());
    vec![
        appended,
        vtu::encode(&mesh, std::slice::from_ref(&field), &[]).unwrap(),
        msh::encode(&mesh).unwrap(),
        gifti::encode_surface(&surface, gifti::Space::Mni152, "pial"),
        gifti::encode_shape(mesh.nodes_mm().len(), &[field]).unwrap(),
    ]
}

fn read_as_all(bytes: &[u8]) {
    // What comes out is checked by the types; what must not come is a panic or an endless loop.
    let _ = vtu::decode(bytes, "x.vtu");
    let _ = msh::decode(bytes, "x.msh");
    let _ = gifti::decode_surface(bytes, "x.surf.gii");
    let _ = gifti::decode_shape(bytes, "x.shape.gii");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_mesh_files_do_not_bring_the_readers_down(
        which in 0usize..5,
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![
            any::<u8>().prop_map(|b| vec![b]),
            "[0-9]{1,20}".prop_map(String::into_bytes),
            "-1|nan|inf|\\$End|<|/>|\"|_|1e308".prop_map(String::into_bytes),
        ]), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        static VALID: LazyLock<Vec<Vec<u8>>> = LazyLock::new(valid);
        let mut bytes = VALID[which].clone();
        for (at, with) in changes {
            let at = at.index(bytes.len());
            let end = (at + with.len()).min(bytes.len());
            bytes.splice(at..end, with);
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        read_as_all(&bytes);
    }

    #[test]
    fn arbitrary_bytes_do_not_bring_the_readers_down(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        read_as_all(&bytes);
    }
}
