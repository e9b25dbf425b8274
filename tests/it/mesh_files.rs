//! Mesh files against the readers and writers of other people.

use crate::python::python;
use hgm::mesh::format::{Field, feb, gifti, inp, msh, ply, pvd, stl, vtu};
use hgm::mesh::{TetMesh, TriMesh};
use std::collections::BTreeMap;
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

fn largest_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
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
        assert!((back.mesh.tets(), back.mesh.labels()) == (mesh.tets(), mesh.labels()), "{file}");
        assert!(back.mesh.node_sets == mesh.node_sets, "{file}");
        assert_eq!(sorted_facets(&back.mesh, "falx"), sorted_facets(&mesh, "falx"), "{file}");
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0));
        assert!(close(back.mesh.nodes_mm().as_flattened(), mesh.nodes_mm().as_flattened()), "{file}");
        for field in &fields {
            assert!(close(&back.point_field(&field.name).unwrap().values, &field.values), "{file}: {}", field.name);
        }
        assert!(close(&back.cell_field("jacobian").unwrap().values, &jacobian.values), "{file}");
    }
    let mixed = vtu::decode(&read(folder.path(), "mixed.vtu"), "mixed.vtu").unwrap();
    assert!((mixed.mesh.tets(), mixed.mesh.labels()) == (mesh.tets(), mesh.labels()));
}

/// Nodes of every set, by coordinates, as Python's readers see them: what survives any renumbering.
const MSH_READERS: &str = r#"
import gmsh, meshio, numpy as np
key = lambda points: sorted(map(tuple, np.asarray(points).reshape(-1, 3)))
m = meshio.read("ours.msh")
names = {tuple(v): k for k, v in m.field_data.items()}
assert [k for k, v in m.field_data.items() if v[1] == 3] == ["grey_matter", "white_matter"]
count = {}
for block, tags in zip(m.cells, m.cell_data["gmsh:physical"]):
    for tag in np.unique(tags):
        count[block.type, names.get((tag, {"tetra": 3, "triangle": 2, "vertex": 0}[block.type]))] = int((tags == tag).sum())
x = np.abs(m.points[m.cells_dict["triangle"]][..., 0]).max()
assert x < 1e-12, x
gmsh.initialize(); gmsh.option.setNumber("General.Terminal", 0); gmsh.open("ours.msh")
tags, xyz, _ = gmsh.model.mesh.getNodes()
assert key(xyz) == key(m.points)
types, elements, nodes = gmsh.model.mesh.getElements(3)
assert list(types) == [4] and gmsh.model.mesh.getElementQualities(elements[0], "volume").min() > 0
for dim, tag in gmsh.model.getPhysicalGroups():
    name = gmsh.model.getPhysicalName(dim, tag)
    n = sum(len(e) for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)
            for e in gmsh.model.mesh.getElements(dim, entity)[1])
    kind = {0: "vertex", 2: "triangle", 3: "tetra"}[dim]
    assert count[kind, name] == n, (kind, name, n, count)
    print(kind, name, n)
gmsh.write("gmsh_text.msh")
gmsh.option.setNumber("Mesh.Binary", 1); gmsh.write("gmsh_binary.msh")
gmsh.finalize()
m.write("meshio_binary.msh", file_format="gmsh"); m.write("meshio_text.msh", file_format="gmsh", binary=False)
# A mesh gmsh makes itself: ball in a box, second dimension kept, groups named.
gmsh.initialize(); gmsh.option.setNumber("General.Terminal", 0)
o = gmsh.model.occ
outer, inner = o.addBox(-30, -30, -30, 60, 60, 60), o.addSphere(0, 0, 0, 15)
o.fragment([(3, outer)], [(3, inner)]); o.synchronize()
ball, rest = sorted(gmsh.model.getEntities(3), key=lambda e: o.getMass(*e))
gmsh.model.addPhysicalGroup(3, [ball[1]], 4, "ventricle"); gmsh.model.addPhysicalGroup(3, [rest[1]], 2, "grey_matter")
wall = gmsh.model.getBoundary([ball], oriented=False)
gmsh.model.addPhysicalGroup(2, [w[1] for w in wall], 1, "ventricle wall")
gmsh.option.setNumber("Mesh.MeshSizeMax", 12); gmsh.model.mesh.generate(3)
gmsh.write("ball.msh"); gmsh.finalize()
"#;

#[test]
fn gmsh_and_meshio_read_our_msh_and_we_read_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let mut mesh = box_mesh(6, 120.0);
    // Sets that overlap must not take each other's elements.
    mesh.set_nodes("edge of base", (0..7).collect()).unwrap();
    std::fs::write(folder.path().join("ours.msh"), msh::encode(&mesh).unwrap()).unwrap();
    let said = python(folder.path(), MSH_READERS);
    let falx = mesh.facet_sets["falx"].len();
    for expected in
        ["vertex base 49", "vertex edge of base 7", &format!("triangle falx {falx}"), "tetra grey_matter 648"]
    {
        assert!(said.contains(expected), "{expected} is not in\n{said}");
    }
    for file in ["gmsh_text.msh", "gmsh_binary.msh"] {
        let back = msh::decode(&read(folder.path(), file), file).unwrap();
        // gmsh writes sixteen digits, one short of the whole number.
        assert!(largest_difference(back.nodes_mm(), mesh.nodes_mm()) < 1e-12, "{file}");
        assert!((back.tets(), back.labels()) == (mesh.tets(), mesh.labels()), "{file}");
        assert_eq!(sorted_facets(&back, "falx"), sorted_facets(&mesh, "falx"), "{file}");
        for set in ["base", "edge of base"] {
            assert_eq!(back.node_sets[set], mesh.node_sets[set], "{file}: {set}");
        }
    }
    // meshio numbers nodes anew and writes only those groups that own nodes: the labels.
    for file in ["meshio_text.msh", "meshio_binary.msh"] {
        let back = msh::decode(&read(folder.path(), file), file).unwrap();
        let sorted = |m: &TetMesh| {
            let mut labels = m.labels().to_vec();
            labels.sort_unstable();
            labels
        };
        assert!(sorted(&back) == sorted(&mesh), "{file}");
    }
    let ball = msh::decode(&read(folder.path(), "ball.msh"), "ball.msh").unwrap();
    let volume = |label: u8| -> f64 {
        (0..ball.tets().len()).filter(|&t| ball.labels()[t] == label).map(|t| ball.volume_mm3(t)).sum()
    };
    assert!((volume(2) + volume(4) - 60f64.powi(3)).abs() < 1e-6);
    assert!(ball.node_sets["ventricle wall"].iter().all(|&n| {
        let [x, y, z] = ball.nodes_mm()[n as usize];
        (x.hypot(y).hypot(z) - 15.0).abs() < 1e-9
    }));
    assert_eq!(ball.boundary_facets(|l| l == 4).len(), ball.facet_sets["ventricle wall"].len());
}

#[test]
fn meshio_reads_our_abaqus_input_and_the_feb_file_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = box_mesh(4, 100.0);
    std::fs::write(folder.path().join("ours.inp"), inp::encode(&mesh).unwrap()).unwrap();
    let grey = feb::Elastic { young_modulus_pa: 3973.0, ..feb::Elastic::default() };
    std::fs::write(folder.path().join("ours.feb"), feb::encode(&mesh, &BTreeMap::from([(2, grey)])).unwrap()).unwrap();
    std::fs::write(folder.path().join("ours.vtu"), vtu::encode(&mesh, &[], &[]).unwrap()).unwrap();
    python(
        folder.path(),
        r#"
import meshio, numpy as np
import xml.etree.ElementTree as ET
v, a = meshio.read("ours.vtu"), meshio.read("ours.inp")
tets = v.cells_dict["tetra"]
assert np.array_equal(v.points, a.points) and np.array_equal(tets, a.cells_dict["tetra"])
label = v.cell_data["label"][0]
sets = {name: np.concatenate([np.atleast_1d(s).astype(int) for s in s_]) for name, s_ in a.cell_sets.items()}
assert np.array_equal(sets["grey_matter"], np.flatnonzero(label == 2)), sets
assert np.array_equal(sets["white_matter"], np.flatnonzero(label == 3))
assert np.array_equal(np.sort(a.point_sets["base"]), np.flatnonzero(v.point_data["base"]))
# Abaqus faces of *SURFACE, by the book.
faces = {"S1": [0, 1, 2], "S2": [0, 3, 1], "S3": [1, 3, 2], "S4": [2, 3, 0]}
text = open("ours.inp").read().split("*SURFACE, TYPE=ELEMENT, NAME=falx\n")[1].split("*")[0]
falx = {tuple(sorted(tets[int(t) - 1][faces[f.strip()]])) for t, f in (row.split(",") for row in text.split("\n") if row)}
assert len(falx) == 32 and all(abs(v.points[list(f), 0]).max() < 1e-9 for f in falx)

root = ET.parse("ours.feb").getroot()
assert root.tag == "febio_spec" and root.attrib["version"] == "4.0"
assert [c.tag for c in root] == ["Module", "Material", "Mesh", "MeshDomains"]
materials = {m.attrib["name"]: m for m in root.find("Material")}
assert [m.attrib["id"] for m in materials.values()] == ["1", "2"]
assert np.isclose(float(materials["grey_matter"].find("E").text), 3973e-6)
assert np.isclose(float(materials["grey_matter"].find("density").text), 1e-9)
assert float(materials["white_matter"].find("v").text) < .5
mesh = root.find("Mesh")
nodes = np.array([[float(x) for x in n.text.split(",")] for n in mesh.find("Nodes")])
assert np.array_equal(nodes, v.points)
assert [int(n.attrib["id"]) for n in mesh.find("Nodes")] == list(range(1, len(nodes) + 1))
seen = {}
for part in mesh.findall("Elements"):
    assert part.attrib["type"] == "tet4"
    for e in part:
        seen[int(e.attrib["id"])] = (part.attrib["name"], [int(n) - 1 for n in e.text.split(",")])
assert sorted(seen) == list(range(1, len(tets) + 1))
assert all(np.array_equal(seen[t + 1][1], tets[t]) for t in range(len(tets)))
assert all((seen[t + 1][0] == "grey_matter") == (label[t] == 2) for t in range(len(tets)))
domains = {d.attrib["name"]: d.attrib["mat"] for d in root.find("MeshDomains")}
assert set(domains) == {p.attrib["name"] for p in mesh.findall("Elements")} and set(domains.values()) <= set(materials)
sets = {s.attrib["name"]: [int(n) - 1 for n in s.text.split(",")] for s in mesh.findall("NodeSet")}
assert np.array_equal(sets["base"], np.flatnonzero(v.point_data["base"]))
surface = {tuple(sorted(int(n) - 1 for n in f.text.split(","))) for f in mesh.find("Surface[@name='falx']")}
assert surface == falx
"#,
    );
}

#[test]
fn surfaces_are_read_by_nibabel_and_pyvista_where_we_put_them() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = box_mesh(5, 140.0);
    let (surface, _) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true));
    let rmse = Field::scalar("rmse_mm", surface.nodes_mm.iter().map(|p| p[2] / 8.0).collect());
    let write = |file: &str, bytes: Vec<u8>| std::fs::write(folder.path().join(file), bytes).unwrap();
    write("x.surf.gii", gifti::encode_surface(&surface, gifti::Space::Mni152, "pial & <cut>"));
    write("x.shape.gii", gifti::encode_shape(surface.nodes_mm.len(), std::slice::from_ref(&rmse)).unwrap());
    write("x.stl", stl::encode(&surface));
    write("x.ply", ply::encode(&surface, std::slice::from_ref(&rmse)).unwrap());
    write("x.pvd", pvd::encode(&[(0.0, "a.vtu"), (2.5, "b.vtu")]));
    write("a.vtu", vtu::encode(&mesh, &[], &[]).unwrap());
    write("b.vtu", vtu::encode(&mesh, &[], &[]).unwrap());
    python(
        folder.path(),
        r#"
import meshio, nibabel as nib, numpy as np, pyvista as pv
g, s = nib.load("x.surf.gii"), nib.load("x.shape.gii")
points, triangles = g.agg_data()
assert g.darrays[0].coordsys.dataspace in (4, "NIFTI_XFORM_MNI_152"), g.darrays[0].coordsys.dataspace
assert np.allclose(g.darrays[0].coordsys.xform, np.eye(4))
assert g.darrays[0].meta["AnatomicalStructureSecondary"] == "pial & <cut>"
assert np.allclose(s.agg_data(), points[:, 2] / 8, atol=1e-5) and s.darrays[0].meta["Name"] == "rmse_mm"
p = points[triangles].astype(float)
volume = lambda p: np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6
assert np.isclose(volume(p), 140 ** 3)
ply, stl = pv.read("x.ply"), pv.read("x.stl")
assert np.abs(ply.points - points).max() < 1e-5 and np.array_equal(ply.regular_faces, triangles)
assert np.allclose(meshio.read("x.ply").point_data["rmse_mm"], s.agg_data())
assert ply.is_manifold and np.isclose(ply.volume, 140 ** 3)
assert stl.n_cells == len(triangles) and np.isclose(stl.volume, 140 ** 3)
r = pv.PVDReader("x.pvd")
assert r.time_values == [0, 2.5] and r.read()[0].n_points == 216
for encoding, name in ((1, "ascii"), (2, "base64"), (3, "gzip")):
    for d in g.darrays: d.encoding = encoding
    nib.save(g, f"nib_{name}.surf.gii")
"#,
    );
    let close = |back: &TriMesh| {
        back.triangles == surface.triangles && largest_difference(&back.nodes_mm, &surface.nodes_mm) < 1e-5
    };
    for file in ["x.surf.gii", "nib_ascii.surf.gii", "nib_base64.surf.gii", "nib_gzip.surf.gii"] {
        assert!(close(&gifti::decode_surface(&read(folder.path(), file), file).unwrap()), "{file}");
    }
}
