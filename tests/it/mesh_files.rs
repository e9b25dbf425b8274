//! Mesh files against the readers and writers of other people.

use crate::python::python;
use hgm::mesh::TetMesh;
use hgm::mesh::format::{Field, vtu};
use std::path::Path;

/// The unit cube cut into `n`^3 small cubes of six tetrahedra, in mm around the origin of a head: label 2 for x < 0,
/// else 3; the floor as node set `base`, the facets between the labels as facet set `falx`.
pub fn box_mesh(n: u32, edge_mm: f64) -> TetMesh {
    let number = |i: u32, j: u32, k: u32| (k * (n + 1) + j) * (n + 1) + i;
    let mut nodes = Vec::new();
    for k in 0..=n {
        for j in 0..=n {
            for i in 0..=n {
                nodes.push([i, j, k].map(|c| (f64::from(c) / f64::from(n) - 0.5) * edge_mm));
            }
        }
    }
    // Kuhn's triangulation: one tetrahedron per order in which the axes are walked.
    let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]];
    let (mut tets, mut labels) = (Vec::new(), Vec::new());
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                for (o, order) in orders.iter().enumerate() {
                    let mut at = [i, j, k];
                    let mut tet = [number(i, j, k); 4];
                    for (step, &axis) in order.iter().enumerate() {
                        at[axis] += 1;
                        tet[step + 1] = number(at[0], at[1], at[2]);
                    }
                    if o >= 3 {
                        tet.swap(2, 3); // odd orders are left-handed
                    }
                    tets.push(tet);
                    labels.push(if 2 * i < n { 2 } else { 3 });
                }
            }
        }
    }
    let mut mesh = TetMesh::new(nodes, tets, labels).unwrap();
    mesh.set_nodes("base", (0..(n + 1) * (n + 1)).collect()).unwrap();
    let left = mesh.boundary_facets(|l| l == 2);
    let sheet = left.into_iter().filter(|f| f.iter().all(|&v| mesh.nodes_mm()[v as usize][0].abs() < 1e-9));
    mesh.facet_sets.insert("falx".into(), sheet.collect());
    mesh
}

fn sorted_facets(mesh: &TetMesh, set: &str) -> Vec<[u32; 3]> {
    let mut facets = mesh.facet_sets[set].clone();
    for facet in &mut facets {
        facet.sort_unstable();
    }
    facets.sort_unstable();
    facets
}

fn read(folder: &Path, file: &str) -> Vec<u8> {
    std::fs::read(folder.join(file)).unwrap()
}

#[test]
fn meshio_and_pyvista_read_our_vtu_and_we_read_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = box_mesh(12, 160.0);
    let u: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|p| [p[0] * 0.1, -p[1], p[2] * 1e-7]).collect();
    let fields = [Field::vector("displacement", &u), Field::scalar("rmse_mm", u.iter().map(|v| v[1]).collect())];
    let jacobian = Field::scalar("jacobian", (0..mesh.tets().len()).map(|t| 1.0 + t as f64 * 1e-6).collect());
    let ours = vtu::encode(&mesh, &fields, std::slice::from_ref(&jacobian)).unwrap();
    std::fs::write(folder.path().join("ours.vtu"), ours).unwrap();
    let said = python(
        folder.path(),
        r#"
import meshio, numpy as np, pyvista as pv, vtk
m = meshio.read("ours.vtu"); p = pv.read("ours.vtu")
assert np.array_equal(m.points, p.points), (m.points[:3], p.points[:3], p.points.dtype)
assert np.array_equal(m.cells_dict["tetra"], p.cells_dict[10]), (m.cells_dict, p.cells_dict)
assert np.array_equal(m.cell_data["label"][0], p.cell_data["label"]), p.cell_data["label"]
assert p.cell_data["label"].dtype.kind in "iu", p.cell_data["label"].dtype
for name in ("base", "displacement", "rmse_mm"):
    assert np.array_equal(m.point_data[name], p.point_data[name]), name
assert np.array_equal(m.cell_data["jacobian"][0], p.cell_data["jacobian"])
assert p.compute_cell_sizes().cell_data["Volume"].min() > 0
assert np.allclose(m.point_data["displacement"], m.points * [.1, -1, 1e-7], atol=1e-12)
for zlib in (0, 1):
    m.write(f"meshio{zlib}.vtu", file_format="vtu", binary=True, compression="zlib" if zlib else None)
m.write("meshio_text.vtu", file_format="vtu", binary=False)
for big in (0, 1):
    for mode in ("Ascii", "Binary", "Appended", "AppendedBase64"):
        for zlib in (0, 1):
            for words in (32, 64):
                w = vtk.vtkXMLUnstructuredGridWriter()
                w.SetInputData(p); w.SetFileName(f"vtk_{mode}_{zlib}_{words}_{big}.vtu")
                w.SetDataMode({"Ascii": 0, "Binary": 1}.get(mode, 2))
                w.SetEncodeAppendedData(mode == "AppendedBase64")
                w.SetCompressorType(1 if zlib else 0)
                w.SetHeaderType(words); w.SetByteOrder(0 if big else 1)
                assert w.Write()
# Triangles and vertices beside the tetrahedra, single precision, 32-bit numbers: what gmsh's exports look like.
tri = np.array([[0, 1, 14]], dtype=np.int32); tet = m.cells_dict["tetra"].astype(np.int32)
mixed = meshio.Mesh(m.points.astype(np.float32), [("vertex", np.array([[3]], dtype=np.int32)), ("triangle", tri), ("tetra", tet)],
    cell_data={"gmsh:physical": [np.array([7]), np.array([8]), m.cell_data["label"][0]]})
mixed.write("mixed.vtu", file_format="vtu")
print(len(m.cell_data["label"][0]))
"#,
    );
    assert_eq!(said.trim(), mesh.tets().len().to_string());

    let mut files = vec!["meshio0.vtu".to_owned(), "meshio1.vtu".into(), "meshio_text.vtu".into()];
    for mode in ["Ascii", "Binary", "Appended", "AppendedBase64"] {
        for variant in ["0_32_0", "0_64_0", "1_32_0", "1_64_0", "0_32_1", "1_64_1"] {
            files.push(format!("vtk_{mode}_{variant}.vtu"));
        }
    }
    for file in files {
        let back = vtu::decode(&read(folder.path(), &file), &file).unwrap();
        assert_eq!(back.mesh.tets(), mesh.tets(), "{file}");
        assert_eq!((back.mesh.labels(), &back.mesh.node_sets), (mesh.labels(), &mesh.node_sets), "{file}");
        assert_eq!(sorted_facets(&back.mesh, "falx"), sorted_facets(&mesh, "falx"), "{file}");
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0));
        assert!(close(back.mesh.nodes_mm().as_flattened(), mesh.nodes_mm().as_flattened()), "{file}");
        for field in &fields {
            assert!(close(&back.point_field(&field.name).unwrap().values, &field.values), "{file}: {}", field.name);
        }
        assert!(close(&back.cell_field("jacobian").unwrap().values, &jacobian.values), "{file}");
    }
    let mixed = vtu::decode(&read(folder.path(), "mixed.vtu"), "mixed.vtu").unwrap();
    assert_eq!((mixed.mesh.tets(), mixed.mesh.labels()), (mesh.tets(), mesh.labels()));
}
