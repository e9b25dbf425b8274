//! How loads over tetrahedra and facets are shared among their nodes.

use crate::mesh::TetMesh;

/// The nodes that loads are shared among: the corners, or corners and mid-edge nodes of quadratic tetrahedra.
pub(super) struct Sharing<'a> {
    pub mesh: &'a TetMesh,
    pub quadratic: Option<Quadratic<'a>>,
    /// Weight goes where a lumped mass is, so that a free body falls as one.
    pub lumped: bool,
}

/// Quadratic connectivity and the sorted ends of the mid-edge nodes.
type Quadratic<'a> = (&'a [[u32; 10]], &'a [[u32; 2]]);

impl Sharing<'_> {
    /// Integrals of the shape functions over a tetrahedron of volume 1: a quarter each, or -1/20 at corners and 1/5 at
    /// mid-edges (1/36 and 4/27 for a lumped mass).
    pub(super) fn of_tet(&self, tet: usize) -> Vec<(u32, f64)> {
        match self.quadratic {
            None => self.mesh.tets()[tet].iter().map(|&n| (n, 0.25)).collect(),
            Some((tets, _)) => {
                let [corner, middle] = if self.lumped { [1.0 / 36.0, 4.0 / 27.0] } else { [-0.05, 0.2] };
                tets[tet].iter().enumerate().map(|(k, &n)| (n, if k < 4 { corner } else { middle })).collect()
            }
        }
    }

    /// The same over a facet of area 1: a third at each corner, or at each mid-edge.
    pub(super) fn of_facet(&self, facet: [u32; 3]) -> [u32; 3] {
        let Some((_, edges)) = self.quadratic else { return facet };
        let corners = self.mesh.nodes_mm().len();
        [[0, 1], [1, 2], [2, 0]].map(|[a, b]| {
            let edge = [facet[a].min(facet[b]), facet[a].max(facet[b])];
            (corners + edges.binary_search(&edge).unwrap_or(0)) as u32
        })
    }

    pub(super) fn nodes(&self) -> usize {
        self.mesh.nodes_mm().len() + self.quadratic.map_or(0, |(_, edges)| edges.len())
    }
}
