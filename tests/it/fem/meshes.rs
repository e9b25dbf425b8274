//! Meshes that the cases need, made of hexahedra split into six tetrahedra.

use hgm::mesh::TetMesh;

/// Corners of a hexahedron in VTK order -> its six tetrahedra.
const SPLIT: [[usize; 4]; 6] = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]];

/// `cells` hexahedra along each axis, mapped by `place` from the unit cube to mm; all cells labelled 2.
pub fn block(cells: [usize; 3], place: impl Fn([f64; 3]) -> [f64; 3]) -> TetMesh {
    let number = |i: usize, j: usize, k: usize| (i + (cells[0] + 1) * (j + (cells[1] + 1) * k)) as u32;
    let mut nodes = Vec::new();
    for k in 0..=cells[2] {
        for j in 0..=cells[1] {
            for i in 0..=cells[0] {
                let at = [i as f64 / cells[0] as f64, j as f64 / cells[1] as f64, k as f64 / cells[2] as f64];
                nodes.push(place(at));
            }
        }
    }
    let mut tets = Vec::new();
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                let corners = [
                    number(i, j, k),
                    number(i + 1, j, k),
                    number(i + 1, j + 1, k),
                    number(i, j + 1, k),
                    number(i, j, k + 1),
                    number(i + 1, j, k + 1),
                    number(i + 1, j + 1, k + 1),
                    number(i, j + 1, k + 1),
                ];
                tets.extend(SPLIT.map(|tet| tet.map(|c| corners[c])));
            }
        }
    }
    let labels = vec![2; tets.len()];
    TetMesh::new(nodes, tets, labels).unwrap()
}

/// A cube of `edge_mm` with the node sets x0, x1, y0, y1, z0, z1 (its faces).
pub fn cube(cells: usize, edge_mm: f64) -> TetMesh {
    let mut mesh = block([cells; 3], |x| x.map(|v| v * edge_mm));
    name_faces(&mut mesh, edge_mm);
    mesh
}

fn name_faces(mesh: &mut TetMesh, edge_mm: f64) {
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        for (end, value) in [("0", 0.0), ("1", edge_mm)] {
            let on = |n: &u32| (mesh.nodes_mm()[*n as usize][axis] - value).abs() < 1e-9 * edge_mm;
            let nodes = (0..mesh.nodes_mm().len() as u32).filter(on).collect();
            mesh.set_nodes(&format!("{name}{end}"), nodes).unwrap();
        }
    }
}

/// The same cube with its upper half (z) labelled 3.
pub fn two_tissue_cube(cells: usize, edge_mm: f64) -> TetMesh {
    let mesh = cube(cells, edge_mm);
    let upper = |tet: &[u32; 4]| tet.iter().map(|&n| mesh.nodes_mm()[n as usize][2]).sum::<f64>() > 2.0 * edge_mm;
    let labels = mesh.tets().iter().map(|t| if upper(t) { 3 } else { 2 }).collect();
    let mut two = TetMesh::new(mesh.nodes_mm().to_vec(), mesh.tets().to_vec(), labels).unwrap();
    name_faces(&mut two, edge_mm);
    two
}
