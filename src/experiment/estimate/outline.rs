//! A body's outline, moved out or in.

use crate::mesh::{ClosestPoint, TetMesh, TriMesh};
use crate::tag::{MARGIN, VENTRICLE};
use nalgebra::Vector3;

/// What lies farther than this from what is moved stays where it is, mm.
pub(super) const REACH_MM: f64 = 10.0;

/// What a body ends at, walls of a ventricle or a cavity apart.
pub(super) struct Surface {
    outside: TriMesh,
    tree: ClosestPoint,
    /// Outward, one a node of the outside.
    normals: Vec<Vector3<f64>>,
}

impl Surface {
    /// `None` for a body without an outside.
    pub fn new(mesh: &TetMesh) -> Option<Self> {
        let facets = mesh.outside_without(&[VENTRICLE, MARGIN]);
        let (outside, nodes) = TriMesh::from_facets(mesh.nodes_mm(), &facets);
        let normals = mesh.node_normals_mm2(&facets);
        let normals = nodes.into_iter().map(|n| normals[n as usize].normalize()).collect();
        Some(Self { tree: ClosestPoint::new(&outside)?, outside, normals })
    }

    /// The mesh with its outline moved outwards by so many mm, what lies below it by less the deeper it lies; `None` where that
    /// turns a tetrahedron inside out.
    pub fn moved(&self, mesh: &TetMesh, by_mm: impl Fn(Vector3<f64>) -> f64) -> Option<TetMesh> {
        let corner = |n: u32| Vector3::from(self.outside.nodes_mm[n as usize]);
        let to = |x: [f64; 3]| -> [f64; 3] {
            let hit = self.tree.find(x);
            let share = 1.0 - hit.distance_mm / REACH_MM;
            if share <= 0.0 {
                return x;
            }
            // From corner to corner the normal turns smoothly.
            let near = |n: u32| 1.0 / ((corner(n) - hit.point_mm.coords).norm() + 1e-9);
            let corners = self.outside.triangles[hit.triangle as usize];
            let normal: Vector3<f64> = corners.iter().map(|&n| self.normals[n as usize] * near(n)).sum();
            let out = normal.try_normalize(1e-12).unwrap_or_else(Vector3::zeros);
            (Vector3::from(x) + out * (share * by_mm(hit.point_mm.coords))).into()
        };
        mesh.clone().moved(to).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    fn volume_mm3(mesh: &TetMesh) -> f64 {
        (0..mesh.tets().len()).map(|t| mesh.volume_mm3(t)).sum()
    }

    fn moved(mesh: &TetMesh, by_mm: f64) -> TetMesh {
        Surface::new(mesh).unwrap().moved(mesh, |_| by_mm).unwrap()
    }

    #[test]
    fn an_outline_moved_out_encloses_what_it_has_swept() {
        let mesh = block(8);
        let step = 0.1;
        let area: f64 = {
            let (surface, _) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true));
            let at = |n: u32| Vector3::from(surface.nodes_mm[n as usize]);
            surface.triangles.iter().map(|t| 0.5 * (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0]))).norm()).sum()
        };
        let swept = volume_mm3(&moved(&mesh, step)) - volume_mm3(&mesh);
        // Edges and corners move along their mean normals: less than the faces beside them.
        assert!((0.75..1.0).contains(&(swept / (area * step))), "{swept} of {}", area * step);
        let back = volume_mm3(&moved(&mesh, -step)) - volume_mm3(&mesh);
        assert!((swept + back).abs() < 0.05 * swept, "{swept} {back}");
        // The middle of the block lies deeper than the outline reaches.
        let moved = moved(&mesh, step);
        let deep =
            mesh.nodes_mm().iter().zip(moved.nodes_mm()).filter(|(a, _)| a.iter().all(|x| (12.0..28.0).contains(x)));
        assert!(deep.clone().count() > 0 && deep.into_iter().all(|(a, b)| a == b));
    }

    #[test]
    fn the_wall_of_a_ventricle_is_no_outline() {
        let mut mesh = block(4);
        let floor: Vec<[u32; 3]> = mesh
            .boundary_facets(|_| true)
            .into_iter()
            .filter(|facet| facet.iter().all(|&n| mesh.nodes_mm()[n as usize][2] < 1e-9))
            .collect();
        assert!(!floor.is_empty());
        mesh.facet_sets.insert(VENTRICLE.to_owned(), floor);
        let moved = moved(&mesh, 0.5);
        let change = |n: usize| mesh.nodes_mm()[n][2] - moved.nodes_mm()[n][2];
        let inner =
            |n: usize| mesh.nodes_mm()[n][2] < 1e-9 && (0..2).all(|a| (12.0..28.0).contains(&mesh.nodes_mm()[n][a]));
        let floor: Vec<usize> = (0..mesh.nodes_mm().len()).filter(|&n| inner(n)).collect();
        assert!(!floor.is_empty() && floor.into_iter().all(|n| change(n).abs() < 1e-12));
    }
}
